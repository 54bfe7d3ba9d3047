"""Measures of users' own classes, minimised over the placements of an assembly's bodies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.methods.newton.batches import OBJECTIVE, Angle, Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.own_rows import quadratic_model
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import System
from wholebody.methods.newton.task_batches import RootMotion
from wholebody.scene.scene import Scene
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Measure
from wholebody.tasks.checks import check_measure


class AssemblyObjective:
    """Rows whose squares model some measures: one for each degree of freedom of bodies and revolute joints.

    A measure f with gradient g and diagonal second derivative h is, to second order, a sum of squares of displacements
    from -g / h with the factors h / 2, as in `wholebody.methods.newton.measures`.
    """

    def __init__(
        self,
        measures: Iterable[Measure],
        scene: Scene,
        q: Array,
        bodies: Iterable[int],
        figures: Iterable[FigureBodies],
    ) -> None:
        """Resolve the measures on the assembly's scene at its posture q (nq,); `bodies` are those without figure."""
        self._state = scene.state(q)
        self._measures = [measure.resolve(scene, q) for measure in measures]
        joints = scene.model.joints
        free = [(body, int(joints[body + 1].idx_q), int(joints[body + 1].idx_v)) for body in bodies]
        self._angles: list[tuple[FigureBodies, slice, Angle, Indices]] = []
        for figure in figures:
            first = joints[figure.first + 1]
            rows, tangent = figure.distance(q[first.idx_q : first.idx_q + figure.model.nq])
            part = slice(int(first.idx_q), int(first.idx_q) + figure.model.nq)
            self._angles.append((figure, part, rows, int(first.idx_v) + tangent))
            free += [(figure.first + body, part.start + at, int(first.idx_v) + v) for body, at, v in figure.roots]
        self._free = [(RootMotion(body, "the measures"), at, v) for body, at, v in free]
        self._tangent = np.concatenate([*(np.arange(v, v + 6) for _, _, v in free), *(row[3] for row in self._angles)])
        self._stiffness = np.zeros(len(self._tangent))

    def batches(self) -> list[Batch]:
        """All rows, in the order of their factors."""
        found: list[Batch] = [*(motion for motion, _, _ in self._free), *(rows for _, _, rows, _ in self._angles)]
        for batch in found:
            batch.role = OBJECTIVE
        return found

    def value(self, q: Array) -> float:
        """The measures, with their weights, at a posture (nq,) of the assembly's scene."""
        state = self._state.update(q)
        return float(sum(term.weight * term.value(state) for term in self._measures))

    def renew(self, q: Array) -> None:
        """Model the measures at a posture (nq,) of the assembly's scene."""
        state = self._state.update(q)
        gradient, curvature = quadratic_model(self._measures, state)
        half = np.maximum(0.5 * curvature, REFINEMENT.least_stiffness)
        way = -0.5 * gradient / half
        for motion, at, v in self._free:
            motion.anchor(q[at : at + 7], way[v : v + 6])
        for figure, part, rows, tangent in self._angles:
            rows.bound = figure.angles_at(q[part]) + way[tangent]
        self._stiffness = REFINEMENT.stiffness * half[self._tangent]

    def enter(self, system: System) -> None:
        """Write the present factors into a system, whose residual is of the model before."""
        system.stiffness[system.objective] = self._stiffness
        system.renew(system.batches)


def checked(measure: Measure, scene: Scene, q: Array) -> Measure:
    """A measure of one's own whose gradient agrees with a central difference at a posture (nq,) of a scene."""
    instance(measure, Measure, "minimise: measure", "give an object of a subclass of wb.Measure")
    label = type(measure).__name__
    if not is_own(measure):
        raise InputError(f"minimise: {label} is of one figure's joints; give a measure of a class of your own")
    resolved, state = measure.resolve(scene, q), scene.state(q)
    check_measure("minimise", resolved, state)
    way = np.random.default_rng(0).normal(size=scene.model.nv)
    slope = float(resolved.gradient(state) @ way)
    ends = [resolved.value(state.update(pin.integrate(scene.model, q, step * way))) for step in (1e-6, -1e-6)]
    difference = (ends[0] - ends[1]) / 2e-6
    if not abs(slope - difference) <= 1e-4 * max(1.0, abs(difference)):
        raise InputError(
            f"minimise: along a motion of all bodies the gradient of {label} gives {slope:.6g}, and a central "
            f"difference of its value {difference:.6g}; correct the gradient"
        )
    return measure

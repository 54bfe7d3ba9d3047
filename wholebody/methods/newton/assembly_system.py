"""An assembly's equations during an iteration, with its contacts and the measures that it minimises."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.geometry.memory_views import placement_view
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_geometry import AssemblyFigure
from wholebody.methods.newton.batches import OBJECTIVE, Angle, Batch
from wholebody.methods.newton.feasibility import Projection, kkt_algebra, project
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.linear_algebra import QuasiDefinite
from wholebody.methods.newton.measures import refine
from wholebody.methods.newton.own_rows import quadratic_model
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import ActiveSystem, System, unit
from wholebody.methods.newton.task_batches import RootMotion
from wholebody.scene.scene import Scene
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Measure
from wholebody.tasks.checks import check_measure


class AssemblySystem(ActiveSystem):
    """An assembly's equations, renewed from state to state."""

    def __init__(
        self,
        held: Sequence[Batch],
        weight: Array,
        algebra: str,
        figures: Sequence[AssemblyFigure],
        to_scene: Callable[[Array], Array],
        revision: int,
        objective: AssemblyObjective | None = None,
    ) -> None:
        """Take constraints and weights (7 n,); `to_scene` gives the scene's posture (nq,) at variables (7 n,)."""
        super().__init__([*held, *(() if objective is None else objective.batches())], weight, algebra, figures)
        self._to_scene, self.revision, self.objective = to_scene, revision, objective
        self.own_terms = objective is not None
        self._nearest: tuple[System, QuasiDefinite] | None = None

    def among(self, scene: Scene, clearance: float) -> None:
        """Let the pairs of a scene of the bodies touch, at a distance of at least `clearance` metres."""
        if len(scene.pair_table.pairs):
            self.workspace = scene.workspace()
            data = pin.Data()  # without the tensors of a model's data, which grow with the cube of its freedoms
            data.oMi.extend([pin.SE3.Identity()] * self.workspace.model.njoints)
            self._find_contacts(np.full(len(scene.pair_table.pairs), clearance), self.workspace, data)

    def arrive(self, x: Array) -> bool:
        """Renew the contacts and the model of the measures at x; returns whether the pattern changed."""
        x = self.retract(x)
        if self.objective is None:
            return super().arrive(x)
        self.objective.renew(self._to_scene(x))
        changed = super().arrive(x)
        self.objective.enter(self.system)
        return changed

    def lowered(self, x: Array, tolerance: float, rounds: int = REFINEMENT.rounds) -> Array:
        """The variables (7 n,) after rounds that lower the measures along the equations, which hold at x."""
        objective = self.objective
        if objective is None:
            return x

        def value(here: Array) -> float:
            return objective.value(self._to_scene(here))

        return refine(self, x, value, tolerance=tolerance, rounds=rounds)[0]

    def nearest(self, x: Array, anchor: Array, tolerance: float, iterations: int) -> Projection:
        """The place nearest to the anchor from x (both (7 n,)); analysed once while the pattern stays."""
        if self._nearest is None or self._nearest[0] is not self.system:
            self._nearest = self.system, kkt_algebra(self.system)
        return project(self.system, self._nearest[1], x, anchor, tolerance=tolerance, iterations=iterations)

    def _projected(self, x: Array) -> Array:
        x = unit(x)
        for figure in self._figures:
            figure.retract(x)
        if self.contacts is not None:
            self.q = self._to_scene(x)
            self._place(x)
        return x

    def _place(self, x: Array) -> None:
        """Write the placements of the bodies at x (7 n,) into the data."""
        bodies, joints = x.reshape(-1, 7), placement_view(self._data.oMi)
        if joints is None:
            for number, body in enumerate(bodies):
                self._data.oMi[number + 1] = pin.XYZQUATToSE3(body)
            return
        joints[1:, 3] = bodies[:, :3]
        for axis, unit_vector in enumerate(np.eye(3)):
            joints[1:, axis] = quat.rotate(bodies[:, 3:], np.broadcast_to(unit_vector, (len(bodies), 3)))


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

"""An assembly's equations during an iteration, with its contacts and the measures that it minimises."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.geometry.memory_views import placement_view
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_geometry import AssemblyFigure
from wholebody.methods.newton.batches import Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.measures import Objective, Refined, refine
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import ActiveSystem, unit
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
        objective: Objective | None = None,
    ) -> None:
        """Take constraints and weights (7 n,); `to_scene` gives the scene's posture (nq,) at variables (7 n,)."""
        super().__init__([*held, *(() if objective is None else objective.batches())], weight, algebra, figures)
        self._to_scene, self.revision, self.objective = to_scene, revision, objective
        self.own_terms = objective is not None

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

        return refine(self, x, value, tolerance=tolerance, rounds=rounds).x

    def nearest(self, x: Array, anchor: Array, tolerance: float, rounds: int) -> Refined:
        """The place (7 n,) nearest to the anchor, from x, where the equations hold (eq. 1)."""

        def value(here: Array) -> float:
            return float(0.5 * (self._weight * (here - anchor)) @ (here - anchor))

        return refine(self, x, value, tolerance=tolerance, rounds=rounds, anchor=anchor)

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


def objective_of(
    measures: Iterable[Measure], scene: Scene, q: Array, bodies: Iterable[int], figures: Iterable[FigureBodies]
) -> Objective:
    """Rows of measures, resolved on an assembly's scene at its posture q (nq,); `bodies` are those without figure."""

    def placed(body: int) -> tuple[int, int]:
        joint = scene.model.joints[body + 1]
        return int(joint.idx_q), int(joint.idx_v)

    parts = [(figure, *placed(figure.first)) for figure in figures]
    free = [(body, *placed(body)) for body in bodies]
    free += [(figure.first + k, at + own_at, v + own_v) for figure, at, v in parts for k, own_at, own_v in figure.roots]
    return Objective(scene.state(q), q, parts, free, [measure.resolve(scene, q) for measure in measures])


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

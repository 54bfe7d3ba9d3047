"""An assembly's goals, its equations during an iteration with contacts and measures, and its answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, brief
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.memory_views import placement_view
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_geometry import AssemblyFigure
from wholebody.methods.newton.batches import Batch, EquationSet, Role
from wholebody.methods.newton.feasibility import FeasibilityResult
from wholebody.methods.newton.measures import Objective, refine
from wholebody.methods.newton.system import ActiveSystem, System, unit
from wholebody.scene.moving_obstacles import Collision
from wholebody.scene.scene import Scene
from wholebody.solution import Status
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Measure
from wholebody.tasks.checks import check_measure
from wholebody.tasks.inputs import point, target_placement, target_rotation

Kind = Literal["point", "frame", "orientation"]
"""What a goal places."""


@dataclass(frozen=True)
class AssemblySolution:
    """The solution of an assembly.

    Attributes:
        placements: name to pin.SE3.
        status: "solved", "unreachable" (goals missed, all joints hold), "infeasible" (joints cannot all hold; the least
            residual) or "stalled".
        goal_error: largest distance [m] or angle [rad] of a goal from its target, as `Assembly.goal_error` says it.
        joint_error: largest distance [m] or angle [rad] by which a joint or constraint is open.
        residuals: largest error before each iteration and at the end.
        systems: linear systems solved.
        algebra: name of the factorisation.
        penetration: depth of the deepest overlap of the tested pairs at the end, metres; judged by coal for all pairs
            at once. 0 without shapes.
        least_distance: of the tested pairs, metres; inf without shapes.
        path: (k, nq) intermediate states as postures of the assembly's `scene`, the first as before the solve and the
            last as after it.
        message: one sentence that explains the status and names bodies.

    Examples:
        >>> answer = wb.Assembly().body("ball", (0.0, 0.0, 1.0)).point_goal("ball", (0.0, 0.0, 2.0)).solve()
        >>> answer.status, answer.placements["ball"].translation.round(6).tolist()
        ('solved', [0.0, 0.0, 2.0])
    """

    __repr__ = brief

    placements: dict[str, Any]
    status: Status
    goal_error: float
    joint_error: float
    residuals: tuple[float, ...]
    systems: int
    algebra: str
    penetration: float
    least_distance: float
    path: Array
    message: str

    @property
    def q(self) -> Array:
        """(nq,) the placements as a posture of the assembly's `scene`, which the viewer shows."""
        result: Array = self.path[-1]
        return result

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.residuals) - 1


class AssemblyStep(NamedTuple):
    """Answer of one frame of a drag."""

    # largest distance [m] or angle [rad] of a goal from its target, as `Assembly.goal_error` says it.
    goal_error: float
    joint_error: float  # largest distance [m] or angle [rad] by which a joint, a constraint or a contact is open
    iterations: int  # Newton iterations
    systems: int  # linear systems solved
    taken: bool  # whether the bodies moved there
    collisions: tuple[Collision, ...] = ()  # what things that move passed through, or are inside of; empty if nothing
    # shares of the frame, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty
    path: tuple[tuple[float, Array], ...] = ()


def explained(system: System, x: Array, found: FeasibilityResult, tolerance: float) -> tuple[Status, str]:
    """The status of a solve that ended at the variables x (7 n,), and the sentence that explains it."""
    if found.met:
        return "solved", f"solved in {found.iterations} iterations"
    hard = found.hard > tolerance
    status: Status = ("infeasible" if hard else "unreachable") if found.stationary else "stalled"
    counted = np.where(system.goal_groups == hard, 0.0, system.errors(system.residual(x)))
    worst = system.label(int(system.group_starts[counted.argmax()]))
    why = {"infeasible": "the joints cannot all hold", "unreachable": "all joints hold, the goals cannot"}
    missed = f"{worst} is missed by {counted.max():.3g} m or rad"
    return status, f"{why.get(status, 'ran out of iterations')}: {missed}"


@dataclass(frozen=True)
class AssemblyGoal:
    """A frame of a body, `local` in body `index`, and its goal (pin.SE3): a "point", an "orientation" or both."""

    label: str
    index: int
    local: Any
    target: Any
    kind: Kind

    def moved(self, target: Any) -> AssemblyGoal:
        """The same goal at another position, placement or orientation."""
        return replace(self, target=to_target(target, self.kind, self.label))

    def error(self, body: Any) -> Array:
        """(6,) metres and radians in the world, from where it is to the target; `body` is the body's placement."""
        here = body * self.local
        offset = np.zeros(3) if self.kind == "orientation" else self.target.translation - here.translation
        turn = np.zeros(3) if self.kind == "point" else pin.log3(self.target.rotation @ here.rotation.T)
        return np.concatenate([offset, turn])

    def between(self, body: Any, share: float) -> AssemblyGoal:
        """The goal at a fraction of the path from where it is now to the target."""
        error, here = self.error(body), body * self.local
        turned = pin.exp3(share * error[3:]) @ here.rotation
        return replace(self, target=pin.SE3(turned, here.translation + share * error[:3]))

    def enter(self, equations: EquationSet) -> None:
        """Add the goal's equations."""
        parts = self.kind != "orientation", self.kind != "point"
        equations.place(self.index, -1, self.label, (self.local, self.target), Role(weight=1.0), parts)


def to_target(target: Any, kind: Kind, where: str) -> Any:
    """A target as pin.SE3: a position, a placement, or an orientation."""
    if kind == "orientation":
        return target_rotation(target, where)
    return target_placement(target, where) if kind == "frame" else pin.SE3(np.eye(3), point(target, f"{where}: target"))


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
        super().__init__(held, weight, algebra, figures, objective)
        self._to_scene, self.revision = to_scene, revision
        self.own_terms = objective is not None or any(
            is_own(term) for one in figures for term in one.problem.constraints
        )

    def among(self, scene: Scene, clearance: float) -> None:
        """Let the pairs of a scene of the bodies touch, at a distance of at least `clearance` metres."""
        if len(scene.pair_table.pairs):
            self.workspace = scene.workspace()
            data = pin.Data()  # without the tensors of a model's data, which grow with the cube of its freedoms
            data.oMi.extend([pin.SE3.Identity()] * self.workspace.model.njoints)
            self._find_contacts(np.full(len(scene.pair_table.pairs), clearance), self.workspace, data)

    def posture(self, x: Array) -> Array:
        """The posture (nq,) of the scene at the variables (7 n,)."""
        return self._to_scene(x)

    def lowered(self, x: Array, tolerance: float) -> Array:
        """The variables (7 n,) after a round that lowers the measures along the equations, which hold at x."""
        return x if self.objective is None else refine(self, x, tolerance, 1).x

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


class OfFigure(Measure):
    """A measure of one figure's joints, at states of the scene of the assembly that the figure is in."""

    def __init__(self, measure: Measure, figure: AssemblyFigure) -> None:
        """Resolve the measure on the figure alone."""
        problem = figure.problem
        self._measure, self._state = measure.resolve(problem.scene, problem.start), State(figure.model)
        self._first = f"{figure.name}/{figure.names[0]}"

    @property
    def weight(self) -> float:  # noqa: D102
        return self._measure.weight

    def _alone(self, state: State) -> State:
        first = state.model.joints[state.model.getJointId(self._first)].idx_q
        return self._state.update(state.q[first : first + self._state.model.nq])

    def _among(self, own: Array, state: State) -> Array:
        """Numbers (nv,) of the figure's freedoms among those of all, which are 0."""
        result, first = np.zeros(state.model.nv), state.model.joints[state.model.getJointId(self._first)].idx_v
        result[first : first + len(own)] = own
        return result

    def value(self, state: State) -> float:  # noqa: D102
        return self._measure.value(self._alone(state))

    def gradient(self, state: State) -> Array:  # noqa: D102
        return self._among(self._measure.gradient(self._alone(state)), state)

    def curvature(self, state: State) -> Array:  # noqa: D102
        return self._among(self._measure.curvature(self._alone(state)), state)


def checked(measure: Measure, scene: Scene, q: Array) -> Measure:
    """A measure whose gradient agrees with a central difference at a posture (nq,) of a scene."""
    label = type(measure).__name__
    resolved, state = measure.resolve(scene, q), scene.state(q)
    check_measure("minimise", resolved, state)
    direction = np.random.default_rng(0).normal(size=scene.model.nv)
    slope = float(resolved.gradient(state) @ direction)
    ends = [resolved.value(state.update(pin.integrate(scene.model, q, step * direction))) for step in (1e-6, -1e-6)]
    difference = (ends[0] - ends[1]) / 2e-6
    if not abs(slope - difference) <= 1e-4 * max(1.0, abs(difference)):
        raise InputError(
            f"minimise: along a motion of all bodies the gradient of {label} gives {slope:.6g}, and a central "
            f"difference of its value {difference:.6g}; correct the gradient"
        )
    return measure

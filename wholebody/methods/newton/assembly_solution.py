"""Answers of an assembly: of a solve, and of one frame of a drag."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, brief
from wholebody.methods.newton.batches import EquationSet, Role
from wholebody.methods.newton.feasibility import FeasibilityResult
from wholebody.methods.newton.system import System
from wholebody.scene.moving_obstacles import Collision
from wholebody.solution import Status
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
        path: (k, nq) the states on the way as postures of the assembly's `scene`, the first as before the solve and the
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
        way = np.zeros(3) if self.kind == "orientation" else self.target.translation - here.translation
        turn = np.zeros(3) if self.kind == "point" else pin.log3(self.target.rotation @ here.rotation.T)
        return np.concatenate([way, turn])

    def between(self, body: Any, share: float) -> AssemblyGoal:
        """The goal at a share of the way from where it is now to the target."""
        error, here = self.error(body), body * self.local
        turned = pin.exp3(share * error[3:]) @ here.rotation
        return replace(self, target=pin.SE3(turned, here.translation + share * error[:3]))

    def enter(self, equations: EquationSet) -> None:
        """Add the goal's equations."""
        local, target = self.local, self.target
        ends = np.array(local.translation), np.array(target.translation)
        if self.kind != "orientation":
            equations.coincide(self.index, -1, self.label, *ends, Role(weight=1.0))
        if self.kind != "point":
            turns = pin.Quaternion(local.rotation), pin.Quaternion(target.rotation)
            equations.turn(self.index, -1, self.label, *turns, 3, Role(weight=1.0))


def to_target(target: Any, kind: Kind, where: str) -> Any:
    """A target as pin.SE3: a position, a placement, or an orientation."""
    if kind == "orientation":
        return target_rotation(target, where)
    return target_placement(target, where) if kind == "frame" else pin.SE3(np.eye(3), point(target, f"{where}: target"))

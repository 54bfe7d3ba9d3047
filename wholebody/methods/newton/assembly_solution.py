"""What an assembly answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.methods.newton.reaching import Reached
from wholebody.methods.newton.system import System
from wholebody.problem import Status


@dataclass(frozen=True)
class AssemblySolution:
    """Where the bodies of an assembly end.

    Attributes:
        placements: name to pin.SE3.
        status: "solved", "unreachable" (goals missed, all joints hold), "infeasible" (joints cannot all hold; the least
            residual) or "stalled".
        goal_error: largest goal error, metres or radians.
        joint_error: largest error of what must hold, metres or radians.
        residuals: largest error before each iteration and at the end.
        systems: linear systems solved.
        algebra: name of the factorisation.
        message: one sentence for a reader, with the bodies concerned.
    """

    placements: dict[str, Any]
    status: Status
    goal_error: float
    joint_error: float
    residuals: tuple[float, ...]
    systems: int
    algebra: str
    message: str

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.residuals) - 1


def answer(names: list[str], system: System, found: Reached, tolerance: float, algebra: str) -> AssemblySolution:
    """Put what an iteration found into words."""
    residual = system.residual(found.x)
    size = np.abs(np.where(system.inequality, np.minimum(residual, 0.0), residual))
    status: Status = "solved"
    message = f"solved in {found.iterations} iterations"
    if not found.met:
        hard = found.hard > tolerance
        status = ("infeasible" if hard else "unreachable") if found.stationary else "stalled"
        counted = np.where(system.goal == hard, 0.0, size)
        worst = system.label(int(counted.argmax()))
        why = {"infeasible": "the joints cannot all hold", "unreachable": "all joints hold, the goals cannot"}
        left = f"{worst} is missed by {counted.max():.3g} m or rad"
        message = f"{why.get(status, 'ran out of iterations')}: {left}"
    placements = {name: pin.XYZQUATToSE3(place) for name, place in zip(names, found.x.reshape(-1, 7), strict=True)}
    return AssemblySolution(
        placements, status, found.goal, found.hard, found.residuals, found.systems, algebra, message
    )

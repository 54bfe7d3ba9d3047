"""The solution of an assembly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.methods.newton.feasibility import reach
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.kkt import project
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.system import ActiveSystem, unit
from wholebody.solution import Status

FINEST = 1e-9  # least tolerance of the KKT system: redundant equations leave an error of about a tenth of it


@dataclass(frozen=True)
class AssemblySolution:
    """The solution of an assembly.

    Attributes:
        placements: name to pin.SE3.
        status: "solved", "unreachable" (goals missed, all joints hold), "infeasible" (joints cannot all hold; the least
            residual) or "stalled".
        goal_error: largest goal error, metres or radians.
        joint_error: largest error of a joint or constraint, metres or radians.
        residuals: largest error before each iteration and at the end.
        systems: linear systems solved.
        algebra: name of the factorisation.
        nearness: largest error of the KKT system before each iteration of `nearest` and at the end; empty
            without it. If the last is above the tolerance, the placements are near the start, but not the nearest.
        message: one sentence that explains the status and names bodies.
    """

    placements: dict[str, Any]
    status: Status
    goal_error: float
    joint_error: float
    residuals: tuple[float, ...]
    systems: int
    algebra: str
    nearness: tuple[float, ...]
    message: str

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.residuals) - 1


def solved(
    names: list[str],
    active_system: ActiveSystem,
    before: Array,
    *,
    tolerance: float,
    iterations: int,
    kind: Kind,
    nearest: QuasiDefinite | None,
) -> tuple[Array, AssemblySolution]:
    """Solve from the variables `before` (7 n,); where the bodies end, as variables and in words.

    With `nearest`, the factorisation of the system's KKT matrix, they end at the place nearest to `before`.
    """
    found = reach(active_system, before, tolerance=tolerance, iterations=iterations, kind=kind)
    system, x = active_system.system, found.x
    nearness: tuple[float, ...] = ()
    if nearest is not None and found.met:
        settled = project(system, nearest, x, before, tolerance=max(tolerance, FINEST), iterations=iterations)
        x, nearness = (unit(settled.x) if settled.met else x), settled.errors
    residual = system.residual(x)
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
    placements = {name: pin.XYZQUATToSE3(place) for name, place in zip(names, x.reshape(-1, 7), strict=True)}
    return x, AssemblySolution(
        placements=placements,
        status=status,
        goal_error=float(size[system.goal].max(initial=0.0)),
        joint_error=float(size[~system.goal].max(initial=0.0)),
        residuals=found.residuals,
        systems=found.systems,
        algebra=active_system.algebra.name,
        nearness=nearness,
        message=message,
    )

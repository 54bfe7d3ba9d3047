"""The solution of an assembly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.all_pairs import all_pairs
from wholebody.base.arrays import Array
from wholebody.methods.newton.assembly_system import AssemblySystem
from wholebody.methods.newton.feasibility import satisfy
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.kkt import project
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.system import unit
from wholebody.scene.scene import Scene
from wholebody.solution import Status

FINEST = 1e-9  # least tolerance of the KKT system: redundant equations leave an error of about a tenth of it


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
        nearness: largest error of the KKT system before each iteration of `nearest` and at the end; empty
            without it. If the last is above the tolerance, the placements are near the start, but not the nearest.
        penetration: depth of the deepest overlap of the tested pairs at the end, metres; judged by coal for all pairs
            at once. 0 without shapes.
        least_distance: of the tested pairs, metres; inf without shapes.
        path: (k, nq) the states on the way as postures of the assembly's `scene`, the first as before the solve and the
            last as after it.
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


def solved(
    names: Sequence[str],
    active_system: AssemblySystem,
    before: Array,
    *,
    tolerance: float,
    iterations: int,
    kind: Kind,
    nearest: QuasiDefinite | None,
    scene: Scene | None,
    to_scene: Callable[[Array], Array],
) -> tuple[Array, AssemblySolution]:
    """Solve from the variables `before` (7 n,); where the bodies end, as variables and in words.

    With `nearest`, the factorisation of the system's KKT matrix, they end at the place nearest to `before`.
    """
    found = satisfy(
        active_system,
        before,
        tolerance=tolerance,
        iterations=iterations,
        kind=kind,
        improve_goals=True,
        leave_saddles=True,
    )
    system, x = active_system.system, found.x
    nearness: tuple[float, ...] = ()
    if nearest is not None and found.met:
        settled = project(system, nearest, x, before, tolerance=max(tolerance, FINEST), iterations=iterations)
        x, nearness = (unit(settled.x) if settled.met else x), settled.errors
    residual = system.residual(x)
    joint_error, goal_error = system.largest_errors(residual)
    status: Status = "solved"
    message = f"solved in {found.iterations} iterations"
    if not found.met:
        hard = found.hard > tolerance
        status = ("infeasible" if hard else "unreachable") if found.stationary else "stalled"
        counted = np.where(system.goal_groups == hard, 0.0, system.errors(residual))
        worst = system.label(int(system.group_starts[counted.argmax()]))
        why = {"infeasible": "the joints cannot all hold", "unreachable": "all joints hold, the goals cannot"}
        left = f"{worst} is missed by {counted.max():.3g} m or rad"
        message = f"{why.get(status, 'ran out of iterations')}: {left}"
    least = np.inf
    if scene is not None:
        with all_pairs(scene.built).borrow() as pairs:
            pairs.move(to_scene(x))
            least = pairs.least
    path = active_system.path
    if not np.array_equal(path[-1], x):
        path = (*path, x)
    placements = {name: pin.XYZQUATToSE3(place) for name, place in zip(names, x.reshape(-1, 7), strict=True)}
    return x, AssemblySolution(
        placements=placements,
        status=status,
        goal_error=goal_error,
        joint_error=joint_error,
        residuals=found.residuals,
        systems=found.systems,
        algebra=active_system.algebra.name,
        nearness=nearness,
        penetration=max(0.0, -least),
        least_distance=least,
        path=np.array([to_scene(state) for state in path]),
        message=message,
    )

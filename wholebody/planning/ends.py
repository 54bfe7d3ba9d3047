"""Postures that meet goals, at which a motion may end."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array
from wholebody.methods.conclusion import meets
from wholebody.methods.control import BUDGET
from wholebody.methods.qp.method import QP
from wholebody.planning.local_planner import Geodesics
from wholebody.planning.sampling import Sampler
from wholebody.planning.smoothing import length
from wholebody.planning.tracked_motions import LocalPlanner
from wholebody.problem import Problem

ENDS = 8  # postures that meet goals; more = ends that are reached more easily, for a solve each
ALONG = (0.0, 0.4, 0.7, 0.9)  # of a path: where nearer ends are looked for; more = shorter paths, for a solve each

End = tuple[Array | None, str]  # a posture (nq,) at which a motion may end, None where goals were not met; and why


def answers(problem: Problem, sampler: Sampler) -> Iterator[End]:
    """Ends that meet the goals: that of the least measures, then those near random postures; or why there is none."""
    bare = _bare(problem)
    for number in range(ENDS):
        if number == 0:
            solution = QP().solve(problem)
        else:
            solution = QP(restarts=0, budget=0).solve(bare.with_start(sampler.near(problem.start, number / (ENDS - 1))))
        # Half of the ends are on any side of whole turns: things can block the nearest.
        near = problem.start if number < ENDS // 2 else sampler.anywhere()
        end = sampler.turned(solution.q, near) if solution.solved else None
        # a goal or a constraint on joint values may be met on one side of a whole turn alone
        if end is not None and not np.array_equal(end, solution.q) and not meets(assess(problem, end), QP().tolerance):
            end = solution.q
        yield end, solution.message


def nearer(problem: Problem, path: list[Array], local: LocalPlanner, sampler: Sampler) -> list[Array]:
    """A path to goals that ends where these are met near one of its postures, where that makes it shorter."""
    if not problem.goals or not isinstance(local, Geodesics):
        return path
    bare, model = _bare(problem), problem.scene.model
    for share in ALONG:
        place = int(share * (len(path) - 1))
        if BUDGET.over:
            break
        solution = QP(restarts=0, budget=0).solve(bare.with_start(path[place]))
        end = sampler.turned(solution.q, path[place])
        if solution.solved and meets(assess(problem, end), QP().tolerance):
            # m, rad: the motion to a nearer end is shorter
            shorter = local.joined(path[place], end, 0.98 * length(model, path[place:]))
            path = [*path[: place + 1], *shorter] if shorter else path
    return path


def _bare(problem: Problem) -> Problem:
    """The problem without measures, which lead most starts to one end."""
    result = problem.with_start(problem.start)
    result.measures = ()
    return result

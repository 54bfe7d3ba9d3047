"""Arms of seven joints whose posture of least effort is blocked, against descents of the whole problem."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import robots
from wholebody.methods.qp.along_branches import Along, Look
from wholebody.methods.starts import restarts


@pytest.mark.parametrize(
    ("arm", "kind", "seed"), [("panda", "shelf", 9), ("panda", "table", 10), ("iiwa7", "table", 10)]
)
def test_least_effort_is_where_a_clearance_is_only_just_kept(arm: str, kind: str, seed: int) -> None:
    """Quadratic programs from the witness and six random starts lead to no less; they took 15 to 100 ms, this 2."""
    problem, witness = robots.into(kind, robots.of_known.arms.index(arm), np.random.default_rng(seed), True)
    solution = wb.solve(problem)
    with problem.borrow() as workspace:
        starts = [witness, *restarts(problem, workspace.state, problem.start, np.random.default_rng(0), 6)]
    others = [found for found in wb.methods.QP().minima(problem, starts) if found.solved]
    least = min(found.assessment.measure for found in others)
    assert solution.solved
    assert not solution.programs
    assert solution.assessment.measure <= 1.0005 * least
    assert solution.assessment.least_distance <= problem.clearance + 1e-4  # what blocks it is only just not met


def test_ends_of_branches_that_come_below_nothing_are_not_sought_exactly(monkeypatch: pytest.MonkeyPatch) -> None:
    """This arm meets itself at its least effort; with every edge to the last digit it takes 74 looks, for no less."""
    problem, witness = robots.free(robots.of_known.arms.index("xarm7"), np.random.default_rng(126))
    looks, look = list[float](), Along._look

    def counted(along: Along, values: Array, held: float) -> Look | None:
        looks.append(held)
        return look(along, values, held)

    monkeypatch.setattr(Along, "_look", counted)
    solution = wb.solve(problem)
    with problem.borrow() as workspace:
        starts = [witness, *restarts(problem, workspace.state, problem.start, np.random.default_rng(0), 6)]
    others = [found for found in wb.methods.QP().minima(problem, starts) if found.solved]
    assert solution.assessment.measure <= 1.0005 * min(found.assessment.measure for found in others)
    assert 0 < len(looks) < 55

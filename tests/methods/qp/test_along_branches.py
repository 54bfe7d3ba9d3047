"""Arms of seven joints whose posture of least effort is blocked, against descents of the whole problem."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import robots
from wholebody.methods.qp.along_branches import Along, Look
from wholebody.methods.qp.chain_problem import chains_of, goal_entries, how_far
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


@pytest.mark.parametrize("seed", [126, 72174])
def test_ends_of_branches_that_come_below_nothing_are_not_sought(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """These arms meet themselves at their least effort; with every end looked at, the first takes 74 looks."""
    problem, witness = robots.free(robots.of_known.arms.index("xarm7"), np.random.default_rng(seed))
    looks, look = list[float](), Along._look

    def counted(along: Along, values: Array, effort: float) -> Look:
        looks.append(effort)
        return look(along, values, effort)

    monkeypatch.setattr(Along, "_look", counted)
    solution = wb.solve(problem)
    with problem.borrow() as workspace:
        starts = [witness, *restarts(problem, workspace.state, problem.start, np.random.default_rng(0), 6)]
    others = [found for found in wb.methods.QP().minima(problem, starts) if found.solved]
    assert solution.assessment.measure <= 1.0005 * min(found.assessment.measure for found in others)
    assert 0 < len(looks) < 20


def test_a_branch_is_followed_as_far_as_it_exists() -> None:
    """Its ends meet the goal by Pinocchio's kinematics, and a step of the held joint beyond the last one does not."""
    problem, _ = robots.free(robots.of_known.arms.index("panda"), np.random.default_rng(3))
    goal: Any = problem.goals[0]
    figure, place = problem.scene.figure, goal.residual.placement
    with chains_of(problem).borrow() as chains:
        chain = chains.carrying(goal_entries(problem) or [])
        assert chain is not None
        goals, nearest = chain.goals(goal_entries(problem) or []), np.array([problem.start, np.ones(7)])
        branches, asked, most = chain.branches(goals, nearest), how_far(wb.methods.QP(), 1), (0.0, np.inf, 40)
        order, ways = chain.downhill(branches, np.inf)
        assert (np.diff(ways[:, 1]) >= 0.0).all()
        ends, efforts = chain.along(goals, nearest, asked, branches.values[order], ways[:, 0].copy(), most)
        cut = 0
        for (first, last), effort, towards in zip(ends, efforts, ways[:, 0], strict=True):
            if effort[0] == np.inf:
                continue
            for q, own in ((first, effort[0]), (last, effort[1])):
                assert figure.placement(q, "tool").isApprox(place, 1e-6)
                assert own == pytest.approx(((q - problem.start) ** 2).sum())
            assert effort[1] <= effort[0]
            step = np.sign(towards - last[chain.held]) * 1e-3
            if abs(towards - last[chain.held]) > 1e-3 and effort[1] < effort[0]:
                beyond = last.copy()
                beyond[chain.held] += step
                on = chain.along(goals, nearest, asked, beyond[None], beyond[[chain.held]], most)[1]
                cut += 1
                assert on[0, 0] == np.inf or on[0, 0] >= effort[1]
        assert cut > 0


@pytest.mark.parametrize("clearance", [0.0, 0.003])
def test_the_pair_that_was_too_near_last_is_asked_first_and_no_answer_changes(clearance: float) -> None:
    """The sign of the least gap is that of coal over all pairs, whatever was asked before."""
    problem, _ = robots.free(robots.of_known.arms.index("xarm7"), np.random.default_rng(1))
    limits, clearances = problem.scene.figure.limits, np.full(len(problem.clearances), clearance)
    postures = np.random.default_rng(2).uniform(limits.lower, limits.upper, (80, 7))
    with problem.borrow() as workspace:
        gaps = [workspace.least_gap(q, clearances, clearance) for q in postures]
        short = [len(workspace.near(q, clearance).number) > 0 for q in postures]
    assert [gap < 0.0 for gap in gaps] == short
    assert 10 < sum(short) < 80

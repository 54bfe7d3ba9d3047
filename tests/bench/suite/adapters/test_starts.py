"""Methods that differ in their starts: the same method from one start, and from more within the same time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.adapters.starts import Restarted, movable, restarted, starts


@pytest.fixture(scope="module")
def shelf(standing_before: Callable[..., wb.Problem]) -> wb.Problem:
    """Return a person whose feet are held, with a board before the chest."""
    goal = wb.Point("right_index_tip", (0.4, -0.1, 1.2))
    return standing_before("board", (0.3, 0.8, 0.03), (0.45, 0.0, 1.0), goal)


def test_starts_keep_the_holds_and_are_free_of_overlap_and_differ(shelf: wb.Problem) -> None:
    model, found = shelf.scene.model, list(islice(starts(shelf), 8))
    moving = movable(shelf)
    assert 20 < moving.sum() < model.nv - 6
    for q in found:
        judged = wb.assess(shelf, q)
        assert judged.constraint_violation < 1e-9
        assert judged.penetration < 1e-4
        assert shelf.scene.figure.within_limits(q)
        move = pin.difference(model, shelf.start, q)
        assert not move[~moving].any()
        assert np.abs(move).max() > 0.1
    assert len({q.tobytes() for q in found}) == 8
    again = list(islice(starts(shelf), 8))
    assert all(np.array_equal(one, other) for one, other in zip(found, again, strict=True))


def test_more_starts_solve_what_one_does_not(planar_arm: Callable[..., wb.Figure]) -> None:
    # straight, and the goal on its line: the gradient is zero
    problem = wb.Problem(wb.Scene(planar_arm((0.5, 0.4, 0.3))), np.zeros(3), goals=[wb.Point("tip", (0.6, 0.0, 0.0))])
    one, many = adapters(["dls", "dls/starts"])
    assert not one.make(1e-4, None).solve(problem).solved
    solution = many.make(1e-4, None).solve(problem)
    assert solution.solved
    assert "starts" in solution.message
    assert solution.method == "dls/starts"


def test_where_nothing_helps_the_best_is_answered_within_the_time(planar_arm: Callable[..., wb.Figure]) -> None:
    problem = wb.Problem(wb.Scene(planar_arm((0.5, 0.4, 0.3))), np.array([0.5, 0.5, 0.5]), goals=[
        wb.Point("tip", (1.4, 0.0, 0.0))
    ])  # fmt: skip
    tried: list[int] = []

    def told(entry: wb.TraceEntry) -> None:
        tried.append(1)

    method = Restarted(wb.methods.DampedLeastSquares(tolerance=1e-4), lambda *_: None, seconds=0.05)
    solution = method.solve(problem, told)
    assert solution.status in ("unreachable", "stalled")
    assert solution.assessment.goal_error == pytest.approx(0.2, abs=5e-3)
    assert tried


def test_one_start_means_one(shelf: wb.Problem) -> None:
    qp, newton, ccd = (
        adapter.make(1e-4, None) for adapter in adapters([f"{n}/one_start" for n in ("qp", "newton", "ccd")])
    )
    assert (qp.restarts, qp.budget, newton.restarts, ccd.restarts) == (0, 0, 0, 0)  # type: ignore[attr-defined]
    for adapter in adapters(["qp/one_start", "ccd/one_start"]):
        more = restarted(adapter)
        assert more.name == adapter.name.replace("one_start", "starts")
        assert "Further starts" in more.setup


def test_methods_that_differ_in_starts_are_left_out_unless_they_are_asked_for() -> None:
    few, all_ = [adapter.name for adapter in adapters()], [adapter.name for adapter in adapters(starts=True)]
    assert "qp" in few
    assert not any(name.endswith(("/one_start", "/starts")) for name in few)
    assert {"qp/one_start", "dls/starts"} <= set(all_)
    assert set(few) <= set(all_)
    every = [adapter.name for adapter in adapters(["all"], starts=True)]
    assert {"qp/starts", "ccd/starts", "newton/kkt"} <= set(every) - set(all_)
    assert set(all_) <= set(every)


def test_every_algorithm_takes_part_from_one_start_and_from_several() -> None:
    names = {adapter.name for adapter in adapters(starts=True)}
    for family in ("qp", "newton", "ccd", "dls", "placo", "pink", "mink"):
        mine = {name for name in names if name.partition("/")[0] == family} - {"placo/pruned"}  # placo with fewer pairs
        assert not mine or (len(mine) == 2 and sum("start" in name for name in mine) == 1)
    assert len(names) <= 18
    assert [adapter.name for adapter in adapters(["newton"], starts=True)][-2:] == ["newton/one_start", "newton/starts"]


def test_the_judgements_of_all_starts_are_taken_off_the_time(shelf: wb.Problem) -> None:
    (adapter,) = adapters(["dls"])
    method = restarted(replace(adapter)).make(1e-4, 20)
    solution = method.solve(shelf)
    assert solution.assessment.seconds <= solution.seconds

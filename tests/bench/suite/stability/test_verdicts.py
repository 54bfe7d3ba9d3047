"""Every rule, on methods made up to break it; those that hang or crash in processes of their own, as in earnest."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability import asking
from wholebody.bench.suite.stability.asking import Judged, ask, depth_between, judge, run
from wholebody.bench.suite.stability.catalogue import NOTHING, Answer, Stream, cases
from wholebody.bench.suite.stability.verdict import Verdict, decide, length, result
from wholebody.problem import Problem

Fakes = Callable[..., Adapter]


@pytest.fixture(autouse=True)
def cold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no process compile what methods of the package need: no test of this file asks one."""
    monkeypatch.setattr(asking, "_warm", lambda: None)


def verdict(name: str, adapter: Adapter) -> Verdict:
    """The verdict on a method that answers, refuses or raises."""
    (case,) = cases([name])
    answer = ask(case, adapter)
    return decide(case, answer, judge(case, answer))


def verdict_of_process(name: str, adapter: Adapter, cap: float = 20.0) -> Verdict:
    """The verdict on a method that has a process of its own, which it may end."""
    chosen = cases([name])
    return result(chosen, [adapter.name], run([(chosen[0], adapter)], cap=cap)).verdicts[name, adapter.name]


def at(*values: float) -> Callable[[Problem], np.ndarray]:
    return lambda problem: np.array(values)


def start(problem: Problem) -> np.ndarray:
    return problem.scene.figure.clamp(problem.start)


def test_an_honest_answer(fake: Fakes) -> None:
    found = verdict("out-by-1-mm", fake(start, "stalled"))
    assert (found.kind, found.acceptable, found.symbol) == ("honest", False, "○")
    assert found.figure.startswith("+")


def test_the_best_honest_answer(fake: Fakes) -> None:
    found = verdict("out-by-1-mm", fake(at(-0.7, 0.0, 0.0), "unreachable"))
    assert (found.kind, found.acceptable, found.figure, found.symbol) == ("honest", True, "best known", "●")


def test_a_claim(fake: Fakes) -> None:
    found = verdict("out-by-1-mm", fake(at(-0.7, 0.0, 0.0), "solved"))
    assert (found.kind, found.figure) == ("wrong", "claims solved, 1 mm left")


def test_solved_whatever_it_says(fake: Fakes) -> None:
    assert verdict("goal-1e-12-away", fake(start, "stalled")).kind == "solved"


def test_not_a_number(fake: Fakes) -> None:
    assert verdict("out-by-1-mm", fake(at(np.nan, 0.0, 0.0))).figure == "NaN"


def test_out_of_limits(fake: Fakes) -> None:
    assert verdict("out-by-1-mm", fake(at(0.0, 2.95, 0.0))).figure == "0.05 rad out of limits"


def test_inside(fake: Fakes) -> None:
    found = verdict("edge-on-edge", fake(at(0.02, 0.01, 0.3 + 0.2 * np.sqrt(2.0) - 0.02), "infeasible"))
    assert (found.kind, found.figure) == ("wrong", "20 mm inside, says infeasible")


def test_a_start_inside_may_stay_if_it_is_said(fake: Fakes) -> None:
    honest = verdict("start-5-cm-inside", fake(start, "infeasible"))
    assert (honest.kind, honest.figure) == ("honest", "50 mm inside, not deeper")
    assert not honest.acceptable
    assert verdict("start-5-cm-inside", fake(start, "unreachable")).kind == "wrong"
    deeper = verdict("start-5-cm-inside", fake(lambda problem: start(problem) + (0.1, 0.0, 0.0), "infeasible"))
    assert deeper.kind == "wrong"


def test_a_constraint_that_could_hold(fake: Fakes) -> None:
    found = verdict("redundant-loop", fake(lambda problem: start(problem) + (0.01, 0.0, 0.0, 0.0), "infeasible"))
    assert found.kind == "wrong"
    assert found.figure.startswith("a constraint missed by")


def test_constraints_that_cannot_hold_are_missed_honestly(fake: Fakes) -> None:
    assert verdict("inconsistent-loop", fake(start, "infeasible")).figure == "25 mm missed"
    assert verdict("inconsistent-loop", fake(start, "unreachable")).kind == "wrong"


def raises(problem: Problem) -> np.ndarray:
    raise ZeroDivisionError("nothing to divide by\nand more")


def refuses(problem: Problem) -> np.ndarray:
    raise InputError("this method cannot take goals; leave them out")


def grumbles(problem: Problem) -> np.ndarray:
    raise InputError("no")


def sleeps(problem: Problem) -> np.ndarray:
    time.sleep(60.0)
    return start(problem)


def waits(problem: Problem) -> np.ndarray:
    time.sleep(0.5)
    return start(problem)


def computes(problem: Problem) -> np.ndarray:
    while True:
        pass


def crashes(problem: Problem) -> np.ndarray:
    os.kill(os.getpid(), signal.SIGKILL)
    return start(problem)


def test_an_exception(fake: Fakes) -> None:
    found = verdict_of_process("conflict", fake(raises))
    assert (found.kind, found.figure) == ("wrong", "ZeroDivisionError: nothing to divide by")


def test_a_refusal(fake: Fakes) -> None:
    assert verdict("conflict", fake(refuses)).kind == "refusal"
    assert verdict("conflict", fake(grumbles)).kind == "wrong"


def test_hanging(fake: Fakes) -> None:
    found = verdict_of_process("conflict", fake(computes), cap=0.3)
    assert (found.kind, found.figure[:5]) == ("wrong", "hangs")


def test_waiting_is_no_hanging(fake: Fakes) -> None:
    """Others' work on the machine, which makes a method wait, ends no answer: its limit is of the processor."""
    assert verdict_of_process("conflict", fake(waits), cap=0.3).kind == "honest"


def test_crashing(fake: Fakes) -> None:
    assert verdict_of_process("conflict", fake(crashes)).figure == "crashes: SIGKILL"


def test_nonsense_has_to_be_refused(fake: Fakes) -> None:
    found = verdict("not-a-number", fake(lambda problem: np.zeros(3)))
    assert found.kind == "wrong"
    assert found.figure == "takes NaN as tolerance"


def frames(name: str, *postures: tuple[float, ...]) -> Verdict:
    """The verdict on postures that a stream's frames go through by turns."""
    case = cases([name])[0]
    question = case.question()
    assert isinstance(question, Stream)
    shown = np.array([postures[k % len(postures)] for k in range(len(question.frames))])
    answer = Answer(shown, left=(0.0,) * len(shown))
    return decide(case, answer, replace(judge(case, answer), misreported=0.0))


def test_passing_through_between_frames() -> None:
    # the arm points away from the plate in every frame, and swings through it from each to the next
    found = frames("thin-plate", (2.0, 0.0, 0.0), (-2.0, 0.0, 0.0))
    assert found.kind == "wrong"
    assert "mm inside on the way: turn" in found.figure
    assert "plate, frame" in found.figure
    assert frames("thin-plate", (-1.4, 1.5, 1.2), (-1.6, 1.5, 1.2)).kind == "honest"


def test_what_moves_comes_into_who_stays() -> None:
    # the arm never moves, and the ball comes into it; then the arm is turned away from where it comes
    assert frames("moving-obstacle", (0.0, 0.5, 1.2, 0.0, 0.3, 0.0)).kind == "wrong"
    assert frames("moving-obstacle", (2.5, 0.5, 1.2, 0.0, 0.3, 0.0)).kind == "honest"


def test_too_fast() -> None:
    found = frames("speed-bound", (-0.9, 0.5, 0.3), (-0.9, 0.55, 0.3))
    assert (found.kind, found.figure) == ("wrong", "3.0 times too fast")


def test_a_stream_that_says_less_is_left_than_is() -> None:
    case = cases(["thin-plate"])[0]
    answer = Answer(NOTHING, left=(0.0,))
    assert decide(case, answer, Judged(goal_error=0.23, misreported=0.23)).figure.startswith("misreports")
    assert decide(case, answer, replace(Judged(goal_error=0.23), misreported=1e-4)).kind == "honest"


@pytest.mark.parametrize(
    ("metres", "words"), [(1.2345, "1.23 m"), (0.0342, "34.2 mm"), (0.5, "500 mm"), (1e-3, "1 mm"), (5.1e-6, "5.1 µm")]
)
def test_lengths(metres: float, words: str) -> None:
    assert length(metres) == words


def test_a_way_through_a_plate_is_as_deep_as_the_plate(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3))).add(wb.Box((0.6, 0.01, 0.2)), name="plate", at=(0.5, 0.0, 0.0))
    before, after = np.array([0.6, 0.0]), np.array([-0.6, 0.0])
    depth, what = depth_between(scene, before, after, 1e-3)
    assert depth > 0.01
    assert "plate" in what
    assert depth_between(scene, after, after, 1e-3) == (0.0, "")

"""Hard cases in which an adapter was at fault: pink and mink are set up as they have to be for these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.adapters.loop import margins, size
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.stability import catalogue
from wholebody.bench.suite.stability.asking import ask, judge
from wholebody.bench.suite.stability.catalogue import Posed, Stream
from wholebody.bench.suite.stability.verdict import decide

CASES = ("inside-obstacle", "narrow-passage", "edge-on-edge", "100-m-scale", "start-1-mm-inside")


@pytest.mark.parametrize("name", ["mink", "pink"])
@pytest.mark.parametrize("case", CASES)
def test_no_answer_is_wrong(name: str, case: str) -> None:
    pytest.importorskip(name.partition("/")[0])
    (adapter,), (hard,) = adapters([name]), catalogue.cases([case])
    answer = ask(hard, adapter)
    verdict = decide(hard, answer, judge(hard, answer))
    assert verdict.kind in ("solved", "honest"), verdict
    if (name, case) in {("mink", "narrow-passage"), ("pink", "narrow-passage"), ("mink", "100-m-scale")}:
        assert verdict.kind == "solved"


@pytest.mark.parametrize(
    ("name", "case", "near"), [("mink", "fast-obstacle", (10, 40)), ("pink", "moving-obstacle", (50, 64))]
)
def test_a_thing_that_comes_is_left_room(name: str, case: str, near: tuple[int, int]) -> None:
    """What comes nearer than its room is not given all of it back in one step, for which joints are too slow.

    Of the frames those are asked in which the thing is near.
    """
    pytest.importorskip(name)
    (adapter,), (hard,) = adapters([name]), catalogue.cases([case])
    asked = hard.question

    def shorter() -> Stream:
        whole = asked()
        assert isinstance(whole, Stream)
        return replace(whole, frames=whole.frames[slice(*near)])

    hard = replace(hard, question=shorter)
    answer = ask(hard, adapter)
    assert decide(hard, answer, judge(hard, answer)).kind == "solved"


def test_lengths_are_shares_of_the_size_of_a_figure() -> None:
    sizes = {}
    for name in ("1-cm-scale", "100-m-scale"):
        question = catalogue.cases([name])[0].question()
        assert isinstance(question, Posed)
        sizes[name] = size(question.problem.scene.figure)
    assert sizes["100-m-scale"] == pytest.approx(1e4 * sizes["1-cm-scale"])
    person = wb.load("human", stature=1.8)
    assert 1.0 < size(person) < 1.8


def test_margins_leave_what_rests_where_it_is() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))], clearance=0.003)
    found = margins(problem, 1e-3)
    assert found.min() == 0.0
    assert found.max() == 1e-3
    with problem.borrow() as workspace:
        near = workspace.near(problem.start, 0.01)
    room = near.distance - problem.clearances[near.number]
    assert (found[near.number] <= np.maximum(0.5 * room, 0.0) + 1e-12).all()

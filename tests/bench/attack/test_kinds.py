"""What kinds of cases judge: right answers pass, and answers with a false claim do not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.attack import frames, terms
from wholebody.bench.attack.scenes import Body
from wholebody.bench.suite.stability.bodies import planar_arm
from wholebody.tracking.loop import FrameLoop


@pytest.fixture
def arm() -> wb.Scene:
    """Return an arm along x of 0.5 and 0.4 m."""
    return wb.Scene(planar_arm([0.5, 0.4]))


def test_an_answer_where_a_term_is_not_defined_is_wrong(arm: wb.Scene) -> None:
    problem = wb.Problem(arm, np.zeros(2), goals=[wb.Point("tip", (0.6, 0.0, 0.0))])
    solution = replace(
        wb.solve(problem), status="stalled", message="a term is not finite at the posture of iteration 3"
    )
    asked = terms.Asked("tip", np.array([-0.3, 0.0, 0.0]), 0.1, "error", np.nan)
    half = np.array([0.0, np.pi / 2])  # the tip is at x = 0.5

    def said(q: Any, **changed: Any) -> str:
        return terms.own_verdict(problem, asked, np.asarray(q), replace(solution, **changed)).outcome

    assert said(np.zeros(2)) == "right"
    assert said(half) == "wrong"
    assert said(np.zeros(2), message="nothing better is near") == "wrong"
    assert said(np.zeros(2), status="solved") == "wrong"
    assert terms.own_verdict(problem, asked, np.zeros(2)).outcome == "right"
    assert terms.own_verdict(problem, asked, half).outcome == "wrong"
    assert terms.own_verdict(problem, asked, np.full(2, np.nan)).outcome == "wrong"


def test_things_that_overlap_are_told_and_others_are_not(arm: wb.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, x in (("a", 3.0), ("b", 3.15), ("c", 3.5)):
        arm.add(wb.Sphere(0.1), name=name, at=(x, 0.0, 0.0))
    assert frames.overlapping(arm, np.zeros(2)).words == "1 pairs of 3 things overlap"
    none = SimpleNamespace(pair=np.zeros((0, 2), dtype=int))
    monkeypatch.setattr(wb.Scene, "overlapping", lambda *_: none)
    monkeypatch.setattr(wb.Scene, "penetration", lambda *_: [])
    assert "a and b overlap by 0.05 m" in frames.overlapping(arm, np.zeros(2)).words
    told = [SimpleNamespace(a="a", b="b"), SimpleNamespace(a="b", b="c")]
    monkeypatch.setattr(wb.Scene, "penetration", lambda *_: told)
    assert "b and c are 0.15 m apart" in frames.overlapping(arm, np.zeros(2)).words


@pytest.mark.parametrize(
    ("shift", "deepest", "words"),
    [
        (0.0, 0.0, "1 places of the support"),
        (-0.05, 0.0, "frame 0: the body sleeps 0.05 m from what bore it"),
        (0.01, 0.01, "frame 30: the body is 0.01 m inside of what bears it"),
        (0.01, 0.0, "frame 0: the body is 0.01 m deep, reported as 0 m"),
    ],
)
def test_a_body_that_sleeps_in_the_air_or_in_its_support_is_wrong(
    arm: wb.Scene, monkeypatch: pytest.MonkeyPatch, shift: float, deepest: float, words: str
) -> None:
    arm.add(wb.Box((1.0, 1.0, 0.1)), name="support", at=(3.0, 0.0, 0.0))
    arm.add(wb.Sphere(0.1), name="sleeper", at=(3.0, 0.0, 0.15))
    frame = SimpleNamespace(engine=SimpleNamespace(sleeping=1), deepest=deepest)
    monkeypatch.setattr(frames, "World", lambda _: SimpleNamespace(dt=0.02, step=lambda: frame))
    found = frames.slept(arm, [(3.0, 0.0, shift, 0.0, 0.0, 0.0, 1.0)], over=False)
    assert (found.outcome, found.words) == ("wrong" if shift else "right", words)


def test_goals_are_met_in_few_frames_where_they_can_be(arm: wb.Scene) -> None:
    body = Body(arm.figure, 1.0)
    there = arm.figure.placement(np.array([0.2, 0.3]), "tip").copy()
    assert 1 <= frames.frames_until(body, "tip", there, (1.0, 1e3), 30) <= 30
    far = pin.SE3(there.rotation, there.translation + (2.0, 0.0, 0.0))
    assert frames.frames_until(body, "tip", far, (1.0, 1.0), 5) == 6


def test_a_thing_in_the_figure_is_told(arm: wb.Scene) -> None:
    arm.add(wb.Sphere(0.05), name="ball", at=(0.7, 0.0, 0.18))
    inside, loop = [(0.7, 0.0, 0.06, 0.0, 0.0, 0.0, 1.0), None], FrameLoop(arm, np.zeros(2))
    assert frames.shown(arm, loop, inside).outcome == "right"
    still: Any = SimpleNamespace(shown=np.zeros(2), frame=lambda q: SimpleNamespace(q=q, note=""))
    assert "frame 0: 20.00 mm of overlap" in frames.shown(arm, still, inside).words

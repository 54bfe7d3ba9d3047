"""Every method follows one protocol: it says what it cannot take, solves, and makes a tracker."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.adapters.mink import Mink
from wholebody.bench.suite.adapters.pink import Pink
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.methods import METHODS
from wholebody.methods.base import Method, UnsupportedTermError
from wholebody.methods.solve import method_named

REFUSED = {
    "qp": None,
    "newton": None,
    "ccd": (wb.Posture("neutral"), [wb.Plane("tip", (0, 1, 0))]),
    "placo": (wb.Axis("tip", (1, 0, 0), toward=(1, 1, 1)), [wb.Plane("tip", (0, 1, 0), side="above")]),
    "dls": (wb.Point("tip", (0.3, 0.0, 0.3)), [wb.Plane("tip", (0, 1, 0), side="above")]),
}
"""A goal and constraints that a method cannot take; None where it can take all of ours."""


@pytest.fixture(scope="module")
def scene(planar_arm: Callable[..., wb.Figure]) -> wb.Scene:
    return wb.Scene(planar_arm((0.3, 0.3, 0.2)))


def chosen(name: str) -> Method:
    if name == "placo":
        pytest.importorskip("placo")
    return method_named(name)


@pytest.mark.parametrize("name", [name for name in METHODS if REFUSED[name]])
def test_what_a_method_cannot_take_is_named_by_one_sentence_everywhere(name: str, scene: wb.Scene) -> None:
    method = chosen(name)
    goal, constraints = REFUSED[name]  # type: ignore[misc]
    problem = wb.Problem(
        scene, goals=[goal], constraints=constraints, measures=[wb.Effort()] if name != "ccd" else None
    )
    sentence = method.accepts(problem)
    assert sentence is not None
    assert "Plane" in sentence
    assert "method='qp'" in sentence
    with pytest.raises(UnsupportedTermError) as caught:
        method.solve(problem)
    assert str(caught.value) == sentence
    with pytest.raises(UnsupportedTermError, match="Plane"):
        method.tracker(problem, 0.02).step(problem.start)


LEFT_OUT = {
    "qp": (), "newton": (),
    "ccd": ("Balance (by default)",),
    "placo": ("RangeOfMotion (by default)", "ReachCones (by default)"),
    "dls": ("contacts", "RangeOfMotion (by default)", "ReachCones (by default)", "Balance (by default)"),
    "pink": ("RangeOfMotion (by default)", "ReachCones (by default)", "Balance (by default)"),
    "mink": ("RangeOfMotion (by default)", "ReachCones (by default)", "Balance (by default)"),
}  # fmt: skip
"""What methods do not look at of a person who stands, from their documentation; all others of these they keep."""


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_a_method_does_not_look_at_is_said_before_it_begins(name: str, human: wb.Figure) -> None:
    tools: dict[str, type[Method]] = {"pink": Pink, "mink": Mink}
    method = tools[name](1e-3) if name in tools else chosen(name)
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    there = human.placement(human.posture("standing"), "right_palm").translation
    goals = [wb.Point("right_palm", there)]
    problem = wb.Problem(wb.Scene(human), "standing", goals=goals, constraints=[] if name == "ccd" else feet)
    if name == "ccd":  # which takes no hold that its joints move; of a start that stands this is the default
        problem = wb.Problem(wb.Scene(human), "standing", goals=goals, balance=True)
    said: tuple[str, ...] = method.leaves_out(problem)  # type: ignore[attr-defined]
    assert said == LEFT_OUT[name]
    if said and name not in tools:
        with pytest.warns(UserWarning, match="the assessment alone judges") as told:
            assert wb.solve(problem, method, lambda entry: True).method.startswith(name)
        assert all(word in str(told[0].message) for word in said)


def test_what_breaks_is_told_from_what_a_method_left_out(human: wb.Figure) -> None:
    """Who is 0.3 m beside where the feet are to bear falls, and an arm does not change that: ccd does not look."""
    problem = wb.Problem(wb.Scene(human), "standing", goals=[wb.Point("right_palm", (0.6, -0.3, 1.1))], balance=True)
    problem = problem.with_start(problem.start + 0.3 * np.eye(len(problem.start))[0])
    solution = wb.solve(problem, wb.methods.CCD(restarts=0))
    assert not solution.solved
    assert "this method leaves out Balance (by default): Balance (by default) is missed by" in solution.message


@pytest.mark.parametrize("name", METHODS)
def test_a_tracker_comes_to_a_goal_and_follows_it_elsewhere(name: str, scene: wb.Scene) -> None:
    """Judged by Pinocchio's own placement of the tip."""
    method, q = chosen(name), np.array([0.3, 0.4, 0.5])
    there = scene.state(q).frame(scene.frame_id("tip")).translation
    problem = wb.Problem(scene, [0.1, 0.2, 0.3], goals=[wb.Point("tip", there)])
    assert method.accepts(problem) is None
    tracker, at = method.tracker(problem, 0.1), problem.start
    for _ in range(60):
        at = tracker.step(at).q
    assert scene.state(at).frame(scene.frame_id("tip")).translation == pytest.approx(there, abs=2e-3)
    there = scene.state(q + 0.1).frame(scene.frame_id("tip")).translation
    problem.retarget([wb.Point("tip", there)])
    for _ in range(10):
        at = tracker.frame(at, 1e-4).q
    assert scene.state(at).frame(scene.frame_id("tip")).translation == pytest.approx(there, abs=5e-4)
    assert tracker.solve(at).assessment.goal_error < 2e-4


@pytest.mark.parametrize("name", METHODS)
def test_a_drag_uses_a_method_by_its_protocol_alone(name: str, scene: wb.Scene) -> None:
    """A method of somebody else, which only hands on what the protocol has, drags as the one that it wraps."""
    method = chosen(name)

    class Wrapped:
        name, accepts, solve, tracker = method.name, method.accepts, method.solve, method.tracker

    there = scene.state(np.array([0.3, 0.4, 0.5])).frame(scene.frame_id("tip")).translation
    found = []
    for one in (method, Wrapped()):
        drag = wb.tracking.Drag(wb.Problem(scene, [0.1, 0.2, 0.3], goals=[wb.Point("tip", there)]), one)
        found.append([drag.to(there + (0.0, 0.01 * k, 0.0)).q for k in range(3)])
    assert np.array_equal(found[0], found[1])


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("no_module_of_this_name:Kind", "cannot be imported"), ("json:Nothing", "cannot be imported"),
        ("json:loads", "no class with solve"), ("json:JSONDecoder", "no class with solve"),
    ],
)  # fmt: skip
def test_a_method_that_cannot_be_imported_is_refused_in_one_sentence(name, told):
    with pytest.raises(wb.InputError, match=told) as refused:
        method_named(name)
    assert "\n" not in str(refused.value)


def test_a_method_of_ones_own_by_the_name_of_its_module(tmp_path, monkeypatch):
    """`solve` and comparisons take it by "module:Class"; budgets go to the arguments that it has."""
    example = Path(__file__).parents[2] / "examples" / "own_method.py"
    (tmp_path / "mine_alone.py").write_text(example.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", list(sys.path))
    name = "mine_alone:JacobianTranspose"
    problem = wb.Problem(wb.Scene(wb.load("avatar")), goals=[wb.Point("right_palm", (0.4, -0.3, 1.1))])
    assert wb.solve(problem, name).solved
    (adapter,) = adapters([name])
    assert adapter.name == name
    assert adapter.make(1e-2, 7) == type(method_named(name))(tolerance=1e-2, iterations=7)

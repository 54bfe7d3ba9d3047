"""The same call has the same answer, bit for bit, whatever was asked before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry.pair_distances import PairDistances

FEET = ("left_foot", "right_foot")


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    """Return a human among boxes and a hull, whose distances coal finds by iteration."""
    made = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    for k in range(6):
        made.add(wb.Box((0.1, 0.3, 0.1)), name=f"box{k}", at=(0.45, 0.5 - 0.2 * k, 0.6 + 0.1 * k))
    corners = np.random.default_rng(0).normal(size=(20, 3)) * 0.05
    return made.add(wb.Hull(corners), name="stone", at=(0.5, -0.2, 1.2))


def problem(scene: wb.Scene, place: tuple[float, float, float]) -> wb.Problem:
    holds = [wb.Hold(foot) for foot in FEET]
    return wb.Problem(scene, goals=[wb.Point("right_index_tip", place)], constraints=holds, clearance=0.003)


PLACES = {"within reach": (0.4, -0.25, 1.15), "out of reach": (1.1, 0.3, 1.5), "elsewhere": (0.35, 0.0, 0.8)}


@pytest.mark.parametrize("place", ["within reach", "out of reach"])
@pytest.mark.parametrize(
    "method",
    [
        wb.methods.QP(budget=60, restarts=3, time_limit=None),
        wb.methods.DampedLeastSquares(iterations=30, time_limit=None),
    ],
    ids=lambda method: method.name,
)
def test_a_solve_after_others_is_the_solve_before_them(scene: wb.Scene, method: Any, place: str) -> None:
    asked = problem(scene, PLACES[place])
    first = method.solve(asked)
    for other in (PLACES["elsewhere"], (0.4, -0.5, 1.3), PLACES["out of reach"]):
        method.solve(problem(scene, other))
    scene.contacts(scene.figure.posture("sitting"), 0.3)
    again = method.solve(asked)
    assert np.array_equal(first.q, again.q)
    assert first.assessment == again.assessment
    assert (first.status, first.iterations, first.trace) == (again.status, again.iterations, again.trace)
    restated = method.solve(problem(scene, PLACES[place]))
    assert np.array_equal(first.q, restated.q)


def test_a_judgement_does_not_depend_on_the_one_before(scene: wb.Scene) -> None:
    asked, figure, rng = problem(scene, PLACES["within reach"]), scene.figure, np.random.default_rng(2)
    postures = [
        figure.clamp(pin.integrate(figure.model, figure.neutral, 0.4 * rng.normal(size=figure.model.nv)))
        for _ in range(6)
    ]
    before = [wb.assess(asked, q) for q in postures]
    assert [wb.assess(asked, q) for q in postures[::-1]][::-1] == before
    fresh = wb.Scene(figure)
    for name, thing in scene.objects.items():
        fresh.add(thing.shape, name=name, at=thing.placement)
    assert [wb.assess(problem(fresh, PLACES["within reach"]), q) for q in postures] == before


def test_contacts_and_sweeps_do_not_depend_on_those_before(scene: wb.Scene) -> None:
    figure, rng = scene.figure, np.random.default_rng(3)
    postures = [
        figure.clamp(pin.integrate(figure.model, figure.neutral, 0.4 * rng.normal(size=figure.model.nv)))
        for _ in range(5)
    ]

    def asked(k: int) -> tuple[list[object], float | None]:
        met = scene.sweep(postures[k], postures[k - 1])
        return [part.tolist() for part in scene.contacts(postures[k], 0.2)], None if met is None else met.fraction

    before = [asked(k) for k in range(5)]
    assert [asked(k) for k in reversed(range(5))][::-1] == before


def test_a_new_tracker_steps_as_the_first_one_did(scene: wb.Scene) -> None:
    asked, method = problem(scene, PLACES["within reach"]), wb.methods.QP(time_limit=None)

    def way() -> list[np.ndarray]:
        tracker, q, found = method.tracker(asked, 0.02), asked.start, []
        for _ in range(30):
            q = tracker.step(q).q
            found.append(q)
        return found

    before = way()
    method.solve(problem(scene, PLACES["elsewhere"]))
    other = method.tracker(problem(scene, PLACES["elsewhere"]), 0.02)
    q = asked.start
    for _ in range(10):
        q = other.step(q).q
    np.testing.assert_array_equal(way(), before)


def test_a_drag_goes_as_the_first_one_did(scene: wb.Scene) -> None:
    for method in ("qp", "newton"):
        ways = []
        for _ in range(2):
            drag = wb.tracking.Drag(problem(scene, PLACES["within reach"]), method)
            ways.append([drag.to((0.4 - 0.01 * k, -0.3, 1.15)).q for k in range(4)])
        np.testing.assert_array_equal(*ways)


def test_forgotten_guesses_are_those_of_a_new_run(monkeypatch: pytest.MonkeyPatch, scene: wb.Scene) -> None:
    """With the view over coal's guesses and, where its memory is laid out in another way, without."""
    q, model, geometry, pairs = scene.figure.posture("sitting"), scene.model, scene.geometry, scene.pair_table.pairs
    data = model.createData()

    def distances(asked: PairDistances, q: Any) -> list[list[float]]:
        pin.forwardKinematics(model, data, q)
        asked.place(model, data)
        return asked.measured(np.arange(len(pairs))).tolist()

    new = PairDistances(geometry, pairs)
    new.reset()
    expected = distances(new, q)
    for seen in (True, False):
        if not seen:
            monkeypatch.setattr("wholebody.geometry.pair_distances.guess_view", lambda requests: None)
        used = PairDistances(geometry, pairs)
        for posture in ("standing", "t_pose"):
            distances(used, scene.figure.posture(posture))
        used.reset()
        assert distances(used, q) == expected

"""Adjustable things: a solve chooses their settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.measuring import measure

CUSHION, BACK = (wb.Box((0.36, 0.5, 0.04)), (0.18, 0.0, -0.02)), (wb.Box((0.03, 0.5, 0.5)), (-0.015, 0.0, 0.45))


def cabin(figure: wb.Figure, target: Any = None, layout: Any = None) -> wb.Problem:
    """Somebody who sits as people are measured, with flat feet whose balls are at a pedal."""
    seat = wb.figures.adjustable({"cushion": CUSHION, "back": BACK}, slide=(-0.3, 0.1), height=(0.30, 0.55))
    scene = wb.Scene({"anna": figure, "seat": seat}).add(wb.HalfSpace(), name="floor")
    sits = wb.Sit(on="seat/cushion", back="seat/back", pelvis="anna/pelvis", trunk="anna/thorax", erect=True)
    stands = wb.Stand(on="floor", feet=["anna/left_foot", "anna/right_foot"], balance=False)
    knees = wb.Freeze("anna/left_knee_flexion", "anna/right_knee_flexion")
    goals = [wb.Point("anna/right_ball", (0.5, -0.12, 0.0))]
    return wb.Problem(scene, scene.figure.posture({"anna": "sitting"}), goals=goals, constraints=[sits, stands, knees])


def test_a_seat_is_as_high_as_the_legs_are_long() -> None:
    person = wb.load("human", sex="male")
    problem = cabin(person)
    solution = wb.solve(problem)
    assert solution.solved
    chosen = problem.scene.figure.joint_values(solution.q)
    # Thighs level, knees at a right angle and flat feet: that is how the popliteal height is measured.
    assert chosen["seat/height"] == pytest.approx(measure(person)["popliteal_height"], abs=2e-4)
    ball = problem.scene.figure.placement(solution.q, "anna/right_ball").translation
    np.testing.assert_allclose(ball, (0.5, -0.12, 0.0), atol=1e-4)


def test_a_task_file_has_what_is_adjustable(tmp_path: Path) -> None:
    problem = cabin(wb.load("human"))
    file = wb.taskfile.write_task(problem, tmp_path / "cabin.toml")
    again = wb.read_task(file).problem
    np.testing.assert_allclose(wb.solve(again).q, wb.solve(problem).q, atol=1e-6)
    figure, read = problem.scene.figure, again.scene.figure
    assert read.joints == figure.joints
    np.testing.assert_array_equal(read.limits.lower, figure.limits.lower)
    np.testing.assert_array_equal(read.limits.upper, figure.limits.upper)
    records = wb.study(
        file, people=[{"sex": "female", "percentile": 50}]
    )  # a seat is nobody whose place she could take
    assert [one.outcome for one in records] == ["solved"]
    file.write_text(file.read_text().replace('name = "back"', 'name = "cushion"'))
    with pytest.raises(wb.FileFormatError, match="key parts: two parts have one name"):
        wb.read_task(file)


def test_a_study_tells_the_settings_of_people() -> None:
    people = wb.people(percentiles=[50, 90], sex="female")
    found = wb.accommodation(cabin, people)
    assert found.share == 1.0
    assert set(found.settings) == {"seat/slide", "seat/height"}
    bodies = [measure(wb.load("human", **people[one.factors["person"]])) for one in found.records]  # type: ignore[index]
    for body, height in zip(bodies, found.settings["seat/height"], strict=True):
        assert height == pytest.approx(body["popliteal_height"], abs=2e-4)
    assert "seat/height 0.3" in repr(found)


def test_tilt_and_slide_move_the_parts() -> None:
    wheel = wb.figures.adjustable({"rim": (wb.Torus(0.18, 0.015), (0.0, 0.0, 0.5))}, slide=(0.0, 0.1), tilt=(0.0, 1.0))
    q = wheel.with_joints(wheel.posture("middle"), {"slide": 0.1, "tilt": 0.5})
    # Turned about y through the origin of the parts, which has slid.
    expected = (0.1 + 0.5 * np.sin(0.5), 0.0, 0.5 * np.cos(0.5))
    np.testing.assert_allclose(wheel.placement(q, "rim").translation, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("parts", "ranges", "told"),
    [
        ({}, {"slide": (0.0, 1.0)}, "takes parts"),
        ({"seat": wb.Sphere(0.1)}, {}, "takes parts, and slide"),
        ({"seat": wb.Sphere(0.1)}, {"tilt": (0.2, 0.1)}, "tilt is"),
        ({"seat": wb.HalfSpace()}, {"slide": (0.0, 1.0)}, "with an end"),
        ({"slide": wb.Sphere(0.1)}, {"slide": (0.0, 1.0)}, "that no setting has"),
        ({"seat": 3}, {"slide": (0.0, 1.0)}, "give wb.Box"),
        ({"seat": wb.Sphere(0.1)}, {"height": (0.0, float("nan"))}, "height"),
    ],
)
def test_what_is_no_adjustable_thing_is_refused(parts: Any, ranges: Any, told: str) -> None:
    with pytest.raises(wb.InputError, match=told):
        wb.figures.adjustable(parts, **ranges)

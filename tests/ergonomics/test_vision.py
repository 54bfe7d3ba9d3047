"""Sight: directions whose angles are known, and things in between."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest

import wholebody as wb


@pytest.fixture(scope="module")
def person() -> wb.Figure:
    return wb.load("human")


def ahead(person: wb.Figure, side: float, height: float, distance: float = 1.0) -> np.ndarray:
    """A point in a direction from the eyes, degrees."""
    a, b = radians(side), radians(height)
    direction = np.array((cos(b) * cos(a), cos(b) * sin(a), sin(b)))
    eyes = person.placement(person.posture("standing"), "gaze")
    return np.array(eyes.act(distance * direction))


@pytest.mark.parametrize(
    ("side", "height", "seen", "comfortable"),
    [
        (0, -15, True, True),  # the normal line of sight
        (14, -15, True, True),
        (30, -15, True, False),
        (-40, -15, False, False),
        (0, 24, True, False),  # 39 degrees above the line of sight
        (0, 27, False, False),
        (0, -34, True, False),
        (0, -37, False, False),
        (180, 0, False, False),
    ],
)
def test_cones(person: wb.Figure, side: float, height: float, seen: bool, comfortable: bool) -> None:
    found = wb.ergonomics.sight(wb.Scene(person), person.posture("standing"), ahead(person, side, height))
    assert (found.seen, found.comfortable) == (seen, comfortable)
    assert found.distance == pytest.approx(1.0)


def test_a_thing_in_between_hides(person: wb.Figure) -> None:
    q, scene, point = person.posture("standing"), wb.Scene(person), ahead(person, 0, -15)
    scene.add(wb.Box((0.02, 0.3, 0.3)), name="board", at=ahead(person, 0, -15, 0.5))
    assert wb.ergonomics.sight(scene, q, point).hidden_by == "board"
    scene.move("board", at=ahead(person, 60, -15, 0.5))
    assert wb.ergonomics.sight(scene, q, point).seen
    scene.move("board", at=ahead(person, 0, -15, 1.5))
    assert wb.ergonomics.sight(scene, q, point).seen


@pytest.mark.parametrize("wall_first", [True, False])
def test_the_first_thing_on_the_line_is_named(person: wb.Figure, wall_first: bool) -> None:
    """Of a long wall and a ball on one line of sight, although the middle of the wall is far aside."""
    q, scene, point = person.posture("standing"), wb.Scene(person), ahead(person, 0, -15, 2.0)
    wall, ball = (0.5, 1.0) if wall_first else (1.5, 1.0)
    x, y, z = ahead(person, 0, -15, wall)
    scene.add(wb.Box((0.02, 6.0, 1.0)), name="wall", at=(x, y + 2.8, z))
    scene.add(wb.Sphere(0.1), name="ball", at=ahead(person, 0, -15, ball))
    assert wb.ergonomics.sight(scene, q, point).hidden_by == ("wall" if wall_first else "ball")


def test_a_thing_does_not_hide_its_own_surface(person: wb.Figure) -> None:
    scene, point = wb.Scene(person), ahead(person, 0, -15)
    scene.add(wb.Sphere(0.05), name="ball", at=ahead(person, 0, -15, 1.05))
    assert wb.ergonomics.sight(scene, person.posture("standing"), point).seen


def test_a_thing_does_not_hide_its_own_middle(person: wb.Figure) -> None:
    scene, point = wb.Scene(person), ahead(person, 0, -15)
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="clock", at=point)
    assert wb.ergonomics.sight(scene, person.posture("standing"), point).seen
    scene.add(wb.Box((0.02, 0.3, 0.3)), name="board", at=ahead(person, 0, -15, 0.5))
    assert wb.ergonomics.sight(scene, person.posture("standing"), point).hidden_by == "board"

"""Neighbouring tasks of people have neighbouring postures, each from its own start."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.figures.mirroring import mirrored

MOST = np.radians(10.0)  # largest change of a joint between neighbours


def changes(figure: wb.Figure, postures: Iterable[Array]) -> list[float]:
    """The largest change of a joint between each two neighbours, radians."""
    angles = [np.array(list(figure.joint_values(q).values())) for q in postures]
    return [float(np.abs(b - a).max()) for a, b in pairwise(angles)]


@pytest.mark.parametrize(("sex", "numbers"), [("male", (3, 4, 5, 6, 7, 8, 9)), ("female", (1, 2, 3, 4, 5, 6))])
def test_people_lift_a_box_from_the_floor_in_one_way(sex: str, numbers: Iterable[int]) -> None:
    """From upright, half of these ended elsewhere: one leg ahead, astride or beside the box, at up to four times the
    measure.
    """  # noqa: D205
    postures = []
    for number in numbers:
        scene = wb.Scene(wb.load("human", sex=sex, percentile=3.0 + number * 94.0 / 19.0))
        scene.add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box((0.30, 0.32, 0.24)), name="box", at=(0.45, 0.0, 0.1201))
        goals = [wb.Grasp(side, "box", kind="palm") for side in ("left", "right")]
        solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")]))
        assert solution.solved
        postures.append(solution.q)
        feet = [scene.figure.placement(solution.q, f"{side}_foot").translation for side in ("left", "right")]
        assert abs(feet[0][0] - feet[1][0]) < 0.02
    assert max(changes(scene.figure, postures)) < MOST


@pytest.mark.parametrize("bearings", [(-128.0, -125.0, -122.0), (53.0, 56.0, 60.0)])
def test_who_reaches_down_beside_or_behind_bends_forward(bearings: tuple[float, ...]) -> None:
    """Whose feet slide turns there; from upright some of these bent back, at 1.5 times the measure."""
    figure = wb.load("human")
    scene, postures = wb.Scene(figure).add(wb.HalfSpace(), name="floor"), []
    for bearing in np.radians(bearings):
        goals = [wb.Point("right_index_tip", (0.5 * np.cos(bearing), 0.5 * np.sin(bearing), 0.3))]
        solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")]))
        assert solution.solved
        postures.append(solution.q)
        assert figure.joint_values(solution.q)["left_hip_flexion"] > 0.5
    assert max(changes(figure, postures)) < MOST


@pytest.mark.parametrize("height", [0.30, 0.62])
def test_two_hands_alike_leave_the_body_in_the_middle(height: float) -> None:
    """A woman leaned by 132 mm to one side, and a man had one arm otherwise than the other."""
    woman = wb.load("human", sex="female")
    scene = wb.Scene(woman).add(wb.HalfSpace(), name="floor")
    goals = [wb.Point(f"{side}_palm", (0.46, y, height)) for side, y in (("left", 0.14), ("right", -0.14))]
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")]))
    assert solution.solved
    angles = woman.joint_values(solution.q)
    for name in (name for name in angles if name.startswith("left_")):
        assert angles[name] == pytest.approx(angles[f"right_{name.removeprefix('left_')}"], abs=0.02)


def test_who_may_lunge_to_either_side_lunges_to_the_left() -> None:
    """Descents end in either of two mirror images, which are as good: of people side by side every other one."""
    postures, crate = [], wb.Box((0.3, 0.4, 0.3))
    for percentile, yaw, sign in ((3.0, 0.0, 1), (13.5, 0.0, 1), (24.0, 0.0, 1), (13.5, 0.8, 1), (24.0, 4.0, -1)):
        figure = wb.load("human", sex="male", percentile=percentile)
        place = pin.SE3(pin.utils.rotate("z", yaw), np.array([0.4, -0.7, 0.0]) * (yaw > 0.0))
        start = figure.neutral.copy()
        start[:7] = pin.SE3ToXYZQUAT(place.act(pin.XYZQUATToSE3(start[:7])))
        start[3:7] *= sign  # a quaternion of either sign is the same turn
        scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
        scene.add(crate, name="crate", at=place.act(pin.SE3(np.eye(3), np.array([0.45, 0.0, 0.16]))))
        goals = [wb.Grasp(side, "crate") for side in ("left", "right")]
        measures = [wb.Effort(), wb.tasks.Rhythm(style="free")]
        problem = wb.Problem(scene, start, goals=goals, constraints=[wb.Stand("floor")], measures=measures)
        solution = wb.solve(problem)
        assert solution.solved
        postures.append(solution.q)
    assert max(changes(figure, postures)) < MOST


def test_mirror_images_at_a_place_are_those_at_the_origin_moved_there() -> None:
    figure, rng = wb.load("human"), np.random.default_rng(0)
    place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    q = pin.integrate(figure.model, figure.neutral, rng.normal(0.0, 0.3, figure.model.nv))
    moved = q.copy()
    moved[:7] = pin.SE3ToXYZQUAT(place.act(pin.XYZQUATToSE3(q[:7])))
    image, there = mirrored(figure, q[None])[0], mirrored(figure, moved[None], place)[0]
    for name in ("left_palm", "right_ankle", "head"):
        expected = place.act(figure.placement(image, name))
        assert expected.isApprox(figure.placement(there, name), 1e-9)

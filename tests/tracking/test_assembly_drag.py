"""Drags and paths of assemblies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import wholebody as wb
from tests.saved_page import unpacked


def _slider() -> wb.Assembly:
    """A block on a rail along x, with a post on its way."""
    made = wb.Assembly().body("block", (0, 0, 0), shape=wb.Box((0.1, 0.1, 0.1)))
    made.add(wb.Capsule(0.05, 0.3), name="post", at=(0.5, 0, 0))
    return made.prismatic("world", "block", axis=(1, 0, 0)).point_goal("block", (0, 0, 0))


def test_a_drag_follows_and_stops_at_a_post_and_comes_back() -> None:
    made = _slider()
    drag = wb.tracking.Drag(made)
    for x in np.linspace(0.0, 1.0, 21):
        frame = drag.to((x, 0, 0))
        assert frame.q[0] == pytest.approx(min(x, 0.4), abs=2e-4)
    assert frame.error == pytest.approx(0.6, abs=1e-3)
    answer = drag.finish()
    assert answer.status == "unreachable"
    assert answer.q[0] == pytest.approx(0.4, abs=1e-5)
    assert drag.to((0.1, 0, 0)).error < 1e-3


def test_a_fast_drag_does_not_jump_over_a_thin_plate() -> None:
    made = wb.Assembly().body("ball", (-0.5, 0, 0), shape=wb.Sphere(0.02))
    made.add(wb.Box((0.001, 1, 1)), name="plate").point_goal("ball", (-0.5, 0, 0))
    drag = wb.tracking.Drag(made)
    for k in range(12):
        assert drag.to((1.0 if k < 8 else 3.0, 0.01 * k, 0)).q[0] < -0.02


def test_a_drag_turns_a_frame() -> None:
    made = wb.Assembly().body("rod", (0, 0, 0)).frame_goal("rod", (0, 0, 0))
    drag = wb.tracking.Drag(made)
    for angle in np.linspace(0.0, np.pi, 31):
        drag.to((0, 0, angle, 0, 0, np.sin(0.5 * angle), np.cos(0.5 * angle)))
    assert drag.finish().status == "solved"
    assert np.abs(drag.q[5]) == pytest.approx(1.0, abs=1e-5)
    assert drag.q[2] == pytest.approx(np.pi, abs=1e-5)


def test_a_thing_that_moves_in_pushes_a_body_out() -> None:
    made = wb.Assembly().body("ball", (0, 0, 0.2), shape=wb.Sphere(0.1)).add(wb.HalfSpace(), name="lift")
    drag = wb.tracking.Drag(made.point_goal("ball", (0, 0, 0.2)))
    for height in np.linspace(0.0, 0.5, 21):
        made.move("lift", at=(0, 0, height))
        frame = drag.to((0, 0, 0.2))
        assert frame.q[2] >= height + 0.1 - 1e-4
    assert frame.q[2] == pytest.approx(0.6, abs=1e-3)


def test_a_path_is_followed_to_where_it_is_blocked() -> None:
    made = _slider()
    found = wb.tracking.follow_path(made, [(0, 0, 0), (0.3, 0, 0), (1.0, 0, 0)], spacing=0.1)
    assert [answer.status for answer in found] == ["solved"] * 5 + ["unreachable"]
    assert found[-1].q[0] == pytest.approx(0.4, abs=1e-5)
    assert [answer.q[0] for answer in found[:5]] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4], abs=1e-5)
    for answer in found:
        for before, after in pairwise(answer.path):
            assert np.array_equal(before, after) or made.scene.sweep(before, after) is None


def test_the_viewer_takes_an_assembly(tmp_path: object) -> None:
    made = _slider().body("lamp", (0, 0.3, 0), shape=wb.Sphere(0.05), color=(1.0, 0.0, 0.0)).body("ghost", (0, 0, 9))
    with wb.Viewer(made) as viewer:
        viewer.show(made.q)
        viewer.play([made.q, made.q], 0.1)
        page = unpacked(viewer.save(f"{tmp_path}/one.html"))
    assert "lamp" in page
    with pytest.raises(wb.InputError, match="shape"):
        viewer.show(made.q[:7])


@pytest.mark.parametrize("speed", [20.0])
def test_a_plate_that_flies_by_pushes_a_ball_or_is_named(speed: float) -> None:
    dt = 1.0 / 60.0
    made = wb.Assembly().body("ball", (0, 0, 0), shape=wb.Sphere(0.05))
    made.add(wb.Box((0.001, 0.4, 0.4)), name="plate", at=(-0.5, 0, 0)).frame_goal("ball", (0, 0, 0))
    drag, x, named = wb.tracking.Drag(made), -0.5, False
    while x < 0.5:
        x += speed * dt
        made.move("plate", at=(x, 0, 0), over=dt)
        frame = drag.to((0, 0, 0))
        named = named or bool(frame.collisions)
        assert named or frame.q[0] - x > 0.0505 - 1e-4 or x < 0.0
    for collision in frame.collisions:
        assert {collision.first, collision.second} == {"ball", "plate"}


def test_a_plate_through_a_body_that_cannot_give_way_is_named() -> None:
    made = wb.Assembly().body("ball", (0, 0, 0), shape=wb.Sphere(0.05)).body("rod", (0, 0, 0.3))
    made.add(wb.Box((0.001, 0.4, 0.4)), name="plate", at=(-0.1, 0, 0))
    made.spherical("world", "ball", at=(0, 0, 0)).point_goal("ball", (0, 0, 0))
    drag = wb.tracking.Drag(made)
    made.move("plate", at=(0.1, 0, 0), over=1.0 / 60.0)
    frame = drag.to((0, 0, 0))
    assert [{one.first, one.second} for one in frame.collisions] == [{"ball", "plate"}]


def test_bodies_that_are_pushed_about_are_in_nothing_and_pass_through_nothing() -> None:
    seed = 0
    made = (
        wb.Assembly().add(wb.HalfSpace(), name="floor").add(wb.Box((0.3, 0.3, 0.3)), name="block", at=(0.5, 0.1, 0.15))
    )
    shapes = (wb.Sphere(0.08), wb.Box((0.2, 0.1, 0.1)), wb.Capsule(0.05, 0.2))
    for k in range(5):
        made.body(f"b{k}", (0.35 * k - 0.9, -0.4, 0.3), shape=shapes[k % 3])
    made.spherical("b0", "b1", at=made.placement("b0").translation + (0.15, 0, 0))
    drag, scene, before = wb.tracking.Drag(made.frame_goal("b0", made.placement("b0"))), made.scene, made.q
    for k in range(50):
        t = 0.02 * k
        y, z = 0.5 * np.sin(3 * t + seed) ** 2 - 0.4, 0.2 * np.sin(7 * t + seed) + 0.25
        frame = drag.to((1.6 * k / 60 + 0.1 * np.sin(5 * t + seed) - 0.9, y, z, 0, 0, np.sin(t), np.cos(t)))
        assert scene.contacts(frame.q, 0.0).distance.min(initial=0.0) > -1e-5
        assert np.array_equal(before, frame.q) or scene.sweep(before, frame.q, 5e-4) is None
        before = frame.q

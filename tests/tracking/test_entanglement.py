"""Two arms that were tracked through each other and hold each other: both come back when the tracked ones are free."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.tracking import FrameLoop, build_scene

IN_TIME = 30  # frames
EASED = np.sin(np.linspace(0.0, 0.5 * np.pi, 40)) ** 2

ANGLES = ("shoulder_flexion", "shoulder_abduction", "shoulder_rotation", "elbow_flexion")
AHEAD = (1.05, 0.17, 0.0, 1.2)  # rad, both arms
TANGLE = (
    ((0.82, 0.20, 0.56, 1.67), (0.64, 0.32, 0.93, 1.87)),  # rad, the left arm and the right one
    ((0.63, 0.00, 1.11, 1.49), (0.86, 0.09, 0.55, 1.29)),
)


def off(loop: FrameLoop, tracked: Any) -> float:
    return float(np.abs(pin.difference(loop.scene.model, tracked, loop.shown)).max())


def test_a_figure_that_is_a_root_alone_is_followed(tmp_path: Path) -> None:
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    (tmp_path / "box.urdf").write_text(f'<robot name="box"><link name="box">{box}</link></robot>')
    scene = wb.Scene(wb.load(tmp_path / "box.urdf", root="free"))
    q = np.array((0.01, 0, 0, 0, 0, 0, 1.0))
    np.testing.assert_allclose(FrameLoop(scene, q - (0.01, 0, 0, 0, 0, 0, 0)).frame(q).q, q, atol=1e-6)


def test_arms_crossed_before_the_chest_come_back(least_distance: Any) -> None:
    """The scene from before the forearms cross until the tracked ones were apart for half a second."""
    made = build_scene("self_collision")
    part = made.track[440:600]
    free = np.array([least_distance(made.scene, q) for q in part.q]) > -1e-6
    released = int(np.flatnonzero(~free)[-1]) + 1
    assert 100 < released < len(free) - IN_TIME
    loop = FrameLoop(made.scene, part.q[0])
    for tracked in part.q[: released + IN_TIME]:
        loop.frame(tracked)
        assert least_distance(made.scene, loop.shown) > -1e-5
    assert off(loop, tracked) < 1e-3


def test_arms_moved_from_one_overlap_to_another_come_back(least_distance: Any) -> None:
    mirrored = True
    avatar = wb.load("avatar")
    scene, sides = wb.Scene(avatar), ("right", "left") if mirrored else ("left", "right")

    def arms(*angles: Any) -> Any:
        named = {
            f"{side}_{name}": x
            for side, arm in zip(sides, angles, strict=True)
            for name, x in zip(ANGLES, arm, strict=True)
        }
        return avatar.with_joints(avatar.posture("standing"), named)

    ahead, first, second = arms(AHEAD, AHEAD), arms(*TANGLE[0]), arms(*TANGLE[1])
    assert max(least_distance(scene, q) for q in (first, second)) < -0.03
    assert least_distance(scene, ahead) > 0.0
    ways = ((ahead, first), (first, first), (first, second), (second, ahead))
    tracked = [np.asarray(pin.interpolate(avatar.model, *way, share)) for way in ways for share in EASED]
    loop = FrameLoop(scene, ahead)
    for q in [*tracked, *[ahead] * (IN_TIME - 10)]:  # apart for ten frames before they are ahead
        loop.frame(q)
        assert least_distance(scene, loop.shown) > -1e-5
    assert off(loop, ahead) < 1e-3

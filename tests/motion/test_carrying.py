"""People who stand on things that move: a made-up person on a lift that goes up, turns and leans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_ground import DT, flat, walker
from tests.motion.test_retargeting import person, places
from wholebody.motion.carrying import carrier
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.surfaces import surface_of

COUNT = 24


def ridden(turns: bool, off: bool = False) -> tuple[SkeletonMotion, np.ndarray]:
    """Somebody who stands on a lift of 0.5 m/s, and where it is; `off`: it leaves without them in the middle."""
    motion, seconds = person(COUNT), np.arange(COUNT) / 30
    ways = [
        pin.SE3(
            pin.utils.rotate("z", 0.5 * time * turns) @ pin.utils.rotate("x", 0.1 * np.sin(3.0 * time) * turns),
            0.5 * max(time - 0.4 * off, 0.0) * np.array([0.6, 0.0, 0.8]),
        )
        for time in seconds
    ]
    goes = motion if off else replace(
        motion,
        positions=np.array([[way.act(at) for at in row] for way, row in zip(ways, motion.positions, strict=True)]),
        rotations=np.array([way.rotation @ row for way, row in zip(ways, motion.rotations, strict=True)]),
    )  # fmt: skip
    start = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    return replace(goes, dt=1 / 30), np.array([pin.SE3ToXYZQUAT(way * start) for way in ways])


def among(figure: wb.Figure) -> wb.Scene:
    scene = wb.Scene(figure).add(wb.Box((1.0, 1.0, 0.1)), name="lift", at=(0.0, 0.0, -0.05))
    return scene.add(wb.Box((0.2, 0.2, 0.2)), name="post", at=(3.0, 0.0, 0.0))


@pytest.mark.parametrize("turns", [False, True])
def test_feet_rest_on_a_lift_that_moves(turns: bool) -> None:
    human = wb.load("human", stature=1.5)  # smaller than the recorded person
    motion, track = ridden(turns)
    clip = wb.retarget(motion, human, scene := among(human), things={"lift": track})
    assert clip.things["lift"] == pytest.approx(track, abs=1e-12)
    for name in ("left_heel", "right_heel", "left_toe_tip", "right_toe_tip"):
        path = [
            pin.XYZQUATToSE3(at).actInv(human.placement(q, name).translation)
            for q, at in zip(clip.q, track, strict=True)
        ]
        assert np.ptp(path, axis=0).max() < 1e-3
        assert np.abs(np.array(path)[:, 2] - 0.05).max() < 2e-3
    assert wb.check(clip, scene).colliding == 0


def test_a_slow_lift_moves_however_many_frames_a_second_has(human: wb.Figure) -> None:
    """Of 0.1 m/s, in 120 frames a second, it counted as standing: heels were 27 mm off it."""
    motion, count = person(60), 60
    way = np.outer(np.arange(count) / 1200, (0.0, 0.0, 1.0))
    track = np.hstack([way + (0.0, 0.0, -0.05), np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))])
    rider = replace(motion, dt=1 / 120, positions=motion.positions + way[:, None])
    clip = wb.retarget(rider, human, among(human), things={"lift": track})
    for side in ("left", "right"):
        assert np.abs(places(clip, f"{side}_heel")[:, 2] - way[:, 2]).max() < 2e-3


def test_who_is_left_by_a_lift_does_not_go_with_it(human: wb.Figure) -> None:
    """As the lift leaves, the feet stay on the floor beneath: they do not go with the lift alone."""
    for off in (False, True):
        motion, track = ridden(turns=False, off=off)
        scene, joints = among(human).add(wb.HalfSpace(), name="floor"), {name: name for name in motion.names}
        joints |= {f"{side}_toe": f"{side}_foot" for side in ("left", "right")}
        ground = wb.motion.ground(motion, scene=scene)
        assert surface_of(scene, without={"lift"})(np.array([0.0, 0.0, 1.0]), 0) == pytest.approx(0.0, abs=1e-5)
        assert carrier(motion, joints, scene, {"lift": track}, ground) == ("" if off else "lift")


def test_each_foot_keeps_its_place_on_a_ski_of_its_own(human: wb.Figure) -> None:
    """The right ski glides ahead of the left one, so nobody stands on one thing alone."""
    motion, seconds = person(COUNT), np.arange(COUNT) / 30
    ahead = {"left": 0.5 * seconds, "right": 0.6 * seconds}
    places = motion.positions.copy()
    for k, name in enumerate(motion.names):
        places[:, k, 0] += ahead["right" if name in ("right_ankle", "right_foot") else "left"]
    scene, tracks = wb.Scene(human), dict[str, np.ndarray]()
    for side, y in (("left", 0.25), ("right", -0.25)):
        scene.add(wb.Box((1.0, 0.5, 0.1)), name=side, at=(0.0, y, -0.05))
        tracks[side] = np.array([(x, y, -0.05, 0.0, 0.0, 0.0, 1.0) for x in ahead[side]])
    clip = wb.retarget(replace(motion, positions=places, dt=1 / 30), human, scene, things=tracks)
    for side, way in ahead.items():
        heel = [human.placement(q, f"{side}_heel").translation[0] for q in clip.q]
        assert np.ptp(heel - way) < 0.01


@pytest.mark.parametrize("boards", [False, True])
def test_feet_go_from_a_lift_to_the_floor_that_it_meets_and_back(human: wb.Figure, boards: bool) -> None:
    """A walker goes down on a lift and steps off it, or steps on it and goes up: half a metre in 1.2 s."""
    motion, stood = walker(flat, 3.0)
    share = np.clip((np.arange(len(motion)) * DT - (1.8 if boards else 0.0)) / 1.2, 0.0, 1.0)
    high = 0.5 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    high = high if boards else 0.5 - high
    along = 2.7 if boards else 0.3  # m: of the middle of the lift; the edge is between two footholds
    lifted = motion.positions + np.outer(high, (0.0, 0.0, 1.0))[:, None]
    scene = wb.Scene(human).add(wb.Box((3.0, 2.0, 0.1)), name="lift", at=(along, 0.0, -0.05))
    scene.add(wb.HalfSpace(), name="floor")
    track = np.array([(along, 0.0, z - 0.05, 0.0, 0.0, 0.0, 1.0) for z in high])
    clip = wb.retarget(replace(motion, positions=lifted), human, scene, things={"lift": track})
    for side, mask in stood.items():
        heel = places(clip, f"{side}_heel")[mask]
        steps = np.linalg.norm(np.diff(places(clip, f"{side}_heel")[:, :2], axis=0), axis=1)[mask[1:] & mask[:-1]]
        assert np.abs(heel[:, 2] - high[mask]).max() < 0.01
        assert steps.mean() < 0.01 * DT
    assert wb.check(clip, scene).deepest < 1e-3

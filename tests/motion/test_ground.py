"""What a recorded person stands on, and figures that stand there: a made-up walker whose footholds are known."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_retargeting import places
from tests.motion.test_things import robot
from wholebody.motion import posture_fit
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import standing
from wholebody.motion.standing_ground import Foothold

DT, STRIDE, STEP = 1 / 30, 0.9, 0.5  # s; s from a step of a foot to its next; m from foot to foot
THIGH, SHANK, ANKLE, TOE = 0.43, 0.42, 0.08, 0.16  # m
Terrain = Callable[[float], float]


def flat(x: float) -> float:
    return 0.0


def stairs(x: float) -> float:
    return 0.15 * float(np.clip(np.floor((x + 0.25) / STEP), 0, 3))


def rocks(x: float) -> float:
    return float(0.05 * np.sin(9.0 * x) + 0.04 * np.cos(23.0 * x))


@cache
def walker(height: Terrain, seconds: float = 3.0, raised: float = 0.0) -> tuple[SkeletonMotion, dict[str, np.ndarray]]:
    """A walk along x with level soles, and in which frames each foot stands; `raised`: or the right foot is held up."""
    count = round(seconds / DT)
    names = [
        "pelvis", "left_hip", "left_knee", "left_ankle", "left_foot", "right_hip", "right_knee", "right_ankle",
        "right_foot", "spine3", "neck", "head", "left_shoulder", "left_elbow", "left_wrist", "right_shoulder",
        "right_elbow", "right_wrist",
    ]  # fmt: skip
    parents = np.array([-1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 9, 12, 13, 9, 15, 16])
    offsets = np.array([
        [0, 0, 0], *leg_offsets(1.0), *leg_offsets(-1.0), [0, 0, 0.3], [0, 0, 0.2], [0.02, 0, 0.12],
        [0, 0.2, 0.15], [0, 0.06, -0.28], [0, 0.02, -0.26], [0, -0.2, 0.15], [0, -0.06, -0.28], [0, -0.02, -0.26],
    ])  # fmt: skip
    at = np.zeros((count, len(names), 3))
    stands = {side: np.zeros(count, dtype=bool) for side in ("left", "right")}
    for k in range(count):
        feet = {}
        for side, sign in (("left", 1.0), ("right", -1.0)):
            phase = k * DT / STRIDE + (0.0 if sign > 0 else 0.5)
            number, share = int(np.floor(phase)), phase % 1.0
            x = 2 * STEP * number + (STEP if sign < 0 else 0.0) - STEP
            swing = np.clip((share - 0.6) / 0.4, 0.0, 1.0)  # a foot stands for 60 % of a stride
            smooth = swing * swing * swing * (10.0 - 15.0 * swing + 6.0 * swing * swing)
            z = height(x) + (height(x + 2 * STEP) - height(x)) * smooth + 0.12 * np.sin(np.pi * smooth)
            feet[side] = np.array([x + 2 * STEP * smooth, 0.1 * sign, z])
            stands[side][k] = swing == 0.0
            if raised:
                lift = raised * min(1.0, 2 * k * DT) if sign < 0 else 0.0
                feet[side] = np.array([0.0, 0.1 * sign, lift])
                stands[side][k] = sign > 0 or k == 0
        under = 0.5 * (feet["left"] + feet["right"])
        low = min(feet["left"][2], feet["right"][2])
        at[k, 0] = [under[0], 0.0, 0.86 + 0.7 * low + 0.3 * under[2]]
        for side, first in (("left", 1), ("right", 5)):
            hip = at[k, 0] + offsets[first]
            ankle = feet[side] + [0.0, 0.0, ANKLE]
            at[k, first : first + 4] = [hip, knee(hip, ankle), ankle, ankle + [TOE, 0.0, 0.03 - ANKLE]]
        for joint in range(9, len(names)):
            at[k, joint] = at[k, parents[joint]] + offsets[joint]
    rotations = np.tile(np.eye(3), (count, len(names), 1, 1))
    return SkeletonMotion(tuple(names), parents, offsets, rotations, at, DT, "walker"), stands


def leg_offsets(sign: float) -> list[list[float]]:
    return [[0, 0.09 * sign, -0.05], [0, 0, -THIGH], [0, 0, -SHANK], [TOE, 0, 0.03 - ANKLE]]


def knee(hip: np.ndarray, ankle: np.ndarray) -> np.ndarray:
    """The knee, forward of the line from hip to ankle."""
    way = ankle - hip
    length = min(float(np.linalg.norm(way)), THIGH + SHANK - 1e-6)
    along = way / np.linalg.norm(way)
    first = (THIGH**2 - SHANK**2 + length**2) / (2 * length)
    ahead = np.array([1.0, 0.0, 0.0]) - along[0] * along
    return hip + first * along + np.sqrt(max(THIGH**2 - first**2, 0.0)) * ahead / np.linalg.norm(ahead)


def slides(clip: wb.Clip, stands: dict[str, np.ndarray]) -> np.ndarray:
    """Speeds of heels and balls of the feet in the middle of their stands, m/s."""
    found = []
    for side, mask in stands.items():
        inner = mask.copy()
        for shift in range(1, 3):
            inner &= np.roll(mask, shift) & np.roll(mask, -shift)
        for point in ("heel", "ball"):
            speed = np.linalg.norm(np.diff(places(clip, f"{side}_{point}"), axis=0), axis=1) / clip.dt
            found.append(speed[inner[1:] & inner[:-1]])
    return np.concatenate(found)


def test_feet_that_pass_each_other_between_two_frames_do_not_overlap(human: wb.Figure, shared_data: Path) -> None:
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_02_03.bvh")  # a run, at 30 Hz
    found = wb.check(wb.retarget(motion, human), wb.Scene(human).add(wb.HalfSpace(), name="floor"))
    assert found.colliding == 0
    assert found.deepest_between < 2e-3


@pytest.mark.parametrize(("name", "between"), [("cmu_12_01_cgspeed", 1e-3), ("cmu_02_01", np.inf)])
def test_of_every_other_frame_none_overlaps(human: wb.Figure, shared_data: Path, name: str, between: float) -> None:
    """A mended frame alone gave way half as far, and 1.3 mm stayed between; one step of a mend left 0.4 mm in it."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / f"{name}.bvh")
    every = dataclasses.replace(
        motion, rotations=motion.rotations[::2], positions=motion.positions[::2], dt=2.0 * motion.dt
    )
    found = wb.check(wb.retarget(every, human), wb.Scene(human).add(wb.HalfSpace(), name="floor"))
    assert found.colliding == 0
    assert found.deepest_between < between


def held_in_front(share: float) -> SkeletonMotion:
    """Somebody who begins with the right foot 10 cm up, and lifts it; the body is at this share of the way to it."""
    motion = walker(flat, 2.5, raised=0.1)[0].part(20, 75)
    places = np.array(motion.positions)
    foot = [motion.names.index(f"right_{part}") for part in ("ankle", "foot")]
    body = [motion.names.index(name) for name in ("left_hip", "right_hip", "left_shoulder", "right_shoulder")]
    places[:, foot, 2] += np.maximum(0.0, np.arange(len(places)) - 35)[:, None] * 0.01
    places[:, foot, 0] += 0.3
    places[:, body, :2] += [0.3 * share, 0.1 - 0.2 * share]
    return dataclasses.replace(motion, positions=places)


def test_a_foot_beside_one_that_bears_the_whole_body_hangs() -> None:
    """A clip that begins with it does not tell that it came down; on a step it would bear something."""
    assert not any(held_up.role.startswith("right") for held_up in wb.motion.ground(held_in_front(0.0)).footholds)
    stands = [each for each in wb.motion.ground(held_in_front(0.4)).footholds if each.role == "right_ankle"]
    assert [each.height for each in stands] == pytest.approx([0.1], abs=0.01)


@pytest.mark.parametrize("height", [flat, stairs, rocks])
def test_feet_rest_where_they_do(height: Terrain) -> None:
    motion, stands = walker(height)
    found = wb.motion.ground(motion)
    for side, mask in stands.items():
        for part in ("ankle", "toe"):
            assert (found.rests[f"{side}_{part}"] == mask).mean() > 0.9
    for each in found.footholds:
        lowest = min(height(STEP * step) for step in range(-1, 6))
        foot = each.place[0] - (TOE if each.role.endswith("toe") else 0.0)
        assert each.height == pytest.approx(height(round(foot / STEP) * STEP) - lowest, abs=0.02)


@pytest.mark.parametrize("tread", [0.42, 0.68])
def test_the_foot_that_alone_is_slow_bears_on_steep_stairs(tread: float) -> None:
    """Two stairs lower or higher than the other one in a stride: heel and toe are slow, and were taken to hang."""
    motion, stands = walker(lambda x: -0.14 / 0.42 * tread * float(np.floor((x + 0.01) / tread)), 5.0)
    found = wb.motion.ground(motion)
    for side, mask in stands.items():
        seen = np.any([found.rests[f"{side}_{part}"] for part in ("ankle", "toe")], axis=0)
        assert (seen == mask).mean() > 0.95


@pytest.mark.parametrize("size", [0.4, 3.0])
def test_skeletons_of_any_size_rest_when_a_person_does(size: float, tmp_path: Path) -> None:
    """A toy and a giant climb stairs; a robot that gets their walks goes as behind the person."""
    motion, _ = walker(stairs)
    own, other = wb.motion.ground(motion), wb.motion.ground(motion.resized(size))
    for role, mask in own.rests.items():
        assert (other.rests[role] == mask).mean() > 0.98
    assert other.levels == pytest.approx(tuple(size * level for level in own.levels), abs=0.005 * size)
    for one, big in zip(own.footholds, other.footholds, strict=True):
        assert np.abs(big.place - size * one.place).max() < 0.01 * size
    level, figure = walker(flat, 1.0)[0], robot(tmp_path)
    assert np.abs(wb.retarget(level.resized(size), figure).q - wb.retarget(level, figure).q).max() < 0.02


def test_levels_are_found() -> None:
    assert wb.motion.ground(walker(flat)[0]).levels == (0.0,)
    found = wb.motion.ground(walker(stairs)[0])
    assert found.levels == pytest.approx((0.0, 0.15, 0.3, 0.45), abs=0.01)
    assert "0.15" in str(found)


def test_a_foot_that_is_held_up_does_not_rest() -> None:
    found = wb.motion.ground(walker(flat, 2.0, raised=0.25)[0])
    assert found.rests["left_ankle"].all()
    assert not found.rests["right_ankle"][10:].any()


def test_knees_rest_on_the_ground_though_hands_are_recorded_below_it(human: wb.Figure, shared_data: Path) -> None:
    """Somebody gets up with hands up to 10 cm below the soles' level: arms bend, and the body is not lifted off."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "deepmimic_getup_facedown.bvh")
    clip, found = wb.retarget(motion, human), wb.motion.ground(motion)
    for side in ("left", "right"):
        knee = places(clip, f"{side}_knee")[found.rests[f"{side}_knee"]]
        assert len(knee) > 10
        assert knee[:, 2].max() < 0.16  # 0.23 m where the body goes up with the hands; 0.1 m is on the floor


def test_toes_that_are_tucked_under_stay_on_the_ground(human: wb.Figure) -> None:
    """Somebody goes down on a knee: the sole turns from level to upright over the toes, which rest all the time."""
    motion, _ = walker(flat, 2.0)
    at, down = np.array(motion.positions), np.clip(np.arange(len(motion)) * DT / 0.8, 0.0, 1.0)
    smooth = down * down * (3.0 - 2.0 * down)
    at[:, :, 1] = motion.positions[0, :, 1]
    foot = 0.26  # m from ankle to toe, longer than a person's, so that followed alone the toes end 10 cm up
    toe, left = np.array([-0.4 + foot, -0.1, 0.03]), np.array([0.4, 0.1, ANKLE])
    for k, share in enumerate(smooth):
        at[k, 0] = [0.0, 0.0, 0.8 - 0.25 * share]
        angle = 0.2 + share * (0.5 * np.pi - 0.2)
        ankle = toe + foot * np.array([-np.cos(angle), 0.0, np.sin(angle)])
        for first, end, far in ((1, left, left + [TOE, 0.0, 0.03 - ANKLE]), (5, ankle, toe)):
            hip = at[k, 0] + motion.offsets[first]
            at[k, first : first + 4] = [hip, knee(hip, end), end, far]
        for joint in range(9, len(motion.names)):
            at[k, joint] = at[k, motion.parents[joint]] + motion.offsets[joint]
    motion = dataclasses.replace(motion, positions=at)
    assert wb.motion.ground(motion).rests["right_toe"].mean() > 0.9
    clip = wb.retarget(motion, human)
    toes = [height_of(clip, k, "right_toes") for k in range(0, len(clip), 5)]
    assert max(toes) < 0.02  # m; 0.075 where nothing draws them down


def height_of(clip: wb.Clip, frame: int, segment: str) -> float:
    """Height of the lowest point of a segment, metres."""
    floor = wb.Scene(clip.figure).add(wb.HalfSpace(), name="floor")
    near = floor.contacts(clip.q[frame], within=0.5)
    return min(
        float(gap)
        for gap, pair in zip(near.distance, near.pair, strict=True)
        if {floor.piece_owner[piece] for piece in pair} == {segment, "floor"}
    )


def test_feet_of_who_kneels_do_not_rest() -> None:
    motion, _ = walker(flat, 1.0)
    at = np.repeat(motion.positions[:1], len(motion), axis=0)
    for joint in (2, 6):  # knees; the shanks are level, and the feet up behind
        at[:, joint, 2] = 0.05
        at[:, joint + 1] = at[:, joint] + [-SHANK, 0.0, 0.12]
        at[:, joint + 2] = at[:, joint + 1] + [-0.03, 0.0, TOE]
    assert not wb.motion.ground(dataclasses.replace(motion, positions=at)).footholds


def test_feet_slide_no_more_and_bodies_jerk_no_more_at_higher_rates(
    human: wb.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.DT", 1 / 120)
    motion, stands = walker.__wrapped__(flat, 0.8)
    clip = wb.retarget(motion, human)
    slid = slides(clip, stands)
    assert slid.mean() < 1e-4
    assert slid.max() < 2e-3
    ours, theirs = places(clip, "pelvis"), motion.positions[:, motion.names.index("pelvis")]
    jerks = [np.sqrt((np.diff(path, 3, axis=0) ** 2).mean()) for path in (ours, theirs)]
    assert jerks[0] < 2.0 * jerks[1]


def test_a_person_stands_on_the_floor_and_does_not_slide(human: wb.Figure) -> None:
    motion, stands = walker(flat, 1.2)
    clip = wb.retarget(motion, human)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    assert max(-scene.contacts(q, 0.01).distance.min(initial=0.0) for q in clip.q) < 5e-4
    assert slides(clip, stands).mean() < 2e-3
    for side, mask in stands.items():
        assert np.abs(places(clip, f"{side}_heel")[mask, 2]).mean() < 1.5e-3
    loose = wb.retarget(motion, human, ground=None)
    assert slides(loose, stands).mean() > 2e-2  # legs are of other lengths
    errors = [np.median(np.concatenate(list(wb.motion.bone_errors(motion, each).values()))) for each in (clip, loose)]
    assert errors[0] - errors[1] < np.radians(1.5)


def test_a_person_climbs_stairs_that_stand_there(human: wb.Figure) -> None:
    motion, stands = walker(stairs, 2.0)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    for step in (1, 2, 3):  # each from its edge, half a step before its foothold, to x = 5 m
        edge = STEP * step - 0.25
        scene.add(wb.Box((5.0 - edge, 2.0, 0.15 * step)), name=f"step {step}", at=(0.5 * (5.0 + edge), 0, 0.075 * step))
    clip = wb.retarget(motion, human, scene)
    assert max(-scene.contacts(q, 0.01).distance.min(initial=0.0) for q in clip.q) < 2e-3
    assert slides(clip, stands).mean() < 2e-3


def test_who_lags_behind_among_things_lags_by_a_step_and_not_by_all_of_them(human: wb.Figure) -> None:
    """Legs of this walker reach farther than a person's; at things the lacks of steps must not add up."""
    motion, stands = walker(flat, 4.0)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor").add(wb.Box((0.2, 0.2, 0.2)), name="post", at=(0, 3, 0.1))
    clip, loose = (wb.retarget(motion, human, scene, ground=ground) for ground in ("auto", None))
    behind = places(loose, "left_foot")[stands["left"], 0] - places(clip, "left_foot")[stands["left"], 0]
    assert behind.max() < 0.5  # 0.36; where each step keeps 0.8 of what lacks it is 0.86 after 4 s, and grows


def test_heels_over_the_edge_of_a_step_stay_level(human: wb.Figure) -> None:
    """Ankles are 2 cm behind the edges of steps: heels, asked to be on the ground below, threw the body metres away."""
    motion, stands = walker(stairs, 2.0)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    for step in (1, 2, 3):
        edge = STEP * step - 0.02
        scene.add(wb.Box((5.0 - edge, 2.0, 0.15 * step)), name=f"step {step}", at=(0.5 * (5.0 + edge), 0, 0.075 * step))
    clip = wb.retarget(motion, human, scene)
    for side, mask in stands.items():
        heel, ball = (places(clip, f"{side}_{point}")[mask, 2] for point in ("heel", "ball"))
        assert np.abs(heel - ball).max() < 0.02
    assert slides(clip, stands).mean() < 2e-3
    assert max(-scene.contacts(q, 0.01).distance.min(initial=0.0) for q in clip.q) < 2e-3


def test_arms_that_were_recorded_inside_the_trunk_are_outside(human: wb.Figure) -> None:
    motion, _ = walker(flat, 0.3)
    at = np.array(motion.positions)
    for joint, inside in ((13, (0.0, 0.12, 1.0)), (14, (0.05, 0.02, 0.85))):
        at[:, joint] = at[:, 0] * [1.0, 0.0, 0.0] + inside
    inside = SkeletonMotion(motion.names, motion.parents, motion.offsets, motion.rotations, at, DT, "inside")
    scene = wb.Scene(human)
    depths = [
        max(-scene.contacts(q, 0.01).distance.min(initial=0.0) for q in wb.retarget(inside, human, ground=ground).q)
        for ground in (None, "auto")
    ]
    assert depths[0] > 0.02
    assert depths[1] < 1e-3


def test_speed_limits_hold() -> None:
    """Feet that go twice as fast, of a person whose knees turn at 3 rad/s at most."""
    motion, _ = walker(flat, 1.0)
    slow = wb.load("human", stature=1.75)
    limit = np.array(slow.model.velocityLimit)
    limit[6:] = 3.0
    slow.model.velocityLimit = limit
    clip = wb.retarget(motion, slow)
    assert np.abs(clip.velocities()[:, 6:]).max() < 3.0 * (1.0 + 1e-3)
    assert not wb.check(clip).speeds


def test_first_frames_are_mended_within_speed_limits(shared_data: Path) -> None:
    """Frames of which a motion between the first two overlaps; no posture is before the first one."""
    slow = wb.load("human")
    slow.model.velocityLimit = np.concatenate([np.full(6, np.inf), np.full(slow.model.nv - 6, 4.0)])
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_02_03.bvh").part(8, 20)
    clip = wb.retarget(dataclasses.replace(motion, dt=1 / 30), slow)
    hinges = [joint.idx_q for joint in slow.model.joints[2:] if joint.nq == 1]
    assert np.abs(np.diff(clip.q[:, hinges], axis=0)).max() < 4.0 / 30.0 * (1.0 + 1e-6)


@pytest.fixture
def program_rows(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many bounds and rows each program of retargeting has."""
    rows, solve = list[int](), posture_fit.daqp.solve

    def counted(*program: Any, **settings: Any) -> Any:
        rows.append(len(program[2]))
        return solve(*program, **settings)

    monkeypatch.setattr(posture_fit.daqp, "solve", counted)
    return rows


def test_frames_without_room_are_told_and_their_programs_stay_small(tmp_path: Path, program_rows: list[int]) -> None:
    figure = robot(tmp_path)  # of few pieces
    low = wb.Scene(figure).add(wb.HalfSpace(), name="floor").add(wb.Box((9, 9, 1)), name="ceiling", at=(0, 0, 0.5))
    with pytest.warns(UserWarning, match="3 of 3 frames, or motions to the next, overlap") as told:
        clip = wb.retarget(walker(flat, 0.1)[0], figure, low)
    check = wb.check(clip, low)
    assert (check.depth > 2e-3).all()
    assert any(f"by {1e3 * check.deepest:.0f} mm" in str(one.message) for one in told)
    # those of ways between frames that both overlap came to ten times as many
    assert max(program_rows) < len(low.geometry.collisionPairs)


def test_programs_of_many_pieces_without_room_stay_small(program_rows: list[int]) -> None:
    """Its 39 spheres are all inside the floor or the ceiling: a program of their hundreds of rows took a second."""
    person = wb.load("human", detail="spheres")
    low = wb.Scene(person).add(wb.HalfSpace(), name="floor").add(wb.Box((9, 9, 1)), name="ceiling", at=(0, 0, 1.0))
    wb.retarget(walker(flat, 0.07)[0], person, low)
    assert max(program_rows) <= person.model.nv + len(person.cones)


def test_feet_that_are_held_inside_the_floor_are_told_before(human: wb.Figure) -> None:
    standing = human.grounded(human.posture("standing"), wb.Scene(human).add(wb.HalfSpace(), name="floor"))
    sunk = standing.copy()
    sunk[2] -= 0.03
    clip = wb.Clip(human, np.tile(sunk, (3, 1)), DT)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    with pytest.warns(UserWarning, match=r"left_foot .* 30 mm inside floor.*hold_feet=False"):
        wb.avoid(clip, scene, progress=lambda _: True)
    assert wb.avoid(clip, scene, hold_feet=False).report.after.free


@pytest.mark.parametrize("frozen", ["root", "all"])
def test_what_is_frozen_inside_things_or_the_body_is_told_before(frozen: str, human: wb.Figure) -> None:
    """A box comes to a frozen pelvis in frame 1, or a frozen body has an elbow inside its trunk from frame 2 on."""
    q, scene = np.tile(human.posture("standing"), (4, 1)), wb.Scene(human)
    if frozen == "root":
        q[0, 0] -= 1.0
        at = human.placement(q[1], "pelvis").translation
        scene.add(wb.Box((0.1, 0.1, 0.1)), name="box", at=at)
        terms, said = (
            wb.Freeze("root"),
            r"pelvis is frozen up to .* mm inside box \(first in frame 1\); leave that Freeze",
        )
    else:
        joint = human.model.joints[human.model.getJointId("left_shoulder_abduction")]
        q[2:, joint.idx_q] = human.model.lowerPositionLimit[joint.idx_q]
        terms, said = wb.Freeze(*human.joints), r"left_\w+ is frozen .* inside \w+ \(first in frame 2\)"
    with pytest.warns(UserWarning, match=said):
        left = wb.avoid(wb.Clip(human, q, DT), scene, constraints=[terms], progress=lambda _: True).report
    assert not left.solved
    assert not left.before.free


def test_what_feet_and_hands_carry_into_things_is_told_before(human: wb.Figure) -> None:
    floor = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    clip = wb.Clip(human, np.tile(human.grounded(human.posture("standing"), floor), (3, 1)), DT)
    skate = wb.Box((0.2, 0.02, 0.04))
    floor.attach(skate, to="left_foot", name="skate", at=(0.05, 0.0, -0.09), rests_on=["left_foot", "left_toes"])
    with pytest.warns(UserWarning, match=r"skate .* inside floor.*hold_feet=False"):
        carried = wb.avoid(clip, floor, progress=lambda _: True).report
    assert not carried.solved
    assert "inside floor" in carried.message
    at = human.placement(clip.q[0], "right_palm").translation
    beside = wb.Scene(human).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=at)
    with pytest.warns(UserWarning, match=r"right_hand .* inside box"):
        held = wb.avoid(clip, beside, constraints=[wb.Hold("right_palm")], progress=lambda _: True).report
    assert not held.solved
    assert "inside box" in held.message


def test_a_jump_that_collides_and_ends_that_overlap_are_told_before(human: wb.Figure) -> None:
    standing = human.posture("standing")
    inside = human.with_joints(standing, {"right_shoulder_abduction": -0.3})
    bent = human.with_joints(inside, {"left_elbow_flexion": 1.0})
    clip = wb.Clip(human, [inside, inside, bent, bent, standing], DT)
    said = r"jumps from frame 1 to 2 \(left_elbow_flexion by 0.74 rad.*clip\[:2\].*first posture.*give clip\[4:\]"
    with pytest.warns(UserWarning, match=said):
        wb.avoid(clip, keep_ends=True, progress=lambda _: True)
    with pytest.warns(UserWarning, match=r"last posture overlaps by .* give clip\[:1\]"):
        wb.avoid(wb.Clip(human, [standing, inside], DT), keep_ends=True, progress=lambda _: True)
    with pytest.warns(UserWarning, match="jumps from frame 1 to 2"):
        freed = wb.avoid(wb.Clip(human, [inside, inside, bent, bent], DT)).report
    assert (freed.solved, "jumps" in freed.message) == (True, False)
    with warnings.catch_warnings():  # a recording that is only fast, or jumps where it is free
        warnings.simplefilter("error")
        wb.avoid(wb.Clip(human, [inside, inside], DT), progress=lambda _: True)
        fast = [human.with_joints(standing, {"left_elbow_flexion": by}) for by in (0.1, 1.3, 1.3)]
        freed = wb.avoid(wb.Clip(human, fast, DT), keep_ends=True)
    np.testing.assert_array_equal(freed.clip.q[[0, -1]], [fast[0], fast[-1]])


def test_stance_of_a_clip_on_uneven_ground(human: wb.Figure) -> None:
    motion, stands = walker(rocks, 1.2)
    clip = wb.retarget(motion, human)
    found = standing(human, clip.q, clip.dt)
    for side, mask in stands.items():
        assert (found[f"{side}_heel"] == mask).mean() > 0.9
        assert (found[f"{side}_ball"] == mask).mean() > 0.9


@pytest.mark.parametrize(
    ("given", "sentence"), [("floor", "retarget: ground"), ("other", "the ground is of another recording")]
)
def test_wrong_grounds_are_one_sentence(human: wb.Figure, given: str, sentence: str) -> None:
    ground = wb.motion.ground(walker(flat)[0]) if given == "other" else given
    with pytest.raises(wb.InputError, match=sentence):
        wb.retarget(walker(flat, 0.5)[0], human, ground=ground)


def nowhere(count: int) -> dict[str, np.ndarray]:
    return {"left_toe": np.full(count, np.nan)}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rests": nowhere(60)}, r"rests of left_toe are .*; give True or False for each frame"),
        ({"rests": {"tail": np.ones(60, dtype=bool)}}, "rests: no role is called 'tail'"),
        ({"rests": {"left_toe": [True], "left_ankle": [True, False]}}, r"left_toe 1, left_ankle 2\); give one for"),
        ({"rests": None}, "rests is a NoneType, not a Mapping; give role to value"),
        ({"footholds": (Foothold("left_toe", 5, 5, np.zeros(3), 0.0),)}, r"end is 5; give a whole number between 6"),
        ({"lowest": {"left_toe": np.nan}}, "lowest of left_toe is nan; give a finite number"),
        ({"levels": (np.nan,)}, "a level is nan; give a finite number"),
        ({"uneven": "x"}, "uneven is 'x'; give True or False"),
    ],
)
def test_a_changed_ground_is_checked(change: dict[str, Any], sentence: str) -> None:
    found = wb.motion.ground(walker(flat, 2.0)[0])
    with pytest.raises((wb.InputError, wb.UnknownNameError), match=f"Ground: .*{sentence}") as told:
        dataclasses.replace(found, **change)
    assert "\n" not in str(told.value)


def test_a_changed_ground_keeps_what_is_not_changed() -> None:
    found = wb.motion.ground(walker(stairs, 2.0)[0])
    again = dataclasses.replace(found, rests={role: mask.astype(float) for role, mask in found.rests.items()})
    assert str(again) == str(found)
    assert all(mask.dtype == bool for mask in again.rests.values())

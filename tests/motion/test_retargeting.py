"""Retargeting: real recordings and made-up skeletons, judged by forward kinematics of the figure alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion import retargeting
from wholebody.motion.holds import Holds
from wholebody.motion.posture_fit import Fitter
from wholebody.motion.roles import matched
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.tasks import ReachCones

CLIPS = ("cmu_13_26_cgspeed_30fps", "deepmimic_getup_facedown")
BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
SIDES = ("left", "right")


def bone(clip: wb.Clip, first: str, second: str) -> np.ndarray:
    """Unit directions (n, 3) from one frame of the figure to another."""
    model, data = clip.figure.model, clip.figure.model.createData()
    ways = []
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        a, b = (data.oMf[clip.figure.frame_id(name)].translation for name in (first, second))
        ways.append(b - a)
    return np.array(ways) / np.linalg.norm(ways, axis=1)[:, None]


def within(clip: wb.Clip) -> bool:
    cones = ReachCones().resolve(wb.Scene(clip.figure), clip.figure.neutral)
    state = wb.Scene(clip.figure).state(clip.q[0])
    return all(clip.figure.within_limits(q, 0.0) and cones.value(state.update(q)).min() > -1e-5 for q in clip.q)


def person(frames: int = 20, tall: float = 1.0, walking: bool = False) -> SkeletonMotion:
    """A skeleton with the names of SMPL that lifts its arms, and walks on the spot in which its left foot stands."""
    offsets = {
        "pelvis": ("", (0.0, 0.0, 0.0)), "left_hip": ("pelvis", (0.0, 0.09, -0.05)),
        "left_knee": ("left_hip", (0.0, 0.0, -0.42)), "left_ankle": ("left_knee", (0.0, 0.0, -0.41)),
        "left_foot": ("left_ankle", (0.13, 0.0, -0.05)), "right_hip": ("pelvis", (0.0, -0.09, -0.05)),
        "right_knee": ("right_hip", (0.0, 0.0, -0.42)), "right_ankle": ("right_knee", (0.0, 0.0, -0.41)),
        "right_foot": ("right_ankle", (0.13, 0.0, -0.05)), "spine3": ("pelvis", (0.0, 0.0, 0.3)),
        "neck": ("spine3", (0.0, 0.0, 0.2)), "head": ("neck", (0.02, 0.0, 0.12)),
        "left_shoulder": ("spine3", (0.0, 0.18, 0.15)), "left_elbow": ("left_shoulder", (0.0, 0.28, 0.0)),
        "left_wrist": ("left_elbow", (0.0, 0.26, 0.0)), "right_shoulder": ("spine3", (0.0, -0.18, 0.15)),
        "right_elbow": ("right_shoulder", (0.0, -0.28, 0.0)), "right_wrist": ("right_elbow", (0.0, -0.26, 0.0)),
    }  # fmt: skip
    names = tuple(offsets)
    parents = np.array([names.index(parent) if parent else -1 for parent, _ in offsets.values()])
    local = np.tile(np.eye(3), (frames, len(names), 1, 1))
    for k in range(frames):
        lift = -1.2 + 1.5 * k / max(1, frames - 1)
        local[k, names.index("left_shoulder")] = pin.utils.rotate("x", lift)
        local[k, names.index("right_shoulder")] = pin.utils.rotate("x", -lift)
        local[k, names.index("right_hip")] = pin.utils.rotate("y", -0.8 * k / frames if walking else 0.0)
    root = np.tile([0.0, 0.0, 0.94], (frames, 1))
    return SkeletonMotion.moved(
        names, parents, tall * np.array([o for _, o in offsets.values()]), local, tall * root, 1 / 30
    )


def places(clip: wb.Clip, frame: str) -> np.ndarray:
    """Places (n, 3) of a frame of the figure."""
    model, data = clip.figure.model, clip.figure.model.createData()
    found = []
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        found.append(np.array(data.oMf[clip.figure.frame_id(frame)].translation))
    return np.array(found)


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angles (n,) between directions, degrees."""
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.degrees(np.arccos(np.clip((first * second).sum(axis=1) / lengths, -1.0, 1.0)))


def furthest(clip: wb.Clip, other: wb.Clip) -> float:
    return max(
        float(np.abs(pin.difference(clip.figure.model, a, b)).max()) for a, b in zip(clip.q, other.q, strict=True)
    )


@pytest.mark.parametrize("name", CLIPS)
def test_real_recordings_keep_the_directions_of_their_limbs(name: str, human: Figure, shared_data: Path) -> None:
    motion = wb.motion.read_skeleton(shared_data / "mocap" / f"{name}.bvh").part(0, 20)
    clip = wb.retarget(motion, human)
    assert len(clip) == 20
    assert clip.dt == motion.dt
    assert within(clip)
    joints = matched(motion, human, None).joints
    off = []
    for side in SIDES:
        for first, second in BONES:
            a, b = (motion.names.index(joints[f"{side}_{part}"]) for part in (first, second))
            off.append(
                angles(
                    bone(clip, f"{side}_{first}", f"{side}_{second}"), motion.positions[:, b] - motion.positions[:, a]
                )
            )
    assert np.mean(off) < 6.0
    assert np.max(off) < 35.0


def test_a_skeleton_of_the_same_directions_is_followed_whatever_its_size(human: Figure) -> None:
    for tall in (0.6, 1.3):
        motion = person(tall=tall)
        clip = wb.retarget(motion, human)
        assert within(clip)
        for side in SIDES:
            for first, second in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
                a, b = (motion.names.index(f"{side}_{part}") for part in (first, second))
                way = motion.positions[:, b] - motion.positions[:, a]
                assert angles(bone(clip, f"{side}_{first}", f"{side}_{second}"), way).max() < 6.0


def test_feet_that_stand_stay_where_they_are_at_the_height_of_the_floor(human: Figure) -> None:
    clip = wb.retarget(person(30, walking=True), human)
    standing = wb.Clip(human, [human.neutral], 1.0)  # type: ignore[arg-type]
    for frame in ("left_ankle", "left_toe_extension"):
        at = places(clip, frame)
        assert np.ptp(at, axis=0).max() < 2e-3
        assert at[:, 2] == pytest.approx(places(standing, frame)[0, 2], abs=2e-3)
    assert np.ptp(places(clip, "right_ankle")[:, 0]) > 0.3


def test_the_answer_does_not_depend_on_the_frame_it_starts_from(human: Figure, shared_data: Path) -> None:
    """Played backwards, the same postures come out; and so they do, away from the cut, from the middle on."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_02_07.bvh").part(200, 232)
    clip = wb.retarget(motion, human)
    back = wb.retarget(replace(motion, rotations=motion.rotations[::-1], positions=motion.positions[::-1]), human)
    late = wb.retarget(motion.part(10, 32), human)
    for frame in ("left_wrist", "right_elbow", "head"):  # feet come down where they were led
        own = places(clip, frame)
        assert np.linalg.norm(own - places(back, frame)[::-1], axis=1).max() < 0.03
        assert np.linalg.norm(own[24:] - places(late, frame)[14:], axis=1).max() < 0.03


def test_a_retargeted_clip_is_smooth_where_the_recording_is(human: Figure) -> None:
    """Arms that pass their singular direction, straight out to the sides, at constant speed."""
    clip = wb.retarget(person(30), human)
    assert np.abs(np.diff(clip.q[:, 7:], axis=0)).max() < 0.24


def test_a_robot_follows(human: Figure, tmp_path: Path) -> None:
    """A fixed arm of two hinges takes the part of the left arm, as a TOML file says."""
    link = """<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
      </inertial></link>"""
    joint = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/>
      <axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="1" velocity="100"/></joint>"""
    parts = [link.format(name) for name in ("base", "upper", "lower", "tool")]
    parts += [joint.format("lift", "base", "upper", "0 0 1"), joint.format("bend", "upper", "lower", "0 0.5 0")]
    parts.append(joint.format("turn", "lower", "tool", "0 0.4 0"))
    (tmp_path / "arm.urdf").write_text(f"<robot name='arm'>{''.join(parts)}</robot>")
    (tmp_path / "bones.toml").write_text(
        "[figure]\nleft_shoulder = 'upper'\nleft_elbow = 'lower'\nleft_wrist = 'tool'\n"
    )
    arm = wb.load(tmp_path / "arm.urdf")
    clip = wb.retarget(person(10), arm, names=tmp_path / "bones.toml")
    lift = np.linspace(-1.2, 0.3, 10)
    assert clip.q[:, 0] == pytest.approx(lift, abs=0.02)
    assert clip.q[:, 1] == pytest.approx(np.zeros(10), abs=0.02)


def test_feet_that_stand_move_with_the_pelvis_of_a_fixed_figure(tmp_path: Path) -> None:
    """The pelvis goes forward over feet that stand; where it cannot move, the legs go back below it."""
    still, turn = person(20), np.linspace(-0.3, 0.3, 20)
    local = np.tile(np.eye(3), (20, len(still.names), 1, 1))
    for side in ("left", "right"):
        for k, angle in enumerate(turn):
            local[k, still.names.index(f"{side}_hip")] = pin.utils.rotate("y", angle)
            local[k, still.names.index(f"{side}_ankle")] = pin.utils.rotate("y", -angle)
    leg = 0.83
    root = np.array([[leg * np.sin(angle), 0.0, 0.11 + leg * np.cos(angle)] for angle in turn])
    motion = SkeletonMotion.moved(still.names, still.parents, still.offsets, local, root, 1 / 30)
    feet = motion.positions[:, motion.names.index("left_ankle")]
    assert np.ptp(feet, axis=0).max() < 1e-12
    inertia = """<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"""
    parts = [f"<link name='base'>{inertia}</link>"]
    for side, away in (("left", 0.09), ("right", -0.09)):
        above = "base"
        for part, at in (("hip", f"0 {away} -0.05"), ("knee", "0 0 -0.42"), ("ankle", "0 0 -0.41")):
            parts.append(f"<link name='{side}_{part}_link'>{inertia}</link>")
            parts.append(
                f"<joint name='{side}_{part}' type='revolute'><parent link='{above}'/>"
                f"<child link='{side}_{part}_link'/><origin xyz='{at}'/><axis xyz='0 1 0'/>"
                "<limit lower='-2' upper='2' effort='1' velocity='1'/></joint>"
            )
            above = f"{side}_{part}_link"
    (tmp_path / "legs.urdf").write_text(f"<robot name='legs'>{''.join(parts)}</robot>")
    clip = wb.retarget(motion, wb.load(tmp_path / "legs.urdf"))
    for side in SIDES:
        way = motion.positions[:, motion.names.index(f"{side}_ankle")]
        way = way - motion.positions[:, motion.names.index(f"{side}_hip")]
        assert angles(places(clip, f"{side}_ankle") - places(clip, f"{side}_hip"), way).max() < 5.0


CONVENTIONS = {
    "Mixamo": {
        "pelvis": "mixamorig:Hips", "spine3": "mixamorig:Spine2", "neck": "mixamorig:Neck", "head": "mixamorig:Head",
        "hip": "mixamorig:{}UpLeg", "knee": "mixamorig:{}Leg", "ankle": "mixamorig:{}Foot",
        "foot": "mixamorig:{}ToeBase", "shoulder": "mixamorig:{}Arm", "elbow": "mixamorig:{}ForeArm",
        "wrist": "mixamorig:{}Hand",
    },
    "LAFAN1": {
        "pelvis": "Hips", "spine3": "Spine2", "neck": "Neck", "head": "Head", "hip": "{}UpLeg", "knee": "{}Leg",
        "ankle": "{}Foot", "foot": "{}Toe", "shoulder": "{}Arm", "elbow": "{}ForeArm", "wrist": "{}Hand",
    },
    "CMU": {
        "pelvis": "root", "spine3": "thorax", "neck": "lowerneck", "head": "head", "hip": "{}femur", "knee": "{}tibia",
        "ankle": "{}foot", "foot": "{}toes", "shoulder": "{}humerus", "elbow": "{}radius", "wrist": "{}wrist",
    },
}  # fmt: skip


@cache
def retargeted() -> tuple[SkeletonMotion, wb.Clip]:
    """A short motion of a skeleton whose names are ours, and what becomes of it."""
    return person(6), wb.retarget(person(6), wb.load("human"))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_skeletons_of_other_names_are_the_same_motion(convention: str, human: Figure) -> None:
    (motion, alone), table = retargeted(), CONVENTIONS[convention]

    def named(joint: str) -> str:
        side, _, part = joint.rpartition("_")
        said = {"left": "l", "right": "r"}.get(side, "") if convention == "CMU" else side.capitalize()
        return table[part].format(said)

    names = tuple(map(named, motion.names))
    other = SkeletonMotion(names, motion.parents, motion.offsets, motion.rotations, motion.positions, motion.dt)
    assert furthest(wb.retarget(other, human), alone) < 1e-9


def test_bones_that_all_rest_along_one_axis_are_the_same_motion(human: Figure) -> None:
    """As LAFAN1 has it: where nothing turns, all bones lie along x, so that nothing stands."""
    motion = person(8)
    turned = np.tile(np.eye(3), (len(motion.names), 1, 1))
    for joint, parent in enumerate(motion.parents):
        way = motion.offsets[joint]
        if parent > 0 and np.linalg.norm(way) > 0.0:
            turned[parent] = pin.Quaternion.FromTwoVectors(np.array([1.0, 0.0, 0.0]), way).toRotationMatrix()
    offsets = np.array(motion.offsets)
    for joint, parent in enumerate(motion.parents):
        offsets[joint] = turned[parent].T @ motion.offsets[joint] if parent >= 0 else 0.0
    lying = SkeletonMotion(
        motion.names, motion.parents, offsets, motion.rotations @ turned, motion.positions, motion.dt
    )
    clip = wb.retarget(lying, human)
    joint = motion.names.index
    for side in SIDES:
        for first, second in BONES:
            way = motion.positions[:, joint(f"{side}_{second}")] - motion.positions[:, joint(f"{side}_{first}")]
            assert angles(bone(clip, f"{side}_{first}", f"{side}_{second}"), way).max() < 12.0, (side, first)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "[figure]\nleft_sholder = 'x'",
            "no part of a body is called 'left_sholder'; did you mean left_sh",
        ),
        ("[figure]\nleft_shoulder = 'x'", "no frame is called 'x'"),
        ("[skeleton]\nleft_shoulder = 'x'", "no joint of the skeleton is called 'x'"),
        ("[skelton]\n", "no table is called 'skelton'"),
        ("[skeleton]\nhead = 3", "head is 3; give the name"),
        ("skeleton = 3", "skeleton is 3; give names by role"),
        ("[skeleton", r"bones\.toml: is not TOML"),
        pytest.param(f"[skeleton]\nhead = {'9' * 5000}", "a number has thousands of digits", id="digits"),
        pytest.param(f"{'a.' * 5000}a = 1", "a key has more than 20 parts", id="parts"),
    ],
)
def test_wrong_names_of_bones_are_one_sentence(text: str, sentence: str, human: Figure, tmp_path: Path) -> None:
    (tmp_path / "bones.toml").write_text(text)
    with pytest.raises(wb.WholebodyError, match=sentence):
        wb.retarget(person(2), human, names=tmp_path / "bones.toml")


def test_a_skeleton_of_unknown_names_is_refused_with_the_way_out(human: Figure) -> None:
    parents, offsets = np.arange(-1, 6), np.tile([0.0, 0.0, 0.2], (7, 1))
    snake = np.tile(np.eye(3), (2, 7, 1, 1))
    strange = SkeletonMotion.moved(tuple(f"bone{k}" for k in range(7)), parents, offsets, snake, np.zeros((2, 3)), 0.1)
    with pytest.raises(wb.InputError, match=r"no bones .* bone0, .*; name them in a TOML file"):
        wb.retarget(strange, human)


def test_an_arm_alone_moves_the_arm_of_a_person_that_stays(human: Figure) -> None:
    whole = person(6)
    kept = [whole.names.index(f"left_{part}") for part in ("shoulder", "elbow", "wrist")]
    arm = SkeletonMotion(
        tuple(whole.names[k] for k in kept), np.array([-1, 0, 1]), whole.offsets[kept], whole.rotations[:, kept],
        whole.positions[:, kept], whole.dt,
    )  # fmt: skip
    names = {"skeleton": {name: name for name in arm.names}}
    clip = wb.retarget(arm, human, names=names)
    assert np.abs(clip.q[:, :3] - human.neutral[:3]).max() < 0.02
    way = arm.positions[:, 2] - arm.positions[:, 1]
    assert angles(bone(clip, "left_elbow", "left_wrist"), way).max() < 8.0
    alone = {"skeleton": {"left_shoulder": "left_shoulder", "right_wrist": "left_wrist"}}
    with pytest.raises(wb.InputError, match="make no bone; name both ends of one"):
        wb.retarget(arm, human, names=alone)


def test_one_frame_is_retargeted(human: Figure) -> None:
    assert len(wb.retarget(person(1), human)) == 1


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_limbs_that_swing_wildly_stay_in_their_cones(human: Figure) -> None:
    """Five frames at 10 Hz in which arms and legs pass through each other: what mends that is drawn to and fro."""
    rng, still, dt = np.random.default_rng(110), person(2), 0.1
    count = int(rng.choice([2, 3, 5, 12, 25]))
    rng.choice(4)
    times, local = dt * np.arange(count), np.tile(np.eye(3), (count, len(still.names), 1, 1))
    for j, name in enumerate(still.names):
        if name in ("pelvis", "neck", "head"):
            continue
        way = rng.normal(size=3) * (1.0 if "should" in name or "hip" in name else 0.4)
        rate, phase = rng.uniform(0.5, 8.0), rng.uniform(0.0, 6.0)
        if "shoulder" in name:
            way[2] += (-1.3 if "left" in name else 1.3) * rng.uniform(0.0, 1.0)
        local[:, j] = [pin.exp3(way * np.sin(rate * t + phase)) for t in times]
    root = np.array([0.0, 0.0, 0.94]) + np.cumsum(0.01 * rng.normal(size=(count, 3)), axis=0)
    clip = wb.retarget(SkeletonMotion.moved(still.names, still.parents, still.offsets, local, root, dt), human)
    assert count == 5
    assert within(clip)


def test_told_overlaps_are_looked_for_beside_the_middle_of_a_motion() -> None:
    """2.1 mm a quarter after frame 1, 1.2 mm there and in the middle; the motion before meets it only at its end."""
    asked = list[float]()

    class Hinge:
        model = pin.Model()

        def see(self, _: object) -> None:
            """Nothing moves."""

        def depth(self, q: np.ndarray) -> float:
            asked.append(float(q[0]))
            return max(0.0, 2.1e-3 - 3.6e-3 * abs(asked[-1] - 1.25))

        def deepest(self, q: np.ndarray) -> tuple[str, str]:
            return f"part at {q[0]}", "floor"

    Hinge.model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    still = cast("Holds", SimpleNamespace(moved=lambda _: {}))
    q, fitter = np.array([[0.0], [1.0], [2.0]]), cast("Fitter", Hinge())
    depths = retargeting._depths(fitter, still, q)
    assert depths.max() == pytest.approx(2.1e-3)
    assert depths[1, 4] == pytest.approx(1.2e-3)
    assert len([at for at in asked if 1.0 < at < 2.0]) == 7
    told = retargeting._said_inside(fitter, still, q, depths)
    assert "1 of 3 frames" in told
    assert "part at 1.25 and floor by 2 mm after frame 1" in told

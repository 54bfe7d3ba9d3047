"""Names of skeletons: those that programs write are known, and what is not known is told."""

from __future__ import annotations

import dataclasses
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_retargeting import person
from wholebody.motion.roles import matched, skeleton_roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.structure import built_figure, upright

LEGS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
KNOWN = {
    "Bandai-Namco": "Hips UpperLeg_L LowerLeg_L Foot_L UpperArm_L LowerArm_L Hand_L",
    "Biovision": "Hips LeftHip LeftKnee LeftAnkle LeftShoulder LeftElbow LeftWrist",
    "Poser": "hip lThigh lShin lFoot lShldr lForeArm lHand",
    "Daz": "hip lThighBend lShin lFoot lShldrBend lForearmBend lHand",
    "3ds Max": "Bip001_Pelvis Bip001_L_Thigh Bip001_L_Calf Bip001_L_Foot Bip001_L_UpperArm Bip001_L_Forearm "
    "Bip001_L_Hand",
    "Unreal": "pelvis thigh_l calf_l foot_l upperarm_l lowerarm_l hand_l",
    "VRM": "hips leftUpperLeg leftLowerLeg leftFoot leftUpperArm leftLowerArm leftHand",
    "VRoid": "J_Bip_C_Hips J_Bip_L_UpperLeg J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_UpperArm J_Bip_L_LowerArm "
    "J_Bip_L_Hand",
    "Rokoko": "Hips LeftThigh LeftShin LeftFoot LeftArm LeftForeArm LeftHand",
    "Motive": "Skeleton_Hip Skeleton_LThigh Skeleton_LShin Skeleton_LFoot Skeleton_LUArm Skeleton_LFArm Skeleton_LHand",
    "Mixamo": "mixamorig:Hips mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftArm "
    "mixamorig:LeftForeArm mixamorig:LeftHand",
    "SMPL-X": "pelvis left_hip left_knee left_ankle left_shoulder left_elbow left_wrist",
    "SMPL": "Pelvis L_Hip L_Knee L_Ankle L_Shoulder L_Elbow L_Wrist",
}


def still(names: tuple[str, ...]) -> SkeletonMotion:
    """A skeleton of these names, a chain whose bones are ten centimetres each."""
    parents, offsets = np.arange(-1, len(names) - 1), np.tile([0.0, 0.0, 0.1], (len(names), 1))
    return SkeletonMotion.moved(
        names, parents, offsets, np.tile(np.eye(3), (1, len(names), 1, 1)), np.zeros((1, 3)), 1.0
    )


@pytest.mark.parametrize("program", KNOWN)
def test_names_of_programs_are_known(program: str, human: wb.Figure) -> None:
    pelvis, *limbs = KNOWN[program].replace("Skeleton_", "Skeleton:").split()
    found = matched(still((pelvis, *limbs)), human, None)
    assert found.joints == {"pelvis": pelvis} | {f"left_{part}": name for part, name in zip(LEGS, limbs, strict=True)}
    assert {"head", "right_knee"} <= set(found.missing)


def test_what_follows_nothing_is_told(human: wb.Figure) -> None:
    left = KNOWN["VRM"].split()[1:]
    names = ("hips", *left, *(name.replace("left", "right") for name in left))
    parents = np.array([-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11])
    limb = np.array([[0, 0.1, -0.1], [0, 0, -0.4], [0, 0, -0.4], [0, 0.2, 0.5], [0, 0, -0.3], [0, 0, -0.25]])
    offsets = np.vstack([np.zeros((1, 3)), limb, limb * (1.0, -1.0, 1.0)])
    local = np.tile(np.eye(3), (2, len(names), 1, 1))
    motion = SkeletonMotion.moved(names, parents, offsets, local, np.tile([0.0, 0.0, 0.9], (2, 1)), 0.02)
    with pytest.warns(
        UserWarning, match=r"no joint of motion is known for chest, neck, head, .*right_hand.*follow nothing"
    ):
        wb.retarget(motion, human)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert matched(motion, human, {"skeleton": {"head": "leftHand"}}).joints["head"] == "leftHand"


def test_nothing_is_told_where_all_joints_were_named(human: wb.Figure) -> None:
    names = {"skeleton": {"left_shoulder": "a", "left_elbow": "b", "left_wrist": "c"}}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        named = wb.retarget(still(("a", "b", "c")), human, names=names)
    with pytest.warns(UserWarning, match="no joint of motion is known for .*left_hand"):
        more = wb.retarget(still(("a", "b", "c", "d")), human, names=names)
    assert more.q == pytest.approx(named.q, abs=1e-6)  # what follows nothing changes nothing


def test_what_goes_on_from_a_shank_is_an_ankle_though_it_is_named_after_the_foot() -> None:
    """Rigs that name joints after hip, knee and foot, and after shoulder, elbow and hand, with toes and fingers."""
    names, parents, offsets = ["hip", "chest", "head"], [-1, 0, 1], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.4], [0.0, 0.0, 0.3]]
    for side, y in (("l", 0.1), ("r", -0.1)):
        legs = [("hip", [0, y, 0]), ("knee", [0, 0, -0.4]), ("foot", [0, 0, -0.4]), ("toe", [0.15, 0, -0.05])]
        arms = [("shoulder", [0, y, 0.1]), ("elbow", [0, y, -0.27]), ("hand", [0, 0, -0.25]), ("finger", [0, 0, -0.1])]
        for start, limb in ((0, legs), (1, arms)):
            for number, (part, offset) in enumerate(limb):
                parents.append(len(names) - 1 if number else start)
                names.append(f"{side}{part}" if part not in ("toe", "finger") else f"{part}1.{side}")
                offsets.append(offset)
    turns = np.tile(np.eye(3), (2, len(names), 1, 1))
    motion = SkeletonMotion.moved(
        tuple(names), np.array(parents), np.array(offsets), turns, np.tile([0.0, 0.0, 0.9], (2, 1)), 0.02
    )
    known = skeleton_roles(motion)
    assert (known["left_ankle"], known["left_toe"]) == ("lfoot", "toe1.l")
    assert (known["right_wrist"], known["right_hand"]) == ("rhand", "finger1.r")
    assert (known["pelvis"], known["chest"]) == ("hip", "chest")


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_structure_tells_what_names_do_not(turn: float, human: wb.Figure) -> None:
    """A person's own skeleton whose joints have numbers, however it stands and wherever it looks."""
    frames = {"pelvis": "pelvis", "chest": "thorax", "head": "head", "crown": "head_top"}
    for side in ("left", "right"):
        frames |= {f"{side}_{part}": f"{side}_{part}" for part in (*LEGS, "toe_tip", "index_tip")}
    above = {"pelvis": "", "chest": "pelvis", "head": "chest", "crown": "head"}
    for side in ("left", "right"):
        for limb in (
            ("pelvis", "hip", "knee", "ankle", "toe_tip"),
            ("chest", "shoulder", "elbow", "wrist", "index_tip"),
        ):
            above |= {f"{side}_{b}": a if a in above else f"{side}_{a}" for a, b in pairwise(limb)}
    names = tuple(above)
    q = human.posture("sitting")
    q[3:7] = 0.0, 0.0, np.sin(0.5 * turn), np.cos(0.5 * turn)
    places = np.array([human.placement(q, frames[name]).translation for name in names])
    parents = np.array([-1, *(names.index(above[name]) for name in names[1:])])
    offsets = np.vstack([np.zeros((1, 3)), places[1:] - places[parents[1:]]])
    local = np.tile(np.eye(3), (2, len(names), 1, 1))
    numbers = tuple(f"joint {number}" for number in range(len(names)))
    motion = SkeletonMotion.moved(numbers, parents, offsets, local, np.tile(places[0], (2, 1)), 0.02)
    found = matched(motion, human, None)
    soles = _with_soles(motion, [numbers[names.index(f"{side}_ankle")] for side in ("left", "right")])
    assert matched(soles, human, None).joints == found.joints  # a joint below an ankle is no toe
    ends = {"toe_tip": "toe", "index_tip": "hand"}
    expected = {name.replace(*next(((a, b) for a, b in ends.items() if a in name), ("", ""))): numbers[k]
                for k, name in enumerate(names) if name != "crown"}  # fmt: skip
    assert found.joints == expected
    assert set(found.by_structure) == set(expected)
    with pytest.warns(UserWarning, match="by the structure of the skeleton .*left_knee is 'joint "):
        wb.retarget(motion, human)
    assert matched(motion, human, {"skeleton": {"left_elbow": "joint 3", "left_wrist": "joint 4"}}).by_structure == ()


def _with_soles(motion: SkeletonMotion, ankles: list[str]) -> SkeletonMotion:
    """The motion with a joint 4 cm below each ankle, from which the foot goes on."""
    names, parents, offsets = list(motion.names), motion.parents.tolist(), [*motion.offsets]
    for ankle in ankles:
        at = names.index(ankle)
        toe = next(k for k, parent in enumerate(parents) if parent == at)
        parents = [parent + (parent >= toe) for parent in parents]
        parents[toe] = toe
        parents.insert(toe, at)
        names.insert(toe, f"below {ankle}")
        offsets.insert(toe, np.array([0.0, 0.0, -0.04]))
        offsets[toe + 1] = offsets[toe + 1] + (0.0, 0.0, 0.04)
    local = np.tile(np.eye(3), (2, len(names), 1, 1))
    return SkeletonMotion.moved(tuple(names), np.array(parents), np.array(offsets), local, motion.positions[:, 0], 0.02)


def robot(folder: Path, links: list[tuple[str, str, tuple[float, ...], float, str]]) -> wb.Figure:
    """A robot of boxes: link before, name, place of its joint in that, size, axis of its joint."""
    lines = ["<robot name='robot'><link name='base'/>"]
    for parent, name, place, size, axis in links:
        at, along = " ".join(map(str, place)), " ".join(str(int(axis == letter)) for letter in "xyz")
        lines.append(
            f"<link name='{name}'><collision><geometry><box size='{size} {size} {size}'/></geometry></collision></link>"
            f"<joint name='{name}_j' type='revolute'><parent link='{parent}'/><child link='{name}'/>"
            f"<origin xyz='{at}'/><axis xyz='{along}'/><limit lower='-2' upper='2' effort='9' velocity='9'/></joint>"
        )
    path = folder / "robot.urdf"
    path.write_text("".join([*lines, "</robot>"]))
    return wb.load(path, root="free")


def test_a_robot_with_long_fingers_has_its_elbows_before_its_wrists(tmp_path: Path) -> None:
    """Fingers of 22 cm, as of the grippers of Talos, and a root link without a shape, as of Romeo."""
    sides = ("left", 1), ("right", -1)
    links = [("base", "torso", (0, 0, 0.4), 0.3), ("torso", "head", (0, 0, 0.3), 0.1)]
    for side, sign in sides:
        links += [("base", f"{side}_a", (0, 0.1 * sign, -0.1), 0.1), (f"{side}_a", f"{side}_b", (0, 0, -0.38), 0.1)]
        links += [(f"{side}_b", f"{side}_c", (0, 0, -0.35), 0.1), ("torso", f"{side}_d", (0, 0.25 * sign, 0.1), 0.05)]
        links += [(f"{side}_d", f"{side}_e", (0, 0, -0.27), 0.05), (f"{side}_e", f"{side}_f", (0, 0, -0.26), 0.05)]
        links += [(f"{side}_f", f"{side}_{end}", (x, 0, -0.22), 0.02) for end, x in (("g", -0.05), ("h", 0.05))]
        links += [(f"{side}_{end}", f"{side}_{end}2", (0, 0, -0.12), 0.02) for end in "gh"]
    figure = robot(tmp_path, [(*link, "y") for link in links])
    found = matched(still(tuple(KNOWN["SMPL-X"].split())), figure, None).frames
    parts = zip(LEGS, "abcdef", strict=True)
    assert found == {"pelvis": "base"} | {f"left_{part}": f"left_{joint}_j" for part, joint in parts}


def test_a_hand_that_rolls_about_the_forearm_begins_at_the_wrist(tmp_path: Path) -> None:
    """As of an H1 with hands: that joint alone is between elbow and fingers, and named after the hand."""
    links = [("base", "torso", (0, 0, 0.4), 0.3, "z")]
    for side, sign in (("left", 1), ("right", -1)):
        hand = f"{side}_hand"
        links += [
            ("base", f"{side}_a", (0, 0.1 * sign, -0.1), 0.1, "y"), (f"{side}_a", f"{side}_b", (0, 0, -0.4), 0.1, "y"),
            (f"{side}_b", f"{side}_c", (0, 0, -0.4), 0.1, "y"), ("torso", f"{side}_d", (0, 0.2 * sign, 0.1), 0.05, "y"),
            (f"{side}_d", f"{side}_e", (0, 0, -0.3), 0.05, "y"), (f"{side}_e", hand, (0, 0, -0.25), 0.05, "z"),
            *((hand, f"{side}_{end}", (x, 0, -0.13), 0.02, "y") for end, x in (("g", -0.02), ("h", 0.02))),
        ]  # fmt: skip
    found = matched(still(tuple(KNOWN["SMPL-X"].split())), robot(tmp_path, links), None).frames
    assert (found["left_elbow"], found["left_wrist"]) == ("left_e_j", "left_hand_j")
    assert "left_hand" not in found


@pytest.mark.parametrize("ahead", [1, -1])
def test_a_small_robot_with_a_stiff_trunk_is_known_by_its_axes(ahead: int, tmp_path: Path) -> None:
    """Numbered joints, of which the third of a leg turns it far below the hip; no wrists; some look backward."""
    links = []
    for side, sign in (("LLEG", ahead), ("RLEG", -ahead)):
        links += [
            ("base", f"{side}_1_R", (0, 0.1 * sign, -0.1), 0.02, "x"),
            (f"{side}_1_R", f"{side}_2", (0,) * 3, 0.02, "y"),
        ]
        links += [
            (f"{side}_2", f"{side}_3_R", (0, 0, -0.15), 0.02, "z"),
            (f"{side}_3_R", f"{side}_4", (0, 0, -0.1), 0.02, "y"),
        ]
        links += [
            (f"{side}_4", f"{side}_5", (0, 0, -0.25), 0.02, "y"),
            (f"{side}_5", f"{side}_6_R", (0,) * 3, 0.06, "x"),
        ]
    for side, sign in (("LARM", ahead), ("RARM", -ahead)):
        links += [
            ("base", f"{side}_1", (0, 0.2 * sign, 0.3), 0.02, "y"),
            (f"{side}_1", f"{side}_2_R", (0,) * 3, 0.02, "x"),
        ]
        links += [(f"{side}_2_R", f"{side}_3", (0, 0, -0.15), 0.3, "y")]
    figure = robot(tmp_path, links)
    found = matched(still(tuple(KNOWN["SMPL-X"].split())), figure, None)
    numbers = dict(zip(LEGS, ("LEG_3_R", "LEG_4", "LEG_6_R", "ARM_2_R", "ARM_3", "ARM_3"), strict=True))
    assert found.frames == {"pelvis": "base"} | {f"left_{part}": f"L{joint}_j" for part, joint in numbers.items()}
    joint, place = found.places(figure)["left_wrist"]
    assert figure.model.names[joint] == "LARM_3_j"
    assert np.abs(place).max() == pytest.approx(0.15)  # the face of its box, 0.3 m wide
    left = figure.placement(upright(figure), "LARM_1").translation
    assert left == pytest.approx([0.0, 0.2, 0.3])


def test_a_robot_of_legs_alone_is_known_where_it_walks(tmp_path: Path) -> None:
    """Numbered joints of two legs; what stands in the world on them is no walker, and what hangs upward has no legs.

    It looks along y, LR is of the legs the right one, and thighs swing 5 cm beside the hips.
    """
    for down in (-1.0, 1.0):
        links = []
        for side, x in (("LL_", -1), ("LR_", 1)):
            links += [("base", f"{side}1", (0.1 * x, 0, 0), 0.02, "y"), (f"{side}1", f"{side}2", (0,) * 3, 0.1, "x")]
            links += [
                (f"{side}2", f"{side}3", (0.05 * x, 0.01, 0.3 * down), 0.1, "x"),
                (f"{side}3", f"{side}4", (0, 0, 0.3 * down), 0.05, "x"),
            ]
        figure = robot(tmp_path, links)
        legs = {"hip": 2, "knee": 3, "ankle": 4}
        known = {
            f"{side}_{part}": f"L{side[0].upper()}_{k}_j" for side in ("left", "right") for part, k in legs.items()
        }
        assert {role: part.joint for role, part in built_figure(figure).items()} == (known if down < 0.0 else {})
        assert built_figure(wb.load(tmp_path / "robot.urdf")) == {}
        if down < 0.0:
            q, found = upright(figure), matched(still(tuple(KNOWN["SMPL-X"].split())), figure, None)
            assert figure.placement(q, "LL_3").translation == pytest.approx([0.01, 0.15, -0.3])
            joint, place = found.places(figure)["left_hip"]
            assert figure.placement(q, figure.model.names[joint]).act(place) == pytest.approx([0.0, 0.15, 0.0])


def test_a_quadruped_is_no_person(tmp_path: Path) -> None:
    """Four limbs alike that hang from a level trunk; RR of its names is no right hip alone."""
    links = []
    for leg, x, y in (("FL", 0.2, 0.1), ("FR", 0.2, -0.1), ("RL", -0.2, 0.1), ("RR", -0.2, -0.1)):
        links += [
            ("base", f"{leg}_hip", (x, y, 0), 0.05, "x"),
            (f"{leg}_hip", f"{leg}_thigh", (0, 0.8 * y, 0), 0.1, "y"),
        ]
        links += [(f"{leg}_thigh", f"{leg}_calf", (0, 0, -0.2), 0.4, "y")]
    figure = robot(tmp_path, links)
    assert built_figure(figure) == {}
    with pytest.raises(wb.InputError, match="no bones of the skeleton are known to belong to robot"):
        matched(still(tuple(KNOWN["SMPL-X"].split())), figure, None)


def test_a_quadruped_with_feet_is_no_person(tmp_path: Path) -> None:
    """Its trunk is level, though each joint has one role."""
    links = []
    for leg, x, y in (("1", 0.2, 0.1), ("2", 0.2, -0.1), ("3", -0.2, 0.1), ("4", -0.2, -0.1)):
        links += [("base", f"{leg}_a", (x, y, 0), 0.05, "y"), (f"{leg}_a", f"{leg}_b", (0, 0, -0.2), 0.05, "y")]
        links += [(f"{leg}_b", f"{leg}_c", (0, 0, -0.2), 0.05, "y")]
    assert built_figure(robot(tmp_path, links)) == {}


def test_a_figure_with_one_freedom_is_refused() -> None:
    figure = wb.figures.adjustable({"a": wb.Box((1, 1, 1))}, height=(0, 1))
    with pytest.raises(wb.InputError, match="no bones of the skeleton are known"):
        wb.retarget(still(tuple(KNOWN["SMPL-X"].split())), figure)


def test_a_part_is_where_the_axes_of_its_joints_meet(tmp_path: Path) -> None:
    """Joints stand 3 cm beside where their axes meet, as of a HighTorque Hi, and toes turn in front of ankles."""
    links = [("base", "torso", (0, 0, 0.3), 0.1, "z")]
    for side, sign in (("left", 1), ("right", -1)):
        links += [
            ("base", f"{side}_1", (0, 0.06 * sign, -0.1), 0.02, "y"),
            (f"{side}_1", f"{side}_2", (0.03, 0.04 * sign, 0), 0.02, "x"),
            (f"{side}_2", f"{side}_3", (-0.03, 0, -0.12), 0.02, "z"),
            (f"{side}_3", f"{side}_4", (0, 0.03 * sign, -0.18), 0.02, "y"),
            (f"{side}_4", f"{side}_5", (0, -0.03 * sign, -0.3), 0.02, "y"),
            (f"{side}_5", f"{side}_6", (0.02, 0, 0), 0.02, "x"),
            (f"{side}_6", f"{side}_7", (0.08, 0, -0.02), 0.02, "y"),
            ("torso", f"{side}_a", (0, 0.1 * sign, 0.1), 0.02, "y"),
            (f"{side}_a", f"{side}_b", (0.03, 0.05 * sign, 0), 0.02, "x"),
            (f"{side}_b", f"{side}_c", (-0.03, 0, -0.2), 0.02, "z"),
            (f"{side}_c", f"{side}_d", (0, 0.02 * sign, -0.05), 0.02, "y"),
            (f"{side}_d", f"{side}_e", (0, -0.02 * sign, -0.2), 0.02, "z"),
            (f"{side}_e", f"{side}_f", (0, 0, -0.03), 0.02, "x"),
        ]
    figure = robot(tmp_path, links)
    found = built_figure(figure)
    places = {role: figure.placement(upright(figure), part.joint).act(part.place) for role, part in found.items()}
    known = {
        "hip": (0.1, -0.1),
        "knee": (0.1, -0.4),
        "ankle": (0.1, -0.7),
        "shoulder": (0.15, 0.4),
        "elbow": (0.15, 0.15),
    }
    for part, (y, z) in known.items():
        for side, sign in (("left", 1), ("right", -1)):
            assert places[f"{side}_{part}"] == pytest.approx([0.0, sign * y, z], abs=1e-6)
    assert found["left_ankle"].joint == "left_6_j"


def test_a_small_robot_follows_as_a_large_one(tmp_path: Path) -> None:
    """Of 15 cm, with bones whose ends miss few metres at any angle."""
    links = [("base", "torso", (0, 0, 0.045), 0.015, "z")]
    for side, sign in (("left", 1), ("right", -1)):
        places = [
            ("base", "1", (0, 0.015 * sign, -0.015), "y"), ("1", "2", (0, 0, 0), "x"), ("2", "3", (0, 0, -0.015), "z"),
            ("3", "4", (0, 0, -0.045), "y"), ("4", "5", (0, 0, -0.06), "y"), ("5", "6", (0, 0, 0), "x"),
            ("torso", "a", (0, 0.03 * sign, 0.03), "y"), ("a", "b", (0, 0, 0), "x"), ("b", "c", (0, 0, -0.015), "z"),
            ("c", "d", (0, 0, -0.03), "y"), ("d", "e", (0, 0, -0.04), "x"),
        ]  # fmt: skip
        for parent, name, at, axis in places:
            above = parent if len(parent) > 1 else f"{side}_{parent}"
            links.append((above, f"{side}_{name}", at, 0.007, axis))
    motion = person(20)
    clip = wb.retarget(motion, robot(tmp_path, links), ground=None)
    errors = wb.motion.bone_errors(motion, clip)
    assert max(np.degrees(np.median(values)) for values in errors.values()) < 0.1


@pytest.mark.parametrize("clip", ["cmu_02_01.bvh", "cmu_35_01.bvh"])
def test_the_wrist_of_the_archive_is_where_hands_bend(clip: str, human: wb.Figure, shared_data: Path) -> None:
    """Its lwrist turns along the forearm alone; as a wrist, its hand turned one way and its bone went another."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / clip)
    joints = skeleton_roles(motion)
    elbow, wrist, hand = (
        motion.positions[:, motion.names.index(joints[f"left_{part}"])] for part in LEGS[4:] + ("hand",)
    )
    twist = motion.positions[:, motion.names.index("lwrist")]
    assert np.abs(np.cross(twist - elbow, wrist - twist)).max() < 1e-6
    bends = np.cross(wrist - elbow, hand - wrist) / np.linalg.norm(wrist - elbow, axis=1)[:, None]
    assert np.linalg.norm(bends, axis=1).min() > 0.3 * np.linalg.norm(hand - wrist, axis=1).min()
    errors = wb.motion.bone_errors(motion, wb.retarget(motion, human, ground=None))
    for side in ("left", "right"):
        assert np.degrees(np.median(errors[f"{side}_wrist to {side}_hand"])) < 5.0


def test_an_arm_of_the_archive_that_ends_in_its_lwrist_has_a_wrist(shared_data: Path) -> None:
    """Files that were written without hands: the joint that alone goes on from the elbow."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_02_01.bvh")
    hands = tuple(f"{side}{part}" for side in "lr" for part in ("hand", "fingers", "thumb"))
    kept = [k for k, name in enumerate(motion.names) if not name.startswith(hands)]
    cut = dataclasses.replace(
        motion,
        names=tuple(motion.names[k] for k in kept),
        parents=tuple(kept.index(motion.parents[k]) if k else -1 for k in kept),
        offsets=motion.offsets[kept],
        positions=motion.positions[:, kept],
        rotations=motion.rotations[:, kept],
    )
    found = skeleton_roles(cut)
    assert [found.get(f"{side}_wrist") for side in ("left", "right")] == ["lwrist", "rwrist"]
    assert "left_hand" not in found

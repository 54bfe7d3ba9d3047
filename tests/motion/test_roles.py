"""Names of skeletons: those that programs write are known, and what is not known is told."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import wholebody as wb
from wholebody.motion.roles import matched
from wholebody.motion.skeleton import SkeletonMotion

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
    "SMPL": "Pelvis L_Hip L_Knee L_Ankle L_Shoulder L_Elbow L_Wrist",
}


@pytest.fixture(scope="module")
def human() -> wb.Figure:
    return wb.load("human")


@pytest.mark.parametrize("program", KNOWN)
def test_names_of_programs_are_known(program: str, human: wb.Figure) -> None:
    pelvis, *limbs = KNOWN[program].replace("Skeleton_", "Skeleton:").split()
    found = matched((pelvis, *limbs), human, None)
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
        assert matched(names, human, {"skeleton": {"head": "leftHand"}}).joints["head"] == "leftHand"

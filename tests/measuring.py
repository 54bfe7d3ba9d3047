"""The person measured as an anthropometrist measures people, in metres.

Lengths are taken between the skin, which is the surface of the collision pieces, and landmarks. Standing means upright
with hanging arms; sitting means upright with thighs horizontal, shanks vertical and the seat's plane under buttocks and
thighs. Circumferences are those of round pieces; of arms, as far as they are more when flexed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import RELAXED
from wholebody.figures.human.details import SPREAD
from wholebody.figures.postures import support
from wholebody.figures.sizes import MIDDLE_TIP

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure


class _Pose:
    """A figure at one posture: frames and the extent of its pieces along the axes."""

    def __init__(self, figure: Figure, degrees: Mapping[str, float]) -> None:
        self.figure = figure
        names = set(figure.model.names)
        values = {
            joint: math.radians(value)
            for name, value in degrees.items()
            for joint in (f"left_{name}", f"right_{name}")
            if joint in names
        }
        q = figure.with_joints(pin.neutral(figure.model), values)
        self._data, self._pieces = figure.model.createData(), pin.GeometryData(figure.geometry)
        pin.framesForwardKinematics(figure.model, self._data, q)
        pin.updateGeometryPlacements(figure.model, self._data, figure.geometry, self._pieces)

    def frame(self, name: str) -> Array:
        """Position (3,) of a frame; the pelvis is at the origin."""
        return np.asarray(self._data.oMf[self.figure.model.getFrameId(name)].translation)

    def extent(self, direction: tuple[float, float, float], segments: Iterable[str]) -> float:
        """Farthest the pieces of some segments, or some pieces, reach along a direction, metres."""
        chosen = set(segments)
        return max(
            support(piece.geometry, placement, np.array(direction))
            for piece, placement in zip(self.figure.geometry.geometryObjects, self._pieces.oMg, strict=True)
            if piece.name.partition(":")[0] in chosen or piece.name in chosen
        )

    def across(self, axis: tuple[float, float, float], *segments: str) -> float:
        """How far the pieces of some segments reach along both directions of an axis, metres."""
        x, y, z = axis
        return self.extent(axis, segments) + self.extent((-x, -y, -z), segments)


UP, DOWN, FRONT, BACK, LEFT = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
THIGHS = ("left_thigh", "right_thigh")
TRUNK = ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax")

GIRTHS = {
    "neck": ("neck", 1.0),
    "upper_arm": ("left_upper_arm:0", RELAXED),
    "forearm": ("left_forearm:0", RELAXED),
    "wrist": ("left_forearm:1", 1.0),
    "calf": ("left_shank:0", 1.0),
    "ankle": ("left_shank:1", 1.0),
}
"""Piece whose circumference is that of a part, and share of it when the muscles are relaxed."""


def measure(figure: Figure) -> dict[str, float]:
    """Return the dimensions of a person, metres, by the names of `anthropometry.dimension_names`.

    The arm that reaches overhead is straight and vertical, with the clavicle raised as far as it goes. Circumferences
    are measured in the detail "capsules" only.
    """
    clavicle = figure.model.joints[figure.model.getJointId("left_clavicle_elevation")].idx_q
    elevation = math.degrees(figure.model.upperPositionLimit[clavicle])
    stand = _Pose(figure, {})
    sit = _Pose(figure, {"hip_flexion": 90.0, "knee_flexion": 90.0})
    cross = _Pose(figure, {"shoulder_abduction": 90.0})
    reach = _Pose(figure, {"shoulder_flexion": 90.0})
    raised = _Pose(figure, {"clavicle_elevation": elevation})
    bent = _Pose(figure, {"elbow_flexion": 90.0})
    floor, vertex = stand.frame("left_sole")[2], stand.frame("head_top")[2]
    seat, rest = -sit.extent(DOWN, ("pelvis", "left_thigh:0")), sit.frame("left_sole")[2]
    arm = float(np.linalg.norm(stand.frame("left_middle_tip") - stand.frame("left_shoulder")))
    knee, buttock = sit.extent(FRONT, ("left_thigh", "left_shank")), sit.extent(BACK, ("pelvis", *THIGHS))
    found = {
        "sitting_height": vertex - seat,
        "eye_height_sitting": sit.frame("gaze")[2] - seat,
        "acromial_height": stand.extent(UP, ("left_clavicle", "left_upper_arm")) - floor,
        "wrist_height": stand.frame("left_wrist")[2] - floor,
        "elbow_rest_height": -bent.extent(DOWN, ("left_upper_arm", "left_forearm:0")) - seat,
        "bideltoid_breadth": 2.0 * stand.extent(LEFT, ("left_clavicle", "left_upper_arm")),
        "span": 2.0 * cross.frame("left_middle_tip")[1],
        "thumb_tip_reach": reach.frame("left_thumb_tip")[0] + reach.extent(BACK, TRUNK),
        "overhead_reach_sitting": raised.frame("left_shoulder")[2] + arm - seat,
        "forearm_hand_length": bent.frame("left_middle_tip")[0] + bent.extent(BACK, ("left_forearm",)),
        "buttock_knee_length": knee + buttock,
        # Behind its centre the knee ends as far as before it.
        "buttock_popliteal_length": 2.0 * sit.frame("left_knee")[0] - knee + buttock,
        "popliteal_height": seat - rest,
        # As high over its centre too.
        "knee_height_sitting": sit.frame("left_knee")[2] + knee - sit.frame("left_knee")[0] - rest,
        "thigh_clearance": sit.extent(UP, THIGHS) - seat,
        "hip_breadth_sitting": 2.0 * sit.extent(LEFT, ("pelvis", *THIGHS)),
        "hip_breadth": 2.0 * stand.extent(LEFT, ("pelvis", *(f"left_thigh:{k}" for k in range(SPREAD)))),
        "chest_breadth": stand.across(LEFT, "lower_thorax", "thorax"),
        "chest_depth": stand.across(FRONT, "lower_thorax"),
        "waist_breadth": stand.across(LEFT, "lower_lumbar"),
        "waist_depth": stand.across(FRONT, "lower_lumbar"),
        "buttock_depth": stand.across(FRONT, "pelvis"),
        "head_length": stand.across(FRONT, "head:0"),
        "head_breadth": stand.across(LEFT, "head"),
        "hand_length": float(stand.frame("left_wrist")[2] - stand.frame("left_middle_tip")[2]) / MIDDLE_TIP,
        "hand_breadth": stand.across(FRONT, "left_hand:0"),
        "foot_length": stand.across(FRONT, "left_foot", "left_toes"),
        "foot_breadth": stand.across(LEFT, "left_foot"),
    }
    if figure.detail == "capsules":
        pieces = {piece.name: piece.geometry for piece in figure.geometry.geometryObjects}
        found |= {
            f"{part}_circumference": 2.0 * math.pi * float(pieces[name].radius) / share
            for part, (name, share) in GIRTHS.items()
        }
    return found

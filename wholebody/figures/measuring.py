"""The person measured as an anthropometrist measures people: fifteen dimensions of ANSUR II, in metres.

Lengths are taken between the skin, which is the surface of the collision pieces, and landmarks. Standing means upright
with hanging arms; sitting means upright with thighs horizontal, shanks vertical and the seat's plane under buttocks and
thighs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Person, table
from wholebody.figures.body_spec import geometry_of, model_of
from wholebody.figures.dimensions import Dimensions
from wholebody.figures.human import capsules
from wholebody.figures.human.spec import human_spec
from wholebody.figures.postures import support


class _Pose:
    """A figure at one posture: frames and the extent of its pieces along the axes."""

    def __init__(self, figure: Any, degrees: Mapping[str, float]) -> None:
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


UP, DOWN, FRONT, BACK, LEFT = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
THIGHS = ("left_thigh", "right_thigh")

TOLERANCE = 0.005
"""Metres: a dimension that is off by this counts as one unit of a fit."""


def measure(figure: Any) -> dict[str, float]:
    """Return the fifteen dimensions of a person in any detail, metres, by the names of the table "dimensions".

    The arm that reaches overhead is straight and vertical, with the clavicle raised as far as it goes.
    """
    stand = _Pose(figure, {})
    sit = _Pose(figure, {"hip_flexion": 90.0, "knee_flexion": 90.0})
    cross = _Pose(figure, {"shoulder_abduction": 90.0})
    reach = _Pose(figure, {"shoulder_flexion": 90.0})
    # Degrees of elevation of the clavicle in the overhead reach: people stretch as far as they can, so its limit.
    raised = _Pose(figure, {"clavicle_elevation": 45.0})
    bent = _Pose(figure, {"elbow_flexion": 90.0})
    floor, vertex = stand.frame("left_sole")[2], stand.frame("head_top")[2]
    seat, rest = -sit.extent(DOWN, ("pelvis", *THIGHS)), sit.frame("left_sole")[2]
    arm = np.linalg.norm(stand.frame("left_middle_tip") - stand.frame("left_shoulder"))
    knee = ("left_thigh", "left_shank")
    return {
        "eye_below_vertex": vertex - stand.frame("gaze")[2],
        "wrist_height": stand.frame("left_wrist")[2] - floor,
        "acromial_height": stand.extent(UP, ("left_clavicle", "left_upper_arm")) - floor,
        "bideltoid_breadth": 2.0 * stand.extent(LEFT, ("left_clavicle", "left_upper_arm")),
        "span": 2.0 * cross.frame("left_middle_tip")[1],
        "thumb_tip_reach": reach.frame("left_thumb_tip")[0]
        + reach.extent(BACK, ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax")),
        "overhead_reach_sitting": raised.frame("left_shoulder")[2] + float(arm) - seat,
        "sitting_height": vertex - seat,
        "eye_height_sitting": sit.frame("gaze")[2] - seat,
        "buttock_knee_length": sit.extent(FRONT, knee) + sit.extent(BACK, ("pelvis", *THIGHS)),
        "popliteal_height": seat - rest,
        "knee_height_sitting": sit.extent(UP, ("left_thigh:1",)) - rest,
        "thigh_clearance": sit.extent(UP, THIGHS) - seat,
        "forearm_hand_length": bent.frame("left_middle_tip")[0] + bent.extent(BACK, ("left_forearm",)),
        "hip_breadth_sitting": 2.0 * sit.extent(LEFT, ("pelvis", *THIGHS)),
    }


def measured(person: Person, deviations: tuple[tuple[str, float], ...] = ()) -> dict[str, float]:
    """Return the dimensions of a person, metres, with some of the fitted sizes changed."""
    person = replace(person, deviations=deviations, age=None)
    model = model_of(human_spec(person))
    geometry = geometry_of(model, capsules.solids(Dimensions(person)), ())

    def with_joints(q: Array, values: Mapping[str, float]) -> Array:
        q = q.copy()
        for name, value in values.items():
            q[model.joints[model.getJointId(name)].idx_q] = value
        return q

    return measure(SimpleNamespace(model=model, geometry=geometry, with_joints=with_joints))


@cache
def ansur(sex: str, percentile: int) -> dict[str, float]:
    """Return ANSUR II's value of each dimension at a percentile of 5, 50 or 95, metres."""
    column = f"{'M' if sex == 'male' else 'F'}{percentile}"
    return {row["name"]: float(row[column]) for row in table("dimensions")}

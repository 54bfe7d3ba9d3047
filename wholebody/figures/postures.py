"""Named postures of the person, in degrees, and the placement of the root for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.description import Articulated

GAP = 0.004
"""Least distance of any two pieces in a named posture, metres; arms and legs move outwards if a build needs it."""


class Attitude(NamedTuple):
    """Joint angles in degrees and the pitch of the pelvis; the lowest piece is then put on the ground.

    A name without a side, such as "shoulder_abduction", means both sides.
    """

    degrees: Mapping[str, float]
    pitch: float = 0.0


_ARMS = {"shoulder_abduction": 11.0, "elbow_flexion": 15.0}

HUMAN: dict[str, Attitude] = {
    "standing": Attitude(_ARMS),
    "a_pose": Attitude({"shoulder_abduction": 45.0}),
    "t_pose": Attitude({"shoulder_abduction": 90.0}),
    "arms_forward": Attitude({"shoulder_flexion": 90.0}),
    "hands_up": Attitude({"shoulder_flexion": 165.0, "elbow_flexion": 10.0}),
    "sitting": Attitude(
        {
            "hip_flexion": 90.0,
            "knee_flexion": 90.0,
            "hip_abduction": 6.0,
            "shoulder_abduction": 16.0,
            "elbow_flexion": 20.0,
        }
    ),
    "squatting": Attitude(
        {
            "hip_flexion": 105.0,
            "knee_flexion": 110.0,
            "ankle_dorsiflexion": 30.0,
            "spine1_flexion": 10.0,
            "spine2_flexion": 10.0,
            "shoulder_flexion": 80.0,
            "elbow_flexion": 15.0,
        },
        pitch=25.0,
    ),
    "kneeling": Attitude({"knee_flexion": 90.0, "ankle_dorsiflexion": -50.0, **_ARMS}),
    "prone": Attitude({"shoulder_abduction": 25.0, "elbow_flexion": 0.0, "ankle_dorsiflexion": -50.0}, pitch=90.0),
    "supine": Attitude({"shoulder_abduction": 25.0, "elbow_flexion": 0.0, "ankle_dorsiflexion": -20.0}, pitch=-90.0),
}


def stand(figure: Articulated, attitude: Attitude) -> Array:
    """Return the posture (nq,) of an attitude: pelvis above the origin, lowest piece on z = 0, no overlap.

    Very stout builds (body mass index above about 45) cannot squat: their thighs, spread to the limit,
    overlap the belly.
    """
    q = pin.neutral(figure.model)
    values: dict[str, float] = {}
    for name, degrees in attitude.degrees.items():
        for joint in (name, f"left_{name}", f"right_{name}"):
            if joint in figure.joints:
                values[joint] = math.radians(degrees)
    q = figure.clamp(figure.with_joints(q, values))
    spread = [name for name in figure.joints if name.endswith(("shoulder_abduction", "hip_abduction"))]
    free = q
    for _ in range(45):
        close = _close_segments(figure, free)
        if not close:
            break
        moved = {
            name: figure.joint_values(free)[name] + math.radians(1.0)
            for name in spread
            if any(_moves(name, segment) for segment in close)
        }
        free = figure.clamp(figure.with_joints(free, moved))
    if figure.root == "free":
        half = math.radians(attitude.pitch) / 2.0
        free[3:7] = 0.0, math.sin(half), 0.0, math.cos(half)
        free[2] = -lowest(figure, free)
    return free


def _moves(abduction: str, segment: str) -> bool:
    """Whether an abduction joint moves a segment outwards."""
    side, part, _ = abduction.split("_")
    leg = ("thigh", "shank", "foot", "toes")
    return segment.startswith(side) and segment.endswith(leg) == (part == "hip") and not segment.endswith("clavicle")


def _close_segments(figure: Articulated, q: Array) -> set[str]:
    data, geometry = figure.model.createData(), figure.geometry
    geometry_data = pin.GeometryData(geometry)
    pin.updateGeometryPlacements(figure.model, data, geometry, geometry_data, q)
    pin.computeDistances(geometry, geometry_data)
    close: set[str] = set()
    for pair, result in zip(geometry.collisionPairs, geometry_data.distanceResults, strict=True):
        if result.min_distance < GAP:
            close.update(geometry.geometryObjects[k].name.partition(":")[0] for k in (pair.first, pair.second))
    return close


def lowest(figure: Articulated, q: Array) -> float:
    """Height of the lowest point of all pieces, metres."""
    data = figure.model.createData()
    geometry_data = pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data, q)
    return min(
        -support(piece.geometry, placement, np.array([0.0, 0.0, -1.0]))
        for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True)
    )


def support(shape: Any, placement: pin.SE3, direction: Array) -> float:
    """How far a piece reaches along a unit direction (3,), metres from the origin."""
    far, row = float(placement.translation @ direction), np.asarray(placement.rotation).T @ direction
    kind = type(shape).__name__
    if kind == "Sphere":
        return far + float(shape.radius)
    if kind == "Capsule":
        return far + float(shape.radius) + abs(float(row[2])) * float(shape.halfLength)
    if kind == "Box":
        return far + float(np.abs(row) @ np.asarray(shape.halfSide))
    if kind == "Ellipsoid":
        return far + float(np.linalg.norm(row * np.asarray(shape.radii)))
    return far + float((np.asarray(shape.points()) @ row).max())

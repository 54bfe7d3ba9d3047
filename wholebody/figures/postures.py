"""Named postures of the person, overlaps parted and the root placed, and postures moved onto what is below."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.figures.description import Articulated
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.pieces import swept_points

GAP = 0.004
"""Least distance of any two pieces in a named posture, metres; arms and legs move outwards if a build needs it.

Where the thighs are as far apart as they go, the trunk rises from them: hips, pelvis and spine turn back, legs stay."""

_TRUNK = {"lower_lumbar", "upper_lumbar", "lower_thorax", "thorax"}


def zero(figure: Articulated) -> Array:
    """(nq,) a robot's zero, in which its soles are level; its first posture may have had to evade itself."""
    return np.array(figure.posture("zero") if "zero" in figure.postures else figure.neutral)


def stand(figure: Articulated, degrees: Mapping[str, float]) -> Array:
    """Posture (nq,) of a row of `named_angles`: pelvis above the origin, lowest piece on z = 0, no overlap."""
    q = pin.neutral(figure.model)
    values: dict[str, float] = {}
    for name, angle in degrees.items():
        for joint in (name, f"left_{name}", f"right_{name}"):
            if joint in figure.joints:
                values[joint] = math.radians(angle)
    q = figure.clamp(figure.with_joints(q, values))
    spread = [name for name in figure.joints if name.endswith(("shoulder_abduction", "hip_abduction"))]
    free: Array = q
    reach = np.array([swept_points(piece.geometry).reach for piece in figure.geometry.geometryObjects])
    pairs = pairs_of(figure.geometry)
    within, data = reach[pairs].sum(axis=1) + GAP, figure.model.createData()
    hips = [name for name in figure.joints if name.endswith("hip_flexion")]
    pitch = degrees.get("pelvis_pitch", 0.0)
    for turn in range(120):
        close = _close_segments(placed(figure, free, data), pairs, within)
        if not close:
            break
        now = figure.joint_values(free)
        # arms that are not free after 60 degrees stay where they are
        free_to = [name for name in spread if "hip" in name or turn < 60]
        apart = [name for name in free_to if any(_moves(name, segment) for segment in close)]
        if not apart:
            break
        free = figure.clamp(figure.with_joints(free, {name: now[name] + math.radians(1.0) for name in apart}))
        reached = figure.joint_values(free)
        if close & _TRUNK and any(reached[name] <= now[name] for name in apart if "hip" in name):
            bent = [name for name in now if name.startswith("spine") and name.endswith("flexion") and now[name] > 0.0]
            back = {name: now[name] - math.radians(1.0) for name in (*hips, *bent)}
            free = figure.clamp(figure.with_joints(free, back))
            pitch -= 1.0
    if figure.root == "free":
        half = math.radians(pitch) / 2.0
        free[3:7] = 0.0, math.sin(half), 0.0, math.cos(half)
        free[2] = -lowest(figure, free, data)
    return free


def _moves(abduction: str, segment: str) -> bool:
    """Whether an abduction joint moves a segment outwards."""
    side, part, _ = abduction.split("_")
    leg = ("thigh", "shank", "foot", "toes")
    return segment.startswith(side) and segment.endswith(leg) == (part == "hip") and not segment.endswith("clavicle")


def _close_segments(parts: list[tuple[pin.GeometryObject, pin.SE3]], pairs: Indices, within: Array) -> set[str]:
    """Segments with pieces nearer to others than `GAP`, of pairs (k, 2) whose origins are `within` (k,) then."""
    pieces, places = zip(*parts, strict=True)
    centers = np.array([place.translation for place in places])
    apart = np.linalg.norm(centers[pairs[:, 0]] - centers[pairs[:, 1]], axis=1)
    at = [coal.Transform3s(place.rotation, place.translation) for place in places]
    close: set[str] = set()
    for a, b in pairs[apart < within].tolist():
        shapes, result = (pieces[a].geometry, pieces[b].geometry), coal.DistanceResult()
        if coal.distance(shapes[0], at[a], shapes[1], at[b], coal.DistanceRequest(), result) < GAP:
            close.update(pieces[k].name.partition(":")[0] for k in (a, b))
    return close


def placed(figure: Articulated, q: Array, data: pin.Data | None = None) -> list[tuple[pin.GeometryObject, pin.SE3]]:
    """The pieces of a figure, and where each is in a posture (nq,); new data take longer than the rest."""
    data = figure.model.createData() if data is None else data
    pin.forwardKinematics(figure.model, data, q)
    return [(piece, data.oMi[piece.parentJoint] * piece.placement) for piece in figure.geometry.geometryObjects]


def lowest(figure: Articulated, q: Array, data: pin.Data | None = None) -> float:
    """Height of the lowest point of all pieces, metres."""
    down = np.array([0.0, 0.0, -1.0])
    return min(-support(piece.geometry, place, down) for piece, place in placed(figure, q, data))


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


def grounded(model: pin.Model, segments: tuple[str, ...], q: Array, scene: Any, height: int) -> Array:
    """Copy (nq,) of a posture with the root's `height` such that its `segments` stand; see `Figure.grounded`."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    own, body, things = set(segments), [], []
    for piece, owner in zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True):
        place = data.oMi[piece.parentJoint] * piece.placement
        if owner in own:
            body.append((piece.geometry, place, -support(piece.geometry, place, np.array((0.0, 0.0, -1.0)))))
        elif owner in scene.objects and piece.parentJoint == 0:
            things.append((piece.geometry, coal.Transform3s(place.rotation, place.translation)))
    if not things or not body:
        raise InputError("grounded: there is nothing to stand on; add wb.HalfSpace() to the scene")
    bottom = min(low for *_, low in body)
    # m: segments that reach as low as this above the lowest point are those that stand
    soles = [(shape, place) for shape, place, low in body if low <= bottom + 0.03]
    shift = 0.0
    for _ in range(2000):  # most steps; each goes down by the least distance, so none goes through anything
        gap = _least(soles, things, shift)
        if abs(gap) <= 1e-7:  # m: gap that counts as standing
            break
        shift -= gap  # the figure overlaps by no more than this gap, so a few steps move it out
        if abs(shift) > 10.0:
            raise InputError("grounded: nothing is below the figure within 10 m; add wb.HalfSpace()")
    result = np.array(q, dtype=float)
    result[height] += shift
    return result


def _least(soles: list[tuple[Any, pin.SE3]], things: list[tuple[Any, Any]], shift: float) -> float:
    """Least signed distance of the soles from the things when the figure is higher by `shift`."""
    up, least = np.array((0.0, 0.0, shift)), np.inf
    for shape, place in soles:
        at = coal.Transform3s(place.rotation, place.translation + up)
        for thing, where in things:
            gap = coal.distance(shape, at, thing, where, coal.DistanceRequest(), coal.DistanceResult())
            least = min(least, float(gap))
    return least

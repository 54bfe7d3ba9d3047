"""What each frame of a retargeted motion is to reach: the skeleton's directions at the figure's proportions."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import box_corners
from wholebody.motion.footfalls import SMALL, Footfalls, held
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import RIGID, SkeletonMotion

UPRIGHT = 0.7
"""Cosine of the greatest angle between up and the trunk, thighs and shanks of a rest posture that stands."""

LIMBS = (
    ("hip", "knee"),
    ("knee", "ankle"),
    ("ankle", "toe"),
    ("shoulder", "elbow"),
    ("elbow", "wrist"),
    ("wrist", "hand"),
)
"""Bones whose directions are taken from the skeleton, and their lengths from the figure."""

SHORT = 0.4
"""Share of the figure's length below which a bone of the skeleton has no direction that says something."""

LIMB_ABOVE = {second: first for first, second in LIMBS}
"""Part of a limb to the part nearer to the trunk."""


class Targets(NamedTuple):
    """Goals of all frames.

    Attributes:
        points: role to (n, 3), metres in the figure's world.
        turns: role to (n, 3, 3): orientations of the figure's frames.
        root: (n, 3, 3) orientation of the pelvis, from which the descent begins.
        scale: metres of the figure for each metre of the skeleton's way over the floor.
    """

    points: dict[str, Array]
    turns: dict[str, Array]
    root: Array
    scale: float


class _Body:
    """Places of roles, of the figure in its neutral posture or of the skeleton in all frames; (..., 3)."""

    def __init__(self, places: dict[str, Array]) -> None:
        self.places = dict(places)
        for part in ("hip", "shoulder"):
            if {f"left_{part}", f"right_{part}"} <= places.keys():
                self.places[f"{part}s"] = 0.5 * (places[f"left_{part}"] + places[f"right_{part}"])
        if "hips" not in self.places and places:
            self.places["hips"] = places.get("pelvis", next(iter(places.values())))

    def has(self, *roles: str) -> bool:
        return all(role in self.places for role in roles)

    def way(self, first: str, second: str) -> Array:
        return self.places[second] - self.places[first]

    def length(self, first: str, second: str) -> float:
        """Length of a bone; of a trunk, which bends, that of its straightest frames."""
        return float(np.percentile(np.linalg.norm(self.way(first, second), axis=-1), 95))


def standing_places(figure: Figure, roles: Roles) -> tuple[dict[str, Array], dict[str, Array], float]:
    """Places (3,) and orientations (3, 3) of a figure's roles in its neutral posture, and its lowest height."""
    data, geometry = figure.model.createData(), figure.geometry.createData()
    q = figure.neutral
    pin.framesForwardKinematics(figure.model, data, q)
    found = {role: data.oMf[figure.frame_id(frame)] for role, frame in roles.frames.items()}
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry)
    low = np.inf
    for piece, at in zip(figure.geometry.geometryObjects, geometry.oMg, strict=True):
        corners = at.rotation @ box_corners(piece.geometry).T + at.translation[:, None]
        low = min(low, float(corners[2].min()))
    return (
        {role: at.translation.copy() for role, at in found.items()},
        {role: data.oMf[figure.frame_id(frame)].rotation.copy() for role, frame in roles.turns.items()},
        low if np.isfinite(low) else 0.0,
    )


def rest_axes(motion: SkeletonMotion, roles: Roles) -> Array | None:
    """Forward, left and up (columns, 3 x 3) of the skeleton's rest posture; None where that does not stand."""
    rest = motion.rest()
    body = _Body({role: rest[motion.names.index(joint)] for role, joint in roles.joints.items()})
    top = next((role for role in ("shoulders", "neck", "head", "chest") if body.has("hips", role)), None)
    up = np.array([0.0, 0.0, 1.0])
    ways = [] if top is None else [body.way("hips", top)]
    for side in ("left", "right"):
        for first, second in LIMBS[:2]:
            if body.has(f"{side}_{first}", f"{side}_{second}"):
                ways.append(-body.way(f"{side}_{first}", f"{side}_{second}"))
    pair = next((part for part in ("hip", "shoulder") if body.has(f"left_{part}", f"right_{part}")), None)
    if pair is None or not ways or any(way @ up < UPRIGHT * np.linalg.norm(way) for way in ways):
        return None
    left = body.way(f"right_{pair}", f"left_{pair}")
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 1e-6:
        return None
    left /= np.linalg.norm(left)
    return np.stack([np.cross(left, up), left, up], axis=1)


def targets(motion: SkeletonMotion, figure: Figure, roles: Roles, steps: Footfalls) -> Targets:
    """Goals of all frames.

    Args:
        motion: the skeleton.
        figure: the figure.
        roles: what they have in common.
        steps: when its feet stand; where they do, the figure's feet are on the plane z = 0.
    """
    places, turned, lowest = standing_places(figure, roles)
    own = _Body(places)
    joint = {role: motion.names.index(name) for role, name in roles.joints.items()}
    source = _Body({role: motion.positions[:, k] for role, k in joint.items()})
    axes = rest_axes(motion, roles)
    turns: dict[str, Array] = {}
    if axes is not None:
        for role in ("pelvis", "head", "left_ankle", "right_ankle"):
            if role in joint:
                turns[role] = motion.rotations[:, joint[role]] @ axes @ turned[role]
        for side in ("left", "right"):
            turn = _hand_turn(motion, joint, side, axes)
            if turn is not None and f"{side}_hand" in joint:
                turns[f"{side}_hand"] = turn @ _hand_axes(own, side).T @ turned[f"{side}_hand"]
    root = turns["pelvis"] if "pelvis" in turns else _pelvis(source, motion)
    if figure.root == "fixed":  # only what moves relative to the pelvis can be followed
        back = np.swapaxes(root, 1, 2)
        source = _Body(
            {role: (back @ (at - source.places["hips"])[:, :, None])[:, :, 0] for role, at in source.places.items()}
        )
        turns = {role: back @ turn for role, turn in turns.items() if role != "pelvis"}
        hips = np.tile(own.places.get("hips", np.zeros(3)), (len(motion), 1))
        scale = 1.0
    else:
        scale = _leg(own) / max(_leg(source), SMALL) if _leg(own) and _leg(source) else 1.0
        hips = scale * source.places["hips"]
        foot = next((part for part in ("left_ankle", "left_toe") if part in steps.heights and own.has(part)), None)
        if foot is not None:
            hips[:, 2] += own.places[foot][2] - lowest - scale * steps.heights[foot]
        else:
            hips[:, 2] -= scale * float(np.percentile(motion.positions[:, :, 2].min(axis=1), 2))
    points = _points(own, source, hips, figure.root == "fixed" or not has_trunk(joint))
    return Targets(held(points, steps, places, lowest, motion.dt), turns, root, scale)


def has_trunk(roles: Collection[str]) -> bool:
    """Whether roles say where the trunk is: a pelvis, or a hip or shoulder on both sides."""
    pairs = ({f"left_{part}", f"right_{part}"} for part in ("hip", "shoulder"))
    return "pelvis" in roles or any(pair <= set(roles) for pair in pairs)


def _leg(body: _Body) -> float:
    """Length of a leg and of what is below its ankle to the floor."""
    if not body.has("left_hip", "left_knee", "left_ankle"):
        return 0.0
    return body.length("left_hip", "left_knee") + body.length("left_knee", "left_ankle")


def _points(own: _Body, source: _Body, hips: Array, anchored: bool) -> dict[str, Array]:
    points: dict[str, Array] = {}

    def directed(first: str, second: str, start: Array) -> Array:
        """The skeleton's way from one role to another at the figure's length."""
        return start + source.way(first, second) * (
            own.length(first, second) / max(source.length(first, second), SMALL)
        )

    middle = {"hip": hips}
    top = None
    if own.has("hips", "shoulders") and source.has("hips", "shoulders"):
        top = directed("hips", "shoulders", hips)
    elif own.has("shoulders"):
        top = np.tile(own.places["shoulders"], (len(hips), 1))
    if top is not None:
        middle["shoulder"] = top
    for part, start in middle.items():
        if own.has(f"{part}s") and source.has(f"left_{part}", f"right_{part}") and own.has(f"left_{part}"):
            for side in ("left", "right"):
                points[f"{side}_{part}"] = directed(f"{part}s", f"{side}_{part}", start)
    for side in ("left", "right"):
        for first, second in LIMBS:
            a, b = f"{side}_{first}", f"{side}_{second}"
            if a not in points and f"{side}_{LIMB_ABOVE.get(first)}" not in own.places and own.has(a, b) and anchored:
                points[a] = np.tile(own.places[a], (len(hips), 1))
            if a in points and own.has(a, b) and source.has(a, b):
                points[b] = directed(a, b, points[a])
    if (
        top is not None
        and own.has("shoulders", "head")
        and source.has("shoulders", "head")
        and source.length("shoulders", "head") > SHORT * own.length("shoulders", "head")
    ):
        points["head"] = directed("shoulders", "head", top)
    return points


def _pelvis(source: _Body, motion: SkeletonMotion) -> Array:
    """Orientation of the pelvis (n, 3, 3) from places alone: y from right to left, z towards the shoulders.

    Without hips and shoulders it is that of the skeleton's root.
    """
    pair = next((part for part in ("hip", "shoulder") if source.has(f"left_{part}", f"right_{part}")), None)
    if pair is None:
        return np.array(motion.rotations[:, 0])
    left = source.way(f"right_{pair}", f"left_{pair}")
    top = next((role for role in ("shoulders", "neck", "chest", "head") if source.has(role, "hips")), None)
    up = np.tile([0.0, 0.0, 1.0], (len(left), 1)) if top is None else source.way("hips", top)
    y = left / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), SMALL)
    x = np.cross(y, up)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), SMALL)
    found = np.stack([x, y, np.cross(x, y)], axis=2)
    flat = np.abs(np.linalg.det(found) - 1.0) > RIGID
    found[flat] = motion.rotations[flat, 0]
    return found


def _hand_axes(own: _Body, side: str) -> Array:
    """Fingers, side and palm of the figure's hand in its neutral posture, columns (3, 3): palms face inwards."""
    fingers = own.way(f"{side}_wrist", f"{side}_hand")
    inward = np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])
    return _frame(fingers, inward)


def _hand_turn(motion: SkeletonMotion, joint: dict[str, int], side: str, axes: Array) -> Array | None:
    """Fingers, side and palm of the skeleton's hand in all frames, columns (n, 3, 3); None without a hand."""
    wrist, hand = joint.get(f"{side}_wrist"), joint.get(f"{side}_hand")
    if wrist is None or hand is None:
        return None
    rest = motion.rest()
    fingers = rest[hand] - rest[wrist]
    if np.linalg.norm(fingers) < 1e-6:
        return None
    fingers = fingers / np.linalg.norm(fingers)
    inward = (-1.0 if side == "left" else 1.0) * axes[:, 1]
    palm = inward if abs(fingers @ axes[:, 2]) > UPRIGHT else -axes[:, 2]  # hanging arms, or arms out with palms down
    turned: Array = motion.rotations[:, motion.parents[hand]] @ _frame(fingers, palm)
    return turned


def _frame(along: Array, towards: Array) -> Array:
    """Orthonormal axes (3, 3): x along the first direction, z as near to the second one as it can be."""
    x = along / np.linalg.norm(along)
    y = np.cross(towards, x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)

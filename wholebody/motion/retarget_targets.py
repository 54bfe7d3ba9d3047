"""Feet of a recorded skeleton that stand: when, and where the floor is.

They are slow and low by the measures of `StanceFeet`, as the feet of a clip are. But the joints of a skeleton are above
its soles, and a recording drifts: both feet have one floor, a low percentile of what they do while they are slow, and a
foot that stands at several places made steps between them.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import box_corners
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import RIGID, SkeletonMotion
from wholebody.motion.soles import soled
from wholebody.motion.stance import StanceFeet, speeds
from wholebody.motion.windows import Window, long_runs, runs

SMALL = 1e-9
"""Metres: shorter ways have no direction."""


class Footfalls(NamedTuple):
    """When parts of the feet stand.

    Attributes:
        stands: role to (n,) whether it stands.
        heights: role to its height while it stands, metres.
    """

    stands: dict[str, Mask]
    heights: dict[str, float]


def footfalls(motion: SkeletonMotion, roles: Roles) -> Footfalls:
    """When the ankles and toes of a skeleton stand."""
    stands, heights, limits = {}, {}, StanceFeet()
    for part in ("ankle", "toe"):
        pair = {
            f"{side}_{part}": motion.names.index(roles.joints[f"{side}_{part}"])
            for side in ("left", "right")
            if f"{side}_{part}" in roles.joints
        }
        places = {role: motion.positions[:, joint] for role, joint in pair.items()}
        speed = {role: speeds(at, motion.dt) for role, at in places.items()}
        slow = [at[speed[role] <= limits.speed, 2] for role, at in places.items()]
        low = np.concatenate(slow) if slow else np.zeros(0)
        if not len(low):
            continue
        height = float(np.percentile(low, 10.0))  # some are lower by error
        for role, at in places.items():
            heights[role] = height
            still = _apart(at, (speed[role] <= limits.speed) & (at[:, 2] <= height + limits.height))
            stands[role] = long_runs(still, round(limits.least / motion.dt))
    for side in ("left", "right"):  # a heel stands only while the toes do, so that both keep the length of the foot
        if {f"{side}_toe", f"{side}_ankle"} <= stands.keys():
            stands[f"{side}_ankle"] &= stands[f"{side}_toe"]
    return Footfalls(stands, heights)


def held(
    points: dict[str, Array], steps: Footfalls, places: dict[str, Array], lowest: float, dt: float
) -> dict[str, Array]:
    """The goals of points with feet that stand at one place each, at the height at which the figure's stand.

    Before and after it stands, a foot goes over from its own way to that place and back. Places (3,) and the lowest
    height are those of the figure's neutral posture, which stands.
    """
    found = dict(points)
    for part in ("toe", "ankle"):
        for side in ("left", "right"):
            role, toe = f"{side}_{part}", f"{side}_toe"
            if role not in steps.stands or role not in points:
                continue
            corrections = []
            for first, last in runs(steps.stands[role]):
                frames = slice(first, last)
                place = points[role][frames].mean(axis=0)
                if part == "ankle" and toe in steps.stands and steps.stands[toe][frames].all():
                    ahead = found[toe][frames].mean(axis=0)  # the toes stand already: keep the length of the foot
                    place = ahead + (points[role][frames] - points[toe][frames]).mean(axis=0)
                    flat = place[:2] - ahead[:2]
                    rise = places[role][2] - places[toe][2]
                    length = np.linalg.norm(places[role] - places[toe])
                    place[:2] = ahead[:2] + flat / max(float(np.linalg.norm(flat)), SMALL) * np.sqrt(
                        max(length**2 - rise**2, 0.0)
                    )
                place[2] = places[role][2] - lowest
                corrections.append((first, last, place))
            found[role] = _blended(points[role], corrections, max(1, round(0.15 / dt)))  # over 0.15 s
    return found


def _blended(way: Array, places: list[tuple[int, int, Array]], over: int) -> Array:
    """A way (n, 3) that rests at places over some frames each, and goes over to and from them."""
    frames = np.arange(len(way))
    total, weights = np.zeros_like(way), np.zeros(len(way))
    for first, last, place in places:
        away = np.maximum(first - frames, frames - (last - 1))
        share = 0.5 + 0.5 * np.cos(np.pi * np.clip(away / over, 0.0, 1.0))
        near = np.clip(frames, first, last - 1)
        total += share[:, None] * np.where((away > 0)[:, None], place - way[near], place - way)
        weights += share
    found: Array = way + total / np.maximum(weights, 1.0)[:, None]
    return found


def _apart(places: Array, mask: Mask) -> Mask:
    """The mask without the fastest frame of each run over which a foot goes on, so that it stands at several places."""
    kept: Mask = np.array(mask)
    waiting = runs(kept)
    moved = speeds(places, 1.0)
    while waiting:
        first, last = waiting.pop()
        # a foot that moves by more than 3 cm has made a step
        if last - first > 2 and np.linalg.norm(np.ptp(places[first:last], axis=0)) > 0.03:
            cut = first + 1 + int(moved[first + 1 : last - 1].argmax())
            kept[cut] = False
            waiting += [Window(first, cut), Window(cut + 1, last)]
    return kept


UPRIGHT = 0.7
"""Cosine of the greatest angle between up and the trunk, thighs and shanks of a rest posture that stands."""

LIMBS = (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist", "hand"))
"""Ends of bones whose directions are taken from the skeleton, and their lengths from the figure."""


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
        for first, second in (("hip", "knee"), ("knee", "ankle")):
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
    """Goals of all frames; where the skeleton's feet stand, the figure's are on the plane z = 0."""
    places, turned, lowest = standing_places(figure, roles)
    own = _Body(places)
    joint = {role: motion.names.index(name) for role, name in roles.joints.items()}
    centres = {role: motion.positions[:, k] for role, k in joint.items()}
    source = _Body(centres | soled(motion, roles, steps.stands, places))
    turns = _turns(motion, joint, own, turned, rest_axes(motion, roles))
    root, scale = turns.get("pelvis", _pelvis(source, motion)), 1.0
    if figure.root == "fixed":  # only what moves relative to the pelvis can be followed
        back = np.swapaxes(root, 1, 2)
        source = _Body(
            {role: (back @ (at - source.places["hips"])[:, :, None])[:, :, 0] for role, at in source.places.items()}
        )
        turns = {role: back @ turn for role, turn in turns.items() if role != "pelvis"}
        hips = np.tile(own.places.get("hips", np.zeros(3)), (len(motion), 1))
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


def _turns(
    motion: SkeletonMotion, joint: dict[str, int], own: _Body, turned: dict[str, Array], axes: Array | None
) -> dict[str, Array]:
    """Orientations (n, 3, 3) of pelvis, head, feet and hands by role; none where the rest posture does not stand."""
    if axes is None:
        return {}
    rigid = [role for role in ("pelvis", "head", "left_ankle", "right_ankle") if role in joint]
    turns: dict[str, Array] = {role: motion.rotations[:, joint[role]] @ axes @ turned[role] for role in rigid}
    for side in ("left", "right"):
        turn = _hand_turn(motion, joint, side, axes)
        if turn is not None:
            turns[f"{side}_hand"] = turn @ _hand_axes(own, side).T @ turned[f"{side}_hand"]
    return turns


def has_trunk(roles: Collection[str]) -> bool:
    """Whether roles say where the trunk is: a pelvis, or a hip or shoulder on both sides."""
    pairs = ({f"left_{part}", f"right_{part}"} for part in ("hip", "shoulder"))
    return "pelvis" in roles or any(pair <= set(roles) for pair in pairs)


def _leg(body: _Body) -> float:
    """Length of a leg and of what is below its ankle to the floor."""
    if not body.has("left_hip", "left_knee", "left_ankle"):
        return 0.0
    return body.length("left_hip", "left_knee") + body.length("left_knee", "left_ankle")


def _ratio(own: _Body, source: _Body, first: str, second: str) -> float:
    return own.length(first, second) / max(source.length(first, second), SMALL)


def _directed(own: _Body, source: _Body, first: str, second: str, start: Array) -> Array:
    """(n, 3) from a start along the skeleton's way from one role to another, at the figure's length."""
    found: Array = start + source.way(first, second) * _ratio(own, source, first, second)
    return found


def known_bones(limb: tuple[str, ...], side: str, roles: Collection[str]) -> list[tuple[str, str]]:
    """Both ends of what lies between the roles of a limb that are known: bones, or what is left of them."""
    return list(pairwise(role for part in limb if (role := f"{side}_{part}") in roles))


def _points(own: _Body, source: _Body, hips: Array, anchored: bool) -> dict[str, Array]:
    """Places (n, 3) of the roles: from the hips up to the shoulders and the head, and outwards along the limbs.

    Limbs of which nothing nearer to the trunk is known begin where the figure's do, if they are `anchored`.
    """
    points, top = _girdles(own, source, hips)
    limbs = [(limb, known_bones(limb, side, own.places.keys())) for limb in LIMBS for side in ("left", "right")]
    rigid = {
        (a, b) for limb, bones in limbs for a, b in bones if (a.split("_")[1], b.split("_")[1]) in set(pairwise(limb))
    }
    size = float(np.median([_ratio(own, source, *ends) for ends in rigid])) if rigid else 1.0
    for _, bones in limbs:
        for k, (a, b) in enumerate(bones):
            if anchored and k == 0 and a not in points:
                points[a] = np.tile(own.places[a], (len(hips), 1))
            if a in points and (a, b) in rigid:
                points[b] = _directed(own, source, a, b, points[a])
            elif a in points:  # over a joint that is not known: the longest way in the recording may be a bent one
                ratio = float(np.clip(_ratio(own, source, a, b), 0.85 * size, 1.15 * size))
                points[b] = points[a] + source.way(a, b) * (ratio if rigid else _ratio(own, source, a, b))
    necks = [body.length("shoulders", "head") if body.has("shoulders", "head") else 0.0 for body in (own, source)]
    if top is not None and min(necks) > 0.0 and necks[1] > 0.4 * necks[0]:  # a shorter one has no direction
        points["head"] = _directed(own, source, "shoulders", "head", top)
    return points


def _girdles(own: _Body, source: _Body, hips: Array) -> tuple[dict[str, Array], Array | None]:
    """Places (n, 3) of hips and shoulders, and between the shoulders; None where the figure has none."""
    top: Array | None = None
    if own.has("hips", "shoulders") and source.has("hips", "shoulders"):
        top = _directed(own, source, "hips", "shoulders", hips)
    elif own.has("shoulders"):
        top = np.tile(own.places["shoulders"], (len(hips), 1))
    points, starts = dict[str, Array](), {"hip": hips} if top is None else {"hip": hips, "shoulder": top}
    for part, start in starts.items():
        if own.has(f"{part}s", f"left_{part}") and source.has(f"left_{part}", f"right_{part}"):
            for side in ("left", "right"):
                points[f"{side}_{part}"] = _directed(own, source, f"{part}s", f"{side}_{part}", start)
    return points, top


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

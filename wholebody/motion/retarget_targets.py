"""Goals of all frames: the directions of a skeleton's bones at a figure's lengths, and orientations of its parts.

Skeletons have ankles and toes at other heights than the figure; `soled` gives their feet the figure's.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask, cross
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import box_corners
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import RIGID, SkeletonMotion
from wholebody.motion.standing_ground import Ground
from wholebody.motion.structure import LIMBS, upright

SMALL = 1e-9  # metres: shorter vectors have no direction


UPRIGHT = 0.7  # cosine of the greatest angle between up and the trunk, thighs and shanks of a rest posture that stands

ALIKE = 0.9  # length of the mean of directions that are one direction, with the errors of a recording


class Targets(NamedTuple):
    """Goals of all frames."""

    points: dict[str, Array]  # role to (n, 3), metres in the figure's world
    turns: dict[str, Array]  # role to (n, 3, 3): orientations of the figure's frames
    root: Array  # (n, 3, 3) orientation of the pelvis, from which the descent begins


class Wanted(NamedTuple):
    """Goals of one frame."""

    places: Array  # (p, 3) of the points, metres
    turns: Array  # (t, 3, 3) orientations
    root: Array  # (3, 3) of the pelvis, from which a descent begins


def wanted_of(targets: Targets, roles: Roles) -> list[Wanted]:
    """Goals frame by frame, of what the figure has."""
    points, turns = parts_of(targets, roles)
    places = np.stack([targets.points[role] for role in points], axis=1)
    rotations = np.stack([targets.turns[role] for role in turns], axis=1) if turns else np.zeros((len(places), 0, 3, 3))
    return [Wanted(*each) for each in zip(places, rotations, targets.root, strict=True)]


def parts_of(targets: Targets, roles: Roles) -> tuple[list[str], list[str]]:
    """Roles of the points, and of the orientations, that skeleton and figure have."""
    return [role for role in targets.points if role in roles.frames], [
        role for role in targets.turns if role in roles.frames
    ]


class _Body:
    """Places of roles, of the figure in its neutral posture or of the skeleton in all frames; (..., 3)."""

    def __init__(self, places: dict[str, Array], like: _Body | None = None) -> None:
        self.places, self._like = dict(places), like  # `like` has the lengths
        self._lengths = dict[tuple[str, str], float]()
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
        if self._like is not None:
            return self._like.length(first, second)
        if (first, second) not in self._lengths:
            lengths = np.linalg.norm(self.way(first, second), axis=-1)
            self._lengths[first, second] = float(np.percentile(lengths, 95))
        return self._lengths[first, second]


def standing_places(figure: Figure, roles: Roles) -> tuple[dict[str, Array], dict[str, Array], float]:
    """Places (3,) and orientations (3, 3) of a figure's roles where it stands upright, and its lowest height."""
    data, geometry = figure.model.createData(), figure.geometry.createData()
    q = upright(figure)
    pin.framesForwardKinematics(figure.model, data, q)
    places = {role: np.array(data.oMi[joint].act(at)) for role, (joint, at) in roles.places(figure).items()}
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry)
    low = np.inf
    for piece, at in zip(figure.geometry.geometryObjects, geometry.oMg, strict=True):
        corners = at.rotation @ box_corners(piece.geometry).T + at.translation[:, None]
        low = min(low, float(corners[2].min()))
    return (
        places,
        {role: data.oMf[figure.frame_id(frame)].rotation.copy() for role, frame in roles.turns.items()},
        low if np.isfinite(low) else 0.0,
    )


def rest_axes(motion: SkeletonMotion, roles: Roles) -> Array | None:
    """Forward, left and up (columns, 3 x 3) of the skeleton's rest posture; None where that does not stand."""
    rest = motion.rest()
    body = _Body({role: rest[motion.names.index(joint)] for role, joint in roles.joints.items()})
    top = next((role for role in ("shoulders", "neck", "head", "chest") if body.has("hips", role)), None)
    up = np.array([0.0, 0.0, 1.0])
    vectors = [] if top is None else [body.way("hips", top)]
    for side in ("left", "right"):
        for first, second in (("hip", "knee"), ("knee", "ankle")):
            if body.has(f"{side}_{first}", f"{side}_{second}"):
                vectors.append(-body.way(f"{side}_{first}", f"{side}_{second}"))
    pair = next((part for part in ("hip", "shoulder") if body.has(f"left_{part}", f"right_{part}")), None)
    if pair is None or not vectors or any(way @ up < UPRIGHT * np.linalg.norm(way) for way in vectors):
        return None
    left = body.way(f"right_{pair}", f"left_{pair}")
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 1e-6:
        return None
    left /= np.linalg.norm(left)
    return np.stack([cross(left, up), left, up], axis=1)


class Proportions:
    """What a recording says once and for all: lengths of bones, how feet are soled, heights, the scale of a figure.

    Attributes:
        path: metres of the figure for each metre of the skeleton's way over the ground.
    """

    def __init__(
        self, motion: SkeletonMotion, figure: Figure, roles: Roles, ground: Ground, path: float | None = None
    ) -> None:
        """Measure a recording; `path`: metres of the figure for a metre of the path and heights, None as its legs."""
        places, self._turned, lowest = standing_places(figure, roles)
        self._own, self._axes, self._fixed = _Body(places), rest_axes(motion, roles), figure.root == "fixed"
        self._joint = {role: motion.names.index(name) for role, name in roles.joints.items()}
        self._soles = soles(motion, roles, ground.rests, places)
        self._flat = flat_turns(motion, roles, ground.rests)
        self._turning = turning(motion, roles)
        own = self._own
        self._source = source = _Body(self._centres(motion))
        self._scale = _leg(own) / max(_leg(source), SMALL) if _leg(own) and _leg(source) else 1.0
        self.path = 1.0 if self._fixed else self._scale if path is None else path
        lows = ground.lowest
        foot = next((part for part in ("left_ankle", "left_toe") if part in lows and own.has(part)), None)
        if foot is not None:
            self._rise = own.places[foot][2] - lowest - self._scale * lows[foot]
        else:
            self._rise = -self._scale * float(np.percentile(motion.positions[:, :, 2].min(axis=1), 2))

    def _centres(self, motion: SkeletonMotion) -> dict[str, Array]:
        centres = {role: motion.positions[:, k] for role, k in self._joint.items()}
        return centres | soled(motion, self._joint, self._soles)

    def targets(self, motion: SkeletonMotion, under: Array | float = 0.0) -> Targets:
        """Goals of all frames of a motion of the same skeleton; `under` (n,) heights of the ground below it, metres."""
        own, source = self._own, _Body(self._centres(motion), self._source)
        turns = _turns(motion, self._joint, own, self._turned, self._axes, self._flat)
        turns = {role: turn for role, turn in turns.items() if role in self._turning}
        root = turns.get("pelvis", _pelvis(source, motion))
        if self._fixed:  # only what moves relative to the pelvis can be followed
            back = np.swapaxes(root, 1, 2)
            vectors = {role: at - source.places["hips"] for role, at in source.places.items()}
            turned = {role: (back @ way[:, :, None])[:, :, 0] for role, way in vectors.items()}
            source = _Body(turned, self._source)
            turns = {role: back @ turn for role, turn in turns.items() if role != "pelvis"}
            hips = np.tile(own.places.get("hips", np.zeros(3)), (len(motion), 1))
        else:
            hips = np.array([self.path, self.path, self._scale]) * source.places["hips"]
            hips[:, 2] += (self.path - self._scale) * under + self._rise
        return Targets(_points(own, source, hips, self._fixed or not has_trunk(self._joint)), turns, root)


def _turns(
    motion: SkeletonMotion,
    joint: dict[str, int],
    own: _Body,
    turned: dict[str, Array],
    axes: Array | None,
    flat: Mapping[str, Array],
) -> dict[str, Array]:
    """Orientations (n, 3, 3) of pelvis, head, feet and hands by role; none where the rest posture does not stand."""
    if axes is None:
        return {}
    rigid = [role for role in ("pelvis", "head", "left_ankle", "right_ankle") if role in joint]
    turns: dict[str, Array] = {
        role: motion.rotations[:, joint[role]] @ flat.get(role, np.eye(3)) @ axes @ turned[role] for role in rigid
    }
    for side in ("left", "right"):
        turn = _hand_turn(motion, joint, side, axes)
        if turn is not None:
            inward = np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])  # as palms face in the neutral posture
            fingers = own.way(f"{side}_wrist", f"{side}_hand")
            turns[f"{side}_hand"] = turn @ _frame(fingers, inward).T @ turned[f"{side}_hand"]
    return turns


def turning(motion: SkeletonMotion, roles: Roles) -> set[str]:
    """Roles whose joints' axes turn with the body; those of skeletons of places alone do not, and say nothing.

    A joint's axes turn with the body where bones of constant length have the directions of the rest posture in them,
    and where they have these in the pelvis's axes.
    """
    used = set[int]()
    for name in roles.joints.values():
        joint = motion.names.index(name)
        while joint not in used and joint >= 0:
            used.add(joint)
            joint = int(motion.parents[joint])
    alike: dict[int, list[float]] = {joint: [] for joint in used}
    for joint in used - {0}:
        parent, rest = int(motion.parents[joint]), np.linalg.norm(motion.offsets[joint])
        bone = motion.positions[:, joint] - motion.positions[:, parent]
        lengths = np.linalg.norm(bone, axis=1)
        if min(rest, lengths.min()) > SMALL and lengths.std() < 0.1 * lengths.mean():  # else it moves along itself
            there = motion.rotations[:, parent] @ (motion.offsets[joint] / rest)
            alike[parent].append(float((bone / lengths[:, None] * there).sum(axis=1).mean()))
    like = {joint: min(cosines, default=1.0) > ALIKE for joint, cosines in alike.items()}
    whole = like[motion.names.index(roles.joints["pelvis"])] if "pelvis" in roles.joints else like[0]
    at = {role: motion.names.index(name) for role, name in roles.joints.items()}
    return {role for role, k in at.items() if whole and like[motion.parents[k] if role.endswith("hand") else k]}


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
    return np.asarray(start + source.way(first, second) * _ratio(own, source, first, second))


def known_bones(limb: tuple[str, ...], side: str, roles: Collection[str]) -> list[tuple[str, str]]:
    """Both ends of what lies between the roles of a limb that are known: bones, or their remaining parts."""
    return list(pairwise(role for part in limb if (role := f"{side}_{part}") in roles))


def _points(own: _Body, source: _Body, hips: Array, anchored: bool) -> dict[str, Array]:
    """Places (n, 3) of the roles: from the hips up to the shoulders and the head, and outwards along the limbs."""
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
    """Orientation of the pelvis (n, 3, 3) from places: y from right to left, z towards the shoulders; or the root's."""
    pair = next((part for part in ("hip", "shoulder") if source.has(f"left_{part}", f"right_{part}")), None)
    if pair is None:
        return np.array(motion.rotations[:, 0])
    left = source.way(f"right_{pair}", f"left_{pair}")
    top = next((role for role in ("shoulders", "neck", "chest", "head") if source.has(role, "hips")), None)
    up = np.tile([0.0, 0.0, 1.0], (len(left), 1)) if top is None else source.way("hips", top)
    y = left / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), SMALL)
    x = cross(y, up)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), SMALL)
    found = np.stack([x, y, cross(x, y)], axis=2)
    flat = np.abs(np.linalg.det(found) - 1.0) > RIGID
    found[flat] = motion.rotations[flat, 0]
    return found


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
    return np.asarray(motion.rotations[:, motion.parents[hand]] @ _frame(fingers, palm))


def _frame(along: Array, towards: Array) -> Array:
    """Orthonormal axes (3, 3): x along the first direction, z as near to the second one as it can be."""
    x = along / np.linalg.norm(along)
    y = cross(towards, x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, cross(x, y)], axis=1)


def soles(
    motion: SkeletonMotion, roles: Roles, stands: Mapping[str, Mask], places: Mapping[str, Array]
) -> dict[str, Array]:
    """Directions (3,) from ankles to toes in the ankles' axes, by role, as if feet were soled as the figure's are.

    Skeletons have both joints at other heights above their soles; their direction may differ by 20 degrees and
    more. While both stand (n,) the sole is flat, which says in the ankle's axes where the toes of the figure would be:
    `places` (3,) are those in its neutral posture, by role.
    """
    found = {}
    for side in ("left", "right"):
        ankle, toe = f"{side}_ankle", f"{side}_toe"
        if not {ankle, toe} <= stands.keys() & places.keys():
            continue
        flat = stands[ankle] & stands[toe]
        start, end = (motion.names.index(roles.joints[role]) for role in (ankle, toe))
        vectors = motion.positions[:, end] - motion.positions[:, start]
        heading, own = vectors[flat] * (1.0, 1.0, 0.0), places[toe] - places[ankle]
        along = np.linalg.norm(heading, axis=1)
        length = np.median(np.linalg.norm(vectors, axis=1))
        if not flat.any() or along.min() < 0.5 * length:  # a hanging foot says nothing
            continue
        rise = float(own[2] / np.linalg.norm(own))
        wanted = heading / along[:, None] * np.sqrt(1.0 - rise**2) + (0.0, 0.0, rise)
        local = np.einsum("nji,nj->ni", motion.rotations[flat, start], wanted).mean(axis=0)
        alike = np.linalg.norm(local)  # 1 where all frames say the same
        if alike > ALIKE:  # axes that do not turn with the foot say nothing, as of skeletons of places alone
            found[toe] = local / alike
    return found


def soled(motion: SkeletonMotion, joint: Mapping[str, int], known: Mapping[str, Array]) -> dict[str, Array]:
    """Places (n, 3) of toes whose directions from their ankles are `known`; `joint` has those of roles."""
    found = {}
    for toe, local in known.items():
        ankle, end = joint[toe.replace("toe", "ankle")], joint[toe]
        lengths = np.linalg.norm(motion.positions[:, end] - motion.positions[:, ankle], axis=1)
        found[toe] = motion.positions[:, ankle] + lengths[:, None] * (motion.rotations[:, ankle] @ local)
    return found


def flat_turns(motion: SkeletonMotion, roles: Roles, stands: Mapping[str, Mask]) -> dict[str, Array]:
    """Rotations (3, 3) in ankles' axes by role, from the rest posture's foot to a flat one, of standing frames (n,)."""
    found = {}
    for side in ("left", "right"):
        ankle, toe = f"{side}_ankle", f"{side}_toe"
        if ankle in roles.joints and {ankle, toe} <= stands.keys() and (flat := stands[ankle] & stands[toe]).any():
            up = motion.rotations[flat, motion.names.index(roles.joints[ankle])][:, 2].mean(axis=0)
            if np.linalg.norm(up) > UPRIGHT:
                quaternion = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), up / np.linalg.norm(up))
                found[ankle] = quaternion.toRotationMatrix()
    return found

"""Which joints of a skeleton are which parts of a body by its structure, where their names do not tell.

A body has two pairs of limbs: siblings of one length, of which two neighbouring bones are the longest. The pair of the
longer ones are legs. What is between the pairs is the trunk; what goes on beyond the arms is the neck. Left is known by
letters in the names, else by the feet, which point forward, and by the knees, which bend forward.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross
from wholebody.figures.figure import Figure
from wholebody.figures.postures import zero
from wholebody.geometry.pieces import box_corners
from wholebody.motion.skeleton import UNITS, SkeletonMotion, longest_way

LIMBS = (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist", "hand"))
"""Ends of the bones of a leg and of an arm, from the trunk outwards."""

PARTS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist", "head")


class _Limb(NamedTuple):
    """Joints of a limb from the trunk outwards, and the place among them from which its two longest bones go on."""

    joints: list[int]
    first: int
    bones: tuple[float, float]

    @property
    def length(self) -> float:
        return sum(self.bones)


def limb_pairs(parents: Indices, offsets: Array, least: int = 2) -> tuple[tuple[int, _Limb, _Limb], ...]:
    """Legs and arms: the joint from which the pair goes on, and both limbs; empty for fewer than `least` pairs."""
    lengths = np.linalg.norm(offsets, axis=1)
    children: list[list[int]] = [[] for _ in parents]
    reach = lengths.copy()
    for joint in range(len(parents) - 1, 0, -1):
        children[parents[joint]].append(joint)
        reach[parents[joint]] = max(reach[parents[joint]], lengths[parents[joint]] + reach[joint])
    found = []
    for joint, below in enumerate(children):
        limbs = [limb for each in below if (limb := _limb(each, children, lengths, reach)) is not None]
        alike = [
            (float(np.abs(np.log(np.divide(one.bones, other.bones))).max()), one, other)
            for one, other in combinations(limbs, 2)
            if len(one.joints) == len(other.joints)
        ]
        taken = list[_Limb]()  # arms and legs of a stiff trunk begin at one joint
        for _, one, other in sorted((pair for pair in alike if pair[0] < 0.15), key=lambda each: each[0]):
            if one not in taken and other not in taken:
                taken += one, other
                found.append((joint, one, other))
    found = sorted(found, key=lambda pair: pair[1].length + pair[2].length, reverse=True)[:2]
    if len(found) < least:
        return ()
    ratios = [
        found[0][1].length / found[-1][1].length,
        *(max(limb.bones) / min(limb.bones) for _, *pair in found for limb in pair),
    ]
    inside = any(joint in limb.joints for joint, *_ in found for _, *pair in found for limb in pair)
    return () if inside or ratios[0] > 2.5 or max(ratios[1:]) > 2.0 else tuple(found)


def _limb(start: int, children: list[list[int]], lengths: Array, reach: Array) -> _Limb | None:
    """The limb that goes on from a joint; None where two neighbouring bones are not its longest."""
    joints = [start]
    while children[joints[-1]]:
        joints.append(max(children[joints[-1]], key=lambda child: float(reach[child])))
    if len(joints) < 3:
        return None
    shorter = [min(lengths[joints[k + 1]], lengths[joints[k + 2]]) for k in range(len(joints) - 2)]
    # of several the outermost that does not end the limb: a clavicle may be longer than a forearm, and hands follow
    long = np.flatnonzero(np.array(shorter) >= 0.67 * max(shorter)).tolist()
    # one bone goes on from an elbow or a knee; several fingers do from a wrist
    long = [k for k in long if len(children[joints[k + 1]]) == 1] or long
    first = next((k for k in reversed(long) if k + 3 < len(joints)), long[-1])
    bones = float(lengths[joints[first + 1]]), float(lengths[joints[first + 2]])
    long_enough = sum(bones) > 0.4 * (reach[start] - lengths[start]) and min(bones) > 0.0
    return _Limb(joints, first, bones) if long_enough else None


def built(motion: SkeletonMotion, stands: bool = False) -> dict[str, str]:
    """Role to joint of a skeleton by its structure; empty where it is no person's. What `stands` may have no arms."""
    pairs = limb_pairs(motion.parents, motion.offsets, 1 if stands else 2)
    if not pairs:
        return {}
    if stands:
        pairs = tuple(sorted(pairs, key=lambda pair: float(motion.positions[0, pair[1].joints[-1], 2])))
    places = motion.positions[:: max(1, len(motion) // 50)]
    hips, *legs = pairs[0]
    chest = pairs[-1][0]
    found = {"pelvis": hips} if hips == chest else {"pelvis": hips, "chest": chest}
    for (_, *pair), parts in zip(pairs, LIMBS, strict=False):
        for side, limb in zip(("left", "right"), _sided(motion, places, pair, legs), strict=True):
            found |= {f"{side}_{part}": joint for part, joint in zip(parts, _parts(motion, limb), strict=False)}
    taken = {joint for _, *pair in pairs for limb in pair for joint in limb.joints}
    while hips >= 0:  # from a chest that is the root a way leads down to the legs
        taken.add(hips)
        hips = int(motion.parents[hips])
    above = [k for k in range(len(motion.names)) if motion.parents[k] == chest and k not in taken]
    if "chest" in found and above:
        neck = [max(above, key=lambda k: _reach(motion, k))]
        while below := [k for k in range(len(motion.names)) if motion.parents[k] == neck[-1]]:
            neck.append(max(below, key=lambda k: _reach(motion, k)))
        turning = neck[:-1] or neck  # the last one is the end of the head
        found |= {"head": turning[-1]} | ({"neck": turning[0]} if len(turning) > 1 else {})
    return {role: motion.names[joint] for role, joint in found.items()}


def _reach(motion: SkeletonMotion, joint: int) -> float:
    return float(np.linalg.norm(motion.offsets[joint]))


def _parts(motion: SkeletonMotion, limb: _Limb) -> list[int]:
    """The three ends of the two longest bones, and the next joint that is apart: of a leg one that is not below it."""
    # a bone shorter than 1 % of the skeleton's longest way has no direction
    size, rest = 0.01 * longest_way(motion.parents, motion.offsets), motion.rest()
    first, middle, last = limb.joints[limb.first : limb.first + 3]
    beyond = [k for k in limb.joints[limb.first + 3 :] if np.linalg.norm(rest[k] - rest[last]) > size]
    offsets = rest[beyond] - rest[last]
    down = (rest[last] - rest[middle]) / np.linalg.norm(rest[last] - rest[middle])
    ahead = np.abs(offsets @ down) < 0.9 * np.linalg.norm(offsets, axis=1)  # a joint in the sole is no toe
    straight = not ahead.any()  # an arm, or a foot that hangs
    return [first, middle, last, *[k for k, off in zip(beyond, ahead, strict=True) if off or straight][:1]]


def _sided(motion: SkeletonMotion, places: Array, pair: list[_Limb], legs: list[_Limb]) -> list[_Limb]:
    signs = [sum(side_of(motion.names[joint]) for joint in limb.joints) for limb in pair]
    if signs[0] * signs[1] < 0:
        return pair if signs[0] > 0 else pair[::-1]
    left = np.zeros((len(places), 3))
    for limb in legs:
        hip, knee, ankle, *toe = (places[:, joint] for joint in _parts(motion, limb))
        left += np.cross(hip - ankle, toe[0] - ankle if toe else 2.0 * knee - hip - ankle)
    apart = places[:, pair[0].joints[pair[0].first]] - places[:, pair[1].joints[pair[1].first]]
    return pair if float((left * apart).sum()) >= 0.0 else pair[::-1]


def side_of(name: str) -> int:
    """1 for a name of the left side, -1 for one of the right, 0 for neither."""
    plain = re.sub(r"^.*[:|]|(?<![A-Za-z])[LR](?=[LR](?![A-Za-z]))", "", name)  # LR_knee: of the legs the right one
    side = re.search(r"left|right", plain, re.IGNORECASE) or re.search(
        r"(?:^|(?<=[^A-Za-z]))([LRlr])(?=[^a-z]|$)|(?<=[a-z])([LR])$", plain
    )
    return 0 if side is None else 1 if side[0].lower().startswith("l") else -1


def upright(figure: Figure) -> Array:
    """(nq,) a posture with flat soles and straight limbs, looking along x: a robot's zero, if it has one."""
    q = zero(figure)
    if figure.root == "free":
        data = figure.model.createData()
        pin.forwardKinematics(figure.model, data, q)
        left = sum(side_of(name) * at.translation for name, at in zip(figure.model.names, data.oMi, strict=True))
        turns = round(float(np.arctan2(-left[0], left[1]) / (0.5 * np.pi)))  # quarters, of robots that look elsewhere
        turn = pin.Quaternion(pin.AngleAxis(-0.5 * np.pi * turns, np.array([0.0, 0.0, 1.0])))
        q[3:7] = (turn * pin.Quaternion(q[3:7])).coeffs() if turns else q[3:7]
    return q


def link_end(figure: Figure, joint: int) -> Array:
    """(3,) the far end of what a joint carries, in its axes, metres; the joint itself where it carries nothing."""
    pieces = [piece for piece in figure.geometry.geometryObjects if piece.parentJoint == joint]
    corners = [[0.0, 0.0, 0.0], *(piece.placement.act(at) for piece in pieces for at in box_corners(piece.geometry))]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    end, axis = 0.5 * (low + high), int(np.argmax(np.maximum(high, -low)))
    end[axis] = high[axis] if high[axis] > -low[axis] else low[axis]
    return np.asarray(end)


class Part(NamedTuple):
    """Where a role is: the joint that carries it, and its place (3,) in the axes of that, metres."""

    joint: str
    place: Array


def built_figure(figure: Figure) -> dict[str, Part]:
    """Parts of a figure by role, where the axes of their joints meet at its zero; empty where it is no person's."""
    # Joints of one place are one, and a hinge is anywhere along its axis: that of a thigh's turn is at the hip.
    model, data = figure.model, figure.model.createData()
    pin.computeJointJacobians(model, data, upright(figure))
    real = np.array([place.translation for place in data.oMi])
    at, root = real.copy(), 1 if figure.root == "free" else 0
    # joints that are nearer to each other than this share of the figure's size meet in one place
    near = 0.07 * float(np.ptp(at[root:], axis=0).max())
    first, groups, parents = {root: 0}, [[root]], [-1]  # joint to its group
    columns = np.asarray(data.J).reshape(6, -1)[3:]  # Pinocchio's is (6,) where there is one column
    turned = [columns[:, joint.idx_vExtended] if joint.nv == 1 else np.zeros(3) for joint in model.joints[1:]]
    axes = np.array([np.zeros(3), *turned])
    for joint in range(root + 1, model.njoints):
        before = model.parents[joint]
        own, way = first[before], at[before] - at[joint]
        # fingers begin at a wrist, which is where it is
        along = (axes[joint] @ way) * axes[joint] if list(model.parents).count(joint) < 2 else np.zeros(3)
        # toes turn about an axis beside that of the ankle, an arm beside that of its clavicle
        meets = all(_apart(real[joint] - real[k], axes[joint], axes[k]) < 0.5 * near for k in groups[own])
        if own and list(model.parents).count(before) == 1 and np.linalg.norm(way - along) < near and meets:
            groups[own].append(joint)
            at[joint] += along
        else:
            parents.append(own)
            groups.append([joint])
            own = len(groups) - 1
        first[joint] = own
    places, joints = [at[group[-1]] for group in groups], [group[-1] for group in groups]
    for number, group in enumerate(groups):  # where links end
        if number not in parents and group[-1] not in model.parents:
            parents.append(number)
            joints.append(group[-1])
            places.append(data.oMi[group[-1]].act(link_end(figure, group[-1])))
    offsets = np.array([place - places[max(parent, 0)] for place, parent in zip(places, parents, strict=True)])
    numbers = tuple(f"{model.names[joint]} {k}" for k, joint in enumerate(joints))
    turns = np.tile(np.eye(3), (1, len(numbers), 1, 1))
    still = SkeletonMotion(numbers, np.array(parents), offsets, turns, np.array(places)[None], 1.0)
    found = {role: numbers.index(name) for role, name in built(still, stands=True).items()}
    found = {role: k for role, k in found.items() if role.split("_")[-1] in PARTS}
    meeting = {role: groups[k] for role, k in found.items() if k < len(groups)}
    # a bone is carried by the last joint before it: what turns beyond an elbow, a knee or a wrist turns the next one
    carriers = {role: joints[k] for role, k in found.items()} | {
        role: group[0] if role.split("_")[-1] in ("elbow", "knee", "wrist") else group[-1]
        for role, group in meeting.items()
    }
    if not _is_person(carriers, {role: places[k] for role, k in found.items()}, figure.root == "free"):
        return {}
    centres = {role: places[k] for role, k in found.items()} | _centres(meeting, real, axes)
    return {role: Part(model.names[joint], data.oMi[joint].actInv(centres[role])) for role, joint in carriers.items()}


def _apart(way: Array, axis: Array, other: Array) -> float:
    """Distance of two lines, metres, from a point on the one to a point on the other; 0 of what does not turn."""
    normal = cross(axis, other)
    size = float(np.linalg.norm(normal))
    if size > 0.1:
        return abs(float(way @ normal)) / size
    return float(np.linalg.norm(cross(way, axis)))


def _centres(meeting: Mapping[str, list[int]], real: Array, axes: Array) -> dict[str, Array]:
    """Places (3,) nearest to the axes of joints, by role; `real` (j, 3) and `axes` (j, 3) are those of all joints."""
    found, hinges = {}, {}
    for role, joints in meeting.items():
        across = np.eye(3) - axes[joints, :, None] * axes[joints, None, :]
        middle = real[joints].mean(axis=0)
        # the little of the identity leaves the middle where lines do not say, along an axis
        found[role] = middle + np.linalg.solve(
            across.sum(axis=0) + 1e-9 * np.eye(3), (across @ (real[joints] - middle)[:, :, None]).sum(axis=0)[:, 0]
        )
        if np.linalg.norm(cross(axes[joints], axes[joints[-1]]), axis=1).max() < 0.1:
            hinges[role] = axes[joints[-1]]
    limbs = [[f"{side}_{part}" for part in parts[:3]] for parts in LIMBS for side in ("left", "right")]
    for start, middle, end in (limb for limb in limbs if limb[1] in hinges):
        swing = hinges[middle]
        # nothing says how far out such a leg is
        beside = bool(start in meeting and abs(axes[meeting[start][-1]] @ swing) > 0.99)
        ends = (end,) if beside else (start, end)
        known = [role for role in ends if role in meeting and role not in hinges]
        if known:
            found[middle] += swing * (swing @ (np.mean([found[role] for role in known], axis=0) - found[middle]))
        hung = [start] * beside + [role for role in (end,) if role in hinges and abs(hinges[role] @ swing) > 0.99]
        for role in hung:
            last = meeting[role][-1]
            found[role] = real[last] + swing * (swing @ (found[middle] - real[last]))
    return found


def _is_person(joints: Mapping[str, int], places: Mapping[str, Array], walks: bool) -> bool:
    """Whether shoulders (3,) stand above hips, and no joint but a forearm's has two roles; of what `walks`, hips."""
    arms = "left_shoulder" in places
    if not {"left_hip", "left_ankle"} <= places.keys() or not (arms or walks):
        return False
    lower, upper = (
        sum(places[f"{side}_{part}"] for side in ("left", "right"))
        for part in (("hip", "shoulder") if arms else ("ankle", "hip"))
    )
    trunk = np.asarray(upper - lower)
    single = [joint for role, joint in joints.items() if not role.endswith("wrist")]
    return len(set(single)) == len(single) and bool(trunk[2] > 0.5 * np.linalg.norm(trunk))


def recognised_unit(parents: Indices, offsets: Array) -> str:
    """The unit of `UNITS` in which a person's skeleton is a person's size; of others m to 3, cm to 300, else mm."""
    size = max(longest_way(parents, offsets), 1e-12)
    if limb_pairs(parents, offsets):
        return min(
            UNITS, key=lambda unit: abs(np.log(size * UNITS[unit] / 2.2))
        )  # m, along the bones from foot to head
    return "metres" if size <= 3.0 else "centimetres" if size <= 300.0 else "millimetres"


def size_of(motion: SkeletonMotion, joints: Mapping[str, str]) -> float:
    """How many times as long as a grown person's the legs of a skeleton are, by joints of roles; 1 for grown people."""
    legs = [[f"{side}_{part}" for part in LIMBS[0][:3]] for side in ("left", "right")]
    if not {*legs[0], *legs[1]} <= joints.keys():
        return 1.0
    at = {role: motion.positions[:, motion.names.index(joint)] for role, joint in joints.items()}
    bones = [at[end] - at[start] for leg in legs for start, end in pairwise(leg)]
    size = 0.5 * sum(float(np.median(np.linalg.norm(bone, axis=1))) for bone in bones) / 0.84  # m, of a median person
    return size if size > 0.0 and not 0.75 < size < 1.25 else 1.0


def stands_along(motion: SkeletonMotion, axis: int) -> bool:
    """Whether a person stands along an axis, on the ground at its zero, in most frames."""
    pairs = limb_pairs(motion.parents, motion.offsets)
    if not pairs:
        return False
    middles = [motion.positions[:, [one.joints[0], other.joints[0]]].mean(axis=1) for _, one, other in pairs]
    hips, shoulders = sorted(middles, key=lambda middle: float(middle[:, axis].mean()))
    upright = (shoulders - hips)[:, axis] > 0.8 * np.linalg.norm(shoulders - hips, axis=1)
    lowest = motion.positions[:, :, axis].min(axis=1)
    grounded = np.abs(lowest).max() < 0.1 * longest_way(motion.parents, motion.offsets)
    return bool(grounded and upright.mean() > 0.5)


def is_sized(parents: Indices, offsets: Array) -> bool:
    """Whether a skeleton, metres, is of a person's size, or has not a person's structure."""
    return not limb_pairs(parents, offsets) or 0.5 < longest_way(parents, offsets) < 5.0  # m, from foot to head

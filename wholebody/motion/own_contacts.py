"""Where hands rest on their own body: on each other, the head, the trunk or a thigh.

The skeleton says when, and from which side: a hand is slow in the axes of a bone, and near to the flesh about it. The
free fit of the figure says which of its pieces is there, whatever its size. Goals there move with the piece, so that a
hand that rests does not hold the body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask, with_values
from wholebody.figures.figure import Figure
from wholebody.motion.footholds import RestLimits
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.thing_contacts import Piece, ThingContact, near_and_slow, nearest
from wholebody.motion.windows import long_runs, runs

BODY = {
    "head": ("head", "head", 0.13),
    "trunk": ("hips", "shoulders", 0.13),
    "pelvis": ("left_hip", "right_hip", 0.11),
    "left thigh": ("left_hip", "left_knee", 0.1),
    "right thigh": ("right_hip", "right_knee", 0.1),
}
"""Of parts that hands touch both ends of a bone, and how far a hand that touches them is from it, metres."""

HAND = 0.06  # m: as far from each other are hands that touch; half of it is a hand without pieces thick
SLACK = 0.02  # m: farther away than that by more than this nothing is touched: hands that swing past hips do not
ARM = ("shoulder", "elbow", "wrist", "hand")


def hand_shares(joints: Mapping[str, str]) -> dict[str, float]:
    """Roles of a skeleton's hands, of wrists without one, and where between wrist and joint they touch a body."""
    found = {}
    for hand, wrist in (("left_hand", "left_wrist"), ("right_hand", "right_wrist")):
        if {hand, wrist} & joints.keys():
            found[hand if hand in joints else wrist] = 0.5 if {hand, wrist} <= joints.keys() else 1.0
    return found


def own_rests(
    motion: SkeletonMotion,
    joints: Mapping[str, str],
    shares: Mapping[str, float],
    busy: Sequence[tuple[str, int, int]],
) -> list[ThingContact]:
    """When hands of a skeleton touch their own body, by the roles of its `joints`, and from where.

    `shares` are those of the hands, see `hand_shares`. The normals are in the world, in the middle frame of each; the
    places are not said. Hands do not that are `busy`: roles with first frames and ends.
    """
    at = {role: motion.positions[:, motion.names.index(joint)] for role, joint in joints.items()}
    turns = {role: motion.rotations[:, motion.names.index(joint)] for role, joint in joints.items()}
    for part in ("hip", "shoulder"):
        if {f"left_{part}", f"right_{part}"} <= at.keys():
            at[f"{part}s"] = 0.5 * (at[f"left_{part}"] + at[f"right_{part}"])
            turns[f"{part}s"] = turns.get("pelvis", turns[f"left_{part}"])
    found = list[ThingContact]()
    free: dict[str, Mask] = {role: np.ones(len(motion), dtype=bool) for role in shares}
    for role, frame, last in busy:
        if role in free:
            free[role][frame:last] = False
    wrists = {role: wrist if (wrist := role.replace("hand", "wrist")) in at else role for role in shares}
    parts = {role: (wrists[role], role, HAND) for role in shares} | BODY
    for role, share in shares.items():
        place = at[wrists[role]] + share * (at[role] - at[wrists[role]])
        for name, (start, end, reach) in parts.items():
            if name == role or not {start, end} <= at.keys():
                continue
            way = place - _on_bone(place, at[start], at[end])
            far = np.linalg.norm(way, axis=1)
            local = np.einsum("nji,nj->ni", turns[start], place - at[start])
            near = near_and_slow(local, far - reach, SLACK, motion.dt) & free[role] & (far > 1e-3)
            near &= free.get(name, near)
            for run in runs(long_runs(near, max(1, round(RestLimits().least / motion.dt)))):
                normal = way[(run.first + run.end) // 2]
                found.append(ThingContact(role, *run, name, np.zeros(3), normal / np.linalg.norm(normal), share))
                for taken in {role, name} & free.keys():
                    free[taken][run.first : run.end] = False
    return found


def _on_bone(places: Array, start: Array, end: Array) -> Array:
    """(n, 3) what is nearest to points (n, 3) on lines between two points (n, 3)."""
    way = end - start
    along = np.einsum("ni,ni->n", places - start, way) / np.maximum(np.einsum("ni,ni->n", way, way), 1e-12)
    return np.asarray(start + np.clip(along, 0.0, 1.0)[:, None] * way)


def own_contacts(
    rests: Sequence[ThingContact], figure: Figure, roles: Roles, hands: Mapping[str, HeldPoint], free: Sequence[Array]
) -> list[ThingContact]:
    """The same of a figure, in the axes of its joints: where its `hands` are in the middle of each, of the free fit.

    `free` are its postures (nq,) in all frames.
    """
    model, data, pieces = figure.model, figure.model.createData(), dict[int, list[Piece]]()
    for piece in figure.geometry.geometryObjects:
        pieces.setdefault(piece.parentJoint, []).append(Piece(piece.geometry, piece.placement, np.inf))
    arms = {joint for role, (joint, _) in roles.places(figure).items() if role.split("_")[-1] in ARM}
    body, found = [joint for joint in pieces if not arms & set(model.supports[joint])], []
    for rest in rests:
        hand, other = hands[rest.role], hands.get(rest.thing)
        if other is None and not body:
            continue  # a body without pieces has nothing to touch
        pin.forwardKinematics(model, data, free[(rest.first + rest.end) // 2])
        here = data.oMi[hand.joint].act(hand.place)
        near = {joint: nearest(pieces[joint], data.oMi[joint].actInv(here))[0] for joint in body}
        base = min(near, key=lambda joint: near[joint]) if other is None else other.joint
        start = here if other is None else data.oMi[base].act(other.place)
        if base in pieces:
            # m: so far outside of a part, the nearest place on it is on the side that the hand came from
            _, place, normal = nearest(pieces[base], data.oMi[base].actInv(start + 0.1 * rest.normal))
        else:
            place = data.oMi[base].actInv(start + 0.5 * HAND * rest.normal)
            normal = data.oMi[base].rotation.T @ rest.normal
        found.append(with_values(rest, place=place, normal=normal, base=base, away=0.5 * HAND))
    return found

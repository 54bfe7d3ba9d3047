"""How much nearer two pieces can come while every joint moves by a bounded amount, wherever the joints are.

A joint that turns by at most w moves a point at distance r from its origin by at most w r. From the origin of a joint
to a point of a piece it is no farther than the sum of the distances between the joints on the way, which are constant,
and of the travel of those that slide. Joints that carry both pieces do not count.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.continuous.motion_bounds import TURNING_AXES
from wholebody.geometry.proximity import PairTable


def largest_approach(table: PairTable, centres: Array, most: Array) -> Array:
    """Most by which the distance of every pair can fall (pairs,), metres; infinite where nothing is known.

    Args:
        table: the pieces and pairs.
        centres: (n,) most that a piece's origin is away from that of its joint, metres; infinite where it may be placed
            anew.
        most: (nv,) largest displacement of every degree of freedom, radians and metres; may be infinite.
    """
    model = table.model
    moved = np.array([_motion(model, joint, most) for joint in range(model.njoints)])
    lengths = np.array([_length(model, joint) for joint in range(model.njoints)])
    parents = np.array(list(model.parents), dtype=np.intp)
    joint = table.joint[table.pairs]
    fixed, turned, lever = np.zeros((3, *joint.shape))
    with np.errstate(invalid="ignore"):  # an infinite lever of what does not turn
        # a joint comes after the one that carries it: the later of two is never an ancestor of the other
        while len(row := np.flatnonzero(joint[:, 0] != joint[:, 1])):
            later = (row, (joint[row, 1] > joint[row, 0]).astype(np.intp))
            number = joint[later]
            slide, turn = moved[number].T
            fixed[later] += slide + np.where(turn > 0.0, turn * lever[later], 0.0)
            turned[later] += turn
            lever[later] += lengths[number]
            joint[later] = parents[number]
        own = (centres + table.reach)[table.pairs]
        ways = fixed + np.where(turned > 0.0, turned * own, 0.0)
    return np.asarray(ways.sum(axis=1))


def _motion(model: pin.Model, joint: int, most: Array) -> tuple[float, float]:
    """How far a joint can slide, and how far it can turn."""
    if joint == 0:
        return 0.0, 0.0
    kind: Any = model.joints[joint]
    size = most[kind.idx_v : kind.idx_v + kind.nvExtended]
    if not np.isfinite(size).all():
        return np.inf, 0.0
    if any(word in kind.shortname() for word in TURNING_AXES):
        return np.inf, 0.0
    part = np.abs(_axes(model, kind)) @ size
    return float(np.linalg.norm(part[:3])), float(np.linalg.norm(part[3:]))


def _length(model: pin.Model, joint: int) -> float:
    """Most that the origin of a joint can be away from the origin of the one that carries it."""
    kind: Any = model.joints[joint]
    if joint == 0:
        return 0.0
    length = float(np.linalg.norm(model.jointPlacements[joint].translation))
    if not _axes(model, kind)[:3].any():
        return length
    if kind.nq != 1:
        return np.inf
    return length + float(max(abs(model.lowerPositionLimit[kind.idx_q]), abs(model.upperPositionLimit[kind.idx_q])))


def _axes(model: pin.Model, joint: Any) -> Array:
    """(6, k) motions of a joint by its k degrees of freedom, in its own frame."""
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return np.asarray(data.S).reshape(6, -1)

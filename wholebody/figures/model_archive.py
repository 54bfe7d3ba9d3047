"""Pickled models of Pinocchio: its archives alone lose infinite values and what joints that follow others are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array

LIMITS = ("lowerPositionLimit", "upperPositionLimit", "velocityLimit", "effortLimit")
"""Values of a model that may be infinite: an archive writes them and cannot read them."""


class _Follower(NamedTuple):
    """A joint that follows another one (mimic)."""

    number: int
    leader: int
    slope: float
    offset: float
    axis: Array  # (6,) it slides along, or turns about, by a unit of its own value


def reduced(model: pin.Model) -> tuple[Any, ...]:
    """What a pickled model is made from again, for `copyreg`."""
    limits = {name: np.array(getattr(model, name)) for name in LIMITS}
    finite, joints, followers = pin.Model(model), list(model.joints), list[_Follower]()
    for name, values in limits.items():
        setattr(finite, name, np.nan_to_num(values))
    for number, joint in enumerate(joints):
        if joint.shortname() == "JointModelMimic":
            law = joint.extract()
            leader = next(k for k, other in enumerate(joints) if other.nq and other.idx_q == law.idx_q)
            axis = np.asarray(joint.createData().S, dtype=float).ravel() / law.scaling
            followers.append(_Follower(number, leader, float(law.scaling), float(law.offset), axis))
    return _restored, (finite.saveToString(), limits, followers)


def _restored(archive: str, limits: dict[str, Array], followers: list[_Follower]) -> pin.Model:
    """A model that was pickled."""
    model = pin.Model()
    model.loadFromString(archive)
    for name, values in limits.items():
        setattr(model, name, values)
    for one in followers:  # archives of Pinocchio 3.8 leave out how many columns of the Jacobian they have
        joint, leader, read = _along(one.axis), model.joints[one.leader], model.joints[one.number].extract()
        joint.setIndexes(leader.id, leader.idx_q, leader.idx_v, leader.idx_vExtended)
        made = pin.JointModelMimic(pin.JointModel(joint), one.slope, one.offset)
        made.setIndexes(one.number, read.idx_q, read.idx_v, read.idx_vExtended)
        model.joints[one.number] = pin.JointModel(made)
    return model


def _along(axis: Array) -> Any:
    """A joint that slides along or turns about an axis (6,)."""
    kind, direction = ("P", axis[:3]) if axis[:3].any() else ("R", axis[3:])
    for k, letter in enumerate("XYZ"):
        if direction[k] == 1.0:
            return getattr(pin, f"JointModel{kind}{letter}")()
    return (pin.JointModelPrismaticUnaligned if kind == "P" else pin.JointModelRevoluteUnaligned)(direction)

"""Models of Pinocchio: checked against impossible numbers and angles in degrees, and pickled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import MOST_TURNED, warn
from wholebody.base.errors import InputError
from wholebody.figures.description import followers_of

HEAVIEST = 1e9  # kilograms: greatest mass carried by one joint
LARGEST = 1e6  # largest value of a joint, radians or metres, and largest tolerance; larger ones are refused as mistakes


def check_model(model: pin.Model, name: str) -> None:
    """Refuse impossible masses, positions, inertias and limits by an `InputError`; `name` is the figure's."""
    for joint in range(1, model.njoints):
        inertia, at = model.inertias[joint], model.jointPlacements[joint]
        where = f"{name}, joint {model.names[joint]!r}"
        if not 0.0 <= inertia.mass <= HEAVIEST:
            raise InputError(f"{where}: what it carries has a mass of {inertia.mass:g} kg; give 0 to {HEAVIEST:g} kg")
        for what, values in (("centre of mass", inertia.lever), ("inertia", inertia.inertia)):
            if not np.isfinite(values).all():
                raise InputError(f"{where}: the {what} of what it carries is not finite; give finite numbers")
        if not (np.isfinite(at.rotation).all() and (np.abs(at.translation) <= LARGEST).all()):
            raise InputError(f"{where}: its origin is not finite or beyond {LARGEST:g} m; give metres")
    low, high, speed = model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit
    for joint in list(model.joints)[1:]:
        where = f"{name}, joint {model.names[joint.id]!r}"
        for k in range(joint.idx_q, joint.idx_q + joint.nq):
            if not low[k] <= high[k]:
                raise InputError(f"{where}: its limits are {low[k]:g} and {high[k]:g}; give the lower one first")
        for k in range(joint.idx_v, joint.idx_v + joint.nv):
            if not speed[k] >= 0.0:
                raise InputError(f"{where}: its velocity limit is {speed[k]:g}; give 0 or more")


def with_joint_frames(model: pin.Model) -> pin.Model:
    """The model, or a copy with a frame for each joint that lacks one: joints have names that goals place."""
    lacking = [k for k in range(1, model.njoints) if not model.existFrame(model.names[k], pin.FrameType.JOINT)]
    if not lacking:
        return model
    model = pin.Model(model)
    for joint in lacking:
        model.addJointFrame(joint)
    return model


def joint_of(model: pin.Model, freedom: int) -> int:
    """The joint of a model that has a degree of freedom; 0 where none has."""
    return next(
        (joint for joint in range(1, model.njoints) if 0 <= freedom - model.idx_vs[joint] < model.nvs[joint]), 0
    )


FAR_OUT = 1.0  # radians beyond a limit from which a value was probably meant in degrees


class Turning:
    """The joints of a model that turn by one number, with their limits."""

    def __init__(self, model: pin.Model) -> None:
        """Look them up; a joint without a limit has two turns as its limit here."""
        every = list(zip(model.joints, model.names, strict=True))[1:]  # but the world's, whose numbers are not set
        joints = [(j, n) for j, n in every if j.nq == j.nv == 1]
        found = [(j.idx_q, str(name)) for j, name in joints if not j.shortname().startswith("JointModelP")]  # prismatic
        self._places = np.array([place for place, _ in found], dtype=np.intp)
        self._names = [name for _, name in found]
        low, high = model.lowerPositionLimit[self._places], model.upperPositionLimit[self._places]
        self._limits = low, high
        self._low = np.where(np.isfinite(low), low, -MOST_TURNED)
        self._high = np.where(np.isfinite(high), high, MOST_TURNED)
        self._least, self._most = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)  # beyond them something is said
        self._least[self._places], self._most[self._places] = self._low - FAR_OUT, self._high + FAR_OUT

    def warn(self, q: Array, what: str) -> bool:
        """Warn of the joint that is farthest out in a posture (nq,) or several (n, nq); whether it was said."""
        q = np.asarray(q)
        # at every step of a tracker: bytes are looked through in a tenth of the time of a reduction
        if q.ndim == 1 and 0 not in ((q >= self._least) & (q <= self._most)).tobytes():
            return False
        rows = np.atleast_2d(q)
        if not len(rows) or not len(self._places):
            return False
        least, most = rows.min(axis=0)[self._places], rows.max(axis=0)[self._places]  # no copy of a clip of hours
        beyond = np.maximum(self._low - least, most - self._high)
        column = int(np.argmax(beyond))
        if not float(beyond[column]) > FAR_OUT:
            return False
        values = rows[:, self._places[column]]
        frame = int(np.argmax(np.maximum(self._low[column] - values, values - self._high[column])))
        where = f"{what}: joint {self._names[column]!r}" + (f" of frame {frame}" if q.ndim > 1 else "")
        warn(self._sentence(where, float(values[frame]), column))
        return True

    def warn_of(self, name: str, value: float, place: int, q: Array) -> None:
        """Warn where a value of a joint, which is at a place of the posture q (nq,), is far out."""
        for column in np.flatnonzero(self._places == place).tolist():
            if not self._low[column] - FAR_OUT <= q[place] <= self._high[column] + FAR_OUT:
                warn(self._sentence(f"joint {name!r}", value, column))

    def _sentence(self, what: str, value: float, column: int) -> str:
        """The warning of an angle [rad] that is far out of its limits."""
        low, high = (float(limits[column]) for limits in self._limits)
        if low <= np.radians(value) <= high:
            out = "far out of its limits" if np.isfinite(low) or np.isfinite(high) else "more than two turns"
            return f"{what} is {value:g} rad, {out}; {value:g} degrees are {np.radians(value):.4g}"
        return f"{what} is {value:g} rad, far out of its limits, which are {low:.4g} and {high:.4g} rad"


LIMITS = ("lowerPositionLimit", "upperPositionLimit", "velocityLimit", "effortLimit")
"""Values of a model that may be infinite: an archive writes them and cannot read them."""


def archived(model: pin.Model) -> tuple[Any, ...]:
    """What a pickled model is made from again, for `copyreg`: Pinocchio's archives lose infinities and followers."""
    limits = {name: np.array(getattr(model, name)) for name in LIMITS}
    finite, followers = pin.Model(model), []
    for name, values in limits.items():
        setattr(finite, name, np.nan_to_num(values))
    for name, law in followers_of(model).items():
        number = model.getJointId(name)
        axis = np.asarray(model.joints[number].createData().S, dtype=float).ravel() / law.slope
        followers.append((number, model.getJointId(law.joint), law.slope, law.offset, axis))
    return _restored, (finite.saveToString(), limits, followers)


def _restored(
    archive: str, limits: dict[str, Array], followers: list[tuple[int, int, float, float, Array]]
) -> pin.Model:
    """The model; a follower is its number, its leader's, slope and offset, and its axis (6,) by a unit of its value."""
    model = pin.Model()
    model.loadFromString(archive)
    for name, values in limits.items():
        setattr(model, name, values)
    # archives of Pinocchio 3.8 leave out how many columns of the Jacobian they have
    for number, leading, slope, offset, axis in followers:
        joint, leader, read = _along(axis), model.joints[leading], model.joints[number].extract()
        joint.setIndexes(leader.id, leader.idx_q, leader.idx_v, leader.idx_vExtended)
        made = pin.JointModelMimic(pin.JointModel(joint), slope, offset)
        made.setIndexes(number, read.idx_q, read.idx_v, read.idx_vExtended)
        model.joints[number] = pin.JointModel(made)
    return model


def _along(axis: Array) -> Any:
    """A joint that slides along or turns about an axis (6,)."""
    kind, direction = ("P", axis[:3]) if axis[:3].any() else ("R", axis[3:])
    for k, letter in enumerate("XYZ"):
        if direction[k] == 1.0:
            return getattr(pin, f"JointModel{kind}{letter}")()
    return (pin.JointModelPrismaticUnaligned if kind == "P" else pin.JointModelRevoluteUnaligned)(direction)

"""Joint strength of people: the largest torques that muscles exert (Stobbe 1982; `figures/data/strength.csv`).

From 40 years on men lose 12 % of it in ten years (Hurley 1995, Journals of Gerontology 50A: 12 to 15 %), women 7.6 %
(Hunter, Thompson, Adams 2000, Journal of Gerontology 55A(6): knee extensors 9.3, plantar flexors 7.4, grip 6.2 %).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.figures.anthropometry import AGE
from wholebody.figures.figure import Figure
from wholebody.figures.tables import table

PERCENTILES = (5.0, 50.0, 95.0)
STRONGEST = 40.0  # years: until which strength is whole
LOSS = {"male": 0.012, "female": 0.0076}  # a year, of the strength at that age


class Shoulder(NamedTuple):
    """A shoulder, whose flexion strength is that of the torque about the axis across upper arm and axis of abduction.

    The joint's own axis of flexion is along an arm held out sideways: torques about the axes of the three joints then
    lack a part of what the muscles exert. With this axis the three are square in every posture.
    """

    flexion: int  # joint
    abduction: int  # joint with whose segment the axis goes
    axis: Array  # (3,) in the axes of that joint; of a hanging arm that of flexion


def shoulders(figure: Figure, prefix: str = "") -> list[Shoulder]:
    """Those of a person, or of the one of several figures whose names begin with a prefix."""
    found = []
    for side in ("left", "right"):
        first, second = (f"{prefix}{side}_shoulder_{way}" for way in ("flexion", "abduction"))
        if {first, second} <= {*figure.joints}:
            joints = figure.joint_id(first), figure.joint_id(second)
            own = figure.model.joints[joints[0]].createData().S[3:].ravel()
            found.append(Shoulder(*joints, figure.model.jointPlacements[joints[1]].rotation.T @ own))
    return found


def with_strength_axes(figure: Figure) -> pin.Model:
    """The model of a figure with a joint more in each shoulder, at zero, whose axis is that of its `Shoulder`."""
    own, extra = figure.model, {one.abduction: one.axis for one in shoulders(figure)}
    if not extra:
        return own
    made, place = pin.Model(), {0: 0}
    made.gravity = own.gravity
    for joint in range(1, own.njoints):
        parent, motion = place[own.parents[joint]], own.joints[joint]
        place[joint] = made.addJoint(parent, motion, own.jointPlacements[joint], own.names[joint])
        if joint in extra:
            axis = pin.JointModelRevoluteUnaligned(extra[joint])
            place[joint] = made.addJoint(place[joint], axis, pin.SE3.Identity(), f"{own.names[joint]}: strength")
        made.appendBodyToJoint(place[joint], own.inertias[joint], pin.SE3.Identity())
    return made


def _sex(value: Any, _: str) -> str:
    return checks.known(value, ("male", "female"), "sex", "Strength")


@dataclass(frozen=True)
class Strength(Checked):
    """Strength of a person, from measurements of static strength.

    Joints without a published value (clavicles, neck, wrists, toes, rotation of the hip, ...) have no limit. Strength
    between the tabulated percentiles is interpolated as if its logarithm were normally distributed.

    Attributes:
        percentile: share of people of this sex who are weaker, 5 to 95.
        sex: "male" or "female"; None for that of the figure, and male for a figure without one.
        age: years, 17 to 69; None for that of the figure, and under 40 for a figure without one.

    Raises:
        InputError: a percentile or an age beyond what was measured.
        UnknownNameError: another sex.

    Examples:
        >>> weak = wb.motion.Strength(percentile=5, sex="female")
    """

    percentile: Annotated[float, Range(PERCENTILES[0], PERCENTILES[-1])] = 50.0
    sex: Annotated[str, _sex] | None = None
    age: Annotated[float, AGE] | None = None

    def limits(self, figure: Figure) -> tuple[Array, Array]:
        """Least and largest torques (nv,) of a figure's joints, N m; infinite where none is published, as of a root."""
        from scipy.special import ndtri

        checks.instance(figure, Figure, "Strength.limits: figure", "load one with wb.load('human')")
        person = figure.describe().person
        sex = self.sex or ("male" if person is None else person.sex)
        age = (None if person is None else person.age) if self.age is None else self.age
        left = 1.0 - LOSS[sex] * max((age or STRONGEST) - STRONGEST, 0.0)
        lower, upper = np.full(figure.model.nv, -np.inf), np.full(figure.model.nv, np.inf)
        for name in figure.joints:
            joint = figure.model.joints[figure.joint_id(name)]
            for row in table("strength") if joint.nv == 1 else ():
                if row["joint"] == _kind(name):
                    sign, bounds = (-1.0, lower) if row["sign"] == "-" else (1.0, upper)
                    logs = np.log([float(row[f"{sex}_{percentile:g}"]) for percentile in PERCENTILES])
                    place = np.interp(ndtri(self.percentile / 100.0), ndtri(np.array(PERCENTILES) / 100.0), logs)
                    bounds[joint.idx_v] = sign * left * np.exp(place)
        return lower, upper


def torque_limits(figure: Figure, strength: Strength) -> tuple[Array, Array]:
    """Least and largest torques (nv,), N m: published strength, else the effort limits; infinite for none."""
    lower, upper = strength.limits(figure)
    if np.isfinite(lower).any() or np.isfinite(upper).any():
        return lower, upper
    effort = np.array(figure.model.effortLimit, dtype=float).reshape(-1)
    known = (effort > 0.0) & (effort < 1e9)  # a larger one stands for none
    known[[joint.nq != joint.nv for joint in list(figure.model.joints)[1:] for _ in range(joint.nv)]] = False
    return np.where(known, -effort, -np.inf), np.where(known, effort, np.inf)


def _kind(joint: str) -> str:
    """A joint's name without its side and number: "left_knee_flexion" -> "knee_flexion"."""
    words = joint.removeprefix("left_").removeprefix("right_").split("_")
    return "_".join([words[0].rstrip("0123456789"), *words[1:]])

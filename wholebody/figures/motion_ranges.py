"""Ranges of motion that more than one joint angle decides: muscles over two joints, the twist of a limb, the neck.

Limits of single joints allow what no person can do: to bend down with straight knees, to raise the arms with the
crease of the elbow outward, to flex, bend and turn the neck by all of its range at once. `figures/data` names the
sources of the numbers. Right limbs are given; left ones are their mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.tables import table


class CoupledRange(NamedTuple):
    """A weighted sum of joint angles is at most a bound: ``sum_i c_i q_i <= b``."""

    joints: Mapping[str, float]  # joint to its factor c
    bound: float  # b, radians


class EllipseAxis(NamedTuple):
    """One of the angles of an elliptic range: the sum of some joints."""

    joints: tuple[str, ...]  # names of the joints
    lower: float  # the angle's least value while the others are zero, radians, negative
    upper: float  # its greatest value, positive
    offset: float = 0.0  # radians added to the sum: of joints that are locked


class EllipticRange(NamedTuple):
    """Up to three angles share one range: the sum of their squares, each as a share of its own limit, is at most 1."""

    axes: tuple[EllipseAxis, ...]

    @property
    def size(self) -> float:
        """The least of all limits, radians."""
        return min(min(-axis.lower, axis.upper) for axis in self.axes)


class TwistRange(NamedTuple):
    """The twist of a limb about its long axis is at most a bound, which depends on where the limb points.

    The limb's rotation in the reference, seen from a central one, is a swing after a twist about the limb's own z axis
    (Grassia 1998, "Practical Parameterization of Rotations Using the Exponential Map", Journal of Graphics Tools 3(3)).
    The twist has no jump but where the limb points away from its central direction, which no limb does.
    ``s twist <= b + w . z`` with z the direction of the limb's z axis in the reference.
    """

    reference: str  # frame that carries the range
    limb: str  # frame that turns; its z axis is the limb's long axis
    center: Array  # (3, 3) central rotation of the limb in the reference
    sign: float  # s, 1 or -1: the direction of the twist that is limited
    bound: float  # b, radians
    slope: Array  # (3,) w, radians


MotionRange: TypeAlias = CoupledRange | EllipticRange | TwistRange

LARGEST_ELLIPSE = 3
"""Most angles that share one range."""

NECK = (
    (("neck1_flexion", "neck2_flexion"), -60.0, 50.0),
    (("neck1_lateral",), -45.0, 45.0),
    (("neck1_rotation", "neck2_rotation"), -80.0, 80.0),
)
"""Angles of the neck with the limits of each alone, degrees: extension 60, flexion 50, to a side 45, rotation 80 (AMA,
AAOS). That they end on an ellipsoid is an ESTIMATE: rotation decreases with flexion and extension (Walmsley et
al. 1996).
"""

INTERNAL_ROTATION = ((80.0, 70.0), (120.0, 0.0))
"""Elevations in the frontal plane, and the most inward rotation of the upper arm there, degrees: 70 up to 80 (AAOS, of
the abducted arm), none at 120, for the greater tubercle would meet the acromion: ESTIMATE."""


def human_ranges(sex: str, joints: Collection[str]) -> dict[str, MotionRange]:
    """Return the ranges of motion of a person of a sex whose joints are these."""
    column = "F" if sex == "female" else "M"
    found: dict[str, MotionRange] = {}
    for side in ("left", "right"):
        for row in table("coupled_ranges"):
            factors = {f"{side}_{row['limited']}": 1.0, f"{side}_{row['by']}": -float(row[f"slope_{column}"])}
            if factors.keys() <= set(joints):
                bound = math.radians(float(row[f"bound_{column}"]))
                found[f"{side}_{row['name']}"] = CoupledRange(factors, bound)
        found[f"{side}_shoulder_twist"] = shoulder_twist(side)
    if all(set(names) <= set(joints) for names, _, _ in NECK):
        axes = (EllipseAxis(names, math.radians(low), math.radians(high)) for names, low, high in NECK)
        found["neck"] = EllipticRange(tuple(axes))
    return found


def shoulder_twist(side: str) -> TwistRange:
    """Range of the inward rotation of an upper arm in the thorax: linear in the height of the arm's direction."""
    outward = 1.0 if side == "left" else -1.0
    # Degrees from the sagittal plane, outwards: where the arm points, level, in the middle of its directions.
    center = swing(90.0, 45.0, outward)
    heights, twists = [], []
    for elevation, inward in INTERNAL_ROTATION:
        turned = center.T @ swing(elevation, 90.0, outward)
        heights.append(-math.cos(math.radians(elevation)))
        frontal = math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])
        twists.append(math.radians(inward) - outward * frontal)
    slope = (twists[1] - twists[0]) / (heights[1] - heights[0])
    # The arm points along -z of its frame, so the height of its direction is minus that of its z axis.
    return TwistRange(
        "thorax", f"{side}_upper_arm", center, -outward, twists[0] - slope * heights[0], np.array([0.0, 0.0, -slope])
    )


def swing(elevation: float, plane: float, outward: float) -> Array:
    """Rotation (3, 3) of a hanging arm raised in a plane, degrees from ahead outwards; `outward`: 1 left, -1 right."""
    angle, turn = math.radians(elevation), math.radians(plane)
    # From -z towards (cos, +-sin, 0): about the level axis that is square to both.
    cross = pin.skew(np.array([outward * math.sin(turn), -math.cos(turn), 0.0]))
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)

"""Ranges of motion that more than one joint angle decides: reach cones, muscles over two joints, twists, the neck.

Limits of single joints allow what no person can do: to bend down with straight knees, to raise the arms with the
crease of the elbow outward, to flex, bend and turn the neck by all of its range at once. `figures/data` names the
sources of the numbers. Right limbs are given; left ones are their mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from math import atan2, inf, sqrt
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
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

LARGEST_ELLIPSE = 3  # most angles that share one range

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


PARALLEL = 1e-12  # shorter than this a projection onto the plane of an edge has no direction
SHORTEST = 1e-9  # a vector shorter than this has no direction
TOUCHING = 1e-9  # rad: a direction nearer to an edge than this is on it


class ReachCone:
    """The allowed directions of a limb: those inside a polygon on the sphere.

    Wilhelms & Van Gelder, Fast and Easy Reach-Cone Joint Limits, Journal of Graphics Tools 6(2), 2001. The polygon is
    star-shaped about a visible point V: the planes through V and each vertex P_i cut the sphere into wedges, and
    exactly one wedge contains a direction L: ``S_i . L >= 0 > S_{i+1} . L`` with ``S_i = V x P_i``. L is inside iff
    ``B_i . L >= 0`` with the boundary normal ``B_i = P_i x P_{i+1}``. The polygon may be concave and larger than a
    hemisphere.

    Attributes:
        vertices: (k, 3) unit corners, counter-clockwise seen from outside the sphere.
        visible: (3,) unit direction inside, from which every edge is seen.
        boundaries: (k, 3) boundary normals of the edges.
        planes: (5 k, 3) of the k edges, in this order: their boundary normals, the normals at their first and at their
            last corner, between which a direction is beside the edge, their first corners, and the normals S.

    Examples:
        >>> cone = human.cones["left_shoulder"].cone
    """

    def __init__(self, vertices: Any, visible: Any) -> None:
        """Check the polygon (three visible corners or more) and precompute its planes."""
        self.vertices, self.visible = _unit(vertices, "reach cone corner"), _unit(visible, "visible point")
        if self.vertices.ndim != 2 or len(self.vertices) < 3 or self.visible.shape != (3,):
            raise InputError(
                "a reach cone needs at least three corners, shape (k, 3), and one visible point, shape (3,)"
            )
        following = np.roll(self.vertices, -1, axis=0)
        normals = np.cross(self.vertices, following)
        if (normals @ self.visible < 0.0).all():
            self.vertices = self.vertices[::-1].copy()
            following = np.roll(self.vertices, -1, axis=0)
            normals = np.cross(self.vertices, following)
        lengths = np.linalg.norm(normals, axis=1)
        if lengths.min() < 1e-9 or (normals @ self.visible <= 0.0).any():
            raise InputError(
                "every edge of a reach cone must be seen from its visible point; move that point or the corners"
            )
        self.boundaries: Array = normals / lengths[:, None]
        across = (np.cross(self.boundaries, self.vertices), np.cross(following, self.boundaries))
        sides = np.cross(self.visible, self.vertices)
        self.planes: Array = np.vstack([self.boundaries, *across, self.vertices, sides])

    def __repr__(self) -> str:
        return f"ReachCone({len(self.vertices)} corners)"

    def contains(self, direction: Any) -> bool:
        """Whether a direction (3,) is inside, on the edge included."""
        return self.signed_angle(direction)[0] >= 0.0

    def signed_angle(self, direction: Any) -> tuple[float, Array]:
        """Angle of a direction (3,) to the nearest edge, radians, positive inside, and its gradient (3,), a tangent."""
        direction = _unit(direction, "direction")
        if direction.shape != (3,):
            raise InputError(f"a direction has shape {direction.shape}; give (3,)")
        height, before, after, corner, side = (self.planes @ direction).reshape(5, -1).tolist()
        edge, following, nearness, crossed = 0, 0, -inf, 0
        last = len(height) - 1
        for k in range(last, -1, -1):  # downwards: of edges that are equally near the first counts
            beyond = k + 1 if k < last else 0
            if before[k] >= 0.0 and after[k] >= 0.0:
                near = sqrt(max(1.0 - height[k] * height[k], 0.0))
            else:
                near = max(corner[k], corner[beyond])
            if near >= nearness:
                edge, following, nearness = k, beyond, near
            if side[k] >= 0.0 and side[beyond] < 0.0:
                crossed = k
        if before[edge] >= 0.0 and after[edge] >= 0.0 and nearness > PARALLEL:
            nearest = direction - height[edge] * self.boundaries[edge]
            nearest /= sqrt(nearest @ nearest)
        else:
            nearest = self.vertices[following if corner[following] > corner[edge] else edge]
        sign = 1.0 if height[crossed] >= 0.0 else -1.0
        cosine = float(direction @ nearest)
        away = cosine * direction - nearest
        sine = sqrt(away @ away)
        if sine > TOUCHING:
            return sign * atan2(sine, cosine), (sign / sine) * away
        inward = self.boundaries[edge] - height[edge] * direction  # on the edge itself
        return sign * atan2(sine, cosine), inward / sqrt(inward @ inward)

    def mirrored(self) -> ReachCone:
        """Return the cone of the other side of the body: y negated."""
        flip = np.array([1.0, -1.0, 1.0])
        return ReachCone(self.vertices[::-1] * flip, self.visible * flip)


def _unit(vectors: Any, what: str) -> Array:
    vectors = np.asarray(vectors, dtype=float)
    if vectors.shape == (3,):
        length = sqrt(vectors @ vectors)  # constraints ask for one direction at a time
        if SHORTEST <= length < inf:
            return np.asarray(vectors / length)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.isfinite(lengths).all() or (lengths < SHORTEST).any():
        raise InputError(f"a {what} is zero or not finite; give directions other than zero")
    return np.asarray(vectors / lengths)

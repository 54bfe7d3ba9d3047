"""The named parts of a figure, in addition to Pinocchio's model and geometry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, brief
from wholebody.figures.anthropometry import Person
from wholebody.figures.body_spec import Solid
from wholebody.figures.motion_ranges import MotionRange, ReachCone

ROUNDED = 1e-3  # rad, m: files round the values of postures, such as 1.5707, and the limits that they are at
ROOT_JOINT = "root_joint"
"""Name of a free root in the model; that of a joined figure follows the figure's name: "anna/root_joint"."""


class Chain(NamedTuple):
    """Joints from the root outwards, and the frame at the end.

    Examples:
        >>> human.chains["right_arm"].tip
        'right_index_tip'
    """

    joints: tuple[str, ...]
    tip: str

    def __repr__(self) -> str:
        return brief(self)


class JointCone(NamedTuple):
    """Reach cone of a limb.

    Attributes:
        cone: allowed directions of the limb.
        reference: frame to which the cone is fixed.
        limb: frame that carries the limb.
        axis: (3,) unit direction of the limb in its own frame.

    Examples:
        >>> human.cones["left_shoulder"].axis.shape
        (3,)
    """

    cone: ReachCone
    reference: str
    limb: str
    axis: Array

    def __repr__(self) -> str:
        return brief(self)


class ExcludedPair(NamedTuple):
    """Two pieces that are never tested, with the reason."""

    a: str
    b: str
    reason: str


class Limits(NamedTuple):
    """Limits of the joints with one degree of freedom that have them.

    Attributes:
        idx_q: (n,) indices in the posture.
        idx_v: (n,) indices in the tangent vector.
        lower: (n,) radians or metres.
        upper: (n,)

    Examples:
        >>> bool((human.limits.lower <= human.limits.upper).all())
        True
    """

    idx_q: Indices
    idx_v: Indices
    lower: Array
    upper: Array

    def room(self, q: Array, nv: int) -> tuple[Array, Array]:
        """Least and greatest displacement (nv,) of a posture q (nq,) within the limits; infinite without one."""
        least, most = np.full(nv, -np.inf), np.full(nv, np.inf)
        least[self.idx_v], most[self.idx_v] = self.lower - q[self.idx_q], self.upper - q[self.idx_q]
        return least, most

    def __repr__(self) -> str:
        return brief(self)


class Place(NamedTuple):
    """Index of a frame of the model, of the joint that carries it, and its placement in that joint."""

    frame: int
    joint: int
    placement: pin.SE3


class Follower(NamedTuple):
    """A joint whose value is that of another times a slope plus an offset (mimic)."""

    joint: str  # name of the followed joint
    idx_q: int  # its index in the posture
    slope: float  # never zero
    offset: float  # radians or metres

    def value(self, q: Array) -> float:
        """Value of the joint at a posture."""
        return self.slope * float(q[self.idx_q]) + self.offset

    def leading(self, value: float) -> float:
        """Value of the followed joint at which this joint has a value."""
        return (value - self.offset) / self.slope


class Law(NamedTuple):
    """A joint's value is that of another, by its name or number, times a slope plus an offset."""

    leader: Any
    slope: float
    offset: float


def led(laws: Mapping[Any, Law], joint: Any) -> Law:
    """A joint's value by the joint that leads it and follows none; by itself where it follows none."""
    found = Law(joint, 1.0, 0.0)
    while found.leader in laws:
        above = laws[found.leader]
        found = Law(above.leader, found.slope * above.slope, found.offset + found.slope * above.offset)
    return found


Articulated: TypeAlias = Any
"""A `Figure`, for the functions that make its parts: the module of figures imports this one."""


class Member(NamedTuple):
    """A figure among those that were joined."""

    figure: Articulated  # as it is alone
    # where the world of that figure is in the world: it places a fixed root, and the postures of a free one
    at: pin.SE3


class Mount(NamedTuple):
    """What a figure was mounted from; see `Figure.mounted`."""

    base: Articulated
    other: Articulated
    on: str
    name: str
    at: pin.SE3


class Description(NamedTuple):
    """The named parts of a figure, in addition to its model and geometry."""

    groups: Mapping[str, tuple[str, ...]]  # group to joints, without the root
    chains: Mapping[str, Chain]  # limbs, from the root outwards
    frames: tuple[str, ...]  # names of frames for goals
    segments: tuple[str, ...]  # links with mass or geometry
    postures: Mapping[str, Callable[[Articulated], Array]]  # name to a function that computes the posture of a figure
    cones: Mapping[str, JointCone] = MappingProxyType({})  # reach cones of ball joints
    # segment to the group whose parts are never tested against each other; may be empty
    collision_groups: Mapping[str, str] = MappingProxyType({})
    # joint to weight of its effort; joints that are not named have 1
    effort: Mapping[str, float] = MappingProxyType({})
    excluded: tuple[ExcludedPair, ...] = ()  # pairs of pieces that are not tested, with the reason
    # ranges of motion that more than one joint angle decides; a problem takes them by default
    ranges: Mapping[str, MotionRange] = MappingProxyType({})
    # weight of the position [rad^2/m^2] and of the rotation of each free root in the effort
    root_effort: tuple[float, ...] = (0.0, 0.0)
    # sentences on what had to be changed about the geometry of a file, or about stated dimensions
    notes: tuple[str, ...] = ()
    # sex, stature and mass of the figure or of the hand's owner; None for a figure of a file
    person: Person | None = None
    members: Mapping[str, Member] = MappingProxyType({})  # figures that were joined, by name; empty for one figure
    # what the names of each figure's parts begin with, such as "anna/"; "" for one figure
    prefixes: tuple[str, ...] = ("",)
    # makes the pieces that meet things in the world, on frames of the model, for a figure whose own are too coarse for
    # it; None if its own do
    outer: Callable[[], tuple[Solid, ...]] | None = None


def copied(figure: Articulated, q: Array) -> Array:
    """A posture (nq,) that a description has as it is."""
    return np.array(q)


class PieceName(NamedTuple):
    """What of a piece decides which others it is tested against."""

    name: str
    segment: str


Pairs: TypeAlias = tuple[tuple[tuple[str, str], ...], tuple[ExcludedPair, ...]]
"""Pairs that are tested, by name, and those that are not."""


def chosen_pairs(pieces: Iterable[PieceName], reason: Callable[[PieceName, PieceName], str | None]) -> Pairs:
    """The pairs of pieces that are tested, and those that are not, for which there is a reason."""
    judged = [(a.name, b.name, reason(a, b)) for a, b in combinations(pieces, 2)]
    tested = tuple((a, b) for a, b, why in judged if not why)
    return tested, tuple(ExcludedPair(a, b, why) for a, b, why in judged if why)


def is_root(joint: str) -> bool:
    """Whether the name of a joint of a model is that of a free root."""
    return joint.rpartition("/")[2] == ROOT_JOINT


def limits_of(model: pin.Model) -> Limits:
    """Return the limits of the joints of a model that have one degree of freedom and limits."""
    rows = []
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            if np.isfinite(low) or np.isfinite(high):
                rows.append((joint.idx_q, joint.idx_v, low, high))
    columns = np.array(rows).reshape(-1, 4).T
    return Limits(columns[0].astype(np.intp), columns[1].astype(np.intp), columns[2].copy(), columns[3].copy())


def zero_within_limits(model: pin.Model) -> Array:
    """The neutral posture (nq,), with joints whose limits exclude zero at the nearest limit."""
    limits, q = limits_of(model), np.array(pin.neutral(model))
    q[limits.idx_q] = np.clip(q[limits.idx_q], limits.lower, limits.upper)
    return q


def follows(joint: Any) -> bool:
    """Whether a joint of a model follows another (mimic)."""
    return bool(joint.shortname() == "JointModelMimic")


def followers_of(model: pin.Model) -> dict[str, Follower]:
    """Return the joints of a model that follow another one."""
    found: dict[str, Follower] = {}
    leader: dict[int, str] = {}
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        if follows(joint):
            law = joint.extract()
            place = int(joint.idx_q)
            found[name] = Follower(leader[place], place, float(law.scaling), float(law.offset))
        else:
            leader[int(joint.idx_q)] = name
    return found

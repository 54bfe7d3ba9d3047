"""Contact terms of a plan as arrays: things stand still throughout, so that one computation has all of their rows.

A part of a contact term says where a point p of one body is along an axis n of another, ``n . (p - c)``, or how an axis
a of one body is turned against one of another, ``a . n``, or how far two surfaces are apart. Ranges are bounds here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross
from wholebody.figures.state import State
from wholebody.geometry.proximity import PairTable, Proximity
from wholebody.scene.workspace import Workspace
from wholebody.tasks.base import ComputedTogether, Constraint
from wholebody.tasks.contact_parts import Facing, Gap, Level, Near, Over, Part, TermOfParts
from wholebody.tasks.faces import Face
from wholebody.tasks.grips import Looking
from wholebody.tasks.inputs import Place
from wholebody.tasks.surfaces import Surface

TOUCHING = 0.03  # m: of surfaces that are asked for alone at first; larger = more pairs
ENDLESS = 1e6  # m: beyond the distance of any two pieces


class Row(NamedTuple):
    """A row ``n . (p - c)`` or ``n . a``, and its bounds."""

    joint: int  # that carries p or a
    other: int  # that carries n and c
    place: Array  # (3,) p or a in the joint's axes
    axis: Array  # (3,) n in the other's axes
    origin: Array  # (3,) c in the other's axes
    point: bool  # whether it is of a point
    low: float
    high: float


class Apart(NamedTuple):
    """The distance of two surfaces, and its bounds."""

    first: Surface
    second: Surface
    low: float
    high: float


class ContactValues(ComputedTogether):
    """Rows of all contact terms of a plan: those of points and axes, then distances, then parts of other classes."""

    def __init__(self, terms: Sequence[TermOfParts], workspace: Workspace) -> None:
        """Take resolved terms; things are where the run sees them."""
        rows, gaps, self._others = list[Row](), list[Apart](), list[Part]()
        low, high = list[Array](), list[Array]()
        for term in terms:
            sides, begin = np.broadcast_arrays(term.lower, term.upper, term.angular)[:2], 0
            for part in term.parts:
                end = begin + len(part.in_radians)
                if (found := _rows_of(part, workspace.geometry)) is not None:
                    rows += [row for row in found if row.low > -np.inf or row.high < np.inf]
                elif (apart := _gap_of(part)) is not None:
                    gaps.append(apart)
                else:
                    self._others.append(part)
                    low.append(sides[0][begin:end])
                    high.append(sides[1][begin:end])
                begin = end
        ends = np.array([one[-2:] for one in (*rows, *gaps)], dtype=float).reshape(-1, 2)
        self._low: Array
        self._high: Array
        self._low, self._high = (
            np.concatenate([mine, *theirs]) for mine, theirs in zip(ends.T, (low, high), strict=True)
        )
        self._joint, self._other = np.array([row[:2] for row in rows], dtype=np.intp).reshape(-1, 2).T
        self._place, self._axis, self._origin = np.array([row[2:5] for row in rows]).reshape(-1, 3, 3).swapaxes(0, 1)
        self._point = np.array([row.point for row in rows], dtype=float).reshape(-1, 1)
        self._gaps = _Gaps(gaps, workspace) if gaps else None

    @property
    def lower(self) -> Array:
        """(m,) least values."""
        return self._low

    @property
    def upper(self) -> Array:
        """(m,) greatest values."""
        return self._high

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Array]:
        """Values (m,) and rows (m, nv)."""
        values, wrench = self._along(state)
        found, rows = [values], [state.rows(wrench, self._joint, self._other)]
        if self._gaps is not None:
            distance, wrench, joints = self._gaps.nearest(state)
            found.append(distance)
            rows.append(state.rows(wrench, *joints))
        for part in self._others:
            mine, row = part.rows(state)
            found.append(mine)
            rows.append(row)
        return np.concatenate(found), np.concatenate(rows)

    def _along(self, state: State) -> tuple[Array, Array]:
        """Values (k,) and wrenches (k, 6) of points and axes."""
        joints = state.joints
        mine, its = joints[self._joint], joints[self._other]
        axis = np.einsum("kj,kji->ki", self._axis, its[:, :3])
        place = np.einsum("kj,kji->ki", self._place, mine[:, :3]) + self._point * mine[:, 3]
        origin = np.einsum("kj,kji->ki", self._origin, its[:, :3]) + self._point * its[:, 3]
        wrench = np.concatenate([self._point * axis, cross(place, axis)], axis=1)
        return np.einsum("ki,ki->k", axis, place - origin), wrench


class _Gaps:
    """Distances of pairs of surfaces."""

    def __init__(self, gaps: Sequence[Apart], workspace: Workspace) -> None:
        geometry = workspace.geometry.copy()
        geometry.removeAllCollisionPairs()
        pairs = dict[tuple[int, int], int]()
        # of each gap its pairs by number, and 1 where they are the same way, else -1
        self._slots = list[tuple[Indices, Array]]()
        for gap in gaps:
            numbers, signs = list[int](), list[float]()
            for one in gap.first.pieces:
                for other in gap.second.pieces:
                    key = min(one, other), max(one, other)
                    if key not in pairs:
                        pairs[key] = len(pairs)
                        geometry.addCollisionPair(pin.CollisionPair(*key))
                    numbers.append(pairs[key])
                    signs.append(1.0 if one < other else -1.0)
            self._slots.append((np.array(numbers, dtype=np.intp), np.array(signs)))
        self._proximity = Proximity(PairTable(workspace.model, geometry, swept=workspace.table.swept))
        self._joint = workspace.table.joint
        self._apart, self._row = np.empty(len(pairs)), np.empty(len(pairs), dtype=np.intp)

    def nearest(self, state: State) -> tuple[Array, Array, tuple[Indices, Indices]]:
        """Distances (g,), wrenches (g, 6), and the joints (g,) that they are on, and against."""
        count = len(self._slots)
        distance, wrench, joints = np.empty(count), np.empty((count, 6)), np.empty((2, count), dtype=np.intp)
        near, apart, row = self._proximity.query_views(state.data, TOUCHING), self._apart, self._row
        apart[:] = np.inf
        apart[near.number], row[near.number] = near.distance, np.arange(len(near.number))
        for number, (pairs, signs) in enumerate(self._slots):
            least = int(apart[pairs].argmin())
            if apart[pairs[least]] == np.inf:
                near = self._proximity.query_views(state.data, ENDLESS)
                apart[near.number], row[near.number] = near.distance, np.arange(len(near.number))
                least = int(apart[pairs].argmin())
            at, sign = row[pairs[least]], signs[least]
            first, second = near.pair[at] if sign > 0.0 else near.pair[at][::-1]
            distance[number], wrench[number, :3] = near.distance[at], sign * near.normal[at]
            wrench[number, 3:] = cross(0.5 * (near.point_a[at] + near.point_b[at]), wrench[number, :3])
            joints[:, number] = self._joint[second], self._joint[first]
        return distance, wrench, (joints[0], joints[1])


def joined_contacts(terms: Sequence[Constraint], workspace: Workspace) -> tuple[Constraint, ...]:
    """The constraints of a plan, with one in place of all contact terms."""
    contacts = [term for term in terms if isinstance(term, TermOfParts)]
    if not contacts:
        return tuple(terms)
    return *(term for term in terms if not isinstance(term, TermOfParts)), ContactValues(contacts, workspace)


def _rows_of(part: Any, geometry: pin.GeometryModel) -> list[Row] | None:
    """Rows of a part; None for one of another class, and where the face is not at the placement of a scene's piece."""
    if type(part) is Looking:
        ends = (-np.sin(part.most), np.sin(part.most)) if part.level else (np.cos(part.most), np.inf)
        return [_turned(part.place, part.axis, 0, part.direction, *map(float, ends))]
    if type(part) not in (Facing, Level, Over) or not isinstance(part.face, Face):
        return None
    on = part.face.surface
    if not on.owners or any(number == 0 for number, _ in on.flesh):  # a point, only drawn, or flesh, which spreads
        return None
    at = geometry.geometryObjects[on.pieces[0]].placement
    axes, joint = part.face.axes @ at.rotation.T, part.face.joint
    if isinstance(part, Over):
        place, middle = part.place.placement.act(part.offset), at.act(part.face.center)
        sides = zip(axes, part.low.tolist(), part.high.tolist(), strict=False)
        return [Row(part.place.joint, joint, place, axis, middle, True, low, high) for axis, low, high in sides]
    if isinstance(part, Level):
        return [_turned(part.place, part.axis, joint, axes[2], 0.0, 0.0)]
    return [_turned(part.place, axis, joint, part.direction @ axes, 0.0, 0.0) for axis in part.basis[:2]]


def _turned(place: Place, axis: Array, other: int, direction: Array, low: float, high: float) -> Row:
    """The row of an axis (3,) of a frame against a direction (3,) of another body."""
    return Row(place.joint, other, place.placement.rotation @ axis, direction, np.zeros(3), False, low, high)


def _gap_of(part: Any) -> Apart | None:
    """The distance that a part asks for; None for one of another class, or of a point."""
    # what is only drawn, and has no owners, is in no geometry model of a scene, nor is a point
    if type(part) not in (Gap, Near) or not (part.first.owners and part.second.owners):
        return None
    low, high = (-np.inf, part.most) if isinstance(part, Near) else (0.0, 0.0)
    return Apart(part.first, part.second, low, high)

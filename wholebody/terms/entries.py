"""Built-in goals and constraints as rows of tables: what `plan` puts together and `kernel` evaluates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.tasks.base import Constraint, Goal
from wholebody.tasks.frame import PlacementResidual
from wholebody.tasks.inputs import WORLD
from wholebody.tasks.range_of_motion import ConeRow, Coordinate, CoupledRow, EllipticRow, RangeConstraint

RESIDUAL, PLANE, AXIS, MASS_CENTER, COORDINATE, TURN, ROOT, CONE, COUPLED, ELLIPSE, TWIST = range(11)
"""The tables of goals and constraints, by what a row of them stands for."""

DISTANCE, DISCOMFORT, HEIGHT, BOX, LIMIT, BODY, CURVATURE, COLUMN = range(11, 19)
ROOT_DISTANCE, ELEVATION, LUMBAR, BALL, HANG, EDGE = range(19, 25)
"""The other tables of a plan: of measures, of bounds, of the model, and of the edges of reach cones."""

WIDTHS = {
    RESIDUAL: (36, 6),  # place in the joint (12), base in its joint (12), target (3), rotation back from it (9)
    PLANE: (7, 2),  # origin in the joint (3), normal (3), height
    AXIS: (24, 3),  # place in the joint (12), basis (9), target (3)
    MASS_CENTER: (4, 3),  # direction (3), offset
    COORDINATE: (1, 3),  # target
    TURN: (2, 3),  # cosine and sine of the target
    ROOT: (12, 3),  # target
    CONE: (12, 5),  # axis of the limb in its joint (3), rotation of the reference in its joint (9)
    COUPLED: (3, 5),  # factors of two coordinates, bound
    ELLIPSE: (10, 13),  # offsets (3), lower limits (3), upper limits (3), size
    TWIST: (23, 3),  # limb in its joint (9), center in the joint of the reference (9), slope (3), bound, sign
}
"""Floats and integers of a goal or constraint in its table. The first integer is its first row, then:

RESIDUAL: joint, joint of the base, whether the place and the rotation count, whether there is a base other than the
world; PLANE: joint; AXIS: joint, whether the target is a place; MASS_CENTER: first joint that counts, and the one after
the last; COORDINATE, TURN, ROOT: place in the posture and in the tangent; CONE: joint, joint of the reference, how many
edges, the first of them; COUPLED, ELLIPSE: place in the posture and in the tangent of each coordinate, -1 for none, two
of them for each angle of an ellipse; TWIST: joint, joint of the reference.
"""

Integers: TypeAlias = NDArray[np.int64]
Row: TypeAlias = tuple[tuple[int, ...], Array]  # integers and floats of a row of a table

_NO_EDGES: Array = np.zeros((0, 15))


class Entry(NamedTuple):
    """A row of a table of terms: its table, integers and floats, `rows` of the Jacobian, `edges` (k, 15) of a cone."""

    table: int
    integers: tuple[int, ...]
    floats: Array
    rows: int
    edges: Array = _NO_EDGES


def entries_of(term: Goal | Constraint, model: pin.Model) -> list[Entry] | None:
    """The entries of a goal or constraint, in the order of its rows; None for one of another class."""
    write = _WRITERS.get(type(term))
    return None if write is None else write(term, model)


def only_moved(goal: Goal, before: Goal) -> bool:
    """Whether two resolved goals of a figure differ in their targets (3,) alone, floats 24 to 26 of `RESIDUAL`."""
    if not (type(goal) is tasks.Point is type(before)):
        return False
    return goal.place[:2] == before.place[:2] and goal.offset is before.offset is tasks.Point.offset


def placement_floats(place: Any) -> Array:
    """The columns of the rotation, then the translation."""
    floats = np.empty((4, 3))
    floats[:3], floats[3] = place.rotation.T, place.translation
    return floats.ravel()


def _residual(residual: PlacementResidual) -> list[Entry]:
    place, target, base, position, orientation = residual
    based, floats = base.frame != WORLD.frame, np.zeros((12, 3))
    floats[:4] = place.placement.homogeneous.T[:, :3]
    if based:
        floats[4:8] = base.placement.homogeneous.T[:, :3]
    floats[8], floats[9:] = target.translation, target.rotation
    integers = place.joint, base.joint, int(position), int(orientation), int(based)
    return [Entry(RESIDUAL, integers, floats.reshape(36), 3 * (position + orientation))]


def _point(term: tasks.Point, model: pin.Model) -> list[Entry]:
    _, joint, frame = term.place
    floats = np.zeros((12, 3))
    floats[:4], floats[8] = frame.homogeneous.T[:, :3], term.resolved_target
    if term.offset is not tasks.Point.offset:  # the default is none
        floats[3] = frame.act(term.resolved_offset)
    return [Entry(RESIDUAL, (joint, 0, 1, 0, 0), floats.reshape(36), 3)]


def _plane(term: tasks.Plane, model: pin.Model) -> list[Entry]:
    origin = term.place.placement.translation
    return [Entry(PLANE, (term.place.joint,), np.array([*origin, *term.resolved_normal, term.height]), 1)]


def _axis(term: tasks.Axis, model: pin.Model) -> list[Entry]:
    floats = np.concatenate([placement_floats(term.place.placement), term.basis.ravel(), term.resolved_target])
    return [Entry(AXIS, (term.place.joint, int(term.toward is not None)), floats, 2)]


def _mass_center(term: tasks.CenterOfMass, model: pin.Model) -> list[Entry]:
    axes = np.eye(3)
    return [
        Entry(MASS_CENTER, _ends(term.joints, model), np.array([*axes[k], target]), 1)
        for k, target in enumerate(term.resolved_target.tolist())
    ]


def _ends(joints: range | None, model: pin.Model) -> tuple[int, int]:
    return (1, model.njoints) if joints is None else (joints.start, joints.stop)


def _balance(term: tasks.Balance, model: pin.Model) -> list[Entry]:
    return [
        Entry(MASS_CENTER, _ends(term.joints, model), np.array([x, y, 0.0, offset]), 1)
        for (x, y), offset in zip(term.normals.tolist(), term.offsets.tolist(), strict=True)
    ]


def _posture(term: tasks.Posture, model: pin.Model) -> list[Entry] | None:
    entries: list[Entry] = []
    dofs, target = term.dofs.tolist(), term.resolved_target
    for joint in list(model.joints)[1:]:
        q, v = int(joint.idx_q), int(joint.idx_v)
        mine = [dof for dof in dofs if v <= dof < v + joint.nv]
        if not mine:
            continue
        if joint.nq == joint.nv:
            shifts = [dof - v for dof in mine]
            entries += [Entry(COORDINATE, (q + k, v + k), target[q + k : q + k + 1], 1) for k in shifts]
        elif (joint.nq, joint.nv) == (2, 1):
            entries.append(Entry(TURN, (q, v), target[q : q + 2], 1))
        elif joint.nq == 7 and len(mine) == 6:
            entries.append(Entry(ROOT, (q, v), placement_floats(pin.XYZQUATToSE3(target[q : q + 7])), 6))
        else:
            return None
    in_order = [entry.integers[1] + k for entry in entries for k in range(entry.rows)] == dofs
    return entries if in_order else None


def _ranges(term: RangeConstraint, model: pin.Model) -> list[Entry] | None:
    entries = []
    for row in term.rows:
        if isinstance(row, CoupledRow):
            if len(row.coordinates) > 2:
                return None
            factors = [part.factor for part in row.coordinates] + [0.0] * (2 - len(row.coordinates))
            entries.append(Entry(COUPLED, _places(row.coordinates, 2), np.array([*factors, row.bound]), 1))
        elif isinstance(row, EllipticRow):
            if len(row.axes) > 3 or any(len(axis) > 2 for axis in row.axes):
                return None
            missing = 3 - len(row.axes)
            places = sum((_places(axis, 2) for axis in (*row.axes, *[()] * missing)), ())
            limits = np.pad(np.vstack([row.offset, row.limits]), ((0, 0), (0, missing)))
            limits[1:, len(row.axes) :] = np.array([[-1.0], [1.0]])
            entries.append(Entry(ELLIPSE, places, np.array([*limits.ravel(), row.size]), 1))
        elif isinstance(row, ConeRow):
            axis, reference = row.limb.placement.rotation @ row.axis, row.reference.placement.rotation
            edges = np.hstack(row.cone.planes.reshape(5, -1, 3))
            floats = np.concatenate([axis, reference.T.ravel()])
            entries.append(Entry(CONE, (row.limb.joint, row.reference.joint), floats, 1, edges))
        else:
            limb = row.limb.placement.rotation
            center = row.reference.placement.rotation @ row.part.center
            slope = row.part.slope @ row.part.center
            floats = np.concatenate([limb.T.ravel(), center.T.ravel(), slope, [row.part.bound, row.part.sign]])
            entries.append(Entry(TWIST, (row.limb.joint, row.reference.joint), floats, 1))
    return entries


def _places(coordinates: Sequence[Coordinate], count: int) -> tuple[int, ...]:
    found = [place for part in coordinates for place in (part.idx_q, part.idx_v)]
    return (*found, *[-1] * (2 * count - len(found)))


_WRITERS: dict[type, Callable[[Any, pin.Model], list[Entry] | None]] = {
    tasks.Point: _point,
    tasks.Frame: lambda term, _: _residual(term.residual),
    tasks.Orientation: lambda term, _: _residual(term.residual),
    tasks.Relative: lambda term, _: _residual(term.residual),
    tasks.Hold: lambda term, _: _residual(term.residual),
    tasks.Plane: _plane,
    tasks.Axis: _axis,
    tasks.CenterOfMass: _mass_center,
    tasks.Balance: _balance,
    tasks.Posture: _posture,
    tasks.ReachCones: _ranges,
    tasks.RangeOfMotion: _ranges,
}

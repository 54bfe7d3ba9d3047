"""Built-in goals, constraints, bounds and measures as arrays, so that one compiled pass evaluates all of them.

A plan is made for a problem and never changed. Terms of other classes are evaluated by their own methods: a plan only
says in which rows they stand. `term_kernel` evaluates a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import tasks
from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.figures.state import State, Wrench, extended_columns
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.distance import LEAST_CURVATURE
from wholebody.tasks.inputs import WORLD, Place
from wholebody.tasks.residuals import PlacementResidual

RESIDUAL, PLANE, AXIS, MASS_CENTER, COORDINATE, TURN, ROOT, CONE = range(8)
"""The tables of goals and constraints, by what a row of them stands for."""

DISTANCE, DISCOMFORT, HEIGHT, BOX, LIMIT, BODY, CURVATURE, COLUMN, EDGE = range(8, 17)
"""The other tables of a plan: of measures, of bounds, of the model, and of the edges of reach cones."""

WIDTHS = {
    RESIDUAL: (36, 6),  # place in the joint (12), base in its joint (12), target (3), rotation back from it (9)
    PLANE: (7, 2),  # origin in the joint (3), normal (3), height
    AXIS: (24, 3),  # place in the joint (12), basis (9), target (3)
    MASS_CENTER: (4, 1),  # direction (3), offset
    COORDINATE: (1, 3),  # target
    TURN: (2, 3),  # cosine and sine of the target
    ROOT: (12, 3),  # target
    CONE: (12, 5),  # axis of the limb in its joint (3), rotation of the reference in its joint (9)
}
"""Floats and integers of a goal or constraint in its table. The first integer is its first row, then:

RESIDUAL: joint, joint of the base, whether the place and the rotation count, whether there is a base other than the
world; PLANE: joint; AXIS: joint, whether the target is a place; COORDINATE, TURN, ROOT: place in the posture and in the
tangent; CONE: joint, joint of the reference, how many edges, the first of them.
"""

Integers: TypeAlias = NDArray[np.int64]
Row: TypeAlias = tuple[tuple[int, ...], Array]
"""Integers and floats of a row of a table."""

_NO_EDGES: Array = np.zeros((0, 15))


class Entry(NamedTuple):
    """One row of a table of goals or constraints.

    Attributes:
        table: which.
        integers: its integers without the first.
        floats: its floats.
        rows: how many rows of the Jacobian it makes.
        edges: (k, 15) planes of the edges of a reach cone, see `ReachCone.planes`; each edge is a row.
    """

    table: int
    integers: tuple[int, ...]
    floats: Array
    rows: int
    edges: Array = _NO_EDGES


class OtherTerm(NamedTuple):
    """A goal or constraint that is evaluated by its own methods.

    Attributes:
        term: the goal or constraint.
        value: its error or value at a state.
        row: its first row.
        rows: how many rows it has.
    """

    term: Goal | Constraint
    value: Callable[[State], Array]
    row: int
    rows: int


class TermPlan(NamedTuple):
    """The terms of a problem as arrays.

    Attributes:
        floats: all tables of floats, one after the other.
        integers: all tables of integers.
        layout: (tables, 6) where each table of floats begins, its rows and columns, and the same of integers.
        support: (njoints, n) 1 where a column of the joint Jacobian moves a joint.
        goal_rows: rows of all goals.
        value_rows: rows of all constraints.
        others: goals and constraints of other classes.
        other_bounds: bounds of other classes.
        other_measures: measures of other classes.
        goals: entries of each goal; None for one of another class.
    """

    floats: Array
    integers: Integers
    layout: Integers
    support: NDArray[np.int8]
    goal_rows: int
    value_rows: int
    others: tuple[OtherTerm, ...]
    other_bounds: tuple[Bound, ...]
    other_measures: tuple[Measure, ...]
    goals: tuple[list[Entry] | None, ...]

    def with_goals(self, goals: Sequence[Goal], model: pin.Model) -> TermPlan | None:
        """The plan with other goals, or None where they are not of the same classes for the same frames.

        Args:
            goals: resolved goals.
            model: Pinocchio's model.
        """
        if len(goals) != len(self.goals):
            return None
        floats = self.floats.copy()
        filled = dict.fromkeys(WIDTHS, 0)
        found: list[list[Entry] | None] = []
        others = list(self.others)
        number = 0
        for goal, known in zip(goals, self.goals, strict=True):
            entries = entries_of(goal, model)
            found.append(entries)
            if entries is None or known is None:
                if entries is not known or type(goal) is not type(others[number].term):
                    return None
                others[number] = others[number]._replace(term=goal, value=goal.error)
                number += 1
                continue
            if [entry[:2] for entry in entries] != [entry[:2] for entry in known]:
                return None
            for entry in entries:
                start, _, columns = self.layout[entry.table, :3].tolist()
                place = start + columns * filled[entry.table]
                floats[place : place + columns] = entry.floats
                filled[entry.table] += 1
        return self._replace(floats=floats, goals=tuple(found), others=tuple(others))


def make_plan(
    limits: Any,
    goals: Sequence[Goal],
    constraints: Sequence[Constraint],
    bounds: Sequence[Bound],
    measures: Sequence[Measure],
    dt: float | None,
    state: State,
) -> TermPlan:
    """The plan of resolved terms.

    Args:
        limits: of the figure's joints; see `Figure.limits`.
        goals: resolved goals.
        constraints: resolved constraints.
        bounds: resolved bounds.
        measures: resolved measures.
        dt: seconds of a step, for bounds that need them; None for a whole solve.
        state: tells how many rows terms of other classes have; stays where it is.
    """
    model = state.model
    parts: dict[int, list[Row]] = {table: [] for table in range(EDGE + 1)}
    others: list[OtherTerm] = []
    row = 0

    def add(term: Goal | Constraint, value: Callable[[State], Array]) -> list[Entry] | None:
        nonlocal row
        entries = entries_of(term, model)
        if entries is None:
            others.append(OtherTerm(term, value, row, int(np.size(value(state)))))
            row += others[-1].rows
            return None
        for entry in entries:
            numbers = (row, *entry.integers)
            if entry.table == CONE:
                numbers += (len(entry.edges), len(parts[EDGE]))
                parts[EDGE] += [((0,), edge) for edge in entry.edges]
            parts[entry.table].append((numbers, entry.floats))
            row += entry.rows
        return entries

    goal_entries = tuple(add(goal, goal.error) for goal in goals)
    goal_rows = row
    for constraint in constraints:
        add(constraint, constraint.value)
    parts[BOX], other_bounds = _boxes(bounds, state, dt)
    other_measures, curvature = _measures(measures, model, parts)
    parts[CURVATURE] = [((0,), curvature)]
    parts[LIMIT] = [
        ((int(q), int(v)), np.array([low, high]))
        for q, v, low, high in zip(limits.idx_q, limits.idx_v, limits.lower, limits.upper, strict=True)
    ]
    parts[BODY] = [
        ((int(model.parents[joint]),), np.array([model.inertias[joint].mass, *model.inertias[joint].lever]))
        for joint in range(model.njoints)
    ]
    columns = extended_columns(model)
    places = np.arange(len(state.column_joint)) if columns is None else columns
    parts[COLUMN] = [
        ((int(place), int(joint)), np.zeros(0)) for place, joint in zip(places, state.column_joint, strict=True)
    ]
    floats, integers, layout = _packed(parts)
    return TermPlan(
        floats, integers, layout, state.support.astype(np.int8), goal_rows, row - goal_rows, tuple(others),
        other_bounds, other_measures, goal_entries,
    )  # fmt: skip


def _packed(parts: dict[int, list[Row]]) -> tuple[Array, Integers, Integers]:
    layout = np.zeros((len(parts), 6), dtype=np.int64)
    floats: list[Array] = [np.zeros(0)]
    integers: list[int] = []
    begun = 0
    for table in sorted(parts):
        rows = parts[table]
        wide = len(rows[0][1]) if rows else WIDTHS.get(table, (0, 0))[0]
        layout[table] = (begun, len(rows), wide, len(integers), len(rows), len(rows[0][0]) if rows else 0)
        begun += len(rows) * wide
        floats += [part for _, part in rows]
        integers += [number for numbers, _ in rows for number in numbers]
    return np.concatenate(floats), np.array(integers, dtype=np.int64), layout


def entries_of(term: Goal | Constraint, model: pin.Model) -> list[Entry] | None:
    """The entries of a goal or constraint, in the order of its rows; None for one of another class."""
    write = _WRITERS.get(type(term))
    return None if write is None else write(term, model)


def _placement(place: Any) -> Array:
    """The columns of the rotation, then the translation."""
    return np.concatenate([place.rotation.T.ravel(), place.translation])


def _in_joint(place: Place, model: pin.Model) -> pin.SE3:
    return model.frames[place.frame].placement


def _residual(residual: PlacementResidual, model: pin.Model) -> list[Entry]:
    based = residual.base.frame != WORLD.frame
    base = _in_joint(residual.base, model) if based else pin.SE3.Identity()
    floats = np.concatenate(
        [
            _placement(_in_joint(residual.place, model)), _placement(base), residual.target,
            residual.undo.rotation.T.ravel(),
        ]
    )  # fmt: skip
    integers = (residual.place.joint, residual.base.joint, residual.position, residual.orientation, based)
    rows = 3 * (residual.position + residual.orientation)
    return [Entry(RESIDUAL, tuple(map(int, integers)), floats, rows)]


def _point(term: tasks.Point, model: pin.Model) -> list[Entry]:
    frame = _in_joint(term.place, model)
    place = pin.SE3(frame.rotation, frame.act(term.resolved_offset))
    floats = np.concatenate([_placement(place), np.zeros(12), term.resolved_target, np.zeros(9)])
    return [Entry(RESIDUAL, (term.place.joint, 0, 1, 0, 0), floats, 3)]


def _plane(term: tasks.Plane, model: pin.Model) -> list[Entry]:
    origin = _in_joint(term.place, model).translation
    return [Entry(PLANE, (term.place.joint,), np.array([*origin, *term.resolved_normal, term.height]), 1)]


def _axis(term: tasks.Axis, model: pin.Model) -> list[Entry]:
    floats = np.concatenate([_placement(_in_joint(term.place, model)), term.basis.ravel(), term.resolved_target])
    return [Entry(AXIS, (term.place.joint, int(term.toward is not None)), floats, 2)]


def _mass_center(term: tasks.CenterOfMass, model: pin.Model) -> list[Entry]:
    axes = np.eye(3)
    return [
        Entry(MASS_CENTER, (), np.array([*axes[k], target]), 1)
        for k, target in enumerate(term.resolved_target.tolist())
    ]


def _balance(term: tasks.Balance, model: pin.Model) -> list[Entry]:
    return [
        Entry(MASS_CENTER, (), np.array([x, y, 0.0, offset]), 1)
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
            entries.append(Entry(ROOT, (q, v), _placement(pin.XYZQUATToSE3(target[q : q + 7])), 6))
        else:
            return None
    in_order = [entry.integers[1] + k for entry in entries for k in range(entry.rows)] == dofs
    return entries if in_order else None


def _cones(term: tasks.ReachCones, model: pin.Model) -> list[Entry]:
    entries = []
    for limb in term.limbs:
        axis = _in_joint(limb.limb, model).rotation @ limb.axis
        reference = _in_joint(limb.reference, model).rotation
        edges = np.hstack(limb.cone.planes.reshape(5, -1, 3))
        floats = np.concatenate([axis, reference.T.ravel()])
        entries.append(Entry(CONE, (limb.limb.joint, limb.reference.joint), floats, 1, edges))
    return entries


_WRITERS: dict[type, Callable[[Any, pin.Model], list[Entry] | None]] = {
    tasks.Point: _point,
    tasks.Frame: lambda term, model: _residual(term.residual, model),
    tasks.Orientation: lambda term, model: _residual(term.residual, model),
    tasks.Relative: lambda term, model: _residual(term.residual, model),
    tasks.Hold: lambda term, model: _residual(term.residual, model),
    tasks.Plane: _plane,
    tasks.Axis: _axis,
    tasks.CenterOfMass: _mass_center,
    tasks.Balance: _balance,
    tasks.Posture: _posture,
    tasks.ReachCones: _cones,
}


def coordinates(model: pin.Model) -> Integers:
    """(nv,) place in the posture of each degree of freedom that is a plain coordinate; -1 for the others."""
    places = np.full(model.nv, -1, dtype=np.int64)
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv:
            places[joint.idx_v : joint.idx_v + joint.nv] = np.arange(joint.idx_q, joint.idx_q + joint.nq)
    return places


def _boxes(bounds: Sequence[Bound], state: State, dt: float | None) -> tuple[list[Row], tuple[Bound, ...]]:
    """Bounds that are the same at every posture, as pairs of rows, and the others."""
    static = [bound for bound in bounds if type(bound) in (tasks.Freeze, tasks.StepLimit)]
    rows: list[Row] = [((0,), np.array(side, dtype=float)) for bound in static for side in bound.bounds(state, dt)]
    return rows, tuple(bound for bound in bounds if bound not in static)


def _measures(
    measures: Sequence[Measure], model: pin.Model, parts: dict[int, list[Row]]
) -> tuple[tuple[Measure, ...], Array]:
    """Write the tables of measures; the measures of other classes, and the curvature (nv,) that is always the same."""
    others: list[Measure] = []
    curvature = np.zeros(model.nv)
    places = coordinates(model)
    for term in measures:
        if (type(term) is tasks.Effort or type(term) is tasks.Displacement) and term.distance.straight:
            curvature += term.weight * term.distance.curvature
            for v in np.flatnonzero(term.distance.weights).tolist():
                q = int(places[v])
                floats = np.array([term.weight * term.distance.weights[v], term.distance.reference[q]])
                parts[DISTANCE].append(((q, v), floats))
        elif type(term) is tasks.Discomfort:
            curvature += term.weight * LEAST_CURVATURE
            joints = term.limited
            columns = np.column_stack([joints.neutral, joints.weights, joints.limits.T, joints.phase.T])
            for q, v, floats in zip(joints.idx_q.tolist(), joints.idx_v.tolist(), columns, strict=True):
                parts[DISCOMFORT].append(((q, v), np.array([term.weight, *floats])))
        elif type(term) is tasks.PotentialEnergy:
            curvature += term.weight * LEAST_CURVATURE
            masses = term.masses
            for joint, centre, weight, height in zip(
                masses.joints.tolist(), masses.centres, masses.weights, masses.heights, strict=True
            ):
                parts[HEIGHT].append(((joint,), np.array([*centre, term.weight * weight, height])))
        else:
            others.append(term)
    return tuple(others), curvature


def checked_rows(term: Goal | Constraint, value: Array, jacobian: Wrench | Array, expected: int) -> None:
    """Raise InputError where a term of one's own has not as many rows as values, or not as many as at the start."""
    rows = len(jacobian.rows) if isinstance(jacobian, Wrench) else len(jacobian)
    if rows != len(value):
        raise InputError(f"{type(term).__name__} has {len(value)} values and {rows} rows at a posture; give as many")
    if rows != expected:
        raise InputError(
            f"{type(term).__name__} has {rows} rows here, and had {expected} at the start; give each term one number "
            "of rows at all postures"
        )

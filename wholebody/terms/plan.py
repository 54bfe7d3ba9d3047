"""Built-in goals, constraints, bounds and measures as arrays, so that `kernel` evaluates all of them in one pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import tasks
from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import TermError
from wholebody.figures.description import Limits
from wholebody.figures.state import State, extended_columns, free_roots, root_freedoms
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.distance import LEAST_CURVATURE, SquaredDistance
from wholebody.tasks.rhythm import LUMBAR_RATE
from wholebody.terms import entries as kinds
from wholebody.terms.entries import Entry, Integers, Row, entries_of, only_moved, placement_floats


class Terms(NamedTuple):
    """The goals, constraints, bounds and measures of a problem."""

    goals: Sequence[Goal] = ()
    constraints: Sequence[Constraint] = ()
    bounds: Sequence[Bound] = ()
    measures: Sequence[Measure] = ()


class OtherTerm(NamedTuple):
    """A goal or constraint that is evaluated by its own methods: its error or value at a state, first row and rows."""

    term: Goal | Constraint
    value: Callable[[State], Array]
    row: int
    rows: int


class TermPlan(NamedTuple):
    """The terms of a problem as arrays."""

    floats: Array  # all tables of floats, one after the other
    integers: Integers  # all tables of integers
    layout: Integers  # (tables, 6) where each table of floats begins, its rows and columns, and the same of integers
    support: NDArray[np.int8]  # (njoints, n) 1 where a column of the joint Jacobian moves a joint
    goal_rows: int  # rows of all goals
    value_rows: int  # rows of all constraints
    others: tuple[OtherTerm, ...]  # goals and constraints of other classes
    other_bounds: tuple[Bound, ...]  # bounds of other classes
    other_measures: tuple[Measure, ...]  # measures of other classes
    goals: tuple[list[Entry] | None, ...]  # entries of each goal; None for one of another class
    constraints: tuple[list[Entry] | None, ...]  # the same of each constraint
    rows: tuple[int, ...]  # of each goal, then of each constraint
    seldom: bool  # whether there are terms of `seldom_kernel`

    @property
    def squares(self) -> int:
        """Number of squares that built-in measures are the sum of."""
        rows = ((kinds.ELEVATION, 1), (kinds.LUMBAR, 1), (kinds.BALL, 3), (kinds.HANG, 2))
        return sum(count * int(self.layout[table, 1]) for table, count in rows)

    def with_terms(
        self, goals: Sequence[Goal], model: pin.Model, constraints: Sequence[Constraint] | None = None
    ) -> TermPlan | None:
        """The plan with other resolved terms; None where they are not of the same classes for the same frames."""
        terms: list[Goal | Constraint] = [*goals, *(constraints or ())]
        old = self.goals if constraints is None else (*self.goals, *self.constraints)
        if len(goals) != len(self.goals) or len(terms) != len(old):
            return None
        again = self.copied()
        places = dict[int, int]()
        others = list(self.others)
        number = 0
        for term, known in zip(terms, old, strict=True):
            if known is None:
                if entries_of(term, model) is not None or type(term) is not type(others[number].term):
                    return None
                value = term.error if isinstance(term, Goal) else term.value
                others[number] = with_values(others[number], term=term, value=value)
                number += 1
            elif not again._put(term, model, known, places):
                return None
        return again._replace(others=tuple(others))

    def copied(self) -> TermPlan:
        """A plan into which goals may be put."""
        return self._replace(floats=self.floats.copy())

    def put(self, goals: Sequence[Goal], before: Sequence[Goal], model: pin.Model) -> bool:
        """Write resolved goals in the place of those before; False where `with_terms` has to look at them."""
        if len(goals) != len(before):
            return False
        places = dict[int, int]()
        for goal, old, known in zip(goals, before, self.goals, strict=True):
            if only_moved(goal, old):
                place = places.get(kinds.RESIDUAL, 0)  # the first table
                self.floats[place + 24 : place + 27] = goal.resolved_target  # type: ignore[attr-defined]
                places[kinds.RESIDUAL] = place + kinds.WIDTHS[kinds.RESIDUAL][0]
            elif known is None or not self._put(goal, model, known, places):
                return False
        return True

    def _put(self, term: Goal | Constraint, model: pin.Model, known: list[Entry], places: dict[int, int]) -> bool:
        """Write a term in the place of one with these entries; whether it has such. `places`: next row by table."""
        entries = entries_of(term, model)
        if entries is None or len(entries) != len(known):
            return False
        for entry, before in zip(entries, known, strict=True):
            table, integers, floats, _, edges = entry
            if table != before.table or integers != before.integers:
                return False
            if edges is not before.edges and not np.array_equal(edges, before.edges):
                return False
            place = places.get(table) or int(self.layout[table, 0])
            places[table] = end = place + len(floats)
            self.floats[place:end] = floats
        return True


def make_plan(limits: Limits, terms: Terms, dt: float | None, state: State) -> TermPlan:
    """The plan of resolved terms, for steps of `dt` seconds or None; the state tells rows of one's own terms."""
    model, (goals, constraints, bounds, measures) = state.model, terms
    parts: dict[int, list[Row]] = {table: [] for table in range(kinds.EDGE + 1)}
    others: list[OtherTerm] = []
    row, counts = 0, list[int]()

    def add(term: Goal | Constraint, value: Callable[[State], Array]) -> list[Entry] | None:
        nonlocal row
        entries = entries_of(term, model)
        if entries is None:
            others.append(OtherTerm(term, value, row, int(np.size(value(state)))))
            row += others[-1].rows
            counts.append(others[-1].rows)
            return None
        for entry in entries:
            numbers = (row, *entry.integers)
            if entry.table == kinds.CONE:
                numbers += (len(entry.edges), len(parts[kinds.EDGE]))
                parts[kinds.EDGE] += [((0,), edge) for edge in entry.edges]
            parts[entry.table].append((numbers, entry.floats))
            row += entry.rows
        counts.append(sum(entry.rows for entry in entries))
        return entries

    goal_entries = tuple(add(goal, goal.error) for goal in goals)
    goal_rows = row
    constraint_entries = tuple(add(constraint, constraint.value) for constraint in constraints)
    parts[kinds.BOX], other_bounds = _boxes(bounds, state, dt)
    other_measures, curvature = _measures(measures, model, parts)
    parts[kinds.CURVATURE] = [((0,), curvature)]
    # largest share of the distance to its limit that each freedom moves in a step
    braking = np.min([np.ones(model.nv), *(one.braking(dt) for one in bounds if type(one) is tasks.StepLimit)], axis=0)
    parts[kinds.LIMIT] = [
        ((int(q), int(v)), np.array([low, high, braking[v]]))
        for q, v, low, high in zip(limits.idx_q, limits.idx_v, limits.lower, limits.upper, strict=True)
    ]
    parts[kinds.BODY] = [
        ((parent, first, width), np.array([inertia.mass, *inertia.lever]))
        for parent, first, width, inertia in zip(
            model.parents.tolist(),
            model.idx_vExtendeds.tolist(),
            model.nvExtendeds.tolist(),
            model.inertias,
            strict=True,
        )
    ]
    columns = extended_columns(model)
    places = np.arange(len(state.column_joint)) if columns is None else columns
    parts[kinds.COLUMN] = [
        ((int(place), int(joint)), np.zeros(0)) for place, joint in zip(places, state.column_joint, strict=True)
    ]
    floats, integers, layout = _packed(parts)
    seldom = [kinds.PLANE, kinds.AXIS, kinds.MASS_CENTER, kinds.COORDINATE, kinds.TURN, kinds.ROOT]
    seldom += [kinds.BALL, kinds.HANG, kinds.HEIGHT]
    return TermPlan(
        floats, integers, layout, state.support.astype(np.int8), goal_rows, row - goal_rows, tuple(others),
        other_bounds, other_measures, goal_entries, constraint_entries, tuple(counts), bool(layout[seldom, 1].any()),
    )  # fmt: skip


def _packed(parts: dict[int, list[Row]]) -> tuple[Array, Integers, Integers]:
    layout = np.zeros((len(parts), 6), dtype=np.int64)
    floats: list[Array] = [np.zeros(0)]
    integers: list[int] = []
    begun = 0
    for table in sorted(parts):
        rows = parts[table]
        wide = len(rows[0][1]) if rows else kinds.WIDTHS.get(table, (0, 0))[0]
        layout[table] = (begun, len(rows), wide, len(integers), len(rows), len(rows[0][0]) if rows else 0)
        begun += len(rows) * wide
        floats += [part for _, part in rows]
        integers += [number for numbers, _ in rows for number in numbers]
    return np.concatenate(floats), np.array(integers, dtype=np.int64), layout


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
        distance = _distance(term)
        if distance is not None and _distances(distance, term.weight, model, places, parts):
            curvature += term.weight * distance.curvature
            for ball in term.balls if isinstance(term, tasks.RotationEffort) else ():
                numbers = np.concatenate([ball.axes.ravel(), ball.start.ravel(), term.weight * ball.weights])
                parts[kinds.BALL].append(((*ball.idx_q, *ball.idx_v), numbers))
        elif type(term) is tasks.Discomfort:
            curvature += term.weight * LEAST_CURVATURE
            joints = term.limited
            columns = np.column_stack([joints.neutral, joints.weights, joints.limits.T, joints.phase.T])
            for q, v, floats in zip(joints.idx_q.tolist(), joints.idx_v.tolist(), columns, strict=True):
                parts[kinds.DISCOMFORT].append(((q, v), np.array([term.weight, *floats])))
        elif type(term) is tasks.PotentialEnergy:
            curvature += term.weight * LEAST_CURVATURE
            masses = term.masses
            for joint, centre, weight, height in zip(
                masses.joints.tolist(), masses.centres, masses.weights, masses.heights, strict=True
            ):
                parts[kinds.HEIGHT].append(((joint,), np.array([*centre, term.weight * weight, height])))
        elif type(term) is tasks.Hang:
            curvature += term.weight * LEAST_CURVATURE
            for place, down in zip(term.places, term.down, strict=True):
                parts[kinds.HANG].append(((place.joint,), np.array([term.weight, *down])))
        elif type(term) is tasks.Rhythm:
            curvature += term.weight * LEAST_CURVATURE
            for part in (*term.girdles, *term.knees):
                numbers = np.array([term.weight * part.weight, part.most, part.rest, part.onset])
                parts[kinds.ELEVATION].append(((*part.idx_q, *part.idx_v), numbers))
            for spine in term.lumbar:
                share = np.array([term.weight * spine.weight, spine.most, LUMBAR_RATE, spine.rest])
                parts[kinds.LUMBAR].append(((*spine.idx_q, *spine.idx_v, *spine.root), share))
        else:
            others.append(term)
    return tuple(others), curvature


def _distance(term: Measure) -> SquaredDistance | None:
    """The part of a measure that is a squared distance; None for other classes, and for a subclass."""
    if type(term) is tasks.Effort or type(term) is tasks.Displacement:
        return term.distance
    return term.others if type(term) is tasks.RotationEffort else None


def _distances(
    distance: SquaredDistance, weight: float, model: pin.Model, places: Integers, parts: dict[int, list[Row]]
) -> bool:
    """Write the tables of a distance; false where a joint that counts is no free root and no coordinate."""
    weighed = np.flatnonzero(distance.weights).tolist()
    own = root_freedoms(model)
    if any(places[v] < 0 for v in weighed if not own[v]):
        return False
    for root in (model.joints[joint] for joint in free_roots(model)):
        q, v = int(root.idx_q), int(root.idx_v)
        if distance.weights[v : v + 6].any():
            target = placement_floats(pin.XYZQUATToSE3(distance.reference[q : q + 7]))
            floats = np.concatenate([target, weight * distance.weights[v : v + 6]])
            parts[kinds.ROOT_DISTANCE].append(((q, v), floats))
    for v in weighed:
        if not own[v]:
            q = int(places[v])
            parts[kinds.DISTANCE].append(((q, v), np.array([weight * distance.weights[v], distance.reference[q]])))
    return True


def checked_count(term: Goal | Constraint | Measure, rows: int, expected: int) -> None:
    """A TermError where a term of one's own has another number of rows than at the start."""
    if rows != expected:
        message = f"it has {rows} rows here, and had {expected} at the start; give each term one number of rows"
        raise TermError(term, type(term).__name__, f"{message} at all postures")

"""First-order optimality of a posture (Karush, Kuhn and Tucker), and its blockers: what has large multipliers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from wholebody.assessment.all_pairs import AllPairs, Label, NearPairs, all_pairs
from wholebody.base.arrays import Array, Mask
from wholebody.figures.figure import Figure
from wholebody.figures.model_check import joint_of
from wholebody.figures.state import State
from wholebody.problem import Problem
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.checks import values_and_rows

ACTIVE = 1e-4  # m, rad: a constraint nearer to its bound than this counts as active
MET = 1e-4  # m, rad: goals nearer than this count as met, and constraints as holding
INDEPENDENT = 1e-9  # share of its length that a direction must have of its own to count as independent of others


@dataclass(frozen=True)
class Blocker:
    """A limit, constraint or contact that blocks a better posture."""

    # "contact" between two owners, "limit" of a joint, "bound" on a joint (as by `Freeze`), or "constraint"
    kind: Literal["contact", "limit", "bound", "constraint"]
    names: tuple[str, ...]  # the two segments or objects; the joint; or the constraint as in "constraints[0], Hold"
    share: float  # its part of the gradient, relative to the strongest blocker, from 0 to 1
    violated: bool  # whether it is violated at the posture
    frame: str | None = None  # name of the frame of a constraint on one frame

    def __str__(self) -> str:
        if self.kind == "contact":
            return f"{self.names[0]} against {self.names[1]}"
        return {"limit": "the limit of ", "bound": "the bound on ", "constraint": ""}[self.kind] + self.names[0]


class _Rows:
    """Gradients of active constraints, with their labels."""

    def __init__(self, nv: int) -> None:
        self.rows, self.labels = [np.zeros((0, nv))], list[Label]()

    def add(self, rows: Array, labels: list[Label]) -> None:
        self.rows.append(rows)
        self.labels += labels


class _Asked(NamedTuple):
    """What was asked of a posture when it was judged; `names` are those of the constraints."""

    goals: tuple[Goal, ...]
    constraints: tuple[Constraint, ...]
    names: tuple[str, ...]
    bounds: tuple[Bound, ...]
    measures: tuple[Measure, ...]
    figure: Figure


class FirstOrder:
    """Optimality and blockers of a judged posture, computed at the first request."""

    def __init__(self, problem: Problem, pairs: AllPairs, fits: bool, near: bool, errors: tuple[float, ...]) -> None:
        """Keep what they need; `fits`: nothing blocks the posture, `near`: a pair may be near its clearance.

        `errors` are those of the goals.
        """
        if fits:
            self.blockers = ()
        self.fits = fits
        scene = problem.scene
        self._asked = _Asked(
            problem.goals, problem.constraints, problem.constraint_names, problem.bounds, problem.measures, scene.figure
        )
        self._built, self._q = scene.built, pairs.state.q.copy()
        self._near = pairs.nearer(problem.clearances + ACTIVE) if near else pairs.none
        self._clearances = problem.clearances[self._near.number]
        roots = np.sqrt([goal.weight for goal in problem.goals])
        self._within = 5e-3 * float(np.linalg.norm(roots * errors) / roots.max(initial=1e-300))
        self._beside = pairs.nearer(problem.clearances + self._within) if self._within > ACTIVE else self._near

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("fits", "optimality", "nearer", "blockers")}

    @cached_property
    def residual(self) -> Array:
        """(nv,) what nothing balances of the objective's gradient, divided by the objective's curvature."""
        with self._lent() as state:
            return _residual(self._asked, state, _active(self._asked, state, self._near))

    @cached_property
    def optimality(self) -> float:
        """See `Assessment`."""
        return float(np.abs(self.residual).max(initial=0.0))

    @cached_property
    def nearer(self) -> float:
        """The share of its goals' errors that a posture would leave that moves along what nothing balances.

        Errors are linear in the motion, which turns no joint by more than a radian. It is 1 at a minimum, and without
        goals. What is nearer than 0.5 % of the errors counts as active: descents end as near to it.
        """
        with self._lent() as state:
            rows = [values_and_rows(goal, goal.error, state) for goal in self._asked.goals]
            roots = [np.sqrt(goal.weight) for goal in self._asked.goals]
            error = np.concatenate([np.zeros(1), *(root * each for root, (each, _) in zip(roots, rows, strict=True))])
            pull = np.zeros(state.model.nv)
            pull += sum(root * each @ (root * jacobian) for root, (each, jacobian) in zip(roots, rows, strict=True))
            active = _active(self._asked, state, self._beside, max(ACTIVE, self._within))
            _, direction = _balanced(pull, active.signed, active.one_sided)
            led = [root * jacobian @ direction for root, (_, jacobian) in zip(roots, rows, strict=True)]
        led = np.concatenate([np.zeros(1), *led])
        bends = float(led @ led)
        if not bends or np.linalg.norm(direction) <= INDEPENDENT * np.linalg.norm(pull):  # what rounding leaves
            return 1.0
        length = min(float(error @ led) / bends, 1.0 / float(np.abs(direction).max()))
        return float(np.linalg.norm(error - length * led) / np.linalg.norm(error))

    @cached_property
    def blockers(self) -> tuple[Blocker, ...]:
        """See `Assessment`."""
        with self._lent() as state:
            return _blockers(self._asked, state, self._near, self._clearances)

    @contextmanager
    def _lent(self) -> Iterator[State]:
        with all_pairs(self._built).borrow() as pairs:
            yield pairs.state.update(self._q)


def _residual(asked: _Asked, state: State, active: _Active) -> Array:
    """What the best combination of all active gradients leaves of the objective's (nv,), divided by its curvature."""
    nv = state.model.nv
    goals = [(*values_and_rows(goal, goal.error, state), goal) for goal in asked.goals]
    met = all(np.abs(error).max(initial=0.0) <= MET for error, _, _ in goals)
    signed, one_sided = active.signed, active.one_sided
    if met:
        objective = sum((term.weight * term.gradient(state) for term in asked.measures), np.zeros(nv))
        curvature = sum((term.weight * term.curvature(state) for term in asked.measures), np.zeros(nv))
        signed.rows += [jacobian for _, jacobian, _ in goals]
        terms: list[Goal | Constraint] = [*asked.goals, *asked.constraints]
        for term in terms:
            if (planes := term.supporting_planes(state)) is not None:
                near = np.abs(planes.value) <= ACTIVE
                one_sided.add(-planes.jacobian[near], [("constraint", ("",))] * int(near.sum()))
    else:
        objective = sum((goal.weight * error @ jacobian for error, jacobian, goal in goals), np.zeros(nv))
        curvature = sum((goal.weight * (jacobian**2).sum(axis=0) for _, jacobian, goal in goals), np.zeros(nv))
    # share of the largest curvature below which a degree of freedom counts as having that much
    scale = np.maximum(curvature, 1e-2 * curvature.max(initial=0.0))
    if not scale.any():
        return np.zeros(nv)
    _, left = _balanced(objective, signed, one_sided)
    return np.asarray(left / scale)


def _blockers(asked: _Asked, state: State, near: NearPairs, clearances: Array) -> tuple[Blocker, ...]:
    """What keeps a posture from meeting the constraints or, if these hold, the goals; the strongest first."""
    nv = state.model.nv
    signed, one_sided, rows, numbers = _active(asked, state, near)
    gradient = np.zeros(nv)
    violated: dict[Label, float] = {}
    violation = clearances - near.found[:, 0]
    for row in np.flatnonzero(violation > MET).tolist():
        violated[near.label(row)] = float(violation[row])
    for number, constraint in enumerate(asked.constraints):
        value, jacobian = values_and_rows(constraint, constraint.value, state)
        missed = np.minimum(value - constraint.lower, 0.0) + np.maximum(value - constraint.upper, 0.0)
        if np.abs(missed).max(initial=0.0) > MET:
            violated["constraint", (asked.names[number],)] = float(np.abs(missed).max())
            gradient += missed @ jacobian
    if violated:
        for row, number in zip(rows, numbers, strict=True):
            gradient -= violated.get(near.label(number), 0.0) * row
        signed, one_sided = _without(signed, violated), _without(one_sided, violated)
    else:
        for goal in asked.goals:
            error, jacobian = values_and_rows(goal, goal.error, state)
            gradient += goal.weight * error @ jacobian
    multipliers, _ = _balanced(gradient, signed, one_sided)
    found: dict[Label, float] = {}
    for label, size in zip([*signed.labels, *one_sided.labels], multipliers.tolist(), strict=True):
        found[label] = found.get(label, 0.0) + size
    most, deepest = max(found.values(), default=0.0), max(violated.values(), default=0.0)
    frames: dict[Label, str | None] = {
        ("constraint", (name,)): getattr(term, "frame", None)
        for name, term in zip(asked.names, asked.constraints, strict=True)
    }
    first = [Blocker(*label, size / deepest, True, frames.get(label)) for label, size in violated.items()]
    # share of the largest push from which on something counts as being in the way
    second = [
        Blocker(*label, size / most, False, frames.get(label)) for label, size in found.items() if size > 0.05 * most
    ]
    return tuple(part for group in (first, second) for part in sorted(group, key=lambda blocker: -blocker.share))


def _without(rows: _Rows, labels: dict[Label, float]) -> _Rows:
    kept = np.array([label not in labels for label in rows.labels], dtype=bool)
    left = _Rows(rows.rows[0].shape[1])
    left.add(np.vstack(rows.rows)[kept], [label for label, keep in zip(rows.labels, kept, strict=True) if keep])
    return left


class _Active(NamedTuple):
    """Gradients of what works to both sides, of what pushes one way, of contacts among these, and their pairs."""

    signed: _Rows
    one_sided: _Rows
    gaps: Array
    contacts: list[int]


def _active(asked: _Asked, state: State, near: NearPairs, within: float = ACTIVE) -> _Active:
    nv = state.model.nv
    signed, one_sided = _Rows(nv), _Rows(nv)
    gaps, contacts = near.gradients(state)
    one_sided.add(gaps, [near.label(number) for number in contacts])
    for number, constraint in enumerate(asked.constraints):
        value, jacobian = values_and_rows(constraint, constraint.value, state)
        low, high = value <= constraint.lower + within, value >= constraint.upper - within
        label: Label = ("constraint", (asked.names[number],))
        signed.add(jacobian[low & high], [label] * int((low & high).sum()))
        one_sided.add(jacobian[low & ~high], [label] * int((low & ~high).sum()))
        one_sided.add(-jacobian[high & ~low], [label] * int((high & ~low).sum()))
    lower, upper = asked.figure.tangent_bounds(state.q)
    limited_low, limited_high = lower >= -within, upper <= within
    for bound in asked.bounds:
        low_bound, high_bound = bound.bounds(state, None)
        lower, upper = np.maximum(lower, low_bound), np.minimum(upper, high_bound)
    identity, names = np.eye(nv), state.model.names
    for at_work, sign, limited in ((lower >= -within, 1.0, limited_low), (upper <= within, -1.0, limited_high)):
        columns = np.flatnonzero(at_work)
        labels: list[Label] = [
            ("limit" if limited[k] else "bound", (names[joint_of(state.model, int(k))],)) for k in columns
        ]
        one_sided.add(sign * identity[columns], labels)
    return _Active(signed, one_sided, gaps, contacts)


def _balanced(objective: Array, signed: _Rows, one_sided: _Rows) -> tuple[Array, Array]:
    """How hard each labelled row pushes against the objective's gradient (nv,), and its residual (nv,)."""
    equal, one_way = np.vstack(signed.rows), np.vstack(one_sided.rows)
    basis = _row_space(equal)
    room = objective - objective @ basis.T @ basis
    multipliers, left = nonnegative_least_squares(
        one_way - one_way @ basis.T @ basis, room, np.linalg.norm(one_way, axis=1)
    )
    turned = np.linalg.lstsq(equal.T, objective - multipliers @ one_way, rcond=None)[0] if len(equal) else np.zeros(0)
    sizes = [np.abs(turned) * np.linalg.norm(equal, axis=1), multipliers * np.linalg.norm(one_way, axis=1)]
    return np.concatenate([sizes[0][: len(signed.labels)], sizes[1]]), left


def _row_space(rows: Array) -> Array:
    """Orthonormal rows (r, n) that span the same as the rows (m, n)."""
    if not len(rows):
        return rows
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(basis[values > INDEPENDENT * values[0]])


def nonnegative_least_squares(rows: Array, right: Array, lengths: Array) -> tuple[Array, Array]:
    """Shares (m,) >= 0 of rows (m, n) whose sum is nearest to a right side (n,), and the rest (n,)."""
    # Lawson and Hanson 1974, "Solving least squares problems", chapter 23; scipy.optimize loads longer than a solve.
    # A row that is shorter than `INDEPENDENT` of its length (m,) counts as zero.
    norms = np.linalg.norm(rows, axis=1)
    counts = norms > INDEPENDENT * lengths
    scale = np.where(counts, norms, 1.0)
    units = np.where(counts[:, None], rows / scale[:, None], 0.0)
    products = units @ units.T
    share, passive, excluded = np.zeros(len(rows)), np.zeros(len(rows), dtype=bool), ~counts
    left, enough = right, INDEPENDENT * float(np.linalg.norm(right))
    for _ in range(20 * len(rows)):  # times the number of rows: changes of the passive set, at the most
        agrees = np.where(passive | excluded, -np.inf, units @ left)
        new = int(agrees.argmax())
        if agrees[new] <= enough:
            break
        before = share.copy(), passive.copy()
        passive[new] = True
        trial = _least_squares_on(units, products, right, passive)
        if trial is None or trial[new] <= 0.0:  # to rounding it is a combination of the passive rows
            passive[new], excluded[new] = False, True
            continue
        for _ in range(int(passive.sum())):  # each time at least one row leaves
            if trial is None or not (falling := passive & (trial <= 0.0)).any():
                break
            part, fall = np.full(len(rows), np.inf), share[falling] - trial[falling]
            part[falling] = share[falling] / np.where(fall > 0.0, fall, 1.0)  # 0 for a share that is 0 and stays 0
            share += part.min() * (trial - share)
            passive[part <= part.min()] = False
            share[~passive] = 0.0
            trial = _least_squares_on(units, products, right, passive)
        share = share if trial is None else trial
        rest = right - share @ units
        if np.linalg.norm(rest) < np.linalg.norm(left):
            left, excluded = rest, ~counts
        else:  # rows that nearly depend: what rounding leaves would join and leave in turn for ever
            share, passive = before
            excluded[new] = True
    return share / scale, left


def _least_squares_on(units: Array, products: Array, right: Array, passive: Mask) -> Array | None:
    """Shares (m,) of the passive rows in the combination nearest to a right side, any sign; None: they depend."""
    share, rows, square = np.zeros(len(units)), units[passive], products[np.ix_(passive, passive)]
    try:
        first = np.linalg.solve(square, rows @ right)
        share[passive] = first + np.linalg.solve(square, rows @ (right - first @ rows))  # refined once
    except np.linalg.LinAlgError:
        return None
    return share

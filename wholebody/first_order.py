"""First-order optimality of a posture, and what stands in its way: which limits, constraints and contacts push back.

At an optimum the objective's gradient is a combination of the gradients of everything at work, with signs where it
works to one side only (Karush, Kuhn and Tucker). The combination is found by nonnegative least squares; what it leaves
says how far from an optimum the posture is, and its largest parts say what is in the way.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.all_pairs import AllPairs, Label, NearPairs
from wholebody.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State, Wrench
from wholebody.problem import Problem
from wholebody.tasks.base import Bound, Constraint, Goal, Measure

ACTIVE = 1e-4  # m, rad: nearer to its bound than this a constraint may push back
FLAT = 1e-2  # share of the largest curvature below which a degree of freedom counts as having that much
MET = 1e-4  # m, rad: goals nearer than this count as met, and what must hold as holding
WORTH = 0.05  # share of the largest push from which on something counts as being in the way


@dataclass(frozen=True)
class Blocker:
    """Something that keeps a posture from a better one.

    Attributes:
        kind: "contact" between two owners, "limit" of a joint, "bound" on a joint (as by `Freeze`), or "constraint".
        names: the two segments or objects; the joint; or the constraint as in "constraints[0], Hold".
        share: how hard it pushes back, from 0 to 1 for the hardest.
        violated: whether it does not hold here.
        frame: of a constraint on one frame, its name.
    """

    kind: Literal["contact", "limit", "bound", "constraint"]
    names: tuple[str, ...]
    share: float
    violated: bool
    frame: str | None = None

    def __str__(self) -> str:
        """Say it in words."""
        if self.kind == "contact":
            return f"{self.names[0]} against {self.names[1]}"
        return {"limit": "the limit of ", "bound": "the bound on ", "constraint": ""}[self.kind] + self.names[0]


class _Rows:
    """Gradients of what is at work, with what each belongs to."""

    def __init__(self, nv: int) -> None:
        self.rows, self.labels = [np.zeros((0, nv))], list[Label]()

    def add(self, rows: Array, labels: list[Label]) -> None:
        self.rows.append(rows)
        self.labels += labels


class _Asked(NamedTuple):
    """What was asked of a posture when it was judged."""

    goals: tuple[Goal, ...]
    constraints: tuple[Constraint, ...]
    bounds: tuple[Bound, ...]
    measures: tuple[Measure, ...]
    figure: Figure


class FirstOrder:
    """Optimality and blockers of a judged posture: each is computed when it is first asked for, as things were then.

    Attributes:
        fits: whether goals are met and everything holds, so that nothing is in the way.
    """

    def __init__(self, problem: Problem, pairs: AllPairs, fits: bool) -> None:
        """Keep what was asked, the posture where `pairs` are, and the pairs that push there."""
        self.fits = fits
        scene = problem.scene
        self._asked = _Asked(problem.goals, problem.constraints, problem.bounds, problem.measures, scene.figure)
        self._built, self._q = scene.built, pairs.state.q.copy()
        self._near = pairs.nearer(problem.clearances + ACTIVE)
        self._clearances = problem.clearances[self._near.number]

    def __getstate__(self) -> dict[str, Any]:
        """Return the answers: a copy in another process has nothing to compute them from."""
        return {"fits": self.fits, "optimality": self.optimality, "blockers": self.blockers}

    @cached_property
    def optimality(self) -> float:
        """See `wholebody.assessment.Assessment`."""
        with self._lent() as state:
            return _optimality(self._asked, state, _active(self._asked, state, self._near))

    @cached_property
    def blockers(self) -> tuple[Blocker, ...]:
        """See `wholebody.assessment.Assessment`."""
        if self.fits:
            return ()
        with self._lent() as state:
            return _blockers(self._asked, state, self._near, self._clearances)

    @contextmanager
    def _lent(self) -> Iterator[State]:
        """A state at the posture."""
        with self._built.pool(AllPairs, lambda: AllPairs(self._built)).lend() as pairs:
            yield pairs.state.update(self._q)


def _dense(part: Wrench | Array, state: State) -> Array:
    return state.wrench_jacobian(part) if isinstance(part, Wrench) else np.atleast_2d(part)


def _optimality(asked: _Asked, state: State, active: _Active) -> float:
    """What is left of the objective's gradient after the best combination of all active gradients."""
    nv = state.model.nv
    goals = [(np.atleast_1d(goal.error(state)), _dense(goal.jacobian(state), state), goal) for goal in asked.goals]
    met = all(np.abs(error).max(initial=0.0) <= MET for error, _, _ in goals)
    signed, one_sided = active.signed, active.one_sided
    if met:
        objective = sum((term.weight * term.gradient(state) for term in asked.measures), np.zeros(nv))
        curvature = sum((term.weight * term.curvature(state) for term in asked.measures), np.zeros(nv))
        signed.rows += [jacobian for _, jacobian, _ in goals]
    else:
        objective = sum((goal.weight * error @ jacobian for error, jacobian, goal in goals), np.zeros(nv))
        curvature = sum((goal.weight * (jacobian**2).sum(axis=0) for _, jacobian, goal in goals), np.zeros(nv))
    scale = np.maximum(curvature, FLAT * curvature.max(initial=0.0))
    if not scale.any():
        return 0.0
    _, left = _balanced(objective, signed, one_sided)
    return float((np.abs(left) / scale).max())


def _blockers(asked: _Asked, state: State, near: NearPairs, clearances: Array) -> tuple[Blocker, ...]:
    """What keeps a posture from meeting the goals, or from holding what must hold; the hardest first.

    Where something does not hold, the violated things come first, by how much, then what pushes against mending them.
    """
    nv = state.model.nv
    signed, one_sided, rows, numbers = _active(asked, state, near)
    pull = np.zeros(nv)
    violated: dict[Label, float] = {}
    lack = clearances - near.found[:, 0]
    for row in np.flatnonzero(lack > MET).tolist():
        violated[near.label(row)] = float(lack[row])
    for number, constraint in enumerate(asked.constraints):
        value = np.atleast_1d(constraint.value(state))
        missed = np.minimum(value - constraint.lower, 0.0) + np.maximum(value - constraint.upper, 0.0)
        if np.abs(missed).max(initial=0.0) > MET:
            violated[_constraint(number, constraint)] = float(np.abs(missed).max())
            pull += missed @ _dense(constraint.jacobian(state), state)
    if violated:
        for row, number in zip(rows, numbers, strict=True):
            pull -= violated.get(near.label(number), 0.0) * row
        signed, one_sided = _without(signed, violated), _without(one_sided, violated)
    else:
        for goal in asked.goals:
            pull += goal.weight * np.atleast_1d(goal.error(state)) @ _dense(goal.jacobian(state), state)
    push, _ = _balanced(pull, signed, one_sided)
    found: dict[Label, float] = {}
    for label, size in zip([*signed.labels, *one_sided.labels], push.tolist(), strict=True):
        found[label] = found.get(label, 0.0) + size
    most, deepest = max(found.values(), default=0.0), max(violated.values(), default=0.0)
    frames = {_constraint(k, term): getattr(term, "frame", None) for k, term in enumerate(asked.constraints)}
    first = [Blocker(*label, size / deepest, True, frames.get(label)) for label, size in violated.items()]
    second = [
        Blocker(*label, size / most, False, frames.get(label)) for label, size in found.items() if size > WORTH * most
    ]
    return tuple(part for group in (first, second) for part in sorted(group, key=lambda blocker: -blocker.share))


def _without(rows: _Rows, labels: dict[Label, float]) -> _Rows:
    kept = np.array([label not in labels for label in rows.labels], dtype=bool)
    left = _Rows(rows.rows[0].shape[1])
    left.add(np.vstack(rows.rows)[kept], [label for label, keep in zip(rows.labels, kept, strict=True) if keep])
    return left


def _constraint(number: int, constraint: Any) -> Label:
    name = getattr(constraint, "frame", None)
    return "constraint", (f"constraints[{number}], {type(constraint).__name__}" + (f"({name!r})" if name else ""),)


class _Active(NamedTuple):
    """Gradients of everything at work.

    Attributes:
        signed: of what works to both sides.
        one_sided: of what only pushes one way.
        gaps: (n, nv) those of contacts among them.
        contacts: (n,) the pair that each of these is of.
    """

    signed: _Rows
    one_sided: _Rows
    gaps: Array
    contacts: list[int]


def _active(asked: _Asked, state: State, near: NearPairs) -> _Active:
    nv = state.model.nv
    signed, one_sided = _Rows(nv), _Rows(nv)
    gaps, contacts = near.gradients(state)
    one_sided.add(gaps, [near.label(number) for number in contacts])
    for number, constraint in enumerate(asked.constraints):
        value = np.atleast_1d(constraint.value(state))
        jacobian = _dense(constraint.jacobian(state), state)
        low, high = value <= constraint.lower + ACTIVE, value >= constraint.upper - ACTIVE
        label = _constraint(number, constraint)
        signed.add(jacobian[low & high], [label] * int((low & high).sum()))
        one_sided.add(jacobian[low & ~high], [label] * int((low & ~high).sum()))
        one_sided.add(-jacobian[high & ~low], [label] * int((high & ~low).sum()))
    lower, upper = asked.figure.tangent_bounds(state.q)
    limited_low, limited_high = lower >= -ACTIVE, upper <= ACTIVE
    for bound in asked.bounds:
        low_bound, high_bound = bound.bounds(state, None)
        lower, upper = np.maximum(lower, low_bound), np.minimum(upper, high_bound)
    identity = np.eye(nv)
    for at_work, sign, limited in ((lower >= -ACTIVE, 1.0, limited_low), (upper <= ACTIVE, -1.0, limited_high)):
        columns = np.flatnonzero(at_work)
        one_sided.add(sign * identity[columns], [_of_joint(state.model, int(k), bool(limited[k])) for k in columns])
    return _Active(signed, one_sided, gaps, contacts)


def _of_joint(model: pin.Model, column: int, limited: bool) -> Label:
    joint = next(j for j in range(1, model.njoints) if model.joints[j].idx_v <= column < model.idx_vs[j] + model.nvs[j])
    return ("limit" if limited else "bound"), (model.names[joint],)


def _balanced(objective: Array, signed: _Rows, one_sided: _Rows) -> tuple[Array, Array]:
    """How hard each labelled row pushes against the objective's gradient (nv,), and what is left of it (nv,)."""
    from scipy.optimize import nnls

    equal, pushing = np.vstack(signed.rows), np.vstack(one_sided.rows)
    rows = np.vstack([equal, -equal, pushing])
    if not rows.size:
        return np.zeros(len(signed.labels) + len(pushing)), objective
    push, _ = nnls(rows.T, objective, maxiter=20 * (len(rows) + len(objective)))
    left = objective - push @ rows
    size = push * np.sqrt((rows**2).sum(axis=1))
    count, named = len(equal), len(signed.labels)
    return np.concatenate([(size[:count] + size[count : 2 * count])[:named], size[2 * count :]]), left

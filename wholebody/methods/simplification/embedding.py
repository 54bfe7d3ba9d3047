"""Terms of the whole figure on a smaller one, whose postures are embedded in those of the whole one.

The smaller figure has the same joints without the locked ones. A term is resolved on it by its names. If that gives a
different function (joints that it names are missing, a posture that it takes has another length, its weights depend on
a locked joint), the term of the whole figure is used: it is evaluated at the whole posture, and gives the remaining
columns of its derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import UndefinedTermError
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term

SAME = 1e-7  # largest difference in the values and derivatives of one function, relative to their size

_T = TypeVar("_T", bound=Term)


class Embedding:
    """The indices of a smaller model's joints in the whole one's postures.

    Attributes:
        idx_q: (small nq,) indices in the whole posture.
        idx_v: (small nv,) indices in the whole displacement.
    """

    def __init__(self, whole: pin.Model, small: pin.Model, start: Array) -> None:
        """Match the joints by name; the locked ones stay as in `start`, (nq,)."""
        ids = [whole.getJointId(name) for name in list(small.names)[1:]]
        joints = [whole.joints[index] for index in ids]
        self.idx_q = _places([(int(joint.idx_q), int(joint.nq)) for joint in joints])
        self.idx_v = _places([(int(joint.idx_v), int(joint.nv)) for joint in joints])
        self._model = whole
        self._start: Array = np.array(start, dtype=float)

    def embed(self, q: Array) -> Array:
        """Whole posture (nq,) of a small one."""
        whole: Array = self._start.copy()
        whole[self.idx_q] = q
        return whole

    @property
    def trivial(self) -> bool:
        """Whether the smaller model is the whole one."""
        return len(self.idx_v) == int(self._model.nv)

    def whole(self, state: State) -> State:
        """The state of the whole figure at the posture of the small one; it belongs to the owner of the small state."""
        q, whole = self.embed(state.q), state.companion(self, self._model)
        return whole if np.array_equal(q, whole.q) else whole.update(q)

    def rows(self, term: Goal | Constraint, state: State) -> Array:
        """The columns (m, small nv) of a term's Jacobian at the small figure's posture."""
        whole = self.whole(state)
        return np.asarray(whole.dense_jacobian(term.jacobian(whole))[:, self.idx_v])


class EmbeddedGoal(Goal):
    """A goal of the whole figure."""

    def __init__(self, term: Goal, embedding: Embedding) -> None:
        self.term, self.embedding = term, embedding

    @property
    def weight(self) -> float:
        """As the goal's."""
        return self.term.weight

    @property
    def angular(self) -> Mask:
        """(m,) as the goal's."""
        return self.term.angular

    def error(self, state: State) -> Array:
        """(m,) as the goal's."""
        return self.term.error(self.embedding.whole(state))

    def jacobian(self, state: State) -> Array:
        """(m, small nv)."""
        return self.embedding.rows(self.term, state)


class EmbeddedConstraint(Constraint):
    """A constraint of the whole figure."""

    def __init__(self, term: Constraint, embedding: Embedding) -> None:
        self.term, self.embedding = term, embedding

    @property
    def lower(self) -> Array:
        """(m,) as the constraint's."""
        return self.term.lower

    @property
    def upper(self) -> Array:
        """(m,) as the constraint's."""
        return self.term.upper

    @property
    def angular(self) -> Mask:
        """(m,) as the constraint's."""
        return self.term.angular

    def value(self, state: State) -> Array:
        """(m,) as the constraint's."""
        return self.term.value(self.embedding.whole(state))

    def jacobian(self, state: State) -> Array:
        """(m, small nv)."""
        return self.embedding.rows(self.term, state)


class EmbeddedMeasure(Measure):
    """A measure of the whole figure; the share of the locked joints is part of its value."""

    def __init__(self, term: Measure, embedding: Embedding) -> None:
        self.term, self.embedding = term, embedding

    @property
    def weight(self) -> float:
        """As the measure's."""
        return self.term.weight

    def value(self, state: State) -> float:
        """As the measure's."""
        return self.term.value(self.embedding.whole(state))

    def gradient(self, state: State) -> Array:
        """(small nv,)."""
        return np.asarray(self.term.gradient(self.embedding.whole(state))[self.embedding.idx_v])

    def curvature(self, state: State) -> Array:
        """(small nv,)."""
        return np.asarray(self.term.curvature(self.embedding.whole(state))[self.embedding.idx_v])

    def squares(self, state: State) -> tuple[Array, Array] | None:
        """(k,) and (k, small nv)."""
        found = self.term.squares(self.embedding.whole(state))
        return None if found is None else (found[0], np.asarray(found[1][:, self.embedding.idx_v]))


class EmbeddedBound(Bound):
    """A bound of the whole figure."""

    def __init__(self, term: Bound, embedding: Embedding) -> None:
        self.term, self.embedding = term, embedding

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """(small nv,) each."""
        low, high = self.term.bounds(self.embedding.whole(state), dt)
        return np.asarray(low)[self.embedding.idx_v], np.asarray(high)[self.embedding.idx_v]


@dataclass(frozen=True)
class SmallerScene:
    """The part of the smaller scene that terms need, before the scene is made, with its start (small nq,)."""

    figure: Figure
    geometry: pin.GeometryModel
    piece_owner: tuple[str, ...]
    start: Array

    @property
    def model(self) -> pin.Model:
        """The smaller figure's."""
        return self.figure.model

    @cached_property
    def state(self) -> State:
        """A state for all terms."""
        return State(self.model)

    @cached_property
    def postures(self) -> list[Array]:
        """The start and another posture (small nq,), at which functions are compared."""
        return [self.start, *random_postures(self.model, 1, seed=1)]


def restated(terms: Sequence[_T], small: SmallerScene, embedding: Embedding, *, holds: bool = False) -> list[_T]:
    """Terms on a smaller figure: resolved anew if that gives the same function, otherwise embedded.

    Rows of a constraint that no joint moves, and that hold, are dropped; a constraint of which none is left, too.

    Args:
        terms: resolved ones of the whole figure.
        small: the smaller scene.
        embedding: of the smaller in the whole figure.
        holds: whether terms that are goals and constraints stand among the constraints.
    """
    found = (
        term if embedding.trivial and not term.touching else _restated(term, small, embedding, holds) for term in terms
    )
    return [term for term in found if term is not None]


def _restated(term: Any, small: SmallerScene, embedding: Embedding, holds: bool) -> Any:
    embedded: Term
    if isinstance(term, Goal) and not holds:
        embedded = EmbeddedGoal(term, embedding)
    elif isinstance(term, Constraint):
        embedded = EmbeddedConstraint(term, embedding)
    elif isinstance(term, Measure):
        embedded = EmbeddedMeasure(term, embedding)
    else:
        return EmbeddedBound(term, embedding)
    try:
        wanted = _values(embedded, small)
    except UndefinedTermError:  # of one's own, at a posture that was tried
        return embedded
    if isinstance(embedded, Constraint):
        wanted, rows = _moving_rows(wanted)
        if not rows:
            return None
    if term.touching:  # of the whole scene's pieces, which the smaller scene may leave out
        return embedded
    try:
        anew = term.resolve(small, small.start)
        values = _values(anew, small)
    except Exception:  # a user's term may raise any error on another figure
        return embedded
    alike = len(values) == len(wanted) and all(
        a.shape == b.shape and np.abs(a - b).max(initial=0.0) <= SAME * (1.0 + np.abs(b).max(initial=0.0))
        for a, b in zip(values, wanted, strict=True)
    )
    return anew if alike else embedded


def _values(term: Term, small: SmallerScene) -> list[Array]:
    """Values of a term at the postures: all that a method reads, except the constant part of a measure."""
    state = small.state
    ask: list[Callable[[], object]] = []
    if isinstance(term, Goal):
        ask = [lambda: term.error(state), lambda: state.dense_jacobian(term.jacobian(state)), lambda: term.angular]
    elif isinstance(term, Constraint):
        ask = [lambda: np.atleast_1d(term.value(state)), lambda: state.dense_jacobian(term.jacobian(state))]
        ask += [lambda: _wide(term.lower, term, state), lambda: _wide(term.upper, term, state)]
    elif isinstance(term, Measure):
        ask = [lambda: term.gradient(state), lambda: term.curvature(state)]
    values = []
    for q in small.postures:
        state.update(q)
        values += [np.nan_to_num(np.array(question(), dtype=float), posinf=1e300, neginf=-1e300) for question in ask]
    return values


def _moving_rows(values: list[Array]) -> tuple[list[Array], int]:
    """Values of a constraint without the rows that hold and that no joint moves; and the number of remaining rows."""
    value, lower, upper = values[0], values[2], values[3]
    moves = np.any([np.abs(jacobian).max(axis=1, initial=0.0) > SAME for jacobian in values[1::4]], axis=0)
    keep = moves | (value < lower - SAME) | (value > upper + SAME)
    return [part[keep] for part in values], int(keep.sum())


def _wide(bound: Array, term: Constraint, state: State) -> Array:
    return np.broadcast_to(bound, np.shape(np.atleast_1d(term.value(state))))


def _places(spans: list[tuple[int, int]]) -> NDArray[np.intp]:
    return np.array([place for first, size in spans for place in range(first, first + size)], dtype=np.intp)

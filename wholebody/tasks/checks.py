"""Checks of terms when a problem is stated: weights, bounds, and counts of rows that fit together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, TypeGuard, TypeVar

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, TermError, UndefinedTermError, either
from wholebody.figures.model_check import joint_of
from wholebody.figures.state import UNIT_TOLERANCE, State, Wrench
from wholebody.geometry.placement import FARTHEST
from wholebody.scene.scene import Scene
from wholebody.tasks import answers
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term

T = TypeVar("T")

_ASKED = (("error", 1), ("value", 1), ("jacobian", 1), ("gradient", 1), ("curvature", 1), ("squares", 1), ("bounds", 2))
"""What terms are asked at a state, and of how many arguments."""

KINDS: dict[str, type] = {"goals": Goal, "constraints": Constraint, "bounds": Bound, "measures": Measure}


def checked_terms(terms: Any, kinds: type | tuple[type, ...], what: str) -> Sequence[Any]:
    """Terms of some kinds, given as the argument `what` of a problem; InputError for anything else."""
    listed = checks.listed(terms, what, f"{what}=[...]")
    for number, term in enumerate(listed):
        if not is_a(term, kinds):
            wanted = either(kind.__name__ for kind in (kinds if isinstance(kinds, tuple) else (kinds,)))
            home = next((name for name, taken in KINDS.items() if isinstance(term, taken)), "")
            home = "constraints" if home == "bounds" else home
            correction = f"give it in {home}=[...]" if home else "give terms such as wb.Hold('left_foot')"
            raise InputError(f"{what}[{number}] is {checks.a(type(term))}, not a {wanted}; {correction}")
    return listed


def is_a(term: object, kinds: type[T] | tuple[type[T], ...]) -> TypeGuard[T]:
    """`isinstance`, remembered by class: to ask an abstract class takes three times as long."""
    kind: Any = type(term)
    asked: Any = kinds
    return _derives(kind, asked)


def is_equality(term: Constraint) -> bool:
    """Whether a row of a constraint is an equality, as those of `Hold` are."""
    return bool(np.any(term.lower == term.upper))


@lru_cache(maxsize=256)
def _derives(kind: Any, kinds: Any) -> bool:
    return issubclass(kind, kinds)


def owner_pair(scene: Any, pair: Any) -> tuple[str, str]:
    """Two names of segments or things that may touch; InputError for anything else."""
    known = {*scene.figure.segments, *scene.objects}
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        text = checks.shown(pair)
        raise InputError(f"touching takes a list of pairs of names, such as [('right_hand', 'table')], not of {text}")
    for name in pair:
        checks.known(name, known, "segment or object", "touching")
    return str(pair[0]), str(pair[1])


@contextmanager
def named(where: str, term: object) -> Iterator[None]:
    """A context in which a TermError names the term's place, such as "goals[1] (Mine)"."""
    try:
        yield
    except TermError as error:
        raise type(error)(term, f"{where} ({type(term).__name__})", error.reason) from None


def check_rows(where: str, term: Any, evaluate: Callable[[State], Array], state: State) -> None:
    """Check the values and Jacobian of a goal or constraint, its weight or bounds, and which rows are angles."""
    with named(where, term):
        values, _ = values_and_rows(term, evaluate, state)
        if isinstance(term, Goal):
            answers.weight(term, "weight", term.weight)
        if isinstance(term, Constraint):
            low, high = (answers.limit(term, what, getattr(term, what)) for what in ("lower", "upper"))
            for what, bound in (("lower", low), ("upper", high)):
                if bound.ndim and len(bound) not in (1, len(values)):
                    message = (
                        f"it has {len(values)} values, and its {what} has shape {bound.shape}; give as many, or one"
                    )
                    raise TermError(term, answers.in_words(term), message)
            if not (low <= high).all():
                raise TermError(term, answers.in_words(term), "its lower is above its upper; give the lower one first")
        if answers.mask(term, "angular", term.angular).shape not in ((), (1,), values.shape):
            message = f"it has {len(values)} values, and its angular has shape {np.shape(term.angular)}; give as many"
            raise TermError(term, answers.in_words(term), message)


def values_and_rows(term: Any, evaluate: Callable[[State], Array], state: State) -> tuple[Array, Array]:
    """Values (m,) of a goal or constraint at a state, and their derivatives (m, nv); TermError where counts differ."""
    values, jacobian = evaluate(state), term.jacobian(state)
    check_row_count(term, values, jacobian, state.model.nv)
    return values, state.dense_jacobian(jacobian)


def check_row_count(term: Term, values: Array, jacobian: Wrench | Array, nv: int) -> None:
    """A TermError where a term has not as many rows, of nv columns, as values (m,)."""
    count = len(jacobian.rows if isinstance(jacobian, Wrench) else jacobian)
    if count != len(values):
        message = f"it has {len(values)} values and a jacobian of {count} rows at a posture; give shape "
        raise TermError(term, answers.in_words(term), f"{message}{(len(values), nv)}")


def undefined(terms: Iterable[Term], state: State, dt: float | None = None) -> UndefinedTermError | None:
    """Why a state cannot be used: the first term of one's own that is not finite there; None where all are."""
    try:
        for term in filter(answers.is_own, terms):
            for what, arguments in _ASKED:
                ask = getattr(term, what, None)
                if ask is not None:
                    ask(state, *((dt,) if arguments == 2 else ()))
    except UndefinedTermError as error:
        return error
    return None


def defined(term: Term, states: Iterable[State]) -> Iterator[State]:
    """Those of some states where a term is finite: postures all over the limits are tried, and some may not be."""
    return (state for state in states if undefined((term,), state) is None)


def check_measure(where: str, measure: Measure, state: State) -> None:
    """Check the weight of a measure, and what its methods return at a state."""
    with named(where, measure):
        answers.weight(measure, "weight", measure.weight)
        for evaluate in (measure.value, measure.gradient, measure.curvature, measure.squares):
            evaluate(state)


def check_own(state: State, **groups: Iterable[Any]) -> None:
    """Evaluate terms of one's own at the start; those of the package find mistakes when they are resolved."""
    for name, terms in groups.items():
        for number, term in enumerate(terms):
            if answers.is_own(term) and name == "measures":
                check_measure(f"{name}[{number}]", term, state)
            elif answers.is_own(term):
                check_rows(f"{name}[{number}]", term, term.error if name == "goals" else term.value, state)


def check_frozen(bounds: Iterable[Bound], scene: Scene, state: State) -> None:
    """Raise InputError if a bound keeps a joint out of its limits where a state is."""
    least, most = scene.figure.tangent_bounds(state.q)
    for bound in bounds:
        low, high = bound.bounds(state, None)
        wrong = np.flatnonzero((high < least) | (low > most))
        if len(wrong):
            name = scene.model.names[joint_of(scene.model, int(wrong[0]))]
            message = f"{type(bound).__name__} keeps {name} where it starts"
            raise InputError(f"{message}, out of its limits; start it within them")


def start_posture(scene: Scene, start: Array | str | Mapping[str, Array | str] | None) -> Array:
    """The posture (nq,) that a problem starts at, of unit quaternions; InputError for anything else."""
    figure = scene.figure
    if start is None or isinstance(start, (str, Mapping)):
        return np.array(figure.posture(figure.postures[0] if start is None else start), dtype=float)
    q = checks.posture(start, scene.model.nq, "start")
    figure.warn_of_angles(q, "start")
    if q.dot(q) > FARTHEST**2 and np.abs(q).max() > FARTHEST:
        raise InputError(f"start has a value of {np.abs(q).max():.3g}; give metres and radians")
    if scene.model.nq == scene.model.nv:
        return np.array(q)
    if not pin.isNormalized(scene.model, q, UNIT_TOLERANCE):
        raise InputError("the start's quaternion is not of unit length; normalise it with pin.normalize(model, q)")
    return np.asarray(pin.normalize(scene.model, q), dtype=float)

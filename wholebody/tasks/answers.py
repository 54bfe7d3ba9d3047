"""Checks of what users' terms return, at every call: finite numbers of the right shape, or a TermError."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from math import isfinite
from numbers import Integral
from typing import Any

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError, TermError, UndefinedTermError
from wholebody.figures.state import State, Wrench

Check = Callable[[object, str, Any, tuple[Any, ...]], Any]
"""Checks an answer: the term, what was asked in words, the answer, and the arguments of the call."""

_OURS = __name__.partition(".")[0]
_MARK = "_answers_checked"
_DOUBLE = np.dtype(np.float64)


def in_words(term: object) -> str:
    """Class of a term, and its frame if it has one."""
    frame = getattr(term, "frame", None)
    return f"{type(term).__name__}({frame})" if isinstance(frame, str) else type(term).__name__


def is_own(term: object) -> bool:
    """Whether a term is of a class of one's own, or stands for one."""
    kind: Any = type(term)
    if not _is_ours(kind):
        return True
    inner = vars(term).get("goal")  # that `Soft` stands for
    return inner is not None and is_own(inner)


@lru_cache(maxsize=256)
def _is_ours(kind: Any) -> bool:
    return bool(kind.__module__.partition(".")[0] == _OURS)


def check_answers(kind: type, table: Mapping[str, Check]) -> None:
    """Have the answers of a class of terms checked."""
    for name, check in table.items():
        owner = next((base for base in kind.__mro__ if name in vars(base)), None)
        if owner is None or _is_ours(owner):
            continue
        found = vars(owner)[name]
        if isinstance(found, property):
            if found.fget is not None and not hasattr(found.fget, _MARK):
                setattr(kind, name, property(_checked(found.fget, name, check), doc=found.__doc__))
        elif callable(found) and not hasattr(found, _MARK):
            setattr(kind, name, _checked(found, name, check))


def _checked(found: Any, what: str, check: Check) -> Any:
    def answer(self: object, *arguments: Any, **named: Any) -> Any:
        method = found.__get__(self, type(self)) if hasattr(found, "__get__") else found
        return Checked(self, what, method, check)(*arguments, **named)

    setattr(answer, _MARK, True)
    return wraps(found)(answer) if hasattr(found, "__name__") else answer


class Checked:
    """A method of a term whose answers are checked."""

    def __init__(self, term: object, what: str, found: Callable[..., Any], check: Check) -> None:
        self._term, self._what, self._found, self._check = term, what, found, check

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """The checked answer."""
        given, asked = self._found(*arguments, **named), arguments or tuple(named.values())
        try:
            return self._check(self._term, self._what, given, asked)
        except UndefinedTermError as error:
            error.q = next((np.array(one.q) for one in asked if isinstance(one, State)), None)
            raise


def values(term: object, what: str, given: Any, _: object = ()) -> Array:
    """Values (m,) of a goal or constraint; a single number is one row."""
    found = given if type(given) is np.ndarray and given.dtype is _DOUBLE else _numbers(term, what, given, "shape (m,)")
    if found.ndim > 1:
        raise _wrong(term, f"its {what} has shape {found.shape}; return one row of numbers, shape (m,)")
    return _finite(term, what, found if found.ndim else found.reshape(1))


def rows(term: object, what: str, given: Any, arguments: tuple[Any, ...] = ()) -> Wrench | Array:
    """A Jacobian: a `Wrench`, or rows (m, nv); a single row may be (nv,)."""
    model = _model(arguments)
    if isinstance(given, Wrench):
        found = _numbers(term, what, given.rows, "wrenches, shape (m, 6)")
        if found.ndim != 2 or found.shape[1] != 6:
            raise _wrong(term, f"the rows of its Wrench have shape {found.shape}; give (m, 6)")
        last = sys.maxsize if model is None else model.njoints - 1
        joints: tuple[Any, ...] = given[1:]
        if not all(isinstance(joint, Integral) and 0 <= int(joint) <= last for joint in joints):
            raise _wrong(term, f"its Wrench is of the joints {given[1]} and {given[2]}; give indices from 0 to {last}")
        return Wrench(_finite(term, what, found), int(given.joint), int(given.against))
    found = _numbers(term, what, given, "a Wrench or rows, shape (m, nv)")
    found = found.reshape(1, -1) if found.ndim == 1 else found
    columns = found.shape[-1] if model is None else model.nv
    if found.ndim != 2 or found.shape[1] != columns:
        raise _wrong(term, f"its {what} has shape {found.shape}; give shape (m, {columns}), or a Wrench")
    return _finite(term, what, found)


def one(term: object, what: str, given: Any, _: object = ()) -> float:
    """A single number."""
    if type(given) is float and isfinite(given):
        return given
    found = _numbers(term, what, given, "one number")
    if found.size != 1:
        raise _wrong(term, f"its {what} has shape {found.shape}; give one number")
    return float(_finite(term, what, found.reshape(1))[0])


def freedoms(term: object, what: str, given: Any, arguments: tuple[Any, ...] = ()) -> Array:
    """A number for each degree of freedom, (nv,)."""
    found, model = _numbers(term, what, given, "shape (nv,)"), _model(arguments)
    if found.ndim != 1 or (model is not None and len(found) != model.nv):
        wanted = "(nv,)" if model is None else (model.nv,)
        raise _wrong(term, f"its {what} has shape {found.shape}; give shape {wanted}")
    return _finite(term, what, found)


def diagonal(term: object, what: str, given: Any, arguments: tuple[Any, ...] = ()) -> Array:
    """A number of zero or more for each degree of freedom, (nv,)."""
    found = freedoms(term, what, given, arguments)
    if (found < 0.0).any():
        raise _wrong(term, f"it has a negative {what}; give a diagonal that is zero or more")
    return found


def squares(term: object, what: str, given: Any, arguments: tuple[Any, ...] = ()) -> tuple[Array, Array] | None:
    """Residuals (k,) and their derivatives (k, nv), or None."""
    if given is None:
        return None
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise _wrong(term, f"its {what} are {checks.shown(given)}; give residuals (k,) and derivatives (k, nv)")
    residuals, slopes = values(term, what, given[0]), rows(term, what, given[1], arguments)
    if isinstance(slopes, Wrench) or len(slopes) != len(residuals):
        raise _wrong(term, f"its {what} are {len(residuals)} residuals and not as many derivatives (k, nv)")
    return residuals, slopes


def sides(term: object, what: str, given: Any, arguments: tuple[Any, ...] = ()) -> tuple[Array, Array]:
    """Lower and upper bounds, each (nv,); infinite for no bound."""
    if not isinstance(given, (tuple, list, np.ndarray)) or len(given) != 2:
        raise _wrong(term, f"its {what} are {checks.shown(given)}; give lower and upper ones, each (nv,)")
    low, high = (_known(term, what, _numbers(term, what, side, "two rows, each (nv,)")) for side in given)
    model = _model(arguments)
    for side in (low, high):
        if side.ndim > 1 or (side.ndim and model is not None and len(side) != model.nv):
            raise _wrong(term, f"its {what} have shape {side.shape}; give two rows, each (nv,)")
    return low, high


def limit(term: object, what: str, given: Any, _: object = ()) -> Array:
    """Least or greatest values of a constraint, (m,) or one for all; infinite for no bound."""
    found = _known(term, what, _numbers(term, what, given, "shape (m,), or one number for all rows"))
    if found.ndim > 1:
        raise _wrong(term, f"its {what} has shape {found.shape}; give shape (m,), or one number for all rows")
    return found


def mask(term: object, what: str, given: Any, _: object = ()) -> Mask:
    """Which rows are angles, (m,) or one for all."""
    try:
        found = np.asarray(given)
    except ValueError:
        found = np.empty(0, dtype=object)
    if found.dtype.kind != "b" or found.ndim > 1:
        raise _wrong(term, f"its {what} is {checks.shown(given)}; give True or False for each row, or one for all")
    return found


def weight(term: object, what: str, given: Any, _: object = ()) -> float:
    """A positive weight."""
    found = one(term, what, given)
    if not found > 0.0:
        raise _wrong(term, f"its {what} is {found:g}; give a positive number")
    return found


def _model(arguments: tuple[Any, ...]) -> Any:
    """The model of the state among the arguments of a call; None without one."""
    return next((given.model for given in arguments if isinstance(given, State)), None)


def _numbers(term: object, what: str, given: Any, wanted: str) -> Array:
    try:
        return checks.array(given, f"its {what}", wanted)
    except InputError as error:
        raise _wrong(term, str(error)) from None


def _wrong(term: object, message: str) -> TermError:
    return TermError(term, in_words(term), message)


def _finite(term: object, what: str, found: Array) -> Array:
    good = np.isfinite(found)
    if not good.all():
        raise _undefined(term, what, found[~good][0])
    return found


def _known(term: object, what: str, found: Array) -> Array:
    if np.isnan(found).any():
        raise _undefined(term, what, np.nan)
    return found


def _undefined(term: object, what: str, found: float) -> UndefinedTermError:
    message = f"its {what} has {found:g} {UndefinedTermError.WHERE}, which is not finite; its formula must give finite"
    return UndefinedTermError(term, in_words(term), f"{message} numbers at every posture")

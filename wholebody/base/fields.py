"""Checks of the fields of a record, read from their annotations: a range is written once."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache
from types import SimpleNamespace, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, Union, get_args, get_origin, get_type_hints

import numpy as np

from wholebody.base import checks
from wholebody.base.errors import InputError

Check: TypeAlias = Callable[[Any, str], Any]
"""A function of a value and its name in messages: the value in the form in which it is used, or an InputError."""


@dataclass(frozen=True)
class Range:
    """The numbers that a value may be, both ends included."""

    low: float  # the least
    high: float  # the greatest
    unit: str = ""  # of the numbers
    whole: bool = False  # whether they are whole
    endless: bool = False  # whether infinity is taken too, for no limit
    wanted: str = ""  # what the message asks for in place of the range

    def __call__(self, value: object, what: str) -> float:
        """The number; an InputError if the value is none of these."""
        if self.whole:
            return checks.whole(value, what, int(self.low), int(self.high))
        if self.endless and isinstance(value, (float, np.floating)) and value == math.inf:
            return math.inf
        wanted = self.wanted or (f"a number between {self}, or math.inf for no limit" if self.endless else "")
        return checks.number(value, what, self.low, self.high, self.unit, wanted)

    def __str__(self) -> str:
        """Both ends and the unit, such as "0 and 1 m"."""
        return f"{checks.plain(self.low)} and {checks.plain(self.high)} {self.unit}".strip()


@dataclass(frozen=True)
class Choice:
    """One of a few words; the check of a field that is annotated as a Literal of them."""

    options: Collection[str]

    def __call__(self, value: object, what: str) -> str:
        """The word; an InputError if the value is another."""
        return checks.choice(value, self.options, what)


@dataclass(frozen=True)
class Vector:
    """A fixed count of numbers, kept as a tuple."""

    count: int
    each: Range

    def __call__(self, value: object, what: str) -> tuple[float, ...]:
        """The numbers; an InputError if the value is of another shape, or one of them is out of range."""
        low, high, floats = self.each.low, self.each.high, not self.each.whole
        plain = floats and type(value) is tuple and len(value) == self.count  # told in a fifth of the time
        if plain and all(type(one) is float and low <= one <= high for one in value):  # type: ignore[attr-defined]
            return value  # type: ignore[return-value]
        found = tuple(checks.numbers(value, (self.count,), what).tolist())
        within = floats and low <= min(found) and max(found) <= high
        return found if within else tuple(self.each(one, what) for one in found)


@dataclass(frozen=True)
class Names:
    """A list of at least `least` names, kept as a tuple; `example` is such a list as it is written, for messages."""

    example: str
    least: int = 1

    def __call__(self, value: object, what: str) -> tuple[str, ...]:
        """The names; an InputError if the value is no list or empty."""
        names = tuple(checks.listed(value, what, self.example))
        if len(names) < self.least:
            raise InputError(f"{what} is empty; give a list of names, such as {self.example}")
        return names


class _Checked(NamedTuple):
    """A field with its check; None stands for no value where it is optional, and what the check returns is `kept`."""

    name: str
    check: Check
    optional: bool
    kept: str
    default: object  # a default that was checked, and what the check returned; MISSING where there is none
    found: object


class Checked:
    """Base of records whose fields are checked by their annotations when they are made.

    `bool` and `Literal` are checked as they are, ``Annotated[T, check]`` by the check, and None passes where the
    annotation has it. What a check returns is kept in the field `resolved_NAME` if the class has one, otherwise in the
    field itself.
    """

    def __post_init__(self) -> None:
        """Check the fields."""
        kind: Any = type(self)
        own, where = vars(self), ""
        for name, check, optional, kept, default, found in _checked(kind):
            value = own[name]
            if value is default:
                own[kept] = found
            elif value is not None or not optional:
                where = where or called(self)
                own[kept] = check(value, f"{where}: {name}")
                if kept != name and hasattr(value, "copy"):  # the caller may change an array of its own
                    own[name] = value.copy()


def called(record: object) -> str:
    """A record in messages: its class, and the names that it must be given."""
    kind: Any = type(record)
    names = _names(kind)
    values = ", ".join([checks.shown(getattr(record, name)) for name in names])
    return f"{kind.__name__}({values})" if names else str(kind.__name__)


def check_of(kind: Any, name: str) -> Check:
    """The check of a field of a class that is `Checked`."""
    return next(field.check for field in _checked(kind) if field.name == name)


@cache
def _checked(kind: Any) -> tuple[_Checked, ...]:
    found = []
    names = {field.name for field in fields(kind)}
    for field, hint in _hints(kind):
        parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
        check = next(filter(None, map(_check, parts)), None)
        if check is not None:
            kept = f"resolved_{field.name}"
            kept = kept if kept in names else field.name
            found.append(_Checked(field.name, check, type(None) in parts, kept, *_default(field.default, check)))
    return tuple(found)


def _default(default: object, check: Check) -> tuple[object, object]:
    """A default with what its check returns, if any number of records may share that; else nothing."""
    if default is MISSING or default is None:
        return MISSING, MISSING
    found = check(default, "default")
    shared = not found.flags.writeable if isinstance(found, np.ndarray) else isinstance(found, (float, int, str, tuple))
    return (default, found) if shared else (MISSING, MISSING)


def _check(hint: Any) -> Check | None:
    """The check that an annotation asks for; None if it asks for none."""
    if hint is bool:
        return checks.flag
    if get_origin(hint) is Literal:
        return Choice(get_args(hint))
    return next(filter(callable, get_args(hint)[1:]), None) if get_origin(hint) is Annotated else None


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(
        field.name
        for field, hint in _hints(kind)
        if field.default is field.default_factory is MISSING and str in (hint, *get_args(hint)[:1])
    )


def _hints(kind: Any) -> Iterator[tuple[Field[Any], Any]]:
    """The fields that are given, with their annotations; those of each class are read in its module."""
    for field in fields(kind):
        if field.init:
            one = SimpleNamespace(__annotations__={field.name: field.type})
            # the first class that has it; since Python 3.14 a class may lack its annotations
            having = (
                base for base in reversed(kind.__mro__) if field in vars(base).get("__dataclass_fields__", {}).values()
            )
            scope = getattr(sys.modules.get(next(having).__module__), "__dict__", {})
            with suppress(NameError):  # what only a type checker resolves asks for nothing
                yield field, get_type_hints(one, scope, include_extras=True)[field.name]

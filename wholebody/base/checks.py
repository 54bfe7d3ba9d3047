"""Checks of arguments: each returns the value in the form in which it is used, or raises an InputError, one sentence.

`what` is the name of the value in the sentence: the argument's name, with the callable in front if that is not obvious.
"""

from __future__ import annotations

import inspect
import math
import os
import re
import warnings
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from numbers import Number
from operator import index
from pathlib import Path
from reprlib import Repr
from typing import Any, ClassVar, TypeVar

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import ALIKE, InputError, UnknownNameError, either

_T = TypeVar("_T")

DOUBLE = np.dtype(np.float64)
NUMERIC = "fiu"  # kinds of numpy arrays that hold real numbers: floating, signed and unsigned

SLIPS = {"m": {"millimetres": 1e-3, "centimetres": 1e-2}, "rad": {"degrees": math.pi / 180.0}, "kg": {"grams": 1e-3}}
"""Unit -> the units that people write by mistake, with their size in it."""

TIME_STEP = (1e-6, 1e6)  # least and greatest time step, seconds: beyond them velocities have no significant digits
TIME_STEP_ASKED = "give one between 1e-6 and 1e6 s"  # the end of a message about a time step that is out of that range

MOST_TURNED = 4.0 * math.pi  # radians, two turns, beyond which degrees were probably meant

FASTEST_TURN = 50.0  # radians a second beyond which a limit was probably meant in degrees a second

UNLIMITED = 1e4  # radians, radians a second or metres from which on a limit stands for none: some files write 1e16

LONGEST = 200  # characters of a name or a title

SHOWN_NAMES = 6  # names that a list in a sentence has at most

_INSIDE = (str(Path(__file__).parents[1]) + os.sep, "<string>")  # the package's files, and code that dataclasses make
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60


def shown(value: object) -> str:
    """A value as messages quote it: its representation in one line, shortened, or its type if it has none."""
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) is str and value.isascii() and value.isidentifier() and len(value) <= _SHORT.maxstring - 2:
        return f"'{value}'"  # a name, by which every term is called that is made: in a tenth of the time
    try:
        return " ".join(_SHORT.repr(value).split())
    except Exception:  # a user's __repr__ may raise anything; Python refuses that of an int beyond 4300 digits
        return f"a {type(value).__name__} that cannot be shown"


def a(kind: object) -> str:
    """The name of a type with its article."""
    name = getattr(kind, "__name__", str(kind))
    return f"an {name}" if name[:1].lower() in "aeio" else f"a {name}"


def some(names: Iterable[str]) -> str:
    """The first six names, and how many more there are; "" for none."""
    listed = list(names)
    more = f" and {len(listed) - SHOWN_NAMES} more" if len(listed) > SHOWN_NAMES else ""
    return ", ".join(listed[:SHOWN_NAMES]) + more


def instance(value: object, kind: type[_T] | tuple[type[_T], ...], what: str, correction: str) -> _T:
    """A value of a type, or of one of several; `correction` ends the sentence: "load one with wb.load('human')"."""
    if not isinstance(value, kind):
        wanted = either(a(one) for one in (kind if isinstance(kind, tuple) else (kind,)))
        raise InputError(f"{what} is {a(type(value))}, not {wanted}; {correction}")
    return value


def number(value: object, what: str, low: float, high: float, unit: str = "", wanted: str = "") -> float:
    """A finite number within a range, both ends included; `wanted` replaces range and unit in the message."""
    if type(value) is float and low <= value <= high and math.isfinite(value):  # told in a third of the time
        return value
    found = _real(value)
    if found is None or not low <= found <= high:
        if not wanted:
            finite = "finite " if math.isinf(high) or (isinstance(value, float) and not math.isfinite(value)) else ""
            ends = f" between {plain(low)} and {plain(high)}" if math.isfinite(high) else f" of {plain(low)} or more"
            wanted = f"a {finite}number{ends if math.isfinite(low) else ''}{f' {unit}' if unit else ''}"
        slip = "" if found is None else unit_hint(found, low, high, unit)
        raise InputError(f"{what} is {shown(value)}; give {wanted}{slip}")
    return found


def plain(bound: float) -> str:
    """An end of a range as it is written by hand: "0.001", "1e6", "4294967295"."""
    short = f"{bound:.0f}" if bound % 1.0 == 0.0 and float(f"{bound:g}") != bound else f"{bound:g}"
    return re.sub(r"e([+-])0*", lambda sign: f"e{sign[1]}".replace("+", ""), short)


def warn(message: str) -> None:
    """Warn, at the place that called the package."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_code.co_filename.startswith(_INSIDE):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, stacklevel=level)


def warn_of_degrees(value: float, what: str, likely: float = MOST_TURNED, unit: str = "rad") -> None:
    """Warn where an angle [rad], or a speed [rad/s], is beyond what is likely, so that degrees were probably meant."""
    if likely < abs(value) < UNLIMITED:
        degrees = unit.replace("rad", "degrees")
        warn(f"{what} is {value:g} {unit}; {value:g} {degrees} are {math.radians(value):.4g} {unit}")


def unit_hint(value: float, low: float, high: float, unit: str) -> str:
    """A hint that a number out of a range may be in another unit that people write; empty if it fits in none."""
    fits = [
        f"{value * factor:.6g} if it is in {other}"
        for other, factor in SLIPS.get(unit, {}).items()
        if abs(value) < 1e15 and low <= value * factor <= high  # a large int times a float overflows
    ]
    return f"; write {' or '.join(fits)}" if fits else ""


def time_step(value: object, what: str) -> float:
    """Seconds of a step or a frame, within `TIME_STEP`."""
    found = number(value, what, *TIME_STEP, "s, such as 0.02")
    if found > 10.0:  # Seconds of a step beyond which a number of frames a second was probably meant.
        message = f"{what} is {found:g} s; for {found:g} frames a second give 1 / {found:g}"
        warn(message)
    return found


def whole(value: object, what: str, low: int, high: int) -> int:
    """A whole number within a range, both ends included."""
    try:
        found = None if isinstance(value, (bool, np.bool_)) else index(value)  # type: ignore[arg-type]
    except TypeError:
        found = None
    if found is None or not low <= found <= high:
        raise InputError(f"{what} is {shown(value)}; give a whole number between {low} and {high}")
    return found


def flag(value: object, what: str) -> bool:
    """True or false."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} is {shown(value)}; give True or False")
    return bool(value)


def text(value: object, what: str) -> str:
    """A line of text: not empty, at most `LONGEST` characters, all of which can be shown."""
    if not isinstance(value, str) or not value.strip() or len(value) > LONGEST or not value.isprintable():
        raise InputError(f"{what} is {shown(value)}; give a line of text, at most {LONGEST} characters")
    return value


def choice(value: object, options: Collection[str], what: str) -> str:
    """One of a few words."""
    if not isinstance(value, str) or value not in options:
        raise InputError(f"{what} is {shown(value)}; give {either(map(repr, options))}")
    return value


def known(
    value: object, names: Collection[str], kind: str, where: str = "", offered: Collection[str] | None = None
) -> str:
    """A known name of a kind of object such as "frame"; an UnknownNameError offers all names, or those `offered`."""
    if not isinstance(value, str):
        raise InputError(f"{f'{where}: ' if where else ''}{shown(value)} is not the name of {a(kind)}; give a text")
    if value not in names:
        raise UnknownNameError(kind, value, names if offered is None else offered, where)
    return value


def listed(value: object, what: str, example: str) -> list[Any]:
    """The entries of a list, a tuple or another iterable that is no text."""
    if type(value) in (list, tuple) or (isinstance(value, Iterable) and not isinstance(value, (str, bytes))):
        try:
            return list(value)  # type: ignore[call-overload,no-any-return]
        except TypeError:  # an array without dimensions
            pass
    raise InputError(f"{what} is {shown(value)}, not a list; give one, such as {example}")


class FixedAttributes:
    """Base of objects whose public attributes stay, but those in `_settable`, which `_checked_value` checks."""

    _settable: ClassVar[frozenset[str]] = frozenset()
    _correction: ClassVar[str] = "make another one"
    _properties: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls) -> None:
        kinds = {name: kind for base in reversed(cls.__mro__) for name, kind in vars(base).items()}
        cls._properties = frozenset(name for name, kind in kinds.items() if isinstance(kind, property))

    def __setattr__(self, name: str, value: Any) -> None:
        if (name in self.__dict__ or name in self._properties) and name[0] != "_":
            if name not in self._settable:
                raise InputError(f"{name} of a {type(self).__name__} cannot be set; {self._correction}")
            value = self._checked_value(name, value)
        object.__setattr__(self, name, value)

    def _checked_value(self, name: str, value: Any) -> Any:
        """The value in the form in which it is kept; an InputError if it does not fit."""
        return value


def settle(record: object, name: str, value: object) -> None:
    """Keep a value of a record as its check returned it: what counts on with it gets a float, not a fraction."""
    object.__setattr__(record, name, value)


def keywords(given: Collection[str], options: type, what: str) -> None:
    """Refuse keyword arguments that a TypedDict of options has not, as Python does."""
    for name in given:
        if name not in options.__annotations__:
            raise TypeError(f"{what}() got an unexpected keyword argument {name!r}")


def function(value: _T, what: str) -> _T:
    """Something that can be called, or None."""
    if value is not None and not callable(value):
        raise InputError(f"{what} is {shown(value)}; give a function, or leave it out")
    return value


def path(value: object, what: str) -> Path:
    """The path of a file."""
    given = value.__fspath__() if isinstance(value, os.PathLike) else value
    if not isinstance(given, str) or not given or "\0" in given:
        raise InputError(f"{what} is {shown(value)}; give the path of a file")
    return Path(given)


def array(value: object, what: str, wanted: str) -> Array:
    """Real numbers as an array, including infinities and NaN; `wanted`: "corners, shape (k, 3), metres"."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if isinstance(value, np.ma.MaskedArray) and value.dtype.kind in NUMERIC:
        value = np.where(value.mask, np.nan, value.data)  # what is masked is no number
    try:
        found = np.asarray(value)
    except (TypeError, ValueError, OverflowError, RecursionError):
        found = np.empty(0, dtype=object)
    if isinstance(value, (tuple, list)) and any(one is True or one is False for one in value):  # numpy counts it as 1
        raise InputError(f"{what} is {shown(value)}, of which one is no number; give {wanted}")
    if found.dtype.kind == "O" and found.size and all(isinstance(one, Number) for one in found.flat):
        real_ones = [_real(one) for one in found.flat]  # fractions and decimals
        if None not in real_ones:
            return np.array(real_ones, dtype=np.float64).reshape(found.shape)
    if found.dtype.kind not in NUMERIC:
        raise InputError(f"{what} is {shown(value)}, not numbers; give {wanted}")
    real: Array = found if found.dtype == np.float64 else found.astype(np.float64)
    return real


def numbers(value: object, shape: tuple[int, ...], what: str) -> Array:
    """Read-only copy with finite numbers of this shape."""
    if type(value) is np.ndarray and value.dtype is DOUBLE:  # a third of the time is that of the words below
        found: Array = value.copy()
    else:
        found = array(value, what, f"numbers of shape {shape}" if shape else "one number")
        found = found if type(value) in (tuple, list) else found.copy()
    if found.shape != shape:
        raise InputError(f"{what} has shape {found.shape}; give {math.prod(shape)} numbers, shape {shape}")
    if not math.isfinite(np.vdot(found, found)) and not np.isfinite(found).all():  # the first takes a fifth of the time
        raise InputError(f"{what} is {shown(found.tolist())}; give finite numbers")
    found.setflags(write=False)
    return found


def posture(value: object, size: int, what: str = "a posture") -> Array:
    """A posture (size,) of finite numbers; an array of floats is returned without a copy."""
    usual = type(value) is np.ndarray and value.dtype is DOUBLE and value.shape == (size,)
    if usual and math.isfinite(value.dot(value)):  # type: ignore[attr-defined]
        return value  # type: ignore[return-value] # told in a third of the time
    found = array(value, what, f"{size} numbers; start from figure.posture(...)")
    if found.shape != (size,):
        raise InputError(f"{what} has shape {found.shape}; give ({size},), from figure.posture(...)")
    if not math.isfinite(found.dot(found)) and not np.isfinite(found).all():  # the first takes a fifth of the time
        wrong = int(np.flatnonzero(~np.isfinite(found))[0])
        raise InputError(f"{what} entry {wrong} is not finite; give finite numbers")
    return found


def color(value: object, what: str) -> tuple[float, float, float, float]:
    """Red, green, blue and alpha from 0 to 1, of three or four such numbers, a name of CSS, or "#rrggbb(aa)"."""
    wanted = "red, green, blue and, if wanted, alpha, each from 0 to 1, such as (1.0, 0.0, 0.0), a name or '#rrggbb'"
    if isinstance(value, str):
        from PIL import ImageColor  # the names of CSS

        try:
            parts = (*ImageColor.getrgb(value), 255)[:4]
        except ValueError:
            near = get_close_matches("".join(value[:LONGEST].lower().split()), ImageColor.colormap, 3, ALIKE)
            hint = f"; did you mean {', '.join(near)}?" if near else f"; give {wanted}"
            raise InputError(f"{what} is {shown(value)}{hint}") from None
        return parts[0] / 255.0, parts[1] / 255.0, parts[2] / 255.0, parts[3] / 255.0
    found = array(value, what, wanted)
    if found.shape not in ((3,), (4,)) or not ((found >= 0.0) & (found <= 1.0)).all():
        bytes_ = found.shape in ((3,), (4,)) and ((found >= 0.0) & (found <= 255.0)).all()
        raise InputError(f"{what} is {shown(value)}; give {wanted}{'; divide bytes by 255' if bytes_ else ''}")
    red, green, blue, alpha = (*found.tolist(), 1.0)[:4]
    return red, green, blue, alpha


def _real(value: object) -> float | None:
    """A finite number as a float; None for anything else, also for booleans, texts, and arrays of one number."""
    if isinstance(value, (bool, np.bool_, str, bytes, bytearray)) or getattr(value, "shape", ()) != ():
        return None
    try:
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return None
    return found if math.isfinite(found) else None


def is_number(word: str) -> bool:
    """Whether a text is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True

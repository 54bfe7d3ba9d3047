"""Array types, whose shapes docstrings give; copies of named tuples that hold arrays; how both are shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]
Record = TypeVar("Record", bound=tuple[Any, ...])

SHOWN = 8  # numbers of an array that are shown
LETTERS = 80  # of another value
LINE = 240  # letters of all


_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3) of vectors (..., 3), as `np.cross` has them at a tenth of its time."""
    found: Array = a.take(_NEXT, -1) * b.take(_LAST, -1) - a.take(_LAST, -1) * b.take(_NEXT, -1)
    return found


def as_dict(record: tuple[Any, ...]) -> dict[str, Any]:
    """The values of a record, a named tuple, by the names of its fields, in their order."""
    return dict(zip(cast(Any, type(record)).__match_args__, record, strict=True))


def with_values(record: Record, **values: Any) -> Record:
    """A copy of a record with other values of some fields, as `copy.replace` of Python 3.13 makes it."""
    kind: Any = type(record)
    made: Record = kind(**{**dict(zip(kind.__match_args__, record, strict=True)), **values})
    return made


def brief(self: Any) -> str:
    """The `__repr__` of a dataclass or named tuple in a line: long arrays by their shape, and no defaults."""
    named = fields(self) if is_dataclass(self) else ()
    names = {one.name: one.default for one in named if one.repr} or dict.fromkeys(getattr(self, "_fields", ()), self)
    values = {name: getattr(self, name) for name in names}
    plain = (int, float, str, type(None))
    usual = {name for name, value in values.items() if isinstance(value, plain) and value == names[name]}
    shown = [f"{name}={_word(value)}" for name, value in values.items() if name not in usual]
    text = f"{type(self).__name__}({', '.join(shown)})"
    return text if len(text) <= LINE else f"{text[: LINE - 4]}...)"


def _word(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > SHOWN:
        return f"<array {value.shape}>"
    if isinstance(value, (tuple, list, Mapping)) and len(value) > SHOWN:
        return f"<{len(value)} {type(next(iter(value))).__name__}>"
    text = f"{value:.4g}" if isinstance(value, float) else " ".join(repr(value).split())
    return text if len(text) <= LETTERS else f"{text[: LETTERS - 3]}..."

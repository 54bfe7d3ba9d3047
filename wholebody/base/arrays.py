"""Array types, whose shapes docstrings give; copies of named tuples that hold arrays; how both are shown."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]
Record = TypeVar("Record", bound=tuple[Any, ...])

SHOWN = 8  # numbers of an array that are shown
LETTERS = 80  # of another value


def as_dict(record: tuple[Any, ...]) -> dict[str, Any]:
    """The values of a record, a named tuple, by the names of its fields, in their order."""
    return dict(zip(cast(Any, type(record)).__match_args__, record, strict=True))


def with_values(record: Record, **values: Any) -> Record:
    """A copy of a record with other values of some fields, as `copy.replace` of Python 3.13 makes it.

    A TypeError if it has no field of that name.
    """
    return type(record)(**{**as_dict(record), **values})


def brief(self: Any) -> str:
    """The `__repr__` of a dataclass that has arrays: long ones are shown by their shape."""
    told = ", ".join(f"{one.name}={_word(getattr(self, one.name))}" for one in fields(self) if one.repr)
    return f"{type(self).__name__}({told})"


def _word(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > SHOWN:
        return f"<array {value.shape}>"
    if isinstance(value, (tuple, list)) and len(value) > SHOWN:
        return f"<{len(value)} {type(value[0]).__name__}>"
    text = " ".join(repr(value).split())
    return text if len(text) <= LETTERS else f"{text[: LETTERS - 3]}..."

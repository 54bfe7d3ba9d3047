"""Array types. Docstrings of functions give the shapes."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]

SHOWN = 8  # numbers of an array that are shown
LETTERS = 80  # of another value


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

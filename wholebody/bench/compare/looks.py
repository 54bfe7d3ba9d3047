"""How methods look: one colour and one marker each, the same in every chart and table."""

from __future__ import annotations

from hashlib import sha256
from typing import NamedTuple

from wholebody.bench.style import COLORS


class Look(NamedTuple):
    """Colour and marker of a method; the principal ones are drawn wide and with their spread."""

    color: str
    marker: str
    principal: bool


_LOOKS = {
    "qp/osqp": Look(COLORS["wholebody/osqp"], "o", True),
    "qp/daqp": Look(COLORS["wholebody/daqp"], "o", True),
    "newton/slack": Look("#e69f00", "s", True),
    "newton/barrier": Look("#a06a00", "D", True),
    "newton/kkt": Look("#f3cf7a", "s", False),
    "ccd": Look("#000000", "v", True),
    "dls": Look("#8c8c8c", "X", True),
    "placo": Look(COLORS["placo"], "P", True),
    "mink": Look(COLORS["mink"], "h", True),
    "pink": Look(COLORS["pink"], "*", True),
}
_SOLVERS = ("#7f9fc4", "#4b6a9b", "#9fb8d0", "#35507a", "#b3c6e0", "#5f86b3")
"""Shades for the QP method with further solvers: one family, seen at a glance."""
_OTHERS = ("#882255", "#117733", "#999933", "#661100", "#aa4499", "#44aa99")


def look(adapter: str) -> Look:
    """Return how a method looks; one that is not known here has a look of its own by its name."""
    if adapter in _LOOKS:
        return _LOOKS[adapter]
    number = sha256(adapter.encode()).digest()[0]
    if adapter.startswith("qp/"):
        return Look(_SOLVERS[number % len(_SOLVERS)], ".", False)
    return Look(_OTHERS[number % len(_OTHERS)], "p", True)

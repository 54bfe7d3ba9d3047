"""Guards: joints that have left a reach cone or a range of motion are brought back, or else stay at their last values.

Cones and ranges that share joints, those of a shoulder or of a leg, are kept together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.methods.ccd.cones import cone_guards
from wholebody.methods.ccd.limbs import Limbs
from wholebody.methods.ccd.ranges import range_guards

ROUNDS = 2  # over the parts of a guard: to bring a limb back into one may take it out of another
HALVINGS = 20  # of the motion back to the last values inside, to a millionth of it


class Part(Protocol):
    """A cone or a range."""

    @property
    def nodes(self) -> tuple[int, ...]:
        """The nodes that change it."""

    def read(self, q: Array, data: Any) -> None:
        """Read what the limbs do not move from `data` at the posture q (nq,); call `limbs.read` first."""

    def inside(self) -> bool:
        """Whether it is kept, after `limbs.forward`."""

    def turn_back(self) -> None:
        """Change the nodes until it is kept, as far as their limits allow, and call `limbs.forward`."""


class Guard:
    """Keeps cones and ranges that share nodes.

    Attributes:
        parts: the cones and ranges.
    """

    def __init__(self, limbs: Limbs, parts: Sequence[Part]) -> None:
        """Take the parts."""
        self.parts, self._limbs = tuple(parts), limbs
        self._rows = np.array(sorted({node for part in parts for node in part.nodes}), dtype=np.intp)
        self._last: Array | None = None

    def read(self, q: Array, data: Any) -> None:
        """Begin at the posture q (nq,) with its placements in `data`, after `limbs.read` and `limbs.forward`."""
        self._last = None
        for part in self.parts:
            part.read(q, data)
        self._remember()

    def keep(self) -> bool:
        """Bring the nodes back inside if they have left; true if they are inside then.

        Call it after `limbs.forward()`; if it moves something, it calls `limbs.forward()` itself.
        """
        if self._remember():
            return True
        for _ in range(ROUNDS):
            for part in self.parts:
                if not part.inside():
                    part.turn_back()
            if self._remember():
                return True
        if self._last is not None:
            self._retreat(self._last)
        return self._remember()

    def _inside(self) -> bool:
        return all(part.inside() for part in self.parts)

    def _remember(self) -> bool:
        if not self._inside():
            return False
        self._last = self._limbs.values[self._rows]
        return True

    def _retreat(self, last: Array) -> None:
        """Move from the last values inside as far towards the present ones as all parts allow."""
        wanted = self._limbs.values[self._rows]
        inside, outside = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            self._blend(last, wanted, middle)
            if self._inside():
                inside = middle
            else:
                outside = middle
        self._blend(last, wanted, inside)

    def _blend(self, first: Array, second: Array, share: float) -> None:
        self._limbs.values[self._rows] = first + share * (second - first)
        self._limbs.forward()


def guards(figure: Figure, limbs: Limbs, cones: Sequence[str] | None = None, ranges: Sequence[str] = ()) -> list[Guard]:
    """Guards of the cones and ranges that these limbs can leave; `cones` None for all cones of the figure."""
    groups: list[list[Part]] = []
    for part in (*cone_guards(figure, limbs, cones), *range_guards(figure, limbs, ranges)):
        sharing = [group for group in groups if any(set(part.nodes) & set(other.nodes) for other in group)]
        groups = [group for group in groups if group not in sharing]
        groups.append([*(other for group in sharing for other in group), part])
    return [Guard(limbs, group) for group in groups]

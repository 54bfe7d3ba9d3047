"""What the viewer needs to know of a scene: this much and no more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Touching(Protocol):
    """Pairs of pieces near each other; k rows each."""

    @property
    def pair(self) -> NDArray[np.intp]:
        """(k, 2) indices of the two pieces."""

    @property
    def distance(self) -> Array:
        """(k,) signed distance, metres."""

    @property
    def normal(self) -> Array:
        """(k, 3) unit vector from the first piece to the second."""

    @property
    def point_a(self) -> Array:
        """(k, 3) witness point on the first piece."""

    @property
    def point_b(self) -> Array:
        """(k, 3) witness point on the second piece."""


class Subject(Protocol):
    """A figure among things, as `wholebody.Scene` is."""

    @property
    def figure(self) -> Any:
        """The figure; only goals ask it for its frames."""

    @property
    def model(self) -> Any:
        """Pinocchio's model of the figure."""

    @property
    def geometry(self) -> Any:
        """Pinocchio's geometry model with all pieces."""

    @property
    def objects(self) -> Mapping[str, Any]:
        """Things by name; each may have a `color`, red, green, blue, alpha."""

    @property
    def piece_owner(self) -> Sequence[str]:
        """Segment or object that each piece is part of."""

    @property
    def revision(self) -> int:
        """A number that changes whenever things come or go."""

    def contacts(self, q: Array, within: float = ...) -> Touching:
        """Pairs nearer than `within` metres at the posture q, nearest first."""

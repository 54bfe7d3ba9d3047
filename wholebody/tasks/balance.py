"""Constraint: the centre of mass above the support polygon of the feet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, TypeAlias

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.base.fields import Names, Range
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Surroundings, filled
from wholebody.tasks.support import convex_polygon, edges, shrunk, standing_points

Feet: TypeAlias = Annotated[Sequence[str], Names("['left_foot', 'right_foot']")]
Margin: TypeAlias = Annotated[float, Range(0.0, 1.0, "m")]


@dataclass(frozen=True, eq=False)
class Balance(Constraint):
    """Keep the centre of mass above the support polygon of the feet, so that the figure can stand still.

    The polygon is the convex hull of the points on which the feet stand at the start; hold the feet there. There is a
    row for each edge: the horizontal distance of the centre of mass from it, positive inside [m].

    Attributes:
        feet: names of the segments that carry the figure, including their child segments, such as toes.
        margin: least distance from the edges [m].
        normals: (m, 2) unit normals of the edges of the support polygon, inward; once resolved.
        offsets: (m,) of the edges: inside, normals @ x >= offsets [m]; once resolved.

    Raises:
        InputError: no feet are named, or the margin is negative.
    """

    feet: Feet = ("left_foot", "right_foot")
    _: KW_ONLY
    margin: Margin = 0.0
    normals: Array = field(init=False, repr=False)
    offsets: Array = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Balance:
        """Compute the support polygon at the start.

        Raises:
            UnknownNameError: the figure has no such foot.
            InputError: the feet have no pieces, stand on a line, or the polygon is smaller than the margin; or no
                moving part has mass.
        """
        inputs.check_mass(scene, "Balance")
        corners = convex_polygon(standing_points(scene, start, self.feet)[:, :2])
        if len(shrunk(corners, self.margin)) == 0:
            raise InputError(
                f"Balance: a margin of {self.margin:g} m leaves nothing of the support polygon; make it smaller"
            )
        normals, offsets = edges(corners)
        return filled(self, normals=normals, offsets=offsets)

    @property
    def lower(self) -> Array:
        """(m,) the margin."""
        return np.full(len(self.offsets), self.margin)

    @property
    def upper(self) -> Array:
        """(m,) inf."""
        return np.full(len(self.offsets), np.inf)

    @property
    def angular(self) -> Mask:
        """(m,) no row is in radians."""
        return np.zeros(len(self.offsets), dtype=bool)

    def value(self, state: State) -> Array:
        """(m,) distance inside each edge [m]."""
        return np.asarray(self.normals @ state.center_of_mass()[:2] - self.offsets)

    def jacobian(self, state: State) -> Array:
        """(m, nv)."""
        return np.asarray(self.normals @ state.center_of_mass_jacobian()[:2])

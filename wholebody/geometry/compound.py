"""Several shapes that are one thing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.checks import listed, shown
from wholebody.base.errors import InputError
from wholebody.geometry.pieces import Piece
from wholebody.geometry.shapes import Shape


@dataclass(frozen=True, eq=False)
class Compound(Shape):
    """Shapes that are one thing.

    Attributes:
        parts: each shape, and its placement as a pin.SE3.

    Raises:
        InputError: other parts, or none.
    """

    parts: tuple[tuple[Shape, pin.SE3], ...]

    def __post_init__(self) -> None:
        wanted = "[(wb.Box((0.1, 0.1, 0.1)), pin.SE3.Identity())]"
        parts = tuple(listed(self.parts, "Compound parts", wanted))
        for part in parts:
            pair = isinstance(part, (tuple, list)) and len(part) == 2
            placed = pair and isinstance(part[0], Shape) and isinstance(part[1], pin.SE3)
            if not (placed and np.isfinite(part[1].homogeneous).all()):
                raise InputError(f"Compound: a part is {shown(part)}; give pairs such as {wanted}")
        if not parts:
            raise InputError(f"Compound: there are no parts; give pairs such as {wanted}")
        object.__setattr__(self, "parts", tuple((shape, pin.SE3(at)) for shape, at in parts))

    def pieces(self) -> tuple[Piece, ...]:
        """The pieces of all shapes."""
        return tuple(
            Piece(piece.geometry, at * piece.placement, piece.volume)
            for shape, at in self.parts
            for piece in shape.pieces()
        )

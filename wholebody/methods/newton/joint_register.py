"""The joints of an assembly, so that a joint given twice is refused."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array
from wholebody.errors import InputError

SAME_PLACE = 1e-9  # m: joints of one kind between two bodies that are nearer than this are the same joint


class JointRegister:
    """Joints by kind and pair of bodies, with their positions in both."""

    def __init__(self) -> None:
        """Make an empty register."""
        self._known: dict[tuple[str, frozenset[str]], list[dict[str, Array]]] = {}

    def add(self, kind: str, first: str, second: str, places: tuple[Array, Array] | None = None) -> None:
        """Add a joint.

        Args:
            kind: such as "revolute joint".
            first: name of a body.
            second: another.
            places: (3,) positions of the joint in either body; joints at different positions are different, such as two
                hinges. None for joints without a position.

        Raises:
            InputError: the joint exists already.
        """
        listed = self._known.setdefault((kind, frozenset((first, second))), [])
        at = (np.zeros(3), np.zeros(3)) if places is None else places
        here = {first: at[0], second: at[1]}
        for other in listed:
            if all(np.abs(other[name] - place).max() <= SAME_PLACE for name, place in here.items()):
                where = "" if places is None else " there"
                raise InputError(f"{kind}: {first!r} and {second!r} have one already{where}; leave the second out")
        listed.append(here)

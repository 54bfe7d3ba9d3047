"""Which joints an assembly has already, so that the same one given twice is named."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array
from wholebody.errors import InputError

SAME_PLACE = 1e-9  # m: joints of one kind between two bodies that are nearer than this are one


class JointRegister:
    """Joints by kind and pair of bodies, with their places in both."""

    def __init__(self) -> None:
        """Begin without any."""
        self._known: dict[tuple[str, frozenset[str]], list[dict[str, Array]]] = {}

    def add(self, kind: str, first: str, second: str, places: tuple[Array, Array] | None = None) -> None:
        """Remember a joint.

        Args:
            kind: such as "revolute joint".
            first: name of a body.
            second: another.
            places: (3,) where the joint is, in either body; two at different places are two, as of a door's hinges.
                None for joints that say all there is to say at any place.

        Raises:
            InputError: there is this joint already.
        """
        listed = self._known.setdefault((kind, frozenset((first, second))), [])
        at = (np.zeros(3), np.zeros(3)) if places is None else places
        here = {first: at[0], second: at[1]}
        for other in listed:
            if all(np.abs(other[name] - place).max() <= SAME_PLACE for name, place in here.items()):
                where = "" if places is None else " there"
                raise InputError(f"{kind}: {first!r} and {second!r} have one already{where}; leave the second out")
        listed.append(here)

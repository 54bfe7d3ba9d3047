"""What every format writes and reads."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure


class Motion(Protocol):
    """What is written: a clip."""

    @property
    def figure(self) -> Figure:
        """The figure of the postures."""

    @property
    def q(self) -> Array:
        """(n, nq) one posture for each frame."""

    @property
    def dt(self) -> float:
        """Seconds from frame to frame."""

    @property
    def name(self) -> str:
        """Name of the clip."""


class Frames(NamedTuple):
    """What is read.

    Attributes:
        q: (n, nq) one posture for each frame.
        dt: seconds from frame to frame.
        name: name of the clip.
    """

    q: Array
    dt: float
    name: str

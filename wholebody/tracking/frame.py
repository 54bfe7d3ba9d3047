"""One frame: what an overlap strategy says of it, the protocol of such strategies, and what is shown."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from wholebody.base.arrays import Array, brief
from wholebody.scene.moving_obstacles import Collision

FRAME = 1.0 / 60.0  # s: of a display, from frame to frame


class Resolution(NamedTuple):
    """Result of the overlap removal of one frame; the other attributes are those of `Frame`."""

    # postures (nq,) to show, the best one first; the next is taken if the motion to one is not free
    candidates: tuple[Array, ...]
    contact_seconds: float
    solve_seconds: float
    iterations: int
    joints: int
    pairs: int
    note: str
    swept: bool = False  # whether the motion to the first of them was swept and is free, where nothing moves by itself
    # where things moved, shares of the frame and postures (nq,) before the first of them
    path: tuple[tuple[float, Array], ...] = ()


class OverlapStrategy(Protocol):
    """An algorithm that removes overlap."""

    @property
    def sweep_tolerance(self) -> float:
        """Allowed depth of the motion from frame to frame, metres; less than that of its postures."""

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""


class Frame(NamedTuple):
    """One frame.

    Attributes:
        q: (nq,) the shown posture, free of overlap unless the note says otherwise.
        seconds: wall time of the frame, without drawing.
        cpu_seconds: the processor's time, without waiting for other work on a shared machine.
        contact_seconds: the part of it for collision queries.
        solve_seconds: the part of it for joint angles (or, for a rigid figure, its displacement).
        iterations: programs solved, passes of CCD with a goal made anew, or displacements.
        joints: number of joints adjusted for contact, counted once for each iteration that adjusted them, as the joints
            per frame of table 2 of Schmidl and Lin; 0 if the figure is displaced as a whole.
        pairs: number of pairs of pieces that were kept apart or separated.
        note: "" or a report of unusual events.
        collisions: what things that move (`Scene.move` with `over`) passed through, or are inside of; empty if nothing.
        path: shares of the frame, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty.

    Examples:
        >>> frame = wholebody.tracking.FrameLoop(scene, standing).frame(standing)
        >>> frame.q.shape
        (56,)
    """

    q: Array
    seconds: float
    cpu_seconds: float
    contact_seconds: float
    solve_seconds: float
    iterations: int
    joints: int
    pairs: int
    note: str
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()

    def __repr__(self) -> str:
        return brief(self)

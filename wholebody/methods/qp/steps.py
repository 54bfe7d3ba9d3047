"""What a tracker of the QP method answers: a step, and a frame of several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from wholebody.base.arrays import Array
from wholebody.scene.moving_obstacles import Collision


class QPStep(NamedTuple):
    """Answer of one step.

    Attributes:
        q: (nq,) the next posture.
        displacement: (nv,) tangent displacement to it, radians and metres.
        velocity: (nv,) displacement / dt.
        contacts: how many pairs had rows.
        rows: how many contact rows.
        exact: whether the program was solved to rounding.
        iterations: iterations of the QP solver.
        by: what closed the last program, see `QPSolution`.
        programs: how many programs each closed: one a step, and more where it was looked at twice.
        share: how much of the program's displacement was gone: less than 1 where it was longer than what was looked at.
        collisions: what things that move (`Scene.move` with `over`) passed through, or are inside of; empty if nothing.
        path: shares of the step, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty.
        note: which term of one's own is not finite where the step would have ended, so that it was cut; else empty.
    """

    q: Array
    displacement: Array
    velocity: Array
    contacts: int
    rows: int
    exact: bool
    iterations: int
    by: str
    programs: Mapping[str, int]
    share: float
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()
    note: str = ""


class FrameStep(NamedTuple):
    """Answer of one frame.

    Attributes:
        q: (nq,) the next posture.
        iterations: programs.
        collisions, path: see `QPStep`.
    """

    q: Array
    iterations: int
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()

"""What a tracker of the QP method answers: a step, and a frame of several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from wholebody.base.arrays import Array, brief
from wholebody.scene.moving_obstacles import Collision


class QPStep(NamedTuple):
    """Answer of one step."""

    q: Array  # (nq,) the next posture
    displacement: Array  # (nv,) tangent displacement to it, radians and metres
    velocity: Array  # (nv,) displacement / dt
    contacts: int  # how many pairs had rows
    rows: int  # how many contact rows
    exact: bool  # whether the program was solved to rounding
    iterations: int  # iterations of the QP solver
    by: str  # what closed the last program, see `QPSolution`
    programs: Mapping[str, int]  # how many programs each closed: one a step, and more where it was looked at twice
    # how much of the program's displacement was gone: less than 1 where it was longer than what was looked at
    share: float
    # what things that move (`Scene.move` with `over`) passed through, or are inside of; empty if nothing.
    collisions: tuple[Collision, ...] = ()
    # shares of the step, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty
    path: tuple[tuple[float, Array], ...] = ()
    # which term of one's own is not finite where the step would have ended, so that it was cut; else empty
    note: str = ""

    def __repr__(self) -> str:
        return brief(self)


class FrameStep(NamedTuple):
    """Answer of one frame."""

    q: Array  # (nq,) the next posture
    iterations: int  # programs
    collisions: tuple[Collision, ...] = ()  # see `QPStep`
    path: tuple[tuple[float, Array], ...] = ()

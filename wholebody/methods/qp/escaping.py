"""A free posture for the end of a frame in which a thing came faster than the figure can move.

Postures within what bounds allow are sought with the thing where it ends: from the posture before and from random
ones, near pairs are projected out of each other one after the other (Kaczmarz, 1937). A program would leave all of them
violated where not all can be parted to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.compiled import with_loops
from wholebody.figures.state import root_freedoms
from wholebody.methods.control import BUDGET
from wholebody.methods.qp.settings import ESCAPE


class ProjectionRows(NamedTuple):
    """What a posture is projected out of: rows of near contacts and of constraints."""

    depth: float  # greatest of any pair, metres
    rows: Array  # (k, nv) rates of what must not become negative
    room: Array  # (k,) how much that is, metres and radians
    box: Array  # (2, nv) displacements that bounds allow


def free_end(model: pin.Model, q: Array, out: float, rows_at: Callable[[Array], ProjectionRows]) -> Array | None:
    """A posture (nq,) that is free to a depth `out` [m], whatever passes; None if a frame's budget finds none."""
    project, box = compiled_kernel().project, rows_at(q).box.copy()
    for start in _starts(model, box):
        gone, least, weak = start, np.inf, 0
        for _ in range(ESCAPE.rounds):
            if BUDGET.over:
                return None
            here = np.asarray(pin.integrate(model, q, gone))
            at = rows_at(here)
            if at.depth <= out:
                return here
            weak += at.depth > ESCAPE.worth * least
            if weak == ESCAPE.weak:
                break
            least = min(least, at.depth)
            gone = gone.copy()
            project(at.rows, at.room, box[0], box[1], gone)
    return None


def _starts(model: pin.Model, box: Array) -> Iterator[Array]:
    """Displacements (nv,) to begin at, all within a box (2, nv)."""
    yield np.zeros(model.nv)
    low, high = np.clip(box, -ESCAPE.farthest, ESCAPE.farthest)
    rng, joints = np.random.default_rng(0), ~root_freedoms(model)
    for _ in range(ESCAPE.random):
        begun = rng.uniform(low, high)
        begun[joints] *= rng.uniform()
        yield begun


@with_loops("wholebody.methods.qp.dense_kernel")
def compiled_kernel(dense_kernel: Any) -> None:
    """The projection, compiled or read back."""
    dense_kernel.project(np.zeros((0, 1)), np.zeros(0), np.zeros(1), np.zeros(1), np.zeros(1))

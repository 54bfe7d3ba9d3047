"""A step near the goals in a normal and a tangential part, and where the tangential ones lead: docs/theory/qp.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.methods.acceleration import STRETCH, Anderson
from wholebody.methods.qp.active_set import without_gradient
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import DESCENT

SHORTER, LONGER = 1.0 / 3.0, 2.0  # factors of the longest extrapolation after one was rejected, and taken


class Parts(NamedTuple):
    """A step in two parts, (n,) each."""

    normal: Array
    tangential: Array


def parts_of(program: QuadraticProgram, answer: QPSolution, shift: Array, work: Array) -> Parts | None:
    """The normal and tangential part of the answer of a program; None where its face has no normal part.

    A bound that was some way off and now holds belongs to the measures, so to the tangential part, unless the normal
    one comes to it too. `shift` (s,), of the method of multipliers, makes up for g in the first errors.
    """
    target = program.target.copy()
    target[: len(shift)] += shift
    active, normal = answer.active, None
    lower = active.lower & (program.lower >= -DESCENT.room)
    upper = active.upper & (program.upper <= DESCENT.room)
    left = (active.lower & ~lower) | (active.upper & ~upper)
    if left.any():
        normal = without_gradient(program, with_values(active, lower=lower, upper=upper), target, work)
        if normal is not None and not ((program.lower < normal) & (normal < program.upper))[left].all():
            normal = None
    if normal is None:
        normal = without_gradient(program, active, target, work)
    return None if normal is None else Parts(normal, answer.x - normal)


class Extrapolation:
    """Where the tangential parts of the last steps lead."""

    def __init__(self) -> None:
        self._memory = Anderson()
        self._longest = STRETCH  # plain tangential parts
        self._as_plain = False  # whether the last proposal would have been the program's own step

    def propose(self, parts: Parts, program: QuadraticProgram) -> Array | None:
        """The extrapolated step (n,) in the program's box; None while too little is known, or where it is its own."""
        plain = parts.tangential
        fast, self._as_plain = self._memory.propose(plain, self._longest), False
        if fast is None:
            return None
        if fast @ (program.diagonal * plain) <= 0.0:  # back to where the measures are flat and curve downwards
            if self._longest <= 1.0:  # not looked at twice
                self._as_plain = True
                return None
            fast = min(DESCENT.along, self._longest) * plain
        return np.clip(parts.normal + fast, program.lower, program.upper)

    def record(self, parts: Parts, way: Array, extrapolated: bool) -> None:
        """Remember the displacement (n,) after the last proposal, and whether it was the proposed one."""
        self._memory.record(way - parts.normal)
        if extrapolated or self._as_plain:
            self._longest = min(LONGER * self._longest, STRETCH)

    def rejected(self) -> None:
        """Go less far the next time, from what is learnt from now on."""
        self._memory.forget()
        self._longest = max(SHORTER * self._longest, 1.0)

    def reset(self) -> None:
        """Forget the past steps: one was rejected, or the goals are far."""
        self._memory.reset()

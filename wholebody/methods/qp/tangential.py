"""A step near the goals in a normal and a tangential part: docs/theory/qp.md."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.base.arrays import Array, with_values
from wholebody.methods.qp.active_set import without_gradient
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import DESCENT


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

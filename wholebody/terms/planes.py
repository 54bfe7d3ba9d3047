"""Supporting planes of all terms: inequalities that hold wherever a term is met."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.figures.state import State
from wholebody.tasks.base import MOST_PLANES, Constraint, Goal


class TermPlanes(NamedTuple):
    """Supporting planes of all terms; see `Goal.supporting_planes`.

    Attributes:
        value: (p,) not positive where the terms are met.
        jacobian: (p, nv).
        row: (p,) the first row of the term that a plane is of, goals' before constraints'.
        key: (p,) names a plane from one posture to the next.
        bend: (b, nv) rows b with the second derivatives of the terms' rows as sums of b' b.
        bend_row: (b,) the row that a bend is of, goals' before constraints'.
    """

    value: Array
    jacobian: Array
    row: Indices
    key: Indices
    bend: Array
    bend_row: Indices


def term_planes(terms: Sequence[Goal | Constraint], counts: Sequence[int], state: State) -> TermPlanes | None:
    """Supporting planes of the terms that have some, where a state is; None where no term has.

    Args:
        terms: goals and constraints, resolved.
        counts: rows of each.
        state: where they are evaluated.
    """
    found: list[TermPlanes] = []
    row = 0
    for term, count in zip(terms, counts, strict=True):
        planes = term.supporting_planes(state)
        if planes is not None:
            rows, key = np.full(len(planes.value), row, dtype=np.intp), planes.key + row * MOST_PLANES
            found.append(TermPlanes(planes.value, planes.jacobian, rows, key, planes.bend, planes.bend_row + row))
        row += count
    return TermPlanes(*(np.concatenate(part) for part in zip(*found, strict=True))) if found else None

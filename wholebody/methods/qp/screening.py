"""What a search is bounded by, and which of many starts are worth a descent for the measures.

A posture that fits costs a few programs, and its measure tells which minimum it is near; a descent costs many. So of
`SEARCH.screened` times as many postures that fit, those with the least measures are descended from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.control import Control
from wholebody.methods.qp.iterates import LocalSolution


class Settings(NamedTuple):
    """What a search is bounded by; see `QP`."""

    tolerance: float
    iterations: int
    budget: int
    restarts: int
    seed: int
    measures: bool
    restarts_for_measure: int = 0


def least_measures(
    starts: Iterable[Array], probe: Callable[[Array], LocalSolution], tolerance: float, control: Control, count: int
) -> list[LocalSolution]:
    """Postures that fit, by probes from starts (nq,): so many of them, with the least measures first.

    Their `iterations` are those of all probes together, the first one's; those of the others are zero.
    """
    found, spent = list[LocalSolution](), 0
    for q in starts:
        if control.over:
            break
        local = probe(q)
        spent += local.iterations
        if local.violation.worst <= tolerance:
            found.append(local)
    best = sorted(found, key=lambda each: each.measure)[:count]
    return [with_values(local, iterations=spent if place == 0 else 0) for place, local in enumerate(best)]

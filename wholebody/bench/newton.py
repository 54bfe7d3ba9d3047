"""`wholebody bench newton`: what sparse Newton costs by size, shape and factorisation, in whole solves and in drags.

All times are the processor's, medians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wholebody.bench.newton_shapes import SHAPES, median_us
from wholebody.bench.newton_solves import AgreementRow, DragRow, SolveRow
from wholebody.bench.report import render
from wholebody.errors import WholebodyError
from wholebody.methods.newton.iteration import HARD_DAMPING
from wholebody.methods.newton.linear_algebra.base import LinearSystem
from wholebody.methods.newton.linear_algebra.choice import linear_algebra

SIZES = (10, 30, 100, 300, 1000)
SMALLEST_FITTED = 30  # bodies: smaller systems cost what any call costs
ALGEBRAS = ("normal", "llt", "kkt", "schur", "dense")
LARGEST_DENSE = 100  # bodies: more take seconds
LARGEST_STAR = 300  # bodies for which a star's full normal equations are still formed


@dataclass(frozen=True)
class LinearRow:
    """One factorisation on one structure.

    Attributes:
        shape: "chain", "tree", "ring" or "star".
        bodies: how many.
        algebra: name of the factorisation.
        variables, equations, nonzeros: of the Jacobian.
        fill: non-zeros of the factor.
        analyse_us: to lay out and analyse, once a structure [us].
        solve_us: to refill, factorise and solve [us].
    """

    shape: str
    bodies: int
    algebra: str
    variables: int
    equations: int
    nonzeros: int
    fill: int
    analyse_us: float
    solve_us: float


def linear_rows(sizes: tuple[int, ...], repeats: int) -> Iterator[LinearRow]:
    """Every factorisation on every shape and size."""
    for shape, make in SHAPES.items():
        for count in sizes:
            made = make(count)
            system = made.system()
            pattern = system.pattern
            rng = np.random.default_rng(0)
            task = LinearSystem(
                system.values(made.variables()),
                system.weight,
                np.full(pattern.height, HARD_DAMPING),
                np.zeros(pattern.width),
                rng.normal(size=pattern.height),
            )
            for name in ALGEBRAS:
                if name == "dense" and count > LARGEST_DENSE:
                    continue
                if shape == "star" and count > LARGEST_STAR and name in ("normal", "llt"):
                    continue
                if name == "schur" and shape != "star":
                    continue
                few = 2 if count >= LARGEST_STAR and name in ("normal", "llt") and shape == "star" else repeats
                analysed = median_us(partial(linear_algebra, pattern, name), 3)
                solver = linear_algebra(pattern, name)
                try:
                    solved = median_us(partial(solver.solve, task), few)
                except WholebodyError:
                    solved = float("nan")
                size = (pattern.width, pattern.height, len(pattern.rows))
                yield LinearRow(shape, count, name, *size, solver.fill, analysed, solved)


def exponent(rows: Sequence[LinearRow], shape: str, algebra: str) -> float:
    """Slope of log time over log bodies, from `SMALLEST_FITTED` bodies."""
    kept = [(row.bodies, row.solve_us) for row in rows if (row.shape, row.algebra) == (shape, algebra)]
    kept = [(n, t) for n, t in kept if n >= SMALLEST_FITTED and np.isfinite(t)]
    if len(kept) < 2:
        return float("nan")
    n, t = np.log(np.array(kept)).T
    return float(np.polyfit(n, t, 1)[0])


def report(
    linear: Sequence[LinearRow],
    solves: Sequence[SolveRow],
    agreements: Sequence[AgreementRow],
    drags: Sequence[DragRow],
    facts: Mapping[str, str],
) -> str:
    """Tables to read."""
    by_place = {(row.shape, row.bodies, row.algebra): row for row in linear}
    sizes = [
        (place, [by_place.get((*place, name)) for name in ALGEBRAS])
        for place in dict.fromkeys((row.shape, row.bodies) for row in linear)
    ]
    exponents = [(shape, [exponent(linear, shape, name) for name in ALGEBRAS[:4]]) for shape in SHAPES]
    return render(
        "newton.md", solves=solves, agreements=agreements, drags=drags, facts=facts, algebras=ALGEBRAS, sizes=sizes,
        exponents=exponents,
    )  # fmt: skip

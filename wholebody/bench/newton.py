"""`wholebody bench newton`: what sparse Newton costs by size, shape and factorisation, in whole solves and in drags.

All times are the processor's, medians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wholebody.bench.newton_drags import DragRow
from wholebody.bench.newton_shapes import SHAPES
from wholebody.bench.newton_solves import AgreementRow, SolveRow
from wholebody.bench.newton_time import median_us
from wholebody.bench.tables import markdown
from wholebody.errors import WholebodyError
from wholebody.methods.newton.linear_algebra.base import LinearSystem
from wholebody.methods.newton.linear_algebra.choice import linear_algebra
from wholebody.methods.newton.run import HARD_DAMPING

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
    parts = [
        f"Measured on {facts.get('processor', 'this machine')}; OMP_NUM_THREADS "
        f"{facts.get('OMP_NUM_THREADS', 'not set')}; numba {facts.get('numba', 'unknown')}. "
        "Processor's time, medians.",
        markdown(
            (
                "solve",
                "variables",
                "non-zeros",
                "iterations",
                "systems",
                "ms",
                "us a variable and system",
                "last errors",
            ),
            (
                (
                    s.case,
                    str(s.variables),
                    str(s.nonzeros),
                    f"{s.iterations:.0f}",
                    f"{s.systems:.0f}",
                    f"{s.ms:.2f}",
                    f"{s.us_each:.2f}",
                    s.errors,
                )
                for s in solves
            ),
        ),
        markdown(
            (
                "the same problem by newton and by qp",
                "newton ms",
                "qp ms",
                "joints apart [rad]",
                "measures apart, relative",
            ),
            (
                (a.case, f"{a.newton_ms:.0f}", f"{a.qp_ms:.0f}", f"{a.apart:.1e}", f"{a.measures_apart:.1e}")
                for a in agreements
            ),
        ),
        markdown(
            (
                "drag of the human's hand",
                "frames",
                "ms a frame",
                "95 % below",
                "Newton iterations",
                "frames in contact",
                "structures",
                "ms each",
                "greatest constraint error",
                "deepest overlap [mm]",
            ),
            (
                (
                    d.case,
                    str(d.frames),
                    f"{d.ms:.2f}",
                    f"{d.ms_95:.2f}",
                    f"{d.iterations:.2f}",
                    f"{100 * d.touching:.0f} %",
                    str(d.structures),
                    f"{d.structure_ms:.1f}",
                    f"{d.drift:.1e}",
                    f"{1e3 * d.deepest:.3f}",
                )
                for d in drags
            ),
        ),
        _linear_table(linear),
        markdown(
            ("shape", *(f"exponent, {name}" for name in ALGEBRAS[:4])),
            (
                (
                    shape,
                    *("" if np.isnan(e) else f"{e:.2f}" for e in (exponent(linear, shape, a) for a in ALGEBRAS[:4])),
                )
                for shape in SHAPES
            ),
        ),
    ]
    return "\n\n".join(part.strip() for part in parts)


def _linear_table(linear: Sequence[LinearRow]) -> str:
    by_place = {(row.shape, row.bodies, row.algebra): row for row in linear}
    rows = []
    for shape, bodies in dict.fromkeys((row.shape, row.bodies) for row in linear):
        found = [by_place.get((shape, bodies, name)) for name in ALGEBRAS]
        usual = next(row for row in found if row)
        cells = [f"{row.solve_us:.0f} ({row.fill})" if row else "" for row in found]
        rows.append((shape, str(bodies), str(usual.nonzeros), f"{1e-3 * usual.analyse_us:.1f}", *cells))
    names = ("shape", "bodies", "nnz(J)", "ms a new structure", *(f"{name} us (nnz(L))" for name in ALGEBRAS))
    return markdown(names, rows)

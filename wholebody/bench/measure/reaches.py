"""Random reaches among random objects, each with an answer that is known to exist.

A seed makes one reach. The upper body of a standing person is put at random within its limits until nothing touches;
where a fingertip is then becomes the target. Random objects are added that touch neither that posture (the witness) nor
the standing one. The witness holds both feet and keeps the clearance, so whoever does not find an answer has failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench import plot_style, statistics
from wholebody.bench.report import render
from wholebody.bench.statistics import Interval
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE, TIPS
from wholebody.bench.suite.problem_sets.reaching import THINGS, reach_among
from wholebody.bench.tables import filled, programs_text

TOLERANCE = 1e-5  # m, rad: what methods are asked for


@dataclass(frozen=True)
class Reach:
    """One reach and the posture that proves it possible, shape (nq,)."""

    seed: int
    problem: wb.Problem
    witness: Array


@dataclass(frozen=True)
class ReachRow:
    """What came of one reach; errors as judged independently, in m and rad.

    Attributes:
        seed: what it was made from.
        method: which, such as "qp" or "qp/osqp".
        programs: what closed its quadratic programs, and how many.
        how: "directly", "by feasibility first", "from another start", or the message of what was not solved.
        penetration: deepest overlap.
        clearance_violation: by how much the worst pair misses its clearance.
        constraint_violation: of the feet.
        measure, witness_measure: effort of the answer and of the witness.
    """

    seed: int
    method: str
    status: str
    how: str
    milliseconds: float
    iterations: int
    programs: str
    goal_error: float
    penetration: float
    clearance_violation: float
    limit_violation: float
    constraint_violation: float
    measure: float
    witness_measure: float

    @property
    def effort_ratio(self) -> float:
        """Effort of the answer over that of the witness."""
        return self.measure / self.witness_measure


def reach(seed: int, figure: wb.Figure | None = None) -> Reach:
    """Make one reach; the same seed makes the same one. The human may be given if it is loaded already."""
    problem, witness = reach_among(figure or wb.load("human"), TIPS[seed % len(TIPS)], np.random.default_rng(seed))
    return Reach(seed, problem, witness)


def solve_reach(seed: int, method: str, figure: wb.Figure | None = None) -> ReachRow:
    """Make and solve one reach with a fresh method."""
    made = reach(seed, figure)
    (adapter,) = adapters([method])
    solution = adapter.make(TOLERANCE, None).solve(made.problem)
    judged = wb.assess(made.problem, solution.q)
    return filled(
        ReachRow,
        solution,
        judged,
        seed=seed,
        method=method,
        programs=programs_text(solution.programs),
        how=solution.message.removeprefix("solved "),
        milliseconds=1e3 * solution.seconds,
        witness_measure=wb.assess(made.problem, made.witness).measure,
    )


def run(seeds: range, method: str, jobs: int = 1) -> Iterator[ReachRow]:
    """Solve the reaches of these seeds, in processes of their own where `jobs` is more than one; in order."""
    if jobs <= 1:
        figure = wb.load("human")
        for seed in seeds:
            yield solve_reach(seed, method, figure)
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(solve_reach, seeds, [method] * len(seeds), chunksize=4)


def reaches_report(rows: Sequence[ReachRow], facts: Mapping[str, str], jobs: int) -> str:
    """Table of the random reaches, and what was not solved."""

    def share(mine: Sequence[ReachRow]) -> Interval:
        return statistics.share([row.status == "solved" for row in mine])

    def time(mine: Sequence[ReachRow], part: float) -> Interval:
        return statistics.quantile([row.milliseconds for row in mine], part)

    return render(
        "reaches.md", rows=rows, facts=facts, jobs=jobs, things=THINGS, clearance=CLEARANCE, share=share, time=time
    )


def reach_times(rows: Sequence[ReachRow], path: Path) -> tuple[Path, Path]:
    """Share of the random reaches that were answered within a time."""
    chart, axes = plot_style.figure(1, 1, (6.4, 3.4))
    axis = axes[0][0]
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        times = np.sort([row.milliseconds for row in mine if row.status == "solved"])
        share = 100.0 * np.arange(1, len(times) + 1) / len(mine)
        color = plot_style.method_style(method).color
        axis.step(times, share, where="post", color=color, linewidth=1.8, label=method)
    plot_style.plain_log(axis)
    axis.set(ylim=(0.0, 103.0), xlabel="time of a solve [ms]", ylabel="reaches solved [%]")
    axis.legend(loc="lower right", frameon=False)
    return plot_style.save(chart, path)

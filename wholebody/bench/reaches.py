"""`wholebody bench reaches`: random reaches among random objects, each with an answer that is known to exist.

A seed makes one reach. The upper body of a standing person is put at random within its limits until nothing touches;
where a fingertip is then becomes the target. Random objects are added that touch neither that posture (the witness) nor
the standing one. The witness holds both feet and keeps the clearance, so whoever does not find an answer has failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.problem_sets.bodies import CLEARANCE, TIPS
from wholebody.bench.problem_sets.clutter import THINGS, reach_among
from wholebody.bench.report import render


@dataclass(frozen=True)
class Reach:
    """One reach and the posture that proves it possible, shape (nq,)."""

    seed: int
    problem: wb.Problem
    witness: Array


@dataclass(frozen=True)
class ReachRow:
    """What came of one reach.

    Attributes:
        seed: what it was made from.
        solver: of the QP method.
        status: as the method said.
        how: "directly", "by feasibility first", "from another start", or the message of what was not solved.
        milliseconds: of the solve.
        iterations: of the method.
        goal_error: distance left, as judged independently [m].
        penetration: deepest overlap, as judged [m].
        clearance_violation: by how much the worst pair misses its clearance, as judged [m].
        limit_violation: as judged [rad].
        constraint_violation: of the feet, as judged [m, rad].
        measure: effort of the answer.
        witness_measure: effort of the witness.
    """

    seed: int
    solver: str
    status: str
    how: str
    milliseconds: float
    iterations: int
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
    """Make one reach; the same seed makes the same one.

    Args:
        seed: of everything random in it.
        figure: the human, if it is loaded already.
    """
    problem, witness = reach_among(figure or wb.load("human"), TIPS[seed % len(TIPS)], np.random.default_rng(seed))
    return Reach(seed, problem, witness)


def solve_reach(seed: int, solver: str, figure: wb.Figure | None = None) -> ReachRow:
    """Make and solve one reach with a fresh method."""
    made = reach(seed, figure)
    solution = wb.QP(solver=solver).solve(made.problem)
    judged = wb.assess(made.problem, solution.q)
    how = solution.message.removeprefix("solved ")
    return ReachRow(
        seed=seed,
        solver=solver,
        status=solution.status,
        how=how,
        milliseconds=1e3 * solution.seconds,
        iterations=solution.iterations,
        goal_error=judged.goal_error,
        penetration=judged.penetration,
        clearance_violation=judged.clearance_violation,
        limit_violation=judged.limit_violation,
        constraint_violation=judged.constraint_violation,
        measure=judged.measure,
        witness_measure=wb.assess(made.problem, made.witness).measure,
    )


def run(seeds: range, solver: str, jobs: int = 1) -> Iterator[ReachRow]:
    """Solve the reaches of these seeds, in processes of their own where `jobs` is more than one; in order."""
    if jobs <= 1:
        figure = wb.load("human")
        for seed in seeds:
            yield solve_reach(seed, solver, figure)
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(solve_reach, seeds, [solver] * len(seeds), chunksize=4)


def reaches_report(rows: Sequence[ReachRow], facts: Mapping[str, str], jobs: int) -> str:
    """Table of the random reaches, and what was not solved."""
    return render("reaches.md", rows=rows, facts=facts, jobs=jobs, things=THINGS, clearance=CLEARANCE)

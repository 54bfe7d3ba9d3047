"""Recorded programs by every solver alone: no hot start, one solver after the other for each case, in turning order."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from tests.audits.qp_programs.recording import Recorded
from tests.audits.templates import TEMPLATES
from wholebody.bench.statistics import Interval, quantile, share
from wholebody.bench.tables import render
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import ACTIVE_SET, QPSolver
from wholebody.methods.qp.solvers.osqp_solver import ActiveSetSolver
from wholebody.methods.qp.solvers.registry import make_solver


class Residuals(NamedTuple):
    """How well an answer satisfies the optimality conditions of the split form, as qpsolvers defines them.

    Attributes:
        primal: largest violation of the box and of the rows [m, rad].
        dual: largest entry of the Lagrangian's gradient over the curvature there: the Newton step left [rad, m].
        gap: difference of the primal and the dual objective, as a share of the primal one.
    """

    primal: float
    dual: float
    gap: float


@dataclass(frozen=True)
class QPRow:
    """One program by one solver.

    Attributes:
        set, name: of the program.
        solver: which was asked.
        variables, soft, elastic: sizes of the program.
        wall_us, cpu_us: wall and processor's time of a solve, the correcting of the active set included [us].
        by: what closed the program.
        exact: whether the answer is exact.
        iterations: of the solver.
        own_error: how far the solver's own answer is from the exact one [rad, m]; nan where it has none.
        primal, dual, gap: see `Residuals`; of the final answer.
    """

    set: str
    name: str
    solver: str
    variables: int
    soft: int
    elastic: int
    wall_us: float
    cpu_us: float
    by: str
    exact: bool
    iterations: int
    own_error: float
    primal: float
    dual: float
    gap: float


def of(compute: Callable[[Sequence[QPRow]], Any]) -> dict[str, Any]:
    """What computes a field of `QPSummary` from its rows, as metadata."""
    return {"of": compute}


@dataclass(frozen=True)
class QPSummary:
    """All programs by one solver; times in microseconds.

    Attributes:
        closed: programs that the solver closed itself, its active set corrected.
        share: of them, with Wilson's interval.
        handed_on: programs that semismooth Newton steps closed, or another solver.
        failed: programs without an exact answer.
        median_us, p95_us: with intervals by the bootstrap.
    """

    solver: str
    programs: int = field(metadata=of(lambda rows: len(rows)))
    closed: int = field(metadata=of(lambda rows: sum(map(_by_itself, rows))))
    share: Interval = field(metadata=of(lambda rows: share([_by_itself(row) for row in rows])))
    handed_on: int = field(metadata=of(lambda rows: sum(row.exact and not _by_itself(row) for row in rows)))
    failed: int = field(metadata=of(lambda rows: sum(not row.exact for row in rows)))
    median_us: Interval = field(metadata=of(lambda rows: quantile([row.wall_us for row in rows], 0.5)))
    p95_us: Interval = field(metadata=of(lambda rows: quantile([row.wall_us for row in rows], 0.95)))
    cpu_median_us: float = field(metadata=of(lambda rows: np.median([row.cpu_us for row in rows])))
    cpu_p95_us: float = field(metadata=of(lambda rows: np.quantile([row.cpu_us for row in rows], 0.95)))
    iterations: float = field(metadata=of(lambda rows: np.median([row.iterations for row in rows])))
    own_error: float = field(metadata=of(lambda rows: _own(rows, 0.5)))
    own_worst: float = field(metadata=of(lambda rows: _own(rows, 1.0)))
    primal: float = field(metadata=of(lambda rows: max(row.primal for row in rows)))
    dual: float = field(metadata=of(lambda rows: max(row.dual for row in rows)))
    gap: float = field(metadata=of(lambda rows: max(row.gap for row in rows)))


def _by_itself(row: QPRow) -> bool:
    """Whether the solver that was asked closed a program."""
    return row.by == (ACTIVE_SET if row.solver == ActiveSetSolver.name else row.solver)


def _own(rows: Sequence[QPRow], part: float) -> float:
    """A quantile of how far the solver's own answers are off, of those that it has."""
    known = [row.own_error for row in rows if np.isfinite(row.own_error)]
    return float(np.quantile(known, part)) if known else float("nan")


def measure(
    programs: Sequence[Recorded], solvers: Sequence[str], say: Callable[[str], None] = lambda text: None
) -> list[QPRow]:
    """Give every program to every solver.

    A case's programs are solved in the order in which they were posed, by a solver that is made for the case and keeps
    its workspace, as in a solve. It is set up, and that is not counted, by the last program of the case.
    """
    rows: list[QPRow] = []
    done = ""
    for turn, mine in enumerate(_cases(programs)):
        shift = turn % len(solvers)
        for name in [*solvers[shift:], *solvers[:shift]]:
            solver = make_solver(name, hot_start=False)
            solver.load()
            solver.solve(mine[-1].program)
            rows += [_row(one, name, solver) for one in mine]
        if mine[0].set != done:
            done = mine[0].set
            say(f"{done}: {', '.join(solvers)}")
    return rows


def _cases(programs: Sequence[Recorded]) -> Iterator[list[Recorded]]:
    for _, mine in groupby(programs, key=lambda one: (one.set, one.case)):
        yield list(mine)


def _row(one: Recorded, name: str, solver: QPSolver) -> QPRow:
    program = one.program
    gc.disable()
    worked, clock = time.thread_time_ns(), time.perf_counter_ns()
    answer = solver.solve(program)
    wall, cpu = time.perf_counter_ns() - clock, time.thread_time_ns() - worked
    gc.enable()
    own = solver.uncorrected
    found = residuals(program, answer)
    return QPRow(
        one.set, one.name, name, program.size, len(program.target), len(program.least), wall / 1e3, cpu / 1e3,
        answer.by, answer.exact, answer.iterations,
        float("nan") if own is None else float(np.abs(own - answer.x).max(initial=0.0)), *found,
    )  # fmt: skip


def residuals(program: QuadraticProgram, answer: QPSolution) -> Residuals:
    """Optimality conditions of the split form at z = [x, T x - e, max(0, l - C x)].

    The multipliers of the rows follow from their residuals, w r and v s. Those of the box are what is left of the
    gradient at bounds that x is on, of the right sign.
    """
    x = answer.x
    r = program.rows @ x - program.target
    s = np.maximum(program.least - program.elastic @ x, 0.0)
    y, push = program.weight * r, program.elastic_weight * s
    pull = program.diagonal * x + program.linear + y @ program.rows - push @ program.elastic
    box = np.where(x >= program.upper, np.maximum(-pull, 0.0), 0.0) + np.where(
        x <= program.lower, np.minimum(-pull, 0.0), 0.0
    )
    held = box != 0.0  # a bound that holds nothing may be infinite
    low, high = program.lower[held], program.upper[held]
    outside = np.maximum(program.lower - x, x - program.upper)
    primal = 0.5 * (program.diagonal * x) @ x + program.linear @ x + 0.5 * y @ r + 0.5 * push @ s
    dual = (
        -0.5 * (program.diagonal * x) @ x - 0.5 * y @ r - 0.5 * push @ s - y @ program.target + push @ program.least
        - np.maximum(box[held], 0.0) @ np.where(box[held] > 0.0, high, 0.0)
        - np.minimum(box[held], 0.0) @ np.where(box[held] < 0.0, low, 0.0)
    )  # fmt: skip
    return Residuals(
        max(float(outside.max(initial=0.0)), 0.0),
        program.optimality(x),
        abs(float(primal - dual)) / max(abs(float(primal)), 1.0),
    )


def summaries(rows: Sequence[QPRow], solvers: Sequence[str]) -> list[QPSummary]:
    """One row a solver."""
    found = []
    for name in solvers:
        mine = [row for row in rows if row.solver == name]
        figures = {each.name: each.metadata["of"](mine) for each in fields(QPSummary) if each.metadata}
        found.append(QPSummary(name, **figures))
    return found


def qp_report(rows: Sequence[QPRow], totals: Sequence[QPSummary], facts: Mapping[str, str]) -> str:
    """All programs by every solver."""
    first = [row for row in rows if row.solver == totals[0].solver]
    medians = {
        name: float(np.median([getattr(row, name) for row in first])) for name in ("variables", "soft", "elastic")
    }
    return render("qp.md", TEMPLATES, totals=totals, programs=first, medians=medians, facts=facts)

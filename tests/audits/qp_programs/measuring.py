"""Recorded programs by every solver alone: no hot start, one solver after the other for each case, in turning order."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from tests.audits.qp_programs.recording import Recorded
from wholebody.bench.rows import Row
from wholebody.bench.rows import report as tables_of
from wholebody.bench.statistics import quantile, share
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import ACTIVE_SET, QPSolver
from wholebody.methods.qp.solvers.registry import ActiveSetSolver, make_solver


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


def _by_itself(row: Row) -> bool:
    """Whether the solver that was asked closed a program."""
    return bool(row["by"] == (ACTIVE_SET if row.tool == ActiveSetSolver.name else row.tool))


def _own(rows: Sequence[Row], part: float) -> float:
    """A quantile of how far the solver's own answers are off, of those that it has."""
    known = [row["own error"] for row in rows if np.isfinite(row["own error"])]
    return float(np.quantile(known, part)) if known else float("nan")


def measure(
    programs: Sequence[Recorded], solvers: Sequence[str], say: Callable[[str], None] = lambda text: None
) -> list[Row]:
    """Give every program to every solver: its sizes, microseconds by the clock and of the processor, what closed it.

    The own error is how far the solver's own answer is from the exact one [rad, m]; nan where it has none.

    A case's programs are solved in the order in which they were posed, by a solver that is made for the case, as in a
    solve. It is set up, and that is not counted, by the last program of the case.
    """
    rows: list[Row] = []
    done = ""
    for turn, mine in enumerate(_cases(programs)):
        shift = turn % len(solvers)
        for name in [*solvers[shift:], *solvers[:shift]]:
            solver = make_solver(name)
            solver.solve_cold(mine[-1].program)
            rows += [_row(one, name, solver) for one in mine]
        if mine[0].set != done:
            done = mine[0].set
            say(f"{done}: {', '.join(solvers)}")
    return rows


def _cases(programs: Sequence[Recorded]) -> Iterator[list[Recorded]]:
    for _, mine in groupby(programs, key=lambda one: (one.set, one.case)):
        yield list(mine)


def _row(one: Recorded, name: str, solver: QPSolver) -> Row:
    program = one.program
    gc.disable()
    worked, clock = time.thread_time_ns(), time.perf_counter_ns()
    answer = solver.solve_cold(program)
    wall, cpu = time.perf_counter_ns() - clock, time.thread_time_ns() - worked
    gc.enable()
    own = solver.uncorrected
    found = residuals(program, answer)
    error = float("nan") if own is None else float(np.abs(own - answer.x).max(initial=0.0))
    sizes = {"set": one.set, "variables": program.size, "soft": len(program.target), "elastic": len(program.least)}
    times = {"wall µs": wall / 1e3, "cpu µs": cpu / 1e3, "by": answer.by, "exact": answer.exact}
    return Row(
        one.name, name, {**sizes, **times, "iterations": answer.iterations, "own error": error, **found._asdict()}
    )


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


def summaries(rows: Sequence[Row], solvers: Sequence[str]) -> list[Row]:
    """One row a solver, with intervals: of the share by Wilson, of quantiles by the bootstrap."""
    found = []
    for name in solvers:
        mine = [row for row in rows if row.tool == name]
        closed = [_by_itself(row) for row in mine]
        figures = {
            "exact by itself": share(closed),
            "handed on": sum(row["exact"] and not own for row, own in zip(mine, closed, strict=True)),
            "not exact": sum(not row["exact"] for row in mine),
            "median µs": quantile([row["wall µs"] for row in mine], 0.5),
            "p95 µs": quantile([row["wall µs"] for row in mine], 0.95),
            "iterations": float(np.median([row["iterations"] for row in mine])),
            "own answer off by, median": _own(mine, 0.5),
            "worst": _own(mine, 1.0),
        }
        found.append(Row(name, "", figures))
    return found


def qp_report(rows: Sequence[Row], totals: Sequence[Row], facts: Mapping[str, str]) -> str:
    """All programs by every solver."""
    first = [row for row in rows if row.tool == totals[0].case]
    sizes = ", ".join(
        f"{np.median([row[name] for row in first]):.0f} {name}" for name in ("variables", "soft", "elastic")
    )
    most = ", ".join(f"{name} {max(row[name] for row in rows):.0e}" for name in Residuals._fields)
    about = (
        f"{len(first)} programs of {len({row['set'] for row in first})} problem sets; sizes in the median: {sizes}. "
        "Every solver alone, without a hot start, in turning order. Times "
        "include the correction of the active set. *Own answer off by* is how far the solver's answer was from the "
        f"exact one before its active set was corrected. Largest residuals of answers: {most}."
    )
    return tables_of(about, {"": totals}, facts)

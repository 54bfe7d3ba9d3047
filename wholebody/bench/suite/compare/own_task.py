"""Methods beside each other on a task of one's own: each in a process of its own, cold and warm, judged in one way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from pathlib import Path

import numpy as np

from wholebody.assessment.posture import assess
from wholebody.base.compiled import compile_all
from wholebody.base.runner import ONE_THREAD, Child, EndedError, allow, allow_processor
from wholebody.bench import rows as tables
from wholebody.bench.rows import Figure, Panel, Row, texts
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.results import ANSWERED, COARSE, DEFAULT, FAILED, OVERTIME, Record
from wholebody.bench.suite.compare.solving import BUILDING, Ready, solve
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.problem import Problem
from wholebody.taskfile import read_task

REPEATS = 5  # warm solves, of which the median counts


def compared(
    path: Path, adapters: Iterable[Adapter], cap: float = 20.0, tell: Callable[[str], None] = lambda name: None
) -> list[Row]:
    """Every method on the problem of a task file, for `cap` s of the processor: solved ones by time, then by error."""
    read_task(path)
    rows = []
    for adapter in adapters:
        tell(adapter.name)
        child = Child(ONE_THREAD)  # a new one each: what another method has imported does not shorten the first solve
        try:
            first, records = child.call(_solved, path, adapter, cap, seconds=BUILDING)
            rows.append(_row(adapter.name, first, records))
        except EndedError as error:
            outcome = OVERTIME if error.overtime else FAILED
            said = f"ended after {cap:g} s" if error.overtime else str(error)
            rows.append(_row(adapter.name, {}, [Record("task", 0, adapter.name, DEFAULT[0], 0, outcome, said=said)]))
        finally:
            child.close()
    return sorted(rows, key=_order)


def _order(row: Row) -> tuple[bool, float, str]:
    solved = row["outcome"] == "solved"
    return not solved, float(row["warm ms"] if solved else row["worst"] if "worst" in row.figures else inf), row.tool


def _solved(path: Path, adapter: Adapter, cap: float) -> tuple[dict[str, Figure], list[Record]]:
    """Time of the first solve, set-up and imports included, and peak memory; all records. A job of its own process."""
    allow(BUILDING)
    compile_all()
    made = _ready(read_task(path).problem)
    allow_processor(cap)
    began = time.perf_counter()
    records = [solve(adapter, DEFAULT, made)[0]]
    first: dict[str, Figure] = {"cold ms": 1e3 * (time.perf_counter() - began)}
    for _ in range(REPEATS if records[0].outcome == ANSWERED else 0):
        allow_processor(cap)
        records.append(solve(adapter, DEFAULT, made)[0])
    status = Path("/proc/self/status")
    if status.is_file():  # Linux
        peak = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        first["peak MB"] = float(peak.split()[1]) * 1024.0 / 1e6
    return first, records


def _ready(problem: Problem) -> Ready:
    """The problem as a case; a task has no witness, and its start stands in its place, which nothing here uses."""
    with problem.borrow():
        pass
    assess(problem, problem.start)
    return Ready(Case("task", 0, problem, problem.start), inf)


def _row(name: str, first: Mapping[str, Figure], records: Sequence[Record]) -> Row:
    """One method: its outcome, its times, and the remaining errors, as judged; no figures where there is no answer."""
    last, warm = records[-1], [1e3 * record.seconds for record in records[1:]]
    if last.outcome != ANSWERED:
        return Row("task", name, {"outcome": last.outcome, "said": last.said})
    outcome = "not solved" if last.status == "solved" else last.status
    figures: dict[str, Figure] = {
        "outcome": "solved" if last.success(COARSE) else outcome,
        "said": last.said,
        "warm ms": float(np.median(warm)),
        "least ms": min(warm),
        "most ms": max(warm),
        **first,
        "set-up ms": 1e3 * float(np.median([record.setup_seconds for record in records])),
        "goals mm": 1e3 * last.goal_error,
        "goals mrad": 1e3 * last.goal_angle,
        "overlap mm": 1e3 * last.penetration,
        "clearance missed mm": 1e3 * last.clearance_violation,
        "limits and constraints 1e-3": 1e3 * max(last.limit_violation, last.constraint_violation),
        "effort": last.measure,
        "worst": last.worst,
    }
    return Row("task", name, figures)


def report(rows: Sequence[Row], title: str, facts: Mapping[str, str], cap: float = 20.0) -> str:
    """The table as Markdown, refusals and failures below it; `cap` is that of `compared`."""
    about = texts()["own_task"].format(repeats=REPEATS, tolerance=DEFAULT[0], coarse=COARSE, cap=cap)
    answered = [Row(title, row.tool, row.figures) for row in rows if "worst" in row.figures]
    silent = [f"`{row.tool}`, {row['outcome']}: {row['said']}" for row in rows if "worst" not in row.figures]
    return tables.report(f"# {title[:1].upper()}{title[1:]}\n\n{about}", {"": answered}, facts, silent)


def panels(rows: Sequence[Row], title: str) -> list[Panel]:
    """Worst errors over times, warm and cold, of the methods that answer."""
    answered = [row for row in rows if "worst" in row.figures]
    return [
        Panel(
            f"{title}: {name}", "time of a solve [ms]", "worst error [m or rad]",
            {row.tool: ([row[f"{name} ms"]], [row["worst"]]) for row in answered}, "xy", "o", [COARSE],
        )
        for name in ("warm", "cold")
    ]  # fmt: skip

"""Methods beside each other on a task of one's own: each in a process of its own, cold and warm, judged in one way.

One problem says how methods do on it, and nothing of others. The spread of a time is over repeated solves of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.assessment.posture import assess
from wholebody.base.compiled import compile_all
from wholebody.base.runner import ONE_THREAD, Child, EndedError, allow, allow_processor
from wholebody.bench import plot_style
from wholebody.bench.plot_style import method_style
from wholebody.bench.report import render
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.record import ANSWERED, COARSE, DEFAULT, FAILED, FLOOR, OVERTIME, Record
from wholebody.bench.suite.compare.solving import BUILDING, Ready, solve
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.problem import Problem
from wholebody.taskfile import read_task

REPEATS = 5  # warm solves, of which the median counts
CAP = 20.0  # s of the processor's time: after which a solve is ended
NAME = "task"
GREY = "#666666"


@dataclass(frozen=True)
class TaskRow:
    """One method on the task.

    Attributes:
        method: name of the method.
        outcome: "solved", the status that the method gives, or "refused", "failed", "overtime"; "not solved" where the
            method calls solved what is judged to be none.
        said: the refusal, the exception, or the message of the method.
        cold_ms: first solve in a process, with what it imports and builds; NaN without an answer.
        warm_ms, least_ms, most_ms: median, least and greatest of the later solves.
        setup_ms: to build a model of its own, in none of these; median.
        goal_mm, goal_mrad: what is left of the goals, as judged.
        overlap_mm: deepest overlap.
        short_mm: greatest lack of clearance.
        broken: worst violation of a limit or a constraint [1e-3 m or rad].
        effort: the sum of the measures.
        worst: the worst error of all that is asked and that must hold [m or rad]; infinite without an answer.
    """

    method: str
    outcome: str
    said: str
    cold_ms: float
    warm_ms: float
    least_ms: float
    most_ms: float
    setup_ms: float
    goal_mm: float
    goal_mrad: float
    overlap_mm: float
    short_mm: float
    broken: float
    effort: float
    worst: float

    @property
    def solved(self) -> bool:
        """Whether goals are met and everything held to 1e-3, as judged."""
        return self.worst <= COARSE


def compared(
    path: Path, adapters: Iterable[Adapter], cap: float = CAP, tell: Callable[[str], None] = lambda name: None
) -> list[TaskRow]:
    """Every method on the problem of a task file: what solves it first, by time; then by the worst error.

    Args:
        path: the task file.
        adapters: the methods.
        cap: seconds of the processor's time after which a solve is ended.
        tell: is told the name of each method before it begins.

    Raises:
        WholebodyError: the task file cannot be read; nothing has been solved then.
    """
    read_task(path)
    rows = []
    for adapter in adapters:
        tell(adapter.name)
        child = Child(ONE_THREAD)  # a new one each: what another method has imported does not shorten the first solve
        try:
            cold, records = child.call(_solved, path, adapter, cap, seconds=BUILDING)
            rows.append(_row(adapter.name, cold, records))
        except EndedError as error:
            outcome = OVERTIME if error.overtime else FAILED
            said = f"ended after {cap:g} s" if error.overtime else str(error)
            rows.append(_row(adapter.name, inf, [Record(NAME, 0, adapter.name, DEFAULT[0], 0, outcome, said=said)]))
        finally:
            child.close()
    return sorted(rows, key=lambda row: (not row.solved, row.warm_ms if row.solved else row.worst, row.method))


def _solved(path: Path, adapter: Adapter, cap: float) -> tuple[float, list[Record]]:
    """Seconds of the first solve, set-up and imports included, and all records; a job of a process of its own."""
    allow(BUILDING)
    compile_all()
    made = _ready(read_task(path).problem)
    allow_processor(cap)
    began = time.perf_counter()
    records = [solve(adapter, DEFAULT, made)]
    cold = time.perf_counter() - began
    for _ in range(REPEATS if records[0].outcome == ANSWERED else 0):
        allow_processor(cap)
        records.append(solve(adapter, DEFAULT, made))
    return cold, records


def _ready(problem: Problem) -> Ready:
    """The problem as a case; a task has no witness, and its start stands in its place, which nothing here uses."""
    with problem.borrow():
        pass
    assess(problem, problem.start)
    return Ready(Case(NAME, 0, problem, problem.start), inf)


def _row(name: str, cold: float, records: Sequence[Record]) -> TaskRow:
    last, warm = records[-1], [1e3 * record.seconds for record in records[1:]]
    if last.outcome != ANSWERED:
        outcome = last.outcome
    elif last.success(COARSE):
        outcome = "solved"
    else:
        outcome = "not solved" if last.status == "solved" else last.status
    judged = last.outcome == ANSWERED

    def shown(value: float, scale: float = 1e3) -> float:
        return scale * value if judged else nan

    return TaskRow(
        method=name,
        outcome=outcome,
        said=last.said,
        cold_ms=shown(cold),
        warm_ms=float(np.median(warm)) if warm else nan,
        least_ms=min(warm, default=nan),
        most_ms=max(warm, default=nan),
        setup_ms=shown(float(np.median([record.setup_seconds for record in records]))),
        goal_mm=shown(last.goal_error),
        goal_mrad=shown(last.goal_angle),
        overlap_mm=shown(last.penetration),
        short_mm=shown(last.clearance_violation),
        broken=shown(max(last.limit_violation, last.constraint_violation)),
        effort=shown(last.measure, 1.0),
        worst=last.worst,
    )


def report(rows: Sequence[TaskRow], title: str, facts: Mapping[str, str], cap: float = CAP) -> str:
    """The table as Markdown, refusals and failures below it."""
    answered = [row for row in rows if isfinite(row.worst)]
    silent = [row for row in rows if row not in answered]
    return render(
        "own_task.md", answered=answered, silent=silent, title=title, facts=facts, repeats=REPEATS, cap=cap,
        tolerance=DEFAULT[0], coarse=COARSE,
    )  # fmt: skip


def chart(rows: Sequence[TaskRow], title: str, path: Path) -> tuple[Path, Path]:
    """Times and worst errors, a row a method; those without an answer are named and have no marker.

    Args:
        rows: as `compared` gives them.
        title: over the chart.
        path: file, whose suffix is replaced by svg and png.
    """
    drawn, axes = plot_style.figure(1, 2, (10.0, 1.6 + 0.32 * len(rows)))
    times, errors = axes[0]
    for place, row in enumerate(rows):
        if not isfinite(row.worst):
            for panel in (times, errors):
                panel.text(0.5, place, row.outcome, transform=panel.get_yaxis_transform(), ha="center", va="center",
                           color=GREY, fontsize=9)  # fmt: skip
            continue
        seen = method_style(row.method)
        times.plot([row.least_ms, row.most_ms], [place, place], color=seen.color, linewidth=5.0, alpha=0.3)
        marks: dict[str, Any] = {"marker": seen.marker, "linestyle": "", "color": seen.color}
        times.plot([row.warm_ms], [place], **marks)
        times.plot([row.cold_ms], [place], **marks, fillstyle="none")
        errors.plot([max(row.worst, FLOOR)], [place], **marks, fillstyle="full" if row.solved else "none")
    for panel in (times, errors):
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.set_yticks(range(len(rows)), [row.method if panel is times else "" for row in rows])
        panel.grid(axis="y", visible=False)
    plot_style.plain_log(times)
    errors.set_xscale("log")
    errors.axvline(COARSE, color=GREY, linewidth=0.9, linestyle="--")
    times.set(xlabel="time of a solve [ms]: filled warm, empty cold")
    errors.set(xlabel="worst error [m or rad]; solved up to the dashed line")
    drawn.suptitle(title, x=0.01, ha="left", fontsize=13)
    return plot_style.save(drawn, path)

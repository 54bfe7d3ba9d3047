"""`wholebody bench step`: the same 200-step reach by every tool, interleaved in one process."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from wholebody.arrays import Array
from wholebody.bench import track as setting
from wholebody.bench.adapters import make_tool
from wholebody.bench.adapters.base import Tool
from wholebody.bench.closed import said
from wholebody.bench.judge import Verdict, judge
from wholebody.bench.report import render
from wholebody.bench.track import CLEARANCE, Track

REFERENCE = "placo"
JUDGED = ("free", "contact")  # reaches for which a figure was asked


@dataclass(frozen=True)
class StepRow:
    """What one tool did on one reach, over all repeats.

    Attributes:
        reach: "free", "contact" or "alone".
        tool: its name.
        repeats: timed runs.
        steps: of each.
        pairs: of pieces, that could touch.
        setup_ms: median time to set the tool up and make its first step, which is not among the others [ms].
        median_us: median wall time of a step [us].
        p95_us: the time that 95 % of all steps stayed below [us].
        cpu_median_us: median time of a step that the processor worked on it, without waiting for other work [us].
        cpu_p95_us: 95 % of all steps stayed below [us].
        ratio: median_us over the reference's in the same repeat, median of the repeats; nan without the reference.
        ratio_p95: the same of p95.
        cpu_ratio_p95: the same of the processor's time.
        least_mm: least distance of any pair after any step [mm].
        penetrating: steps after which some pair overlapped.
        final_error_mm: distance of the fingertip from the last target [mm].
        mean_error_mm: mean over the steps [mm].
        foot_drift_mm: greatest distance of a foot from where it stood [mm].
        limit_violation: greatest excess over a joint limit [rad].
        root_speed: greatest speed of the root, as a share of the bound.
        acceleration: mean of all joints' absolute accelerations [rad/s^2].
        near: mean number of pairs nearer than what counts.
        touching: mean number of pairs in contact.
        failures: steps for which the tool found no answer.
        rows: mean number of contact rows; nan where the tool does not tell.
        exact: share of steps whose program was solved to rounding; nan where it does not tell.
        programs: what closed its programs, and how many; empty where it does not tell.
    """

    reach: str
    tool: str
    repeats: int
    steps: int
    pairs: int
    setup_ms: float
    median_us: float
    p95_us: float
    cpu_median_us: float
    cpu_p95_us: float
    ratio: float
    ratio_p95: float
    cpu_ratio_p95: float
    least_mm: float
    penetrating: int
    final_error_mm: float
    mean_error_mm: float
    foot_drift_mm: float
    limit_violation: float
    root_speed: float
    acceleration: float
    near: float
    touching: float
    failures: int
    rows: float
    exact: float
    programs: str


@dataclass(frozen=True)
class StepTime:
    """One step: wall time and processor's time [us], and the least distance after it [mm]."""

    reach: str
    tool: str
    repeat: int
    step: int
    wall_us: float
    cpu_us: float
    least_mm: float


@dataclass(frozen=True)
class _Run:
    """One run of one tool."""

    wall: Array
    cpu: Array
    setup: float
    postures: Array
    tool: Tool


def measure(
    track: Track, tools: Sequence[str], repeats: int, say: Callable[[str], None] = lambda text: None
) -> tuple[list[StepRow], list[StepTime]]:
    """Let every tool make a reach a number of times.

    In every repeat each tool makes the whole reach once, from a fresh set-up and from standing; the order of the tools
    rotates from repeat to repeat. One step of each set-up is made before the clock starts. A first round, in which
    code and data come into the caches, is not counted.

    Args:
        track: the reach.
        tools: names.
        repeats: timed runs of each.
        say: takes a line about each repeat.
    """
    runs: dict[str, list[_Run]] = {name: [] for name in tools}
    for repeat in range(repeats + 1):
        shift = repeat % len(tools)
        for name in [*tools[shift:], *tools[:shift]]:
            run = _run(track, name)
            if repeat:
                runs[name].append(run)
        if repeat:
            medians = ", ".join(f"{name} {np.median(runs[name][-1].wall):.0f}" for name in tools)
            say(f"{track.name}, repeat {repeat} of {repeats}, us a step: {medians}")
    rows, times = [], []
    for name in tools:
        verdict = judge(track, runs[name][0].postures)
        rows.append(_row(track, name, runs, verdict))
        for repeat, run in enumerate(runs[name], start=1):
            for step in range(len(run.wall)):
                least = 1e3 * float(verdict.least_distance[step])
                times.append(
                    StepTime(track.name, name, repeat, step + 1, float(run.wall[step]), float(run.cpu[step]), least)
                )
    return rows, times


def _run(track: Track, name: str) -> _Run:
    steps = len(track.targets)
    wall, cpu = np.empty(steps), np.empty(steps)
    postures = np.empty((steps, track.scene.model.nq))
    with _quiet():
        began = time.perf_counter()
        tool = make_tool(name, track)
        tool.step(track.targets[0])
        setup = time.perf_counter() - began
        tool.reset(track.start)
        for number, target in enumerate(track.targets):
            worked, clock = time.thread_time_ns(), time.perf_counter_ns()
            tool.step(target)
            wall[number] = time.perf_counter_ns() - clock
            cpu[number] = time.thread_time_ns() - worked
            postures[number] = tool.posture()
    return _Run(wall / 1e3, cpu / 1e3, setup, postures, tool)


@contextmanager
def _quiet() -> Iterator[None]:
    """No garbage collection and no log lines while the clock runs."""
    gc.collect()
    gc.disable()
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
        gc.enable()


def _row(track: Track, name: str, runs: dict[str, list[_Run]], verdict: Verdict) -> StepRow:
    mine, reference = runs[name], runs.get(REFERENCE)
    wall = np.concatenate([run.wall for run in mine])
    cpu = np.concatenate([run.cpu for run in mine])
    told = mine[0].tool.remarks()
    return StepRow(
        reach=track.name,
        tool=name,
        repeats=len(mine),
        steps=len(track.targets),
        pairs=int(told.get("pairs", track.pairs)),
        setup_ms=1e3 * float(np.median([run.setup for run in mine])),
        median_us=float(np.median(wall)),
        p95_us=float(np.quantile(wall, 0.95)),
        cpu_median_us=float(np.median(cpu)),
        cpu_p95_us=float(np.quantile(cpu, 0.95)),
        ratio=_ratio(mine, reference, lambda run: float(np.median(run.wall))),
        ratio_p95=_ratio(mine, reference, lambda run: float(np.quantile(run.wall, 0.95))),
        cpu_ratio_p95=_ratio(mine, reference, lambda run: float(np.quantile(run.cpu, 0.95))),
        least_mm=1e3 * float(verdict.least_distance.min()),
        penetrating=int((verdict.least_distance < 0.0).sum()),
        final_error_mm=1e3 * float(verdict.error[-1]),
        mean_error_mm=1e3 * float(verdict.error.mean()),
        foot_drift_mm=1e3 * verdict.foot_drift,
        limit_violation=verdict.limit_violation,
        root_speed=verdict.fastest_root,
        acceleration=verdict.acceleration,
        near=float(verdict.near.mean()),
        touching=float(verdict.touching.mean()),
        failures=mine[0].tool.failures,
        rows=told.get("rows", float("nan")),
        exact=told.get("exact", float("nan")),
        programs=said(mine[0].tool.programs()),
    )


def _ratio(mine: list[_Run], reference: list[_Run] | None, figure: Callable[[_Run], float]) -> float:
    if reference is None:
        return float("nan")
    return float(np.median([figure(run) / figure(other) for run, other in zip(mine, reference, strict=True)]))


def goal_lines(rows: Sequence[StepRow]) -> list[str]:
    """What was to be reached and what was: one line for each of our solvers on each reach."""
    lines = []
    for row in rows:
        if not row.tool.startswith("wholebody") or row.reach not in JUDGED:
            continue
        asked = [
            ("median", row.ratio, 0.5, row.ratio <= 0.5),
            ("p95", row.ratio_p95, 1.0, row.ratio_p95 <= 1.0),
        ]
        parts = [
            f"{name} {value:.2f} of {REFERENCE}'s (at most {most:g}: {'reached' if met else 'missed'})"
            for name, value, most, met in asked
            if np.isfinite(value)
        ]
        if row.reach == "contact":
            share = row.least_mm / (1e3 * CLEARANCE)
            met = "reached" if share >= 0.9 else "missed"
            parts.append(f"least distance {share:.2f} of the clearance (at least 0.9: {met})")
        lines.append(f"{row.tool}, {row.reach}: " + ("; ".join(parts) or "nothing to compare with") + ".")
    return lines


def step_report(
    rows: Sequence[StepRow], facts: Mapping[str, str], differences: Mapping[str, Sequence[str]],
    profile: Mapping[str, tuple[float, float]],
) -> str:  # fmt: skip
    """Tables of the tracking steps.

    Args:
        rows: of all tools and reaches.
        facts: of the machine.
        differences: tool -> what it cannot express.
        profile: reach -> median of a whole step and of its linearisation [us].
    """
    tools = dict.fromkeys(row.tool for row in rows)
    stated = [line for name in tools for line in differences.get(name, ())]
    return render(
        "step.md", rows=rows, facts=facts, stated=stated, profile=profile, goals=goal_lines(rows), track=setting
    )

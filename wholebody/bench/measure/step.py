"""`wholebody bench step`: the same 200-step reach by every tool, interleaved in one process."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wholebody.base.errors import InputError
from wholebody.bench import plot_style
from wholebody.bench.measure import track as setting
from wholebody.bench.measure.track import CLEARANCE, DT, Track, Verdict, judge
from wholebody.bench.report import render
from wholebody.bench.statistics import BLOCK, NOTHING, Interval, quantile_ratio
from wholebody.bench.suite.adapters.base import Tool
from wholebody.bench.suite.adapters.own import WholebodyTool
from wholebody.bench.suite.adapters.registry import make_tool
from wholebody.bench.tables import filled, programs_text

REFERENCE = "placo"
TURN = 50
"""Steps that a tool makes before the next one does. Fewer: nearer in time, and more steps whose data others pushed out
of the caches; these are 2 %, so that they do not make the p95."""

GREY = "#666666"
THICK = "wholebody"  # drawn wide and first: with other solvers the same programs have the same answers, and hide it


@dataclass(frozen=True)
class StepRow:
    """What one tool did on one reach, over all repeats; units are in the names, speeds are shares of their bounds.

    Attributes:
        pairs: of pieces, that could touch.
        setup_ms: to set the tool up and make its first step, which is not among the others; median.
        median_us, p95_us, cpu_median_us, cpu_p95_us: of all steps, by the clock and by the processor's time.
        ratio, ratio_p95, cpu_ratio, cpu_ratio_p95: of median_us, p95_us, cpu_median_us and cpu_p95_us to the
            reference's in the same repeat, median of the repeats, with the interval of 95 %, as
            `quantile_ratio` has it; nan without the reference. By the clock they mean nothing where others
            use the processor too, who interrupt long steps more often than short ones.
        least_mm: least distance of any pair after any step.
        penetrating: steps after which some pair overlapped.
        final_error_mm, mean_error_mm: distance of the fingertip from its target.
        foot_drift_mm: greatest distance of a foot from where it stood.
        limit_violation: greatest excess over a joint limit [rad].
        acceleration: mean of all joints' absolute accelerations [rad/s^2].
        near, touching: mean number of pairs nearer than what counts, and in contact.
        failures: steps for which the tool found no answer.
        rows, exact: mean number of contact rows, and share of steps whose program was solved to rounding; nan where
            the tool does not tell.
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
    ratio: Interval
    ratio_p95: Interval
    cpu_ratio: Interval
    cpu_ratio_p95: Interval
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


class _Run:
    """One run of one tool.

    Attributes:
        wall: (steps,) by the clock [us].
        cpu: (steps,) of the processor [us].
        setup: seconds.
        postures: (steps, nq) after each step.
        tool: which went there.
    """

    def __init__(self, track: Track, name: str) -> None:
        """Set the tool up, make a first step and go back to the start."""
        steps = len(track.targets)
        self.wall, self.cpu = np.zeros(steps), np.zeros(steps)
        self.postures, self._targets = np.empty((steps, track.scene.model.nq)), track.targets
        began = time.perf_counter()
        self.tool: Tool = make_tool(name, track)
        self.tool.step(track.targets[0])
        self.setup = time.perf_counter() - began
        self.tool.reset(track.start)

    def go_on(self, first: int, last: int) -> None:
        """Make these steps, without the last."""
        for number in range(first, last):
            target = self._targets[number]
            worked, clock = time.thread_time_ns(), time.perf_counter_ns()
            self.tool.step(target)
            self.wall[number] = 1e-3 * (time.perf_counter_ns() - clock)
            self.cpu[number] = 1e-3 * (time.thread_time_ns() - worked)
            self.postures[number] = self.tool.posture()


def measure(
    track: Track, tools: Sequence[str], repeats: int, say: Callable[[str], None] = lambda text: None
) -> tuple[list[StepRow], list[StepTime]]:
    """Let every tool make a reach a number of times; `say` takes a line about each repeat.

    In every repeat each tool makes the whole reach once, from a fresh set-up and from standing. They take turns of
    `TURN` steps, so that the machine is as fast for one as for the other; their order rotates from turn to turn. One
    step of each set-up is made before the clock starts. A first round, in which code and data come into the caches, is
    not counted.
    """
    runs: dict[str, list[_Run]] = {name: [] for name in tools}
    for repeat in range(repeats + 1):
        beside = _beside(track, tools, repeat)
        if repeat:
            for name, run in beside.items():
                runs[name].append(run)
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


def _beside(track: Track, tools: Sequence[str], shift: int) -> dict[str, _Run]:
    """A run of each tool, in turns; the first turn begins with the tool number `shift`."""
    steps = len(track.targets)
    with quiet():
        runs = {name: _Run(track, name) for name in tools}
        for turn, first in enumerate(range(0, steps, TURN), start=shift):
            begin = turn % len(tools)
            for name in [*tools[begin:], *tools[:begin]]:
                runs[name].go_on(first, min(first + TURN, steps))
    return runs


@contextmanager
def quiet() -> Iterator[None]:
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
    wall, cpu = (np.concatenate([getattr(run, clock) for run in mine]) for clock in ("wall", "cpu"))
    told = mine[0].tool.remarks()
    return filled(
        StepRow,
        verdict,
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
        ratio=_ratio(mine, reference, "wall", 0.5),
        ratio_p95=_ratio(mine, reference, "wall", 0.95),
        cpu_ratio=_ratio(mine, reference, "cpu", 0.5),
        cpu_ratio_p95=_ratio(mine, reference, "cpu", 0.95),
        least_mm=1e3 * float(verdict.least_distance.min()),
        penetrating=int((verdict.least_distance < 0.0).sum()),
        final_error_mm=1e3 * float(verdict.error[-1]),
        mean_error_mm=1e3 * float(verdict.error.mean()),
        foot_drift_mm=1e3 * verdict.foot_drift,
        root_speed=verdict.fastest_root,
        near=float(verdict.near.mean()),
        touching=float(verdict.touching.mean()),
        failures=mine[0].tool.failures,
        programs=programs_text(mine[0].tool.programs()),
        **{name: told.get(name, float("nan")) for name in ("rows", "exact")},
    )


def _ratio(mine: list[_Run], reference: list[_Run] | None, clock: str, share: float) -> Interval:
    """Quantile of a clock over that of the reference in the same repeat."""
    if reference is None:
        return NOTHING
    one, other = (np.array([getattr(run, clock) for run in runs]) for runs in (mine, reference))
    return quantile_ratio(one, other, share)


def step_report(
    rows: Sequence[StepRow], facts: Mapping[str, str], differences: Mapping[str, Sequence[str]],
    profile: Mapping[str, tuple[float, float]], refusals: Mapping[str, Mapping[str, str]] | None = None,
    goals: Sequence[str] = (),
) -> str:  # fmt: skip
    """Tables of the tracking steps.

    Args:
        rows: of all reaches.
        facts: on the machine.
        differences: what tools cannot express.
        profile: median of a whole step and of its linearisation, by reach [us].
        refusals: of reaches of other figures than the human: the sentences of tools that do not take them, by reach
            and tool; None for the reaches of the human.
        goals: sentences of `goal_lines`.
    """
    tools = dict.fromkeys(row.tool for row in rows)
    stated = [line for name in tools for line in differences.get(name, ())]
    return render(
        "step.md", rows=rows, facts=facts, stated=stated, profile=profile, goals=goals, track=setting,
        refusals=refusals, block=BLOCK, turn=TURN,
    )  # fmt: skip


def taking(track: Track, tools: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """The tools that take a reach, and the sentences of those that do not.

    A tool takes it if it can be set up and makes a first step.
    """
    taken, refused = [], {}
    for name in tools:
        try:
            with quiet():
                make_tool(name, track).step(track.targets[0])
            taken.append(name)
        except (InputError, RuntimeError, ValueError) as error:
            refused[name] = " ".join(str(error).split()).rstrip(".")
    return taken, refused


WITHIN_STEP = 0.06  # m beyond the clearance: as far as a step of `QP` looks


def linearise_us(track: Track) -> tuple[float, float]:
    """Median time of a whole step and of its linearisation alone, both of one run [us of the processor].

    The linearisation is replayed by itself at the postures of the run.
    """
    tool = WholebodyTool(track)
    tool.step(track.targets[0])
    tool.reset(track.start)
    lineariser = tool.problem.lineariser(tool.problem.workspace(), DT)
    lineariser.at(track.start, WITHIN_STEP)
    whole, part = [], []
    for target in track.targets:
        q = tool.posture()
        began = time.thread_time_ns()
        tool.step(target)
        whole.append(time.thread_time_ns() - began)
        began = time.thread_time_ns()
        lineariser.at(q, WITHIN_STEP)
        part.append(time.thread_time_ns() - began)
    return float(np.median(whole)) / 1e3, float(np.median(part)) / 1e3


def step_times(times: Sequence[StepTime], path: Path) -> tuple[Path, Path]:
    """Time of a step of every tool: the middle half as a box, 5 to 95 % as whiskers, the median written beside it."""
    reaches, tools = _names(times)
    chart, axes = plot_style.figure(1, len(reaches), (4.6 * len(reaches), 0.9 + 0.5 * len(tools)))
    for column, reach in enumerate(reaches):
        axis = axes[0][column]
        for place, tool in enumerate(reversed(tools)):
            wall = np.array([time.wall_us for time in times if (time.reach, time.tool) == (reach, tool)])
            color = plot_style.COLORS[tool]
            if not len(wall):
                axis.annotate("refused", (0.0, place), (4, 0), ("axes fraction", "data"), "offset points", color=GREY)
                continue
            least, low, median, high, most = np.quantile(wall, (0.05, 0.25, 0.5, 0.75, 0.95))
            axis.plot([least, most], [place, place], color=color, linewidth=1.6, marker="|", markersize=9)
            axis.barh(place, high - low, left=low, height=0.55, color=color, alpha=0.85)
            axis.plot([median, median], [place - 0.275, place + 0.275], color="white", linewidth=1.6)
            axis.annotate(
                f"{median:.0f}", (median, place), (0, 12), textcoords="offset points",
                ha="center", va="bottom", fontsize=8, color=GREY,
            )  # fmt: skip
        plot_style.plain_log(axis)
        axis.set_yticks(range(len(tools)), tools[::-1] if column == 0 else [""] * len(tools))
        axis.set_ylim(-0.6, len(tools) - 0.2)
        axis.grid(axis="y", visible=False)
        axis.set_title(f"{reach} reach", loc="left")
        axis.set_xlabel("time of a step [µs], 5 to 95 %, median")
    return plot_style.save(chart, path)


def least_distances(times: Sequence[StepTime], path: Path) -> tuple[Path, Path]:
    """Least distance of any pair after every step, for every tool."""
    reaches, tools = _names(times)
    chart, axes = plot_style.figure(1, len(reaches), (5.0 * len(reaches), 3.4))
    for column, reach in enumerate(reaches):
        axis = axes[0][column]
        axis.axhspan(-1e3, 0.0, color="#f4dddd", zorder=0)
        axis.axhline(1e3 * CLEARANCE, color=GREY, linewidth=1.0, linestyle="--")
        lowest = 0.0
        for tool in sorted(tools, key=lambda name: name != THICK):
            chosen = [time for time in times if (time.reach, time.tool, time.repeat) == (reach, tool, 1)]
            least = np.array([time.least_mm for time in chosen])
            lowest = min(lowest, float(least.min()))
            width = 3.2 if tool == THICK else 1.5
            axis.plot([time.step for time in chosen], least, color=plot_style.COLORS[tool], linewidth=width, label=tool)
        axis.set_ylim(1.15 * lowest - 2.0, 30.0)
        axis.text(2, 1.05 * lowest - 1.5, "inside", fontsize=8, color=GREY, va="bottom")
        last = max(time.step for time in times)
        axis.text(last, 1e3 * CLEARANCE - 0.4, "clearance asked", fontsize=8, color=GREY, va="top", ha="right")
        axis.set_title(f"{reach} reach", loc="left")
        axis.set_xlabel("step")
        if column == 0:
            axis.set_ylabel("least distance of any pair [mm]")
    handles, labels = axes[0][0].get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside lower center", ncols=len(tools), frameon=False)
    return plot_style.save(chart, path)


def _names(times: Sequence[StepTime]) -> tuple[list[str], list[str]]:
    reaches = list(dict.fromkeys(time.reach for time in times))
    present = {time.tool for time in times}
    return reaches, [tool for tool in plot_style.COLORS if tool in present]

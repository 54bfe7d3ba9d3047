"""`wholebody bench step`: the same 200-step reach by every tool, interleaved in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from wholebody.assessment.motion import pairs_along
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.measure.track import SETTING, Track, Verdict, judge
from wholebody.bench.rows import Figure, Panel, Row, across, only, quiet, report, shares, texts, times
from wholebody.bench.statistics import BLOCK, quantile_ratio
from wholebody.bench.suite.adapters.base import Tool
from wholebody.bench.suite.adapters.registry import make_tool
from wholebody.bench.tables import programs_text
from wholebody.geometry.pair_distances import PairDistances

REFERENCE = "placo"
LEAST = "Pinocchio and coal"
TURN = 50
"""Steps that a tool makes before the next one does. Fewer: nearer in time, and more steps whose data
others evicted from the caches; these are 2 %, so that they do not make the p95."""


class Run:
    """One run of a tool: `wall`, `cpu` (steps,) [us], `setup` [s] and `postures` (steps, nq) after each step."""

    def __init__(self, track: Track, name: str) -> None:
        self.track, steps = track, len(track.targets)
        self.wall, self.cpu = np.zeros(steps), np.zeros(steps)
        self.postures = np.empty((steps, track.scene.model.nq))
        began = time.perf_counter()
        self.tool: Tool = make_tool(name, track)
        self.tool.step(track.targets[0])
        self.setup = time.perf_counter() - began
        self.tool.reset(track.start)

    def go_on(self, first: int, last: int) -> None:
        """Make these steps, without the last."""
        for number in range(first, last):
            target = self.track.targets[number]
            worked, clock = time.thread_time_ns(), time.perf_counter_ns()
            self.tool.step(target)
            self.wall[number] = 1e-3 * (time.perf_counter_ns() - clock)
            self.cpu[number] = 1e-3 * (time.thread_time_ns() - worked)
            self.postures[number] = self.tool.posture()

    @cached_property
    def verdict(self) -> Verdict:
        """What its postures come to."""
        return judge(self.track, self.postures)


Runs = Mapping[str, Sequence[Run]]  # the repeats of each tool, by its name


def measure(
    track: Track, tools: Sequence[str], repeats: int, say: Callable[[str], None] = lambda text: None
) -> dict[str, list[Run]]:
    """Let every tool make a reach `repeats` times, each from a fresh set-up, in turns of `TURN` steps that rotate."""
    # The machine is as fast for one as for the other. One step of each, and a first round, are not counted.
    runs: dict[str, list[Run]] = {name: [] for name in tools}
    for repeat in range(repeats + 1):
        beside = _beside(track, tools, repeat)
        if repeat:
            for name, run in beside.items():
                runs[name].append(run)
            medians = ", ".join(f"{name} {np.median(run.wall):.0f}" for name, run in beside.items())
            say(f"{track.name}, repeat {repeat} of {repeats}, us a step: {medians}")
    return runs


def _beside(track: Track, tools: Sequence[str], shift: int) -> dict[str, Run]:
    """A run of each tool, in turns; the first turn begins with the tool number `shift`."""
    steps = len(track.targets)
    with quiet():
        runs = {name: Run(track, name) for name in tools}
        for turn, first in enumerate(range(0, steps, TURN), start=shift):
            begin = turn % len(tools)
            for name in [*tools[begin:], *tools[:begin]]:
                runs[name].go_on(first, min(first + TURN, steps))
    return runs


def least_times(track: Track, runs: Sequence[Run]) -> Array:
    """(runs, steps) microseconds of joint Jacobians, placements and distances of a step in Pinocchio and coal alone."""
    model, scene = track.scene.model, track.scene
    pairs = PairDistances(scene.geometry, scene.built.table.pairs)
    data, geometry, results = model.createData(), pairs.geometry, pairs.data
    spent = np.empty((len(runs), len(track.targets)))
    for mine, run in zip(spent, runs, strict=True):
        near = [np.flatnonzero(every.distance < SETTING.within) for every in pairs_along(scene, run.postures)]
        with quiet():
            for step, q in enumerate(run.postures):
                numbers = near[step].tolist()
                clock = time.perf_counter_ns()
                pin.computeJointJacobians(model, data, q)
                pin.updateGeometryPlacements(model, data, geometry, results)
                for number in numbers:
                    pin.computeDistance(geometry, results, number)
                mine[step] = 1e-3 * (time.perf_counter_ns() - clock)
    return spent


def time_rows(track: Track, runs: Runs) -> list[Row]:
    """Times of all steps of each tool, and their ratios to the reference's in the same repeat, with intervals."""
    rows, reference, least = list[Row](), runs.get(REFERENCE, []), None
    for name, mine in runs.items():
        figures: dict[str, Figure] = {}
        if least is None:
            least = least_times(track, mine)
            figures[f"median × {LEAST}"] = quantile_ratio(_clock(mine, "wall"), least, 0.5)
        for clock, front in (("wall", ""), ("cpu", "CPU")):
            own = _clock(mine, clock)
            figures |= times(own, "µs", front)
            for part, quantile in (("median", 0.5), ("p95", 0.95)) if reference else ():
                ratio = quantile_ratio(own, _clock(reference, clock), quantile)
                figures[f"{front} {part} × {REFERENCE}".strip()] = ratio
        figures["set-up ms"] = 1e3 * float(np.median([run.setup for run in mine]))
        rows.append(Row(track.name, name, figures))
    if rows and least is not None:
        rows.append(Row(track.name, LEAST, times(least, "µs")))
    return rows


def _clock(runs: Sequence[Run], clock: str) -> Array:
    return np.array([getattr(run, clock) for run in runs])


def result_rows(track: Track, runs: Runs) -> list[Row]:
    """What the first repeat of each tool came to, judged from its postures."""
    rows = []
    for name, (run, *_) in runs.items():
        verdict, remarks = run.verdict, run.tool.remarks()
        figures: dict[str, Figure] = {
            "least distance mm": 1e3 * float(verdict.least_distance.min()),
            "steps inside": int((verdict.least_distance < 0.0).sum()),
            "final error mm": 1e3 * float(verdict.error[-1]),
            "mean error mm": 1e3 * float(verdict.error.mean()),
            "foot drift mm": 1e3 * verdict.foot_drift,
            "beyond limits rad": verdict.limit_violation,
            "root speed ÷ bound": verdict.fastest_root,
            "joint acceleration rad/s²": verdict.acceleration,
            "pairs": int(remarks.get("pairs", track.pairs)),
            "near": float(verdict.near.mean()),
            "touching": float(verdict.touching.mean()),
            "rows": remarks.get("rows", float("nan")),
            "solved exactly": remarks.get("exact", float("nan")),
            "programs closed by": programs_text(run.tool.programs()),
            "no answer": run.tool.failures,
        }
        rows.append(Row(track.name, name, figures))
    return rows


def taking(track: Track, tools: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """The tools that can be set up for a reach and make a first step, and the sentences of those that cannot."""
    taken, refused = [], {}
    for name in tools:
        try:
            with quiet():
                make_tool(name, track).step(track.targets[0])
            taken.append(name)
        except (InputError, RuntimeError, ValueError) as error:
            refused[name] = " ".join(str(error).split()).rstrip(".")
    return taken, refused


def panels(found: Mapping[str, Runs]) -> list[Panel]:
    """Of every reach: the share of steps within a time, and the least distance of any pair after every step."""
    drawn = []
    for name, runs in found.items():
        if runs:
            walls = {tool: _clock(mine, "wall").ravel() for tool, mine in runs.items()}
            drawn.append(shares(name, "time of a step [µs]", walls))
    for name, runs in found.items():
        lines = {}
        for tool, (run, *_) in runs.items():
            least = 1e3 * run.verdict.least_distance
            lines[tool] = np.arange(1, len(least) + 1), np.minimum(least, 30.0)
        if lines:
            levels = (0.0, 1e3 * run.track.clearance)
            drawn.append(Panel(name, "step", "least distance of any pair [mm]", lines, levels=levels))
    return drawn


def step_report(
    spent: Sequence[Row], judged: Sequence[Row], facts: Mapping[str, str], figures: bool, notes: Sequence[str]
) -> str:
    """The tables of the tracking steps; `figures` says whether reaches are of figures from files."""
    about = texts()["step"].format(
        who=texts()["step_figures" if figures else "step_human"], dt_ms=1e3 * SETTING.dt, turn=TURN, block=BLOCK,
        clearance_mm=1e3 * SETTING.clearance, within_mm=1e3 * SETTING.within, joint_speed=SETTING.joint_speed,
        root_speed=SETTING.root_speed, root_turn=SETTING.root_turn, least=LEAST,
    )  # fmt: skip
    met = [row for row in judged if not row.case.endswith("alone")]  # where something is in the way
    figures_of_time = "median µs", f"median × {REFERENCE}", f"p95 × {REFERENCE}", f"median × {LEAST}"
    figures_of_steps = (
        "least distance mm",
        "steps inside",
        "mean error mm",
        "foot drift mm",
        "joint acceleration rad/s²",
    )
    if figures:  # of several figures: tables with fewer columns
        tables = {
            "Time of a step": across(spent, *figures_of_time[:2], columns="tool"),
            "What the steps achieve": only(met, *figures_of_steps[:3]),
        }
    else:
        tables = {
            "Time of a step": across(spent, *figures_of_time[:2]),
            "Its 95 %, and its ratio to calls of C++": across(spent, *figures_of_time[2:]),
            "What the steps achieve": only(met, "final error mm", *figures_of_steps),
        }
    return report(about, tables, facts, notes)

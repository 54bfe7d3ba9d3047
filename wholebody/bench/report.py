"""What the measurements say, as Markdown for the page docs/results.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isnan

import numpy as np

from wholebody.bench.machine import sentence
from wholebody.bench.problem_sets.bodies import CLEARANCE as REACH_CLEARANCE
from wholebody.bench.problem_sets.clutter import THINGS
from wholebody.bench.reaches import ReachRow
from wholebody.bench.solve import MemoryRow, SolveRow
from wholebody.bench.step import StepRow, goal_lines
from wholebody.bench.tables import markdown
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, WITHIN


def step_report(
    rows: Sequence[StepRow], facts: Mapping[str, str], differences: Mapping[str, Sequence[str]],
    stages: Mapping[str, tuple[float, float]],
) -> str:  # fmt: skip
    """Tables of the tracking steps.

    Args:
        rows: of all tools and reaches.
        facts: of the machine.
        differences: tool -> what it cannot express.
        stages: reach -> median of a whole step and of its linearisation [us].
    """
    parts = [
        f"{rows[0].steps} steps of {1e3 * DT:g} ms by the standing human (55 degrees of freedom) among 20 convex "
        f"objects (none in the reach alone), {max(row.pairs for row in rows)} pairs of pieces; both feet held, "
        "joints drawn back to standing, "
        f"clearance {1e3 * CLEARANCE:g} mm, pairs nearer than {1e3 * WITHIN:g} mm looked at, joints up to "
        f"{JOINT_SPEED:g} rad/s, root up to {ROOT_SPEED:g} m/s and {ROOT_TURN:g} rad/s. {rows[0].repeats} repeats, "
        "every tool once in each, in turning order, in one process; a first round and the first step of each set-up "
        "are not counted. Distances, errors and limits are judged afterwards from the postures, every pair by coal.",
    ]
    for reach in dict.fromkeys(row.reach for row in rows):
        mine = [row for row in rows if row.reach == reach]
        title = f"{reach.capitalize()} reach, {max(row.pairs for row in mine)} pairs"
        parts += [f"### {title}: time", _times(mine), f"### {title}: result"]
        parts += [_results(mine)]
        if reach in stages:
            whole, part = stages[reach]
            parts.append(
                f"Of our step (OSQP), {part:.0f} of {whole:.0f} µs are the linearisation: kinematics, distances, rows."
            )
    parts += ["Asked and reached:", "\n".join(f"- {line}" for line in goal_lines(rows))]
    stated = [
        f"- {sentence}" for name in dict.fromkeys(row.tool for row in rows) for sentence in differences.get(name, ())
    ]
    if stated:
        parts += ["What the tools do differently:", "\n".join(stated)]
    return "\n\n".join([*parts, sentence(facts)])


def _times(rows: Sequence[StepRow]) -> str:
    columns = (
        "tool", "median µs", "p95 µs", "× placo", "p95 × placo", "CPU median µs", "CPU p95 µs", "CPU p95 × placo",
        "set-up ms",
    )  # fmt: skip
    return markdown(
        columns,
        [
            (
                row.tool, f"{row.median_us:.0f}", f"{row.p95_us:.0f}", _number(row.ratio, 2), _number(row.ratio_p95, 2),
                f"{row.cpu_median_us:.0f}", f"{row.cpu_p95_us:.0f}", _number(row.cpu_ratio_p95, 2),
                f"{row.setup_ms:.0f}",
            )
            for row in rows
        ],
    )  # fmt: skip


def _results(rows: Sequence[StepRow]) -> str:
    columns = (
        "tool", "least distance mm", "steps inside", "final error mm", "mean error mm", "foot drift mm",
        "beyond limits rad", "root speed ÷ bound", "joint acceleration rad/s²", "pairs", "near",
        "touching", "rows", "solved exactly", "without solver", "no answer",
    )  # fmt: skip
    return markdown(
        columns,
        [
            (
                row.tool, f"{row.least_mm:.2f}", str(row.penetrating), f"{row.final_error_mm:.4f}",
                f"{row.mean_error_mm:.2f}", f"{row.foot_drift_mm:.3f}", f"{row.limit_violation:.0e}",
                f"{row.root_speed:.2f}", f"{row.acceleration:.1f}",
                str(row.pairs), f"{row.near:.1f}", f"{row.touching:.1f}", _number(row.rows, 1),
                _share(row.exact), _share(row.at_once), str(row.failures),
            )
            for row in rows
        ],
    )  # fmt: skip


def reaches_report(rows: Sequence[ReachRow], facts: Mapping[str, str], jobs: int) -> str:
    """Tables of the random reaches."""
    parts = [
        f"Random reaches from standing among {THINGS} random objects and a floor, seeds {rows[0].seed} to "
        f"{rows[-1].seed}; the target is where a fingertip is in a sampled posture free of contact, so an answer "
        f"exists. Both feet held, effort minimised, clearance {1e3 * REACH_CLEARANCE:g} mm."
        + (f" Times with {jobs} processes beside each other." if jobs > 1 else "")
    ]
    columns = ("solver", "reaches", "solved", "directly", "in stages", "another start", "median ms", "p95 ms",
               "iterations", "deepest overlap m", "beyond limits rad", "feet off by", "effort ÷ witness'")  # fmt: skip
    table, missed = [], []
    for solver in dict.fromkeys(row.solver for row in rows):
        mine = [row for row in rows if row.solver == solver]
        solved = [row for row in mine if row.status == "solved"]
        how = Counter(row.how for row in solved)
        others = len(solved) - how["directly"] - how["in stages"]
        times = [row.milliseconds for row in mine]
        table.append(
            (
                solver, str(len(mine)), f"{100.0 * len(solved) / len(mine):.1f} %", str(how["directly"]),
                str(how["in stages"]), str(others), f"{np.median(times):.1f}", f"{np.quantile(times, 0.95):.1f}",
                f"{np.median([row.iterations for row in mine]):.0f}", f"{max(row.penetration for row in mine):.1e}",
                f"{max(row.limit_violation for row in mine):.1e}",
                f"{max(row.constraint_violation for row in mine):.1e}",
                f"{np.median([row.measure / row.witness_measure for row in solved] or [np.nan]):.2g}",
            )
        )  # fmt: skip
        missed += [f"- seed {row.seed}, {solver}: {row.status}; {row.how}" for row in mine if row.status != "solved"]
    parts += [markdown(columns, table)]
    parts += ["Not solved:\n\n" + "\n".join(missed) if missed else "Every reach was solved."]
    return "\n\n".join([*parts, sentence(facts)])


def solve_report(rows: Sequence[SolveRow], peak: MemoryRow, facts: Mapping[str, str]) -> str:
    """Table of the whole solves, and the memory."""
    columns = ("task", "solver", "problem and method", "solves", "pairs", "status", "iterations", "median ms", "p95 ms",
               "CPU median ms")  # fmt: skip
    table = markdown(
        columns,
        [
            (
                row.task, row.solver, "new" if row.way == "cold" else "used before", str(row.count), str(row.pairs),
                row.status, str(row.iterations), f"{row.median_ms:.1f}", f"{row.p95_ms:.1f}",
                f"{row.cpu_median_ms:.1f}",
            )
            for row in rows
        ],
    )  # fmt: skip
    beside = (
        f"; the browser that takes the picture, beside it, {peak.children_mb:.0f} MB" if peak.children_mb > 1 else ""
    )
    said = (
        f"`{peak.command}` takes {peak.peak_mb:.0f} MB of memory at its peak{beside}, and {peak.seconds:.1f} s in all."
    )
    return "\n\n".join([table, said, sentence(facts)])


def _number(value: float, digits: int) -> str:
    return "" if isnan(value) else f"{value:.{digits}f}"


def _share(value: float) -> str:
    return "" if isnan(value) else f"{100.0 * value:.1f} %"

"""`wholebody bench step`, `solve`, `scaling`: what methods cost."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from wholebody.base.errors import UnknownNameError
from wholebody.bench.machine import machine
from wholebody.cli.bench.command import Chart, listed, measuring, publish
from wholebody.cli.command import count, option

PARTS = "task", "reaches", "detail"
"""Of `wholebody bench solve`, each into a table of its own."""


@measuring(
    "step",
    "one step of tracking by every tool",
    "The same 200-step reach by every tool that is installed, interleaved, judged independently. With "
    "--figure it is made by these figures in place of the standing human; tools that do not take one say why.",
    listed("--figure", "URDF or MJCF files, or names of figures", "FILE"),
    count("--repeats", 5, "timed runs of every tool"),
    option("--steps", type=int, default=200, metavar="N", help="of each run (default: 200)"),
    listed("--tools", "only these (default: all that are installed)"),
)
def step(arguments: argparse.Namespace) -> None:
    """Measure steps."""
    from wholebody.bench.measure import step
    from wholebody.bench.measure.figure_track import figure_tracks
    from wholebody.bench.measure.step_goals import goal_lines
    from wholebody.bench.measure.track import VARIANTS, track
    from wholebody.bench.suite.adapters.registry import chosen_tools, tool_class

    tools = chosen_tools(arguments.tools)
    repeats, steps = (1, 40) if arguments.quick else (arguments.repeats, arguments.steps)
    facts = machine() | {"steps": str(steps), "repeats": str(repeats)}
    figures = arguments.figure
    courses = [course for spec in figures or () for course in figure_tracks(spec, steps)]
    refusals: dict[str, dict[str, str]] = {}
    rows, times, shares = [], [], {}
    for course in courses or (track(name, steps) for name in VARIANTS):
        taken, refusals[course.name] = step.taking(course, tools) if figures else (list(tools), {})
        print(f"{course.name} reach: {course.pairs} pairs that can touch, tools {', '.join(taken)}")
        for tool, sentence in refusals[course.name].items():
            print(f"{tool} does not take it: {sentence}")
        measured, timed = step.measure(course, taken, repeats, print)
        rows += measured
        times += timed
        if "wholebody" in taken:
            shares[course.name] = step.linearise_us(course)
    stated = {name: tool_class(name).differences for name in tools}
    goals = [] if figures else goal_lines(rows)
    report = step.step_report(rows, facts, stated, shares, refusals if figures else None, goals)
    name = "step-figures" if figures else "step"
    tables: dict[str, Sequence[Any]] = {name: rows, f"{name}-times": times}
    charts = {f"{name}-times": Chart(partial(step.step_times, times), "Time of a step of every tool")}
    if not figures:
        caption = "Least distance of any pair after every step"
        charts["step-distances"] = Chart(partial(step.least_distances, times), caption)
    publish(name, report, arguments, facts=facts, tables=tables, charts=charts)
    if goals:
        print("\n".join(goals))


@measuring(
    "solve",
    "whole solves: a task and its memory, random reaches, levels of modelling",
    """\
Measure whole solves. `task`: the shelf, or a task of your own, with new and with used workspaces, and the memory of
`wholebody pose`. `reaches`: random reaches from standing whose answer is known to exist; what was not solved is listed.
`detail`: the same tasks with the person as spheres, capsules and hulls, with all joints and pairs and with those that a
task needs, judged in the finest model.""",
    listed("--parts", "what to measure (default: task reaches)", None, choices=PARTS, default=PARTS[:2]),
    option("--task", type=Path, metavar="TASK.toml", help="of the part task (default: the shelf)"),
    count("--count", None, "solves of the task (default: 30), reaches (200), cases of each level (8)"),
    option("--first", type=int, default=0, metavar="SEED", help="seed of the first reach or case (default: 0)"),
    listed("--methods", "such as qp, newton (default: qp, and qp/osqp for the task)"),
    count("--jobs", 1, "processes of the reaches (default: 1, for steady times)"),
)
def solve(arguments: argparse.Namespace) -> None:
    """Measure whole solves."""
    for part in dict.fromkeys(arguments.parts):
        {"task": _task, "reaches": _reaches, "detail": _detail}[part](arguments)


def _task(arguments: argparse.Namespace) -> None:
    """Whole solves of a task with new and with used workspaces, and the memory of `wholebody pose`."""
    from wholebody.bench.measure import solve
    from wholebody.bench.suite.adapters.registry import adapters
    from wholebody.cli.demo import packaged_tasks

    task, facts = arguments.task or packaged_tasks()["shelf"], machine()
    rows = solve.measured(
        task, adapters(arguments.methods or ["qp", "qp/osqp"]), 3 if arguments.quick else arguments.count or 30, print
    )
    peak = solve.memory(task)
    report = solve.solve_report(rows, peak, facts)
    publish("solve", report, arguments, facts=facts, tables={"solve": rows, "memory": [peak]})


def _reaches(arguments: argparse.Namespace) -> None:
    """Random reaches whose answer is known to exist."""
    from wholebody.bench.measure import reaches
    from wholebody.bench.suite.adapters.registry import adapters

    seeds = range(arguments.first, arguments.first + (10 if arguments.quick else arguments.count or 200))
    methods = [adapter.name for adapter in adapters(arguments.methods or ["qp"])]
    facts = machine() | {"processes": str(arguments.jobs)}
    rows = []
    for method in methods:
        for row in reaches.run(seeds, method, arguments.jobs):
            rows.append(row)
            if row.status != "solved":
                print(f"seed {row.seed}, {method}: {row.status}; {row.how}")
    report = reaches.reaches_report(rows, facts, arguments.jobs)
    charts = {"reaches": Chart(partial(reaches.reach_times, rows), "Share of the reaches solved within a time")}
    publish("reaches", report, arguments, facts=facts, tables={"reaches": rows}, charts=charts)


def _detail(arguments: argparse.Namespace) -> None:
    """The same tasks with every detail of geometry, judged in the finest model."""
    from wholebody.bench.measure import detail

    facts = machine()
    rows, refused = [], []
    for row in detail.rows(2 if arguments.quick else arguments.count or 8, arguments.first):
        if isinstance(row, str):
            refused.append(row)
            print(row, flush=True)
        else:
            rows.append(row)
    caption = "Time of a solve against what each level gets wrong, judged in the finest model"
    charts = {"detail": Chart(partial(detail.chart, rows), caption)}
    report = detail.report(rows, refused, facts)
    publish("detail", report, arguments, facts=facts, tables={"detail": rows}, charts=charts)


@measuring(
    "scaling",
    "time of a step and a solve against joints, pieces and things, with exponents",
    "Chains of 5 to 200 joints (500 bodies without a model of joints), 1 to 32 pieces a segment, 10 to "
    "5000 things around, and the exponents with which times grow.",
    count("--repeats", 5, "timed solves each"),
    listed("--methods", "methods (default: qp newton ccd placo)"),
)
def scaling(arguments: argparse.Namespace) -> None:
    """Measure, fit, draw."""
    from wholebody.bench.measure import scaling

    methods = tuple(arguments.methods or scaling.METHODS)
    for name in methods:
        if name not in scaling.METHODS:
            raise UnknownNameError("method", name, scaling.METHODS, "--methods")
    repeats, sizes = (2, scaling.QUICK) if arguments.quick else (arguments.repeats, scaling.SIZES)
    lines: list[str] = []

    def say(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    facts = machine()
    rows = list(scaling.rows(sizes, methods, repeats, say))
    if "newton" in methods:
        bodies = sizes["joints"] if arguments.quick else scaling.ASSEMBLIES
        rows += scaling.assembly_rows(bodies, repeats)
    caption = "Time of a solve, of a step, of the judgement and of the building of the geometry, as one size grows"
    charts = {"scaling": Chart(partial(scaling.chart, rows), caption)}
    report = scaling.report(rows, [line for line in lines if "left out" in line], facts)
    publish("scaling", report, arguments, facts=facts, tables={"scaling": rows}, charts=charts)

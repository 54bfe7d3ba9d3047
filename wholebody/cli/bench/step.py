"""`wholebody bench step`: one step of tracking by every tool."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from typing import Any

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish

PAIRS_OF_RUNS = 15  # with a person's defaults and without: their ratio then has an interval of some 3 %


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "step",
        help="one step of tracking by every tool",
        description="The same 200-step reach by every tool that is installed, interleaved, judged independently. With "
        "--figure it is made by these figures in place of the standing human; tools that do not take one say why.",
    )
    parser.add_argument("--figure", nargs="+", metavar="FILE", help="URDF or MJCF files, or names of figures")
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="timed runs of every tool (default: 5)")
    parser.add_argument("--steps", type=int, default=200, metavar="N", help="of each run (default: 200)")
    parser.add_argument("--tools", nargs="+", metavar="NAME", help="only these (default: all that are installed)")


def run(arguments: argparse.Namespace) -> int:
    """Measure steps."""
    from wholebody.bench.adapters import chosen_tools, differences
    from wholebody.bench.figure_track import figure_tracks
    from wholebody.bench.machine import machine
    from wholebody.bench.person_cost import person_costs
    from wholebody.bench.step import (
        goal_lines,
        least_distances,
        linearise_us,
        measure,
        step_report,
        step_times,
        taking,
    )
    from wholebody.bench.track import VARIANTS, track
    from wholebody.cli.demo import packaged_tasks

    tools = chosen_tools(arguments.tools)
    repeats, steps = (1, 40) if arguments.quick else (arguments.repeats, arguments.steps)
    check_count(repeats, "--repeats")
    facts = machine() | {"steps": str(steps), "repeats": str(repeats)}
    figures = arguments.figure
    courses = [course for spec in figures or () for course in figure_tracks(spec, steps)]
    refusals: dict[str, dict[str, str]] = {}
    rows, times, shares = [], [], {}
    for course in courses or (track(name, steps) for name in VARIANTS):
        taken, refusals[course.name] = taking(course, tools) if figures else (list(tools), {})
        print(f"{course.name} reach: {course.pairs} pairs that can touch, tools {', '.join(taken)}")
        for tool, sentence in refusals[course.name].items():
            print(f"{tool} does not take it: {sentence}")
        measured, timed = measure(course, taken, repeats, print)
        rows += measured
        times += timed
        if "wholebody" in taken:
            shares[course.name] = linearise_us(course)
    stated = {name: differences(name) for name in tools}
    costs = []
    if not figures:
        humans = [track(name, steps) for name in VARIANTS]
        costs = person_costs(humans, packaged_tasks()["shelf"], PAIRS_OF_RUNS if repeats > 1 else 2)
    report = step_report(rows, facts, stated, shares, refusals if figures else None, costs)
    name = "step-figures" if figures else "step"
    tables: dict[str, Sequence[Any]] = {name: rows, f"{name}-times": times}
    charts = {f"{name}-times": Chart(partial(step_times, times), "Time of a step of every tool")}
    if not figures:
        tables["step-person"] = costs
        caption = "Least distance of any pair after every step"
        charts["step-distances"] = Chart(partial(least_distances, times), caption)
    publish(name, report, arguments, facts=facts, tables=tables, charts=charts)
    if not figures:
        print("\n".join(goal_lines(rows)))
    return 0

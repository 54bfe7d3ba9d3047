"""`wholebody bench step`: one step of tracking by every tool."""

from __future__ import annotations

import argparse

from wholebody.cli.bench.publishing import add_common, check_count, publish


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "step",
        help="one step of tracking by every tool",
        description="The same 200-step reach by every tool that is installed, interleaved, judged independently.",
    )
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="timed runs of every tool (default: 5)")
    parser.add_argument("--steps", type=int, default=200, metavar="N", help="of each run (default: 200)")
    parser.add_argument("--tools", nargs="+", metavar="NAME", help="only these (default: all that are installed)")
    parser.set_defaults(run=run)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure steps."""
    from wholebody.bench.adapters import chosen_tools, differences
    from wholebody.bench.machine import machine
    from wholebody.bench.step import goal_lines, least_distances, linearise_us, measure, step_report, step_times
    from wholebody.bench.tables import write_rows
    from wholebody.bench.track import VARIANTS, track

    tools = chosen_tools(arguments.tools)
    repeats, steps = (1, 40) if arguments.quick else (arguments.repeats, arguments.steps)
    check_count(repeats, "--repeats")
    facts = machine() | {"steps": str(steps), "repeats": str(repeats)}
    rows, times, shares = [], [], {}
    for name in VARIANTS:
        course = track(name, steps)
        print(f"{name} reach: {course.pairs} pairs that can touch, tools {', '.join(tools)}")
        measured, timed = measure(course, tools, repeats, print)
        rows += measured
        times += timed
        if "wholebody/osqp" in tools:
            shares[name] = linearise_us(course, "osqp")
    report = step_report(rows, facts, {name: differences(name) for name in tools}, shares)
    write_rows(arguments.out / "step.csv", facts, rows)
    write_rows(arguments.out / "step-times.csv", facts, times)
    drawn = {
        "step-times": step_times(times, arguments.out / "step-times"),
        "step-distances": least_distances(times, arguments.out / "step-distances"),
    }
    captions = {
        "step-times": "Time of a step of every tool",
        "step-distances": "Least distance of any pair after every step",
    }
    publish("step", report, drawn, captions, arguments)
    print("\n".join(goal_lines(rows)))
    return 0

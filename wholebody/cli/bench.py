"""The command group `wholebody bench`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

HELP = "measure steps, solves and random reaches, beside other tools where installed"
DESCRIPTION = """\
Measure what the package does, and write the numbers as CSV, the charts as SVG and PNG, and tables to read. Times depend
on the machine and on what else runs on it: compare ratios of one run. Set OMP_NUM_THREADS=1 for steady ones."""
SOLVERS = ("osqp", "daqp")


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `bench` with its own commands."""
    parser = commands.add_parser("bench", help=HELP, description=DESCRIPTION)
    add_bench_parsers(parser.add_subparsers(title="what to measure", metavar="WHAT", required=True))


def add_bench_parsers(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `step`, `reaches` and `solve`; each sets `run`, which takes the arguments and returns the exit code."""
    step = commands.add_parser(
        "step",
        help="one step of tracking by every tool",
        description="The same 200-step reach by every tool that is installed, interleaved, judged independently.",
    )
    step.add_argument("--repeats", type=int, default=5, metavar="N", help="timed runs of every tool (default: 5)")
    step.add_argument("--steps", type=int, default=200, metavar="N", help="of each run (default: 200)")
    step.add_argument("--tools", nargs="+", metavar="NAME", help="only these (default: all that are installed)")
    step.set_defaults(run=run_step)
    reaches = commands.add_parser(
        "reaches",
        help="random reaches whose answer is known to exist",
        description="Solve random reaches from standing; list everything that was not solved.",
    )
    reaches.add_argument("--count", type=int, default=200, metavar="N", help="how many (default: 200)")
    reaches.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first one (default: 0)")
    reaches.add_argument("--solver", nargs="+", default=["osqp"], metavar="NAME", help="QP solvers (default: osqp)")
    reaches.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default: 1, for steady times)")
    reaches.set_defaults(run=run_reaches)
    solve = commands.add_parser(
        "solve",
        help="whole solves of the shelf task, and memory",
        description="Solve a task with new and with used workspaces, and measure the memory of `wholebody pose`.",
    )
    solve.add_argument("--task", type=Path, metavar="TASK.toml", help="another task (default: the shelf)")
    solve.add_argument("--count", type=int, default=30, metavar="N", help="solves of each kind (default: 30)")
    solve.add_argument("--solver", nargs="+", default=list(SOLVERS), metavar="NAME", help="QP solvers (default: both)")
    solve.set_defaults(run=run_solve)
    newton = commands.add_parser(
        "newton",
        help="sparse Newton by size, shape and factorisation",
        description="Chains, trees, rings and stars by every factorisation, the paper's size, and drags of the human.",
    )
    newton.add_argument("--repeats", type=int, default=15, metavar="N", help="timed systems each (default: 15)")
    newton.set_defaults(run=run_newton)
    for parser in (step, reaches, solve, newton):
        parser.add_argument("--quick", action="store_true", help="a short run that shows whether all works")
        parser.add_argument(
            "--out", type=Path, default=Path("out/bench"), metavar="DIR", help="folder (default: out/bench)"
        )
        parser.add_argument(
            "--update-docs", type=Path, nargs="?", const=Path("docs"), metavar="DOCS",
            help="write tables and charts into the documentation too (default folder: docs)",
        )  # fmt: skip


def run_step(arguments: argparse.Namespace) -> int:
    """Measure steps."""
    from wholebody.bench import charts, stages
    from wholebody.bench.machine import machine
    from wholebody.bench.report import step_report
    from wholebody.bench.step import goal_lines, measure
    from wholebody.bench.tables import write_rows
    from wholebody.bench.tools import chosen_tools, differences
    from wholebody.bench.track import VARIANTS, track

    tools = chosen_tools(arguments.tools)
    repeats, steps = (1, 40) if arguments.quick else (arguments.repeats, arguments.steps)
    _check(repeats, "--repeats")
    facts = machine() | {"steps": str(steps), "repeats": str(repeats)}
    rows, times, shares = [], [], {}
    for name in VARIANTS:
        course = track(name, steps)
        print(f"{name} reach: {course.pairs} pairs that can touch, tools {', '.join(tools)}")
        measured, timed = measure(course, tools, repeats, print)
        rows += measured
        times += timed
        if "wholebody/osqp" in tools:
            shares[name] = stages.linearise_us(course, "osqp")
    report = step_report(rows, facts, {name: differences(name) for name in tools}, shares)
    write_rows(arguments.out / "step.csv", facts, rows)
    write_rows(arguments.out / "step-times.csv", facts, times)
    drawn = {
        "step-times": charts.step_times(times, arguments.out / "step-times"),
        "step-distances": charts.least_distances(times, arguments.out / "step-distances"),
    }
    captions = {
        "step-times": "Time of a step of every tool",
        "step-distances": "Least distance of any pair after every step",
    }
    _publish("step", report, drawn, captions, arguments)
    print("\n".join(goal_lines(rows)))
    return 0


def run_reaches(arguments: argparse.Namespace) -> int:
    """Measure random reaches."""
    from wholebody.bench import charts
    from wholebody.bench.machine import machine
    from wholebody.bench.reaches import run
    from wholebody.bench.report import reaches_report
    from wholebody.bench.tables import write_rows
    from wholebody.methods.qp.solvers.base import make_solver

    count = 10 if arguments.quick else arguments.count
    _check(count, "--count")
    _check(arguments.jobs, "--jobs")
    for solver in arguments.solver:
        make_solver(solver)
    facts = machine() | {"processes": str(arguments.jobs)}
    rows = []
    for solver in arguments.solver:
        for row in run(range(arguments.first, arguments.first + count), solver, arguments.jobs):
            rows.append(row)
            if row.status != "solved":
                print(f"seed {row.seed}, {solver}: {row.status}; {row.how}")
    report = reaches_report(rows, facts, arguments.jobs)
    write_rows(arguments.out / "reaches.csv", facts, rows)
    drawn = {"reaches": charts.reach_times(rows, arguments.out / "reaches")}
    _publish("reaches", report, drawn, {"reaches": "Share of the reaches solved within a time"}, arguments)
    return 0


def run_solve(arguments: argparse.Namespace) -> int:
    """Measure whole solves."""
    from wholebody.bench import solve
    from wholebody.bench.machine import machine
    from wholebody.bench.report import solve_report
    from wholebody.bench.tables import write_rows
    from wholebody.cli.demo import shipped_tasks

    task = arguments.task or shipped_tasks()["shelf"]
    count = 3 if arguments.quick else arguments.count
    _check(count, "--count")
    facts = machine()
    rows = solve.both(task, tuple(arguments.solver), count, print)
    peak = solve.memory(task)
    write_rows(arguments.out / "solve.csv", facts, rows)
    write_rows(arguments.out / "memory.csv", facts, [peak])
    _publish("solve", solve_report(rows, peak, facts), {}, {}, arguments)
    return 0


def run_newton(arguments: argparse.Namespace) -> int:
    """Measure sparse Newton."""
    from wholebody.bench import newton
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import write_rows

    repeats, sizes, frames = (3, (10, 30), 20) if arguments.quick else (arguments.repeats, newton.SIZES, 1000)
    _check(repeats, "--repeats")
    facts = machine()
    solves, drift = [newton.paper_row(10 * repeats)], []
    for contacts in (False, True):
        row, worst = newton.drag_row(frames, contacts)
        solves.append(row)
        drift.append(worst)
    linear = list(newton.linear_rows(sizes, repeats))
    write_rows(arguments.out / "newton-linear.csv", facts, linear)
    write_rows(arguments.out / "newton-solves.csv", facts, solves)
    _publish("newton", newton.report(linear, solves, drift, facts), {}, {}, arguments)
    return 0


def _publish(
    name: str,
    report: str,
    charts: dict[str, tuple[Path, Path]],
    captions: dict[str, str],
    arguments: argparse.Namespace,
) -> None:
    """Write the tables beside the numbers, and with the charts into the documentation where that is asked for."""
    import shutil

    from wholebody.bench.tables import replace_section, write_text

    write_text(arguments.out / f"{name}.md", report + "\n")
    print(report)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is None:
        return
    pictures: Sequence[str] = [f"![{captions[chart]}](assets/bench/{chart}.svg)" for chart in charts]
    replace_section(arguments.update_docs / "results.md", name, "\n\n".join([*pictures, report]))
    folder = arguments.update_docs / "assets" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    for svg, _ in charts.values():
        shutil.copyfile(svg, folder / svg.name)
    print(f"wrote {arguments.update_docs / 'results.md'}")


def _check(number: int, option: str) -> None:
    if number < 1:
        raise InputError(f"{option} is {number}; give 1 or more")

"""`wholebody bench step`, `reaches`, `solve`, `newton`, `qp`, `scaling`, `detail`, `challenge`: what methods cost."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from wholebody.base.errors import UnknownNameError
from wholebody.bench.machine import machine
from wholebody.cli.bench.command import Chart, count, listed, measuring, option, publish, seed

PAIRS_OF_RUNS = 15  # with a person's defaults and without: their ratio then has an interval of some 3 %
QUICK = 45  # quadratic programs


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
    from wholebody.bench import step
    from wholebody.bench.adapters.registry import chosen_tools, tool_class
    from wholebody.bench.figure_track import figure_tracks
    from wholebody.bench.person_cost import person_costs
    from wholebody.bench.step_goals import goal_lines
    from wholebody.bench.track import VARIANTS, track
    from wholebody.cli.demo import packaged_tasks

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
    costs = []
    if not figures:
        humans = [track(name, steps) for name in VARIANTS]
        costs = person_costs(humans, packaged_tasks()["shelf"], PAIRS_OF_RUNS if repeats > 1 else 2)
    goals = [] if figures else goal_lines(rows)
    report = step.step_report(rows, facts, stated, shares, refusals if figures else None, costs, goals)
    name = "step-figures" if figures else "step"
    tables: dict[str, Sequence[Any]] = {name: rows, f"{name}-times": times}
    charts = {f"{name}-times": Chart(partial(step.step_times, times), "Time of a step of every tool")}
    if not figures:
        tables["step-person"] = costs
        caption = "Least distance of any pair after every step"
        charts["step-distances"] = Chart(partial(step.least_distances, times), caption)
    publish(name, report, arguments, facts=facts, tables=tables, charts=charts)
    if goals:
        print("\n".join(goals))


@measuring(
    "reaches",
    "random reaches whose answer is known to exist",
    "Solve random reaches from standing; list everything that was not solved.",
    count("--count", 200, "how many"),
    option("--first", type=int, default=0, metavar="SEED", help="seed of the first one (default: 0)"),
    listed("--methods", "such as qp, qp/osqp, newton (default: qp)", default=["qp"]),
    count("--jobs", 1, "processes (default: 1, for steady times)"),
)
def reaches(arguments: argparse.Namespace) -> None:
    """Measure random reaches."""
    from wholebody.bench import reaches
    from wholebody.bench.adapters.registry import adapters

    seeds = range(arguments.first, arguments.first + (10 if arguments.quick else arguments.count))
    methods = [adapter.name for adapter in adapters(arguments.methods)]
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


@measuring(
    "solve",
    "whole solves of the shelf task, and memory",
    "Solve a task with new and with used workspaces, and measure the memory of `wholebody pose`.",
    option("--task", type=Path, metavar="TASK.toml", help="another task (default: the shelf)"),
    count("--count", 30, "solves of each kind"),
    listed("--methods", "such as qp, qp/osqp (default: these two)", default=["qp", "qp/osqp"]),
)
def solve(arguments: argparse.Namespace) -> None:
    """Measure whole solves."""
    from wholebody.bench import solve
    from wholebody.bench.adapters.registry import adapters
    from wholebody.cli.demo import packaged_tasks

    task, facts = arguments.task or packaged_tasks()["shelf"], machine()
    rows = solve.measured(task, adapters(arguments.methods), 3 if arguments.quick else arguments.count, print)
    peak = solve.memory(task)
    report = solve.solve_report(rows, peak, facts)
    publish("solve", report, arguments, facts=facts, tables={"solve": rows, "memory": [peak]})


@measuring(
    "newton",
    "sparse Newton by size, shape and factorisation",
    "Chains, trees, rings and stars by every factorisation, whole solves, loops beside open chains, "
    "the same problems by qp, and drags of the human. Set OMP_NUM_THREADS=1: small products are slower on more.",
    count("--repeats", 15, "timed systems each"),
)
def newton(arguments: argparse.Namespace) -> None:
    """Measure sparse Newton."""
    from wholebody.bench import newton

    repeats, sizes, frames = (3, (10, 30), 20) if arguments.quick else (arguments.repeats, newton.SIZES, 1000)
    facts, many = machine(), 10 * repeats
    paper = [newton.paper_row(many), newton.drag_of_assembly_row(many)]
    solves = [*paper, newton.nearest_row(many), *newton.loop_rows(many)]
    agreements = newton.agreement_rows(many)
    drags = [newton.drag_row(frames, contacts) for contacts in (False, True)]
    linear = list(newton.linear_rows(sizes, repeats))
    found: dict[str, Any] = {"linear": linear, "solves": solves, "agreements": agreements, "drags": drags}
    tables = {f"newton-{name}": rows for name, rows in found.items()}
    publish("newton", newton.report(**found, facts=facts), arguments, facts=facts, tables=tables)


@measuring(
    "qp",
    "the quadratic programs of all problem sets by every solver alone",
    "Record the programs that the QP method poses on the problem sets, keep them as files that "
    "qpsolvers reads and as a test set of qpbenchmark, and give them to every QP solver alone.",
    count("--count", 2000, "programs"),
    seed("of the problem sets"),
    listed("--solvers", "QP solvers (default: all that are installed)"),
    listed("--sets", "problem sets (default: all)"),
    option("--programs", type=Path, metavar="DIR", help="files of an earlier run, instead of recording"),
)
def qp(arguments: argparse.Namespace) -> None:
    """Measure solvers of quadratic programs."""
    from wholebody.bench.problem_sets.registry import SETS, problem_set
    from wholebody.bench.qp_programs import files
    from wholebody.bench.qp_programs.measuring import measure, qp_report, summaries
    from wholebody.bench.qp_programs.recording import record
    from wholebody.methods.qp.solvers.registry import make_solver, solver_names

    sets = [problem_set(name).name for name in arguments.sets or SETS]
    solvers = tuple(arguments.solvers or solver_names())
    for name in solvers:
        make_solver(name)
    if arguments.programs is None:
        programs = record(sets, QUICK if arguments.quick else arguments.count, arguments.seed, print)
        files.save(programs, arguments.out / "qp-programs")
    else:
        programs = [one for one in files.load(arguments.programs) if one.set in sets]
    facts = machine() | {"seed": str(arguments.seed)}
    rows = measure(programs, solvers, print)
    totals = summaries(rows, solvers)
    report = qp_report(rows, totals, facts)
    publish("qp", report, arguments, facts=facts, tables={"qp-programs": rows, "qp": totals})


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
    from wholebody.bench import scaling

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


@measuring(
    "detail",
    "spheres, capsules, hulls; all joints and pairs or those that matter: time against error",
    "The same tasks with every detail of geometry, with all joints and pairs and with those that a "
    "task needs; answers judged in the model of hulls with everything in it.",
    count("--cases", 8, "cases of each task"),
    seed("of the cases"),
)
def detail(arguments: argparse.Namespace) -> None:
    """Measure, judge, draw."""
    from wholebody.bench import detail

    facts = machine()
    rows, refused = [], []
    for row in detail.rows(2 if arguments.quick else arguments.cases, arguments.seed):
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
    "challenge",
    "a standing person dragged down onto a chair, by newton and qp",
    "Drag a standing person down onto a chair by the pelvis, and judge every posture and way between.",
    count("--frames", 240, "of the way"),
)
def challenge(arguments: argparse.Namespace) -> None:
    """Measure the challenge."""
    from wholebody.bench import challenge
    from wholebody.bench.drag import drag_chart
    from wholebody.cli.demo import packaged_tasks

    facts, task = machine(), packaged_tasks()[challenge.TASK]
    rows, every = challenge.measure(task, 60 if arguments.quick else arguments.frames, print)
    tables: dict[str, list[Any]] = {"challenge": rows, "challenge-frames": list(chain.from_iterable(every.values()))}
    caption = "Time of a frame and what is left to the goal, frame by frame"
    charts = {"challenge": Chart(partial(drag_chart, every), caption)}
    publish("challenge", challenge.report(rows, facts), arguments, facts=facts, tables=tables, charts=charts)

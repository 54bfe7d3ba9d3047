"""`wholebody pose`, `demo` and `gallery`: solve a task file, a packaged one, or run the example scripts."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wholebody.assessment.posture import Assessment, distance_and_angle
from wholebody.base import files
from wholebody.base.checks import known
from wholebody.base.errors import UnknownNameError
from wholebody.base.files import checked_target
from wholebody.cli.show import draw as draw_scene
from wholebody.cli.tables import console, table
from wholebody.figures.packaged_urdf import script_paths, task_paths
from wholebody.figures.state import State
from wholebody.methods.solve import method_named, solve
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.taskfile import Task, read_task, result
from wholebody.view.gallery import Exhibit, write_gallery
from wholebody.view.screenshot import Screenshots

CONTACTS = 10  # most pairs that are listed

NEAR = 0.01  # metres beyond the clearance at which a pair is listed

_COLORS = {"solved": "green", "unreachable": "yellow", "stalled": "yellow", "infeasible": "red"}


def run(arguments: argparse.Namespace, screenshots: Screenshots) -> int:
    """Pose, report and write; 1 if the posture is not a solution."""
    out = arguments.out or Path("out") / arguments.task.stem
    picture = not (arguments.no_picture or arguments.json)
    return _pose(arguments.task, arguments.method, out, arguments.json, screenshots if picture else None)


def _pose(path: Path, method: str | None, out: Path, as_json: bool, screenshots: Screenshots | None) -> int:
    """Pose the figure of a task file by a method, or that of the file; write into a folder; the exit code."""
    chosen = None if method is None else method_named(method)
    task = read_task(path)
    files.make_folder(out)
    solution = solve(task.problem, chosen or task.method)
    text = result.as_json(result.describe(task, solution, out))
    files.write(out / "result.json", text)

    if as_json:
        print(text, end="")
    else:
        show_solution(task, solution)
    with Console(stderr=as_json).status("drawing"):
        written, note = draw_scene(task.problem, solution.q, task.view, out, task.title, screenshots)
    lines = [f"wrote {file}" for file in (out / "result.json", *written)]
    print(*lines, *filter(None, [note]), sep="\n", file=sys.stderr if as_json else sys.stdout)
    return 0 if solution.solved else 1


def show_solution(task: Task, solution: Solution) -> None:
    """Print everything about a solution."""
    shown = console()
    problem, judged = task.problem, solution.assessment
    figure = problem.scene.figure
    shown.print(escape(task.title), style="bold", highlight=False)
    shown.print(
        f"{escape(figure.name)}: {figure.model.nv} degrees of freedom, {len(problem.scene.objects)} things, "
        f"{problem.scene.geometry.ngeoms} pieces, {len(problem.scene.geometry.collisionPairs)} pairs that can touch",
        highlight=False,
    )
    shown.print(
        f"[{_COLORS[solution.status]}]{solution.status}[/] by {solution.method} in {1e3 * solution.seconds:.0f} ms, "
        f"{solution.iterations} iterations: {escape(solution.message)}\n",
        highlight=False,
    )
    shown.print(_goals(task, solution))
    shown.print(_contacts(problem, solution))
    shown.print(_measures(problem, solution))
    held = judgement(table("judged independently", ""), judged)
    held.add_row("first-order optimality", f"{judged.optimality:.1e}")
    shown.print(held)


def judgement(made: Table, judged: Assessment) -> Table:
    """The table with a row for everything that must hold."""
    made.add_row("deepest penetration", f"{1e3 * judged.penetration:.4f} mm")
    made.add_row("distances, worst shortfall", f"{1e3 * judged.clearance_violation:.4f} mm")
    made.add_row("limits, worst violation", f"{math.degrees(judged.limit_violation):.4f} deg")
    made.add_row("constraints, worst violation", f"{1e3 * judged.constraint_violation:.4f} mm or mrad")
    return made


def _goals(task: Task, solution: Solution) -> Table:
    made = table("goal", "distance", "angle")
    state = State(task.problem.scene.model).update(solution.q)
    for name, goal in zip(task.goal_names, task.problem.goals, strict=True):
        distance, angle = distance_and_angle(goal, state)
        made.add_row(
            escape(name),
            "" if distance is None else f"{1e3 * distance:.3f} mm",
            "" if angle is None else f"{math.degrees(angle):.3f} deg",
        )
    return made


def _contacts(problem: Problem, solution: Solution) -> Table:
    """The nearest pairs of owners, each with its nearest pieces."""
    owners = problem.scene.piece_owner
    found = problem.scene.contacts(solution.q, within=problem.clearance + NEAR)
    nearest: dict[tuple[str, str], float] = {}
    for (a, b), distance in zip(found.pair, found.distance, strict=True):
        nearest.setdefault((owners[a], owners[b]), float(distance))
    made = table("nearest pairs", "", "distance")
    for (a, b), distance in list(nearest.items())[:CONTACTS]:
        made.add_row(escape(a), escape(b), f"{round(1e3 * distance, 2) + 0.0:.2f} mm")
    if len(nearest) > CONTACTS:
        made.add_row(f"and {len(nearest) - CONTACTS} more within {1e3 * (problem.clearance + NEAR):.0f} mm", "", "")
    if not nearest:
        made.add_row(f"none within {1e3 * (problem.clearance + NEAR):.0f} mm", "", "")
    return made


def _measures(problem: Problem, solution: Solution) -> Table:
    state = State(problem.scene.model).update(solution.q)
    made = table("measure", "weight", "value")
    for term in problem.measures:
        made.add_row(type(term).__name__, f"{term.weight:g}", f"{term.value(state):.4f}")
    return made


def demo(arguments: argparse.Namespace, screenshots: Screenshots) -> int:
    """List the tasks, or pose one."""
    tasks = task_paths()
    if arguments.list:
        for name, path in tasks.items():
            print(f"{name:25} {path}")
        return 0
    if arguments.name not in tasks:
        raise UnknownNameError("demo", arguments.name, tasks)
    code = _pose(tasks[arguments.name], None, arguments.out, False, screenshots)
    print(f"the task is {tasks[arguments.name]}; to turn the scene about, open {arguments.out / 'scene.html'}")
    return code


def gallery(arguments: argparse.Namespace) -> int:
    """Run the scripts, and write the page."""

    def say(made: Exhibit) -> None:
        print(f"{made.name}: {'failed' if made.failed else 'done'} in {made.seconds:.0f} s", flush=True)

    path = checked_target(arguments.out, "--out", "a page", (".htm", ".html"))
    scripts = script_paths()
    chosen = [known(name, scripts, "example", "gallery") for name in arguments.names] or list(scripts)
    made = write_gallery([scripts[name] for name in chosen], path, say)
    failed = [one.name for one in made if one.failed]
    print(f"{path}: {len(made)} scenes" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if failed else 0

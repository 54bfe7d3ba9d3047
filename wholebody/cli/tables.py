"""Tables for the terminal: goals, contacts, measures, figures; and progress bars."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wholebody.assessment.posture import distance_and_angle
from wholebody.base.batches import Line
from wholebody.figures.state import State

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wholebody.assessment.posture import Assessment
    from wholebody.bench.rows import Row
    from wholebody.figures import Figure
    from wholebody.problem import Problem
    from wholebody.solution import Solution
    from wholebody.taskfile import Task

CONTACTS = 10
"""Most pairs that are listed."""

NEAR = 0.01
"""Metres beyond the clearance at which a pair is listed."""

_COLORS = {"solved": "green", "unreachable": "yellow", "stalled": "yellow", "infeasible": "red"}


def console(least: int = 0) -> Console:
    """The output, whose lines have `least` letters or more, and where it is no terminal enough for all tables."""
    made = Console()
    # letters of a line in a file or a log
    made.width = max(made.width, least, 0 if made.is_terminal else 140)
    return made


@contextmanager
def bar(what: str, count: float = 1.0) -> Iterator[Callable[[float, str], Any]]:
    """Show on a terminal how far something is: the function takes how much of `count` is done, and what it is.

    The line goes when it is done.
    """
    line, shown = Line(), sys.stderr is not None and sys.stderr.isatty()
    if shown:
        line.write(0, count, what)
    try:
        yield lambda done, said: line.write(done, count, said) if shown else None
    finally:
        if shown:
            sys.stderr.write("\r\x1b[K")


def table(*columns: str, title: str = "") -> Table:
    """An empty table; every column but the first is aligned right."""
    made = Table(title=title or None, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for number, column in enumerate(columns):
        made.add_column(column, justify="right" if number else "left", header_style="dim", overflow="fold")
    return made


def print_rows(rows: Sequence[Row]) -> None:
    """Print measurements: a line a figure, a column a row."""
    from wholebody.bench.rows import shown

    made = table("", *(f"{row.case}, {row.tool}" for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row.figures):
        made.add_row(name, *(shown(row.figures[name]) if name in row.figures else "" for row in rows))
    console().print(made)


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


def show_figure(figure: Figure) -> None:
    """Describe a figure: size, names of joints, frames, groups and postures."""
    shown = console()
    model = figure.model
    mass = sum(inertia.mass for inertia in model.inertias)
    shown.print(
        f"[bold]{escape(figure.name)}[/]: {model.nv} degrees of freedom, {mass:.1f} kg, "
        f"{figure.geometry.ngeoms} pieces ({figure.detail}), "
        f"{len(figure.geometry.collisionPairs)} pairs that can touch, {figure.root} root\n",
        highlight=False,
    )
    names = table("names", "")
    names.columns[1].justify = "left"
    listed = {
        "postures": figure.postures,
        "groups": figure.groups,
        "frames": figure.frames,
        "segments": figure.segments,
    }
    for kind, known in listed.items():
        names.add_row(kind, escape(", ".join(known)))
    shown.print(names)
    joints = table("joint", "lowest", "highest", title="")
    limits = figure.limits
    ranges = dict(zip(limits.idx_q.tolist(), zip(limits.lower, limits.upper, strict=True), strict=True))
    for name in figure.joints:
        if name in figure.followers:
            law = figure.followers[name]
            joints.add_row(name, f"{law.slope:g} x {law.joint}", f"+ {law.offset:g}")
            continue
        joint = model.joints[figure.joint_id(name)]
        low, high = ranges.get(joint.idx_q, (-math.inf, math.inf))
        slides = joint.shortname().startswith("JointModelP")
        joints.add_row(
            escape(name), *(f"{end:.3f} m" if slides else f"{math.degrees(end):.1f} deg" for end in (low, high))
        )
    shown.print(joints)
    if figure.notes:
        shown.print("\nnotes", style="dim")
    for note in figure.notes:
        shown.print(f"- {note}", markup=False, highlight=False)

"""The file result.json: written after posing, and read to show the posture again."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.assessment.posture import distance_and_angle
from wholebody.base.arrays import Array, brief
from wholebody.base.checks import instance, posture
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import FileFormatError, one_line
from wholebody.base.files import checked_target, finite, read_text, write
from wholebody.figures.state import State
from wholebody.geometry.placement import FARTHEST
from wholebody.solution import Solution
from wholebody.taskfile.task import Task, read_task
from wholebody.taskfile.writing import root_places
from wholebody.tasks.base import Measure
from wholebody.version import __version__


def describe(task: Task, solution: Solution, folder: Path) -> dict[str, Any]:
    """Return the content of result.json."""
    figure, q = task.problem.scene.figure, solution.q
    state = State(figure.model).update(q)
    errors = [
        (name, *distance_and_angle(goal, state)) for name, goal in zip(task.goal_names, task.problem.goals, strict=True)
    ]
    roots = root_places(figure, q)
    return {
        "wholebody": __version__,
        "task": os.path.relpath(task.path.resolve(), folder.resolve()),
        "title": task.title,
        "figure": figure.name,
        "method": solution.method,
        "status": solution.status,
        "message": solution.message,
        "seconds": solution.seconds,
        "iterations": solution.iterations,
        "programs": dict(solution.programs),
        "goals": [{"name": name, "distance": distance, "angle": angle} for name, distance, angle in errors],
        "measures": _values(task.problem.measures, state),
        "assessment": solution.assessment.summary(),
        "root": roots.get("root", roots or None),
        "joints": figure.joint_values(q),
        "q": q.tolist(),
    }


def _values(measures: Sequence[Measure], state: State) -> dict[str, float]:
    """The value of each measure by its class; the second and later ones of a class have a number."""
    found: dict[str, float] = {}
    for number, term in enumerate(measures):
        kind = type(term).__name__
        count = sum(type(one) is type(term) for one in measures[: number + 1])
        found[kind if count == 1 else f"{kind} {count}"] = float(term.value(state))
    return found


def as_json(description: dict[str, Any]) -> str:
    """Return JSON; numbers that are not finite (the least distance without pairs) become null."""
    return json.dumps(finite(description), indent=2, allow_nan=False) + "\n"


class Result(NamedTuple):
    """A result that was read: a task and the posture that a method found for it.

    Attributes:
        task: the task; `wb.assess(result.task.problem, result.q)` judges the posture again.
        q: (nq,) the posture.
        status: "solved", "unreachable", "infeasible" or "stalled".
        message: the sentence that explains the status.
        method: name of the method.
        joints: joint to its value, radians or metres.

    Examples:
        >>> result = wb.taskfile.read_result(result_file)
        >>> result.status, result.q.shape == solution.q.shape
        ('solved', True)
    """

    task: Task
    q: Array
    status: str
    message: str
    method: str
    joints: dict[str, float]

    def __repr__(self) -> str:
        return brief(self)


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read a result.json that `wholebody pose` or `write_result` wrote, and its task.

    Raises:
        FileFormatError: it is not a result, or does not fit the present task.
        InputError: the path is none.
        WholebodyError: its task cannot be read.

    Examples:
        >>> wb.taskfile.read_result(result_file).status
        'solved'
    """
    file, again = checked_path(path, "read_result: path"), "give a result.json that `wholebody pose` wrote"
    text = read_text(file, "result")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: is no JSON ({one_line(str(error))}); {again}") from None
    if not isinstance(data, dict) or not isinstance(data.get("task"), str) or not isinstance(data.get("q"), list):
        raise FileFormatError(f"{file}: has no task and q; {again}")
    task = read_task(file.parent / data["task"])
    figure, numbers = task.problem.scene.figure, data["q"]
    good = [isinstance(entry, (int, float)) and abs(entry) <= FARTHEST for entry in numbers]
    if len(good) != figure.model.nq or not all(good):
        raise FileFormatError(
            f"{file}, key q: is not {figure.model.nq} finite numbers, as the figure of its task needs; "
            "pose the task again"
        )
    q = np.array(numbers, dtype=float)
    texts = {name: data.get(name) for name in ("status", "message", "method")}
    wrong = next((name for name, value in texts.items() if not isinstance(value, str)), None)
    if wrong is not None:
        raise FileFormatError(f"{file}, key {wrong}: is no text; {again}")
    return Result(task, q, **texts, joints=figure.joint_values(q))  # type: ignore[arg-type]


def write_result(task: Task, solution: Solution, path: str | os.PathLike[str]) -> Path:
    """Write the solution of a task as a result.json, as `wholebody pose` does.

    Raises:
        InputError: not a task or not a solution of its figure, or the file cannot be written or does not end in
            .json.

    Examples:
        >>> task = wb.read_task(task_file)
        >>> path = wb.taskfile.write_result(task, wb.solve(task.problem), folder / "again.json")
    """
    file = checked_target(path, "write_result: path", "a result", (".json",))
    instance(task, Task, "write_result: task", "give one of wb.read_task")
    instance(solution, Solution, "write_result: solution", "give one of wb.solve")
    posture(solution.q, task.problem.scene.model.nq, "write_result: the solution's posture")
    return write(file, as_json(describe(task, solution, file.parent)))

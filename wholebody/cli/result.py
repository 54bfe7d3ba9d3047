"""A posture as a file: result.json, written after posing and read to look at it again."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.arrays import Array
from wholebody.errors import FileFormatError, one_line
from wholebody.figures.state import State
from wholebody.files import read_text
from wholebody.geometry.placement import FARTHEST
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.taskfile import Task, read_task
from wholebody.version import __version__


class GoalLeft(NamedTuple):
    """What is left of one goal.

    Attributes:
        name: its type and what it moves.
        distance: metres left; None where it has no place to reach.
        angle: radians left; None where it has no direction to reach.
    """

    name: str
    distance: float | None
    angle: float | None


def goals_left(task: Task, q: Array) -> list[GoalLeft]:
    """What is left of every goal at the posture q, shape (nq,)."""
    state = State(task.problem.scene.model).update(q)
    found = []
    for name, goal in zip(task.goal_names, task.problem.goals, strict=True):
        error = goal.error(state)
        angular = np.broadcast_to(goal.angular, error.shape)
        parts = [float(np.linalg.norm(error[mask])) if mask.any() else None for mask in (~angular, angular)]
        found.append(GoalLeft(name, *parts))
    return found


def describe(task: Task, solution: Solution, folder: Path) -> dict[str, Any]:
    """Return what result.json says.

    Args:
        task: what was asked.
        solution: what was answered.
        folder: where the file will be; the task file is named relative to it.
    """
    figure, q = task.problem.scene.figure, solution.q
    state = State(figure.model).update(q)
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
        "goals": [goal._asdict() for goal in goals_left(task, q)],
        "measures": {type(term).__name__: float(term.value(state)) for term in task.problem.measures},
        "assessment": solution.assessment.summary(),
        "root": q[:7].tolist() if figure.root == "free" else None,
        "joints": figure.joint_values(q),
        "q": q.tolist(),
    }


def as_json(description: dict[str, Any]) -> str:
    """Return JSON; numbers that are not finite (the least distance where nothing can touch) become null."""
    return json.dumps(_finite(description), indent=2, allow_nan=False) + "\n"


def read(path: Path) -> tuple[Task, Array]:
    """Read a result: the task it belongs to, and its posture (nq,).

    Raises:
        FileFormatError: it is not a result, or not of the task as it is now.
        WholebodyError: its task cannot be read.
    """
    text = read_text(path, "result")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        why = one_line(str(error))
        raise FileFormatError(f"{path}: is no JSON ({why}); give a result.json that `wholebody pose` wrote") from None
    if not isinstance(data, dict) or not isinstance(data.get("task"), str) or not isinstance(data.get("q"), list):
        raise FileFormatError(f"{path}: has no task and q; give a result.json that `wholebody pose` wrote")
    task = read_task(path.parent / data["task"])
    return task, _posture(path, data["q"], task.problem)


def _posture(path: Path, entries: list[Any], problem: Problem) -> Array:
    numbers = [entry for entry in entries if isinstance(entry, (int, float)) and abs(entry) <= FARTHEST]
    wanted = problem.scene.model.nq
    if len(entries) != wanted or len(numbers) != wanted:
        raise FileFormatError(
            f"{path}, key q: is not {wanted} finite numbers, as the figure of its task needs; pose the task again"
        )
    return np.array(numbers, dtype=float)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

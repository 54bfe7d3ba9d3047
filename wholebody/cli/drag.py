"""`wholebody drag`: drag a goal of a task along a path, frame by frame, by any method."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import is_file, make_folder
from wholebody.bench.rows import chart, report
from wholebody.bench.tables import machine, write_rows, write_text
from wholebody.cli.frames import drag_rows, frame_panels, is_clean
from wholebody.cli.show import viewer_of
from wholebody.cli.tables import bar, print_rows
from wholebody.methods.solve import method_named
from wholebody.problem import Problem
from wholebody.taskfile import Task, read_task, write_task
from wholebody.tasks import Frame, Orientation, Point, Relative
from wholebody.tasks.inputs import point
from wholebody.tracking.dragging import (
    Dragged,
    DragJudgement,
    drag_along,
    judge_drag,
    present_position,
    target_position,
)
from wholebody.tracking.live import LiveDrag
from wholebody.tracking.moving_goals import moving_goal
from wholebody.tracking.path_following import circle, read_path, spread
from wholebody.view.live_page import LivePage


def run(arguments: argparse.Namespace) -> int:
    """Drag, assess, report and write; 1 if the end is not met or something was penetrated."""
    if arguments.live:
        return live(arguments)
    method_named(arguments.method)
    task = read_task(arguments.task)
    goal = _goal(task.problem, arguments.goal)
    places = spread(_corners(task.problem, goal, arguments), arguments.frames)
    out = arguments.out or Path("out") / "drag" / arguments.task.stem
    make_folder(out)
    dragged, judged = followed(task.problem, places, arguments.method, goal, f"{task.path.stem}, {arguments.method}")
    name, facts = f"{task.path.stem}-{arguments.method}", machine()
    row, frames = drag_rows(task.path.stem, dragged, judged)
    write_rows(out / f"{name}.csv", facts, frames)
    meaning = (
        "The error is the distance of what is dragged from where the goal is in that frame; at the end its "
        "angle, in mrad, where that is more. Depths are found by coal over every pair of pieces; between frames "
        "stands a bound, found by a continuous sweep, on how much deeper any pair gets in between than at its deeper "
        "end. Jerk is the third difference of the joint angles, rad/s³; CPU is the time that the processor worked on a "
        "frame; holds are in mm or mrad."
    )
    write_text(out / f"{name}.md", report(meaning, {"": [row]}, facts) + "\n")
    chart(frame_panels(frames, ("ms", "CPU ms"), ("error mm",)), out / name)
    _animation(task, dragged, out / f"{name}.html")
    print_rows([row])
    print(f"end: {dragged.end.message}")
    print(f"wrote {out}")
    return 0 if is_clean(row) and dragged.end.solved else 1


def live(arguments: argparse.Namespace) -> int:
    """Let the figure be dragged in a browser until Ctrl-C."""
    if not 1024 <= arguments.port <= 65535:
        raise InputError(f"--port is {arguments.port}; give a number from 1024 to 65535")
    task = read_task(arguments.task)
    drag = LiveDrag(task.problem, arguments.method)
    out = arguments.out or Path("out") / "drag" / arguments.task.stem
    make_folder(out)

    def saved(path: Path) -> Path:
        return write_task(drag.stated(goals=drag.problem.goals), path, title=f"{task.title}, dragged")

    page = LivePage(drag, out / "posture.toml", arguments.port, saved, view=task.view)
    print(f"drag the handles at {page.url}; Ctrl-C ends", flush=True)
    page.serve()
    return 0


def followed(problem: Problem, places: Any, method: str, goal: int, label: str) -> tuple[Dragged, DragJudgement]:
    """Drag and assess, with a progress bar."""
    with bar(label, len(places)) as tell:
        dragged = drag_along(problem, places, method, goal=goal, progress=lambda done: tell(done, label))
        tell(len(places), "judging every pair of every frame")
        return dragged, judge_drag(problem, dragged, goal=goal)


def _goal(problem: Problem, number: int | None) -> int:
    if number is None:
        kinds = (Point, Frame), (Relative,)
        found = (k for kind in kinds for k, goal in enumerate(problem.goals) if isinstance(goal, kind))
        number = next(found, None)
        if number is None:
            raise InputError("the task has no point, frame or relative goal that could be dragged; give it one")
    if isinstance(moving_goal(problem, number), Orientation):
        raise InputError(
            f"--goal: goals[{number}] is an Orientation, which has no place; name a point, a frame or a relative"
        )
    return number


def _corners(problem: Problem, goal: int, arguments: argparse.Namespace) -> Any:
    """Corners (k, 3) of the path, from the position of the dragged frame."""
    if arguments.path == "line":
        end = target_position(problem, goal) if arguments.to is None else point(arguments.to, "--to")
        way = end[None]
    elif arguments.path == "circle":
        way = circle(target_position(problem, goal), arguments.size, arguments.normal)
    elif is_file(arguments.path):
        way = read_path(arguments.path)
    else:
        raise FileFormatError(f"--path: there is no file {arguments.path}; give line, circle or a file of places")
    return np.vstack([present_position(problem, goal), way])


def _animation(task: Task, dragged: Dragged, path: Path) -> None:
    with viewer_of(task.problem, task.view, task.title) as viewer:
        viewer.play(dragged, repeat=float("inf"))
        viewer.save(path)

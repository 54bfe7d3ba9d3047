"""`wholebody pose`: solve the problem of a task file, and write posture, scene and picture."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.command import command, flag, option
from wholebody.methods import METHODS

if TYPE_CHECKING:
    from wholebody.view.screenshot import Screenshots


@command(
    "pose",
    "find a posture for a task file",
    """\
Find a posture for a task file, print how good it is, and write into a folder:

  result.json   the posture, joints by name (rad), and its assessment
  scene.html    the scene, for any browser, without a network
  scene.png     a picture of it (needs Chromium; not with --json or --no-picture)

docs/taskfile.md lists everything that a task file can contain.""",
    option("task", type=Path, metavar="TASK.toml", help="the task file"),
    option("--method", metavar="NAME", help=f"method, in place of the file's: {', '.join(METHODS)}"),
    option("--out", type=Path, metavar="DIR", help="folder to write to (default: out/NAME-OF-TASK)"),
    flag("--json", "print the result as JSON instead of tables; no picture"),
    flag("--no-picture", "do not draw scene.png, which takes seconds"),
    epilog="""\
examples:
  wholebody pose shelf.toml
  wholebody pose shelf.toml --method qp --out results/shelf
  wholebody pose shelf.toml --json | jq .joints""",
)
def run(arguments: argparse.Namespace) -> int:
    """Pose, report and write; 1 if the posture is not a solution."""
    out = arguments.out or Path("out") / arguments.task.stem
    picture = not (arguments.no_picture or arguments.json)
    return pose(arguments.task, arguments.method, out, as_json=arguments.json, draw=picture)


def pose(path: Path, method: str | None, out: Path, *, as_json: bool = False, draw: bool = True) -> int:
    """Pose the figure of a task file by a method, or that of the file; write into a folder; the exit code."""
    from wholebody.base.files import is_file
    from wholebody.view.screenshot import Screenshots

    with Screenshots() as screenshots:
        if draw and is_file(path):
            screenshots.start()  # it gets ready while the posture is found
        return _pose(path, method, out, as_json, screenshots if draw else None)


def _pose(path: Path, method: str | None, out: Path, as_json: bool, screenshots: Screenshots | None) -> int:
    from wholebody.base import files
    from wholebody.cli.show import draw as draw_scene
    from wholebody.methods.solve import method_named, solve
    from wholebody.taskfile import read_task, result

    chosen = None if method is None else method_named(method)
    task = read_task(path)
    files.make_folder(out)
    solution = solve(task.problem, chosen or task.method)
    text = result.as_json(result.describe(task, solution, out))
    files.write(out / "result.json", text)

    from rich.console import Console  # needed only for tables and pictures, so imported after the result is written

    if as_json:
        print(text, end="")
    else:
        from wholebody.cli import tables

        tables.show_solution(task, solution)
    with Console(stderr=as_json).status("drawing"):
        written, note = draw_scene(task.problem, solution.q, task.view, out, task.title, screenshots)
    lines = [f"wrote {file}" for file in (out / "result.json", *written)]
    print(*lines, *filter(None, [note]), sep="\n", file=sys.stderr if as_json else sys.stdout)
    return 0 if solution.solved else 1

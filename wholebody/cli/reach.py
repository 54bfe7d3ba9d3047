"""`wholebody reach`: which places of a grid a frame of a task's figure can reach."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import JOBS, JOINED
from wholebody.cli.command import command, option


@command(
    "reach",
    "map the places that a hand or another frame can reach",
    """\
Find which places of a grid a frame of a task file's figure reaches, under all conditions of the task file except its
goals, and write into a folder:

  reach.png    heat maps of all heights, seen from above
  reach.html   the same with a slider, for any browser
  reach.npz    all arrays: verdicts, distances left, postures
  reach.vtk    verdicts and distances, for ParaView and the like""",
    option("task", type=Path, metavar="TASK.toml", help="the task file: figure, things, constraints"),
    option("--frame", required=True, metavar="NAME", help="the frame that reaches"),
    option("--low", required=True, metavar=JOINED, help="least corner of the grid, metres"),
    option("--high", required=True, metavar=JOINED, help="greatest corner"),
    option("--step", default="0.1", metavar="M", help="metres between places, or X,Y,Z (default: 0.1)"),
    *JOBS,
    option("--out", type=Path, metavar="DIR", help="folder to write to (default: out/NAME-OF-TASK)"),
    epilog="""\
examples:
  wholebody reach seat.toml --frame right_index_tip --low 0,-0.8,0.4 --high 1.0,0.4,1.6 --step 0.1
  wholebody reach seat.toml --frame left_palm --low 0.2,-0.5,0.9 --high 0.9,0.5,0.9 --step 0.05 --jobs 2""",
)
def run(arguments: argparse.Namespace) -> int:
    """Search and write; 1 if no place is reached."""
    from rich.console import Console

    from wholebody.base.files import make_folder
    from wholebody.studies.reach_map import reach_map
    from wholebody.taskfile import read_task

    low, high = _numbers(arguments.low, "--low"), _numbers(arguments.high, "--high")
    step = _numbers(arguments.step, "--step") if "," in arguments.step else _numbers(arguments.step, "--step", 1)[0]
    task = read_task(arguments.task)
    task.problem.retarget([])
    out = arguments.out or Path("out") / arguments.task.stem
    make_folder(out)
    with Console(stderr=True).status("searching") as status:
        found = reach_map(
            task.problem, arguments.frame, low, high, step, jobs=arguments.at_once, cluster=arguments.cluster,
            progress=lambda done, total: status.update(f"{done} of {total} places"),
        )  # fmt: skip
    print(found)
    for write, name in ((found.picture, "png"), (found.html, "html"), (found.save, "npz"), (found.to_vtk, "vtk")):
        print(f"wrote {write(out / f'reach.{name}')}")
    return 0 if found.reached.any() else 1


def _numbers(text: str, what: str, count: int = 3) -> list[float]:
    """Numbers separated by commas; raises InputError where they are something else."""
    from wholebody.base.checks import shown
    from wholebody.base.errors import InputError

    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        wanted = "a number" if count == 1 else f"{count} numbers with commas, such as 0.2,-0.5,0.9"
        raise InputError(f"{what} is {shown(text)}; give {wanted}")
    return numbers

"""`wholebody study` and `reach`: one task for many people, targets and layouts; which places a frame reaches."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from wholebody.base.checks import shown
from wholebody.base.errors import InputError
from wholebody.base.files import make_folder
from wholebody.cli.tables import console, table
from wholebody.studies.reach_map import reach_map
from wholebody.studies.study import study
from wholebody.studies.study_files import read_study
from wholebody.taskfile import read_task


def run_study(arguments: argparse.Namespace) -> int:
    """Solve, report and write; 1 if a case is not solved."""
    asked = read_study(arguments.study)
    out = arguments.out or Path("out") / arguments.study.stem
    make_folder(out)
    with Console(stderr=True).status("solving") as status:
        records = study(
            **asked, jobs=arguments.at_once, cluster=arguments.cluster, folder=out,
            progress=lambda state: status.update(f"{state.done} of {state.total}"),
        )  # fmt: skip
    made = table("case", "outcome", "goal error", "overlap", "time")
    for one in records:
        error, overlap = f"{1e3 * one.goal_error:.2f} mm", f"{1e3 * one.penetration:.3f} mm"
        made.add_row(one.name, one.outcome, error, overlap, f"{1e3 * one.seconds:.0f} ms")
    console().print(made)
    counts = ", ".join(f"{count} {outcome}" for outcome, count in records.counts().items())
    print(f"{len(records)} case{'' if len(records) == 1 else 's'}: {counts}")
    for one in records:
        if one.q is None:
            print(f"{one.name}: {one.message}", file=sys.stderr)
    print(f"wrote {records.to_csv(out / 'cases.csv')}")
    return 0 if all(one.solved for one in records) else 1


def run_reach(arguments: argparse.Namespace) -> int:
    """Search and write; 1 if no place is reached."""
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
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        wanted = "a number" if count == 1 else f"{count} numbers with commas, such as 0.2,-0.5,0.9"
        raise InputError(f"{what} is {shown(text)}; give {wanted}")
    return numbers

"""`wholebody study`: one task for many people, targets and layouts."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from wholebody.base.files import make_folder
from wholebody.cli.tables import console, table
from wholebody.studies.study import study
from wholebody.studies.study_files import read_study


def run(arguments: argparse.Namespace) -> int:
    """Solve, report and write; 1 if a case is not solved."""
    asked = read_study(arguments.study)
    out = arguments.out or Path("out") / arguments.study.stem
    make_folder(out)
    with Console(stderr=True).status("solving") as status:
        records = study(
            asked.task, people=asked.people, targets=asked.targets, layouts=asked.layouts, method=asked.method,
            warm_start=asked.warm_start, jobs=arguments.at_once, cluster=arguments.cluster, folder=out,
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

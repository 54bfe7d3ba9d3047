"""`wholebody assess`: judge the posture of a result again, and score its ergonomics."""

from __future__ import annotations

import argparse
import math
from typing import Any

from rich.markup import escape

from wholebody.assessment.posture import assess
from wholebody.base.errors import InputError
from wholebody.cli.arguments import OF_WORK
from wholebody.cli.pose import judgement
from wholebody.cli.tables import console, table
from wholebody.ergonomics.angles import check_person
from wholebody.ergonomics.assessment import ergonomics_of
from wholebody.ergonomics.work import Work
from wholebody.figures.strength import Strength
from wholebody.taskfile import result

OF_SCORES = {*OF_WORK, "load", "coupling", "seated", "sex", "percentile"}
"""Options that only the scores of ergonomics read."""


def run(arguments: argparse.Namespace) -> int:
    """Judge and print; 1 if the posture violates something."""
    given = {name: value for name, value in vars(arguments).items() if name in OF_SCORES and value is not None}
    if given and not arguments.ergonomics:
        raise InputError(
            f"--{next(iter(given)).replace('_', '-')} is read by the scores of ergonomics alone; add --ergonomics"
        )
    found = result.read_result(arguments.result)
    task, q = found.task, found.q
    judged = assess(task.problem, q)
    described: dict[str, Any] = {"assessment": judged.summary()}
    scores = None
    if arguments.ergonomics:
        figure = task.problem.scene.figure
        if figure.root == "several":
            raise InputError(
                f"--ergonomics scores one person, not {' and '.join(figure.members)}; in Python, wb.ergonomics."
                "ergonomics_of(figure.members[name].figure, figure.part(name, q)) scores each"
            )
        check_person(figure, "--ergonomics")
        strength = Strength(**{name: given.pop(name) for name in ("percentile", "sex") if name in given})
        if "seated" in given:
            given["seated"] = given["seated"] == "yes"
        scores = ergonomics_of(task.problem.scene, q, Work(**given), strength)
        described["ergonomics"] = scores.summary()
    if arguments.json:
        print(result.as_json(described), end="")
    else:
        _show(judged, scores)
    return 0 if judged.holds(1e-4) else 1  # m, rad: of limits, constraints and clearances


def _show(judged: Any, scores: Any) -> None:
    shown = console()
    made = table("judged", "")
    made.add_row("goals missed by", f"{1e3 * judged.goal_error:.3f} mm, {math.degrees(judged.goal_angle):.3f} deg")
    shown.print(judgement(made, judged))
    if scores is not None:
        made = table("ergonomics", "left", "right", "worse")
        made.columns[3].justify = "left"
        for row in scores.rows():
            made.add_row(*map(escape, row))
        shown.print(made)

"""`wholebody assess`: judge the posture of a result again, and score its ergonomics."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from wholebody.base.errors import InputError
from wholebody.cli.command import command, flag, option

FLAGS = {
    "static": "the posture is held for minutes",
    "repeated": "the action is repeated more than four times a minute",
    "shock": "the load comes with a shock",
    "unstable": "the base is unstable, or the posture changes rapidly",
    "arms_supported": "the arms rest on something",
    "walking": "the person walks",
}
OF_SCORES = {*FLAGS, "load", "coupling", "seated", "sex", "percentile"}
"""Options that only the scores of ergonomics read."""


@command(
    "assess",
    "judge a posture, and score its ergonomics",
    """\
Judge the posture of a result.json that `wholebody pose` wrote: goals, overlaps, limits, constraints. With --ergonomics
print RULA, REBA, OWAS and the torques against published strength too; --json prints all of it.""",
    option("result", type=Path, metavar="RESULT.json", help="the result"),
    flag("--ergonomics", "score the ergonomics of a person"),
    option("--load", type=float, metavar="KG", help="mass in both hands (default: 0)"),
    option("--coupling", metavar="WORD", help="grip: good (default), fair, poor, unacceptable"),
    *(
        option(f"--{name.replace('_', '-')}", action="store_const", const=True, help=says)
        for name, says in FLAGS.items()
    ),
    option(
        "--seated",
        choices=("yes", "no"),
        help="whether the person sits (default: decided by what is below, or the posture)",
    ),
    option("--sex", metavar="SEX", help="of the strength: male or female (default: the person's)"),
    option("--percentile", type=float, metavar="P", help="of the strength, 5 to 95 (default: 50)"),
    flag("--json", "print JSON instead of tables"),
    epilog="""\
examples:
  wholebody assess out/shelf/result.json --ergonomics
  wholebody assess out/shelf/result.json --ergonomics --load 6 --repeated --json
exit code: 1 if the posture violates a limit, a constraint or a clearance by more than 0.1 mm or mrad""",
)
def run(arguments: argparse.Namespace) -> int:
    """Judge and print; 1 if the posture violates something."""
    given = {name: value for name, value in vars(arguments).items() if name in OF_SCORES and value is not None}
    if given and not arguments.ergonomics:
        raise InputError(
            f"--{next(iter(given)).replace('_', '-')} is read by the scores of ergonomics alone; add --ergonomics"
        )
    from wholebody.assessment.posture import assess
    from wholebody.taskfile import result

    found = result.read_result(arguments.result)
    task, q = found.task, found.q
    judged = assess(task.problem, q)
    described: dict[str, Any] = {"assessment": judged.summary()}
    scores = None
    if arguments.ergonomics:
        from wholebody.ergonomics.angles import check_person
        from wholebody.ergonomics.assessment import ergonomics_of
        from wholebody.ergonomics.work import Work
        from wholebody.motion.strength import Strength

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
    import math

    from rich.markup import escape

    from wholebody.cli.tables import console, judgement, table

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

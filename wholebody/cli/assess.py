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


@command(
    "assess",
    "judge a posture, and score its ergonomics",
    """\
Judge the posture of a result.json that `wholebody pose` wrote: goals, overlaps, limits, constraints. With --ergonomics
print RULA, REBA, OWAS and the torques against published strength too; --json prints all of it.""",
    option("result", type=Path, metavar="RESULT.json", help="the result"),
    flag("--ergonomics", "score the ergonomics of a person"),
    option("--load", type=float, default=0.0, metavar="KG", help="mass in both hands (default: 0)"),
    option("--coupling", default="good", metavar="WORD", help="grip: good, fair, poor, unacceptable"),
    *(flag(f"--{name.replace('_', '-')}", says) for name, says in FLAGS.items()),
    option(
        "--seated",
        choices=("yes", "no"),
        help="whether the person sits (default: told by what is below, or the posture)",
    ),
    option("--sex", default="male", metavar="SEX", help="of the strength: male or female (default: male)"),
    option("--percentile", type=float, default=50.0, metavar="P", help="of the strength, 5 to 95 (default: 50)"),
    flag("--json", "print JSON instead of tables"),
    epilog="""\
examples:
  wholebody assess out/shelf/result.json --ergonomics
  wholebody assess out/shelf/result.json --ergonomics --load 6 --repeated --json
exit code: 1 if the posture violates a limit, a constraint or a clearance by more than 0.1 mm or mrad""",
)
def run(arguments: argparse.Namespace) -> int:
    """Judge and print; 1 if the posture violates something."""
    _check_options(arguments)
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

        check_person(task.problem.scene.figure, "--ergonomics")
        told = {name: getattr(arguments, name) for name in FLAGS}
        seated = None if arguments.seated is None else arguments.seated == "yes"
        work = Work(arguments.load, coupling=arguments.coupling, seated=seated, **told)
        scores = ergonomics_of(task.problem.scene, q, work, Strength(arguments.percentile, arguments.sex))
        described["ergonomics"] = scores.summary()
    if arguments.json:
        print(result.as_json(described), end="")
    else:
        _show(judged, scores)
    return 0 if judged.holds(1e-4) else 1  # m, rad: of limits, constraints and clearances


def _check_options(arguments: argparse.Namespace) -> None:
    """Refuse options that only the scores of ergonomics read, where these are not asked for."""
    usual = {"load": 0.0, "coupling": "good", "seated": None, "sex": "male", "percentile": 50.0} | dict.fromkeys(
        FLAGS, False
    )
    given = [name for name, value in usual.items() if getattr(arguments, name) != value]
    if given and not arguments.ergonomics:
        raise InputError(f"--{given[0].replace('_', '-')} is read by the scores of ergonomics alone; add --ergonomics")


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

"""`wholebody bench ablation`: counts of work, which no clock disturbs."""

from __future__ import annotations

import argparse

from wholebody.base.errors import InputError
from wholebody.bench.tables import machine
from wholebody.cli.bench.command import measuring, publish
from wholebody.cli.bench.measuring import chosen
from wholebody.cli.command import count, option

PROBLEMS = 6  # of every set, where --count is left out


@measuring(
    "ablation",
    "what each constant and mechanism of a method is worth, in counts",
    "Change one constant or switch one mechanism off at a time, and count answers that differ.",
    option("--method", default="qp", choices=("qp", "newton", "ccd", "motion"), help="motion: of clips (default: qp)"),
    option(
        "--only",
        nargs="+",
        metavar="MODULE",
        help="with --method motion: modules of wholebody.motion (default: all that are looked at)",
    ),
    count("--count", None, f"problems of every set, for the other methods (default: {PROBLEMS}, 1 with --quick)"),
)
def ablation(arguments: argparse.Namespace) -> None:
    """Measure and report.

    Raises:
        InputError: an option that the method does not have.
        UnknownNameError: there is no such module.
    """
    if arguments.method == "motion":
        if arguments.count is not None:
            raise InputError("--method motion takes clips and no problems; leave --count out")
        _of_motion(arguments)
        return
    if arguments.only is not None:
        raise InputError(f"--only chooses modules of --method motion, not of {arguments.method}; leave it out")
    from wholebody.bench.suite import ablation

    each = arguments.count or (1 if arguments.quick else PROBLEMS)
    given = ablation.problems(each, arguments.method)
    named = ablation.mechanisms(arguments.method)
    whole, rows = ablation.ablation(arguments.method, given, named, print)
    compiled = ablation.constants(arguments.method)[1]
    text = ablation.report(arguments.method, len(given), whole, rows, compiled)
    name = f"ablation-{arguments.method}"
    publish(name, text, arguments, facts=machine(), tables={name: rows})


def _of_motion(arguments: argparse.Namespace) -> None:
    from wholebody.bench.measure import motion_ablation as ablated
    from wholebody.bench.rows import report
    from wholebody.figures import load

    only = chosen(arguments.only, ablated.USED, "--only")
    cases = ablated.CASES[-2:] if arguments.quick else ablated.CASES
    facts, rows = machine(), ablated.ablation(load("human"), print, cases, only)
    shown = [row for row in rows if ablated.matters(row)]
    unnoticed = sorted({row.case for row in rows} - {row.case for row in shown})
    about = "Constants of `wb.avoid`, halved and doubled on clips: changes, summed over the cases."
    text = report(about, {"": shown}, facts, [f"changes nothing: {name}" for name in unnoticed])
    publish("ablation-motion", text, arguments, facts=facts, tables={"ablation-motion": rows})

"""`wholebody bench ablation`: counts of work, which no clock disturbs."""

from __future__ import annotations

import argparse

from wholebody.base.errors import InputError
from wholebody.bench.machine import machine
from wholebody.cli.bench.command import measuring, publish
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
    from wholebody.bench.measure.motion import ablated
    from wholebody.bench.measure.motion.cases import chosen
    from wholebody.figures import load

    only = chosen(arguments.only, tuple(ablated.USED), "--only")
    cases = ablated.CASES[-2:] if arguments.quick else ablated.CASES
    rows = ablated.ablation(load("human"), print, cases, only)[1]
    publish("ablation-motion", ablated.report(rows), arguments, facts=machine(), tables={"ablation-motion": rows})

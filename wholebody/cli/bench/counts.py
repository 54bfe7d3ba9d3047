"""`wholebody bench ablation` and `regress`: counts of work, which no clock disturbs."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.base.errors import InputError
from wholebody.bench.machine import machine
from wholebody.cli.bench.command import command, count, measuring, option, publish

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
    from wholebody.bench import ablation

    each = arguments.count or (1 if arguments.quick else PROBLEMS)
    given = ablation.problems(each, arguments.method)
    named = ablation.mechanisms(arguments.method)
    whole, rows = ablation.ablation(arguments.method, given, named, print)
    compiled = ablation.constants(arguments.method)[1]
    text = ablation.report(arguments.method, len(given), whole, rows, compiled)
    name = f"ablation-{arguments.method}"
    publish(name, text, arguments, facts=machine(), tables={name: rows})


def _of_motion(arguments: argparse.Namespace) -> None:
    from wholebody.bench.motion import ablated
    from wholebody.bench.motion.cases import chosen
    from wholebody.figures import load

    only = chosen(arguments.only, tuple(ablated.USED), "--only")
    cases = ablated.CASES[-2:] if arguments.quick else ablated.CASES
    rows = ablated.ablation(load("human"), print, cases, only)[1]
    publish("ablation-motion", ablated.report(rows), arguments, facts=machine(), tables={"ablation-motion": rows})


@command(
    "regress",
    "counts of work, beside those that are locked",
    """\
Count what the methods do on a fixed selection of problems, reaches, drags and hard cases: iterations, kinematic passes,
pairs asked of coal, contact rows, programs, memory of a step. Counts are the same on every machine but for rounding, so
they show what a noisy clock does not. They are compared with locked ones; each that differs by more than its margin is
told in one sentence, and the exit code is 1 where one is worse. Times are told and compare nothing.""",
    option("--update", action="store_true", help="lock the counts as they are now"),
    option("--locked", type=Path, metavar="FILE", help="locked counts (default: those of the package)"),
)
def regress(arguments: argparse.Namespace) -> int:
    """Count and compare; 1 where a count is worse than the locked one."""
    from wholebody.bench.regress import comparison
    from wholebody.bench.regress.selection import runs

    path: Path = arguments.locked or comparison.LOCKED
    locked = comparison.read(path) if path.exists() or not arguments.update else {}
    counted = []
    for run in runs():
        counted.append(run)
        said = ", ".join(f"{name} {count}" for name, count in run.counts.items())
        print(f"{run.name}: {said}; {1e3 * run.seconds:.0f} ms", flush=True)
    print(f"\n{len(counted)} runs in {sum(run.seconds for run in counted):.1f} s of the processor")
    differences = list(comparison.compared(locked, counted)) if locked else []
    for difference in differences:
        print(f"{'worse' if difference.worse else 'differs'}: {difference.sentence}")
    if arguments.update:
        comparison.write(counted, path)
        print(f"wrote {path}")
        return 0
    if not differences:
        print(f"all counts are within their margins of {path}")
    return int(any(difference.worse for difference in differences))

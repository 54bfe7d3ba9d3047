"""`wholebody bench regress`: counts that do not depend on the machine, compared with those that were locked."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands

DESCRIPTION = """\
Count what the methods do on a fixed selection of problems, reaches, drags and hard cases: iterations, kinematic passes,
pairs asked of coal, contact rows, programs, memory of a step. Counts are the same on every machine but for rounding, so
they show what a noisy clock does not. They are compared with locked ones; each that differs by more than its margin is
told in one sentence, and the exit code is 1 where one is worse. Times are told and compare nothing."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "regress", help="counts of work, beside those that are locked", description=DESCRIPTION
    )
    parser.add_argument("--update", action="store_true", help="lock the counts as they are now")
    parser.add_argument("--locked", type=Path, metavar="FILE", help="locked counts (default: those of the package)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
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

"""`wholebody bench held-out`: distributions that no constant was tuned on, beside those that they were."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring, publish

DESCRIPTION = """\
Solve problems of distributions that no constant was tuned on: uniform witnesses, other people, other clutter, robots as
they come. The shares stand beside those of the sets that were tuned on, with intervals. A run that was ended goes on
where it was when it is called again with the same settings and folder."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "held-out",
        help="distributions that nothing was tuned on, beside the sets",
        description=DESCRIPTION,
    )
    parser.add_argument("--methods", nargs="+", metavar="NAME", help="methods (default: qp and three peers)")
    parser.add_argument("--cases", type=int, metavar="N", help="problems of each set (default: 40; with --quick 4)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all problems (default: 0)")
    parser.add_argument("--minutes", type=float, metavar="N", help="of solving in all (default: 20)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="cases beside each other (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Measure, judge, publish."""
    from datetime import date

    from wholebody.bench.adapters import adapters, installed
    from wholebody.bench.compare import held_out
    from wholebody.bench.machine import machine

    check_count(arguments.jobs, "--jobs")
    cases = (4 if arguments.quick else held_out.CASES) if arguments.cases is None else arguments.cases
    check_count(cases, "--cases")
    minutes = held_out.MINUTES if arguments.minutes is None else arguments.minutes
    names = arguments.methods or [name for name in held_out.METHODS if installed(name)]
    asked, left_out = held_out.settings(adapters(names), cases, arguments.seed, minutes)
    if left_out:
        print(left_out)
    folder = arguments.out / "held-out"
    rows = held_out.measured(asked, folder, arguments.jobs, lambda progress: print(progress.said, flush=True))
    facts = machine() | {"date": date.today().isoformat(), "cases beside each other": f"{arguments.jobs}"}
    report = held_out.report(rows, asked, left_out, facts)
    publish("held-out", report, arguments, facts=facts, tables={"held-out/held_out": rows})
    return 0

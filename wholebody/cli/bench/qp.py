"""`wholebody bench qp`: the quadratic programs of all problem sets by every solver alone."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring, publish

QUICK = 45  # programs


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "qp",
        help="the quadratic programs of all problem sets by every solver alone",
        description="Record the programs that the QP method poses on the problem sets, keep them as files that "
        "qpsolvers reads and as a test set of qpbenchmark, and give them to every QP solver alone.",
    )
    parser.add_argument("--count", type=int, default=2000, metavar="N", help="programs (default: 2000)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the problem sets (default: 0)")
    parser.add_argument("--solvers", nargs="+", metavar="NAME", help="QP solvers (default: all that are installed)")
    parser.add_argument("--sets", nargs="+", metavar="NAME", help="problem sets (default: all)")
    parser.add_argument("--programs", type=Path, metavar="DIR", help="files of an earlier run, instead of recording")


def run(arguments: argparse.Namespace) -> int:
    """Measure solvers of quadratic programs."""
    from wholebody.bench.machine import machine
    from wholebody.bench.problem_sets.registry import SETS, problem_set
    from wholebody.bench.qp_programs import files
    from wholebody.bench.qp_programs.measuring import measure, qp_report, summaries
    from wholebody.bench.qp_programs.recording import record
    from wholebody.methods.qp.solvers.registry import make_solver, solver_names

    sets = [problem_set(name).name for name in arguments.sets or SETS]
    solvers = tuple(arguments.solvers or solver_names())
    for name in solvers:
        make_solver(name)
    count = QUICK if arguments.quick else arguments.count
    check_count(count, "--count")
    if arguments.programs is None:
        programs = record(sets, count, arguments.seed, print)
        files.save(programs, arguments.out / "qp-programs")
    else:
        programs = [one for one in files.load(arguments.programs) if one.set in sets]
    facts = machine() | {"seed": str(arguments.seed)}
    rows = measure(programs, solvers, print)
    totals = summaries(rows, solvers, arguments.seed)
    report = qp_report(rows, totals, facts)
    publish("qp", report, arguments, facts=facts, tables={"qp-programs": rows, "qp": totals})
    return 0

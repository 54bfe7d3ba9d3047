"""`wholebody bench loads`: torques and balance of freed clips."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "loads",
        help="torques and balance of clips before and after they are freed, with and without dynamics",
        description="Free clips of collisions without and with regard to strength and balance, and say what each does "
        "to torques, to the zero moment point, and to collisions.",
    )
    parser.add_argument(
        "--clips", type=Path, metavar="DIR", help="folder of recordings (BVH), beside the built-in clips"
    )
    parser.add_argument("--only", nargs="+", metavar="CLIP", help="names of clips (default: all)")
    parser.add_argument("--equipment", nargs="+", metavar="NAME", help="what is worn (default: nothing)")
    parser.add_argument("--longest", type=float, default=4.0, metavar="S", help="cut clips to so long (default: 4 s)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and report; --quick takes one clip, cut to half a second."""
    from wholebody import checks
    from wholebody.bench.machine import machine
    from wholebody.bench.motion import cases, loads
    from wholebody.bench.tables import write_rows

    longest = checks.number(arguments.longest, "--longest", 0.2, 1e4, "s")
    recordings = {path.stem: path for path in cases.recordings(arguments.clips)}
    known: dict[str, Path | None] = {**dict.fromkeys(cases.SYNTHETIC), **recordings}
    names = cases.chosen(arguments.only, tuple(known), "--only")
    worn = cases.chosen(arguments.equipment or ["nothing"], cases.EQUIPMENT, "--equipment")
    if arguments.quick:
        names, worn, longest = names[:1], worn[:1], 0.5
    facts = machine()
    rows = []
    for row in loads.rows({name: known[name] for name in names}, worn, longest):
        rows.append(row)
        write_rows(arguments.out / "loads.csv", facts, rows)
        print(f"{row.clip}, {row.equipment}, {row.way}", flush=True)
    publish("loads", loads.report(rows, facts), arguments)
    return 0

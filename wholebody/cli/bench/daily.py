"""`wholebody bench daily`: reach maps, dragging in a browser, pictures and movies."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring, publish

PARTS = "maps", "drag", "pictures"
"""What is measured, each into a table of its own."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "daily",
        help="measure reach maps, dragging in a browser, pictures and movies",
        description="Measure what is done every day, in seconds of the processor: reach maps of 50 to 10,000 places, "
        "frames of `wholebody drag --live`, pictures and movies. Each part has a table of its own. Needs viser for the "
        "drag, Chromium for pictures, and Linux. Takes seven minutes, of which the maps are six.",
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to measure (default: all)")


def run(arguments: argparse.Namespace) -> int:
    """Measure; --quick makes the smallest map and few frames."""
    from wholebody.bench.daily import measure, report
    from wholebody.bench.machine import machine

    facts = machine()
    for part in dict.fromkeys(arguments.parts):
        rows = []
        for row in measure(part, quick=arguments.quick):
            rows.append(row)
            print(f"{row.what}, {row.count}, processes {row.processes}: {1e3 * row.cpu:.1f} ms", flush=True)
        publish(f"daily-{part}", report(rows, facts), arguments, facts=facts, tables={f"daily-{part}": rows})
    return 0

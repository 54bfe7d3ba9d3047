"""`wholebody bench daily`: reach maps, dragging in a browser, pictures and movies."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    measuring(
        commands,
        run,
        "daily",
        help="measure reach maps, dragging in a browser, pictures and movies",
        description="Measure what is done every day, in seconds of the processor: reach maps of 50 to 10,000 places, "
        "frames of `wholebody drag --live`, pictures and movies. Needs viser, Chromium and Linux. Takes five minutes.",
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure; --quick makes the smallest map and few frames."""
    from wholebody.bench.daily import measure, report
    from wholebody.bench.machine import machine

    facts, rows = machine(), []
    for row in measure(quick=arguments.quick):
        rows.append(row)
        print(f"{row.what}, {row.count}: {1e3 * row.cpu:.1f} ms", flush=True)
    publish("daily", report(rows, facts), arguments, facts=facts, tables={"daily": rows})
    return 0

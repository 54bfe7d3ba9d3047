"""`wholebody bench world`: the same drops in wholebody, MuJoCo and Rapier."""

from __future__ import annotations

import argparse

from wholebody.cli.bench.publishing import add_common, publish

QUICK = 3  # drops
FRAMES = 30  # of a quick run


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "world",
        help="things that fall, slide and lie, beside MuJoCo and Rapier where installed",
        description="Drop, slide and stack the same things in wholebody, MuJoCo and Rapier; measure penetration, "
        "energy and the time of a frame.",
    )
    parser.add_argument("--only", nargs="+", metavar="DROP", help="names of drops (default: all)")
    parser.add_argument("--engines", nargs="+", metavar="NAME", help="wholebody, mujoco, rapier (default: installed)")
    parser.set_defaults(run=run)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure; --quick takes the first drops for half a second."""
    from wholebody.bench.machine import machine
    from wholebody.bench.motion.cases import chosen
    from wholebody.bench.report import render
    from wholebody.bench.tables import write_rows
    from wholebody.bench.world.drops import drops
    from wholebody.bench.world.engines import ENGINES
    from wholebody.bench.world.measuring import installed, measure
    from wholebody.files import make_folder

    known = {drop.name: drop for drop in drops()}
    names = chosen(arguments.only, tuple(known), "--only")
    engines = installed(chosen(arguments.engines, tuple(ENGINES), "--engines"))
    make_folder(arguments.out)
    facts, rows = machine(), []
    for name in names[:QUICK] if arguments.quick else names:
        for engine in engines:
            rows.append(measure(known[name], engine, FRAMES if arguments.quick else None))
            print(f"{name}, {engine}: {rows[-1].median_ms:.2f} ms a frame", flush=True)
            write_rows(arguments.out / "world.csv", facts, rows)
    publish("world", render("world.md", rows=rows, facts=facts), {}, {}, arguments)
    return 0

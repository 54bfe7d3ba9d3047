"""`wholebody bench world`: the same drops in wholebody, MuJoCo and Rapier; closed forms; throws; a long run."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring, publish

if TYPE_CHECKING:
    from wholebody.bench.world.closed_forms import ClosedRow
    from wholebody.bench.world.long_run import LongRow
    from wholebody.bench.world.throws import ThrowRow

QUICK = 3  # drops
FRAMES = 30  # of a quick run
THROWS = 3  # of each kind
LONGEST = 1000.0  # minutes
PARTS = ("closed", "throws", "drops", "long")


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "world",
        help="things that move by themselves: closed forms, throws at a person, drops beside MuJoCo and Rapier",
        description="Measure motions whose outcome is known by formula; throw things at a person who stands, walks or "
        "is dragged; drop, slide and stack the same things in wholebody, MuJoCo and Rapier; let dominoes, stacks and "
        "balls move for minutes. The whole takes about 15 minutes of one processor.",
    )
    parser.add_argument("--parts", nargs="+", metavar="PART", help="closed, throws, drops, long (default: all)")
    parser.add_argument("--only", nargs="+", metavar="DROP", help="names of drops (default: all)")
    parser.add_argument("--engines", nargs="+", metavar="NAME", help="wholebody, mujoco, rapier (default: installed)")
    parser.add_argument(
        "--minutes", type=float, default=10.0, metavar="N", help="simulated minutes of the long run (default: 10)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure; --quick takes three drops for half a second, one throw of each kind, three seconds of the long run."""
    from wholebody.bench.machine import machine
    from wholebody.bench.motion.cases import chosen
    from wholebody.bench.report import render
    from wholebody.bench.tables import write_rows
    from wholebody.bench.world.drops import drops
    from wholebody.bench.world.engines import ENGINES
    from wholebody.bench.world.measuring import installed, measure
    from wholebody.checks import number
    from wholebody.files import make_folder

    known = {drop.name: drop for drop in drops()}
    parts = chosen(arguments.parts, PARTS, "--parts")
    names = chosen(arguments.only, tuple(known), "--only")
    engines = installed(chosen(arguments.engines, tuple(ENGINES), "--engines"))
    minutes = 0.05 if arguments.quick else number(arguments.minutes, "--minutes", 0.01, LONGEST, "minutes")
    make_folder(arguments.out)
    facts = machine()
    found: dict[str, list[Any]] = {part: [] for part in PARTS}
    if "closed" in parts:
        found["closed"] = _closed()
        write_rows(arguments.out / "world-closed.csv", facts, found["closed"])
    if "throws" in parts:
        found["throws"] = _throws(arguments.quick)
        write_rows(arguments.out / "world-throws.csv", facts, found["throws"])
    for name in (names[:QUICK] if arguments.quick else names) if "drops" in parts else ():
        for engine in engines:
            found["drops"].append(measure(known[name], engine, FRAMES if arguments.quick else None))
            print(f"{name}, {engine}: {found['drops'][-1].median_ms:.2f} ms a frame", flush=True)
            write_rows(arguments.out / "world.csv", facts, found["drops"])
    if "long" in parts:
        found["long"] = [_long(minutes)]
        write_rows(arguments.out / "world-long.csv", facts, found["long"])
    publish("world", render("world.md", **found, facts=facts), arguments)
    return 0 if all(row.held for row in found["closed"]) and not any(row.silent for row in found["throws"]) else 1


def _closed() -> list[ClosedRow]:
    from wholebody.bench.world.closed_forms import closed_forms

    rows = closed_forms()
    for row in rows:
        print(f"{row.motion}, {row.quantity}: {row.measured:.6g}, by formula {row.expected:.6g}", flush=True)
    return rows


def _throws(quick: bool) -> list[ThrowRow]:
    from wholebody.bench.world.throws import PERSONS, SHAPES, SPEEDS, throws

    rows = []
    for swift in (True, False):
        for person in PERSONS:
            for thing in SHAPES:
                for speed in SPEEDS[2:3] if quick else SPEEDS:
                    row = throws(thing, speed, person, swift, 1 if quick else THROWS)
                    rows.append(row)
                    print(
                        f"{row.limits} limits, who {person}, {thing} at {speed:g} m/s: {row.deepest_mm:.3f} mm deep, "
                        f"named in {row.named} of {row.frames} frames, silent in {row.silent}",
                        flush=True,
                    )
    return rows


def _long(minutes: float) -> LongRow:
    from wholebody.bench.world.long_run import long_run

    return long_run(minutes, progress=lambda done: print(f"{done:.0f} of {minutes:g} minutes", flush=True))

"""`wholebody bench motion`, `world`: clips freed of collisions, and things that move by themselves."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from wholebody.base.checks import number
from wholebody.base.files import make_folder
from wholebody.bench.machine import machine
from wholebody.bench.tables import write_rows
from wholebody.cli.bench.command import Chart, listed, measuring, publish
from wholebody.cli.command import count, option

CLIPS = (
    option("--clips", type=Path, metavar="DIR", help="folder of recordings (BVH), beside the built-in clips"),
    listed("--only", "names of clips (default: all)", "CLIP"),
)
CAPTION = "Deviation, jerk and sliding against seconds for each second of motion; hollow: not free; dotted: asked"
CAPTION_OF_CHECKS = "CPU time of a check of each clip with each piece of equipment; black: as it is, coloured: freed"


def clips(arguments: argparse.Namespace, clips: int | None) -> dict[str, Path | None]:
    """The chosen clips, at most so many: their recordings, None for one that needs none."""
    from wholebody.bench.measure.motion import cases

    recordings = {path.stem: path for path in cases.recordings(arguments.clips)}
    known: dict[str, Path | None] = {**dict.fromkeys(cases.SYNTHETIC), **recordings}
    return {name: known[name] for name in cases.chosen(arguments.only, tuple(known), "--only")[:clips]}


@measuring(
    "motion",
    "clips freed of collisions by each method, with each piece of equipment",
    "Free clips of collisions by each method, with each piece of equipment, and judge every frame and "
    "every motion between frames; clips that need no recordings, and the recordings of a folder. Each case runs in "
    "a process of its own. A run that was ended goes on where its folder holds what was measured.",
    *CLIPS,
    listed("--equipment", "what is worn (default: all)"),
    listed("--methods", "methods, check and nearest (default: all but nearest)"),
    count("--jobs", 1, "cases at a time"),
)
def motion(arguments: argparse.Namespace) -> None:
    """Measure, or go on; --quick takes two clips with two pieces of equipment."""
    from wholebody.bench.measure.motion import cases, measuring, report
    from wholebody.motion.avoidance import METHODS

    few = 2 if arguments.quick else None
    chosen = clips(arguments, few)
    worn = cases.chosen(arguments.equipment, cases.EQUIPMENT, "--equipment")[:few]
    wanted = (measuring.CHECKED, *METHODS) if arguments.methods is None else arguments.methods
    ways = cases.chosen(wanted, (measuring.CHECKED, *METHODS, measuring.NEAREST), "--methods")
    facts = machine()
    rows = measuring.run(chosen, worn, ways, arguments.out, facts, arguments.jobs, _tell)
    charts = {}
    if any(row.measured and row.method not in report.BESIDE for row in rows):
        charts["motion"] = Chart(partial(report.chart, rows), CAPTION)
    if any(row.measured for row in rows):
        charts["motion-check"] = Chart(partial(report.check_chart, rows), CAPTION_OF_CHECKS)
    publish("motion", report.report(rows, facts), arguments, charts=charts)


def _tell(done: int, count: int, said: str) -> None:
    print(f"{done} of {count}: {said}", flush=True)


QUICK = 3  # drops
LONGEST = 1000.0  # minutes
PARTS = ("closed", "throws", "drops", "long")


@measuring(
    "world",
    "things that move by themselves: closed forms, throws at a person, drops beside MuJoCo and Rapier",
    "Measure motions whose outcome is known by formula; throw things at a person who stands, walks or "
    "is dragged; drop, slide and stack the same things in wholebody, MuJoCo and Rapier; let dominoes, stacks and "
    "balls move for minutes. The whole takes about 15 minutes of one processor.",
    listed("--parts", "closed, throws, drops, long (default: all)", "PART"),
    listed("--only", "names of drops (default: all)", "DROP"),
    listed("--engines", "wholebody, mujoco, rapier (default: installed)"),
    option("--minutes", type=float, default=10.0, metavar="N", help="simulated minutes of the long run (default: 10)"),
)
def world(arguments: argparse.Namespace) -> int:
    """Measure; --quick takes three drops for half a second, one throw of each kind, three seconds of the long run."""
    from wholebody.bench.measure.motion.cases import chosen
    from wholebody.bench.measure.world import closed_forms, drops, engines, long_run, measuring, throws
    from wholebody.bench.report import render

    known = {drop.name: drop for drop in drops.drops()}
    parts = chosen(arguments.parts, PARTS, "--parts")
    names = chosen(arguments.only, tuple(known), "--only")
    tools = measuring.installed(chosen(arguments.engines, tuple(engines.ENGINES), "--engines"))
    minutes = 0.05 if arguments.quick else number(arguments.minutes, "--minutes", 0.01, LONGEST, "minutes")
    make_folder(arguments.out)
    facts = machine()
    found: dict[str, list[Any]] = {part: [] for part in PARTS}

    def keep(part: str, row: Any, said: str = "", name: str = "") -> None:
        found[part].append(row)
        if said:
            print(said, flush=True)
        write_rows(arguments.out / f"{name or f'world-{part}'}.csv", facts, found[part])

    for row in closed_forms.closed_forms() if "closed" in parts else ():
        keep("closed", row, f"{row.motion}, {row.quantity}: {row.measured:.6g}, by formula {row.expected:.6g}")
    # throws of each kind
    for thrown in throws.all_throws(1 if arguments.quick else 3, arguments.quick) if "throws" in parts else ():
        said = f"{thrown.limits} limits, who {thrown.person}, {thrown.thing} at {thrown.speed:g} m/s: "
        said += f"{thrown.deepest_mm:.3f} mm deep, named in {thrown.named} of {thrown.frames} frames, "
        keep("throws", thrown, f"{said}silent in {thrown.silent}")
    for name in (names[:QUICK] if arguments.quick else names) if "drops" in parts else ():
        for engine in tools:
            dropped = measuring.measure(known[name], engine, 30 if arguments.quick else None)  # frames of a quick run
            keep("drops", dropped, f"{name}, {engine}: {dropped.median_ms:.2f} ms a frame", "world")
    if "long" in parts:
        keep(
            "long",
            long_run.long_run(minutes, progress=lambda done: print(f"{done:.0f} of {minutes:g} minutes", flush=True)),
        )
    publish("world", render("world.md", **found, facts=facts), arguments)
    return 0 if all(row.held for row in found["closed"]) and not any(row.silent for row in found["throws"]) else 1

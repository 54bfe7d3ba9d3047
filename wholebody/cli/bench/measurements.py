"""`wholebody bench step`, `scaling`, `motion`, `clips`, `world` and `files`: what things cost and achieve."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import product
from pathlib import Path

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.bench.measure import motion, scaling, step
from wholebody.bench.measure.clips import TOOLS, compare, totals
from wholebody.bench.measure.files import read
from wholebody.bench.measure.motion import EQUIPMENT, SYNTHETIC, recorded, recordings, synthetic
from wholebody.bench.measure.track import VARIANTS, figure_tracks, track
from wholebody.bench.measure.world import ENGINES, drops, installed, measure
from wholebody.bench.rows import Panel, Row, across, chart, in_words, only, report, texts
from wholebody.bench.suite.adapters.registry import chosen_tools, tool_differences
from wholebody.bench.tables import machine
from wholebody.cli.bench.command import Chart, publish
from wholebody.figures import load
from wholebody.motion.avoidance import METHODS
from wholebody.motion.batch import BatchProgress, avoid_many


def chosen(wanted: Sequence[str] | None, known: Iterable[str], flag: str) -> tuple[str, ...]:
    """The names that an option chooses, or all; raises UnknownNameError."""
    names = tuple(known)
    return names if wanted is None else tuple(checks.known(name, names, "name", flag) for name in wanted)


def _charts(name: str, panels: Sequence[Panel], caption: str) -> dict[str, Chart]:
    return {name: Chart(partial(chart, panels), caption)} if panels else {}


def measure_step(arguments: argparse.Namespace) -> None:
    """Measure steps."""
    tools = chosen_tools(arguments.tools)
    repeats, steps = (1, 40) if arguments.quick else (arguments.repeats, arguments.steps)
    facts = machine() | {"steps": str(steps), "repeats": str(repeats)}
    figures = arguments.figure
    courses = [course for spec in figures or () for course in figure_tracks(spec, steps)]
    tracks = {course.name: course for course in courses or (track(name, steps) for name in VARIANTS)}
    runs: dict[str, step.Runs] = {}
    notes = [line for name in tools for line in tool_differences(name)]
    spent, judged = list[Row](), list[Row]()
    for name, course in tracks.items():
        taken, refused = step.taking(course, tools) if figures else (list(tools), {})
        print(f"{name}: {course.pairs} pairs that can touch, tools {', '.join(taken)}")
        notes += [f"{tool} does not take {name}: {sentence}" for tool, sentence in refused.items()]
        runs[name] = step.measure(course, taken, repeats, print) if taken else {}
        spent += step.time_rows(course, runs[name])
        judged += step.result_rows(course, runs[name])
    name = "step-figures" if figures else "step"
    text = step.step_report(spent, judged, facts, bool(figures), notes)
    rows = {f"{name}-time": spent, f"{name}-result": judged}
    charts = _charts(name, step.panels(runs), "Share of steps within a time, and least distance of any pair")
    publish(name, text, arguments, facts=facts, tables=rows, charts=charts)


def measure_scaling(arguments: argparse.Namespace) -> None:
    """Measure, fit, draw."""
    methods = chosen(arguments.methods, ("qp", "newton", "ccd", "placo"), "--methods")
    repeats = 2 if arguments.quick else arguments.repeats
    sizes = {name: grown[: 3 if arguments.quick else None] for name, grown in scaling.SIZES.items()}
    facts, said = machine(), list[str]()

    def say(line: str) -> None:
        said.append(line)
        print(line, flush=True)

    rows = list(scaling.rows(sizes, methods, repeats, say))
    if "newton" in methods:
        bodies = sizes["joints"] if arguments.quick else (*sizes["joints"], 500)
        rows += scaling.assembly_rows(bodies, repeats)
    found = scaling.exponents(rows)
    tables = {"Exponents of a solve": across(found, "a solve"), "All exponents": found}
    text = report(texts()["scaling"], tables, facts, [line for line in said if "left out" in line])
    charts = _charts("scaling", scaling.panels(rows), "Time of a solve and of a step, as one size grows")
    publish("scaling", text, arguments, facts=facts, tables={"scaling": rows}, charts=charts)


def clips(arguments: argparse.Namespace, most: int | None) -> dict[str, Path | None]:
    """The chosen clips, at most so many: their recordings, None for one that needs none."""
    known: dict[str, Path | None] = dict.fromkeys(SYNTHETIC)
    known |= {path.stem: path for path in recordings(arguments.clips)}
    return {name: known[name] for name in chosen(arguments.only, known, "--only")[:most]}


def measure_motion(arguments: argparse.Namespace) -> None:
    """Free, or continue; --quick takes two clips with two pieces of equipment."""

    def tell(now: BatchProgress) -> None:
        if now.case is not None:
            print(f"{now.case.clip}, {now.case.equipment}, {now.case.method}: {now.case.outcome}", flush=True)

    few, figure = 2 if arguments.quick else None, load("human")
    recordings = clips(arguments, few)
    worn = chosen(arguments.equipment, EQUIPMENT, "--equipment")[:few]
    methods = chosen(arguments.methods, METHODS, "--methods")
    facts = machine()
    given = [recorded(path, figure) if path else synthetic(name, figure) for name, path in recordings.items()]
    folder = arguments.out / "motion"
    cases = avoid_many(given, folder, equipment=worn, methods=methods, jobs=arguments.jobs, progress=tell)
    charts = _charts("motion", motion.panels(cases), "Share of the cases freed within a deviation, a jerk and a time")
    publish("motion", motion.motion_report(cases, facts), arguments, charts=charts)


def measure_clips(arguments: argparse.Namespace) -> None:
    """Follow by the installed tools; --quick follows 20 frames."""
    names = arguments.figure or ["human"]
    figures = [load(name, root="free") if Path(name).suffix == ".urdf" else load(name) for name in names]
    frames, rows = 20 if arguments.quick else arguments.frames, list[Row]()
    facts = machine() | {"frames": str(frames)}
    for row in compare(arguments.folder, figures, frames):
        rows.append(row)
        print(in_words(row), flush=True)
    lacking = set(TOOLS) - {row.tool for row in rows}
    notes = [f"Left out: {tool}, which is not installed (extra `compare`)." for tool in sorted(lacking)]
    text = report(texts()["clips"], {"All clips": totals(rows), "Each": rows}, facts, notes)
    publish("clips", text, arguments, facts=facts, tables={"clips": rows})


def measure_world(arguments: argparse.Namespace) -> None:
    """Measure; --quick takes three drops for half a second."""
    known = {drop.name: drop for drop in drops()}
    names = chosen(arguments.only, known, "--only")[: 3 if arguments.quick else None]
    tools = installed(chosen(arguments.engines, ENGINES, "--engines"))
    facts, rows = machine(), list[Row]()
    for name, tool in product(names, tools):
        rows.append(measure(known[name], tool, 30 if arguments.quick else None))
        print(in_words(rows[-1]))
    shown = only(rows, "median ms", "p99 ms", "deepest mm", "largest gain of energy")
    publish("world", report(texts()["world"], {"": shown}, facts), arguments, facts=facts, tables={"world": rows})


def measure_files(arguments: argparse.Namespace) -> int:
    """Read; 1 where a file ends in anything but an answer or a sentence."""
    if not arguments.folder.is_dir():
        raise InputError(f"{arguments.folder}: is no folder; give one with files")
    rows = []
    for row in read(arguments.folder, 5 if arguments.quick else arguments.frames):
        rows.append(row)
        print(f"{row.case}: {', '.join(f'{name} {value}' for name, value in row.figures.items())}", flush=True)
    facts = machine()
    known = [row["bones median deg"] for row in rows if "bones median deg" in row.figures]
    about = f"{sum(row['read'] == 'yes' for row in rows)} of {len(rows)} files are read; {len(known)} recordings are "
    about += f"retargeted, {sum(error < 5.0 for error in known)} of them with a median error of bones below 5 degrees."
    publish("files", report(about, {"": rows}, facts), arguments, facts=facts, tables={"files": rows})
    return int(any(row["read"] == "FAULT" for row in rows))

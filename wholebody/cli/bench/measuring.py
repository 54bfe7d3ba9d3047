"""`wholebody bench step`, `scaling`, `motion`, `world` and `files`: what things cost and achieve."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import product
from pathlib import Path

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.base.files import make_folder
from wholebody.bench.rows import Panel, Row, across, chart, in_words, only, report, texts
from wholebody.bench.tables import machine, write_rows
from wholebody.cli.bench.command import Chart, listed, measuring, publish
from wholebody.cli.command import count, flag, option


def chosen(wanted: Sequence[str] | None, known: Iterable[str], flag: str) -> tuple[str, ...]:
    """The names that an option chooses, or all; raises UnknownNameError."""
    names = tuple(known)
    return names if wanted is None else tuple(checks.known(name, names, "name", flag) for name in wanted)


def _charts(name: str, panels: Sequence[Panel], caption: str) -> dict[str, Chart]:
    return {name: Chart(partial(chart, panels), caption)} if panels else {}


@measuring(
    "step",
    "one step of tracking by every tool",
    "The same 200-step reach by every installed tool, interleaved, judged independently. With --figure these figures "
    "replace the standing human; tools that do not take one say why.",
    listed("--figure", "URDF or MJCF files, or names of figures", "FILE"),
    count("--repeats", 5, "timed runs of every tool"),
    option("--steps", type=int, default=200, metavar="N", help="of each run (default: 200)"),
    listed("--tools", "only these (default: all that are installed)"),
)
def step(arguments: argparse.Namespace) -> None:
    """Measure steps."""
    from wholebody.bench.measure import step
    from wholebody.bench.measure.track import VARIANTS, figure_tracks, track
    from wholebody.bench.suite.adapters.registry import chosen_tools, tool_differences

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
    publish(name, text, arguments, facts=facts, tables=rows, charts=charts, page=None if figures else "results.md")


@measuring(
    "scaling",
    "time of a step and a solve against joints, pieces and things, with exponents",
    "Chains of 5 to 200 joints (500 bodies without a model of joints), 1 to 32 pieces a segment, 10 to "
    "5000 things around, and the exponents with which times grow.",
    count("--repeats", 5, "timed solves each"),
    listed("--methods", "methods (default: qp newton ccd placo)"),
)
def scaling(arguments: argparse.Namespace) -> None:
    """Measure, fit, draw."""
    from wholebody.bench.measure import scaling

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


CLIPS = (
    option("--clips", type=Path, metavar="DIR", help="folder of recordings (BVH), beside the built-in clips"),
    listed("--only", "names of clips (default: all)", "CLIP"),
)


def clips(arguments: argparse.Namespace, most: int | None) -> dict[str, Path | None]:
    """The chosen clips, at most so many: their recordings, None for one that needs none."""
    from wholebody.bench.measure.motion import SYNTHETIC, recordings

    known: dict[str, Path | None] = dict.fromkeys(SYNTHETIC)
    known |= {path.stem: path for path in recordings(arguments.clips)}
    return {name: known[name] for name in chosen(arguments.only, known, "--only")[:most]}


@measuring(
    "motion",
    "clips freed of collisions by each method, with each piece of equipment",
    "Free clips of collisions by each method, with each piece of equipment, as `wholebody clip avoid` does, and sum up "
    "deviation, jerk, sliding and time: clips that need no recordings, and the recordings of a folder. An interrupted "
    "run continues from its folder.",
    *CLIPS,
    listed("--equipment", "what is worn (default: all)"),
    listed("--methods", "methods (default: all)"),
    count("--jobs", 1, "cases at a time"),
)
def motion(arguments: argparse.Namespace) -> None:
    """Free, or continue; --quick takes two clips with two pieces of equipment."""
    from wholebody.bench.measure import motion
    from wholebody.bench.measure.motion import EQUIPMENT, recorded, synthetic
    from wholebody.figures import load
    from wholebody.motion.avoidance import METHODS
    from wholebody.motion.batch import BatchProgress, avoid_many

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


WORLD = {"throws": "Thrown at a person", "drops": "The same drops in three engines"}
"""Parts of `wholebody bench world`, and the titles of their tables."""


@measuring(
    "world",
    "things that move by themselves: throws at a person, drops beside MuJoCo and Rapier",
    "Throw things at a person who stands, walks or is dragged; drop, slide and stack the same things in wholebody, "
    "MuJoCo and Rapier. The whole takes about ten minutes of one processor.",
    listed("--parts", "throws, drops (default: all)", "PART"),
    listed("--only", "names of drops (default: all)", "DROP"),
    listed("--engines", "wholebody, mujoco, rapier (default: installed)"),
)
def world(arguments: argparse.Namespace) -> int:
    """Measure; --quick takes three drops for half a second, and one throw of each kind."""
    from wholebody.bench.measure.world import throw_summary

    found: dict[str, list[Row]] = {part: [] for part in chosen(arguments.parts, WORLD, "--parts")}
    given = _world(arguments)
    make_folder(arguments.out)
    facts = machine()
    for part, rows in found.items():
        for row in given[part]:
            rows.append(row)
            print(in_words(row))
            write_rows(arguments.out / f"world-{part}.csv", facts, rows)
    shown = dict(found)
    if "throws" in found:
        shown["throws"] = throw_summary(found["throws"])
    if "drops" in found:
        shown["drops"] = only(found["drops"], "median ms", "p99 ms", "deepest mm", "largest gain of energy")
    publish("world", report(texts()["world"], {WORLD[part]: rows for part, rows in shown.items()}, facts), arguments)
    return int(any(row["silent"] for row in found.get("throws", ())))


def _world(arguments: argparse.Namespace) -> dict[str, Iterable[Row]]:
    """What measures each part; names are checked before anything is measured."""
    from wholebody.bench.measure.world import ENGINES, all_throws, drops, installed, measure

    quick = arguments.quick
    known = {drop.name: drop for drop in drops()}
    names = chosen(arguments.only, known, "--only")[: 3 if quick else None]
    tools = installed(chosen(arguments.engines, ENGINES, "--engines"))
    frames = 30 if quick else None
    return {
        "throws": all_throws(1 if quick else 3, quick),
        "drops": (measure(known[name], tool, frames) for name, tool in product(names, tools)),
    }


@measuring(
    "files",
    "what is read of the files of a folder",
    "Read every robot, mesh and recording below a folder; recordings are retargeted to the person. The table has what "
    "was read, the sentence by which the rest is refused, the errors of bones, and the processor's time.",
    option("folder", type=Path, metavar="FOLDER", help="of the files"),
    count("--frames", 60, "frames of each recording that are retargeted"),
    flag("--compare", "recordings alone (BVH): by wholebody, and by mink frame by frame with GMR's weights"),
    listed("--figure", "with --compare: figures that follow (default: the person)", "FIGURE"),
)
def files(arguments: argparse.Namespace) -> int:
    """Read; 1 where a file ends in anything but an answer or a sentence."""
    from wholebody.bench.measure.files import read

    if not arguments.folder.is_dir():
        raise InputError(f"{arguments.folder}: is no folder; give one with files")
    if arguments.compare:
        return _compared(arguments)
    if arguments.figure is not None:
        raise InputError("--figure is for --compare; recordings are read for the person")
    rows = []
    for row in read(arguments.folder, 5 if arguments.quick else arguments.frames):
        rows.append(row)
        print(f"{row.case}: {', '.join(f'{name} {value}' for name, value in row.figures.items())}", flush=True)
    facts = machine()
    known = [row["bones median deg"] for row in rows if "bones median deg" in row.figures]
    about = f"{sum(row['read'] == 'yes' for row in rows)} of {len(rows)} files are read; {len(known)} recordings are "
    about += f"retargeted, {sum(error < 5.0 for error in known)} of them with a median error of bones below 5 degrees."
    publish("files", report(about, {"": rows}, facts), arguments, facts=facts, tables={"files": rows}, page=None)
    return int(any(row["read"] == "FAULT" for row in rows))


def _compared(arguments: argparse.Namespace) -> int:
    """Follow recordings by both tools; figures of files may go about freely."""
    from wholebody.bench.measure.files import ABOUT, compare, totals
    from wholebody.figures import load

    names = arguments.figure or ["human"]
    figures = [load(name, root="free") if Path(name).suffix == ".urdf" else load(name) for name in names]
    rows = []
    for row in compare(arguments.folder, figures, 20 if arguments.quick else arguments.frames):
        rows.append(row)
        print(in_words(row), flush=True)
    facts = machine() | {"frames": str(arguments.frames)}
    tables = {"All clips": totals(rows), "Each": rows}
    text = report(ABOUT, tables, facts)
    publish("clips", text, arguments, facts=facts, tables={"clips": rows}, page=None)
    return 0

"""Audits of the package by its makers: `python -m tests.audits NAME`, from the root of a checkout.

They need data or hours that a test does not have, and answer questions that users of the package do not ask. Each
writes its tables and charts into a folder, as the commands of `wholebody bench` do.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wholebody.base.checks import number
from wholebody.base.errors import WholebodyError
from wholebody.base.files import make_folder
from wholebody.bench.rows import in_words, only, report
from wholebody.bench.tables import machine, write_rows, write_text
from wholebody.cli.bench.command import CLIPS, listed, measuring, publish, seed
from wholebody.cli.bench.measurements import chosen, clips
from wholebody.cli.command import command, count, flag, option

QUICK = 45  # quadratic programs


@measuring(
    "newton",
    "sparse Newton by size, shape and factorisation",
    "Chains, trees, rings and stars by every factorisation, whole solves, loops beside open chains, "
    "the same problems by qp, and drags of the human. Set OMP_NUM_THREADS=1: small products are slower on more.",
    count("--repeats", 15, "timed systems each"),
)
def newton(arguments: argparse.Namespace) -> None:
    """Measure sparse Newton."""
    from tests.audits import newton

    repeats, sizes, frames = (3, (10, 30), 20) if arguments.quick else (arguments.repeats, newton.SIZES, 1000)
    facts, many = machine(), 10 * repeats
    paper = [newton.paper_row(many), newton.drag_of_assembly_row(many)]
    solves = [*paper, *newton.loop_rows(many)]
    agreements = newton.agreement_rows(many)
    drags = [newton.drag_row(frames, contacts) for contacts in (False, True)]
    linear = list(newton.linear_rows(sizes, repeats))
    found: dict[str, Any] = {"linear": linear, "solves": solves, "agreements": agreements, "drags": drags}
    tables = {f"newton-{name}": rows for name, rows in found.items()}
    publish("newton", newton.report(**found, facts=facts), arguments, facts=facts, tables=tables)


@measuring(
    "qp",
    "the quadratic programs of all problem sets by every solver alone",
    "Record the programs that the QP method poses on the problem sets, keep them as files that "
    "qpsolvers reads and as a test set of qpbenchmark, and give them to every QP solver alone.",
    count("--count", 2000, "programs"),
    seed("of the problem sets"),
    listed("--solvers", "QP solvers (default: all that are installed)"),
    listed("--sets", "problem sets (default: all)"),
    option("--programs", type=Path, metavar="DIR", help="files of an earlier run, instead of recording"),
)
def qp(arguments: argparse.Namespace) -> None:
    """Measure solvers of quadratic programs."""
    from tests.audits.qp_programs import files
    from tests.audits.qp_programs.measuring import measure, qp_report, summaries
    from tests.audits.qp_programs.recording import record
    from wholebody.bench.suite.problem_sets.registry import SETS, problem_set
    from wholebody.methods.qp.solvers.registry import make_solver, solver_names

    sets = [problem_set(name).name for name in arguments.sets or SETS]
    solvers = tuple(arguments.solvers or solver_names())
    for name in solvers:
        make_solver(name)
    if arguments.programs is None:
        programs = record(sets, QUICK if arguments.quick else arguments.count, arguments.seed, print)
        files.save(programs, arguments.out / "qp-programs")
    else:
        programs = [one for one in files.load(arguments.programs) if one.set in sets]
    facts = machine() | {"seed": str(arguments.seed)}
    rows = measure(programs, solvers, print)
    totals = summaries(rows, solvers)
    report = qp_report(rows, totals, facts)
    publish("qp", report, arguments, facts=facts, tables={"qp-programs": rows, "qp": totals})


@measuring(
    "human",
    "compare the person with people: sizes, ranges, self-contacts, everyday tasks",
    "Measure the dimensions and ranges of motion of the person beside those of people, "
    "bring parts of the body together, and solve thirteen everyday tasks. With --update-docs the page becomes "
    "docs/human.md, with a picture of each contact and task.",
    option("--update-docs", type=Path, nargs="?", const=Path("docs"), metavar="DOCS", help="write the page there too"),
)
def human(arguments: argparse.Namespace) -> None:
    """Measure; --quick measures one design case and three tasks, and draws nothing."""
    from tests.audits.human import Measured, figures, measure, page
    from wholebody.view.browser import find_chromium

    facts = machine()
    drawn = not arguments.quick and find_chromium() is not None
    pictures = arguments.out / "human"
    make_folder(pictures)
    found = None
    for told in measure(pictures if drawn else None, quick=arguments.quick):
        if isinstance(told, Measured):
            found = told
        else:
            print(told, flush=True)
    assert found is not None
    write_text(arguments.out / "human.json", figures(found, facts))
    for folder in filter(None, (arguments.out, arguments.update_docs)):
        write_text(folder / "human.md", page(found, facts, pictures=drawn))
        print(f"wrote {folder / 'human.md'}")
    if arguments.update_docs is not None and drawn:
        folder = arguments.update_docs / "assets" / "human"
        make_folder(folder)
        names = [row.picture for row in found.contacts if row.drawn] + [row.picture for row in found.tasks]
        for name in names:
            shutil.copyfile(pictures / name, folder / name)


@command(
    "regress",
    "counts of work, beside those that are locked",
    """\
Count what the methods do on a fixed selection of problems, reaches, drags and hard cases: iterations, kinematic passes,
pairs asked of coal, contact rows, programs, memory of a step. Counts are the same on every machine but for rounding, so
they show what a noisy clock does not. They are compared with locked ones; each that differs by more than its margin is
told in one sentence, and the exit code is 1 where one is worse. Times are told and compare nothing.""",
    option("--update", action="store_true", help="lock the counts as they are now"),
    option("--locked", type=Path, metavar="FILE", help="locked counts (default: those of the package)"),
)
def regress(arguments: argparse.Namespace) -> int:
    """Count and compare; 1 where a count is worse than the locked one."""
    from tests.audits.regress import comparison
    from tests.audits.regress.selection import runs

    path: Path = arguments.locked or comparison.LOCKED
    locked = comparison.read(path) if path.exists() or not arguments.update else {}
    counted = []
    for run in runs():
        counted.append(run)
        said = ", ".join(f"{name} {count}" for name, count in run.counts.items())
        print(f"{run.name}: {said}; {1e3 * run.seconds:.0f} ms", flush=True)
    print(f"\n{len(counted)} runs in {sum(run.seconds for run in counted):.1f} s of the processor")
    differences = list(comparison.compared(locked, counted)) if locked else []
    for difference in differences:
        print(f"{'worse' if difference.worse else 'differs'}: {difference.sentence}")
    if arguments.update:
        comparison.write(counted, path)
        print(f"wrote {path}")
        return 0
    if not differences:
        print(f"all counts are within their margins of {path}")
    return int(any(difference.worse for difference in differences))


@measuring(
    "loads",
    "torques and balance of clips before and after they are freed, with and without dynamics",
    "Free clips of collisions without and with regard to strength and balance, and say what each does "
    "to torques, to the zero moment point, and to collisions.",
    *CLIPS,
    listed("--equipment", "what is worn (default: nothing)"),
    option("--longest", type=float, default=4.0, metavar="S", help="cut clips to so long (default: 4 s)"),
)
def loads(arguments: argparse.Namespace) -> None:
    """Measure and report; --quick takes one clip, cut to half a second."""
    from tests.audits import loads
    from wholebody.bench.measure.motion import EQUIPMENT

    longest = number(arguments.longest, "--longest", 0.2, 1e4, "s")
    few, longest = (1, 0.5) if arguments.quick else (None, longest)
    worn = chosen(arguments.equipment or ["nothing"], EQUIPMENT, "--equipment")[:few]
    facts, rows = machine(), []
    for row in loads.rows(clips(arguments, few), worn, longest):
        rows.append(row)
        write_rows(arguments.out / "loads.csv", facts, rows)
        print(f"{row.case}, {row.tool}", flush=True)
    publish("loads", loads.report(rows, facts), arguments)


@measuring(
    "detail",
    "levels of modelling",
    "Solve problems with the person as spheres, capsules and hulls, with all pairs and with those "
    "that can touch, and judge the answers in the finest model.",
    count("--count", 8, "cases of each level"),
    seed("of the first case"),
)
def detail(arguments: argparse.Namespace) -> None:
    """The same tasks with every detail of geometry, judged in the finest model."""
    from tests.audits import detail

    facts, refused = machine(), dict[str, None]()
    rows = list(detail.detail_rows(2 if arguments.quick else arguments.count, arguments.seed, refused.setdefault))
    about = (
        "Answers of `qp` that their own model calls solved, judged in the finest model with everything in it: how "
        "many are inside something by more than 0.1 mm, and by how much the worst misses what it is asked; the effort "
        "is held against the finest model's own answer. Medians over the cases, of the processor's time. Simplified "
        "is `wb.simplify`."
    )
    shown = [row for row in detail.detail_summary(rows) if row.tool.endswith(("all", "simplified"))]
    text = report(about, {"": only(shown, *detail.SHOWN)}, facts, list(refused))
    publish("detail", text, arguments, facts=facts, tables={"detail": rows})


@measuring(
    "ablation",
    "what each constant and mechanism of a method is worth, in counts",
    "Change one constant or switch one mechanism off at a time, and count answers that differ.",
    option("--method", default="qp", choices=("qp", "newton", "ccd"), help="(default: qp)"),
    count("--count", None, "problems of every set (default: 6, 1 with --quick)"),
)
def ablation(arguments: argparse.Namespace) -> None:
    """Measure and report."""
    from tests.audits import ablation

    method, facts = arguments.method, machine()
    given = ablation.problems(arguments.count or (1 if arguments.quick else 6), method)
    whole, rows = ablation.ablation(method, given, ablation.mechanisms(method), print)
    text = ablation.report(method, len(given), whole, rows, ablation.constants(method)[1], facts)
    name = f"ablation-{method}"
    publish(name, text, arguments, facts=facts, tables={name: rows})


@measuring(
    "robots",
    "load every robot description of a folder, and reach with its tips",
    "Load every URDF and MJCF file below a folder, with an empty cache and again, and bring the tips "
    "of each robot to where random postures free of contact have them.",
    option("folder", type=Path, metavar="FOLDER", help="folder that holds robot descriptions"),
)
def robots(arguments: argparse.Namespace) -> None:
    """Measure all descriptions; --quick makes three reaches instead of twelve."""
    from tests.audits.robots import measure, robots_report

    facts, reaches, found = machine(), 3 if arguments.quick else 12, []
    for row in measure(arguments.folder, reaches):
        found.append(row)
        told = f"{row.figures.get('solved', 'no reach')} of {reaches} solved" if row.tool != "refused" else "refused"
        print(f"{row.case}: {told}", flush=True)
    text = robots_report(found, facts, reaches)
    publish("robots", text, arguments, facts=facts, tables={"robots": found})


@measuring(
    "plans",
    "planned motions by scene, beside RRT-Connect of OMPL where it is installed",
    "Plan motions of arms, people, a G1 (in the folder WHOLEBODY_ROBOTS) and a hand with several seeds.",
    listed("--scenes", "names of scenes (default: all)"),
    count("--cases", 8, "questions a scene"),
    count("--seeds", 10, "plans of each"),
)
def plans(arguments: argparse.Namespace) -> None:
    """Measure plans; --quick takes one question a scene with one seed."""
    from tests.audits.plan_scenes import SCENES
    from tests.audits.plans import rows

    names = chosen(arguments.scenes, SCENES, "--scenes")
    cases, seeds = (1, 1) if arguments.quick else (arguments.cases, arguments.seeds)
    facts, found = machine(), []
    for row in rows(names, cases, seeds):
        found.append(row)
        print(in_words(row), flush=True)
    text = report("Motions from starts to goals; lengths by the shortest of each question.", {"": found}, facts)
    publish("plans", text, arguments, facts=facts, tables={"plans": found})


@measuring(
    "postures",
    "postures of people beside ours, and weights fitted to them",
    "Solve the tasks in which postures of people were measured. With --fit, first change the weights of a person's "
    "effort for the postures of one half of the data; the other half judges them.",
    flag("--fit", "fit the weights, in some minutes"),
)
def postures(arguments: argparse.Namespace) -> None:
    """Measure or fit; --quick takes the half that is fitted to."""
    from tests.audits import human_fit, human_postures

    facts = machine()
    if arguments.fit:
        fitted = human_fit.fit(lambda told: print(told, flush=True))
        factors = ", ".join(f"{group} {factor}" for group, factor in fitted.factors.items())
        rows, notes = fitted.rows, [f"Changes of the weights and angles: {factors}."]
    else:
        man = human_postures.median_man()
        rows, notes = list(human_postures.measure(man, "fit" if arguments.quick else None)), []
    told = f"Standard deviations of people: {human_postures.summary(rows)}."
    text = "\n\n".join(["# Postures of people and ours", told, *notes])
    publish("postures", text, arguments, facts=facts, tables={"postures": rows})


@measuring(
    "throws",
    "things thrown at a person, and whether any passes through without a word",
    "Throw things at a person who stands, walks or is dragged, for about ten minutes. The exit code is 1 "
    "where a thing passes through and nothing tells it.",
)
def throws(arguments: argparse.Namespace) -> int:
    """Throw; --quick throws each thing once, at one speed."""
    from tests.audits.throws import ABOUT, all_throws, throw_summary

    facts, rows = machine(), []
    for row in all_throws(1 if arguments.quick else 3, arguments.quick):
        rows.append(row)
        print(in_words(row), flush=True)
        write_rows(arguments.out / "throws.csv", facts, rows)
    publish("throws", report(ABOUT, {"": throw_summary(rows)}, facts), arguments)
    return int(any(row["silent"] for row in rows))


@command(
    "docs",
    "put reports into the documentation",
    "Put reports of benches and audits, with their charts, into the documentation: as texts, and into the section of a "
    "page between the markers of their name.",
    option("reports", type=Path, nargs="+", metavar="NAME.md", help="reports, such as out/bench/step.md"),
    option("--docs", type=Path, default=Path("docs"), metavar="DIR", help="the documentation (default: docs)"),
    option("--name", default="", help="of the only report, in place of its file's, such as held-out"),
)
def docs(arguments: argparse.Namespace) -> None:
    """Put them there."""
    from tests.audits.documenting import put

    for file in arguments.reports:
        print(f"wrote {put(file, arguments.docs, arguments.name)}")


COMMANDS = (newton, qp, human, postures, regress, loads, detail, ablation, robots, plans, throws, docs)


def main(words: Sequence[str] | None = None) -> int:
    """Run an audit, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.audits", description=__doc__)
    kinds: Any = parser.add_subparsers(title="what to audit", metavar="WHAT", required=True)
    for audit in COMMANDS:
        audit.add_to(kinds)
    arguments = parser.parse_args(words)
    try:
        return int(arguments.run(arguments))
    except WholebodyError as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())

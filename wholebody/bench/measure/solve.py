"""`wholebody bench solve`: a task new and used, the memory that it takes, random reaches, and levels of modelling.

A random reach comes from a seed: the upper body of a standing person is put at random within its limits until nothing
touches; where a fingertip is then becomes the target. Random objects are added that touch neither that posture (the
witness) nor the standing one. The witness holds both feet and keeps the clearance, so an answer exists.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.base.files import Scratch
from wholebody.bench import statistics
from wholebody.bench.measure.scaling import TIP, chain, task
from wholebody.bench.rows import Figure, Row, measured_ms, quiet, times
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.problem_sets.bodies import TIPS
from wholebody.bench.suite.problem_sets.reaching import reach_among
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.tables import programs_text, summed_programs
from wholebody.methods.simplification.simplify import Parts, leave_out
from wholebody.problem import Problem

TOLERANCE = 1e-5  # m, rad: what methods are asked for


def task_rows(path: Path, methods: Sequence[Adapter], count: int) -> Iterator[Row]:
    """Solve a task `count` times with new problems and methods, and as often with the same ones again.

    One solve of each kind is made before and not counted. Times have the independent assessment in them.
    """
    for adapter in methods:
        used, method = wb.read_task(path).problem, adapter.make(TOLERANCE, None)
        for fresh in (True, False):
            wall, cpu, solutions = [], [], []
            for number in range(count + 1):
                problem = wb.read_task(path).problem if fresh else used
                chosen = adapter.make(TOLERANCE, None) if fresh else method
                with quiet():
                    worked, spent, solution = measured_ms(lambda: chosen.solve(problem))  # noqa: B023
                if number:
                    wall.append(spent)
                    cpu.append(worked)
                    solutions.append(solution)
            unsolved = [solution.status for solution in solutions if not solution.solved]
            yield Row(
                path.stem,
                adapter.name,
                {
                    "problem and method": "new" if fresh else "used before",
                    "solves": count,
                    "pairs": len(used.scene.geometry.collisionPairs),
                    "status": unsolved[0] if unsolved else "solved",
                    "iterations": int(np.median([solution.iterations for solution in solutions])),
                    "programs closed by": programs_text(solutions[-1].programs),
                    **times(wall),
                    "CPU median ms": float(np.median(cpu)),
                },
            )


PEAKS = """\
import resource, sys
from pathlib import Path
from wholebody.cli import main
code = main(["pose", sys.argv[1], "--out", sys.argv[2]])
own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
status = Path("/proc/self/status")
if status.is_file():  # Linux: ru_maxrss begins with what the parent had
    own = next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmHWM"))
print("PEAKS", own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr)
sys.exit(code)
"""
"""Runs the command in a fresh interpreter, and tells its peak and its children's when it is done."""


def memory(path: Path) -> Row:
    """Run `wholebody pose` on a task in a process of its own: the greatest resident memory, MB of 1e6 bytes.

    Raises:
        WholebodyError: the command failed.
    """
    with Scratch() as folder:
        call = [sys.executable, "-c", PEAKS, str(path), str(folder)]
        began = time.perf_counter()
        done = subprocess.run(call, capture_output=True, text=True, timeout=300.0, check=False)
        seconds = time.perf_counter() - began
    peaks = [line.split()[1:] for line in done.stderr.splitlines() if line.startswith("PEAKS ")]
    if done.returncode not in (0, 1) or not peaks:
        raise WholebodyError(
            f"`wholebody pose {path}` failed: {done.stderr.strip().splitlines()[-1:]}; correct it first"
        )
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # bytes there, kibibytes on Linux
    own, children = (float(peak) * unit / 1e6 for peak in peaks[0])
    figures: dict[str, Figure] = {"peak MB": own, "processes that it starts MB": children, "seconds": seconds}
    return Row(path.stem, "wholebody pose", figures)


def reach(seed: int, figure: wb.Figure | None = None) -> tuple[wb.Problem, Array]:
    """Make one reach, and its witness (nq,). The human may be given if it is loaded already."""
    return reach_among(figure or wb.load("human"), TIPS[seed % len(TIPS)], np.random.default_rng(seed))


def solve_reach(seed: int, method: str, figure: wb.Figure | None = None) -> Row:
    """Make and solve one reach with a fresh method; errors are judged independently, in m and rad."""
    problem, witness = reach(seed, figure)
    (adapter,) = adapters([method])
    solution = adapter.make(TOLERANCE, None).solve(problem)
    judged = wb.assess(problem, solution.q)
    return Row(
        f"seed {seed}",
        method,
        {
            "status": solution.status,
            "how": solution.message.removeprefix("solved "),
            "ms": 1e3 * solution.seconds,
            "iterations": solution.iterations,
            "programs": programs_text(solution.programs),
            "goal error": judged.goal_error,
            "overlap": judged.penetration,
            "beyond limits": judged.limit_violation,
            "feet off by": judged.constraint_violation,
            "effort ÷ witness'": judged.measure / wb.assess(problem, witness).measure,
        },
    )


def reaches(seeds: range, method: str, jobs: int = 1) -> Iterator[Row]:
    """Solve the reaches of these seeds, in processes of their own where `jobs` is more than one; in order."""
    if jobs <= 1:
        figure = wb.load("human")
        for seed in seeds:
            yield solve_reach(seed, method, figure)
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(solve_reach, seeds, [method] * len(seeds), chunksize=4)


def reach_summary(rows: Sequence[Row]) -> list[Row]:
    """A row a method: shares and times with intervals of 95 %, and the worst of all errors."""
    found = []
    for method in dict.fromkeys(row.tool for row in rows):
        mine = [row for row in rows if row.tool == method]
        solved = [row for row in mine if row["status"] == "solved"]
        figures: dict[str, Figure] = {
            "solved %": statistics.share([row in solved for row in mine]).scaled(100.0),
            "directly": sum(row["how"] == "directly" for row in solved),
            "by feasibility first": sum(row["how"] == "by feasibility first" for row in solved),
            "median ms": statistics.median([row["ms"] for row in mine]),
            "p95 ms": statistics.quantile([row["ms"] for row in mine], 0.95),
            "iterations": float(np.median([row["iterations"] for row in mine])),
            "programs closed by": summed_programs(row["programs"] for row in mine),
        }
        for name in ("overlap", "beyond limits", "feet off by"):
            figures[f"worst {name}"] = max(row[name] for row in mine)
        if solved:
            figures["effort ÷ witness'"] = float(np.median([row["effort ÷ witness'"] for row in solved]))
        found.append(Row(f"{len(mine)} reaches", method, figures))
    return found


SHOWN = "solved", "pairs", "a solve ms", "judgement ms", "inside", "worst deepest mm", "worst effort above %"
"""Figures of a level of modelling that the report shows."""

LEVELS: dict[str, Parts] = {
    "all": Parts(joints=False, pairs=False),
    "active joints": Parts(joints=True, pairs=False),
    "pairs in reach": Parts(joints=False, pairs=True),
    "simplified": Parts(joints=True, pairs=True),
}


def detail_rows(cases: int, seed: int, say: Callable[[str], None]) -> Iterator[Row]:
    """Solve every case with every model of the body; what an answer misses is judged in the finest model.

    `say` takes a sentence where a model cannot be asked.
    """
    figures = {detail: wb.load("human", detail=detail) for detail in ("hulls", "capsules", "spheres")}
    for name in ("clutter", "balance"):
        for number in range(cases):
            given, models = SETS[name].make(number, seed).problem, {}
            for detail, figure in figures.items():
                try:
                    models[detail] = of_figure(figure, given)
                except WholebodyError as error:
                    say(f"{name}, {detail}: not asked; {error}")
            yield from levels(name, models)
    figure = chain(7, 1)
    for number in range(cases):
        scene, target = task(figure, 1000, seed + number)
        problem = wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=0.002)
        yield from levels("arm among 1000 things", {"own": problem})


def of_figure(figure: wb.Figure, given: Problem) -> Problem:
    """The same problem about the same person in another detail."""
    scene = wb.Scene(figure)
    for name, thing in given.scene.objects.items():
        scene.add(thing.shape, name=name, at=thing.placement)
    return Problem(
        scene, given.start, goals=given.goals, constraints=[*given.constraints, *given.bounds],
        measures=given.measures, clearance=given.clearance,
    )  # fmt: skip


def levels(case: str, models: dict[str, Problem]) -> Iterator[Row]:
    """All levels of all models of one case; the first model, whole, is what the others are held against."""
    judge, best = next(iter(models.values())), float("nan")
    for detail, given in models.items():
        for level, parts in LEVELS.items():
            prepare, _, part = measured_ms(lambda: leave_out(given, parts))  # noqa: B023
            problem = given if level == "all" else part.problem
            wb.solve(problem)  # what a problem makes once is made
            answer, solved, judged = _timed(problem)
            q: Array = answer.q if level == "all" else part.posture(answer.q)
            truth = wb.assess(judge, q)
            if np.isnan(best) and answer.solved:
                best = truth.measure
            yield Row(
                case,
                f"{detail}, {level}",
                {
                    "freedoms": problem.scene.model.nv,
                    "pairs": len(problem.scene.geometry.collisionPairs),
                    "status": answer.status,
                    "a solve ms": max(solved - judged, 0.0),
                    "judgement ms": judged,
                    "leaving out ms": prepare if level != "all" else 0.0,
                    "deepest mm": 1e3 * truth.penetration,
                    "clearance missed mm": 1e3 * truth.clearance_violation,
                    "goal missed mm": 1e3 * truth.goal_error,
                    "effort above %": 100.0 * (truth.measure / best - 1.0),
                },
            )


def _timed(problem: Problem) -> tuple[Any, float, float]:
    """A solution, and the processor's milliseconds of the solve with its judgement, and of the judgement alone."""
    solves = [measured_ms(lambda: wb.solve(problem)) for _ in range(2)]
    answer = solves[0][2]
    judged = min(measured_ms(lambda: wb.assess(problem, answer.q))[0] for _ in range(2))
    return answer, min(each[0] for each in solves), judged


def detail_summary(rows: Sequence[Row]) -> list[Row]:
    """A row for each case and model: medians of sizes and times; the worst errors of answers that it calls solved."""
    found = []
    for case, model in dict.fromkeys((row.case, row.tool) for row in rows):
        mine = [row for row in rows if (row.case, row.tool) == (case, model)]
        solved = [row for row in mine if row["status"] == "solved"]
        figures: dict[str, Figure] = {"solved": f"{len(solved)} of {len(mine)}"}
        for name in ("freedoms", "pairs", "a solve ms", "judgement ms", "leaving out ms"):
            figures[name] = float(np.median([row[name] for row in mine]))
        figures["inside"] = sum(row["deepest mm"] > 0.1 for row in solved)
        for name in ("deepest mm", "clearance missed mm", "goal missed mm", "effort above %"):
            figures[f"worst {name}"] = max((row[name] for row in solved), default=float("nan"))
        found.append(Row(case, model, figures))
    return found

"""What sparse Newton costs by size, shape and factorisation, in whole solves and in drags.

All times are the processor's, medians.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
import pinocchio as pin

import wholebody as wb
from tests.audits.newton_shapes import (
    LINK,
    SHAPES,
    chain,
    four_bar,
    median_us,
    pulled_chain,
    ring,
    three_bar,
)
from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.bench.rows import Row, across, only, times
from wholebody.bench.rows import report as tables_of
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.feasibility import FeasibilityResult, satisfy
from wholebody.methods.newton.linear_algebra import LinearSystem, Pattern, linear_algebra
from wholebody.methods.newton.method import NewtonTracker
from wholebody.methods.newton.settings import STEPS
from wholebody.methods.newton.system import ActiveSystem
from wholebody.methods.newton.terms import FigureSystem

SIZES = (10, 30, 100, 300, 1000)
SMALLEST_FITTED = 30  # bodies: smaller systems cost what any call costs
ALGEBRAS = ("normal", "kkt", "schur")
PAPER_BODIES = 30  # 210 variables and about 1455 non-zeros, as in the paper
CIRCLE = 0.05  # rad: from move to move of a drag
FINE = 1e-8  # m, rad: tolerance at which two methods are compared
TABLE_TOP = 0.74  # m
TOUCHING = 1e-4  # m: nearer than this counts as contact
LARGEST_STAR = 300  # bodies for which a star's full normal equations are still formed


def linear_rows(sizes: tuple[int, ...], repeats: int) -> Iterator[Row]:
    """Every factorisation on every shape and size: its non-zeros, to lay out and analyse a structure, and to solve."""
    for shape, make in SHAPES.items():
        for count in sizes:
            made = make(count)
            system = made.system()
            pattern = system.pattern
            rng = np.random.default_rng(0)
            task = LinearSystem(
                system.values(made.variables()),
                system.weight,
                np.full(pattern.height, STEPS.hard_damping),
                np.zeros(pattern.width),
                rng.normal(size=pattern.height),
            )
            for name in ALGEBRAS:
                if shape == "star" and count > LARGEST_STAR and name == "normal":
                    continue
                if name == "schur" and shape != "star":
                    continue
                few = 2 if count >= LARGEST_STAR and name == "normal" and shape == "star" else repeats
                analysed = median_us(partial(linear_algebra, pattern, name), 3)
                solver = linear_algebra(pattern, name)
                try:
                    solved = median_us(partial(solver.solve, task), few)
                except WholebodyError:
                    solved = float("nan")
                figures = {"bodies": count, "non-zeros": len(pattern.rows), "of the factor": solver.fill}
                yield Row(shape, name, {**figures, "ms a new structure": 1e-3 * analysed, "µs": solved})


def exponent(rows: Sequence[Row], shape: str, algebra: str) -> float:
    """Slope of log time over log bodies, from `SMALLEST_FITTED` bodies."""
    kept = [(row["bodies"], row["µs"]) for row in rows if (row.case, row.tool) == (shape, algebra)]
    kept = [(n, t) for n, t in kept if n >= SMALLEST_FITTED and np.isfinite(t)]
    if len(kept) < 2:
        return float("nan")
    n, t = np.log(np.array(kept)).T
    return float(np.polyfit(n, t, 1)[0])


def assembly_row(case: str, made: Assembly, repeats: int) -> Row:
    """A reach from where an assembly stands."""
    system = made.system()
    active_system = ActiveSystem(system.batches, system.weight, "auto")
    return _reach_row(case, active_system, active_system.begin(made.variables(), ()), repeats)


def _reach_row(case: str, active_system: ActiveSystem, x: Array, repeats: int) -> Row:
    def once() -> FeasibilityResult:
        return satisfy(active_system, x, tolerance=1e-5, iterations=50)

    found, us = once(), median_us(once, repeats)
    return _solve_row(case, active_system.system.pattern, (found.iterations, found.systems), us, found.residuals)


def _solve_row(case: str, pattern: Pattern, counts: tuple[float, float], us: float, errors: Sequence[float]) -> Row:
    """A whole solve: evaluations, factorisations and judgement of steps; `counts` are iterations and systems."""
    size = {"variables": pattern.width, "non-zeros": len(pattern.rows)}
    done = dict(zip(("iterations", "systems"), counts, strict=True))
    last = " ".join(f"{value:.1e}" for value in errors[-4:])
    return Row(case, "", {**size, **done, "ms": 1e-3 * us, "last errors": last})


def paper_row(repeats: int) -> Row:
    """The paper's size: a chain of 30 bodies whose end is dragged so far that it takes three systems."""
    return assembly_row("the paper's size", pulled_chain(PAPER_BODIES), repeats)


def drag_of_assembly_row(moves: int) -> Row:
    """The same chain dragged in a circle through the public interface: a new place of the goal, and a solve."""
    made, last, tip = chain(PAPER_BODIES), f"b{PAPER_BODIES - 1}", np.array((LINK, 0.0, 0.0))
    here, spent, found = made.placement(last).act(tip), [], []
    for angle in CIRCLE * np.arange(moves):
        target = here + (0.03 * np.cos(angle) - 0.05, 0.03 * np.sin(angle), -0.03)
        began = time.process_time()
        found.append(made.drop_goals().point_goal(last, target, place=tip).solve())
        spent.append(time.process_time() - began)
    counts = float(np.mean([one.iterations for one in found])), float(np.mean([one.systems for one in found]))
    us, errors = 1e6 * float(np.median(spent)), found[-1].residuals
    return _solve_row("the same, a move of a drag", made.system().pattern, counts, us, errors)


def loop_rows(repeats: int) -> list[Row]:
    """Closed loops beside open chains with as many bodies, each moved by a goal."""
    closed, opened = four_bar(), three_bar()
    for made in (closed, opened):
        turned = made.placement("crank").rotation @ pin.utils.rotate("y", 0.1)
        made.point_goal("crank", turned @ np.array((0.0, 0.0, 0.3)), place=(0, 0, 0.3))
    rows = [assembly_row("three bars, open", opened, repeats), assembly_row("four-bar, closed", closed, repeats)]
    for name, made in (("chain of 100, open", chain(100)), ("ring of 100, closed", ring(100))):
        made.point_goal("b50", made.placement("b50").translation + np.array((0.02, 0.01, 0.03)))
        rows.append(assembly_row(name, made, repeats))
    return rows + [figure_row(name, problem, repeats) for name, problem in _hands_problems()]


def figure_row(case: str, problem: wb.Problem, repeats: int) -> Row:
    """A reach of a figure, without polishing of the measures."""
    active_system = FigureSystem(problem, problem.workspace(), "auto")
    return _reach_row(case, active_system, active_system.variables(problem.start), max(3, repeats // 10))


def agreement_rows(repeats: int) -> list[Row]:
    """Problems whose least effort is unique, by both methods, the loop being an equality in either."""
    rows = []
    for case, problem in _hands_problems():
        ours, theirs = wb.methods.Newton(tolerance=FINE), wb.methods.QP(tolerance=FINE)
        ends = [method.solve(problem) for method in (ours, theirs)]
        each = [1e-3 * median_us(partial(method.solve, problem), max(3, repeats // 30)) for method in (ours, theirs)]
        apart = float(np.abs(pin.difference(problem.scene.model, ends[0].q, ends[1].q)).max())
        least = [end.assessment.measure for end in ends]
        figures = {"newton ms": each[0], "qp ms": each[1], "joints apart rad": apart}
        rows.append(Row(case, "", {**figures, "measures apart": abs(least[0] - least[1]) / least[1]}))
    return rows


def _hands_problems() -> Iterator[tuple[str, wb.Problem]]:
    """The human alone with both arms forward and both feet held, the left palm to be raised by 10 cm."""
    scene = wb.Scene(wb.load("human"))
    q = scene.figure.posture("arms_forward")
    palm = scene.state(q).frame(scene.frame_id("left_palm")).translation.copy()
    goals = [wb.Point("left_palm", palm + (0.0, 0.0, 0.1))]
    feet, grip = [wb.Hold("left_foot"), wb.Hold("right_foot")], wb.Hold("right_palm", relative_to="left_palm")
    for name, held in (("two hands, open", feet), ("two hands on one box, closed", [*feet, grip])):
        yield name, wb.Problem(scene, q, goals=goals, constraints=held)


def drag_row(frames: int, contacts: bool) -> Row:
    """A drag of the right hand in an upright circle; with contacts, its lower part lies under a table's top."""
    scene = wb.Scene(wb.load("human"))
    if contacts:
        scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0.0, TABLE_TOP - 0.02))
    start = np.array((0.45, -0.25, 0.9))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", start)], constraints=holds)
    drag = wb.tracking.Drag(problem, wb.methods.Newton())
    for _ in range(20):  # to the circle, which is not measured
        drag.to(start)
    low = TABLE_TOP - 0.02 if contacts else 0.8
    owners = scene.piece_owner
    table = np.array(["table" in (owners[a], owners[b]) for a, b in scene.pair_table.pairs], dtype=bool)
    spent, iterations, drift, least, workspace = [], [], 0.0, [], scene.workspace()
    for k in range(frames):
        angle = 0.05 * k
        place = (0.45, -0.25 + 0.1 * np.sin(angle), low + 0.1 * (1.0 + np.cos(angle)))
        began = time.process_time()
        frame = drag.to(place)
        spent.append(1e3 * (time.process_time() - began))
        iterations.append(frame.iterations)
        near = workspace.near(frame.q, 0.01)
        state = workspace.state
        for term in problem.constraints:
            value = term.value(state)
            drift = max(drift, float(np.abs(value - np.clip(value, term.lower, term.upper)).max()))
        least.append(float(near.distance[table[near.number]].min(initial=np.inf)))
    distance = np.array(least)
    assert isinstance(drag.tracker, NewtonTracker)
    return Row(
        "with a table under the lower part of the circle" if contacts else "free",
        "",
        {
            "frames": frames,
            **times(spent),
            "iterations a frame": float(np.mean(iterations)),
            "frames in contact %": 100.0 * float((distance < TOUCHING).mean()),
            "structures": drag.tracker.structures,
            "greatest constraint error": drift,
            "deepest mm": 1e3 * max(0.0, -float(distance.min(initial=np.inf))),
        },
    )


def report(
    linear: Sequence[Row],
    solves: Sequence[Row],
    agreements: Sequence[Row],
    drags: Sequence[Row],
    facts: Mapping[str, str],
) -> str:
    """Tables to read; of the factorisations at the largest size, and how they grow."""
    slopes = [Row(shape, name, {"exponent": exponent(linear, shape, name)}) for shape in SHAPES for name in ALGEBRAS]
    most = max(row["bodies"] for row in linear)
    tables = {
        "Solves": only(solves, "variables", "non-zeros", "iterations", "ms", "last errors"),
        "The same problem by newton and by qp": agreements,
        "Drags of the human's hand": drags,
        "Factorisations": [row for row in linear if row["bodies"] == most],
        "Exponents of the time by the bodies": across(slopes, "exponent", columns="tool"),
    }
    return tables_of("Times are the processor's, medians.", tables, facts)

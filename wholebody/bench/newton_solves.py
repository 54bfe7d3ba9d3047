"""Whole solves by sparse Newton, the same problems by QP, and drags of the human's hand."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.newton_shapes import LINK, chain, four_bar, median_us, ring, three_bar
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.feasibility import reach
from wholebody.methods.newton.linear_algebra.choice import linear_algebra
from wholebody.methods.newton.system import ActiveSystem
from wholebody.methods.newton.tracking import NewtonTracker

PAPER_BODIES = 30  # 210 variables and about 1455 non-zeros, as in the paper
PAPER_WAY = (0.03, -0.03, 0.02)  # m: as far as takes three systems
CIRCLE = 0.05  # rad: from move to move of a drag
FINE = 1e-8  # m, rad: tolerance at which two methods are compared


@dataclass(frozen=True)
class SolveRow:
    """A whole solve: evaluations, factorisations and judgement of steps.

    Attributes:
        case: what.
        variables, nonzeros: of the Jacobian.
        iterations: Newton iterations.
        systems: linear systems solved.
        ms: time [ms].
        us_each: time for a system and a variable [us].
        errors: the last ones, with the most exact last.
    """

    case: str
    variables: int
    nonzeros: int
    iterations: float
    systems: float
    ms: float
    us_each: float
    errors: str


@dataclass(frozen=True)
class AgreementRow:
    """One problem by two methods.

    Attributes:
        case: what.
        newton_ms, qp_ms: time of a solve [ms].
        apart: greatest difference of a joint [rad].
        measures_apart: relative difference of the measures.
    """

    case: str
    newton_ms: float
    qp_ms: float
    apart: float
    measures_apart: float


def paper_row(repeats: int) -> SolveRow:
    """The paper's size: a chain of 30 bodies whose end is dragged so far that it takes three systems."""
    made = chain(PAPER_BODIES)
    last = f"b{PAPER_BODIES - 1}"
    tip = np.array((LINK, 0.0, 0.0))
    made.point_goal(last, made.placement(last).act(tip) + np.array(PAPER_WAY), place=tip)
    return assembly_row("the paper's size", made, repeats)


def drag_of_assembly_row(moves: int) -> SolveRow:
    """The same chain dragged in a circle as its users do it: a goal at a new place, and a solve, at every move."""
    made, last, tip = chain(PAPER_BODIES), f"b{PAPER_BODIES - 1}", np.array((LINK, 0.0, 0.0))
    here, times, found = made.placement(last).act(tip), [], []
    for angle in CIRCLE * np.arange(moves):
        target = here + (0.03 * np.cos(angle) - 0.05, 0.03 * np.sin(angle), -0.03)
        began = time.process_time()
        found.append(made.drop_goals().point_goal(last, target, place=tip).solve())
        times.append(time.process_time() - began)
    pattern, systems = made.system().pattern, float(np.mean([one.systems for one in found]))
    us, errors = 1e6 * float(np.median(times)), " ".join(f"{value:.1e}" for value in found[-1].residuals[-4:])
    iterations = float(np.mean([one.iterations for one in found]))
    each = us / max(systems, 1.0) / pattern.width
    return SolveRow(
        "the same, a move of a drag", pattern.width, len(pattern.rows), iterations, systems, 1e-3 * us, each, errors
    )


def loop_rows(repeats: int) -> list[SolveRow]:
    """Closed loops beside open chains with as many bodies, each moved by a goal."""
    closed, opened = four_bar(), three_bar()
    for made in (closed, opened):
        turned = made.placement("crank").rotation @ pin.utils.rotate("y", 0.1)
        made.point_goal("crank", turned @ np.array((0.0, 0.0, 0.3)), place=(0, 0, 0.3))
    rows = [assembly_row("three bars, open", opened, repeats), assembly_row("four-bar, closed", closed, repeats)]
    for name, made in (("chain of 100, open", chain(100)), ("ring of 100, closed", ring(100))):
        made.point_goal("b50", made.placement("b50").translation + np.array((0.02, 0.01, 0.03)))
        rows.append(assembly_row(name, made, repeats))
    scene, q = hands_scene()
    for name, more in (("two hands, open", []), ("two hands on one box, closed", [_grip()])):
        rows.append(figure_row(name, hands_problem(scene, q, more), repeats))
    return rows


def nearest_row(repeats: int) -> SolveRow:
    """The nearest place by Newton on the KKT system, whose last errors show the order of convergence."""
    made = ring(30)
    made.point_goal("b0", made.placement("b0").translation + np.array((-0.1, 0.06, 0.15)))
    start = made.variables()

    def solve() -> Any:
        made.place(start)
        return made.solve(tolerance=1e-9, nearest=True)

    found, us = solve(), median_us(solve, max(3, repeats // 10))
    pattern = made.system().pattern
    systems = found.systems + len(found.nearness)
    errors = " ".join(f"{value:.1e}" for value in found.nearness[-4:])
    case = "nearest place of a ring of 30"
    count = found.iterations + len(found.nearness) - 1
    return SolveRow(
        case, pattern.width, len(pattern.rows), count, systems, 1e-3 * us, us / systems / pattern.width, errors
    )


def assembly_row(case: str, made: Assembly, repeats: int) -> SolveRow:
    """A reach from where an assembly stands."""
    system = made.system()
    active_system, x = ActiveSystem(system, linear_algebra(system.pattern)), made.variables()
    found = reach(active_system, x, tolerance=1e-5, iterations=50)
    us = median_us(lambda: reach(active_system, x, tolerance=1e-5, iterations=50), repeats)
    pattern, errors = system.pattern, " ".join(f"{value:.1e}" for value in found.residuals[-4:])
    each = us / max(found.systems, 1) / pattern.width
    return SolveRow(case, pattern.width, len(pattern.rows), found.iterations, found.systems, 1e-3 * us, each, errors)


def figure_row(case: str, problem: wb.Problem, repeats: int) -> SolveRow:
    """A reach of a figure, without polishing of the measures."""
    from wholebody.methods.newton.figure_system import FigureSystem

    active_system = FigureSystem(problem, problem.workspace(), "auto")
    few = max(3, repeats // 10)

    def once() -> Any:
        return reach(active_system, active_system.variables(problem.start), tolerance=1e-5, iterations=50)

    found, us = once(), median_us(once, few)
    pattern, errors = active_system.system.pattern, " ".join(f"{value:.1e}" for value in found.residuals[-4:])
    each = us / max(found.systems, 1) / pattern.width
    return SolveRow(case, pattern.width, len(pattern.rows), found.iterations, found.systems, 1e-3 * us, each, errors)


def agreement_rows(repeats: int) -> list[AgreementRow]:
    """Problems whose least effort is unique, by both methods, the loop being an equality in either."""
    scene, q = hands_scene()
    rows = []
    for case, more in (("two hands, open", []), ("two hands on one box, closed", [_grip()])):
        problem = hands_problem(scene, q, more)
        ours, theirs = wb.Newton(tolerance=FINE), wb.QP(tolerance=FINE)
        ends = [method.solve(problem) for method in (ours, theirs)]
        times = [median_us(partial(method.solve, problem), max(3, repeats // 30)) for method in (ours, theirs)]
        apart = float(np.abs(pin.difference(scene.model, ends[0].q, ends[1].q)).max())
        least = [end.assessment.measure for end in ends]
        rows.append(AgreementRow(case, 1e-3 * times[0], 1e-3 * times[1], apart, abs(least[0] - least[1]) / least[1]))
    return rows


def hands_scene() -> tuple[wb.Scene, Any]:
    """The human alone, and the posture with both arms forward."""
    scene = wb.Scene(wb.load("human"))
    return scene, scene.figure.posture("arms_forward")


def hands_problem(scene: wb.Scene, q: Any, more: list[Any]) -> wb.Problem:
    """Both feet held, the left palm to be raised by 10 cm."""
    palm = scene.state(q).frame(scene.frame_id("left_palm")).translation.copy()
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    goals = [wb.Point("left_palm", palm + (0.0, 0.0, 0.1))]
    return wb.Problem(scene, q, goals=goals, constraints=[*feet, *more])


def _grip() -> wb.Hold:
    return wb.Hold("right_palm", relative_to="left_palm")


TABLE_TOP = 0.74  # m
TOUCHING = 1e-4  # m: nearer than this counts as contact


@dataclass(frozen=True)
class DragRow:
    """A drag.

    Attributes:
        case: what.
        frames: how many.
        ms, ms_95: time of a frame that half and 95 % of the frames stay below [ms].
        iterations: Newton iterations a frame, mean.
        touching: share of the frames after which the hand touches the table.
        structures: patterns laid out: contacts that come or go in combinations not met before.
        structure_ms: time of each [ms].
        drift: greatest error of a constraint after any frame [m or rad].
        deepest: deepest overlap with the table after any frame [m].
    """

    case: str
    frames: int
    ms: float
    ms_95: float
    iterations: float
    touching: float
    structures: int
    structure_ms: float
    drift: float
    deepest: float


def drag_row(frames: int, contacts: bool) -> DragRow:
    """A drag of the right hand in an upright circle; with contacts, its lower part lies under a table's top."""
    scene = wb.Scene(wb.load("human"))
    if contacts:
        scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0.0, TABLE_TOP - 0.02))
    start = np.array((0.45, -0.25, 0.9))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", start)], constraints=holds)
    drag = wb.Drag(problem, wb.Newton())
    for _ in range(20):  # to the circle, which is not measured
        drag.to(start)
    low = TABLE_TOP - 0.02 if contacts else 0.8
    owners = scene.piece_owner
    table = np.array(["table" in (owners[a], owners[b]) for a, b in scene.pair_table.pairs], dtype=bool)
    times, iterations, drift, least, workspace = [], [], 0.0, [], scene.workspace()
    for k in range(frames):
        angle = 0.05 * k
        place = (0.45, -0.25 + 0.1 * np.sin(angle), low + 0.1 * (1.0 + np.cos(angle)))
        began = time.process_time()
        frame = drag.to(place)
        times.append(1e3 * (time.process_time() - began))
        iterations.append(frame.iterations)
        near = workspace.near(frame.q, 0.01)
        state = workspace.state
        for term in problem.constraints:
            drift = max(
                drift, float(np.abs(term.value(state) - np.clip(term.value(state), term.lower, term.upper)).max())
            )
        least.append(float(near.distance[table[near.number]].min(initial=np.inf)))
    distance = np.array(least)
    assert isinstance(drag.tracker, NewtonTracker)
    structures, seconds = drag.tracker.laid_out
    return DragRow(
        case="with a table under the lower part of the circle" if contacts else "free",
        frames=frames,
        ms=float(np.median(times)),
        ms_95=float(np.percentile(times, 95)),
        iterations=float(np.mean(iterations)),
        touching=float((distance < TOUCHING).mean()),
        structures=structures,
        structure_ms=1e3 * seconds / max(structures, 1),
        drift=drift,
        deepest=max(0.0, -float(distance.min(initial=np.inf))),
    )

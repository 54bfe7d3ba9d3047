"""`wholebody bench newton`: what sparse Newton costs by size, shape and factorisation, and in a drag."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.errors import WholebodyError
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.course import Course
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern
from wholebody.methods.newton.linear_algebra.choice import linear_algebra
from wholebody.methods.newton.reaching import reach
from wholebody.methods.newton.run import HARD_DAMPING

SIZES = (10, 30, 100, 300, 1000)
ALGEBRAS = ("normal", "llt", "kkt", "schur", "dense")
LARGEST_DENSE = 100  # bodies: more take seconds
LARGEST_STAR = 300  # bodies for which a star's full normal equations are still formed
PAPER_BODIES = 30  # 210 variables and about 1455 non-zeros, as in the paper
LINK = 0.2  # m


@dataclass(frozen=True)
class LinearRow:
    """One factorisation on one structure.

    Attributes:
        shape: "chain", "tree", "ring" or "star".
        bodies: how many.
        algebra: name of the factorisation.
        variables, equations, nonzeros: of the Jacobian.
        fill: non-zeros of the factor.
        analyse_us: to lay out and analyse [us].
        solve_us: to refill, factorise and solve, median [us].
    """

    shape: str
    bodies: int
    algebra: str
    variables: int
    equations: int
    nonzeros: int
    fill: int
    analyse_us: float
    solve_us: float


@dataclass(frozen=True)
class ReachRow:
    """A whole solve: evaluations, factorisations and judgement of steps.

    Attributes:
        case: what.
        variables, nonzeros: of the Jacobian.
        iterations: Newton iterations, their mean where there are several solves.
        ms: median wall time [ms].
        residuals: the last ones, with the most exact last.
    """

    case: str
    variables: int
    nonzeros: int
    iterations: float
    ms: float
    residuals: str


def chain(count: int, bend: float = 0.1) -> Assembly:
    """A bent chain of revolute joints about y and z in turn, the first one spherical on the world."""
    import pinocchio as pin

    made, place = Assembly(), pin.SE3.Identity()
    for k in range(count):
        made.body(f"b{k}", place, size=0.5 * LINK)
        base, axis = (f"b{k - 1}", place.rotation @ np.eye(3)[1 + k % 2]) if k else ("world", None)
        if axis is None:
            made.spherical(base, f"b{k}", at=place.translation)
        else:
            made.revolute(base, f"b{k}", at=place.translation, axis=axis)
        turn = pin.utils.rotate("y" if k % 2 else "z", bend)
        place = place * pin.SE3(np.eye(3), np.array((LINK, 0.0, 0.0))) * pin.SE3(turn, np.zeros(3))
    return made


def tree(count: int) -> Assembly:
    """A binary tree of revolute joints."""
    made = Assembly()
    for k in range(count):
        parent = (k - 1) // 2
        depth = int(np.log2(k + 1))
        place = (LINK * depth, LINK * (k + 1 - 2**depth), 0.0)
        made.body(f"b{k}", place, size=0.5 * LINK)
        if k:
            made.revolute(f"b{parent}", f"b{k}", at=place, axis=np.eye(3)[1 + k % 2])
        else:
            made.spherical("world", "b0", at=place)
    return made


def ring(count: int) -> Assembly:
    """A closed ring of spherical joints."""
    made, radius = Assembly(), LINK * count / (2.0 * np.pi)
    angles = 2.0 * np.pi * np.arange(count) / count
    corners = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    for k in range(count):
        made.body(f"b{k}", corners[k], size=0.5 * LINK)
    for k in range(count):
        made.spherical(f"b{k - 1}" if k else f"b{count - 1}", f"b{k}", at=corners[k])
    return made


def star(count: int) -> Assembly:
    """A hub with arms on revolute joints."""
    made = Assembly().body("hub", size=LINK)
    for k in range(1, count):
        angle = 2.0 * np.pi * k / (count - 1)
        place = (LINK * np.cos(angle), LINK * np.sin(angle), 0.0)
        made.body(f"b{k}", place, size=0.5 * LINK)
        made.revolute("hub", f"b{k}", at=place, axis=(0, 0, 1))
    made.fixed("world", "hub")
    return made


SHAPES: dict[str, Callable[[int], Assembly]] = {"chain": chain, "tree": tree, "ring": ring, "star": star}


def linear_rows(sizes: tuple[int, ...], repeats: int) -> Iterator[LinearRow]:
    """Every factorisation on every shape and size."""
    for shape, make in SHAPES.items():
        for count in sizes:
            made = make(count)
            system = made.system()
            x, pattern = made.variables(), system.pattern
            values = system.values(x)
            rng = np.random.default_rng(0)
            task = LinearSystem(
                values,
                system.weight,
                np.full(pattern.height, HARD_DAMPING),
                np.zeros(pattern.width),
                rng.normal(size=pattern.height),
            )
            for name in ALGEBRAS:
                if name == "dense" and count > LARGEST_DENSE:
                    continue
                if shape == "star" and count > LARGEST_STAR and name in ("normal", "llt"):
                    continue
                if name == "schur" and shape != "star":
                    continue
                began = time.perf_counter()
                solver = linear_algebra(pattern, name)
                analysed = time.perf_counter() - began
                times = []
                try:
                    for _ in range(repeats + 1):
                        began = time.perf_counter()
                        solver.solve(task)
                        times.append(time.perf_counter() - began)
                except WholebodyError:
                    times = [np.nan, np.nan]
                size = (pattern.width, pattern.height, len(pattern.rows))
                solve_us = 1e6 * float(np.median(times[1:]))
                yield LinearRow(shape, count, name, *size, solver.fill, 1e6 * analysed, solve_us)


def paper_row(repeats: int) -> ReachRow:
    """The paper's size: a chain of 30 bodies whose end is dragged by 2 cm."""
    made = chain(PAPER_BODIES)
    last = f"b{PAPER_BODIES - 1}"
    tip = np.array((LINK, 0.0, 0.0))
    made.point_goal(last, made.placement(last).act(tip) + np.array((0.012, -0.012, 0.01)), place=tip)
    system = made.system()
    course, x = Course(system, linear_algebra(system.pattern)), made.variables()
    times = []
    for _ in range(repeats + 1):
        began = time.perf_counter()
        found = reach(course, x, tolerance=1e-5, iterations=30)
        times.append(time.perf_counter() - began)
    return _row("the paper's size", system.pattern, found.iterations, found.residuals, times)


def drag_row(frames: int, contacts: bool) -> tuple[ReachRow, float]:
    """A drag of the human's right hand in a circle, and the greatest error of its constraints [m or rad]."""
    import wholebody as wb

    scene = wb.Scene(wb.load("human"))
    if contacts:
        scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0.0, 0.72))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", (0.45, -0.25, 0.9))], constraints=holds)
    drag = wb.Drag(problem, "newton")
    drag.to((0.45, -0.25, 0.9))
    low = 0.765 if contacts else 0.8  # the finger slides over the table at the lowest part
    times, iterations, worst = [], [], 0.0
    for k in range(frames):
        angle = 0.05 * k
        place = (0.45, -0.25 + 0.1 * np.sin(angle), low + 0.1 * (1.0 + np.cos(angle)))
        frame = drag.to(place)
        times.append(frame.seconds)
        iterations.append(frame.iterations)
        if k % 50 == 0:
            worst = max(worst, wb.assess(problem, frame.q).constraint_violation)
    assert isinstance(drag.method, wb.Newton)
    pattern = drag.method.pattern()
    case = f"a frame of dragging the human, {'with a table' if contacts else 'free'}"
    return _row(case, pattern, float(np.mean(iterations)), (), times), worst


def exponent(rows: list[LinearRow], shape: str, algebra: str) -> float:
    """Slope of log time over log bodies, from 100 bodies."""
    kept = [(row.bodies, row.solve_us) for row in rows if (row.shape, row.algebra) == (shape, algebra)]
    kept = [(n, t) for n, t in kept if n >= 100 and np.isfinite(t)]
    if len(kept) < 2:
        return float("nan")
    n, t = np.log(np.array(kept)).T
    return float(np.polyfit(n, t, 1)[0])


def _row(case: str, pattern: Pattern, iterations: float, residuals: Sequence[float], times: list[float]) -> ReachRow:
    tail = " ".join(f"{value:.1e}" for value in residuals[-4:])
    return ReachRow(case, pattern.width, len(pattern.rows), iterations, 1e3 * float(np.median(times[1:])), tail)


def report(
    linear: Sequence[LinearRow], solves: Sequence[ReachRow], drift: Sequence[float], facts: dict[str, str]
) -> str:
    """Tables to read."""
    lines = [f"Measured on {facts.get('processor', 'this machine')}.", ""]
    lines += ["| solve | variables | non-zeros | iterations | ms | last residuals |", "|---|---|---|---|---|---|"]
    for solve in solves:
        numbers = f"{solve.variables} | {solve.nonzeros} | {solve.iterations:.2f} | {solve.ms:.2f}"
        lines.append(f"| {solve.case} | {numbers} | {solve.residuals} |")
    lines += ["", f"Greatest error of a constraint in the drags: {max(drift):.1e} m or rad.", ""]
    lines += ["| shape | bodies | " + " | ".join(f"{name} us (fill)" for name in ALGEBRAS) + " |"]
    lines += ["|---|---|" + "---|" * len(ALGEBRAS)]
    by_place = {(row.shape, row.bodies, row.algebra): row for row in linear}
    for shape, bodies in dict.fromkeys((row.shape, row.bodies) for row in linear):
        found = [by_place.get((shape, bodies, name)) for name in ALGEBRAS]
        cells = [f"{row.solve_us:.0f} ({row.fill})" if row else "" for row in found]
        lines.append(f"| {shape} | {bodies} | " + " | ".join(cells) + " |")
    lines += [
        "",
        "| shape | " + " | ".join(f"exponent, {name}" for name in ALGEBRAS[:4]) + " |",
        "|---|---|---|---|---|",
    ]
    for shape in SHAPES:
        slopes = [exponent(list(linear), shape, name) for name in ALGEBRAS[:4]]
        lines.append(f"| {shape} | " + " | ".join("" if np.isnan(slope) else f"{slope:.2f}" for slope in slopes) + " |")
    return "\n".join(lines)

"""`wholebody bench scaling`: a chain 2 m long reaches among things; joints, pieces or things grow, the rest stays."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, WholebodyError
from wholebody.bench.rows import Figure, Panel, Row, measured_ms
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.bench.suite.stability.bodies import Builder
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.simplification import simplify
from wholebody.tracking.drag import Drag

TIP = "tip"
LENGTH = 2.0  # m: of the whole chain, however many joints it has
ROOM = 0.01  # m: left free around the start and the witness
TRIES = 400  # witnesses, and places of one thing
SIZES: dict[str, tuple[int, ...]] = {
    "joints": (5, 10, 20, 50, 100, 200),
    "pieces of each segment": (1, 2, 4, 8, 16, 32),
    "things around": (10, 30, 100, 300, 1000, 2000, 5000),
}
SIMPLIFIED = "qp, simplified"


def chain(joints: int, pieces: int, segments: int | None = None) -> wb.Figure:
    """A chain along x, joints about z and y in turn, with boxes on `segments` of its links, all where None."""
    if joints < 1 or not 1 <= (segments or joints) <= joints:
        raise InputError(f"a chain of {joints} joints cannot have {segments} segments; give 1 to {joints}")
    solid = {round(k) for k in np.linspace(0, joints - 1, segments or joints)}
    ends = [*sorted(solid), joints]
    long = {first: (last - first) * LENGTH / joints for first, last in pairwise(ends)}
    limit, joint, builder = min(6.0 / joints, 2.5), 0, Builder("chain")  # rad
    for k in range(joints):
        kind, at = ("rz", "ry")[k % 2], (LENGTH / joints if k else 0.0, 0.0, 0.0)
        joint = builder.joint(kind, f"joint{k}", parent=joint, at=at, limits=(-limit, limit))
        for size, middle in _boxes(long[k], pieces) if k in solid else ():
            builder.shape(joint, wb.Box((size, 0.05, 0.05)), pin.SE3(np.eye(3), np.array((middle, 0.0, 0.0))))
    builder.frame(joint, TIP, (LENGTH / joints, 0.0, 0.0))
    return builder.figure()


def _boxes(length: float, count: int) -> list[tuple[float, float]]:
    """Lengths and middles of a row of boxes that ends short of both joints."""
    free = max(length - 0.1, 0.1 * length)
    return [(free / count, 0.5 * (length - free) + (k + 0.5) * free / count) for k in range(count)]


def task(figure: wb.Figure, things: int, seed: int) -> tuple[wb.Scene, Array]:
    """A scene in which the chain reaches among things, as dense within 2.4 m as farther out, and its goal (3,)."""
    rng = np.random.default_rng([seed, figure.model.nq, things])
    witness = _free_posture(figure, rng)
    occupied = Occupied(figure, (figure.neutral, witness))
    scene = wb.Scene(figure)
    spread = 2.4 * max(1.0, (things / 10.0) ** (1.0 / 3.0))
    for number in range(things):
        size = tuple(rng.uniform(0.03, 0.12, 3))
        shape = wb.Box((float(size[0]), float(size[1]), float(size[2])))
        for _ in range(TRIES):
            x, y, z = (float(value) for value in rng.uniform(-spread, spread, 3))
            if occupied.clear_of(shape, (x, y, z), ROOM):
                scene.add(shape, name=f"thing {number}", at=(x, y, z))
                break
    return scene, figure.placement(witness, TIP).translation


def _free_posture(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """A smoothly bent posture, so that a long chain goes somewhere, in which it does not touch itself."""
    alone, model = wb.Scene(figure), figure.model
    place = np.linspace(0.0, np.pi, model.nq)
    most = model.upperPositionLimit
    for _ in range(TRIES):
        waves = rng.uniform(-1.0, 1.0, (2, 3)) @ np.array([np.cos(k * place) for k in (0, 1, 2)])
        q = most * np.where(np.arange(model.nq) % 2 == 0, waves[0], waves[1]).clip(-1.0, 1.0) * 0.6
        if alone.contacts(q, within=ROOM).distance.min(initial=1.0) >= ROOM:
            return np.asarray(q)
    raise InputError(f"none of {TRIES} postures of the chain is free; give another seed")


def assembly_chain(count: int) -> Assembly:
    """A bent chain of loose bodies, the first joint spherical on the world, whose end is to move by centimetres."""
    made, place = Assembly(), pin.SE3.Identity()
    for k in range(count):
        made.body(f"b{k}", place, size=0.1)
        if k:
            axis = place.rotation @ np.eye(3)[1 + k % 2]
            made.revolute(f"b{k - 1}", f"b{k}", at=place.translation, axis=axis)
        else:
            made.spherical("world", "b0", at=place.translation)
        turn = pin.utils.rotate("y" if k % 2 else "z", 0.1)
        place = place * pin.SE3(turn, np.array((0.2, 0.0, 0.0)))
    last, tip = f"b{count - 1}", np.array((0.2, 0.0, 0.0))
    made.point_goal(last, made.placement(last).act(tip) + np.array((0.03, -0.03, 0.02)), place=tip)
    return made


def rows(
    sizes: dict[str, tuple[int, ...]], methods: Sequence[str], repeats: int, say: Callable[[str], None]
) -> Iterator[Row]:
    """Measure all methods at all sizes; `say` takes a line about each. What is slower than a second grows no more."""
    for series, grown in sizes.items():
        slow: set[str] = set()
        for size in grown:
            joints = size if series == "joints" else 12
            pieces = size if series.startswith("pieces") else 1
            figure = chain(joints, pieces, min(joints, 10))
            scene, target = task(figure, size if series.startswith("things") else 10, seed=0)
            build, _, _ = measured_ms(lambda scene=scene: scene.geometry)  # type: ignore[misc]
            for method in (*methods, SIMPLIFIED):
                if method in slow:
                    continue
                try:
                    row = _row(f"{size} {series}", method, scene, target, build, repeats)
                except WholebodyError as error:
                    say(f"{size} {series}, {method}: left out, {error}")
                    slow.add(method)
                    continue
                if row["a solve ms"] > 1e3:
                    slow.add(method)
                    say(f"{method}: more {series} than {size} left out, for a solve took more than a second")
                say(f"{row.case}, {method}: {row['a solve ms']:.1f} ms, {row['status']}")
                yield row
            del scene, figure
            gc.collect()


def assembly_rows(sizes: Sequence[int], repeats: int) -> Iterator[Row]:
    """Sparse Newton on chains of loose bodies: no model of joints, seven variables a body."""
    for size in sizes:
        build, _, made = measured_ms(partial(assembly_chain, size))
        solves = [measured_ms(made.solve) for _ in range(repeats)]
        answer = solves[-1][2]
        figures: dict[str, Figure] = {
            "status": answer.status,
            "iterations": answer.iterations,
            "a solve ms": min(each[0] for each in solves),
            "building ms": build,
        }
        yield Row(f"{size} joints", "newton, assembly", figures)


def _row(case: str, method: str, scene: wb.Scene, target: Any, build: float, repeats: int) -> Row:
    stating, _, problem = measured_ms(lambda: wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=0.002))
    asked, name = problem, method
    if method == SIMPLIFIED:
        stating, _, part = measured_ms(lambda: simplify(problem))
        asked, name = part.problem, "qp"
    wb.solve(asked, name)
    solves = [wb.solve(asked, name) for _ in range(repeats)]
    figures: dict[str, Figure] = {
        "pairs": len(asked.scene.geometry.collisionPairs),
        "status": solves[-1].status,
        "iterations": solves[-1].iterations,
        "a solve ms": 1e3 * min(found.seconds - found.assessment.seconds for found in solves),
        "the judgement ms": 1e3 * min(found.assessment.seconds for found in solves),
        "stating ms": stating,
        "building ms": build,
    }
    if name in ("qp", "newton"):  # which have a step of their own in a drag
        figures["a step ms"] = _step_ms(asked, name)
    return Row(case, method, figures)


def _step_ms(problem: wb.Problem, method: str) -> float:
    """Median time of a frame of a drag in a circle of 2 cm about where the tip starts."""
    scene = problem.scene
    center = scene.state(problem.start).frame(scene.frame_id(TIP)).translation.copy()
    drag, spent = Drag(problem, method), []
    for frame in range(13):
        angle = 0.2 * np.pi * frame
        place = center + 0.02 * np.array((0.0, np.sin(angle), 1.0 - np.cos(angle)))
        spent.append(measured_ms(partial(drag.to, place))[0])
    return float(np.median(spent[1:]))


def exponent(sizes: Sequence[float], spent: Sequence[float]) -> tuple[float, float]:
    """Exponent of time ~ size**e, fitted to the sizes from a tenth of the largest on, and where that range begins."""
    size, duration = np.asarray(sizes, dtype=float), np.asarray(spent, dtype=float)
    order = np.argsort(size)
    size, duration = size[order], duration[order]
    first = min(int(np.searchsorted(size, 0.0999 * size[-1])), max(0, len(size) - 3))
    if len(size) < 2:
        return float("nan"), float(size[0])
    return float(np.polyfit(np.log(size[first:]), np.log(duration[first:]), 1)[0]), float(size[first])


def _series(rows: Sequence[Row]) -> dict[tuple[str, str], list[tuple[int, Row]]]:
    """Sizes and rows by what grows and by the method."""
    found: dict[tuple[str, str], list[tuple[int, Row]]] = {}
    for row in rows:
        size, _, series = row.case.partition(" ")
        found.setdefault((series, row.tool), []).append((int(size), row))
    return found


TIMES = ("a solve ms", "a step ms", "the judgement ms", "stating ms", "building ms")


def exponents(rows: Sequence[Row]) -> list[Row]:
    """A row for what grows and each method: the sizes that were fitted, and the exponent of each time."""
    table = []
    for (series, method), mine in _series(rows).items():
        figures: dict[str, Figure] = {}
        for name in TIMES:
            if len(mine) > 1 and all(name in row.figures for _, row in mine):
                slope, first = exponent([size for size, _ in mine], [row[name] for _, row in mine])
                figures |= {"sizes fitted": f"{first:g} to {mine[-1][0]}", name.removesuffix(" ms"): slope}
        table.append(Row(series, method, figures))
    return table


def panels(rows: Sequence[Row]) -> list[Panel]:
    """A solve and a step against each size, by method."""
    drawn = []
    for name in TIMES[:2]:
        for series in dict.fromkeys(series for series, _ in _series(rows)):
            lines = {
                method: ([size for size, _ in known], [row[name] for _, row in known])
                for (grown, method), mine in _series(rows).items()
                if grown == series and (known := [each for each in mine if name in each[1].figures])
            }
            if lines:
                drawn.append(Panel(f"more {series}", series, name.replace(" ms", " [ms]"), lines, "xy", "."))
    return drawn

"""What moves frame by frame: goals of mixed weights, things put into a figure, sleepers; and things in each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.judging import Pairs, Verdict, apart, chosen, extent
from wholebody.bench.attack.scenes import Body, Thing, body, clear, shape, somewhere, xyzquat
from wholebody.bench.attack.solves import scene_of
from wholebody.bench.suite.problem_sets.things import Occupied, coal_distance
from wholebody.bench.suite.stability.bodies import planar_arm
from wholebody.dynamics.world import World, WorldFrame
from wholebody.tracking.loop import FrameLoop


def weights(rng: np.random.Generator, folder: Path) -> Verdict:
    """Follow goals of one frame with weights from 1 to 1e6: met in at most three times the frames of equal ones."""
    figure = body(rng, folder)
    frame = str(rng.choice(figure.frames))
    there = figure.figure.placement(figure.near(figure.standing, float(rng.choice([0.2, 0.5, 1.0])), rng), frame)
    there = pin.SE3(there.rotation.copy(), there.translation.copy())
    point, turn = (float(10.0 ** rng.uniform(0.0, 6.0)) for _ in range(2))
    most = 60
    equal = frames_until(figure, frame, there, (1.0, 1.0), most)
    if equal > most:
        return Verdict("right", f"goals of equal weights are not met in {most} frames; nothing is asked")
    found = frames_until(figure, frame, there, (point, turn), 3 * equal)
    words = f"weights {point:.3g} and {turn:.3g}"
    if found > 3 * equal:
        return Verdict("wrong", f"{words}: not met in {3 * equal} frames, with equal ones in {equal}")
    return Verdict("right", f"{words}: met in {found} frames, with equal ones in {equal}")


def frames_until(figure: Body, frame: str, there: pin.SE3, weighed: tuple[float, float], most: int) -> int:
    """Frames until a frame is where it should be, within 0.1 mm and mrad; `most` + 1 if it does not get there."""
    goals = [
        wb.Point(frame, there.translation, weight=weighed[0]),
        wb.Orientation(frame, there.rotation, weight=weighed[1]),
    ]
    problem = wb.Problem(wb.Scene(figure.figure), figure.standing, goals=goals)
    tracker, q = wb.QP().tracker(problem, 1.0 / 60.0), problem.start
    for number in range(1, most + 1):
        q = tracker.frame(q).q
        if apart(figure.figure.placement(q, frame), there) <= 1e-4:
            return number
    return most + 1


def put(rng: np.random.Generator, folder: Path) -> Verdict:
    """Show a figure where it is tracked, and put a thing somewhere into it now and then."""
    figure = body(rng, folder)
    start, thing = figure.standing, None
    while thing is None:
        thing = clear(rng, Occupied(figure.figure, [start]), figure.size, 1e-3 * figure.size, [0])
    places: list[tuple[float, ...] | None] = []
    for _ in range(int(rng.integers(3, 10))):
        place, at = thing.placement, figure.figure.placement(start, str(rng.choice(figure.frames)))
        place.translation = at.translation + 0.1 * figure.size * rng.normal(size=3)
        places += [xyzquat(place), *[None] * int(rng.integers(0, 6))]
    scene = scene_of(figure, [thing])
    return shown(scene, FrameLoop(scene, start, overlap=chosen(rng, ("qp", "ccd"))), places)


def shown(scene: wb.Scene, loop: FrameLoop, places: Sequence[tuple[float, ...] | None]) -> Verdict:
    """Judge whether every frame is free of overlap or tells it, while the scene's only thing is put into places."""
    start: Array = loop.shown
    (name,) = scene.objects
    told = 0
    for number, place in enumerate(places):
        if place is not None:
            scene.move(name, at=place)
        frame = loop.frame(start)
        deepest = -float(Pairs(scene).distances(frame.q).min(initial=0.0))
        if deepest > 1.2e-4 and not frame.note:
            return Verdict("wrong", f"frame {number}: {1e3 * deepest:.2f} mm of overlap, and no note")
        told += bool(frame.note)
    return Verdict("right", f"{len(places)} frames, {told} with notes")


def pairs(rng: np.random.Generator, folder: Path) -> Verdict:
    """Ask a scene which of its things overlap each other."""
    figure = body(rng, folder)
    placed = Occupied(figure.figure, [figure.standing])
    things: list[Thing] = []
    for _ in range(int(rng.integers(2, 9))):
        made, at = shape(rng, figure.size), somewhere(rng, placed, figure.size)
        if things and rng.random() < 0.6:  # near another one
            nearby = chosen(rng, things).placement.translation
            at.translation = nearby + rng.normal(size=3) * figure.size * float(rng.choice([0.0, 0.05, 0.2]))
        if np.abs(at.translation).max() < 99.0:
            things.append(Thing(made, xyzquat(at)))
    return overlapping(scene_of(figure, things), figure.standing)


def overlapping(scene: wb.Scene, q: Array) -> Verdict:
    """Judge what a scene says at a posture (nq,) of things that overlap, by coal on every two pieces of two things."""
    said = {frozenset((one.a, one.b)) for one in scene.penetration(q)} | {
        frozenset((scene.piece_owner[i], scene.piece_owner[j])) for i, j in scene.overlapping(q).pair.tolist()
    }
    count = 0
    for one, other in combinations(scene.objects, 2):
        shapes = [scene.objects[name].shape for name in (one, other)]
        if all(isinstance(made, wb.HalfSpace) for made in shapes):
            continue
        least = _distance(scene, one, other)
        count += least < 0.0
        told = frozenset((one, other)) in said
        # Pairs within this distance of contact may be told or not.
        slack = 2e-5 * max([1.0, *(extent(piece.geometry) for made in shapes for piece in made.pieces())])
        if least < -slack and not told:
            return Verdict("wrong", f"{one} and {other} overlap by {-least:.3g} m, and nothing tells it")
        if least > slack and told:
            return Verdict("wrong", f"{one} and {other} are {least:.3g} m apart, and are said to overlap")
    return Verdict("right", f"{count} pairs of {len(scene.objects)} things overlap")


def sleeper(rng: np.random.Generator, folder: Path) -> Verdict:
    """Let a body fall asleep on a thing, and move that thing."""
    edge = float(rng.uniform(0.05, 0.3))
    solid = chosen(rng, (wb.Box((edge, edge, edge)), wb.Box((edge, 2 * edge, edge)), wb.Cylinder(0.5 * edge, edge)))
    support = chosen(
        rng, (wb.Box((1.0, 1.0, 0.2)), wb.HalfSpace(offset=0.1), wb.Cylinder(0.5, 0.2), wb.Box((0.6, 2.0, 0.2)))
    )
    way = chosen(rng, ("slides", "turns", "jumps", "leaves"))
    direction = rng.normal(size=3) if rng.random() < 0.5 else np.array([0.0, 0.0, chosen(rng, (-1.0, 1.0))])
    direction /= np.linalg.norm(direction)
    step = chosen(rng, (1e-6, 5e-6, 2e-5, 7e-5, 3e-4))  # m or rad a frame
    far = 3.0 if way == "leaves" else chosen(rng, (5e-5, 2e-4, 1e-3))
    slow = way in ("slides", "turns")
    first, places = np.array([3.0, 0.0, -1.1]), []  # below the figure
    for frame in range(1, 61 if slow else 2):
        turn = pin.exp3(direction * step * frame) if way == "turns" else np.eye(3)
        shift = 0.0 if way == "turns" else step * frame if slow else far
        places.append(xyzquat(pin.SE3(turn, first + shift * direction)))
    scene = wb.Scene(planar_arm([0.5])).add(support, name="support", at=first)
    scene.add(solid, name="sleeper", at=(3.0, 0.0, -1.0 + 0.5 * edge + 5e-5), body=wb.Body(density=700.0))
    return slept(scene, places, over=bool(rng.random() < 0.5) and slow)


def slept(scene: wb.Scene, places: Sequence[tuple[float, ...]], *, over: bool) -> Verdict:
    """Judge whether a body floats or stays inside while its support moves, within frames if `over`, else between."""
    world, frames = World(scene), 90
    if not any(_sleeping(world.step()) for _ in range(frames)):
        return Verdict("gave up", f"the body does not sleep after {frames} frames")
    gets_out = 30  # frames that a body has to leave what moved into it
    for number in range(len(places) + gets_out):
        if number < len(places):
            scene.move("support", at=places[number], over=world.dt if over else None)
        frame = world.step()
        apart = _distance(scene, "support", "sleeper")
        if _sleeping(frame) and apart > 3e-4:
            return Verdict("wrong", f"frame {number}: the body sleeps {apart:.3g} m from what bore it")
        if apart < -2e-4 and number >= len(places) + gets_out - 1:
            return Verdict("wrong", f"frame {number}: the body is {-apart:.3g} m inside of what bears it")
        if apart < -1e-4 and abs(frame.deepest + apart) > 1e-5:
            return Verdict("wrong", f"frame {number}: the body is {-apart:.3g} m deep, {frame.deepest:.3g} m are told")
    return Verdict("right", f"{len(places)} places of the support")


def _sleeping(frame: WorldFrame) -> bool:
    return frame.engine is not None and frame.engine.sleeping == 1


def _distance(scene: wb.Scene, one: str, other: str) -> float:
    """Least distance of two things by coal, metres, negative where they overlap."""
    things = (scene.objects[name] for name in (one, other))
    parts = ([(part.geometry, thing.placement * part.placement) for part in thing.shape.pieces()] for thing in things)
    return min(coal_distance(*a, *b) for a, b in product(*parts))

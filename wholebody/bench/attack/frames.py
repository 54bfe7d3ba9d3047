"""What moves: sweeps, streams, goals of mixed weights, things put into a figure, sleepers; and things in each other.

Sweeps across thin things are judged by a fine subdivision, streams of moving goals step by step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.bench.attack.judging import Pairs, Verdict, apart, chosen, extent, judge
from wholebody.bench.attack.scenes import Body, Thing, body, clear, inside, shape, somewhere, xyzquat
from wholebody.bench.attack.solves import scene_of
from wholebody.bench.suite.problem_sets.things import Occupied, coal_distance
from wholebody.bench.suite.stability.bodies import planar_arm
from wholebody.dynamics.world import World, WorldFrame
from wholebody.geometry.continuous.sweep import TOLERANCE, FirstContact
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
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
    tracker, q = wb.methods.QP().tracker(problem, 1.0 / 60.0), problem.start
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
    noted = 0
    for number, place in enumerate(places):
        if place is not None:
            scene.move(name, at=place)
        frame = loop.frame(start)
        deepest = -float(Pairs(scene).distances(frame.q).min(initial=0.0))
        if deepest > 1.2e-4 and not frame.note:
            return Verdict("wrong", f"frame {number}: {1e3 * deepest:.2f} mm of overlap, and no note")
        noted += bool(frame.note)
    return Verdict("right", f"{len(places)} frames, {noted} with notes")


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
        reported = frozenset((one, other)) in said
        # Pairs within this distance of contact may be reported or not.
        slack = 2e-5 * max([1.0, *(extent(piece.geometry) for made in shapes for piece in made.pieces())])
        if least < -slack and not reported:
            return Verdict("wrong", f"{one} and {other} overlap by {-least:.3g} m, and nothing tells it")
        if least > slack and reported:
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
            return Verdict(
                "wrong", f"frame {number}: the body is {-apart:.3g} m deep, reported as {frame.deepest:.3g} m"
            )
    return Verdict("right", f"{len(places)} places of the support")


def _sleeping(frame: WorldFrame) -> bool:
    return frame.engine is not None and frame.engine.sleeping == 1


def _distance(scene: wb.Scene, one: str, other: str) -> float:
    """Least distance of two things by coal, metres, negative where they overlap."""
    things = (scene.objects[name] for name in (one, other))
    parts = ([(part.geometry, thing.placement * part.placement) for part in thing.shape.pieces()] for thing in things)
    return min(coal_distance(*a, *b) for a, b in product(*parts))


def sweep(rng: np.random.Generator, folder: Path) -> Verdict:
    """Sweep from a posture to another, and judge what was found by a fine subdivision."""
    figure = body(rng, folder)
    q = figure.figure.clamp(figure.figure.posture(chosen(rng, figure.figure.postures)))
    share = float(rng.choice([0.01, 0.1, 0.5, 1.0]))
    free = list(range(figure.figure.model.nv)) if rng.random() < 0.3 else None
    end = figure.near(q, share, rng, free)
    middle = np.asarray(pin.interpolate(figure.figure.model, q, end, float(rng.uniform(0.2, 0.8))))
    placed = Occupied(figure.figure, [middle, q])
    things = []
    for _ in range(int(rng.integers(0, 6))):
        if rng.random() < 0.5:
            thing = inside(rng, placed, figure.size, float(np.exp(rng.uniform(np.log(1e-5), np.log(0.1)))))
            if thing is not None and placed.distance(thing.shape, thing.placement, 1) < 0.0 and rng.random() < 0.8:
                thing = None
        else:
            thing = clear(rng, placed, figure.size, 0.0, [1])
        if thing is not None and np.abs(thing.at[:3]).max() < 99.0:
            things.append(thing)
    scene = scene_of(figure, things)
    began = process_time()
    found = scene.sweep(q, end)
    return swept(scene, q, end, found, process_time() - began)


def swept(scene: Scene, start: Array, end: Array, found: FirstContact | None, seconds: float) -> Verdict:
    """Judge what a sweep found between one posture (nq,) to another, and took in seconds of CPU time."""
    pairs, parts = Pairs(scene), 150
    rounding = 3e-6 * max(1.0, pairs.size)
    shares = np.linspace(0.0, 1.0, parts + 1)
    deeper = _deeper(pairs, scene, start, end, shares)
    top = int(np.argmax(deeper))
    near = np.linspace(shares[max(top - 1, 0)], shares[min(top + 1, parts)], 40)
    shares, deeper = np.append(shares, near), np.append(deeper, _deeper(pairs, scene, start, end, near))
    deepest = float(deeper.max(initial=0.0))
    words = f"the deepest in between is {deepest:.3g} m deeper than at the start"
    if found is None:
        if deepest > TOLERANCE + rounding:
            return Verdict("wrong", f"nothing was found; {words}", seconds)
        return Verdict("right", f"nothing was found; {words}", seconds)
    said = f"{'a contact' if found.certain else 'the end of the search'} at {found.fraction:.6f}"
    if not (0.0 <= found.fraction <= 1.0 and np.isfinite(found.q).all()):
        return Verdict("wrong", f"{said}: no place on the way", seconds)
    before = float(deeper[shares < found.fraction - 1e-9].max(initial=0.0))
    if before > TOLERANCE + rounding:
        return Verdict("wrong", f"{said}, and before it something is {before:.3g} m deeper", seconds)
    if not found.certain:
        return Verdict("gave up", f"{said}; {words}", seconds)
    at = float(_deeper(pairs, scene, start, end, np.array([found.fraction]))[0])
    if at < 0.5 * TOLERANCE - rounding:
        return Verdict("wrong", f"{said}, where nothing is more than {at:.3g} m deeper; {words}", seconds)
    return Verdict("right", f"{said}; {words}", seconds)


def _deeper(pairs: Pairs, scene: Scene, start: Array, end: Array, shares: Array) -> Array:
    """By how much some pair is deeper than at the start (k,), metres, at shares (k,) of the way."""
    began = np.minimum(pairs.distances(start), 0.0)
    if not len(began):
        return np.zeros(len(shares))
    postures = (np.asarray(pin.interpolate(scene.model, start, end, float(share))) for share in shares)
    return np.array([float((began - pairs.distances(q)).max()) for q in postures])


class Watch:
    """Looks at every step of a stream, and at the motion between two postures."""

    def __init__(self, problem: Problem, constraints: Sequence[Any], *, speed: float, dt: float) -> None:
        """Begin; joints may move at `speed` [rad/s or m/s], inf for any, and a step takes `dt` seconds."""
        self._problem, self._constraints, self._most = problem, constraints, speed * dt
        self._frame = 0
        self._wrongs: list[str] = []

    def step(self, before: Array, after: Array) -> None:
        """Look at a step from one posture (nq,) to the next."""
        number, self._frame = self._frame, self._frame + 1
        model = self._problem.scene.model
        if np.shape(after) != (model.nq,) or not np.isfinite(after).all():
            self._wrongs.append(f"frame {number}: the posture is not made of numbers")
            raise WholebodyError("; ".join(self._wrongs))
        here, there = (judge(self._problem, [], self._constraints, q) for q in (before, after))
        if there.limits > max(here.limits, 1e-9) + 1e-9:
            self._wrongs.append(f"frame {number}: a joint is {there.limits:.3g} out of its limits")
        way = pin.difference(model, before, after)
        # Rows are linear: a step may worsen constraints by the square of its length, and 5 mm or mrad.
        turned = (5e-3 + float(way @ way)) * max(1.0, Pairs(self._problem.scene).size)
        apart = here.least > -5e-4  # what is inside of something and held cannot have both
        if apart and there.constraints > max(here.constraints, turned):
            self._wrongs.append(f"frame {number}: constraints are violated by {there.constraints:.3g}")
        if np.abs(way).max(initial=0.0) > self._most * (1.0 + 1e-6) + 1e-9:
            self._wrongs.append(f"frame {number}: a joint moves {np.abs(way).max():.3g}, allowed are {self._most:.3g}")
        self._dip(number, before, after)

    def verdict(self) -> Verdict:
        """What came of the stream."""
        if self._wrongs:
            more = f" (and {len(self._wrongs) - 1} more)" if len(self._wrongs) > 1 else ""
            return Verdict("wrong", self._wrongs[0] + more)
        return Verdict("right", f"{self._frame} frames")

    def _dip(self, number: int, before: Array, after: Array) -> None:
        """Whether some pair gets deeper than it was before by 0.5 mm, of pieces of up to a metre."""
        pairs = Pairs(self._problem.scene)
        began = np.minimum(pairs.distances(before), 0.0)
        if not len(began):
            return
        model = self._problem.scene.model
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            found = pairs.distances(np.asarray(pin.interpolate(model, before, after, float(share))))
            worst = int(np.argmin(found - began))
            dip = float((began - found)[worst])
            if dip > 5e-4 * max(1.0, pairs.size):
                names = " and ".join(pairs.owners[worst])
                self._wrongs.append(f"frame {number}: {names} get {dip:.3g} m deeper at {share:.2f} of the way")
                return


def stream(rng: np.random.Generator, folder: Path) -> Verdict:
    """Follow goals by steps, or drag a frame by a method, while things move."""
    figure = body(rng, folder)
    start = figure.standing
    things = _things(figure, start, rng)
    dt = float(chosen(rng, (0.001, 1.0 / 60.0, 0.1, 1.0)))
    speed = float(rng.choice([np.inf, np.inf, 1.0, 10.0]))
    constraints: list[Any] = [wb.tasks.StepLimit(speed)] if np.isfinite(speed) else []
    if rng.random() < 0.3:
        constraints.append(wb.Hold(str(rng.choice(figure.frames))))
    if figure.figure.root == "free" and np.isfinite(speed):
        constraints.append(wb.tasks.StepLimit(speed, root_velocity=speed, root_turn=speed))
    clearance = float(rng.choice([0.0, 0.002, 0.005])) * min(1.0, figure.size)
    method = "step" if rng.random() < 0.7 else str(rng.choice(["qp", "qp", "newton", "ccd"]))
    frame = str(rng.choice(figure.frames))
    targets = _targets(figure, start, frame, int(rng.integers(10, 40)), rng)
    frames = []
    for target in targets:
        goals = [] if method != "step" else _goals(figure, frame, target, rng)
        frames.append((target, goals, _moved(things, figure.size, rng)))
    scene = scene_of(figure, things)
    problem = Problem(scene, start, goals=[wb.Point(frame, targets[0])], constraints=constraints, clearance=clearance)
    watch = Watch(problem, constraints, speed=speed, dt=dt)
    tracker = wb.methods.QP().tracker(problem, dt) if method == "step" else None
    drag = wb.tracking.Drag(problem, method=method, dt=dt) if tracker is None else None
    q = figure.figure.clamp(problem.start) if drag is None else drag.q
    for target, goals, moved in frames:
        for name, at in moved:
            scene.move(name, at=at)
        before = q
        if drag is not None:
            drag.to(target)
            q = drag.q
        elif tracker is not None:
            problem.retarget(goals)
            q = tracker.step(before).q
        watch.step(before, q)
    return watch.verdict()


def _things(figure: Body, start: Array, rng: np.random.Generator) -> list[Thing]:
    placed = Occupied(figure.figure, [start])
    count = int(rng.integers(0, 8))
    found = (clear(rng, placed, figure.size, 1e-3 * figure.size, [0]) for _ in range(count))
    return [thing for thing in found if thing is not None]


def _targets(figure: Body, start: Array, frame: str, count: int, rng: np.random.Generator) -> list[Array]:
    """Places (3,): along a line, or jumping between places that the figure can reach and places that it cannot."""
    postures = (start, figure.near(start, 1.0, rng), figure.near(start, 0.5, rng))
    places = [figure.figure.placement(q, frame).translation.copy() for q in postures]
    places[2] = places[2] + rng.normal(size=3) * figure.size * float(rng.choice([0.0, 0.3]))
    if rng.random() < 0.3:
        return [places[int(rng.integers(3))] for _ in range(count)]
    stations = np.linspace(0.0, 2.0, count)
    return [
        np.clip(places[int(s)] + (s - int(s)) * (places[min(int(s) + 1, 2)] - places[int(s)]), -99.0, 99.0)
        for s in stations
    ]


def _goals(figure: Body, frame: str, target: Array, rng: np.random.Generator) -> list[wb.Goal]:
    """The goal of a frame, now and then another one than before, or none."""
    if rng.random() < 0.85:
        return [wb.Point(frame, target)]
    joints = figure.figure.joints
    some = [str(name) for name in rng.permutation(joints)[: int(rng.integers(1, len(joints) + 1))]]
    other = str(rng.choice(figure.frames))
    options: list[list[wb.Goal]] = [
        [wb.CenterOfMass(target, axes="xy")],
        [wb.CenterOfMass(target)],
        [wb.Posture(figure.figure.postures[0], joints=some)],
        [wb.Point(other, target)],
        [wb.Frame(frame, target)],
        [],
    ]
    return options[int(rng.integers(len(options)))]


def _moved(things: list[Thing], size: float, rng: np.random.Generator) -> list[tuple[str, tuple[float, ...]]]:
    if not things or rng.random() < 0.9:
        return []
    number = int(rng.integers(len(things)))
    place = things[number].placement
    place.translation = np.clip(place.translation + rng.normal(size=3) * 0.1 * size, -99.0, 99.0)
    return [(f"thing {number}", xyzquat(place))]

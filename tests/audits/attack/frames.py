"""What moves: sweeps across thin things, judged by a fine subdivision, and streams of moving goals, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from tests.audits.attack.judging import Pairs, Verdict, chosen, judge
from tests.audits.attack.scenes import Body, Thing, body, clear, inside, xyzquat
from tests.audits.attack.solves import scene_of
from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.geometry.continuous.sweep import TOLERANCE, FirstContact
from wholebody.problem import Problem
from wholebody.scene.scene import Scene


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
    """Judge what a sweep found on the way from one posture (nq,) to another, and took in seconds of CPU time."""
    pairs, parts = Pairs(scene), 150
    rounding = 3e-6 * max(1.0, pairs.size)
    shares = np.linspace(0.0, 1.0, parts + 1)
    deeper = _deeper(pairs, scene, start, end, shares)
    top = int(np.argmax(deeper))
    near = np.linspace(shares[max(top - 1, 0)], shares[min(top + 1, parts)], 40)
    shares, deeper = np.append(shares, near), np.append(deeper, _deeper(pairs, scene, start, end, near))
    deepest = float(deeper.max(initial=0.0))
    words = f"the deepest on the way is {deepest:.3g} m deeper than at the start"
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
    """Looks at every step of a stream, and at the way between two postures."""

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

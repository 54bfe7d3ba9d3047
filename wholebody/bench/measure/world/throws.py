"""Things that fly at a person who stands, walks or is dragged: who is hit, and is it said?

With `swift` limits the person may move as fast as the thing comes, so a free posture is within reach in every frame:
going along with it is one. With `human` limits there may be none. Depths are found by fine subdivision in a scene of
their own.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.world.free_postures import free_posture
from wholebody.tracking.moving_goals import retarget

Path = Sequence[tuple[float, Array]]
"""Shares of a frame, and postures (nq,)."""

DT = 1.0 / 60.0
SHAPES = {
    "plate of 1 mm": wb.Box((0.001, 0.5, 0.5)),
    "board": wb.Box((0.02, 0.6, 0.4)),
    "ball": wb.Sphere(0.08),
    "rod": wb.Capsule(0.01, 0.9),
}
SPEEDS = (1.0, 2.5, 5.0, 10.0, 20.0)  # m/s
PERSONS = ("stands", "walks", "is dragged")
WALK, PULL = 1.3, 1.0  # m/s: of the one who walks, and of the fingertip that is dragged
HUMAN = (12.0, 4.0)  # rad/s of joints, m/s of the root
SPIN = 3.0  # rad/s
WAY = 0.7  # m: that a thing flies
DEEP = 1e-4  # m: an end that is deeper is none
NAMED = 1.2e-4  # m: what is deeper at an end has to be named
DIP = 4e-4  # m: what is deeper on every way has to be named
PARTS = 60  # of a way


@dataclass(frozen=True)
class ThrowRow:
    """All throws of one kind.

    Attributes:
        limits: "swift" or "human".
        person, thing: who is hit by what.
        speed: of the thing, m/s.
        frames: of all throws.
        deepest_mm: at the end of any frame.
        deep: frames that end deeper than 0.1 mm ...
        avoidable: ... of them those with a free posture within speeds, which a search of its own found.
        named: frames in which something is named that could not be avoided.
        silent: frames that end deeper, or in which something passes on every way, and nothing is named.
        median_ms: processor time of a frame.
    """

    limits: str
    person: str
    thing: str
    speed: float
    frames: int
    deepest_mm: float
    deep: int
    avoidable: int
    named: int
    silent: int
    median_ms: float


class Throw:
    """A thing that flies towards the body of a standing person with constant velocity, and turns.

    Attributes:
        scene: the person, the floor and the "thing".
        truth: the same scene once more, for judgements; `instants` moves its thing.
        at: where the thing is.
        frames: until it is past.
    """

    def __init__(self, rng: np.random.Generator, shape: wb.Shape, speed: float, turn: float = SPIN) -> None:
        """Begin half a metre before the body, from anywhere around; `speed` in m/s, `turn` in rad/s."""
        angle = rng.uniform(0.0, 2.0 * np.pi)
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        self.at = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), -0.5 * way + [0.0, 0.0, rng.uniform(0.7, 1.5)])
        self._way, self._turn = speed * DT * way, pin.exp3(turn * DT * rng.normal(size=3))
        self.scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
        self.scene.add(shape, name="thing", at=self.at)
        self.truth = copy.copy(self.scene)
        self.frames = int(WAY / (speed * DT)) + 1

    def next(self) -> tuple[pin.SE3, pin.SE3]:
        """Let it fly for a frame; where it was and is."""
        before = self.at
        self.at = pin.SE3(before.rotation @ self._turn, before.translation + self._way)
        self.scene.move("thing", at=self.at, over=DT)
        return before, self.at

    def instants(self, path: Path, way: tuple[pin.SE3, pin.SE3], parts: int) -> Iterator[Array]:
        """Postures (nq,) along a path of shares and postures, each with the thing of `truth` put where it is then."""
        turn = pin.log3(way[0].rotation.T @ way[1].rotation)
        for (s0, q0), (s1, q1) in pairwise(path):
            for share in np.linspace(0.0, 1.0, parts):
                s = s0 + share * (s1 - s0)
                centre = (1.0 - s) * way[0].translation + s * way[1].translation
                self.truth.move("thing", at=pin.SE3(way[0].rotation @ pin.exp3(s * turn), centre))
                yield pin.interpolate(self.truth.model, q0, q1, share)


def _deepest(throw: Throw, path: Path, way: tuple[pin.SE3, pin.SE3], parts: int) -> float:
    """Depth of the thing in the body along a path, metres."""
    worst, owner = 0.0, throw.truth.piece_owner
    for q in throw.instants(path, way, parts):
        near = throw.truth.contacts(q, 0.0)
        rows = [row for row, pair in enumerate(near.pair) if "thing" in {owner[k] for k in pair}]
        worst = max(worst, float(-near.distance[rows].min(initial=0.0)))
    return worst


def _avoidable(throw: Throw, q: Array, most: Array, rng: np.random.Generator) -> bool:
    """Whether a posture within displacements (nv,) of another (nq,) is free of the thing where it is now."""
    throw.truth.move("thing", at=throw.at)
    return free_posture(throw.truth, q, most, rng) is not None


def throws(thing: str, speed: float, person: str, swift: bool, count: int, seed: int = 0) -> ThrowRow:
    """Throw a thing at a person who is posed by "qp", several times."""
    rng = np.random.default_rng([seed, *map(ord, thing + person), int(10.0 * speed)])
    depths, times, named, silent, avoidable = [], [], 0, 0, 0
    for _ in range(count):
        throw = Throw(rng, SHAPES[thing], speed)
        turning, going = (max(HUMAN[0], 3.0 * speed), max(HUMAN[1], 1.6 * speed)) if swift else HUMAN
        start = throw.scene.figure.posture("standing")
        tip = throw.scene.state(start).frame(throw.scene.frame_id("right_index_tip")).translation.copy()
        goal = wb.Point("right_index_tip", tip)
        limits = wb.StepLimit(turning, root_velocity=going, root_turn=1.5 * going)
        problem = wb.Problem(throw.scene, start, goals=[goal], constraints=[limits], clearance=0.001)
        tracker, q = wb.QP().tracker(problem, DT), problem.start
        for frame in range(throw.frames):
            way = throw.next()
            if person == "walks":
                retarget(problem, 0, tip + (WALK * DT * (frame + 1), 0.0, 0.0))
            elif person == "is dragged":
                retarget(problem, 0, tip + PULL * DT * (frame + 1) * np.array([0.5, 0.5, 0.7]))
            began = time.process_time()
            step = tracker.step(q)
            times.append(time.process_time() - began)
            end = _deepest(throw, ((1.0, step.q), (1.0, step.q)), way, 1)
            depths.append(end)
            avoidable += end > DEEP and _avoidable(
                throw,
                q,
                np.repeat([going, 1.5 * going, turning], [3, 3, throw.scene.model.nv - 6]) * DT,
                np.random.default_rng(seed),
            )
            named += bool(step.collisions)
            began_in = _deepest(throw, ((0.0, q), (0.0, q)), way, 1)  # what was in before was named then
            if not step.collisions and began_in < NAMED:
                straight = ((0.0, q), (1.0, step.q))
                passed = end > NAMED or (
                    _deepest(throw, straight, way, PARTS) > DIP and _deepest(throw, step.path, way, 4) > DIP
                )
                silent += bool(passed)
            q = step.q
    return ThrowRow(
        "swift" if swift else "human", person, thing, speed, len(depths), 1e3 * max(depths),
        int((np.array(depths) > DEEP).sum()), avoidable, named, silent, 1e3 * float(np.median(times)),
    )  # fmt: skip


def all_throws(count: int, quick: bool = False) -> Iterator[ThrowRow]:
    """Throw everything at everybody with both limits, `count` times each; where quick, at one speed."""
    for swift in (True, False):
        for person in PERSONS:
            for thing in SHAPES:
                for speed in SPEEDS[2:3] if quick else SPEEDS:
                    yield throws(thing, speed, person, swift, count)

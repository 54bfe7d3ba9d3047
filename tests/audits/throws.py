"""Things that are thrown at a person: whether any passes through without a word.

With swift limits a person who stands, walks or is dragged may move as fast as a thing comes, so a free posture is
within reach in every frame. Depths are found by fine subdivision in a scene of their own.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.rows import Figure, Row, measured_ms
from wholebody.tracking.moving_goals import retarget

ABOUT = """\
Things fly at a person of 55 degrees of freedom who is posed by qp, 60 frames a second; with swift limits the person \
may move faster than the thing, so a free posture is within reach; human limits are 12 rad/s and 4 m/s. Depths are \
measured by coal at the end of every frame. Times are the processor's."""
"""What the report says above its table."""

Path = Sequence[tuple[float, Array]]  # shares of a frame, and postures (nq,)

DT = 1.0 / 60.0
SHAPES = {
    "plate of 1 mm": wb.Box((0.001, 0.5, 0.5)),
    "board": wb.Box((0.02, 0.6, 0.4)),
    "ball": wb.Sphere(0.08),
    "rod": wb.Capsule(0.01, 0.9),
}


class Throw:
    """A thing that flies and turns towards a person; `truth` is the scene for judgements, `at` tells where it is."""

    def __init__(self, rng: np.random.Generator, shape: wb.Shape, speed: float, turn: float = 3.0) -> None:
        """Begin half a metre before the body, from anywhere around; `speed` in m/s, `turn` in rad/s."""
        angle = rng.uniform(0.0, 2.0 * np.pi)
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        self.at = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), -0.5 * way + [0.0, 0.0, rng.uniform(0.7, 1.5)])
        self._way, self._turn = speed * DT * way, pin.exp3(turn * DT * rng.normal(size=3))
        self.scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
        self.scene.add(shape, name="thing", at=self.at)
        self.truth = copy.copy(self.scene)
        self.frames = int(0.7 / (speed * DT)) + 1

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


def throws(thing: str, speed: float, person: str, swift: bool, count: int) -> Row:
    """Throw a thing at a person who is posed by "qp", several times."""
    # Deep: overlap over 0.1 mm at an end. Silent: 0.12 mm at an end or 0.4 mm on every way without a report.
    rng = np.random.default_rng([0, *map(ord, thing + person), int(10.0 * speed)])
    depths, spent, named, silent = [], [], 0, 0
    for _ in range(count):
        throw = Throw(rng, SHAPES[thing], speed)
        turning, going = (max(12.0, 3.0 * speed), max(4.0, 1.6 * speed)) if swift else (12.0, 4.0)  # rad/s, m/s
        start = throw.scene.figure.posture("standing")
        tip = throw.scene.state(start).frame(throw.scene.frame_id("right_index_tip")).translation.copy()
        goal = wb.Point("right_index_tip", tip)
        limits = wb.tasks.StepLimit(turning, root_velocity=going, root_turn=1.5 * going)
        problem = wb.Problem(throw.scene, start, goals=[goal], constraints=[limits], clearance=0.001)
        tracker, q = wb.methods.QP().tracker(problem, DT), problem.start
        for frame in range(throw.frames):
            way = throw.next()
            if person == "walks":
                retarget(problem, 0, tip + (1.3 * DT * (frame + 1), 0.0, 0.0))
            elif person == "is dragged":
                retarget(problem, 0, tip + DT * (frame + 1) * np.array([0.5, 0.5, 0.7]))
            worked, _, step = measured_ms(partial(tracker.step, q))
            spent.append(worked)
            depths.append(_deepest(throw, ((1.0, step.q), (1.0, step.q)), way, 1))
            named += bool(step.collisions)
            silent += not step.collisions and _unnamed(throw, q, step, way, depths[-1])
            q = step.q
    figures: dict[str, Figure] = {
        "limits": "swift" if swift else "human",
        "m/s": speed,
        "frames": len(depths),
        "deepest mm": 1e3 * max(depths),
        "deep": int((np.array(depths) > 1e-4).sum()),
        "named": named,
        "silent": silent,
        "CPU median ms": float(np.median(spent)),
    }
    return Row(thing, f"who {person}", figures)


def _unnamed(throw: Throw, q: Array, step: Any, way: tuple[pin.SE3, pin.SE3], end: float) -> bool:
    """Whether a step that names nothing ends too deep, or goes through the thing on every way."""
    if _deepest(throw, ((0.0, q), (0.0, q)), way, 1) >= 1.2e-4:  # what was in before was named then
        return False
    straight = ((0.0, q), (1.0, step.q))
    paths = ((straight, 60), (step.path, 4))
    return end > 1.2e-4 or all(_deepest(throw, path, way, parts) > 4e-4 for path, parts in paths)


def all_throws(count: int, quick: bool = False) -> Iterator[Row]:
    """Throw everything at everybody with both limits, `count` times each; where quick, at one speed."""
    for swift in (True, False):
        for person in ("stands", "walks", "is dragged"):
            for thing in SHAPES:
                for speed in (5.0,) if quick else (1.0, 2.5, 5.0, 10.0, 20.0):
                    yield throws(thing, speed, person, swift, count)


def throw_summary(rows: Sequence[Row]) -> list[Row]:
    """A row for each limit and speed, over all things and persons: counts, the deepest end, the largest median time."""
    found = []
    for limits, speed in dict.fromkeys((row["limits"], row["m/s"]) for row in rows):
        mine = [row for row in rows if (row["limits"], row["m/s"]) == (limits, speed)]
        figures: dict[str, Figure] = {"frames": sum(row["frames"] for row in mine)}
        figures["deepest mm"] = max(row["deepest mm"] for row in mine)
        figures |= {name: sum(row[name] for row in mine) for name in ("deep", "named", "silent")}
        figures["CPU median ms, most"] = max(row["CPU median ms"] for row in mine)
        found.append(Row(f"{limits} limits", f"{speed:g} m/s", figures))
    return found

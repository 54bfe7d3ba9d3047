"""Hard cases by name, from `cases.toml`: the problem, why it is hard, and which answers are acceptable."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import known
from wholebody.base.files import packaged_toml
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.bodies import human_arm, planar_arm, sliding_tool, spatial_arm, star
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box, Shape, Sphere
from wholebody.methods.solve import as_method
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Goal, Hold, Orientation, Point, StepLimit
from wholebody.tracking.drag import Drag

Kind = Literal["solved", "honest", "refusal", "wrong"]

FRAME = 1.0 / 60.0  # s: a frame of a screen


@dataclass(frozen=True)
class Posed:
    """A problem to solve once, with the most iterations (None: the method's own)."""

    problem: Problem
    iterations: int | None = None


@dataclass(frozen=True)
class Frame:
    """One frame of a stream: where the goal is now (3,), and things that are elsewhere from now on."""

    target: tuple[float, float, float]
    moved: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stream:
    """A first goal, a `Point`, to follow by `wb.tracking.Drag`, no joint faster than `speed` [rad/s]."""

    problem: Problem
    frames: tuple[Frame, ...]
    dt: float = FRAME
    speed: float = np.inf


@dataclass(frozen=True)
class Nonsense:
    """Inputs that no method can make sense of, in words: each has to be refused."""

    attempts: Mapping[str, Callable[[Adapter], object]]


Question = Posed | Stream | Nonsense


@dataclass(frozen=True)
class HardCase:
    """One hard case: why it is hard, and which answers are acceptable.

    `question` makes the problem, a new one at each call: what a method does to it does not reach the judge. `expected`:
    the best verdict that there can be; `also`: others that are acceptable. `best`: goal error of the best possible
    answer [m, rad], None where only the best answer of all is known; an honest best effort may miss it by `near`. An
    answer counts as solved to `tolerance`; `can_hold`: whether all constraints can hold together.
    """

    name: str
    group: str
    title: str
    why: str
    acceptable: str
    question: Callable[[], Question]
    expected: Kind = "solved"
    also: tuple[Kind, ...] = ()
    best: float | None = 0.0
    near: float = 1e-3
    tolerance: float = 1e-4
    can_hold: bool = True

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Whether an answer is acceptable whose goal error is above that of the best known one by `miss` [m, rad]."""
        return kind in self.also or (kind == self.expected and (kind != "honest" or miss <= self.near))


@dataclass(frozen=True)
class Answer:
    """What a method did with one case.

    `postures` (k, nq): one, or one a frame, or none; `left` (k,): what it says is left to the goal; `failure`: an
    exception that is no WholebodyError, or how the process ended; `taken`: nonsense that it took without a word;
    `seconds` by the clock.
    """

    postures: Array
    status: str = ""
    left: tuple[float, ...] = ()
    refusal: str = ""
    failure: str = ""
    taken: tuple[str, ...] = ()
    seconds: float = 0.0
    message: str = ""


NOTHING = np.zeros((0, 0))


def quick() -> tuple[str, ...]:
    """Names of a few cases of every kind, for a short run."""
    return tuple(name for name, given in _data().items() if given.get("quick"))


def names() -> tuple[str, ...]:
    """Names of all cases."""
    return tuple(_data())


def cases(chosen: Iterable[str] | None = None) -> tuple[HardCase, ...]:
    """The cases of these names, all of them where None; UnknownNameError where there is no such case."""
    listed = _data()
    wanted = listed if chosen is None else [known(name, listed, "case") for name in chosen]
    return tuple(_case(name, given) for name, given in listed.items() if name in wanted)


def _data() -> dict[str, Any]:
    return packaged_toml(Path(__file__).with_name("cases.toml"))


def _case(name: str, given: Mapping[str, Any]) -> HardCase:
    others = {key: value for key, value in given.items() if key not in ("quick", "ask", "best", "also")}
    best = given.get("best", 0.0)
    question = partial(asked, given["ask"]) if "ask" in given else not_numbers
    best = None if best == "open" else best
    return HardCase(name=name, question=question, best=best, also=tuple(given.get("also", ())), **others)


def asked(ask: Mapping[str, Any]) -> Question:
    """The question that a table of `cases.toml` states; see the head of that file."""
    scene, start = Scene(_figure(ask)), ask["start"]
    q = scene.figure.posture(start) if isinstance(start, str) else np.array(start, dtype=float)
    for name, thing in ask.get("things", {}).items():
        scene.add(_shape(thing), name=name, at=_placement(thing))
    goals = [goal for given in ask["goals"] for goal in _goals(scene, q, given)]
    constraints: list[Any] = [_hold(scene, q, given) for given in ask.get("holds", ())]
    speed = ask.get("speed", inf)
    constraints += [StepLimit(speed)] if np.isfinite(speed) else []
    problem = Problem(scene, q, goals=goals, constraints=constraints)
    if "legs" not in ask:
        return Posed(problem, ask.get("iterations"))
    frames = tuple(frame for leg in ask["legs"] for frame in _frames(problem, leg))
    return Stream(problem, frames, ask.get("dt", FRAME), speed)


def _figure(ask: Mapping[str, Any]) -> Figure:
    kind = ask.get("figure", "planar arm")
    if kind == "planar arm":
        given = {name: ask[name] for name in ("limits", "base") if name in ask}
        return planar_arm(ask.get("lengths", (0.5, 0.4, 0.3)), ask.get("radius", 0.03), **given)
    if kind == "sliding tool":
        return sliding_tool(*((_shape(piece), _placement(piece)) for piece in ask["pieces"]))
    made: dict[str, Callable[[], Figure]] = {
        "spatial arm": spatial_arm,
        "star": star,
        "human arm": human_arm,
        "human arm without clavicle": partial(human_arm, clavicle=False),
    }
    return made[kind]()


def _shape(given: Mapping[str, Any]) -> Shape:
    return Sphere(given["sphere"]) if "sphere" in given else Box(tuple(given["box"]))


def _placement(given: Mapping[str, Any]) -> pin.SE3:
    """At a place, turned about axes of the world one after the other, the last one first."""
    turned = np.eye(3)
    for axis, angle in given.get("turned", ()):
        turned = turned @ pin.utils.rotate(axis, angle)
    return pin.SE3(turned, np.array(given.get("at", (0.0, 0.0, 0.0)), dtype=float))


def _goals(scene: Scene, start: Array, given: Mapping[str, Any]) -> list[Goal]:
    """Of one frame or several alike: a place, or where the frame, or another one, is in a posture."""
    frames, more = given.get("frames", ["tip"]), {name: given[name] for name in ("offset", "weight") if name in given}
    found: list[Goal] = []
    for frame in frames:
        there = _frame(scene, np.array(given["where"]) if "where" in given else start, given.get("of", frame))
        if "turned" in given:
            turned = pin.Quaternion(there.rotation @ _placement(given).rotation)
            found.append(Orientation(frame, turned.coeffs().copy()))
        else:
            place = np.array(given["at"]) if "at" in given else there.translation + given.get("plus", (0.0, 0.0, 0.0))
            found.append(Point(frame, place, **more))
    return found


def _hold(scene: Scene, start: Array, given: Mapping[str, Any]) -> Hold:
    if "plus" not in given:
        return Hold(given["frame"])
    return Hold(given["frame"], _frame(scene, start, given["frame"]).translation + given["plus"], orientation=False)


def _frame(scene: Scene, q: Array, name: str) -> pin.SE3:
    placed: pin.SE3 = scene.state(q).frame(scene.figure.frame_id(name))
    return placed.copy()


def _frames(problem: Problem, leg: Mapping[str, Any]) -> list[Frame]:
    """A leg of a stream: the goal rests, moves along a line or jumps; or a thing moves, and the goal rests."""
    first = problem.goals[0]
    assert isinstance(first, Point)
    rests = tuple(leg["at"]) if "at" in leg else tuple(first.resolved_target.tolist())
    count = leg["count"]
    if "to" not in leg:
        places = [tuple(place) for place in leg.get("between", [rests])]
        return [Frame(places[k % len(places)]) for k in range(count)]
    begin, end, steps = np.array(leg["from"]), np.array(leg["to"]), leg.get("steps", count)
    way = [begin + (end - begin) * k / steps for k in range(leg.get("first", 0), leg.get("first", 0) + count)]
    line = [(float(x), float(y), float(z)) for x, y, z in way]
    if "thing" in leg:
        return [Frame(rests, {leg["thing"]: place}) for place in line]
    return [Frame(place) for place in line]


def not_numbers() -> Nonsense:
    """A start, a goal, a goal in the middle of a drag, a thing's place, and the method's own tolerance."""

    def reach(start: float = 0.5, goal: float = 0.5, box: float = 0.0) -> Problem:
        scene = Scene(planar_arm((0.5, 0.4, 0.3))).add(Box((0.1, 0.1, 0.1)), name="box", at=(0.9, 0.0, -0.8))
        problem = Problem(scene, np.array([-0.6, 0.8, start]), goals=[Point("tip", (0.7, 0.0, goal))])
        if box != 0.0:
            scene.move("box", at=(0.9, box, -0.8))
        return problem

    def solve(adapter: Adapter, **changed: float) -> object:
        return adapter.make(1e-5, None).solve(reach(**changed))

    def step_from_nowhere(adapter: Adapter) -> object:
        return as_method(adapter.make(1e-5, None)).tracker(reach(), FRAME).step(np.array([-0.6, nan, 0.5]))

    return Nonsense(
        {
            "NaN in the start": partial(solve, start=nan),
            "NaN in a goal": partial(solve, goal=nan),
            "infinity in a goal": partial(solve, goal=inf),
            "NaN in a thing's place": partial(solve, box=nan),
            "NaN in a drag": lambda adapter: Drag(reach(), adapter.make(1e-5, None)).to((nan, 0.0, 0.5)),
            "NaN in where a drag is": step_from_nowhere,
            "NaN as tolerance": lambda adapter: adapter.make(nan, None).solve(reach()),
        }
    )

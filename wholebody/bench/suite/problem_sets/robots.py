"""Robots, their tools to places among things: arms of random and known lengths, robots as they come, two figures.

Robots as they come are six arms and six humanoids of public descriptions. These are not a part of this package: the
environment variable `WHOLEBODY_ROBOTS` names the folder of the wheel example-robot-data, or one that holds it.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE, ROOM, alone, fitted, floor_scene, is_free, until_found
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things
from wholebody.bench.tables import render
from wholebody.figures.self_pairs import random_postures

of_arm = numbers("robot_arm")


def arms(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The kinds of arm in turn; a place and an orientation in every other round, only a place in the others."""
    figure, start = arm(of_arm.kinds[number % len(of_arm.kinds)], rng)
    return _among_random(figure, start, rng, number // len(of_arm.kinds) % 2 == 1)


def _among_random(figure: wb.Figure, start: Array, rng: np.random.Generator, turned: bool) -> tuple[wb.Problem, Array]:
    """A place of the tool in a random posture, among eight things that are clear of it and of the start (nq,)."""
    model = figure.model

    def sampled() -> Array | None:
        q: Array = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        return q if is_free(alone(figure), q) else None

    witness = until_found(sampled)
    scene = floor_scene(figure)
    add_things(scene, of_arm.things, Occupied(figure, (start, witness)), ROOM, rng, of_arm.space_m)
    return _asked(scene, start, witness, "tool", turned), witness


def _asked(scene: wb.Scene, start: Array, witness: Array, tip: str, turned: bool) -> wb.Problem:
    """A tip where a witness (nq,) has it, turned as there or as it comes."""
    place = scene.figure.placement(witness, tip)
    goal = wb.Frame(tip, place) if turned else wb.Point(tip, place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE)


of_known = numbers("arms_among_things")


def among(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The arms in turn, then what they reach into; in every other round after all with an orientation."""
    figure, start = known_arm(of_known.arms[number % len(of_known.arms)])
    kind, turned = of_known.kinds[number // len(of_known.arms) % len(of_known.kinds)], False
    turned = number // (len(of_known.arms) * len(of_known.kinds)) % 2 == 1
    if kind == "clutter":
        return _among_random(figure, start, rng, turned)
    return into(kind, number, rng, turned)


def into(kind: str, number: int, rng: np.random.Generator, turned: bool = False) -> tuple[wb.Problem, Array]:
    """The arms in turn, into furniture of a kind of `sets.toml`."""
    figure, start = known_arm(of_known.arms[number % len(of_known.arms)])
    reach, dofs, model = _reach(figure), np.arange(figure.model.nv), figure.model

    def attempt() -> tuple[wb.Scene, Array] | None:
        scene, place = _furnished(figure, kind, reach, rng)
        goal = wb.Point("tool", place).resolve(alone(figure), start)
        found = fitted(figure, rng.uniform(model.lowerPositionLimit, model.upperPositionLimit), [goal], dofs)
        free = found is not None and is_free(scene, found) and is_free(scene, start)
        return (scene, found) if free and found is not None else None

    scene, witness = until_found(attempt)
    return _asked(scene, start, witness, "tool", turned), witness


def free(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The arms in turn, from a random posture to where the tool is in another, with nothing around."""
    scene = _nothing_around(of_known.arms[number % len(of_known.arms)])
    model = scene.model
    lower, upper = np.maximum(model.lowerPositionLimit, -np.pi), np.minimum(model.upperPositionLimit, np.pi)

    def sampled() -> Array | None:
        q: Array = rng.uniform(lower, upper)
        return q if is_free(scene, q) else None

    start, witness = until_found(sampled), until_found(sampled)
    return _asked(scene, start, witness, "tool", True), witness


@lru_cache(maxsize=8)
def _nothing_around(name: str) -> wb.Scene:
    return wb.Scene(known_arm(name)[0])


@lru_cache(maxsize=8)
def known_arm(name: str) -> tuple[wb.Figure, Array]:
    """One of the arms of `sets.toml`, and the posture (nq,) that it begins in."""
    given = getattr(of_known, name)
    axes = [Axis(axis, tuple(at), low, high, ready) for axis, at, (low, high), ready in given.axes]
    return _built(name, axes, tuple(given.tool), of_known.radii_m)


@lru_cache(maxsize=8)
def _reach(figure: wb.Figure) -> float:
    """How far a tool gets from the first joint in one of 200 random postures [m]."""
    base, rng = figure.model.jointPlacements[1].translation, np.random.default_rng(0)
    limits = figure.model.lowerPositionLimit, figure.model.upperPositionLimit
    places = [figure.placement(rng.uniform(*limits), "tool").translation for _ in range(200)]
    return float(np.linalg.norm(np.array(places) - base, axis=1).max())


def _furnished(figure: wb.Figure, kind: str, reach: float, rng: np.random.Generator) -> tuple[wb.Scene, Array]:
    """Furniture around an arm, and a place (3,) to reach in, over or under it."""
    given = getattr(of_known, kind)
    scene, turn = floor_scene(figure), pin.utils.rotate("z", float(rng.uniform(-of_known.turn_rad, of_known.turn_rad)))
    at = pin.SE3(turn, turn @ (reach * rng.uniform(*given.at)))
    for number, (size, middle) in enumerate(given.boards):
        x, y, z = (reach * length for length in size)
        place = at * pin.SE3(np.eye(3), reach * np.array(middle))
        scene.add(wb.Box((x, y, z)), name=f"{kind} {number}", at=place)
    where = given.places[int(rng.integers(len(given.places)))]
    return scene, at.act(reach * rng.uniform(*where))


class Axis(NamedTuple):
    """A joint: its axis, where it is on the link before it [m], its limits and how it stands when work begins [rad]."""

    axis: str
    at: tuple[float, ...]
    low: float
    high: float
    ready: float


def arm(kind: str, rng: np.random.Generator) -> tuple[wb.Figure, Array]:
    """An arm ("seven axes", "industrial" or "parallel") with links of random lengths, and its ready posture (nq,)."""
    lengths = [round(float(length), 3) for length in rng.uniform(*of_arm.lengths_m)]
    lower, upper, fore, hand = lengths
    beside = round(float(rng.uniform(*of_arm.beside_m)), 3) if kind == "industrial" else 0.0
    known = {"lower": lower, "upper": upper, "fore": fore, "hand": hand, "beside": beside}

    def place(words: list[Any]) -> tuple[float, ...]:
        """Metres, from numbers and sums of a length and a number."""
        return tuple(_length(word, known) for word in words)

    made = getattr(of_arm, kind.replace(" ", "_"))
    axes = [Axis(axis, place(at), -limit, limit, ready) for axis, at, limit, ready in made.axes]
    return _built(kind.replace(" ", "_"), axes, place(made.tool), of_arm.radii_m)


def _built(name: str, axes: list[Axis], tool: tuple[float, ...], radii: list[float]) -> tuple[wb.Figure, Array]:
    """The figure of some axes and a tool at the end, and its ready posture (nq,)."""
    with Scratch() as folder:
        path = folder / f"{name}.urdf"
        path.write_text(_urdf(name, axes, tool, radii), encoding="utf-8")
        figure = wb.load(path)
    ready = {f"axis{number}": axis.ready for number, axis in enumerate(axes, start=1)}
    return figure, figure.with_joints(figure.neutral, ready)


def _length(word: str | float, known: dict[str, float]) -> float:
    """Metres: a number, or a length by its name, less a number where one follows."""
    if not isinstance(word, str):
        return word
    name, _, less = word.partition(" - ")
    return known[name] - float(less) if less else known[name]


def _urdf(name: str, axes: list[Axis], tool: tuple[float, ...], ends_m: list[float]) -> str:
    """The file: every link is a cylinder from its joint to the next one."""
    ends = [axis.at for axis in axes] + [tool]
    radii = np.linspace(ends_m[0], ends_m[-1], len(ends))
    links = [_link(f"link{number}", end, float(radii[number])) for number, end in enumerate(ends)]
    joints = [
        {"name": f"axis{number}", "kind": "revolute", "at": _numbers(axis.at), "axis": axis.axis,
         "limit": f'lower="{axis.low}" upper="{axis.high}" effort="100" velocity="3"'}
        for number, axis in enumerate(axes, start=1)
    ] + [{"name": "grip", "kind": "fixed", "at": _numbers(tool)}]  # fmt: skip
    links.append({"name": "tool"})
    for joint, parent, child in zip(joints, links, links[1:], strict=False):
        joint |= {"parent": parent["name"], "child": child["name"]}
    return render("robot.urdf", name=name, links=links, joints=joints)


def _link(name: str, end: tuple[float, ...], radius: float) -> dict[str, str]:
    way = np.array(end)
    length = float(np.linalg.norm(way))
    mass = 20.0 * length + 0.5
    link = {"name": name, "middle": _numbers(tuple(0.5 * way)), "mass": f"{mass:.3f}"}
    link["spin"] = f"{0.1 * mass * length**2 + 1e-3:.5f}"
    if length < of_arm.short_m:
        return link | {"shape": f'<sphere radius="{radius:.4f}"/>'}
    turn = (0.0, float(np.arccos(way[2] / length)), float(np.arctan2(way[1], way[0])))
    return link | {"rpy": _numbers(turn), "shape": f'<cylinder radius="{radius:.4f}" length="{length:.4f}"/>'}


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.6f}" for value in values)


of_robots = numbers("robots")


def folder() -> Path:
    """Where the descriptions are; InputError where the variable names no folder with them."""
    named = os.environ.get("WHOLEBODY_ROBOTS", "")
    folders: list[Path] = [Path(named), *Path(named).glob("**/example-robot-data/robots")] if named else []
    for found in folders:
        if (found / of_robots.files[0]).is_file():
            return found
    raise InputError(
        "the set robots needs public descriptions: unpack the wheel example-robot-data, and let WHOLEBODY_ROBOTS name "
        f"its folder (it is {named!r})"
    )


@lru_cache(maxsize=2)
def robot(name: str) -> wb.Figure:
    """A robot with its root where it stands, by its path in the folder."""
    return wb.load(folder() / name)


def described(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The robots in turn; a place and an orientation in every other round, only a place in the others."""
    figure = robot(of_robots.files[number % len(of_robots.files)])
    start = figure.neutral
    chains = [chain for chain in figure.chains.values() if len(chain.joints) >= of_robots.fewest_joints]
    tip = chains[int(rng.integers(len(chains)))].tip
    alone = wb.Problem(wb.Scene(figure), start, goals=[wb.Point(tip, (0.0, 0.0, 0.0))], clearance=CLEARANCE)

    def sampled() -> Array | None:
        other = random_postures(figure.model, 1, int(rng.integers(1 << 31)))[0]
        for share in of_robots.shares:
            q: Array = figure.clamp(np.asarray(pin.interpolate(figure.model, start, other, share)))
            if wb.assess(alone, q).holds(1e-9):  # some pairs of a robot are always nearer than the clearance
                return q
        return None

    witness = until_found(sampled)
    scene = wb.Scene(figure)
    _surround(scene, (start, witness), of_robots, rng)
    return _asked(scene, start, witness, tip, number // len(of_robots.files) % 2 == 1), witness


def _surround(scene: wb.Scene, postures: tuple[Array, Array], given: Any, rng: np.random.Generator) -> None:
    """Put things around a figure in some postures, as many and as far as `sets.toml` says."""
    taken = Occupied(scene.figure, postures)
    space = taken.centres.min(axis=0) - given.around_m, taken.centres.max(axis=0) + given.around_m
    add_things(scene, given.things, taken, ROOM, rng, (space[0].tolist(), space[1].tolist()))


of_pairs = numbers("two_figures")


class One(NamedTuple):
    """One of the two: alone, how it begins (nq,), the frame it reaches with, and the joints that a witness moves."""

    figure: wb.Figure
    start: Array
    tip: str
    joints: tuple[str, ...]


@lru_cache(maxsize=8)
def one(name: str) -> One:
    """A figure by what it is: the sex of a person, or an arm of `sets.toml`."""
    if name in ("female", "male"):
        person = wb.load("human", sex=name)
        return One(person, person.posture("standing"), "right_palm", person.groups["upper_body"])
    figure, ready = known_arm(name)
    return One(figure, ready, "tool", figure.joints)


def two_figures(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The kinds in turn; in every other round the second tip is turned as the witness has it."""
    kind = of_pairs.kinds[number % len(of_pairs.kinds)]
    pair = {"one": one(str(rng.choice(kind.one))), "other": one(str(rng.choice(kind.other)))}

    def attempt() -> tuple[wb.Scene, Array, Array] | None:
        turn = pin.utils.rotate("z", float(np.pi + rng.uniform(-of_pairs.turn_rad, of_pairs.turn_rad)))
        at = {"one": pin.SE3.Identity(), "other": pin.SE3(turn, rng.uniform(*kind.at_m))}
        scene = wb.Scene({name: (each.figure, at[name]) for name, each in pair.items()})
        scene.add(wb.HalfSpace(), name="floor")
        figure = scene.figure
        start = figure.neutral
        for name, each in pair.items():
            if not each.figure.roots:
                figure.part(name, start)[:] = each.start
        for _ in range(of_pairs.tries if is_free(scene, start) else 0):
            witness = _moved(figure, start, pair, rng)
            ends = [figure.placement(witness, f"{name}/{each.tip}").translation for name, each in pair.items()]
            if np.linalg.norm(ends[1] - ends[0]) < of_pairs.apart_m and is_free(scene, witness):
                return scene, start, witness
        return None

    scene, start, witness = until_found(attempt)
    _surround(scene, (start, witness), of_pairs, rng)
    first, second = (f"{name}/{each.tip}" for name, each in pair.items())
    relation = scene.figure.placement(witness, first).actInv(scene.figure.placement(witness, second))
    turned = number // len(of_pairs.kinds) % 2 == 1
    goals = [bodies.point(scene.figure, witness, first), wb.Relative(second, first, relation, orientation=turned)]
    return bodies.standing_problem(scene, start, goals), witness


def _moved(figure: wb.Figure, start: Array, pair: dict[str, One], rng: np.random.Generator) -> Array:
    """The start (nq,) with the joints of both at random within their limits."""
    q = np.array(start)
    names = [f"{name}/{joint}" for name, each in pair.items() for joint in each.joints]
    places = np.array([figure.model.joints[figure.joint_id(name)].idx_q for name in names])
    q[places] = rng.uniform(figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places])
    return q

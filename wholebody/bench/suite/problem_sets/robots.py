"""Robots, their tools to places among things: arms with links of random lengths, and robots as they come.

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
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE, ROOM, alone, floor_scene, is_free, until_found
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things
from wholebody.figures.self_pairs import random_postures

of_arm = numbers("robot_arm")


def arms(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The kinds of arm in turn; a place and an orientation in every other round, only a place in the others."""
    figure, ready = arm(of_arm.kinds[number % len(of_arm.kinds)], rng)
    model, start = figure.model, figure.with_joints(figure.neutral, ready)

    def sampled() -> Array | None:
        q: Array = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        return q if is_free(alone(figure), q) else None

    witness = until_found(sampled)
    scene = floor_scene(figure)
    add_things(scene, of_arm.things, Occupied(figure, (start, witness)), ROOM, rng, of_arm.space_m)
    place = figure.placement(witness, "tool")
    turned = number // len(of_arm.kinds) % 2 == 1
    goal = wb.Frame("tool", place) if turned else wb.Point("tool", place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE), witness


class Axis(NamedTuple):
    """A joint: its axis, where it is on the link before it [m], its limits and how it stands when work begins [rad]."""

    axis: str
    at: tuple[float, float, float]
    limit: float
    ready: float


def arm(kind: str, rng: np.random.Generator) -> tuple[wb.Figure, dict[str, float]]:
    """Return an arm with links of random lengths, and the joint values it is ready with, elbow bent, the tool in front.

    `kind`: "seven axes": a shoulder, an elbow and a wrist that turn as a person's do; "industrial": six axes, the elbow
    beside the shoulder's plane, the last three crossing; "parallel": six axes, three of them parallel, no three of the
    last crossing.
    """
    lengths = [round(float(length), 3) for length in rng.uniform(*of_arm.lengths_m)]
    lower, upper, fore, hand = lengths
    beside = round(float(rng.uniform(*of_arm.beside_m)), 3) if kind == "industrial" else 0.0
    known = {"lower": lower, "upper": upper, "fore": fore, "hand": hand, "beside": beside}

    def place(words: list[Any]) -> tuple[float, float, float]:
        """Metres, from numbers and sums of a length and a number."""
        x, y, z = (_length(word, known) for word in words)
        return x, y, z

    made = getattr(of_arm, kind.replace(" ", "_"))
    axes = [Axis(axis, place(at), limit, ready) for axis, at, limit, ready in made.axes]
    tool = place(made.tool)
    with Scratch() as folder:
        path = folder / f"{kind.replace(' ', '_')}.urdf"
        path.write_text(_urdf(kind.replace(" ", "_"), axes, tool), encoding="utf-8")
        figure = wb.load(path)
    return figure, {f"axis{number}": axis.ready for number, axis in enumerate(axes, start=1)}


def _length(word: str | float, known: dict[str, float]) -> float:
    """Metres: a number, or a length by its name, less a number where one follows."""
    if not isinstance(word, str):
        return word
    name, _, less = word.partition(" - ")
    return known[name] - float(less) if less else known[name]


def _urdf(name: str, axes: list[Axis], tool: tuple[float, float, float]) -> str:
    """The file: every link is a cylinder from its joint to the next one."""
    ends = [axis.at for axis in axes] + [tool]
    thick, thin = of_arm.radii_m
    radii = np.linspace(thick, thin, len(ends))
    lines = [f'<robot name="{name}">']
    lines += [_link(f"link{number}", end, float(radii[number])) for number, end in enumerate(ends)]
    lines.append('<link name="tool"/>')
    for number, axis in enumerate(axes, start=1):
        lines.append(
            f'<joint name="axis{number}" type="revolute"><parent link="link{number - 1}"/><child link="link{number}"/>'
            f'<origin xyz="{_numbers(axis.at)}"/><axis xyz="{axis.axis}"/>'
            f'<limit lower="{-axis.limit}" upper="{axis.limit}" effort="100" velocity="3"/></joint>'
        )
    lines.append(
        f'<joint name="grip" type="fixed"><parent link="link{len(axes)}"/><child link="tool"/>'
        f'<origin xyz="{_numbers(tool)}"/></joint>'
    )
    return "\n".join([*lines, "</robot>"])


def _link(name: str, end: tuple[float, float, float], radius: float) -> str:
    way = np.array(end)
    length = float(np.linalg.norm(way))
    middle = _numbers(tuple(0.5 * way))
    if length < of_arm.short_m:
        shape = f'<geometry><sphere radius="{radius:.4f}"/></geometry>'
        turn = (0.0, 0.0, 0.0)
    else:
        shape = f'<geometry><cylinder radius="{radius:.4f}" length="{length:.4f}"/></geometry>'
        turn = (0.0, float(np.arccos(way[2] / length)), float(np.arctan2(way[1], way[0])))
    mass = 20.0 * length + 0.5
    spin = 0.1 * mass * length**2 + 1e-3
    return (
        f'<link name="{name}"><inertial><mass value="{mass:.3f}"/><origin xyz="{middle}"/>'
        f'<inertia ixx="{spin:.5f}" ixy="0" ixz="0" iyy="{spin:.5f}" iyz="0" izz="{spin:.5f}"/></inertial>'
        f'<collision><origin xyz="{middle}" rpy="{_numbers(turn)}"/>{shape}</collision></link>'
    )


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
    taken = Occupied(figure, (start, witness))
    space = taken.centres.min(axis=0) - of_robots.around_m, taken.centres.max(axis=0) + of_robots.around_m
    add_things(scene, of_robots.things, taken, ROOM, rng, (space[0].tolist(), space[1].tolist()))
    place = figure.placement(witness, tip)
    turned = number // len(of_robots.files) % 2 == 1
    goal = wb.Frame(tip, place) if turned else wb.Point(tip, place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE), witness

"""Robot arms of six and seven axes with links of random lengths, their tool to a place among obstacles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.files import Scratch
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE, ROOM, alone, floor_scene, is_free, until_found
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things

given = numbers("robot_arm")


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The kinds of arm in turn; a place and an orientation in every other round, only a place in the others."""
    figure, ready = arm(given.kinds[number % len(given.kinds)], rng)
    model, start = figure.model, figure.with_joints(figure.neutral, ready)

    def sampled() -> Array | None:
        q: Array = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        return q if is_free(alone(figure), q) else None

    witness = until_found(sampled)
    scene = floor_scene(figure)
    add_things(scene, given.things, Occupied(figure, (start, witness)), ROOM, rng, given.space_m)
    place = figure.placement(witness, "tool")
    turned = number // len(given.kinds) % 2 == 1
    goal = wb.Frame("tool", place) if turned else wb.Point("tool", place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE), witness


class Axis(NamedTuple):
    """A joint: its axis, where it is on the link before it [m], its limits and how it stands when work begins [rad]."""

    axis: str
    at: tuple[float, float, float]
    limit: float
    ready: float


def arm(kind: str, rng: np.random.Generator) -> tuple[wb.Figure, dict[str, float]]:
    """Return an arm, and the joint values it is ready with, elbow bent, the tool in front.

    Args:
        kind: "seven axes": a shoulder, an elbow and a wrist that turn as a person's do; "industrial": six axes, the
            elbow beside the shoulder's plane, the last three crossing; "parallel": six axes, three of them parallel,
            no three of the last crossing.
        rng: for the lengths.
    """
    lengths = [round(float(length), 3) for length in rng.uniform(*given.lengths_m)]
    lower, upper, fore, hand = lengths
    beside = round(float(rng.uniform(*given.beside_m)), 3) if kind == "industrial" else 0.0
    known = {"lower": lower, "upper": upper, "fore": fore, "hand": hand, "beside": beside}

    def place(words: list[Any]) -> tuple[float, float, float]:
        """Metres, from numbers and sums of a length and a number."""
        x, y, z = (_length(word, known) for word in words)
        return x, y, z

    made = getattr(given, kind.replace(" ", "_"))
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
    thick, thin = given.radii_m
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
    if length < given.short_m:
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

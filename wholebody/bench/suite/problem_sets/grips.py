"""Hands with fingers that take rods, balls and boxes by thumb and index finger, or a rod by a power grip.

A thing is made for a posture of the hand, which is the witness. Between two fingertips it is as thick as their
distance, so that each touches it. A bar lies across the palm, and the fingers close until they touch it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import coal_distance, just_outside
from wholebody.figures.postures import placed
from wholebody.tasks.grasp import FINGERS

given = numbers("hands")
Taken = tuple[Array, wb.Shape, pin.SE3]  # a posture (nq,) of a hand, and what it takes where


@lru_cache(maxsize=1)
def person() -> wb.Figure:
    """A person with fingers, loaded once."""
    return wb.load("human", hands="fingers")


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The grips in turn, the right hand and the left in turn of these."""
    kind, thing = given.grips[number % len(given.grips)]
    side = ("right", "left")[number // len(given.grips) % 2]
    figure = person()

    def attempt() -> tuple[wb.Problem, Array] | None:
        taken = (_between if kind == "pinch" else _around)(figure, side, thing, rng)
        if taken is None or not bodies.is_free(bodies.alone(figure), taken[0], bodies.CLEARANCE):
            return None
        witness, shape, at = taken
        (solid,) = shape.pieces()
        if min(coal_distance(*part, solid.geometry, at * solid.placement) for part in _parts(figure, witness)) < -1e-5:
            return None
        scene = bodies.floor_scene(figure).add(shape, name=thing, at=at)
        goal = wb.Grasp(side, thing, "pinch" if kind == "pinch" else "power")
        problem = bodies.standing_problem(scene, figure.posture("standing"), [goal])
        judged = wb.assess(problem, witness)
        return (problem, witness) if judged.met(1e-6) and judged.holds(1e-6) else None

    return bodies.until_found(attempt)


def _open(figure: wb.Figure, side: str, rng: np.random.Generator) -> Array:
    """A standing person (nq,), one arm before it at random, that hand's fingers stretched, the thumb anywhere."""
    q, drawn = bodies.bent(figure, figure.posture("standing"), vars(given.arm_degrees), [side]), {}
    model, values = figure.model, figure.joint_values(q)
    for name in figure.joints:
        place = model.joints[figure.joint_id(name)].idx_q
        low, high = model.lowerPositionLimit[place], model.upperPositionLimit[place]
        ends = getattr(given.thumb_rad, name.partition("thumb_")[2], (-given.spread_rad, given.spread_rad))
        if name.startswith(side) and any(finger in name for finger in FINGERS):
            drawn[name] = float(rng.uniform(*ends)) if "cmc" in name or "abduction" in name else 0.0
        elif name in figure.groups[f"{side}_arm"]:
            drawn[name] = values[name] + given.arm * float(rng.uniform(-1.0, 1.0)) * (high - low)
    return figure.clamp(figure.with_joints(q, drawn))


def _closed(figure: wb.Figure, q: Array, finger: str, shares: dict[str, float], how_far: float) -> Array:
    """The posture q, (nq,), with the joints of a finger at shares of their largest flexion, all times a factor."""
    flexed = {}
    for name in figure.joints:
        if finger in name and "flexion" in name and "cmc" not in name:
            high = figure.model.upperPositionLimit[figure.model.joints[figure.joint_id(name)].idx_q]
            flexed[name] = how_far * shares[name] * float(high)
    return figure.with_joints(q, flexed)


def _shares(figure: wb.Figure, rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.uniform(*given.flexed)) for name in figure.joints}


def _parts(figure: wb.Figure, q: Array, names: Sequence[str] = ()) -> list[tuple[Any, pin.SE3]]:
    """Shapes of segments, of all where none is named, and where they are."""
    found = placed(figure, q)
    return [(piece.geometry, at) for piece, at in found if not names or piece.name.partition(":")[0] in names]


def _shape(thing: str, thick: float, rng: np.random.Generator) -> tuple[wb.Shape, pin.SE3]:
    """A thing that is so thick along z [m], and its placement in axes along whose x it lies."""
    if thing == "ball":
        return wb.Sphere(0.5 * thick), pin.SE3.Identity()
    long = float(rng.uniform(*given.long_m))
    if thing == "rod":
        return wb.Capsule(0.5 * thick, long), pin.SE3(pin.utils.rotate("y", 0.5 * np.pi), np.zeros(3))
    return wb.Box((long, float(rng.uniform(1.0, given.broad)) * thick, thick)), pin.SE3.Identity()


def _between(figure: wb.Figure, side: str, thing: str, rng: np.random.Generator) -> Taken | None:
    """What is between the last parts of thumb and index finger, whose nearest points it touches."""
    q, shares = _open(figure, side, rng), _shares(figure, rng)
    for finger in FINGERS:
        q = _closed(figure, q, f"{side}_{finger}", shares, float(rng.uniform(*given.pinched)))
    (thumb, at), (index, there) = (_parts(figure, q, [f"{side}_{name}_distal"])[0] for name in ("thumb", "index"))
    found, request = coal.DistanceResult(), coal.DistanceRequest()
    request.gjk_tolerance = 1e-9
    put, other = (coal.Transform3s(place.rotation, place.translation) for place in (at, there))
    coal.distance(thumb, put, index, other, request, found)
    way = found.getNearestPoint2() - found.getNearestPoint1()
    thick = float(np.linalg.norm(way))
    if not given.thin_m < thick < given.thick_m:
        return None
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way / thick).matrix()
    turn = turn @ pin.utils.rotate("z", float(rng.uniform(0.0, 2.0 * np.pi)))
    shape, lying = _shape(thing, thick, rng)
    return q, shape, pin.SE3(turn, found.getNearestPoint1() + 0.5 * way) * lying


def _around(figure: wb.Figure, side: str, thing: str, rng: np.random.Generator) -> Taken | None:
    """A bar that touches the palm, and fingers that close around it until they touch."""
    q = _open(figure, side, rng)
    palm = figure.placement(q, f"{side}_palm")
    thick = float(rng.uniform(*given.bars_m))
    beside = float(rng.uniform(0.0, given.bars_m[1] - thick))
    shape, lying = _shape(thing, thick, rng)
    (solid,) = shape.pieces()
    across = np.column_stack([np.eye(3)[1], -np.eye(3)[0], np.eye(3)[2]])
    hand = _parts(figure, q, [f"{side}_hand"])

    def at(height: float) -> pin.SE3:
        return palm * pin.SE3(across, np.array((beside, 0.0, height))) * lying * solid.placement

    def gap(parts: list[tuple[Any, pin.SE3]], place: pin.SE3) -> float:
        return min(coal_distance(*part, solid.geometry, place, exact=True) for part in parts)

    there = at(just_outside(lambda height: gap(hand, at(height)), 0.0, 0.2))
    for finger in FINGERS:
        closed = (_touching(figure, q, f"{side}_{finger}", lambda parts: gap(parts, there), rng) for _ in range(15))
        found = next((posture for posture in closed if posture is not None), None)
        if found is None:
            return None
        q = found
    return q, shape, there * solid.placement.inverse()


def _touching(
    figure: wb.Figure,
    q: Array,
    finger: str,
    gap: Callable[[list[tuple[Any, pin.SE3]]], float],
    rng: np.random.Generator,
) -> Array | None:
    """A finger closed until one of its outer parts touches, (nq,); None where none does, or an inner one is inside."""
    shares, base = _shares(figure, rng), getattr(given, f"{finger.partition('_')[2]}_rad", None)
    if base is not None:
        q = figure.with_joints(q, {f"{finger}_{name}": float(rng.uniform(*ends)) for name, ends in vars(base).items()})
    outer = [f"{finger}_{part}" for part in ("proximal" if "thumb" in finger else "middle", "distal")]

    def room(how_far: float) -> float:
        return gap(_parts(figure, _closed(figure, q, finger, shares, how_far), outer))

    inside = next((share for share in np.linspace(0.1, 1.0, 10) if room(share) < 0.0), None)
    if inside is None or room(0.0) <= 0.0:
        return None
    found = _closed(figure, q, finger, shares, just_outside(room, inside, 0.0))
    inner = _parts(figure, found, [f"{finger}_{'metacarpal' if 'thumb' in finger else 'proximal'}"])
    return found if gap(inner) > 0.0 else None

"""Both hands on one thing, a loop through the arms that stays closed; and hands on the body they belong to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.case import numbers

of_loop = numbers("closed_loop")


def closed_loop(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a bar and a box, brought to a place and an orientation."""
    figure = bodies.human()
    apart = float(rng.uniform(*of_loop.apart_m))
    shape, ahead = _shape(number % 2, apart - 2.0 * of_loop.grip_m, rng)
    middle = np.array((ahead, 0.0, 0.5 * apart))
    scene = bodies.floor_scene(figure).attach(shape, to="right_palm", name="load", at=middle)
    other = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array((0.0, 0.0, apart)))
    q = bodies.bent(figure, figure.posture("standing"), vars(of_loop.bent_degrees))

    def level() -> Array | None:
        """The thing held level before the belly, elbows anyhow, (nq,)."""
        near = bodies.shaken(figure, q, 0.5 * of_loop.spread, rng)
        return _holding(scene, near, other, np.array(of_loop.level), np.array(of_loop.start_m), middle)

    def turned() -> Array | None:
        turn = pin.exp3(rng.uniform(-of_loop.turned_rad, of_loop.turned_rad, 3)) @ np.array(of_loop.level)
        near = bodies.shaken(figure, start, of_loop.spread, rng)
        return _holding(scene, near, other, turn, rng.uniform(*of_loop.middle_m), middle)

    start = bodies.until_found(level)
    witness = bodies.until_found(turned)
    goals = [wb.Frame("right_palm", figure.placement(witness, "right_palm"))]
    grip = wb.Hold("left_palm", other, relative_to="right_palm")
    return bodies.standing_problem(scene, start, goals, grip), witness


def _shape(kind: int, length: float, rng: np.random.Generator) -> tuple[wb.Shape, float]:
    """What is held, and how far ahead of the palms its middle is."""
    if kind == 0:
        return wb.Capsule(of_loop.thick_m, length - 2.0 * of_loop.thick_m), 0.0
    height, depth = (float(edge) for edge in rng.uniform(*of_loop.box_m))
    return wb.Box((depth, height, length)), 0.5 * depth - of_loop.behind_m


def _holding(scene: wb.Scene, q: Array, other: pin.SE3, turn: Array, place: Array, middle: Array) -> Array | None:
    """The posture near q, (nq,), with the thing's middle at a place, held by both hands; None where it is not free."""
    figure = scene.figure
    goals = [
        wb.Frame("right_palm", pin.SE3(turn, place - turn @ middle)),
        wb.Relative("left_palm", "right_palm", other),
    ]
    found = bodies.fitted(
        figure, q, [goal.resolve(bodies.alone(figure), q) for goal in goals], figure.dofs("upper_body")
    )
    return found if found is not None and bodies.is_free(scene, found) else None


of_contact = numbers("self_contact")


@dataclass(frozen=True)
class Touch:
    """A palm that is to lie on a segment, from the place `axis` in it along `normal` (3,), or on what is `near`."""

    hand: str
    segment: str
    axis: Array
    normal: Array
    near: tuple[str, ...]

    def at(self, height: float) -> Array:
        """Where the middle of the palm is, (3,) in the segment's axes, if it is this far from within, metres."""
        return self.axis + height * self.normal


def self_contact(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: a hand on the other elbow, both on the hips, arms crossed; in every other round turned as asked."""
    figure = bodies.human()
    start = figure.posture("standing")
    kind, turned = number % 3, number // 3 % 2 == 1
    begin = bodies.bent(figure, start, vars(of_contact.begin_degrees[kind]))

    def attempt() -> tuple[Array, list[Touch]] | None:
        touches = _touches(kind, ("left", "right")[number // 6 % 2], rng)
        witness = _laid(figure, bodies.shaken(figure, begin, of_contact.spread, rng), touches)
        if witness is None or not bodies.is_free(bodies.alone(figure), witness, of_contact.gap_m[0]):
            return None
        return witness, touches

    witness, touches = bodies.until_found(attempt)
    goals = [_goal(figure, witness, touch, turned) for touch in touches]
    return bodies.standing_problem(bodies.floor_scene(figure), start, goals), witness


def _touches(kind: int, hand: str, rng: np.random.Generator) -> list[Touch]:
    if kind == 0:
        return [_on_arm(hand, (-0.30, -0.22), of_contact.elbow_rad, rng)]
    if kind == 1:
        return [_on_hip(side, rng) for side in ("left", "right")]
    return [_on_arm(side, (-0.34, -0.16), of_contact.front_rad, rng) for side in ("left", "right")]


def _on_arm(hand: str, along: tuple[float, float], around: tuple[float, float], rng: np.random.Generator) -> Touch:
    """A place on the other upper arm, which goes along -z of its axes."""
    side = "right" if hand == "left" else "left"
    out = 1.0 if side == "left" else -1.0
    angle = rng.uniform(*around)
    normal = np.array((np.cos(angle), out * np.sin(angle), 0.0))
    axis = np.array((0.0, 0.0, rng.uniform(*along)))
    return Touch(hand, f"{side}_upper_arm", axis, normal, (f"{side}_upper_arm", f"{side}_forearm"))


def _on_hip(hand: str, rng: np.random.Generator) -> Touch:
    out = 1.0 if hand == "left" else -1.0
    normal = np.array((rng.uniform(-0.3, 0.6), out, rng.uniform(-0.1, 0.3)))
    axis = np.array((0.0, 0.05 * out, 0.03))
    return Touch(hand, "pelvis", axis, normal / np.linalg.norm(normal), ("pelvis", "lower_lumbar", f"{hand}_thigh"))


def _laid(figure: wb.Figure, q: Array, touches: list[Touch]) -> Array | None:
    """A posture near q, (nq,), with the hands some millimetres from what they lie on; None if there is none."""
    scene, dofs = bodies.alone(figure), figure.dofs("upper_body")
    least, most = of_contact.gap_m
    heights = [0.1] * len(touches)
    for _ in range(6):
        goals = [
            wb.Relative(f"{touch.hand}_palm", touch.segment, touch.at(height), orientation=False).resolve(scene, q)
            for touch, height in zip(touches, heights, strict=True)
        ]
        found = bodies.fitted(figure, q, goals, dofs)
        if found is None:
            return None
        q = found
        gaps = [_gap(scene, q, touch) for touch in touches]
        if all(least <= gap <= most for gap in gaps):
            return q
        heights = [height - gap + 0.5 * (least + most) for height, gap in zip(heights, gaps, strict=True)]
    return None


def _gap(scene: wb.Scene, q: Array, touch: Touch) -> float:
    owners, wanted = scene.piece_owner, [{f"{touch.hand}_hand", segment} for segment in touch.near]
    near = scene.contacts(q, within=0.5)
    found = [d for (a, b), d in zip(near.pair, near.distance, strict=True) if {owners[a], owners[b]} in wanted]
    return float(min(found, default=0.5))


def _goal(figure: wb.Figure, q: Array, touch: Touch, turned: bool) -> wb.Relative:
    """The palm where it is in the posture q, as seen from the segment."""
    palm = f"{touch.hand}_palm"
    there = figure.placement(q, touch.segment).actInv(figure.placement(q, palm))
    return wb.Relative(palm, touch.segment, there, orientation=turned)

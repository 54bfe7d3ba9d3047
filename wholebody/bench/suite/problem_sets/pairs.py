"""Two figures in one scene, two people, two arms or one of each: the hand or tool of one at that of the other."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.bench.suite.problem_sets.things import Occupied, add_things

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


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
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
        for _ in range(of_pairs.tries if _is_free(scene, start) else 0):
            witness = _moved(figure, start, pair, rng)
            ends = [figure.placement(witness, f"{name}/{each.tip}").translation for name, each in pair.items()]
            if np.linalg.norm(ends[1] - ends[0]) < of_pairs.apart_m and _is_free(scene, witness):
                return scene, start, witness
        return None

    scene, start, witness = bodies.until_found(attempt)
    taken = Occupied(scene.figure, (start, witness))
    space = taken.centres.min(axis=0) - of_pairs.around_m, taken.centres.max(axis=0) + of_pairs.around_m
    add_things(scene, of_pairs.things, taken, bodies.ROOM, rng, (space[0].tolist(), space[1].tolist()))
    first, second = (f"{name}/{each.tip}" for name, each in pair.items())
    relation = scene.figure.placement(witness, first).actInv(scene.figure.placement(witness, second))
    turned = number // len(of_pairs.kinds) % 2 == 1
    goals = [bodies.point(scene.figure, witness, first), wb.Relative(second, first, relation, orientation=turned)]
    feet = [wb.Hold(name) for name in scene.figure.segments if name.endswith(bodies.FEET)]
    problem = wb.Problem(
        scene, start, goals=goals, constraints=feet, clearance=bodies.CLEARANCE, range_of_motion=False, balance=False
    )
    return problem, witness


def _moved(figure: wb.Figure, start: Array, pair: dict[str, One], rng: np.random.Generator) -> Array:
    """The start (nq,) with the joints of both at random within their limits."""
    q = np.array(start)
    names = [f"{name}/{joint}" for name, each in pair.items() for joint in each.joints]
    places = np.array([figure.model.joints[figure.joint_id(name)].idx_q for name in names])
    q[places] = rng.uniform(figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places])
    return q


def _is_free(scene: wb.Scene, q: Array) -> bool:
    """Whether nothing but soles on the floor is nearer than `bodies.ROOM`, metres."""
    owners = scene.piece_owner
    near = [(owners[a], owners[b]) for a, b in scene.contacts(q, within=bodies.ROOM).pair]
    return all(other == "floor" and name.endswith(("_foot", "_toes")) for name, other in near)

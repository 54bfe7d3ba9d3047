"""Things alone: pairs of them that overlap, and sleeping bodies whose support creeps, jumps or leaves."""

from __future__ import annotations

from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.bodies import body
from wholebody.bench.attack.case import Verdict, Written
from wholebody.bench.attack.solves import Terms, script_head
from wholebody.bench.attack.things import Thing, shape, somewhere, xyzquat
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.dynamics.world import World, WorldFrame

DEEP = 2e-5  # m, of pieces of up to a metre: pairs that overlap by more are told, those by less may be
FLOATS = 3e-4  # m: a body that sleeps is no farther from everything that could bear it
INSIDE = 2e-4  # m: and no deeper in it, once it had time to get out
FALLS_ASLEEP = 90  # frames
GETS_OUT = 30  # frames
FRAMES = 60
CREEPS = (1e-6, 5e-6, 2e-5, 7e-5, 3e-4)  # m a frame

PAIRS = """
verdict = worlds.pairs_verdict(scene, start)
print(verdict)
"""
SLEEPER = '''"""A body sleeps on a thing that {way}."""

import wholebody as wb
from wholebody.bench.attack import worlds

scene = wb.Scene(wb.load("hand"))
scene.add({support}, name="support", at={at!r})
scene.add({shape}, name="sleeper", at={place!r}, body=wb.Body(density=700.0))
verdict = worlds.sleeper_verdict(scene, {moves!r}, {over!r})
print(verdict)
'''


def written_pairs(rng: np.random.Generator) -> Written:
    """Write a scene of things that may overlap each other."""
    figure = body(rng)
    start = figure.figure.clamp(figure.figure.posture(figure.figure.postures[0]))
    placed = Occupied(figure.figure, [start])
    things: list[Thing] = []
    for _ in range(int(rng.integers(2, 9))):
        made, call = shape(rng, figure.size)
        at = somewhere(rng, placed, figure.size)
        if things and rng.random() < 0.6:  # near another one
            nearby = things[int(rng.integers(len(things)))].placement.translation
            at.translation = nearby + rng.normal(size=3) * figure.size * float(rng.choice([0.0, 0.05, 0.2]))
        if np.abs(at.translation).max() < 99.0:
            things.append(Thing(made, call, xyzquat(at)))
    title = f"{len(things)} things about {figure.figure.name}"
    return Written(script_head(title, figure, start, things, Terms(), "worlds") + PAIRS, figure.files)


def pairs_verdict(scene: wb.Scene, q: Array) -> Verdict:
    """Judge what a scene says of things that overlap, by coal on every two pieces of two things."""
    said = {frozenset((one.a, one.b)) for one in scene.penetration(q)} | {
        frozenset((scene.piece_owner[i], scene.piece_owner[j])) for i, j in scene.overlapping(q).pair.tolist()
    }
    names, wrongs, count = list(scene.objects), [], 0
    for one, other in combinations(names, 2):
        shapes = [scene.objects[name].shape for name in (one, other)]
        if all(isinstance(made, wb.HalfSpace) for made in shapes):
            continue
        least = _apart(scene, one, other)
        count += least < 0.0
        size = max([1.0, *(_size(made) for made in shapes)])
        told = frozenset((one, other)) in said
        if least < -DEEP * size and not told:
            wrongs.append(f"{one} and {other} overlap by {-least:.3g} m, and nothing tells it")
        if least > DEEP * size and told:
            wrongs.append(f"{one} and {other} are {least:.3g} m apart, and are said to overlap")
    return Verdict("wrong", wrongs[0]) if wrongs else Verdict("right", f"{count} pairs of things overlap")


def written_sleeper(rng: np.random.Generator) -> Written:
    """Write a body that sleeps on a thing, and how that moves."""
    edge = float(rng.uniform(0.05, 0.3))
    half = 0.5 * edge
    shapes = (
        f"wb.Box(({edge}, {edge}, {edge}))",
        f"wb.Box(({edge}, {2 * edge}, {edge}))",
        f"wb.Cylinder({half}, {edge})",
    )
    supports = (
        "wb.Box((1.0, 1.0, 0.2))",
        "wb.HalfSpace(offset=0.1)",
        "wb.Cylinder(0.5, 0.2)",
        "wb.Box((0.6, 2.0, 0.2))",
    )
    way = str(rng.choice(["creeps", "jumps", "leaves", "turns"]))
    at = np.array([3.0, 0.0, -0.1])
    direction = rng.normal(size=3) if rng.random() < 0.5 else np.array([0.0, 0.0, float(rng.choice([-1.0, 1.0]))])
    direction /= np.linalg.norm(direction)
    step = float(rng.choice(CREEPS))
    turn = pin.exp3(direction * step)
    place, moves = pin.SE3(np.eye(3), at), []
    for frame in range(FRAMES):
        if way == "creeps":
            place = pin.SE3(place.rotation, place.translation + step * direction)
        elif way == "turns":
            place = pin.SE3(turn @ place.rotation, place.translation)
        elif frame == 0:
            far = 3.0 if way == "leaves" else float(rng.choice([5e-5, 2e-4, 1e-3]))
            place = pin.SE3(place.rotation, place.translation + far * direction)
        moves.append(tuple(round(x, 12) for x in xyzquat(place)))
    over = bool(rng.random() < 0.5) and way in ("creeps", "turns")
    script = SLEEPER.format(
        way=way, support=str(rng.choice(supports)), at=tuple(at.tolist()), shape=str(rng.choice(shapes)),
        place=(3.0, 0.0, half + 5e-5), moves=moves, over=over,
    )  # fmt: skip
    return Written(script)


def sleeper_verdict(scene: wb.Scene, moves: list[tuple[float, ...]], over: bool) -> Verdict:
    """Judge a body that sleeps while what bears it moves; by coal, whether it floats or is inside."""
    world = World(scene)
    for _ in range(FALLS_ASLEEP):
        frame = world.step()
        if _sleeping(frame):
            break
    else:
        return Verdict("gave up", f"the body does not sleep after {FALLS_ASLEEP} frames")
    since = 0
    for number, at in enumerate([*moves, *[moves[-1]] * GETS_OUT]):
        if number == 0 or (number < len(moves) and at != moves[number - 1]):
            scene.move("support", at=at, over=world.dt if over else None)
            since = 0
        since += 1
        frame = world.step()
        apart = _apart(scene, "support", "sleeper")
        if _sleeping(frame) and apart > FLOATS:
            return Verdict("wrong", f"frame {number}: the body sleeps {apart:.3g} m above what bore it")
        if apart < -INSIDE and since >= GETS_OUT:
            return Verdict("wrong", f"frame {number}: the body is {-apart:.3g} m inside of what bears it")
        if apart < -1e-4 and abs(frame.deepest + apart) > 1e-5:
            return Verdict("wrong", f"frame {number}: the body is {-apart:.3g} m deep, {frame.deepest:.3g} m are told")
    return Verdict("right", f"{len(moves)} frames")


def _sleeping(frame: WorldFrame) -> bool:
    return frame.engine is not None and frame.engine.sleeping == 1


def _size(made: wb.Shape) -> float:
    """Radius of the largest piece about its origin, metres."""
    sizes = [0.0]
    for piece in made.pieces():
        if not isinstance(piece.geometry, coal.Halfspace):
            piece.geometry.computeLocalAABB()
            sizes.append(float(piece.geometry.aabb_radius))
    return max(sizes)


def _apart(scene: wb.Scene, one: str, other: str) -> float:
    """Least distance of two things by coal, negative where they overlap."""
    first, second = (
        [
            (piece.geometry, coal.Transform3s(at.rotation, at.translation))
            for piece in thing.shape.pieces()
            for at in [thing.placement * piece.placement]
        ]
        for thing in (scene.objects[one], scene.objects[other])
    )
    request = coal.DistanceRequest()
    return min(float(coal.distance(*a, *b, request, coal.DistanceResult())) for a in first for b in second)

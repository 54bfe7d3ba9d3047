"""Reaches of a fingertip, or of both hands and the eyes: alone, among things, through a passage, balanced, dragged."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.case import Posed, numbers
from wholebody.bench.suite.problem_sets.things import Make, Occupied, add_things, household_thing


def free(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """Where the fingertip is in a random posture of the upper body becomes the target."""
    figure = bodies.human()
    start = figure.posture("standing")
    witness = bodies.sampled_posture(figure, start, rng)
    goals = [bodies.point(figure, witness, bodies.TIPS[number % len(bodies.TIPS)])]
    return bodies.standing_problem(bodies.floor_scene(figure), start, goals), witness


def several(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: both fingertips; both and the eyes; one palm with its orientation, the other fingertip and the eyes."""
    figure = bodies.human()
    start = figure.posture("standing")
    witness = bodies.sampled_posture(figure, start, rng)
    away = np.array((rng.uniform(*numbers("free_reach_several").seen_m), 0.0, 0.0))
    look = wb.Axis("gaze", (1, 0, 0), toward=figure.placement(witness, "gaze").act(away))
    points = [bodies.point(figure, witness, tip) for tip in bodies.TIPS]
    palm = wb.Frame("right_palm", figure.placement(witness, "right_palm"))
    goals: list[list[wb.Goal]] = [[*points], [*points, look], [palm, points[1], look]]
    return bodies.standing_problem(bodies.floor_scene(figure), start, goals[number % len(goals)]), witness


def among(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A reach among things that touch neither how the person stands nor the witness."""
    return reach_among("clutter", bodies.human(), bodies.TIPS[number % len(bodies.TIPS)], rng)


def reach_among(
    family: str, figure: wb.Figure, tip: str, rng: np.random.Generator, make: Make = household_thing
) -> tuple[wb.Problem, Array]:
    """A problem with random things, as many as `sets.toml` says of a set, and a posture (nq,) that solves it."""
    start = figure.posture("standing")
    witness = bodies.sampled_posture(figure, start, rng)
    scene = bodies.floor_scene(figure)
    add_things(scene, numbers(family).things, Occupied(figure, (start, witness)), bodies.ROOM, rng, make=make)
    return bodies.standing_problem(scene, start, [bodies.point(figure, witness, tip)]), witness


def uniform(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """All joints anywhere within their limits, the feet then put on their places; one fingertip, or both."""
    figure, given = bodies.human(), numbers("uniform_witnesses")
    start = figure.posture("standing")
    feet = [wb.Frame(foot, figure.placement(start, foot)).resolve(bodies.alone(figure), start) for foot in bodies.FEET]
    limits, dofs = figure.limits, bodies.movable(figure)
    toes = [name for name in figure.joints if "toe" in name]
    standing = figure.joint_values(start)

    def attempt() -> Array | None:
        q = np.array(start)
        q[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        q = figure.with_joints(q, {name: standing[name] for name in toes})
        q[:3] += rng.uniform(*given.pelvis_m)
        turn = np.append(0.5 * given.lean_rad * rng.normal(size=3), 1.0)
        q[3:7] = turn / np.linalg.norm(turn)
        found = bodies.fitted(figure, figure.clamp(q), feet, dofs)
        return found if found is not None and bodies.is_free(bodies.alone(figure), found) else None

    witness = bodies.until_found(attempt)
    tips = bodies.TIPS if number % 2 else (bodies.TIPS[number // 2 % 2],)
    return bodies.standing_problem(
        bodies.floor_scene(figure), start, [bodies.point(figure, witness, tip) for tip in tips]
    ), witness


@lru_cache(maxsize=2)
def person(number: int) -> wb.Figure:
    """One of the people of the set, women and men in turn, from short to tall."""
    given = numbers("other_people")
    low, high = given.statures_m
    stature = low + (high - low) * number / (given.people - 1)
    return wb.load("human", sex=("female", "male")[number % 2], stature=stature)


def people(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The reach among twenty things, by other people."""
    count = numbers("other_people").people
    return reach_among("clutter", person(number % count), bodies.TIPS[number // count % 2], rng)


def clutter(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A reach among more and other things."""
    return reach_among("other_clutter", bodies.human(), bodies.TIPS[number % 2], rng, _other_thing)


def _other_thing(number: int, rng: np.random.Generator) -> tuple[str, wb.Shape]:
    """A plank, a rod, an ellipsoid or a flat hull in turn: longer and thinner than what the set of clutter has."""
    kind = ("plank", "rod", "ellipsoid", "slab")[number % 4]
    if kind == "plank":
        return kind, wb.Box(
            (float(rng.uniform(0.4, 1.0)), float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.01, 0.04)))
        )
    if kind == "rod":
        return kind, wb.Capsule(float(rng.uniform(0.008, 0.02)), float(rng.uniform(0.4, 1.2)))
    if kind == "ellipsoid":
        a, b, c = rng.uniform(0.03, 0.25, 3)
        return kind, wb.Ellipsoid((float(a), float(b), float(c)))
    return kind, wb.Hull(rng.uniform(-1.0, 1.0, (20, 3)) * (*rng.uniform(0.1, 0.3, 2), rng.uniform(0.01, 0.03)))


of_passage = numbers("passage")


def passage(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a window and two boards; left and right in turn of two."""
    figure, side = bodies.human(), ("left", "right")[number // 2 % 2]
    start = figure.posture("standing")
    begin = bodies.bent(figure, start, vars(of_passage.begin_degrees), [side])
    standing = Occupied(figure, (start,))

    def attempt() -> tuple[Array, list[tuple[wb.Box, pin.SE3]]] | None:
        wrist = _wrist(side, rng)
        boards = _boards(number % 2, wrist, rng)
        goal = wb.Frame(f"{side}_hand", wrist).resolve(bodies.alone(figure), start)
        witness = bodies.fitted(
            figure, bodies.shaken(figure, begin, of_passage.spread, rng), [goal], figure.dofs("upper_body")
        )
        if witness is None or not bodies.is_free(bodies.alone(figure), witness):
            return None
        taken = standing, Occupied(figure, (witness,))
        clear = all(body.clear_of(board, at, bodies.ROOM) for body in taken for board, at in boards)
        return (witness, boards) if clear else None

    witness, boards = bodies.until_found(attempt)
    scene = bodies.floor_scene(figure)
    for count, (board, at) in enumerate(boards):
        scene.add(board, name=f"board {count}", at=at)
    return bodies.standing_problem(scene, start, [bodies.point(figure, witness, f"{side}_index_tip")]), witness


def _wrist(side: str, rng: np.random.Generator) -> pin.SE3:
    """Where the hand segment is when it is through: its -z is the way, its x the breadth, its y the thickness."""
    out = 1.0 if side == "left" else -1.0
    place = rng.uniform(*of_passage.place_m) * (1.0, out, 1.0)
    turn, rise = (
        rng.uniform(-of_passage.turn_rad, of_passage.turn_rad),
        rng.uniform(-of_passage.rise_rad, of_passage.rise_rad),
    )
    way = np.array((np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)))
    level = np.cross((0.0, 0.0, 1.0), way)
    level /= np.linalg.norm(level)
    upright = np.column_stack([np.cross(way, level), level, -way])
    roll = out * rng.uniform(-0.3, of_passage.roll_rad)
    return pin.SE3(upright @ pin.exp3(np.array((0.0, 0.0, roll))), place)


def _boards(kind: int, wrist: pin.SE3, rng: np.random.Generator) -> list[tuple[wb.Box, pin.SE3]]:
    """Four boards around a window, or two on both sides of a slot, where the hand and the forearm go through."""
    narrow, broad = of_passage.gap_m
    half = np.array(of_passage.half_m) + rng.uniform(narrow, broad, 2)
    past, wide, thick = float(rng.uniform(*of_passage.past_wrist_m)), of_passage.wide_m, of_passage.thick_m
    if kind == 1:
        deep = float(rng.uniform(*of_passage.deep_m))
        across, along = 2.0 * (half[0] + wide), past + 0.5 * deep - 0.1
        middles = [(0.0, sign * (half[1] + 0.5 * thick), -along) for sign in (-1.0, 1.0)]
        return [(wb.Box((across, thick, deep)), wrist * _at(middle)) for middle in middles]
    boards = []
    for sign in (-1.0, 1.0):
        boards.append((wb.Box((wide, 2.0 * (half[1] + wide), thick)), (sign * (half[0] + 0.5 * wide), 0.0, -past)))
        boards.append((wb.Box((2.0 * half[0], wide, thick)), (0.0, sign * (half[1] + 0.5 * wide), -past)))
    return [(board, wrist * _at(middle)) for board, middle in boards]


def _at(middle: tuple[float, float, float]) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(middle))


of_balance = numbers("balance")


def balance(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: a fingertip low down, one far out, both low down; sides change too."""
    figure, tip = bodies.human(), bodies.TIPS[number // 3 % 2]

    def attempt() -> tuple[list[wb.Point], Array] | None:
        goals = _far_goals(number % 3, tip, rng)
        equalities = [*_standing_and(figure, goals), bodies.MassAbove(rng.uniform(*of_balance.over_m))]
        found = bodies.fitted(figure, _bent_anyhow(figure, rng), equalities, bodies.movable(figure))
        if found is None or not bodies.is_free(bodies.alone(figure), found):
            return None
        return (goals, found) if _least_room(found) > of_balance.margin_m + of_balance.spare_m else None

    goals, witness = bodies.until_found(attempt)
    reached = [bodies.point(figure, witness, goal.frame) for goal in goals]
    start = figure.posture("standing")
    return bodies.standing_problem(
        bodies.floor_scene(figure), start, reached, wb.Balance(margin=of_balance.margin_m)
    ), witness


def _far_goals(kind: int, tip: str, rng: np.random.Generator) -> list[wb.Point]:
    if kind < 2:
        return [wb.Point(tip, rng.uniform(*(of_balance.low_m if kind == 0 else of_balance.far_m)))]
    left, right = rng.uniform(*of_balance.two_m), rng.uniform(*of_balance.two_m) * (1.0, -1.0, 1.0)
    return [wb.Point("left_index_tip", left), wb.Point("right_index_tip", right)]


def _standing_and(figure: wb.Figure, goals: list[wb.Point]) -> list[wb.Goal]:
    start, scene = figure.posture("standing"), bodies.alone(figure)
    feet = [wb.Frame(foot, figure.placement(start, foot)) for foot in bodies.FEET]
    return [goal.resolve(scene, start) for goal in (*goals, *feet)]


def _bent_anyhow(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """A posture (nq,) with bent legs and the upper body anyhow; the feet are not yet where they belong."""
    q = figure.posture("standing")
    bend = float(rng.uniform())
    ends = vars(of_balance.stance_degrees).items()
    q = bodies.bent(figure, q, {name: least + bend * (most - least) for name, (least, most) in ends})
    q = bodies.shaken(figure, figure.clamp(q), of_balance.arms, rng)
    q[2] -= 0.45 * bend
    q[:2] += rng.uniform(-0.1, 0.1, 2)
    pitch = rng.uniform(0.0, 0.6) + 0.3 * bend
    q[3:7] = 0.0, np.sin(pitch / 2.0), 0.0, np.cos(pitch / 2.0)
    return q


@lru_cache(maxsize=1)
def _support() -> wb.Balance:
    return wb.Balance().resolve(bodies.alone(bodies.human()), bodies.human().posture("standing"))


def _least_room(q: Array) -> float:
    """Distance of the centre of mass from the nearest edge of the support polygon, metres."""
    return float(_support().value(bodies.alone(bodies.human()).state(q)).min())


of_drag = numbers("drag")


def drag(number: int, rng: np.random.Generator) -> Posed:
    """The goals are where the fingertip is in each posture of `way`; the first is where it is at the start."""
    figure, tip = bodies.human(), bodies.TIPS[number % len(bodies.TIPS)]
    postures = way(figure, rng)
    scene = bodies.floor_scene(figure)
    add_things(scene, of_drag.things, Occupied(figure, postures), bodies.ROOM, rng)
    goals = [bodies.point(figure, q, tip) for q in postures]
    moving = tuple((goal,) for goal in goals[1:])
    return bodies.standing_problem(scene, postures[0], goals[:1]), postures[0], moving, tuple(postures[1:])


def way(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """Postures (frames + 1, nq) of a smooth free motion from standing, at rest at both ends."""
    # a uniform cubic B-spline (de Boor 1978) through random controls, the last of a span is drawn until it is free
    standing = figure.posture("standing")
    spans = int(rng.integers(of_drag.spans[0], of_drag.spans[1] + 1))
    for _ in range(50):
        control, frames = [standing] * 3, [standing[None]]
        while len(frames) <= spans:
            resting = len(frames) > spans - of_drag.spans_to_rest
            for _ in range(1 if resting else 40):
                point = control[-1] if resting else bodies.shaken(figure, control[-1], of_drag.stride, rng)
                span = _span(np.array([*control[-3:], point]))
                if all(bodies.is_free(bodies.alone(figure), q) for q in span):
                    control.append(point)
                    frames.append(span)
                    break
            else:
                break
        else:
            return np.vstack(frames)
    raise InputError("none of 50 motions is free; give another seed")


def _span(control: Array) -> Array:
    """Postures (frames, nq) of the span between the second and the third of four control postures (4, nq)."""
    t = np.arange(1, of_drag.frames_a_span + 1)[:, None] / of_drag.frames_a_span
    weights = np.hstack([(1.0 - t) ** 3, 3.0 * t**3 - 6.0 * t**2 + 4.0, -3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0, t**3])
    return np.asarray(weights @ control / 6.0)

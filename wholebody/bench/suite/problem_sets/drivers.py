"""People of all sizes at controls: a seat with a backrest, something for both hands, something for the feet.

A cabin is built around a seated posture, which is the witness. The start is the figure's own seated posture somewhere
near, so that it is often inside of what it is to touch.
"""

from __future__ import annotations

from functools import lru_cache

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import alone, bent, fitted, is_free, movable, until_found
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import coal_distance, just_outside
from wholebody.figures.postures import lowest, placed, support

given = numbers("drivers")


@lru_cache(maxsize=14)
def driver(number: int) -> wb.Figure:
    """One of the women and then the men, from small to large."""
    sex, percentile = divmod(number, len(given.percentiles))
    return wb.load("human", sex=("female", "male")[sex], percentile=given.percentiles[percentile])


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """Persons take turns; after all of them the feet, and then the right hand, have other controls."""
    people = 2 * len(given.percentiles)
    figure = driver(number % people)
    kind = number // people

    def attempt() -> tuple[wb.Problem, Array] | None:
        witness, slope, lean = _seated(figure, rng)
        if witness is None or not is_free(alone(figure), witness):
            return None
        problem = _cabin(figure, witness, slope, lean, kind, rng)
        if problem is None:
            return None
        judged = wb.assess(problem, witness)
        return (problem, witness) if judged.met(1e-6) and judged.holds(1e-6) else None

    return until_found(attempt)


def _seated(figure: wb.Figure, rng: np.random.Generator) -> tuple[Array | None, float, float]:
    """A seated posture (nq,) with both soles in one plane, its slope and how the pelvis leans, degrees."""
    lean, slope, apart = (
        float(rng.uniform(*ends)) for ends in (given.leans_degrees, given.slopes_degrees, given.feet_apart_m)
    )
    degrees = {name: rng.uniform(*ends) for name, ends in vars(given.seated_degrees).items()}
    q = figure.clamp(bent(figure, figure.posture("sitting"), degrees))
    q[3:7] = _pitch(-lean)
    rest, goals = figure.posture("standing"), []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        at, turn = figure.placement(q, f"{side}_foot").translation, pin.utils.rotate("y", -np.radians(slope))
        flat = turn @ figure.placement(rest, f"{side}_foot").rotation
        goals.append(wb.Frame(f"{side}_foot", pin.SE3(flat, np.array((at[0], sign * apart, at[2])))))
    legs = np.intersect1d(movable(figure), figure.dofs(figure.groups["legs"]))
    found = fitted(figure, q, [goal.resolve(alone(figure), q) for goal in goals], legs)
    if found is not None:
        found[2] += given.off_floor_m - lowest(figure, found)
    return found, slope, lean


def _cabin(
    figure: wb.Figure, q: Array, slope: float, lean: float, kind: int, rng: np.random.Generator
) -> wb.Problem | None:
    """A cabin around a posture; None where the trunk is not what the backrest meets first."""
    scene = wb.Scene(figure)
    seat = _lowest_along(figure, q, np.array((0.0, 0.0, 1.0)), ("pelvis", "left_thigh", "right_thigh"))
    scene.add(wb.Box((0.46, 0.52, 0.08)), name="seat", at=(q[0] - 0.02, 0.0, seat - 0.04))
    lean -= float(rng.uniform(*given.less_degrees))
    ahead = np.array((np.cos(np.radians(lean)), 0.0, np.sin(np.radians(lean))))
    back = _lowest_along(figure, q, ahead, ("lower_lumbar", "upper_lumbar", "lower_thorax", "thorax"))
    if back > _lowest_along(figure, q, ahead, ("pelvis",)):
        return None
    middle = q[:3] + (0.0, 0.0, 0.25)
    middle = middle + (back - middle @ ahead - 0.04) * ahead
    scene.add(wb.Box((0.08, 0.50, 0.66)), name="backrest", at=(*middle, *_pitch(-lean)))
    goals: list[wb.Goal] = [wb.Sit("seat", back="backrest")]
    constraints: list[wb.Constraint] = []
    up = pin.utils.rotate("y", -np.radians(slope))[:, 2]
    soles = [figure.placement(q, f"{side}_sole").translation for side in ("left", "right")]
    if kind % 2 == 0:
        center = 0.5 * (soles[0] + soles[1]) - 0.01 * up
        scene.add(wb.Box((0.36, 0.6, 0.02)), name="board", at=(*center, *_pitch(-slope)))
        constraints.append(wb.Stand("board", balance=False))
    else:
        for side in ("left", "right"):
            center = figure.placement(q, f"{side}_ball").translation - 0.01 * up
            scene.add(wb.Box((0.12, 0.12, 0.02)), name=f"{side}_pedal", at=(*center, *_pitch(-slope)))
            goals.append(wb.Touch(f"{side}_ball", f"{side}_pedal"))
    for side in ("left", "right") if kind // 2 % 2 == 0 else ("left",):
        scene.add(wb.Capsule(*given.bar_m), name=f"{side}_bar", at=_bar(figure, q, side))
        goals.append(wb.Grasp(side, f"{side}_bar", kind="power"))
    if kind // 2 % 2:
        tip = figure.placement(q, "right_index_tip")
        at = pin.SE3(tip.rotation, tip.act(np.array((given.panel_m, 0.0, 0.0))))
        scene.add(wb.Box((2.0 * given.panel_m, 0.12, 0.12)), name="panel", at=at)
        goals.append(wb.Touch("right_index_tip", "panel"))
    look = figure.placement(q, "gaze").rotation[:, 0]
    goals.append(wb.Axis("gaze", (1, 0, 0), direction=look, weight=0.1))
    start = figure.posture("sitting")
    start[:2] += q[:2] + rng.uniform(-given.away_m, given.away_m, 2) * (1.0, 0.3)
    return wb.Problem(scene, start, goals=goals, constraints=constraints)


def _pitch(degrees: float) -> tuple[float, float, float, float]:
    """Quaternion x, y, z, w of a turn about y."""
    half = np.radians(degrees) / 2.0
    return 0.0, float(np.sin(half)), 0.0, float(np.cos(half))


def _lowest_along(figure: wb.Figure, q: Array, direction: Array, segments: tuple[str, ...]) -> float:
    """How far the pieces of segments reach against a unit direction (3,), metres along it."""
    return min(
        -support(piece.geometry, place, -direction)
        for piece, place in placed(figure, q)
        if piece.name.partition(":")[0] in segments
    )


def _bar(figure: wb.Figure, q: Array, side: str) -> pin.SE3:
    """Where a bar lies along a palm and touches the hand."""
    palm = figure.placement(q, f"{side}_palm")
    joint = figure.model.frames[figure.frame_id(f"{side}_palm")].parentJoint
    hand = [(piece.geometry, place) for piece, place in placed(figure, q) if piece.parentJoint == joint]
    turn, shape = (
        np.column_stack([palm.rotation[:, 2], palm.rotation[:, 0], palm.rotation[:, 1]]),
        coal.Capsule(*given.bar_m),
    )

    def at(height: float) -> pin.SE3:
        return pin.SE3(turn, palm.translation + height * palm.rotation[:, 2])

    def gap(height: float) -> float:
        return min(coal_distance(*piece, shape, at(height), exact=True) for piece in hand)

    return at(just_outside(gap, 0.0, 0.2))

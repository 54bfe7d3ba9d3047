"""The person of the sets, random postures in which nothing touches, and postures moved onto equalities.

`fitted` is Newton's method on the equalities alone, with the shortest step in every turn (Ben-Israel 1966, "A
Newton-Raphson method for the solution of systems of equations"). It knows neither contacts nor measures, so it favours
no method that is compared; whoever calls it asks afterwards whether the posture is free.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import wholebody as wb
from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.figures.state import State, Wrench

ROOM = 0.005  # m: what limbs and things leave free in a witness, and things at the start
CLEARANCE = 0.002  # m: required of an answer
TIPS = ("right_index_tip", "left_index_tip")
FEET = ("left_foot", "right_foot")


_Found = TypeVar("_Found")


@lru_cache(maxsize=1)
def human() -> wb.Figure:
    """The person, loaded once."""
    return wb.load("human")


@lru_cache(maxsize=8)
def alone(figure: wb.Figure) -> wb.Scene:
    """A figure on the floor and nothing else, to ask whether postures are free; never part of a case."""
    return floor_scene(figure)


def floor_scene(figure: wb.Figure) -> wb.Scene:
    """A fresh scene of a figure on the floor."""
    return wb.Scene(figure).add(wb.HalfSpace(), name="floor")


def is_free(scene: wb.Scene, q: Array, room: float = ROOM) -> bool:
    """Whether nothing but the soles on the floor is nearer than `room`, metres, in the posture q, shape (nq,)."""
    owners = scene.piece_owner
    near = [(owners[a], owners[b]) for a, b in scene.contacts(q, within=room).pair]
    return all(other == "floor" and name.endswith(("_foot", "_toes")) for name, other in near)


def sampled_posture(figure: wb.Figure, start: Array, rng: np.random.Generator) -> Array:
    """Posture (nq,), the upper body at random within its limits, nothing touching; InputError where there is none."""
    joints = figure.groups["upper_body"]
    places = np.array([figure.model.joints[figure.joint_id(name)].idx_q for name in joints])
    lower, upper = figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places]

    def sampled() -> Array | None:
        q = np.array(start)
        q[places] = rng.uniform(lower, upper)
        return q if is_free(alone(figure), q) else None

    return until_found(sampled)


def until_found(attempt: Callable[[], _Found | None]) -> _Found:
    """What an attempt gives, made again until it gives something; InputError where it never did."""
    for _ in range(5000):  # about one in five of the postures of a person's upper body is free
        found = attempt()
        if found is not None:
            return found
    raise InputError("none of 5000 postures is free; give another seed")


def shaken(figure: wb.Figure, q: Array, share: float, rng: np.random.Generator) -> Array:
    """The posture q, (nq,), with each joint of the upper body off by at most a share of its range."""
    model = figure.model
    values = {}
    for name in figure.groups["upper_body"]:
        place = model.joints[figure.joint_id(name)].idx_q
        low, high = model.lowerPositionLimit[place], model.upperPositionLimit[place]
        reach = share * (high - low)
        values[name] = float(np.clip(q[place] + float(rng.uniform(-reach, reach)), low, high))
    return figure.clamp(figure.with_joints(q, values))


def bent(figure: wb.Figure, q: Array, degrees: Mapping[str, float], sides: Sequence[str] = ("left", "right")) -> Array:
    """The posture q, (nq,), with joints of one side or both at angles by the joints' names without the side."""
    angles = {f"{side}_{name}": np.radians(angle) for side in sides for name, angle in degrees.items()}
    return figure.with_joints(q, angles)


def movable(figure: wb.Figure) -> NDArray[np.intp]:
    """Places in the tangent of all but the toes, which stay on the floor with their feet."""
    toes = figure.dofs([name for name in figure.joints if "toe" in name])
    return np.setdiff1d(np.arange(figure.model.nv), toes)


def standing_problem(
    scene: wb.Scene, start: Array, goals: Sequence[wb.Goal], *constraints: wb.Constraint
) -> wb.Problem:
    """What people keep: their feet stay where they are at the start (nq,), and all pairs `CLEARANCE` apart."""
    feet = [wb.Hold(name) for name in sorted(scene.figure.segments) if name.endswith(FEET)]
    return wb.Problem(
        scene, start, goals=goals, constraints=[*constraints, *feet], clearance=CLEARANCE,
        range_of_motion=False, balance=False,
    )  # fmt: skip


def point(figure: wb.Figure, q: Array, frame: str) -> wb.Point:
    """The goal that a frame is where the posture q, (nq,), has it."""
    return wb.Point(frame, figure.placement(q, frame).translation)


class MassAbove(wb.Goal):
    """The centre of mass above a place on the floor."""

    def __init__(self, place: Array) -> None:
        """Keep the place (2,) in metres."""
        self.place = np.array(place)

    def error(self, state: State) -> Array:
        """(2,) from the place [m]."""
        return np.asarray(state.center_of_mass()[:2] - self.place)

    def jacobian(self, state: State) -> Array:
        """(2, nv)."""
        return state.center_of_mass_jacobian()[:2]


class Held(wb.Goal):
    """A constraint without slack as an equality."""

    def __init__(self, hold: wb.Hold) -> None:
        self.hold = hold

    def error(self, state: State) -> Array:
        """(m,) difference from where it is held [m, rad]."""
        return self.hold.value(state)

    def jacobian(self, state: State) -> Wrench:
        """Rows of the hold."""
        return self.hold.jacobian(state)


def held(problem: wb.Problem) -> list[Held]:
    """The holds of a problem as equalities."""
    return [Held(term) for term in problem.constraints if isinstance(term, wb.Hold)]


def fitted(figure: wb.Figure, q: Array, goals: Sequence[wb.Goal], dofs: Indices) -> Array | None:
    """Return the posture (nq,) within limits that Newton's method finds for resolved goals from q, moving `dofs`."""
    model, state = figure.model, _state(figure)
    for _ in range(25):
        state.update(q)
        error = np.concatenate([goal.error(state) for goal in goals])
        if np.abs(error).max() < 1e-10:  # m, rad
            return q
        rows = np.vstack([state.dense_jacobian(goal.jacobian(state)) for goal in goals])
        step = _shortest(rows, -error, dofs, *figure.tangent_bounds(q))
        # Farther away than half a radian or metre the rows are no longer true.
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))
        q = figure.clamp(pin.integrate(model, q, step))
    return None


@lru_cache(maxsize=8)
def _state(figure: wb.Figure) -> State:
    """One for all postures of a figure: making it takes as long as twenty turns."""
    return State(figure.model)


def _shortest(rows: Array, wanted: Array, dofs: Indices, lower: Array, upper: Array) -> Array:
    """Step (nv,) of some degrees of freedom that does what is wanted; those that would leave their limits stop."""
    step = np.zeros(rows.shape[1])
    left = dofs
    while len(left):
        part = rows[:, left]
        rest = step.copy()
        rest[left] = 0.0
        step[left] = part.T @ np.linalg.solve(part @ part.T + 1e-9 * np.eye(len(rows)), wanted - rows @ rest)
        beyond = (step[left] < lower[left]) | (step[left] > upper[left])
        if not beyond.any():
            break
        stopped = left[beyond]
        step[stopped] = np.clip(step[stopped], lower[stopped], upper[stopped])
        left = left[~beyond]
    return step

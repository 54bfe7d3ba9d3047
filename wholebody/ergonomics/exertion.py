"""Joint torques of weight and forces against strength, in the search and of a posture; compression of the low back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, brief, cross, with_values
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.ergonomics.angles import SIDES, check_person
from wholebody.ergonomics.work import LOAD
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.figures.strength import Shoulder, Strength, shoulders
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import ComputedTogether, Term, filled
from wholebody.tasks.distance import SumOfSquares
from wholebody.tasks.forces import GRAVITY, Force, Forces, Loads, point_rows, pressure, resolved

LEVER = 0.06
"""m: of the muscles of the back about the disc L5/S1. One muscle stands for all: 50 to 75 mm in the literature
(Chaffin, Andersson & Martin, "Occupational Biomechanics", chapter 6)."""

ROUND = 0.1  # N m: smaller moments than this of either side count as none, so that the derivative is continuous
FEET = ("left_sole", "right_sole")
MOST = 3400.0  # N: compression that NIOSH's action limit allows (1981)


def _strength(value: object, where: str) -> Strength:
    return checks.instance(value, Strength, where, "give wb.motion.Strength(percentile=50, sex='female')")


StrengthOf = Annotated[Strength, _strength]
_T = TypeVar("_T", bound="_HeldPerson")


class HeldArm(NamedTuple):
    """A shoulder, and what it holds."""

    place: int  # of the flexion among the joints with published strength
    shoulder: Shoulder
    arm: range  # joints of the arm


class Statics(NamedTuple):
    """Torques that hold a person under forces, and their derivatives.

    The ground's force is split over both soles by where it presses between them, seen from above, each part through a
    point as far from its sole as the whole from the line of both. Who sits, whose legs bear nothing, has none:
    torques of the legs are then those of hanging legs, and are left out.
    """

    loads: Loads
    body: range | None  # the person's joints in the model of several figures; None of one alone
    feet: tuple[inputs.Place, ...]  # the soles that bear, one or two; none for who sits
    joints: Indices  # (k,) in the tangent, of the joints with published strength
    carriers: Indices  # (k,) their joints in the model
    upper: Array  # (k,) greatest torque towards positive angles [N m]; infinite where none is published
    lower: Array  # (k,) least, negative
    back: tuple[int, int]  # joints of L5/S1, and of the next disc that has one
    arms: tuple[HeldArm, ...]

    def torques(self, state: State, joints: Indices, carriers: Indices) -> tuple[Array, Array]:
        """Torques (k,) of some joints [N m], and their derivative (k, nv)."""
        model, data = state.model, state.companion(Statics, state.model).data
        torque = np.array(pin.computeGeneralizedGravity(model, data, state.q))[joints]
        moves = np.array(pin.computeGeneralizedGravityDerivatives(model, data, state.q))[joints]
        for joint, point, rows, force, turn in self._acting(state):
            moment = cross(point, force)
            d_moment = cross(rows.T, force) + cross(point, turn.T)  # (nv, 3)
            reaches = state.support[joint][joints][:, None]
            linear, angular = state.columns[joints, :3], state.columns[joints, 3:]
            torque -= reaches[:, 0] * (linear @ force + angular @ moment)
            axis = np.hstack([cross(angular, force), cross(linear, force) + cross(angular, moment)])
            turned = (axis @ state.jacobian) * state.support[carriers]
            moves -= reaches * (turned + linear @ turn + angular @ d_moment.T)
        return torque, moves

    def _acting(self, state: State) -> list[tuple[int, Array, Array, Array, Array]]:
        """Of each force the joint, the point (3,) and its derivative (3, nv), the force (3,) and its derivative."""
        points, rows = self.loads.at(state)
        none = np.zeros((3, state.model.nv))
        found = [
            (one.joint, point, moves, force, none)
            for one, point, moves, force in zip(self.loads.places, points, rows, self.loads.vectors, strict=True)
        ]
        return found + (self._ground(state) if self.feet else [])

    def _ground(self, state: State) -> list[tuple[int, Array, Array, Array, Array]]:
        soles = [np.asarray(state.frame(one.frame).translation) for one in self.feet]
        moves = [point_rows(state, sole, one.joint) for sole, one in zip(soles, self.feet, strict=True)]
        middle, d_middle = np.mean(soles, axis=0), np.mean(moves, axis=0)
        height = float(middle[2])
        at, d_at = pressure(state, self.loads, self.body, height, d_middle[2])
        carried = self.body or range(1, state.model.njoints)
        weight = GRAVITY * sum(state.model.inertias[k].mass for k in carried)
        whole = np.array((0.0, 0.0, weight)) - self.loads.vectors.sum(axis=0)
        at, d_at = np.append(at, height), np.vstack([d_at, d_middle[2]])
        if len(soles) == 1:
            return [(self.feet[0].joint, at, d_at, whole, np.zeros_like(d_at))]
        (left, right), (d_left, d_right), level = soles, moves, np.array((1.0, 1.0, 0.0))
        line, d_line = level * (left - right), level[:, None] * (d_left - d_right)
        # m: soles nearer to each other, seen from above, count as so far apart
        length = max(float(line @ line), 0.01**2)
        share = float(line @ (at - right)) / length
        d_share = ((at - right) @ d_line + line @ (d_at - d_right) - 2.0 * share * (line @ d_line)) / length
        if not 0.0 < share < 1.0:
            share, d_share = min(max(share, 0.0), 1.0), np.zeros_like(d_share)
        off = at - share * left - (1.0 - share) * right
        d_off = d_at - share * d_left - (1.0 - share) * d_right - np.outer(left - right, d_share)
        return [
            (one.joint, foot + off, d_foot + d_off, part * whole, np.outer(whole, sign * d_share))
            for one, foot, d_foot, part, sign in (
                (self.feet[0], left, d_left, share, 1.0), (self.feet[1], right, d_right, 1.0 - share, -1.0)
            )
        ]  # fmt: skip

    def efforts(self, state: State) -> tuple[Array, Array]:
        """Torques (k,) as shares of the strength in their directions, with sign, and the derivative (k, nv)."""
        torque, moves = self.torques(state, self.joints, self.carriers)
        for one in self.arms:
            torque[one.place], moves[one.place] = self._across(state, one)
        limit = np.where(torque >= 0.0, self.upper, -self.lower)
        return torque / limit, moves / limit[:, None]

    def _across(self, state: State, one: HeldArm) -> tuple[float, Array]:
        """Torque of a shoulder about the axis across the upper arm [N m], and its derivative (nv,)."""
        carrier, placed = one.shoulder.abduction, state.data.oMi[one.shoulder.abduction]
        axis, at = placed.rotation @ one.shoulder.axis, placed.translation
        weight = np.array((0.0, 0.0, -GRAVITY * sum(state.model.inertias[k].mass for k in one.arm)))
        acting = [(state.center_of_mass(one.arm), state.center_of_mass_jacobian(one.arm), weight)]
        loads = zip(*self.loads.at(state), self.loads.vectors, self.loads.places, strict=True)
        acting += [(point, moves, force) for point, moves, force, load in loads if load.joint in one.arm]
        d_at = point_rows(state, at, carrier)
        moment = sum((cross(point - at, force) for point, _, force in acting), np.zeros(3))
        derivative = -sum(cross(force, axis) @ (moves - d_at) for _, moves, force in acting)
        about = np.r_[0, 0, 0, cross(axis, moment)][None]
        turned = state.rows(about, *np.array([[carrier], [0]], dtype=np.intp))[0]
        return -float(moment @ axis), derivative - turned

    def compression(self, state: State) -> tuple[float, Array]:
        """Compression of the disc L5/S1 [N], and its derivative (nv,)."""
        model, (low, high) = state.model, self.back
        first = int(model.joints[low].idx_v)
        joints = np.arange(first, first + 2, dtype=np.intp)  # flexion and lateral bending
        moment, d_moment = self.torques(state, joints, np.array((low, low + 1), dtype=np.intp))
        whole = float(np.sqrt(moment @ moment + ROUND**2))
        above = [k for k in range(low, model.njoints) if low in model.supports[k]]
        force = np.array((0.0, 0.0, -GRAVITY * sum(model.inertias[k].mass for k in above)))
        force += sum(
            (vector for one, vector in zip(self.loads.places, self.loads.vectors, strict=True) if one.joint in above),
            np.zeros(3),
        )
        a, b = (np.asarray(state.data.oMi[k].translation) for k in (low, high))
        along, d_along = b - a, point_rows(state, b, high) - point_rows(state, a, low)
        length = float(np.linalg.norm(along))
        unit = along / length
        d_unit = (d_along - np.outer(unit, unit @ d_along)) / length
        return (whole - ROUND) / LEVER - float(force @ unit), moment @ d_moment / (whole * LEVER) - force @ d_unit


def statics_of(scene: Scene, term: _HeldPerson) -> Statics:
    """What holds a scene's person, or one of several, under forces; standing, on both soles."""
    where, forces, person, standing = type(term).__name__, term.forces, term.person, term.standing
    joined, prefix = scene.figure, ""
    if person:
        checks.known(person, tuple(joined.members), "figure", f"{where}: person")
        prefix = f"{person}/"
    elif joined.members:
        raise InputError(f"{where}: the scene has several figures; name one, person={next(iter(joined.members))!r}")
    figure = check_person(joined.members[person].figure if person else joined, f"{where}: the scene's figure")
    if "spine1_flexion" not in figure.joints:
        raise InputError(f"{where}: takes a person with a spine; load one with wb.load('human')")
    body = joined.bodies[prefix] if person else None
    state, loads = State(scene.model), resolved(forces, scene, f"{where}: forces")
    if others := [one.frame for one in forces if not str(one.frame).startswith(prefix)]:
        raise InputError(
            f"{where}: forces act on {checks.some(others)}, which is no part of {person!r}; leave them out"
        )
    legs = [figure.joint_id(name) for name in figure.groups["legs"]] if not standing else []
    pairs = [(figure.model.joints[k].idx_v, scene.model.joints[joined.joint_id(prefix + name)].idx_v)
             for name in figure.joints if (k := figure.joint_id(name)) not in legs]  # fmt: skip
    own, there = np.array(pairs, dtype=np.intp).T
    lower, upper = (limit[own] for limit in term.strength.limits(figure))
    known = np.isfinite(lower) | np.isfinite(upper)  # of ankles one direction is
    joints = there[known]
    if standing:
        pressure(state, loads, body, 0.0)  # forces that lift are refused here
    arms = []
    for one in shoulders(joined, prefix):
        last = max(k for k in range(one.flexion, scene.model.njoints) if one.flexion in scene.model.supports[k])
        place = int(np.flatnonzero(joints == scene.model.joints[one.flexion].idx_v)[0])
        arms.append(HeldArm(place, one, range(one.abduction, last + 1)))
    return Statics(
        loads, body,
        tuple(inputs.find_place(scene, prefix + foot, where) for foot in FEET) if standing else (),
        joints, state.column_joint[joints], upper[known], lower[known],
        (joined.joint_id(f"{prefix}spine1_flexion"), joined.joint_id(f"{prefix}spine2_flexion")),
        tuple(arms),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _HeldPerson(Term):
    """What is asked of the torques that hold a person; fields as of `Exertion`."""

    forces: Forces = ()
    _: KW_ONLY
    strength: StrengthOf = Strength()  # noqa: RUF009
    standing: bool = True
    person: str = ""
    statics: Statics = field(init=False, repr=False)

    def resolve(self: _T, scene: Scene, start: Array) -> _T:
        """Look up the joints and their strength."""
        return filled(self, statics=statics_of(scene, self))


@dataclass(frozen=True, eq=False)
class Exertion(_HeldPerson, SumOfSquares):
    """Sum of the squared torques of joints over their strength: elbows go in, and who lifts comes near [no unit].

    Torques are those of the weight, the forces and, of somebody who stands, the ground (`Statics`). Joints without
    published strength do not count.

    Attributes:
        forces: on the person beside the weight.
        strength: of the person; by default the median of its sex and age.
        standing: whether both feet carry the person; False for who sits, whose legs do not count.
        person: whose torques, such as "anna", where the scene has several figures.
        weight: factor on the measure; 10 of it beside `Effort` is as strong as a habit.

    Raises:
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> light = wb.ergonomics.Exertion([wb.Force("right_palm", (0, 0, -50))], weight=10.0)
    """

    _: KW_ONLY
    weight: inputs.Weight = 1.0

    def curvature_of(self, rows: Array, state: State) -> Array:
        """(nv,) the diagonal of Gauss and Newton."""
        return np.asarray(2.0 * np.einsum("ij,ij->j", rows, rows) + 1e-6)

    def squares(self, state: State) -> tuple[Array, Array]:
        """The shares and their derivative."""
        return self.statics.efforts(state)


@dataclass(frozen=True, eq=False)
class StrengthLimit(_HeldPerson, ComputedTogether):
    """Keep joint torques within strength, and the compression of the disc L5/S1 within a bound.

    Rows are reserves: of the strength of each joint with published strength in either direction [share], and of the
    compression [kN].

    Attributes:
        forces: on the person beside the weight.
        strength, standing, person: as for `Exertion`.
        share: of the strength that may be used.
        compression: greatest of the disc L5/S1 [N]; None for no bound.

    Raises:
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> limit = wb.ergonomics.StrengthLimit([wb.Force("right_palm", (0, 0, -50))], share=0.5)
    """

    _: KW_ONLY
    share: Annotated[float, Range(0.01, 10.0)] = 1.0
    compression: Annotated[float, Range(100.0, 1e5, "N")] | None = MOST

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Array]:
        """(m,) reserves, and their derivative (m, nv)."""
        share, moves = self.statics.efforts(state)
        values, rows = [self.share - share, self.share + share], [-moves, moves]
        if self.compression is not None:
            found, row = self.statics.compression(state)
            values.append(np.array([1e-3 * (self.compression - found)]))
            rows.append(-1e-3 * row[None])
        return np.concatenate(values), np.vstack(rows)


def back_compression(figure: Figure, q: Array, forces: Sequence[Force] = ()) -> float:
    """Compression of the disc L5/S1 of a person in a posture (nq,) under weight and forces, N.

    One muscle of the back holds the moments of all that is above, with a lever of 60 mm; the weight and the forces
    above press along the spine beside it. NIOSH's action limit is 3400 N.

    Raises:
        InputError: no person, no posture, or no forces.
        UnknownNameError: a force on an unknown frame.

    Examples:
        >>> wb.ergonomics.back_compression(human, standing) < 1000.0
        True
    """
    person = check_person(figure, "back_compression: figure")
    q = checks.posture(q, person.model.nq, "back_compression: q")
    term = StrengthLimit(forces, standing=False).resolve(Scene(person), q)
    return term.statics.compression(State(person.model).update(q))[0]


@dataclass(frozen=True)
class StaticTorques:
    """Torques that hold a posture.

    Attributes:
        torque: joint -> torque, N m; positive towards positive angles.
        share: joint -> share of the strength in its direction, of the joints with published strength; more than 1 is
            more than the person can. Flexion of a shoulder: of the torque about the axis of `Shoulder`.
        compression: of the disc L5/S1, N, as `back_compression` has it.

    Examples:
        >>> held = wb.ergonomics.static_torques(human, standing, load=5.0)
        >>> max(held.share.values()) < 1.0
        True
    """

    torque: Mapping[str, float]
    share: Mapping[str, float]
    compression: float

    __repr__ = brief

    @property
    def worst(self) -> tuple[str, float]:
        """The joint nearest to its strength, and its share; ("", 0) without any."""
        return max(self.share.items(), key=lambda item: item[1], default=("", 0.0))

    def of_side(self, side: str) -> tuple[str, float]:
        """The same of the arm and the leg of "left" or "right"."""
        checks.choice(side, SIDES, "side")
        mine = {name: share for name, share in self.share.items() if name.startswith(f"{side}_")}
        return max(mine.items(), key=lambda item: item[1], default=("", 0.0))


def static_torques(
    figure: Figure, q: Array, *, load: float = 0.0, seated: bool = False, strength: Strength | None = None
) -> StaticTorques:
    """Torques that hold a posture and a load, as of `Exertion`.

    The weight of the body and of the load rests on the soles of the feet that are lowest. Of somebody seated it rests
    on the seat, so joints of the legs are left out.

    Args:
        figure: a person.
        q: (nq,) posture.
        load: mass in both hands together, half in each palm, kg.
        seated: whether a seat bears the weight.
        strength: of the person; the median of its sex and age if left out.

    Raises:
        InputError: no person, no posture, or a value out of range.

    Examples:
        >>> round(wb.ergonomics.static_torques(human, standing, load=10.0).torque["left_elbow_flexion"], 1)
        4.9
    """
    person = check_person(figure, "static_torques: figure")
    q = checks.posture(q, person.model.nq, "static_torques: q")
    person.warn_of_angles(q, "static_torques: q")
    load = LOAD(load, "static_torques: load")
    seated = checks.flag(seated, "static_torques: seated")
    strength = Strength() if strength is None else _strength(strength, "static_torques: strength")
    held = [Force(f"{side}_palm", (0.0, 0.0, -0.5 * GRAVITY * load)) for side in SIDES if load]
    statics = statics_of(Scene(person), Exertion(held, strength=strength, standing=not seated))
    state = State(person.model).update(q)
    low = min((state.frame(one.frame).translation[2] for one in statics.feet), default=0.0)
    # m: a sole that is higher over the lower one bears nothing
    bearing = tuple(one for one in statics.feet if state.frame(one.frame).translation[2] <= low + 0.03)
    statics = with_values(statics, feet=bearing)
    legs = person.groups["legs"] if seated else ()
    joints = {name: person.model.joints[person.joint_id(name)] for name in person.joints if name not in legs}
    names = {joint.idx_v: name for name, joint in joints.items() if joint.nv == 1}
    columns = np.array(list(names), dtype=np.intp)
    torque, _ = statics.torques(state, columns, state.column_joint[columns])
    share, _ = statics.efforts(state)
    return StaticTorques(
        dict(zip(names.values(), torque.tolist(), strict=True)),
        {names[column]: one for column, one in zip(statics.joints.tolist(), np.abs(share).tolist(), strict=True)},
        statics.compression(state)[0],
    )

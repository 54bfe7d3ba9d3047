"""Contact: a figure that sits on a seat, with its back at a backrest."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import NamedTuple

import coal
import numpy as np

from wholebody.base.arrays import Array, Indices, cross
from wholebody.base.checks import shown
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.axis import across
from wholebody.tasks.base import filled
from wholebody.tasks.contact_parts import (
    ContactTerm,
    Facing,
    Gap,
    Level,
    Made,
    Near,
    Over,
    Part,
    between,
    owner_pairs,
    through,
)
from wholebody.tasks.distance import SumOfSquares
from wholebody.tasks.faces import UP, Face, back_above, face
from wholebody.tasks.grips import Looking
from wholebody.tasks.surfaces import Surface, joined, once_by, outermost, segments_on, surface


@dataclass(frozen=True, eq=False)
class Sit(ContactTerm):
    """Sit on a thing, upright to either side, and with the back at another thing if there is one.

    Pelvis or thighs touch the seat, the middle of the pelvis is over the seat's upper face, its left side is level, and
    it is within 60 degrees of upright.
    With a back, the trunk touches it, the pelvis is near it, and the figure looks away from it. Use it as a goal or as
    a constraint. Hold the feet, or add `Stand(on=..., balance=False)`.

    Erect is as people are measured: hips, spine and neck are as in the posture "sitting", the thighs parallel, and the
    pelvis square to the seat, so that thighs are level on a level one. What has to be free above or beside the thighs
    or before the knees is then what dimensions of sitting people say; who may slouch or spread fits elsewhere too.

    Attributes:
        on: the seat: a thing, of which the highest broad face is sat on, or a piece of one such as "chair:2".
        back: what the back is at, the same thing where seat and backrest are one mesh; None for a stool.
        pelvis: the segment that sits.
        trunk: the last of the segments above the pelvis that may touch the back.
        erect: whether hips, spine and neck are held as people are measured.
        weight: factor on the squared error, as a goal [1/m^2 and 1/rad^2].

    Raises:
        InputError: a value of the wrong kind, shape or range; in a problem, a thing that is its own back has none.
        UnknownNameError: in a problem, a name that the scene does not have.

    Examples:
        >>> seated = wb.Sit(on="seat", back="backrest")
    """

    on: inputs.Name
    back: inputs.Name | None = None
    _: KW_ONLY
    pelvis: inputs.Name = "pelvis"
    trunk: inputs.Name = "thorax"
    erect: bool = False
    weight: inputs.Weight = 1.0

    @property
    def frame(self) -> str:
        """What sits."""
        return self.pelvis

    def resolve(self, scene: Scene, start: Array) -> Sit:
        """Find the surfaces and the seat's face."""
        where, things = f"Sit({shown(self.on)})", [self.on, *filter(None, [self.back])]
        key = type(self), self.on, self.back, self.pelvis, self.trunk, self.erect
        parts, touches = once_by(scene, things, where, start, key, partial(self._between, scene, where))
        return filled(self, parts=parts, touches=touches)

    def _between(self, scene: Scene, where: str, state: State, rest: State) -> Made:
        place, trunk = inputs.find_place(scene, self.pelvis, where), inputs.find_place(scene, self.trunk, where)
        seat = face(scene, self.on, UP, state, where)
        thighs = inputs.once(scene, ("thighs", place.joint, trunk.joint), lambda: _thighs(scene, place, trunk))
        bottom = joined(scene, self.pelvis, [self.pelvis, *thighs])
        if not bottom.pieces:
            raise InputError(f"{where}: {shown(self.pelvis)} has no pieces to sit on; name a segment with geometry")
        edge = np.maximum(seat.half - np.minimum(0.08, 0.5 * seat.half), 0.0)  # m: half a narrow seat
        # m: how much higher than on the deepest point of the pelvis and thighs the pelvis may sit
        deep = _depth(scene, self.pelvis, place, rest) + 0.01
        over = Over(place, seat, np.append(-edge, 0.0), np.append(edge, deep))  # 0: not below the seat
        left = _way(scene, place, rest, 1)
        # rad: how far the pelvis may tip; who lies on the belly touches a floor with it too
        upright = Looking(place, UP, np.pi / 3.0, level=False, axis=_way(scene, place, rest, 2))
        parts: list[Part] = [Gap(bottom, seat.surface, seat), over, upright]
        behind = [self.pelvis] if self.erect else []  # whoever sits erect has the buttocks at the back, too
        touches = owner_pairs(bottom.owners, seat.surface.owners)
        if self.back is None:
            parts.append(Level(place, left, seat))
        else:
            spine = (joint for joint in scene.model.supports[trunk.joint] if joint > place.joint)
            upper = joined(scene, self.trunk, [*behind, *segments_on(scene, spine)])
            side, at_back = self._at_back(scene, self.back, seat, state, where)
            to_left = _level(cross(UP, side.at(state)[1][2]), where)
            lower = joined(scene, self.pelvis, [self.pelvis])
            # m: how far the pelvis may be from the back; more, and the figure slouches
            parts += [Gap(upper, at_back, side), Near(lower, at_back, 0.06, side)]
            parts += [Facing(place, across(left), side, side.at(state)[1] @ to_left)]
            touches += owner_pairs([*upper.owners, *lower.owners], at_back.owners)
        if self.erect:
            parts += [Level(place, _way(scene, place, rest, 0), seat), self._measured(scene, place, where)]
        return tuple(parts), touches

    def _at_back(self, scene: Scene, back: str, seat: Face, state: State, where: str) -> tuple[Face, Surface]:
        """The face of the back that looks to the seat, and the surface of the back."""
        if back == self.on:
            return back_above(scene, back, seat, state, where)
        whole, middle = surface(scene, back, where), seat.at(state)[0]
        return face(scene, back, _level(middle - _middle(whole, state, middle), where), state, where), whole

    def _measured(self, scene: Scene, place: inputs.Place, where: str) -> AtAngles:
        """Hips, spine and neck as in the posture of people who are measured: sitting, with parallel thighs."""
        figure, body = scene.figure, self.pelvis.removesuffix("pelvis")
        names = [f"{body}spine", f"{body}neck", *(f"{body}{side}_leg" for side in ("left", "right"))]
        posture = f"{body}sitting"
        if (not body and "sitting" not in figure.postures) or not set(names) <= set(figure.groups):
            raise InputError(f"{where}: erect is for a person; leave it out, and hold joints by wb.Freeze")
        joints = [one for name in names for one in figure.groups[name] if "_leg" not in name or "hip_" in one]
        known = [scene.model.joints[figure.joint_id(one)] for one in joints]
        idx_q, idx_v = (
            np.array(each, dtype=np.intp) for each in zip(*((k.idx_q, k.idx_v) for k in known), strict=True)
        )
        parallel = dict.fromkeys((one for one in joints if "hip_abduction" in one), 0.0)
        return AtAngles(idx_q, idx_v, figure.with_joints(figure.posture(posture), parallel)[idx_q])


@dataclass(frozen=True, eq=False)
class SeatCenterline(SumOfSquares):
    """Squared distance of the pelvis to the side of a seat's middle, over half of the seat's longer side.

    So it counts on a chair and hardly on a bench, and not on what has no end; on a ball as on a seat of 0.2 m. A person
    who sits by `Sit` has this measure by default: else nothing says where on the seat, and of a task that is the same
    on the left and on the right the answer is beside the middle, on one side or on the other.

    Attributes:
        on: the seat.
        pelvis: the segment that sits.
        weight: factor on the measure.
        place: of the pelvis, once resolved.
        face: of the seat.
        left: (3,) to the left of who sits, in the axes of the pelvis.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a name that the scene does not have.

    Examples:
        >>> in_the_middle = wb.tasks.SeatCenterline("seat")
    """

    on: inputs.Name
    _: KW_ONLY
    pelvis: inputs.Name = "pelvis"
    weight: inputs.Weight = 20.0  # beside an effort of 20 for the clavicles, which turn where the middle is left
    place: inputs.Place = field(init=False, repr=False)
    face: Face = field(init=False, repr=False)
    left: Array = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> SeatCenterline:
        """Find the pelvis and the seat's face."""
        where = f"SeatCenterline({shown(self.on)})"
        place, key = inputs.find_place(scene, self.pelvis, where), (type(self), self.on, self.pelvis)

        def made(state: State, rest: State) -> tuple[Face, Array]:
            return face(scene, self.on, UP, state, where), _way(scene, place, rest, 1)

        seat, left = once_by(scene, [self.on], where, start, key, made)
        return filled(self, place=place, face=seat, left=left)

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residual (1,) and its derivative (1, nv)."""
        pelvis, middle = state.frame(self.place.frame), self.face.at(state)[0]
        long = max(float(self.face.half.max()), 0.1)  # m: what is round has a point for a face
        left = (pelvis.rotation @ self.left)[None]
        rows = between(state, through(middle, left), self.place.joint, self.face.joint)
        return left @ (pelvis.translation - middle) / long, rows / long


class AtAngles(NamedTuple):
    """Joints at angles: a row for each [rad]."""

    idx_q: Indices  # (k,) of the joints in the posture
    idx_v: Indices  # (k,) in the tangent vector
    angles: Array  # (k,)

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """All are."""
        return (True,) * len(self.idx_q)

    def rows(self, state: State) -> tuple[Array, Array]:
        """How far each is from its angle."""
        moves = np.zeros((len(self.idx_v), state.model.nv))
        moves[np.arange(len(self.idx_v)), self.idx_v] = 1.0
        return state.q[self.idx_q] - self.angles, moves


def _way(scene: Scene, place: inputs.Place, rest: State, axis: int) -> Array:
    """Ahead, to the left or up (3,), axis 0, 1 or 2, of who sits in the axes of the pelvis."""
    root = inputs.root_of(scene, place)  # in the first posture it looks ahead, wherever that is
    return np.asarray(rest.frame(place.frame).rotation.T @ rest.data.oMi[root].rotation[:, axis])


def _thighs(scene: Scene, pelvis: inputs.Place, trunk: inputs.Place) -> list[str]:
    """The first segments with pieces of each limb at the pelvis, without the trunk."""
    model, found = scene.model, []
    segments = set(scene.figure.segments)
    above = set(scene.model.supports[trunk.joint])
    carried = {
        int(piece.parentJoint): owner
        for owner, piece in zip(scene.piece_owner, scene.geometry.geometryObjects, strict=True)
        if owner in segments
    }
    for joint, owner in carried.items():
        chain = list(model.supports[joint])
        if pelvis.joint not in chain or joint == pelvis.joint or joint in above:
            continue
        between = chain[chain.index(pelvis.joint) + 1 : -1]
        if not any(other in carried for other in between) and not above.intersection(between):
            found.append(owner)
    return found


def _depth(scene: Scene, name: str, place: inputs.Place, state: State) -> float:
    """How far the pelvis reaches below its origin in the upright state, metres."""
    shape = joined(scene, name, [name])
    lows = [outermost(piece, shape.placed(k, state), -UP)[:, 2].min() for k, piece in enumerate(shape.shapes)]
    return float(state.frame(place.frame).translation[2] - min(lows))


def _middle(thing: Surface, state: State, other: Array) -> Array:
    """Mean (3,) of the origins of a thing's pieces; for a half-space the nearest point of its plane."""
    shape = thing.shapes[0]
    if isinstance(shape, coal.Halfspace):
        place = thing.placed(0, state)
        normal = place.rotation @ np.array(shape.n)
        return np.asarray(other - normal * (normal @ (other - place.translation) - float(shape.d)))
    return np.asarray(np.mean([thing.placed(k, state).translation for k in range(len(thing.shapes))], axis=0))


def _level(direction: Array, where: str) -> Array:
    """The horizontal part of a direction, as a unit vector."""
    flat = np.array((direction[0], direction[1], 0.0))
    length = float(np.linalg.norm(flat))
    if length < 1e-6:
        raise InputError(f"{where}: the back is right above the seat; give a back that stands behind it")
    return flat / length

"""Contact: a hand that takes a thing, by the palm, by a power grip or by the fingertips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.arrays import Array
from wholebody.checks import choice, shown
from wholebody.errors import InputError, UnknownNameError
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.axis import across
from wholebody.tasks.base import SupportingPlanes, Surroundings, filled
from wholebody.tasks.contact_parts import ContactTerm, Facing, Gap, Over, Part, one_sided, owner_pairs, through
from wholebody.tasks.surfaces import Face, Surface, carried_by, face, joined, outermost, segments_beyond, surface
from wholebody.tasks.touch import check_apart, named

KINDS = ("palm", "power", "pinch", "fingertips")
FINGERS = ("thumb", "index", "middle", "ring", "little")
MIDDLE = 0.8  # share of a face, about its middle, in which the palm may be
ALONG = 0.8  # share of a handle, about its middle, that the hand may take


@dataclass(frozen=True, eq=False)
class Grasp(ContactTerm):
    """Take hold of a thing with a hand.

    The frame of the grasp is the figure's frame "left_palm" or "right_palm": x along the fingers, y towards the thumb,
    z out of the palm.

    - "palm": the flat hand lies on a face of the thing. The hand touches it, z looks into the face, and the palm is
      over the face, a tenth within its edges. The hand may turn about z.
    - "power": the hand is around a bar: the thing's longest axis lies along y and crosses the palm, and the hand
      touches the thing. Where the hand has fingers, the two outer parts of each touch it too.
    - "pinch": the fingertips touch the thing: thumb and index finger from two sides where the figure has both,
      otherwise the tip of the index finger. Where the hand has fingers, their last parts touch it.
    - "fingertips": the last parts of all five fingers touch the thing; the hand needs fingers.

    Use it as a goal or as a constraint. The clearance between hand and thing is zero.

    Attributes:
        hand: "left" or "right", or the hand's segment.
        thing: what is taken.
        kind: "palm", "power", "pinch" or "fingertips".
        side: (3,) for a palm, direction in the world in which the face looks; by default a left hand takes the face on
            the figure's left, a right hand that on its right.
        weight: factor on the squared error, as a goal [1/m^2 and 1/rad^2].
        parts: the rows, once resolved.

    Raises:
        InputError: the hand is neither, the kind is another word, or the side has no direction.
    """

    hand: str
    thing: str
    kind: Literal["palm", "power", "pinch", "fingertips"] = "palm"
    _: KW_ONLY
    side: ArrayLike | None = None
    weight: float = 1.0
    parts: Sequence[Part] = field(init=False, repr=False)
    touches: tuple[tuple[str, str], ...] = field(init=False, repr=False, default=())

    def __post_init__(self) -> None:
        """Check the values."""
        where = f"Grasp({shown(self.hand)})"
        for name in (self.hand, self.thing):
            named(name, where)
        if self.hand.split("_")[0] not in ("left", "right"):
            raise InputError(f"{where}: hand is {shown(self.hand)}; give 'left' or 'right'")
        choice(self.kind, KINDS, f"{where}: kind")
        if self.side is not None:
            object.__setattr__(self, "side", inputs.direction(self.side, f"{where}: side"))
        object.__setattr__(self, "weight", inputs.weight(self.weight, f"{where}: weight"))

    @property
    def frame(self) -> str:
        """The frame of the grasp."""
        return f"{self._side}_palm"

    @property
    def _side(self) -> str:
        return self.hand.split("_")[0]

    def resolve(self, scene: Surroundings, start: Array) -> Grasp:
        """Find the hand, and the face, bar or sides that it takes.

        Raises:
            UnknownNameError: the figure has no such palm or fingertip, or there is no such thing.
            InputError: the thing is a frame, is carried by the same hand, or needs fingers that are missing.
        """
        where = f"Grasp({shown(self.hand)}, {shown(self.thing)})"
        place = inputs.find_place(scene, self.frame, where)
        hand, thing = carried_by(scene, self.hand, place.joint), surface(scene, self.thing, where)
        if thing.fixed is not None:
            raise InputError(f"{where}: {shown(self.thing)} is a frame; name a thing or a segment to take")
        if not hand.pieces:
            raise InputError(f"{where}: the hand of {shown(self.frame)} has no pieces; name one with geometry")
        check_apart(hand, thing, where)
        state = State(scene.model).update(start)
        if self.kind == "palm":
            parts = self._palm(scene, place, hand, thing, state, where)
        elif self.kind == "power":
            parts = _power(place, hand, thing, state, where)
            parts += [Gap(finger, thing) for finger in self._outer_parts(scene)]
        elif self.kind == "fingertips":
            parts = self._fingertips(scene, thing, where)
        else:
            parts = self._pinch(scene, thing, where)
        return filled(self, parts=tuple(parts), touches=owner_pairs(segments_beyond(scene, place.joint), thing.owners))

    def _palm(
        self, scene: Surroundings, place: inputs.Place, hand: Surface, thing: Surface, state: State, where: str
    ) -> list[Part]:
        if self.side is not None:
            outwards = np.asarray(self.side)
        else:
            sideways = np.array((0.0, 1.0 if self._side == "left" else -1.0, 0.0))
            outwards = _heading(scene, state) @ sideways
        taken = face(scene, self.thing, outwards, state, where)
        facing = Facing(place, across(np.array((0.0, 0.0, 1.0))), taken, np.array((0.0, 0.0, -1.0)))
        return [Gap(hand, thing), facing, Over(place, taken, -MIDDLE * taken.half, MIDDLE * taken.half)]

    def _pinch(self, scene: Surroundings, thing: Surface, where: str) -> list[Part]:
        ends = [f"{self._side}_{finger}_distal" for finger in ("index", "thumb")]
        if set(ends) <= set(scene.figure.segments):
            index, thumb = (surface(scene, end, where) for end in ends)
            return [Gap(index, thing), Gap(thumb, thing), Opposite(index, thumb, thing)]
        tips = [surface(scene, f"{self._side}_index_tip", where)]
        try:
            tips.append(surface(scene, f"{self._side}_thumb_tip", where))
        except UnknownNameError:
            return [Gap(tips[0], thing)]
        return [*(Gap(tip, thing) for tip in tips), Opposite(tips[0], tips[1], thing)]

    def _fingertips(self, scene: Surroundings, thing: Surface, where: str) -> list[Part]:
        ends = [f"{self._side}_{finger}_distal" for finger in FINGERS]
        if not set(ends) <= set(scene.figure.segments):
            raise InputError(
                f"{where}: kind 'fingertips' needs a hand with fingers; load the person with hands='fingers', "
                "or take the thing by kind 'pinch'"
            )
        return [Gap(surface(scene, end, where), thing) for end in ends]

    def _outer_parts(self, scene: Surroundings) -> list[Surface]:
        """Of each finger of the hand, its two outer parts; none of a hand that is one segment."""
        known = set(scene.figure.segments)
        found = []
        for finger in FINGERS:
            kinds = ("proximal" if finger == "thumb" else "middle", "distal")
            parts = [f"{self._side}_{finger}_{kind}" for kind in kinds]
            owned = [part for part in parts if part in known]
            if owned:
                found.append(joined(scene, f"{self._side}_{finger}", owned))
        return found


class Opposite(NamedTuple):
    """The middle of a thing on the line through two points: three rows, what is across the line [m].

    With a and b the points, c the middle and u the unit vector from a to b, the rows are (1 - u u') (c - a).
    """

    first: Surface
    second: Surface
    thing: Surface

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return False, False, False

    def rows(self, state: State) -> tuple[Array, Array]:
        """What is across the line, and forces."""
        a, b, c = self.first.placed(0, state).translation, self.second.placed(0, state).translation, self._middle(state)
        way = b - a
        length = max(float(np.linalg.norm(way)), 1e-9)
        u, arm = way / length, c - a
        flat = np.eye(3) - np.outer(u, u)
        # d(flat) arm = -(du (u . arm) + u (du . arm)), du = flat (db - da) / length
        turn = -((u @ arm) * flat + np.outer(u, flat @ arm)) / length
        joints = (self.first.joints[0], self.second.joints[0], self.thing.joints[0])
        blocks = zip((a, b, c), (-flat - turn, turn, flat), joints, strict=True)
        total = np.zeros((3, state.model.nv))
        for point, force, joint in blocks:
            wrench = through(point, force)
            total += state.rows(wrench, np.full(3, joint, dtype=np.intp), np.zeros(3, dtype=np.intp))
        return flat @ arm, total

    def _middle(self, state: State) -> Array:
        places = [self.thing.placed(k, state).translation for k in range(len(self.thing.shapes))]
        return np.asarray(np.mean(places, axis=0))


def _power(place: inputs.Place, hand: Surface, thing: Surface, state: State, where: str) -> list[Part]:
    """Rows of a hand around a bar.

    Raises:
        InputError: the thing has no longest axis.
    """
    at = thing.placed(0, state)
    bounded = [(shape, thing.placed(k, state)) for k, shape in enumerate(thing.shapes) if np.isfinite(thing.reach[k])]
    if not bounded:
        raise InputError(f"{where}: {thing.name!r} has no end, so no hand closes around it; take it by the palm")
    center, half = np.zeros(3), np.zeros(3)
    for axis, along in enumerate(at.rotation.T):
        ends = [outermost(shape, placed, sign * along) @ along for shape, placed in bounded for sign in (1.0, -1.0)]
        low, high = float(np.concatenate(ends).min()), float(np.concatenate(ends).max())
        center[axis], half[axis] = 0.5 * (low + high) - float(at.translation @ along), 0.5 * (high - low)
    longest = int(np.argmax(half))
    others = [k for k in range(3) if k != longest]
    # a "face" through the middle of the bar, whose normal is the bar's axis
    bar = Face(thing, center, np.array([*np.eye(3)[others], np.eye(3)[longest]]), half[others])
    facing = Facing(place, across(np.array((0.0, 1.0, 0.0))), bar, np.array((0.0, 0.0, 1.0)), either=True)
    room = ALONG * half[longest]
    return [Gap(hand, thing), facing, Crossing(place, bar, room)]


class Crossing(NamedTuple):
    """A bar that crosses the palm: one row across the palm, and one along the bar that is zero within its room [m].

    The first row is x . w, with x the axis of the fingers and w the way from the palm to the bar's axis.
    """

    place: inputs.Place
    bar: Face
    room: float

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return False, False

    def rows(self, state: State) -> tuple[Array, Array]:
        """The two rows, and wrenches."""
        value, rows = self._all(state)
        excess = value[1] - float(np.clip(value[1], -self.room, self.room))
        return np.array([value[0], excess]), np.array([rows[0], rows[1] if excess else np.zeros_like(rows[1])])

    def planes(self, state: State) -> SupportingPlanes:
        """The ends of the room along the bar."""
        value, rows = self._all(state)
        return one_sided(np.array([value[1], -value[1]]) - self.room, np.array([rows[1], -rows[1]]))

    def _all(self, state: State) -> tuple[Array, Array]:
        """What is across the palm and how far the bar's middle is along the bar (2,), and their derivative (2, nv)."""
        center, axes = self.bar.at(state)
        frame, along = state.frame(self.place.frame), axes[2]
        palm, fingers = frame.translation, frame.rotation[:, 0]
        way = center - palm
        level = fingers - (fingers @ along) * along  # x . (1 - l l') (c - p) = level . way
        reach = float(along @ way)
        # of the hand against the thing, seen from the thing: the hand's velocity v and rotation w
        wrench = through(palm, np.array([-level, -along]))
        wrench[0, 3:] += pin.skew(fingers) @ (way - reach * along)
        joints = np.full(2, self.place.joint, dtype=np.intp), np.full(2, self.bar.joint, dtype=np.intp)
        return np.array([level @ way, reach]), state.rows(wrench, *joints)


def _heading(scene: Surroundings, state: State) -> Array:
    """Rotation (3, 3) about z of the figure's root at the start; none for a fixed root."""
    figure = scene.figure
    if figure.root != "free":
        return np.eye(3)
    ahead = state.data.oMi[1].rotation[:, 0]
    length = float(np.hypot(*ahead[:2]))
    if length < 1e-6:
        return np.eye(3)
    c, s = ahead[0] / length, ahead[1] / length
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))

"""Contact: a hand that takes a thing, by the palm, by a power grip or by the fingertips."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from math import pi
from typing import Annotated, Literal

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import shown
from wholebody.base.errors import InputError
from wholebody.base.fields import Range, called
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.axis import across
from wholebody.tasks.base import filled
from wholebody.tasks.contact_parts import ContactTerm, Facing, Gap, Near, Over, Part, owner_pairs
from wholebody.tasks.faces import face
from wholebody.tasks.grips import Crossing, Looking, Oblique, Opposing, bar_of, holds, rim_of, rounded
from wholebody.tasks.surfaces import Surface, carried_by, joined, segments_beyond, surface
from wholebody.tasks.touch import check_apart

FINGERS = ("thumb", "index", "middle", "ring", "little")
MIDDLE = 0.8  # share of a face, about its middle, in which the palm may be
ALONG = 0.8  # share of a handle, about its middle, that the hand may take
CLOSED = 0.03  # m: the same of a pinch, and of fingers around a bar, which first close
THIN = 0.023  # m: thickness of a bar around which the thumb lies over the fingers
APPROACHES = {"overhand": -1.0, "underhand": 1.0, "side": 0.0}  # z of the direction in which the palm looks


@dataclass(frozen=True, eq=False)
class Grasp(ContactTerm):
    """Take hold of a thing with a hand.

    The frame of the grasp is the figure's frame "left_palm" or "right_palm": x along the fingers, y towards the thumb,
    z out of the palm.

    - "palm": the flat hand lies on a face of the thing. The hand touches it, z looks into the face, and the palm is
      over the face, a tenth within its edges. The hand may turn about z.
    - "power": the hand is around a bar: the thing's longest axis crosses the palm, and the hand touches the thing. It
      lies along y, or, where the hand is one segment, up to 20 degrees from y, nearer to the fingers on the thumb's
      side, as handles lie in a fist. A ring, such as a wheel, is held by its rim: anywhere in the quarter on the
      hand's side, turned to the hand if that holds it at the start, along the tangent there, with the palm outside of
      it, within 45 degrees. Where the hand has fingers, the two outer parts of each touch the thing too, and the thumb
      opposes the four fingers; around a bar thinner than 23 mm the thumb lies over the fingers, which oppose the palm.
      One thinner than 16 mm lies in the fingers: its far side is at most 16 mm from the palm.
    - "pinch": thumb and index finger touch the thing and oppose each other; their last parts where the figure has such
      segments, otherwise their tips, which have to move apart.
    - "fingertips": the last parts of all five fingers touch the thing, and the thumb opposes the others; the hand
      needs fingers.

    Two sides oppose where the normals of their contacts are antiparallel, within `opposed`; of several fingers the
    mean of the normals counts. Edges of boxes and hulls count as rounded.

    Use it as a goal or as a constraint. The clearance between hand and thing is zero.

    Attributes:
        hand: "left" or "right", or the hand's segment; "anna/left" of one of several figures.
        thing: what is taken.
        kind: "palm", "power", "pinch" or "fingertips".
        side: (3,) for a palm, direction in the world in which the face looks; by default a left hand takes the face on
            the figure's left, a right hand that on its right, and one that is at the thing at the start that which its
            palm looks into.
        opposed: largest angle of two sides from opposite, up to pi, where anything goes [rad].
        along: where the hand is along the thing's longest axis, from -1 at one end to 1 at the other; anywhere but the
            ends if left out. Not for a palm, and not for a ring.
        approach: "overhand", the palm looks down, "underhand", it looks up, or "side", it looks to the side, within 45
            degrees each; any if left out.
        weight: factor on the squared error, as a goal [1/m^2 and 1/rad^2].

    Raises:
        InputError: in a problem, a thing that the hand cannot take so.

    Examples:
        >>> grip = wb.Grasp("right", "handle", kind="power")
    """

    hand: inputs.Name
    thing: inputs.Name
    kind: Literal["palm", "power", "pinch", "fingertips"] = "palm"
    _: KW_ONLY
    side: inputs.Direction | None = None
    opposed: Annotated[float, Range(0.0, pi, "rad")] = pi / 4
    along: Annotated[float, Range(-1.0, 1.0)] | None = None
    approach: Literal["overhand", "underhand", "side"] | None = None
    weight: inputs.Weight = 1.0

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        if self._side not in ("left", "right"):
            raise InputError(f"{called(self)}: hand is {shown(self.hand)}; give 'left' or 'right'")
        if self.along is not None and self.kind == "palm":
            raise InputError(f"{called(self)}: along is for bars; a palm takes a face, so give its side")

    @property
    def frame(self) -> str:
        """The frame of the grasp."""
        return f"{self._own}_palm"

    @property
    def _side(self) -> str:
        return self._own.rpartition("/")[2]

    @property
    def _own(self) -> str:
        """What the names of the hand's frames and segments begin with: "left", "anna/left"."""
        figure, slash, hand = self.hand.rpartition("/")
        return f"{figure}{slash}{hand.split('_')[0]}"

    def resolve(self, scene: Scene, start: Array) -> Grasp:
        """Find the hand, and the face, bar or sides that it takes."""
        where = f"Grasp({shown(self.hand)}, {shown(self.thing)})"
        place = inputs.find_place(scene, self.frame, where)
        hand, thing = carried_by(scene, self.hand, place.joint), surface(scene, self.thing, where)
        if thing.fixed is not None:
            raise InputError(f"{where}: {shown(self.thing)} is a frame; name a thing or a segment to take")
        if not hand.pieces:
            raise InputError(f"{where}: the hand of {shown(self.frame)} has no pieces; name one with geometry")
        check_apart(hand, thing, where)
        with scene.figure.posed(start) as state:
            if self.kind == "palm":
                parts = self._palm(scene, place, hand, thing, state, where)
            elif self.kind == "power":
                parts = self._power(scene, place, hand, thing, state, where)
            else:
                parts = self._fingers(scene, thing, state, where)
        if self.approach is not None:
            height = APPROACHES[self.approach]
            up = np.array((0.0, 0.0, height or 1.0))
            # rad: of the palm from straight down, up or level, for the three directions of approach
            parts.append(Looking(place, up, pi / 4, level=not height))
        return filled(self, parts=tuple(parts), touches=owner_pairs(segments_beyond(scene, place.joint), thing.owners))

    def _palm(
        self, scene: Scene, place: inputs.Place, hand: Surface, thing: Surface, state: State, where: str
    ) -> list[Part]:
        outwards = self._outwards(scene, state) if self.side is None else np.asarray(self.side)
        if self.side is None and holds(hand, thing, state):
            outwards = -state.frame(place.frame).rotation[:, 2]
        taken = face(scene, self.thing, outwards, state, where)
        facing = Facing(place, across(np.array((0.0, 0.0, 1.0))), taken, np.array((0.0, 0.0, -1.0)))
        return [Gap(hand, taken.surface, taken), facing, Over(place, taken, -MIDDLE * taken.half, MIDDLE * taken.half)]

    def _power(
        self, scene: Scene, place: inputs.Place, hand: Surface, thing: Surface, state: State, where: str
    ) -> list[Part]:
        rim = rim_of(thing, hand, place, self._outwards(scene, state), state)
        if rim is not None and self.along is not None:
            raise InputError(f"{where}: along is for bars, and {shown(self.thing)} is a ring; leave it out")
        bar = bar_of(thing, state, where) if rim is None else rim
        low, high = self._room(float(bar.half[2]))
        fingers = self._outer_parts(scene)
        y, z = np.array((0.0, 1.0, 0.0)), np.array((0.0, 0.0, 1.0))
        # rad: in a fist a handle is 102 (standard deviation 7) degrees from the forearm of a straight wrist (Barter,
        # Emanuel and Truett 1957, recalled). Fingers with joints close around it squarely.
        oblique = np.radians(20.0) if self._side == "left" else -np.radians(20.0)
        turned = Oblique(place, bar, min(0.0, oblique), max(0.0, oblique))
        thickness = 2.0 * float(bar.half[1])
        # m: thumb and fingers close around a bar of 5 cm that crosses the palm's middle. Thinner ones lie beside it,
        # and thicker ones, around which the thumb reaches less.
        room = (0.05 - thickness if thickness < 0.05 else 0.03) if fingers and thickness >= THIN else 0.0
        parts: list[Part] = [
            # m: thickness that closed fingers leave in front of the palm; a thinner bar lies in the fingers
            Near(hand, thing, 0.016 - thickness) if fingers and thickness < 0.016 else Gap(hand, thing),
            Facing(place, across(y), bar, z, either=True) if fingers else turned,
            Crossing(place, bar, low, high, room),
        ]
        if rim is not None:
            # each within a quarter: of the tube the palm is outside, and of the ring on the hand's side
            parts += [Over(place, each, np.zeros(2), np.full(2, np.inf)) for each in (rim, rim.ring)]
        parts += [Gap(finger, thing) for finger in fingers.values()]
        thumb = fingers.pop("thumb", hand)
        if others := tuple(fingers.values()):
            first = thumb if thickness >= THIN else hand
            # lever [m]: shorter, and fingers around a thick bar do not turn; longer, and one stays away from a thin bar
            parts.append(Opposing(first, others, thing, rounded(thing), float(self.opposed), CLOSED, lever=0.05))
        return parts

    def _fingers(self, scene: Scene, thing: Surface, state: State, where: str) -> list[Part]:
        """Of a pinch or of all fingertips: they touch, and the thumb opposes the others."""
        known = set(scene.figure.segments)
        wanted = FINGERS if self.kind == "fingertips" else FINGERS[:2]
        ends = [f"{self._own}_{finger}_distal" for finger in wanted]
        if not set(ends) <= known and self.kind == "fingertips":
            raise InputError(
                f"{where}: kind 'fingertips' needs a hand with fingers; load the person with hands='fingers', "
                "or take the thing by kind 'pinch'"
            )
        if not set(ends) <= known:
            ends = [f"{self._own}_{finger}_tip" for finger in wanted]
            missing = [end for end in ends if not scene.model.existFrame(end)]
            if missing:
                raise InputError(
                    f"{where}: kind 'pinch' needs a thumb and an index finger that oppose each other, and "
                    f"{scene.figure.name} has no {shown(missing[0])}; use Touch for a single finger"
                )
            if len({inputs.find_place(scene, end, where).joint for end in ends}) == 1:
                raise InputError(
                    f"{where}: kind 'pinch' needs a thumb that moves against the index finger, and those of "
                    f"{scene.figure.name} are one piece; load the person with hands='fingers', or use Touch for a "
                    "single finger"
                )
        thumb, *others = (surface(scene, end, where) for end in ends)
        parts: list[Part] = [Gap(finger, thing) for finger in (thumb, *others)]
        # m: distance of the farthest of fingertips from which they begin to oppose the thumb
        far = CLOSED if self.kind == "pinch" else 0.1
        parts.append(Opposing(thumb, tuple(others), thing, rounded(thing), float(self.opposed), far, lever=0.02))
        bar = bar_of(thing, state, where) if np.isfinite(thing.reach).all() else None
        # ratio of its longest to its next half size from which a thing that is taken by fingertips has ends
        if bar is not None and (self.along is not None or bar.half[2] > 2.0 * bar.half[1]):
            low, high = self._room(float(bar.half[2]))
            lengthwise = with_values(bar, axes=bar.axes[::-1])
            tip = inputs.find_place(scene, f"{self._own}_index_tip", where)
            parts.append(Over(tip, lengthwise, np.array([low]), np.array([high])))
        return parts

    def _outwards(self, scene: Scene, state: State) -> Array:
        """Direction (3,) in the world to the hand's side, by the heading of its figure's root at the start."""
        left = 1.0 if self._side == "left" else -1.0
        root = inputs.root_of(scene, inputs.find_place(scene, self.frame, "Grasp"))
        ahead = state.data.oMi[root].rotation[:2, 0] if root else np.zeros(2)
        length = float(np.hypot(*ahead))
        x, y = ahead / length if length >= 1e-6 else (1.0, 0.0)
        return np.array((-left * y, left * x, 0.0))

    def _room(self, half: float) -> tuple[float, float]:
        """Where the hand may be along a bar, from its middle [m]."""
        if self.along is None:
            return -ALONG * half, ALONG * half
        return float(self.along) * half, float(self.along) * half

    def _outer_parts(self, scene: Scene) -> dict[str, Surface]:
        """Of each finger of the hand, its two outer parts; none of a hand that is one segment."""
        found = {}
        for finger in FINGERS:
            kinds = ("proximal" if finger == "thumb" else "middle", "distal")
            parts = {f"{self._own}_{finger}_{kind}" for kind in kinds}
            if owned := parts.intersection(scene.figure.segments):
                found[finger] = joined(scene, f"{self._own}_{finger}", owned)
        return found

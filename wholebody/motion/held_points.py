"""Points of a figure that rest where those of a skeleton rest: heels, toes, hands and knees, frame by frame.

A point goes over to the place where it rests before it does, and away from it afterwards. The sole of a rigid foot
keeps its length: of heel and toes, what rests first says where the other one comes down. What touches a thing goes
with it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask, brief, with_values
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import swept_points
from wholebody.motion.posture_fit import CLEARANCE
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.standing_ground import MOST_FRAMES, Foothold, Ground
from wholebody.motion.structure import upright
from wholebody.motion.thing_contacts import ThingContact, Things, thickness
from wholebody.motion.windows import long_runs, runs

FIRM, STRONG = 24.0, 48.0  # s, weights of what rests, over the time step, in the first pass and later; 1 of a bone
NEARING, SWING = 30.0, 0.3  # weights of what nearly rests, and of a sole between
TOUCH = 100.0  # of what touches a thing
LANDING = 3.0  # weight in the frame in which a point comes down, where contact decides
BESIDE = np.array([0.1, 0.1, 1.0])  # shares of that weight: soles that meet come down beside each other
STEP = 0.3  # m: a surface higher than this above the recording's ground is not what a sole comes down on
SOLE = 0.002  # m: what is lower than this above a foot's lowest point is its sole
FACING = 0.3  # least cosine of the angle from up to the normal of a sole that faces the ground
FOLLOW = 0.8  # share of the body's shift that a new place keeps; the rest goes back with time
KEPT_OFF = 0.03  # m: largest distance at which a thing keeps a point from its place of contact
LOST = 0.02  # m: points farther than this from their place on a thing cannot reach it
OVER = 0.2  # s: in which a point goes over to where it rests
AHEAD = 0.4  # s before a rest in which it is known: more leads longer swings to it, and postures come out later


@dataclass(frozen=True, eq=False)
class HeldPoint:
    """A point of a figure that may rest."""

    __repr__ = brief

    role: str  # of the skeleton's joint by which it rests
    foot: str  # "left" or "right" for a point of a sole, which comes down to the ground; else ""
    joint: int  # index of the joint that carries it
    place: Array  # (3,) in the joint's frame, metres
    edge: bool = False  # whether it is on the edge of a sole, so that its height alone counts: soles come down flat
    thing: bool = False  # whether it touches things, and not the ground


def held_points(figure: Figure, roles: Roles, ground: Ground) -> list[HeldPoint]:
    """The points of a figure that rest at some time."""
    found, resting = [], {role for role, mask in ground.rests.items() if mask.any()}
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, upright(figure))
    for side in ("left", "right"):
        heel, toe = f"{side}_ankle", f"{side}_toe"
        if heel in roles.frames:
            soles = _sole(figure, data, side, roles.frames[heel])
            told = toe if toe in ground.rests else heel  # without toes the sole rests as the ankle does
            for role, (joint, *places) in zip((heel, told), soles, strict=True):
                if {heel, told} & resting:
                    found += [HeldPoint(role, side, joint, place, edge=k > 0) for k, place in enumerate(places)]
        for role in (f"{side}_{part}" for part in ("hand", "wrist", "knee")):
            if role in resting and role in roles.frames:
                frame = figure.model.frames[figure.frame_id(roles.frames[role])]
                found.append(HeldPoint(role, "", int(frame.parentJoint), np.array(frame.placement.translation)))
    return found


def touching_points(
    figure: Figure, roles: Roles, motion: SkeletonMotion, contacts: Sequence[ThingContact], joints: Mapping[str, str]
) -> list[HeldPoint]:
    """The points of a figure that touch things: of a hand as far from the wrist as the skeleton's joint is.

    `joints` are those of the skeleton's roles, of which the figure may lack hands: these go on along the forearm.
    """
    found, data = [], figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, upright(figure))
    places = {role: np.array(data.oMf[figure.frame_id(frame)].translation) for role, frame in roles.frames.items()}
    for role in dict.fromkeys(one.role for one in contacts):
        elbow, wrist = role.replace("hand", "elbow"), role.replace("hand", "wrist")
        carrier = role if role in places else wrist
        place = places[carrier]
        if role.endswith("hand") and {elbow, wrist} <= places.keys():
            forearm = places[wrist] - places[elbow]
            way = place - places[wrist] if carrier == role else forearm
            hand, own = _length(motion, joints, wrist, role), float(np.linalg.norm(forearm))
            far = hand / _length(motion, joints, elbow, wrist) * own
            most = float(np.linalg.norm(way)) if carrier == role else np.inf
            place = places[wrist] + min(far, most) / max(float(np.linalg.norm(way)), 1e-9) * way
        joint = int(figure.model.frames[figure.frame_id(roles.frames[carrier])].parentJoint)
        found.append(HeldPoint(role, "", joint, np.array(data.oMi[joint].actInv(place)), thing=True))
    return found


def _sole(figure: Figure, data: pin.Data, side: str, ankle: str) -> list[tuple[int, Array, Array, Array]]:
    """Joint, and in it the middle, left and right place of the heel and of the front of a sole."""
    joint = int(figure.model.frames[figure.frame_id(ankle)].parentJoint)
    joint = next(
        (
            int(figure.model.frames[figure.frame_id(name)].parentJoint)
            for name in (f"{side}_heel",)
            if name in figure.frames
        ),
        joint,
    )
    corners = [np.array(data.oMi[joint].translation)[None]]
    for piece in figure.geometry.geometryObjects:
        if piece.parentJoint == joint:
            swept, at = swept_points(piece.geometry), data.oMi[joint] * piece.placement
            if len(swept.points):
                corners.append(swept.points @ at.rotation.T + at.translation - [0.0, 0.0, swept.radius])
    every = np.concatenate(corners)
    low = every[every[:, 2] <= every[:, 2].min() + SOLE]
    (back, right), (front, left) = low[:, :2].min(axis=0), low[:, :2].max(axis=0)
    found = []
    for x in (back, front):
        places = np.array([[x, 0.5 * (left + right)], [x, left], [x, right]])
        found.append((joint, *(data.oMi[joint].actInv(np.array([*place, every[:, 2].min()])) for place in places)))
    return found


def _length(motion: SkeletonMotion, joints: Mapping[str, str], first: str, last: str) -> float:
    """Metres from one joint of a skeleton to another, in the middle of its frames; never zero."""
    start, end = (motion.positions[:, motion.names.index(joints[role])] for role in (first, last))
    return max(float(np.median(np.linalg.norm(end - start, axis=1))), 1e-6)


class Touched:
    """What a figure touches, and with which side."""

    def __init__(self, figure: Figure, things: Things, contacts: Sequence[ThingContact]) -> None:
        self.things, self.contacts, self._figure = things, contacts, figure
        self._data = figure.model.createData()

    def held(self, contact: ThingContact, point: HeldPoint, q: Array) -> Array:
        """(3,) where a point is held in a thing's axes, by the thickness of the part on the side that touches it."""
        pin.forwardKinematics(self._figure.model, self._data, q)
        at = self._data.oMi[point.joint]
        into = at.rotation.T @ self.things.at(contact.thing, contact.first).rotation @ -contact.normal
        pieces = [piece for piece in self._figure.geometry.geometryObjects if piece.parentJoint == point.joint]
        return contact.place + (thickness(pieces, point.place, into) + CLEARANCE) * contact.normal


class Holds:
    """Where each of `points` is to be in each frame, and with which weight."""

    def __init__(
        self,
        points: list[HeldPoint],
        ground: Ground,
        scale: float,
        dt: float,
        surface: Callable[[Array], float | None] | None,
        touched: Touched | None = None,
    ) -> None:
        """Take the points that rest at some time, the ground that says when, and what is touched."""
        # `scale` are metres of the figure for each metre of height of the recording's ground; `surface` is the height
        # of the highest surface below a place (3,), None for the recording's ground.
        self.points, self._scale, self._surface, self._touched = points, scale, surface, touched
        self.over, self.ahead = max(1, round(OVER / dt)), max(1, round(AHEAD / dt))
        self._dt = dt
        contacts = () if touched is None else touched.contacts
        # a part that touches a thing while it seems to rest on the ground rests on the thing
        apart = [
            rest
            for rest in ground.footholds
            if not any(one.role == rest.role and rest.first < one.end and one.first < rest.end for one in contacts)
        ]
        self._stands: list[list[Foothold | ThingContact]] = [
            [each for each in (contacts if point.thing else apart) if each.role == point.role] for point in points
        ]
        feet = sorted({point.foot for point in points if point.foot})
        self._soles = [[k for k, point in enumerate(points) if point.foot == foot] for foot in feet]
        self._ways: dict[tuple[int, int], Array] = {}  # by point and frame the place of the free fit
        self._places: dict[tuple[int, int], Array] = {}
        self._touching: dict[tuple[int, int], Array] = {}  # in things' axes, before these keep parts off
        self._beside: set[int] = set()  # points that were let go of in the first frame
        self._gone: dict[int, dict[int, float]] = {}  # by point and frame the metres to what it is to touch

    def lost(self, frame: int, places: Array, held: tuple[Array, Array]) -> bool:
        """Whether points (h, 3) are too far from the things that they are to touch; these are let go of in the frame.

        `held` are the goals and weights of the frame; those of what is let go of become zero.
        """
        goals, weights = held
        far = np.linalg.norm(places - goals, axis=1)
        gone = [k for k, one in enumerate(self.points) if one.thing and far[k] > LOST and weights[k, 0] == TOUCH]
        for known in self._gone.values():
            known.pop(frame, None)
        for number in gone:
            weights[number] = 0.0
            self._gone.setdefault(number, {})[frame] = float(far[number])
        return bool(gone)

    def give_up(self) -> str:
        """Split the contacts with things where points were let go of; says which, or nothing."""
        told, places = [], dict[tuple[int, int], Array]()
        for number, stands in enumerate(self._stands):
            gone, kept = self._gone.get(number, {}), list[Foothold | ThingContact]()
            for stand in stands:
                reached = np.array([frame not in gone for frame in range(stand.first, stand.end)])
                if not isinstance(stand, ThingContact) or reached.all():
                    kept.append(stand)
                    continue
                off = max(gone.get(frame, 0.0) for frame in range(stand.first, stand.end))
                told.append(f"{self.points[number].role} does not reach {stand.thing} by {1e3 * off:.0f} mm at most")
                came = self._places if reached[0] else self._touching
                own = came[number, stand.first]
                for part in runs(long_runs(reached, self.over)):
                    first = stand.first + part.first
                    kept.append(with_values(stand, first=first, end=stand.first + part.end))
                    places[number, first] = own.copy()  # each part lands by itself
            self._stands[number] = kept
        self._gone.clear()
        self._beside.clear()
        self._places = places if told else self._places  # recompute where feet come down
        return "; ".join(told)

    def rest(self, role: str, frame: int) -> None:
        """Points of a role rest on the lowest level from a frame on, of a stream."""
        for point, stands in zip(self.points, self._stands, strict=True):
            if point.role == role:
                stands.append(Foothold(role, frame, MOST_FRAMES, np.zeros(3), 0.0))

    def leave(self, role: str, frame: int) -> None:
        """They rest no more, from a frame on."""
        for point, stands in zip(self.points, self._stands, strict=True):
            if point.role == role:
                stands[-1] = with_values(stands[-1], end=frame)

    def finish(self, count: int) -> None:
        """No frame comes from `count` on: what rests there begins no more, and other rests end there."""
        self._stands = [
            [with_values(each, end=count) if each.end > count else each for each in stands if each.first < count]
            for stands in self._stands
        ]

    def moved(self, frame: int) -> Mapping[str, pin.SE3]:
        """Where the things that move are in a frame."""
        return {} if self._touched is None else self._touched.things.moved(frame)

    def begin(self, free: Mapping[int, Array]) -> None:
        """Take the postures (nq,) of the free fit by frame, which say which side of a part touches a thing."""
        self._free = free

    def goals(
        self, frame: int, paths: Mapping[int, Array], shift: Array, again: bool = False, span: int = 1
    ) -> tuple[Array, Array]:
        """Goals and weights (h, 3) of a frame; `paths` (h, 3) by frame without holds, `shift` (3,) of the body.

        Of every `span`-th frame the last one before a rest and the first one after it are at rest too, so that what
        lies between two of these frames is.
        """
        down, strong = self._facing_down(paths[frame]), (STRONG if again else FIRM) / self._dt
        goals, weights = np.array(paths[frame]), np.zeros((len(self.points), 3))
        for number, stands in enumerate(self._stands):
            after = bisect_right([stand.first for stand in stands], frame)
            around = [each for each in stands[max(0, after - 1) : after + 1] if each.first <= frame + self.ahead]
            if not around:
                continue
            nearest = [min(max(frame, stand.first), stand.end - 1) for stand in around]
            places = [
                self._place(number, stand, paths, shift, near) for stand, near in zip(around, nearest, strict=True)
            ]
            on = [k for k, stand in enumerate(around) if stand.first - span < frame < stand.end + span - 1]
            if on:
                goals[number] = places[on[0]]
                if self.points[number].thing:
                    weights[number] = TOUCH
                else:
                    weights[number] = LANDING * BESIDE if frame == around[0].first and not again else strong
            else:
                goals[number], share = self._swing(number, frame, nearest, places, paths)
                weights[number] = (
                    BESIDE * (SWING + (NEARING - SWING) * share) if self.points[number].foot else NEARING * share
                )
            if self.points[number].edge:
                weights[number, :2] = 0.0
            if not (down[number] or self.points[number].thing):
                weights[number, 2] = 0.0  # contact says how high
        return goals, weights

    def _swing(
        self, number: int, frame: int, nearest: list[int], places: list[Array], paths: Mapping[int, Array]
    ) -> tuple[Array, float]:
        """Where a point (3,) is to be between rests, and how near in time it is to one, from 0 to 1.

        Its way is led from one rest to the next; it comes to rest, and starts, slowly. `nearest` are their frames.
        """
        for near in nearest:
            if (number, near) not in self._ways:
                self._ways[number, near] = np.array(paths[near][number])
        led = [self._ways[number, near] for near in nearest]
        beside = [place - start for place, start in zip(places, led, strict=True)]
        gone = 0.0
        if len(nearest) == 2:
            start = max(nearest[0], nearest[1] - self.ahead)
            part = max(frame - start, 0) / (nearest[1] - start)
            gone = part * part * (3.0 - 2.0 * part)
        way = paths[frame][number]
        goal, most = way + (1.0 - gone) * beside[0] + gone * beside[-1], 0.0
        for near, start_of in zip(nearest, led, strict=True):
            share = 0.5 + 0.5 * np.cos(np.pi * min(abs(frame - near) / self.over, 1.0))
            goal, most = goal - share * (way - start_of), max(most, share)
        return goal, most

    def _facing_down(self, places: Array) -> Mask:
        """(h,) whether a point, at places (h, 3), is of a sole that faces the ground."""
        found = np.zeros(len(places), dtype=bool)
        for own in self._soles:
            back, left, right, front = places[own[:4]]
            (x, y, z), (u, v, w) = (front - back).tolist(), (left - right).tolist()
            up = x * v - y * u  # of the normal, the cross product of both
            found[own] = up > FACING * ((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + up**2) ** 0.5
        return found

    def landed(self, frame: int, places: Array) -> None:
        """Keep points where they came down, (h, 3), if a rest begins in this frame: contact may have kept them off."""
        for number, stands in enumerate(self._stands):
            stand = next((each for each in stands if each.first == frame), None)
            if isinstance(stand, ThingContact) and self._touched is not None:
                self._places[number, frame] = self._kept_off(number, stand, places[number])
            elif stand is not None:
                self._places[number, frame][:2] = places[number, :2]

    def _kept_off(self, number: int, stand: ThingContact, place: Array) -> Array:
        """(3,) where a point, now at a place (3,), is held in a thing's axes: the thing may keep it farther off."""
        assert self._touched is not None
        key, at = (number, stand.first), self._touched.things.at(stand.thing, stand.first)
        own = self._touching.setdefault(key, self._places[key].copy())
        if stand.first in self._gone.get(number, {}):  # nothing keeps it off
            if stand.first > 0:
                return np.array(own)
            self._beside.add(number)  # the first frame is solved again, to where there is room for the part
            return np.asarray(own + KEPT_OFF * stand.normal)
        if number in self._beside:  # and then from there to the thing itself
            self._beside.discard(number)
            return np.array(own)
        off = float(stand.normal @ (at.actInv(place) - own))  # beside the place that is touched nothing moves
        return np.asarray(own + min(max(off, 0.0), KEPT_OFF) * stand.normal)

    def _place(
        self, number: int, stand: Foothold | ThingContact, paths: Mapping[int, Array], shift: Array, frame: int
    ) -> Array:
        """(3,) where a point rests, decided when it is first asked for; on a thing, where that is in the frame."""
        known = self._places.get((number, stand.first))
        if isinstance(stand, ThingContact):
            assert self._touched is not None
            if known is None:
                known = self._touched.held(stand, self.points[number], self._free[stand.first])
                self._places[number, stand.first] = known
            return np.asarray(self._touched.things.at(stand.thing, frame).act(known))
        if known is not None:
            return known
        frames = range(stand.first, min(stand.end, stand.first + self.over))
        place: Array = np.mean([paths[frame][number] for frame in frames], axis=0) + FOLLOW * shift
        point = self.points[number]
        if point.edge:
            place[2] = self._height(place, stand)
        elif point.foot:
            for other, stands in enumerate(self._stands):
                before = [
                    each
                    for each in stands
                    if isinstance(each, Foothold)
                    and each.first <= stand.first < each.end
                    and (other, each.first) in self._places
                ]
                if (
                    self.points[other].foot == point.foot
                    and self.points[other].role != point.role
                    and not self.points[other].edge
                    and before
                ):
                    pivot = self._places[other, before[-1].first]
                    along = np.mean([paths[frame][number] - paths[frame][other] for frame in frames], axis=0)
                    length = float(np.linalg.norm(paths[frames[0]][number] - paths[frames[0]][other]))
                    rise = self._scale * (stand.height - before[-1].height)
                    flat = np.sqrt(max(length**2 - rise**2, 0.0)) / max(float(np.linalg.norm(along[:2])), 1e-9)
                    place = np.array([*(pivot[:2] + flat * along[:2]), 0.0])
            place[2] = self._height(place, stand)
        self._places[number, stand.first] = place
        return place

    def _height(self, place: Array, stand: Foothold) -> float:
        """Height at which a point of a sole comes down, metres."""
        told = self._scale * stand.height
        below = None if self._surface is None else self._surface(np.array([place[0], place[1], told + STEP]))
        return CLEARANCE + (told if below is None else below)

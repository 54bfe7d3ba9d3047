"""Where points of a figure rest, as those of a skeleton rest, frame by frame.

A point goes over to the place where it rests before it does, and away from it afterwards. The sole of a rigid foot
keeps its length: of heel and toes, what rests first says where the other one comes down. What touches a thing goes
with it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.posture_fit import CLEARANCE
from wholebody.motion.standing_ground import HANGS, MOST_FRAMES, Foothold, Ground
from wholebody.motion.surfaces import Surface
from wholebody.motion.thing_contacts import ThingContact
from wholebody.motion.touching import Touched
from wholebody.motion.windows import long_runs, runs

FIRM, STRONG = 24.0, 3.0  # s, s²: weights of what rests over the time step in the first pass, over its square later
NEARING, SWING = 30.0, 0.3  # weights of what nearly rests, and of a sole between
TOUCH = 200.0  # of what touches a thing
BESIDE = np.array([0.1, 0.1, 1.0])  # shares of these weights: soles that meet come down beside each other
STEP = 0.3  # m: a surface higher than this above the recording's ground is not what a sole comes down on
EDGE = 0.1  # m: by so much lower than elsewhere under a sole, a surface is beyond an edge
BY = 0.002  # m: a part that is nearer to a thing touches it
NEARLY = 3e-4  # m: by which the goal of a part that touches a thing is not moved
STEEP = 0.4, 0.8  # cosines from up to the normal of a sole on its toes: held at no height yet, and fully held
LAID = 4.0  # of the height of hands, knees and tips of toes that rest: bones, and contacts, say more
PALM = 0.04  # m: how high above toes that stand a hand, or wrist, is recorded that bears on the ground
OUT_OF_REACH = 0.02  # m: a part that is farther than this from its place on a thing is let go of
OVER = 0.2  # s: in which a point goes over to where it rests
LAG = 0.3  # of 1: more lets a climber's feet fall far behind its hands, which touch what the recorded ones do
SPAN = 0.034  # s between the frames of the first sweeps at most: more lets feet slide, less leaves jerk
AHEAD = 0.4  # s before a rest in which it is known: more leads longer swings to it, and postures come out later


class Holds:
    """Where each of `points` is to be in each frame, and with which weight."""

    def __init__(
        self,
        points: list[HeldPoint],
        ground: Ground,
        scale: float,
        dt: float,
        surface: Surface | None,
        touched: Touched | None = None,
        lag: float = LAG,
    ) -> None:
        """Take the points that rest at some time, the ground that says when, and what is touched."""
        # `lag` is the share of the body's shift from the free fit that a new place has.
        # `scale` are metres of the figure for each metre of height of the recording's ground; `surface` is the height
        # of the highest surface below a place (3,), None for the recording's ground.
        self.points, self._scale, self._surface, self._touched = points, scale, surface, touched
        self.over, self.ahead = max(1, round(OVER / dt)), max(1, round(AHEAD / dt))
        self._dt, self._lag = dt, lag
        self._floor = min(ground.lowest.values(), default=0.0)
        contacts = () if touched is None else touched.contacts
        self.touches = bool(contacts)  # whether parts touch things, or each other
        # a part that touches a thing while it seems to rest on the ground rests on the thing
        apart = [
            rest
            for rest in ground.footholds
            if not any(one.role == rest.role and rest.first < one.end and one.first < rest.end for one in contacts)
        ]
        self._stands: list[list[Foothold | ThingContact]] = [
            [one for one in contacts if (one.role, one.share, one.base) == (point.role, point.share, point.base)]
            if point.thing
            else [rest for rest in apart if rest.role == point.role]
            for point in points
        ]
        feet = sorted({point.foot for point in points if point.foot})
        self._soles = [[k for k, point in enumerate(points) if point.foot == foot] for foot in feet]
        # of feet that bend at their toes, which may be on their tips
        self._tips = {k for own in self._soles for k in own if points[k].joint != points[own[0]].joint}
        self._ways: dict[tuple[int, int], Array] = {}  # by point and frame the place of the free fit
        self._places: dict[tuple[int, int], Array] = {}
        self._gone: set[tuple[int, int]] = set()  # points and frames in which they do not reach their things
        # the same of all runs, with what is too short to be held between
        self.given_up: set[tuple[int, int]] = set()

    def lost(self, frame: int, q: Array, places: Array, held: tuple[Array, Array]) -> bool:
        """Whether points (h, 3) are too far from their things; then their goals and weights in `held` become zero."""
        self._gone -= {each for each in self._gone if each[1] == frame}
        for number, stand in self._touches(frame, held[1]):
            normal, gap, off = self._met(number, stand, frame, q, places, held[0])
            if np.hypot(np.linalg.norm(off - (off @ normal) * normal), gap) > OUT_OF_REACH:
                held[1][number] = 0.0
                self._gone.add((number, frame))
        return any(each[1] == frame for each in self._gone)

    def touch(self, frame: int, q: Array, places: Array, held: tuple[Array, Array]) -> None:
        """Move goals along the normals of things to where the points (h, 3) of a posture would be if parts touched."""
        # a part is as thick as it is turned; it turns little if goals move no more than they need to
        for number, stand in self._touches(frame, held[1]):
            normal, gap, way = self._met(number, stand, frame, q, places, held[0])
            off = float(normal @ way) + CLEARANCE - gap
            if frame != stand.first:
                off -= min(max(off, -NEARLY), NEARLY)
            held[0][number] += off * normal

    def _touches(self, frame: int, weights: Array) -> list[tuple[int, ThingContact]]:
        """Points that are held at things in a frame, by their numbers, and where."""
        return [
            (number, stand)
            for number, stands in enumerate(self._stands)
            for stand in stands
            if isinstance(stand, ThingContact) and stand.first <= frame < stand.end and weights[number, 0] == TOUCH
        ]

    def _met(
        self, number: int, stand: ThingContact, frame: int, q: Array, places: Array, goals: Array
    ) -> tuple[Array, float, Array]:
        """Of a contact in a frame its normal (3,), the distance of the parts, and the vector (3,) from its goal."""
        assert self._touched is not None
        gap = self._touched.gap(stand, self.points[number], frame, q)
        normal = self._touched.at(stand, frame).rotation @ stand.normal
        return normal, gap, places[number] - goals[number]

    def give_up(self) -> bool:
        """Split the contacts with things where points were let go of; says whether there were any."""
        places, found = dict[tuple[int, int], Array](), bool(self._gone)
        for number, stands in enumerate(self._stands):
            kept = list[Foothold | ThingContact]()
            for stand in stands:
                reached = np.array([(number, frame) not in self._gone for frame in range(stand.first, stand.end)])
                if not isinstance(stand, ThingContact) or reached.all():
                    kept.append(stand)
                    continue
                long = long_runs(reached, self.over)
                self.given_up |= {(number, stand.first + frame) for frame in np.flatnonzero(~long).tolist()}
                own = self._places[number, stand.first]
                for part in runs(long):
                    first = stand.first + part.first
                    kept.append(with_values(stand, first=first, end=stand.first + part.end))
                    places[number, first] = own.copy()  # each part lands by itself
            self._stands[number] = kept
        self._gone.clear()
        self._places = places if found else self._places  # recompute where feet come down
        return found

    def let_go(self, q: Array) -> str:
        """Which parts were let go of, or are farther than `OUT_OF_REACH` from their things in q (n, nq); or nothing."""
        reports, touched = list[str](), self._touched
        if touched is None:
            return ""
        for contact in touched.contacts:
            key = contact.role, contact.share, contact.base
            for number, point in enumerate(self.points):
                if not point.thing or (point.role, point.share, point.base) != key:
                    continue
                frames = range(contact.first, min(contact.end, len(q)))
                gaps = np.array([touched.gap(contact, point, frame, q[frame], alone=True) for frame in frames])
                gone = np.array([(number, frame) in self.given_up for frame in frames]) | (gaps > OUT_OF_REACH)
                if gone.any():
                    spans = [f"{contact.first + run.first} to {contact.first + run.end - 1}" for run in runs(gone)]
                    far = gaps[gone].max()
                    how = f"is up to {1e3 * far:.0f} mm away" if far > BY else "touches it at another place"
                    reports.append(
                        f"{contact.role} does not reach {contact.thing} in frames {' and '.join(spans)} "
                        f"(in the clip it {how})"
                    )
        return "; ".join(reports)

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
        """Goals and weights (h, 3) of a frame; `paths` (h, 3) by frame without holds, `shift` (3,) of the body."""
        # of every `span`-th frame those beside a rest are at rest too, so that what lies between them is
        strong = STRONG / self._dt**2 if again else FIRM / (span * self._dt)
        down = self._facing_down(frame, paths[frame])
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
            borne = [k for k, stand in enumerate(around) if not self._hangs(number, stand, places[k])]
            if not borne:
                continue
            around, nearest = [around[k] for k in borne], [nearest[k] for k in borne]
            places = [places[k] for k in borne]
            on = [k for k, stand in enumerate(around) if stand.first - span < frame < stand.end + span - 1]
            if on:
                goals[number] = places[on[0]]
                if self.points[number].thing:
                    weights[number] = 0.0 if again and (number, frame) in self._gone else TOUCH
                else:
                    weights[number] = NEARING * BESIDE if frame <= around[on[0]].first and not again else strong
            else:
                goals[number], share = self._swing(number, frame, nearest, places, paths)
                weights[number] = (
                    BESIDE * (SWING + (NEARING - SWING) * share) if self.points[number].foot else NEARING * share
                )
            if self.points[number].edge:
                weights[number, :2] = 0.0
            elif self.points[number].lifts:
                weights[number, 2] = 0.0
            if self.points[number].foot:
                # however steep their sole is, tips of toes that rest stay down
                least = min(weights[number, 2], LAID) if on and number in self._tips else 0.0
                weights[number, 2] = max(weights[number, 2] * down[number], least)  # contact says how high
            elif not self.points[number].thing:
                weights[number, 2] = min(weights[number, 2], LAID)
        return goals, weights

    def _bears(self, stand: Foothold | ThingContact) -> bool:
        """Whether a hand or a knee that rests is as low as one that bears on the ground."""
        low = isinstance(stand, Foothold) and stand.place[2] <= self._floor + stand.height + PALM
        return low or stand.role.endswith("knee")

    def _hangs(self, number: int, stand: Foothold | ThingContact, place: Array) -> bool:
        """Whether all surfaces of the scene below a place (3,) of a sole are far below where it rested."""
        if self._surface is None or not (isinstance(stand, Foothold) and self.points[number].foot):
            return False
        return bool(place[2] < self._scale * stand.height - HANGS)

    def _swing(
        self, number: int, frame: int, nearest: list[int], places: list[Array], paths: Mapping[int, Array]
    ) -> tuple[Array, float]:
        """Where a point (3,) is to be between rests at frames `nearest`, and how near in time it is, 0 to 1."""
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

    def _facing_down(self, frame: int, places: Array) -> Array:
        """(h,) shares by which the soles of points, at places (h, 3), face the ground: by degrees on toes alone."""
        found = np.zeros(len(places))
        for own in self._soles:
            back, left, right, front = places[own[:4]]
            (x, y, z), (u, v, w) = (front - back).tolist(), (left - right).tolist()
            up = x * v - y * u  # of the normal, the cross product of both
            cosine = up / max(((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + up**2) ** 0.5, 1e-12)
            share = min(max((cosine - STEEP[0]) / (STEEP[1] - STEEP[0]), 0.0), 1.0) ** 3
            flat = cosine > 0.3 and any(stand.first <= frame < stand.end for stand in self._stands[own[0]])
            found[own] = 1.0 if flat else share
        return found

    def landed(self, frame: int, places: Array, held: tuple[Array, Array], span: int) -> None:
        """Keep points (h, 3) where they came down, if a rest begins in `span` frames; on a thing, at the goal."""
        for number, stands in enumerate(self._stands):
            stand = next((each for each in stands if frame <= each.first < frame + span), None)
            if isinstance(stand, Foothold):
                self._places[number, stand.first][:2] = places[number, :2]
        for number, contact in self._touches(frame, held[1]):
            assert self._touched is not None
            at = self._touched.at(contact, frame)
            self._places[number, contact.first] = np.array(at.actInv(held[0][number]))

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
            return np.asarray(self._touched.at(stand, frame).act(known))
        if known is not None:
            return known
        frames = range(stand.first, min(stand.end, stand.first + self.over))
        # a new place keeps a share of the body's shift; the rest goes back with time
        place: Array = np.mean([paths[frame][number] for frame in frames], axis=0) + self._lag * shift
        point = self.points[number]
        if point.edge:
            place[2] = self._height(number, place, stand, paths, frames)
        elif point.foot:
            for other, end in enumerate(self.points):
                rests = [each for each in self._stands[other] if isinstance(each, Foothold)]
                before = [
                    each
                    for each in rests
                    if each.first <= stand.first < each.end and (other, each.first) in self._places
                ]
                if end.foot == point.foot and end.role != point.role and not end.edge and before:
                    pivot = self._places[other, before[-1].first]
                    along = np.mean([paths[frame][number] - paths[frame][other] for frame in frames], axis=0)
                    length = float(np.linalg.norm(paths[frames[0]][number] - paths[frames[0]][other]))
                    rise = self._scale * (stand.height - before[-1].height)
                    flat = np.sqrt(max(length**2 - rise**2, 0.0)) / max(float(np.linalg.norm(along[:2])), 1e-9)
                    place = np.array([*(pivot[:2] + flat * along[:2]), 0.0])
            place[2] = point.above + self._height(number, place, stand, paths, frames)
        elif self._touched is not None and self._bears(stand):
            rises = [self._touched.rise(point, self._free[frame]) for frame in frames]
            place[2] = CLEARANCE + self._scale * stand.height + np.mean(rises)
        self._places[number, stand.first] = place
        return place

    def _height(self, number: int, place: Array, stand: Foothold, paths: Mapping[int, Array], frames: range) -> float:
        """Height at which a point (3,) of a sole comes down, metres: of one beyond an edge, that of the sole on it."""
        level = self._scale * stand.height
        if self._surface is None:
            return CLEARANCE + level
        sole = next(own for own in self._soles if number in own)
        free = np.mean([paths[frame][sole] for frame in frames], axis=0)
        beside = place[:2] + free[:, :2] - free[sole.index(number), :2]
        middle = (stand.first + stand.end) // 2
        found = [self._surface(np.array([*at, level + STEP]), middle) for at in (place[:2], *beside)]
        known = [below for below in found if below is not None]
        if not known:
            return CLEARANCE + level
        own = known[0] if found[0] is not None else -np.inf
        return CLEARANCE + (own if own > max(known) - EDGE else max(known))

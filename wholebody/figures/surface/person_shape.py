"""The parts of a person's surface: clothes, head, hands and shoes around the person's pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Dimensions, Person
from wholebody.figures.body_spec import Solid
from wholebody.figures.human.details import SPREAD
from wholebody.figures.human.figure import figure_of
from wholebody.figures.human.spec import human_spec
from wholebody.figures.surface.fields import (
    Field,
    ball,
    ellipsoid,
    grown,
    half_space,
    intersection,
    placed,
    round_cone,
    union,
    without,
)
from wholebody.figures.surface.garments import Claim, Garment, Turn, bounds
from wholebody.figures.surface.hand_shape import hand_shape
from wholebody.figures.surface.head_shape import head_shape
from wholebody.figures.surface.profile import RAYS, caps, limb, piece_field, trunk

Color = tuple[float, float, float]


class _Colors(NamedTuple):
    """Red, green, blue."""

    skin: Color = (0.86, 0.66, 0.54)
    hair: Color = (0.25, 0.17, 0.12)
    lips: Color = (0.76, 0.50, 0.44)
    shirt: Color = (0.42, 0.55, 0.68)
    trousers: Color = (0.27, 0.30, 0.38)
    shoes: Color = (0.22, 0.18, 0.16)
    eyes: Color = (0.86, 0.84, 0.82)
    irises: Color = (0.26, 0.20, 0.15)


COLORS = _Colors()
TRUNK = ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax")
CLOTH = 0.003  # thickness of shirt and trousers, metres

SIDES = (("left", 1.0), ("right", -1.0))
HALVES = {"upper_arm": "clavicle", "forearm": "upper_arm", "hand": "forearm", "thigh": "pelvis", "shank": "thigh"}
"""Segments with a bone that turns half as much as they do against the segment named here: joints keep their volume."""


class PersonShape:
    """The garments of a person in the binding posture.

    Attributes:
        bind: placement (4, 4) of every segment in the world in the binding posture.
    """

    def __init__(self, person: Person) -> None:
        spec = human_spec(person)
        figure = figure_of(spec, "capsules")
        # The binding posture is half way between the ends of what people do, and no limbs touch.
        bent = {"shoulder_abduction": 42.0, "hip_abduction": 7.0, "elbow_flexion": 12.0}
        degrees = {f"{side}_{name}": angle for side, _ in SIDES for name, angle in bent.items()}
        q = figure.with_joints(pin.neutral(figure.model), {name: np.radians(angle) for name, angle in degrees.items()})
        data = figure.model.createData()
        pin.framesForwardKinematics(figure.model, data, q)
        self.person, self.size = person, Dimensions(person)
        self._scale = person.stature / 1.75  # lengths below are of a person of 1.75 m
        self.solids: tuple[Solid, ...] = tuple(one for one in spec.solids if not one.name.endswith(f"_thigh:{SPREAD}"))
        self.bind = {name: np.array(data.oMf[figure.frame_id(name)].homogeneous) for name in figure.segments}
        pieces = [
            placed(piece_field(solid), self.bind[solid.segment]) for solid in self.solids if solid.segment in TRUNK
        ]
        hips, neck = self.bind["pelvis"][2, 3], self.bind["neck"][2, 3]
        self._trunk = trunk(union(pieces), hips - 0.2, neck + 0.1, float(self.bind["upper_lumbar"][0, 3]))
        size, radius = self.size, 0.98 * person.radius("neck")
        chin = self.at("head", (size.head_x - 0.030 * self._scale, 0.0, size.head_bottom + 0.06 * self._scale))
        self._throat = round_cone(self.at("neck", (0.0, 0.0, -0.04)), chin, 1.06 * radius, 0.98 * radius)
        parts = {"clavicle", "upper_arm", "forearm", "thigh", "shank"}
        self._limbs = {name: self._limb_field(name) for name in self.bind if name.partition("_")[2] in parts}

    def garments(self) -> Iterator[Garment]:
        """Make the fields of all parts."""
        yield self._shirt()
        yield self._trousers()
        yield from self._head()
        for side, sign in SIDES:
            yield self._hand(side)
            yield self._shoe(side, sign)

    def at(self, segment: str, point: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Array:
        """A point (3,) of a segment in the world."""
        return np.asarray(self.bind[segment][:3, :3] @ np.asarray(point) + self.bind[segment][:3, 3])

    # ---- fields of segments

    def _limb_field(self, segment: str) -> Field:
        """Round cones through the balls of a segment's pieces, from joint to joint."""
        side, _, part = segment.partition("_")
        balls = caps(self.solids, segment)
        if part == "clavicle":
            return placed(limb(balls), self.bind[segment])
        if part == "thigh":
            # Girth of the lower thigh: 1.06 times the calf's (ANSUR II: 1.04 of men, 1.07 of women). It is put higher
            # than it is measured, because the seated knee is not to become higher.
            radius, length = 1.06 * self.person.radius("calf"), self.person.length(segment)
            (back, _, _), knee = balls[-2]
            above = np.array([back + radius - knee, 0.0, -0.70 * length])  # the underside is level with the seat
            balls[-2:-1] = [(above, radius), (np.array([back, 0.0, -0.88 * length]), knee)]
        child = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shank", "shank": "foot"}[part]
        end = np.linalg.inv(self.bind[segment]) @ [*self.at(f"{side}_{child}"), 1.0]
        (_, first), (_, last) = balls[0], balls[-1]
        start, top = (0.95 * first, -0.015) if part == "thigh" else (first, 0.0)
        if part == "upper_arm":
            start = min(first, 1.3 * self.person.size("shoulder_top"))
        if part == "shank":
            start = caps(self.solids, f"{side}_thigh")[-1][1]
            del balls[0]  # the bone below the knee, around which there is flesh
        # Around the elbow the joint is nearer to the skin than to the middle of the arm: the pieces end there.
        before = [] if part == "forearm" else [(np.array([0.0, 0.0, top]), start)]
        after = [] if part == "upper_arm" else [(end[:3], last)]
        return placed(limb([*before, *balls, *after], 0.040), self.bind[segment])

    def _claims(self, segments: Sequence[str]) -> list[Claim]:
        """Claims of limbs by their fields, of the trunk's segments by their heights, of halves at the joints."""
        found = []
        edges = [*(float(self.bind[name][2, 3]) for name in TRUNK), np.inf]
        edges[0] = -np.inf
        for name, low, high in zip(TRUNK, edges, edges[1:], strict=False):
            if name in segments:
                found.append(Claim(name, _between(self._trunk, low, high)))
        for segment in segments:
            side, _, part = segment.partition("_")
            if part == "upper_arm":
                # the shoulder's end of the arm turns with the shoulder: with the arm it would hang below a raised one
                edges = [0.035 * self._scale, *(np.array((0.4, 0.7, 2.0)) * self.person.length(segment))]
                for name, start, end in zip(("/swing", "/middle", ""), edges, edges[1:], strict=False):
                    part_of_it = intersection(self._limbs[segment], self._stretch(segment, start, end))
                    found.append(Claim(segment + name, part_of_it, 0.020))
                found.append(Claim("thorax", grown(self._armpit(side)[1], -0.006), 0.022))
            elif segment in self._limbs:
                found.append(Claim(segment, self._limbs[segment], 0.014))
            if part == "clavicle":
                found.append(Claim(segment, self._trapezius(side)))
            if segment == "neck":
                low, high = (float(self.bind[name][2, 3]) for name in ("neck", "head"))
                found.append(Claim(segment, _between(self._throat, low, high)))
            if part == "thigh":
                found.append(Claim("pelvis", self._buttock(dict(SIDES)[side])))
                found.append(Claim(f"{segment}/half", self._spread(dict(SIDES)[side])))
            if part in HALVES:
                thigh = 0.335 * self.person.size("thigh_clearance") / self._scale
                radius = {"upper_arm": 0.035, "forearm": 0.020, "hand": 0.026, "thigh": thigh, "shank": 0.030}[part]
                reach = radius * self._scale
                found.append(Claim(f"{segment}/half", grown(ball(self.at(segment), reach), 0.006)))
        return found

    def _stretch(self, segment: str, start: float, end: float) -> Field:
        """What lies along a segment between two distances from its joint."""
        down = self.bind[segment][:3, 2]
        beyond = half_space(self.at(segment, (0.0, 0.0, -start)), down)
        return intersection(beyond, half_space(self.at(segment, (0.0, 0.0, -end)), -down))

    # ---- garments

    def _shirt(self) -> Garment:
        size, scale = self.size, self._scale
        neck = self.at("neck")
        solids = [self._trunk, self._throat]
        for side, sign in SIDES:
            solids += [
                self._limbs[f"{side}_clavicle"],
                union([self._limbs[f"{side}_upper_arm"], self._limbs[f"{side}_forearm"], self._elbow(side)], 0.004),
                self._trapezius(side),
                *self._armpit(side),
            ]
            if size.body.sex == "female":
                height = float(self.at("thorax")[2])
                front = self._trunk_ends(height - 0.01 * scale)[1]
                middle = (front - 0.044 * scale, sign * 0.074 * scale, height - 0.014 * scale)
                solids.append(ellipsoid(middle, np.array([0.062, 0.066, 0.064]) * scale))
        body = grown(union(solids, 0.035 * scale), CLOTH)
        hem = half_space((0.0, 0.0, self._belt() - 0.022 * scale), (0.0, 0.0, -1.0))
        cuts = [hem, self._collar(0.0)]
        for side, _ in SIDES:
            wrist, elbow = self.at(f"{side}_hand"), self.at(f"{side}_forearm")
            along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
            cuts.append(half_space(wrist - 0.022 * scale * along, along))
        segments = [*TRUNK, "neck", *self._sided("clavicle", "upper_arm", "forearm")]
        points = [self.at(name) for name in [*segments, *self._sided("hand")]]
        points += [np.array([0.1, 0.0, self._belt() - 0.04]), np.array([-0.1, 0.0, neck[2] + 0.06])]
        low, high = bounds(points, 0.085 * scale + 0.05)
        return Garment("shirt", COLORS.shirt, body, low, high, 0.020, self._claims(segments), cuts)

    def _elbow(self, side: str) -> Field:
        """What fills the groove between the ends of upper arm and forearm."""
        upper, fore = f"{side}_upper_arm", f"{side}_forearm"
        (above, first), (below, last) = caps(self.solids, upper)[-1], caps(self.solids, fore)[0]
        return round_cone(self.at(upper, above), self.at(fore, below), first, last)

    def _trapezius(self, side: str) -> Field:
        """The slope from the side of the neck to the end of the shoulder."""
        scale, sign = self._scale, dict(SIDES)[side]
        radius = self.person.radius("neck")
        high = self.at("neck", (-0.4 * radius, 0.4 * sign * radius, 0.016 * scale))
        low = self.at(f"{side}_upper_arm") + np.array([-0.006, -sign * 0.016, 0.004]) * scale
        return round_cone(high, low, 0.45 * radius, 0.034 * scale)

    def _collar(self, below: float) -> Field:
        """Everything under the shirt's upper edge, or under a plane that many metres below it."""
        edge = self.at("neck", (0.0, 0.0, 0.036 * self._scale))
        return grown(half_space(edge, (0.42, 0.0, 1.0)), -below)

    def _armpit(self, side: str) -> list[Field]:
        """Folds before and behind the armpit: from the chest and from the flank to the upper arm."""
        scale, sign, radius = self._scale, dict(SIDES)[side], 0.4 * self.person.radius("upper_arm")
        folds = []
        for trunk_part, start, ahead in (
            ("thorax", (0.055, sign * 0.080, 0.045), 0.016),
            ("lower_thorax", (-0.040, sign * 0.090, 0.060), -0.016),
        ):
            end = self.at(f"{side}_upper_arm", np.array([ahead, 0.0, -0.055]) * scale)
            folds.append(round_cone(self.at(trunk_part, np.array(start) * scale), end, 0.032 * scale, radius))
        return folds

    def _trousers(self) -> Garment:
        scale = self._scale
        halves = []
        for side, sign in SIDES:
            leg = union([self._limbs[f"{side}_thigh"], self._limbs[f"{side}_shank"]], 0.004)
            leg = union([leg, self._hamstrings(side)], 0.012)
            halves.append(union([leg, self._calf(side, sign), self._buttock(sign)], 0.03))
        body = union([self._trunk, union(halves, 0.012)], 0.04 * scale)
        body = _tapered(grown(body, CLOTH), self._belt() - 0.036 * scale)
        cuts = [half_space((0.0, 0.0, self._belt()), (0.0, 0.0, 1.0))]
        for side, _ in SIDES:
            knee, ankle = self.at(f"{side}_shank"), self.at(f"{side}_foot")
            along = (ankle - knee) / np.linalg.norm(ankle - knee)
            leg = round_cone(ankle - 0.20 * scale * along, ankle, 0.050 * scale, 0.058 * scale)
            body = union([body, leg], 0.06 * scale)
            cuts.append(half_space(ankle + 0.012 * scale * along, along))
        segments = ["pelvis", "lower_lumbar", *self._sided("thigh", "shank")]
        points = [self.at(name) for name in [*segments, *self._sided("foot")]]
        low, high = bounds([*points, np.array([0.0, 0.0, self._belt()])], 0.13 * scale + 0.04)
        return Garment("trousers", COLORS.trousers, body, low, high, 0.024, self._claims(segments), cuts)

    def _buttock(self, sign: float) -> Field:
        person, height = self.person, float(self.bind["pelvis"][2, 3])
        back = self._trunk_ends(height - 0.01 * self._scale)[0]
        deep, wide, high = 0.33 * person.size("buttock_depth"), 0.5 * person.size("hip_breadth"), 0.078 * self._scale
        middle = (back + deep, 0.42 * sign * wide, height - person.size("seat") + high)
        return ellipsoid(middle, (deep, 0.45 * wide, high))

    def _hamstrings(self, side: str) -> Field:
        """Muscles of the thigh behind its piece, which is as deep as a thigh on a seat."""
        length, knee = self.person.length("left_thigh"), self.person.size("knee")
        middle, high = caps(self.solids, f"{side}_thigh")[1]
        upper = np.array([-0.08 * high, middle[1], -0.17 * length])  # ends as far behind the hip as the piece's radius
        cone = round_cone(upper, (0.0, 0.0, -0.78 * length), 0.92 * high, 0.95 * knee)
        return placed(cone, self.bind[f"{side}_thigh"])

    def _spread(self, sign: float) -> Field:
        """Where buttocks and thigh spread on a seat."""
        wide, deep = (0.5 * self.person.size(name) for name in ("hip_breadth", "buttock_depth"))
        seat = self.person.size("seat")
        middle = self.at("pelvis", (-0.3 * deep, 0.55 * sign * wide, -0.9 * seat))
        return grown(ellipsoid(middle, (0.75 * deep, 0.5 * wide, seat)), 0.012)

    def slide(self, side: str, part: str) -> tuple[float, float, float]:
        """How far (3,) the half bone of a segment slides: flesh on a seat, aside and up from where it would turn to."""
        if part != "thigh":
            return 0.0, 0.0, 0.0
        more, seat = self.person.size("hip_breadth_sitting") - self.person.size("hip_breadth"), self.person.size("seat")
        return 0.75 * seat, 0.7 * dict(SIDES)[side] * more, 1.1 * seat

    @staticmethod
    def turns(side: str, part: str) -> dict[str, Turn]:
        """How the bones between a segment and that before it turn, by name."""
        if part != "upper_arm":
            return {"half": Turn()}
        # The flesh of a shoulder follows where the arm points; how it is turned about itself shows along the arm.
        aside = (0.0, dict(SIDES)[side] * float(np.sin(np.pi / 3)), -0.5)
        return {"half": Turn(0.5, 0.0, aside), "swing": Turn(1.0, 0.0, aside), "middle": Turn(1.0, 0.5, aside)}

    def _calf(self, side: str, sign: float) -> Field:
        length, radius = self.person.length("left_shank"), self.person.radius("calf")
        middle = (-0.20 * radius, sign * 0.02 * radius, -0.27 * length)
        muscle = ellipsoid(middle, (0.90 * radius, 0.90 * radius, 0.24 * length))
        return placed(muscle, self.bind[f"{side}_shank"])

    def _head(self) -> Iterator[Garment]:
        shape, frame = head_shape(self.size), self.bind["head"]
        scale = self._scale
        bottom, top = self.at("neck", (0.0, 0.0, -0.04)), self.at("head", (self.size.head_x, 0.0, self.size.head_top))
        shoulders = union([self._trunk, *(self._trapezius(side) for side, _ in SIDES)], 0.035 * scale)
        shoulders = union([shoulders, self._throat], 0.022)
        shoulders = without(shoulders, self._collar(0.02))
        skin = union([placed(shape.skin, frame), shoulders], 0.022)
        low, high = bounds([bottom, top], 0.15 * scale)
        low[2], high[2] = bottom[2] - 0.05, top[2] + 0.03
        atlas = self.at("head")
        claims = [
            *self._claims([*TRUNK, "neck", *self._sided("clavicle", "upper_arm")]),  # as the shirt's over it
            Claim("head", union([half_space(atlas, (0.0, 0.0, -1.0)), placed(shape.skin, frame)]), 0.012),
        ]
        rigid = [Claim("head", lambda points: np.zeros(len(points)))]
        yield Garment("head", COLORS.skin, skin, low, high, 0.0093, claims)
        low[2] = self.at("head", (0.0, 0.0, self.size.head_bottom))[2] - 0.06
        yield Garment("hair", COLORS.hair, placed(shape.hair, frame), low, high, 0.012, rigid)
        eye = self.at("head", (self.size.eye_x, 0.0, self.size.eye_z))
        around = bounds([eye], 0.075 * scale)
        yield Garment("eyes", COLORS.eyes, placed(shape.eyes, frame), *around, 0.0040, rigid)
        yield Garment("front", COLORS.skin, placed(shape.front, frame), *bounds([eye], 0.12 * scale), 0.0026, rigid)
        yield Garment("irises", COLORS.irises, placed(shape.irises, frame), *around, 0.0025, rigid)
        yield Garment("brows", COLORS.hair, placed(shape.brows, frame), *around, 0.0022, rigid)
        mouth = bounds([eye - np.array([0.0, 0.0, 0.075]) * scale], 0.05 * scale)
        yield Garment("lips", COLORS.lips, placed(shape.lips, frame), *mouth, 0.0016, rigid)

    def _hand(self, side: str) -> Garment:
        shape, frame = hand_shape(self.person, side), self.bind[f"{side}_hand"]
        corners = [self.at(f"{side}_hand", corner) for corner in shape.corners]
        low, high = bounds(corners, 0.035)
        claims = [Claim(claim.bone, placed(claim.field, frame), claim.softness) for claim in shape.claims]
        return Garment(f"{side}_hand", COLORS.skin, placed(shape.field, frame), low, high, 0.0054, claims)

    def _shoe(self, side: str, sign: float) -> Garment:
        size, scale = self.size, self._scale
        toe, heel, sole = size.toe_joint_x, size.heel_x, size.sole
        tip, wide = toe + size.toe_length, size.foot_half_width
        ankle = 0.036 * scale
        above, back, arch = (-0.006, 0.0, -0.02), (heel + 0.034, 0.0, sole + 0.026), (toe, -sign * 0.006, sole + 0.024)
        last = [
            round_cone((0.0, 0.0, 0.035), above, ankle, 0.98 * ankle),
            round_cone(above, (heel + 0.036, 0.0, sole + 0.034), 0.98 * ankle, 0.032 * scale),
            round_cone((0.0, 0.0, -0.012), (toe - 0.02, sign * 0.003, sole + 0.034), 0.96 * ankle, 0.033 * scale),
            round_cone(back, arch, 0.032 * scale, 0.034 * scale),
        ]
        inner = (toe - 0.01, -sign * 0.012, sole + 0.026), (tip - 0.032, sign * -0.012, sole + 0.022)
        outer = (toe - 0.012, sign * 0.014, sole + 0.024), (tip - 0.052, sign * 0.016, sole + 0.020)
        front = [round_cone(*inner, 0.033, 0.026), round_cone(*outer, 0.031, 0.024)]
        heel_sole = ellipsoid((0.5 * (heel + toe), 0.0, sole + 0.006), (0.5 * (toe - heel) + 0.024, 0.80 * wide, 0.05))
        hind = intersection(heel_sole, half_space((0.0, 0.0, sole + 0.02), (0.0, 0.0, 1.0)), 0.006)
        toe_sole = ellipsoid((toe - 0.008, 0.0, sole + 0.006), (tip - toe + 0.006, 0.98 * wide, 0.05))
        fore = intersection(toe_sole, half_space((0.0, 0.0, sole + 0.018), (0.0, 0.0, 1.0)), 0.006)
        back_field, front_field = union([*last, hind], 0.02), union([*front, fore], 0.012)
        floor = half_space((0.0, 0.0, sole), (0.0, 0.0, -1.0))
        body = intersection(union([back_field, front_field], 0.02), floor, 0.004)
        frame = self.bind[f"{side}_foot"]
        corners = [self.at(f"{side}_foot", (x, y, z)) for x in (heel, tip) for y in (-wide, wide) for z in (sole, 0.04)]
        low, high = bounds(corners, 0.035)
        before_toes = half_space((toe, 0.0, 0.0), (1.0, 0.0, 0.0))
        claims = [
            Claim(f"{side}_shank", placed(half_space((0.0, 0.0, 0.02), (0.0, 0.0, -1.0)), frame)),
            Claim(f"{side}_foot", placed(intersection(back_field, before_toes), frame)),
            Claim(f"{side}_toes", placed(half_space((toe, 0.0, 0.0), (-1.0, 0.0, 0.0)), frame), 0.010),
        ]
        return Garment(f"{side}_shoe", COLORS.shoes, placed(body, frame), low, high, 0.012, claims)

    # ---- places

    def _belt(self) -> float:
        """Height of the trousers' upper edge."""
        return float(self.bind["lower_lumbar"][2, 3]) + 0.005 * self.size.stature

    def _trunk_ends(self, height: float) -> tuple[float, float]:
        """X of the trunk's back and front at a height."""
        inside = RAYS[self._trunk(np.column_stack([RAYS, np.zeros_like(RAYS), np.full_like(RAYS, height)])) < 0.0]
        return float(inside[0]), float(inside[-1])

    @staticmethod
    def _sided(*parts: str) -> list[str]:
        return [f"{side}_{part}" for side, _ in SIDES for part in parts]


def _between(field: Field, low: float, high: float) -> Field:
    """Distance from the part of a solid between two heights."""
    return lambda points: np.maximum(field(points), 0.0) + _outside(points[:, 2], low, high)


def _tapered(field: Field, height: float) -> Field:
    """A solid that narrows above a height, so that it stays below the shirt whose hem is over it."""
    return lambda points: field(points) + 0.4 * np.maximum(points[:, 2] - height, 0.0)


def _outside(heights: Array, low: float, high: float) -> Array:
    return np.asarray(np.maximum(np.maximum(low - heights, heights - high), 0.0))

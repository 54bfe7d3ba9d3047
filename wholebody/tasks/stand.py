"""Contact: a figure that stands with flat soles on something; measures of how feet stand and free arms hang."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Annotated

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross
from wholebody.base.checks import shown, some
from wholebody.base.errors import InputError
from wholebody.base.fields import Names
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.axis import across, equidistant_error, equidistant_jacobian
from wholebody.tasks.balance import STANDING_HEIGHT, STEADY, Feet, Margin, SolePolygon, polygon
from wholebody.tasks.base import filled
from wholebody.tasks.contact_parts import Facing, Gap, Made, Over, Part, TermOfParts, between, owner_pairs, through
from wholebody.tasks.distance import SumOfSquares
from wholebody.tasks.faces import UP, face
from wholebody.tasks.surfaces import (
    Surface,
    ball_under,
    joined,
    once_by,
    outermost,
    segments_beyond,
    segments_on,
    surface,
)

STANCE_WEIGHTS = np.array((60.0, 300.0, 4.0, 600.0, 600.0))  # of a `Stance`: 1/m^2, but 1/rad^2 of the angle: ESTIMATE


@dataclass(frozen=True, eq=False)
class Stand(TermOfParts):
    """Stand with flat soles on a thing; the feet may slide, and the centre of mass stays over them.

    Each sole touches the thing, lies flat on its upper face and has its middle over it. A foot that is a ball, as
    quadrupeds have it, touches the thing in a point and may roll. The support polygon is that of the corners of the
    soles where they are, so it goes with the feet; `Balance` keeps to the feet of the start.

    Attributes:
        on: what it stands on.
        feet: segments whose soles stand.
        balance: whether the centre of mass stays over the soles; False for who also sits, leans or holds on.
        margin: distance of the centre of mass from the edges of the polygon [m]; None for 0.15 of its least width where
            the feet are at the start, as people keep it; that is in `keeps` once resolved.
        knees: those of the `feet` that are shanks and kneel: the knee and the foot beyond it touch the thing. So
            ``Stand("floor", feet=shanks, knees=shanks)`` kneels, and with "left_foot" and "right_shank" on one knee.
        parts: of each foot the distance, two angles unless it is a ball, and two rows over the face, which are zero;
            then, with balance, the distances of the centre of mass inside the edges [m]; once resolved.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a name that the scene does not have.

    Examples:
        >>> upright = wb.Stand("floor")
    """

    on: inputs.Name
    _: KW_ONLY
    feet: Feet = ("left_foot", "right_foot")
    balance: bool = True
    margin: Margin | None = None
    knees: Annotated[Sequence[str], Names("['right_shank']", least=0)] = ()
    keeps: float = field(init=False, repr=False, default=0.0)

    def resolve(self, scene: Scene, start: Array) -> Stand:
        """Find the soles and the face that they stand on."""
        where = f"Stand({shown(self.on)})"
        if stray := [str(knee) for knee in self.knees if knee not in self.feet]:
            example = "feet=['left_foot', 'right_shank'], knees=['right_shank']"
            raise InputError(f"{where}: knees are of the feet, and {some(stray)} is not; give {example}")
        inputs.find_feet(scene, self.feet, where)
        key = type(self), self.on, tuple(self.feet), tuple(self.knees), self.balance
        parts, touches = once_by(scene, [self.on], where, start, key, partial(self._between, scene, where))
        keeps, soles = 0.0, parts[-1]
        if isinstance(soles, SolePolygon):
            with scene.figure.posed(start) as state:
                corners = soles.corners(state)
            if not len(corners):
                raise InputError(f"{where}: the soles are a line, not an area; name more feet, or leave balance out")
            keeps = STEADY * polygon(corners).width if self.margin is None else self.margin
        return filled(self, parts=parts, touches=touches, keeps=keeps)

    def _between(self, scene: Scene, where: str, state: State, rest: State) -> Made:
        ground = face(scene, self.on, UP, state, where)
        thing = ground.surface
        parts: list[Part] = []
        touches: tuple[tuple[str, str], ...] = ()
        corners, joints = [], []
        for foot in self.feet:
            place, sole = inputs.find_place(scene, foot, where), surface(scene, foot, where)
            if not sole.owners or place.joint == 0:
                raise InputError(f"{where}: {foot!r} has no pieces to stand on; name segments with geometry as feet")
            toes = [owner for owner in segments_beyond(scene, place.joint) if owner != foot]
            middle = np.zeros(3)
            if foot in self.knees:
                above = segments_on(scene, [int(scene.model.parents[place.joint])])  # its end at the knee rests too
                bears, end = joined(scene, foot, [foot, *above]), joined(scene, f"{foot}'s foot", toes)
                parts += [Gap(bears, thing, ground), Gap(end, thing, ground)]
                ahead = np.asarray(rest.data.oMi[int(scene.model.supports[place.joint][1])].rotation[:, 0])
                # somebody kneels on a shin that is up to 30 mm farther ahead than the ankle
                lows = [_lows(sole, rest, ahead, 0.03), _lows(end, rest, ahead, STANDING_HEIGHT)]
            else:
                bears, ball = sole, ball_under(sole, rest)
                parts.append(Gap(sole, thing, ground))
                if ball is None:
                    up = rest.frame(place.frame).rotation.T @ UP
                    parts.append(Facing(place, across(up), ground, UP))
                    lows = [_lows(sole, rest, -UP, STANDING_HEIGHT)]
                else:  # the point on which it stands is below its center, however it is turned
                    lows = [([ball.center], [ball.joint])]
                under = [rest.data.oMi[joint].act(point) for point, joint in zip(*lows[0], strict=True)]
                middle = rest.frame(place.frame).actInv(np.mean(under, axis=0))
            # On a thing that ends the sole is not below the face, where the back of the foot would touch.
            low, high = (-ground.half, ground.half) if np.isinf(ground.half).all() else (
                np.append(-ground.half, -STANDING_HEIGHT), np.append(ground.half, np.inf)
            )  # fmt: skip
            parts.append(Over(place, ground, low, high, middle))
            touches += owner_pairs([*bears.owners, *toes], thing.owners)
            for each in lows:
                corners += each[0]
                joints += each[1]
        if self.balance:
            mass = inputs.joints_with_mass(scene, where, self.feet)
            parts.append(SolePolygon(np.array(corners), np.array(joints, dtype=np.intp), mass))
        return tuple(parts), touches

    @property
    def lower(self) -> Array:
        """(m,) zeros, and the margin for the rows of the balance."""
        return np.where(self._balanced(), self.keeps, 0.0)

    @property
    def upper(self) -> Array:
        """(m,) zeros, and inf for the rows of the balance."""
        return np.where(self._balanced(), np.inf, 0.0)

    def _balanced(self) -> list[bool]:
        return [isinstance(part, SolePolygon) for part in self.parts for _ in part.in_radians]


@dataclass(frozen=True, eq=False)
class Stance(SumOfSquares):
    """Squared distance of two feet from side by side, as in the figure's first posture, and from equal load.

    ``60 f^2 + 300 w^2 + 4 t^2 + 600 (x^2 + y^2)``: f is by how much one foot is ahead of the other, w by how much their
    distance to the side differs from that of the posture, each the mean of what either foot sees [m], t the sine of the
    angle between them, likewise. A person of median size has 0.17 m in the posture, with parallel feet. People who
    stand as they like have 0.165 m (standard deviation 0.038), or 0.203 m (0.046). x and y are how far the centre of
    mass is ahead of the feet's middle, beyond what it is in the posture, and beside it [m]: without them, of a task
    that is the same on the left and on the right, the answer is on one foot. For what the weights are, see
    docs/theory/person.md.

    A person who stands by `Stand` on two feet has this measure by default; where each is on a thing of its own, without
    x and y.

    Attributes:
        feet: the two feet.
        weight: factor on the measure.
        places: of the two, once resolved.
        rest: (5,) f, w, t, x and y in the posture.
        mass: joints of the figure whose centre of mass it is; None for all.
        factors: (5,) roots of the weights.

    Raises:
        InputError: a value of the wrong kind, shape or range; in a problem, a figure of which nothing has mass.
        UnknownNameError: in a problem, a segment that the figure does not have.

    Examples:
        >>> side_by_side = wb.tasks.Stance()
    """

    feet: Feet = ("left_foot", "right_foot")
    weight: inputs.Weight = 1.0
    places: tuple[inputs.Place, inputs.Place] = field(init=False, repr=False)
    rest: Array = field(init=False, repr=False)
    mass: range | None = field(init=False, repr=False)
    factors: Array = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Stance:
        """Find the feet, and how they are in the first posture."""
        if len(self.feet) != 2:
            raise InputError(f"Stance: feet has {len(self.feet)} names; give two")
        places = tuple(inputs.find_place(scene, foot, "Stance") for foot in self.feet)
        mass = inputs.joints_with_mass(scene, "Stance", self.feet)
        found = filled(self, places=places, rest=np.zeros(5), mass=mass, factors=np.sqrt(STANCE_WEIGHTS))
        with scene.figure.posed(scene.figure.neutral) as upright:
            return filled(found, rest=found.squares(upright)[0] / found.factors)

    def of_feet(self) -> Stance:
        """Itself, resolved, without the load."""
        return filled(self, factors=np.append(self.factors[:3], (0.0, 0.0)))

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (5,) and their derivatives (5, nv)."""
        (one, other), joints = (state.frame(place.frame) for place in self.places), [p.joint for p in self.places]
        values, rows = np.zeros(5), np.zeros((5, state.model.nv))
        center, moves = state.center_of_mass(self.mass), state.center_of_mass_jacobian(self.mass)
        for a, b, sign, (joint, against) in ((one, other, 0.5, joints[::-1]), (other, one, -0.5, joints)):
            axes = sign * a.rotation[:, :2].T
            values[:2] += axes @ (b.translation - a.translation)
            rows[:2] += between(state, through(b.translation, axes), joint, against)
            ways, away = 0.5 * a.rotation[:, :2].T, LEVEL * (center - a.translation)
            flat = LEVEL * ways  # on a slope too
            turned = through(a.translation, flat)
            turned[:, 3:] += ways @ pin.skew(away).T
            values[3:] += flat @ away
            rows[3:] += flat @ moves - between(state, turned, against, 0)
        left, ahead = one.rotation[:, 1], other.rotation[:, 0]
        values[2] = left @ ahead
        rows[2] = between(state, np.append(np.zeros(3), cross(ahead, left))[None], joints[1], joints[0])[0]
        return self.factors * (values - self.rest), self.factors[:, None] * rows


def _lows(bears: Surface, rest: State, under: Array, within: float) -> tuple[list[Array], list[int]]:
    """Points (3,) of a surface that are farthest towards a direction, in the axes of their joints, and these."""
    found = [outermost(shape, bears.placed(k, rest), under) for k, shape in enumerate(bears.shapes)]
    deepest = max(float((points @ under).max()) for points in found)
    pairs = [
        (np.asarray(rest.data.oMi[joint].inverse().act(point)), int(joint))
        for points, joint in zip(found, bears.joints, strict=True)
        for point in points
        if point @ under >= deepest - within
    ]
    return [point for point, _ in pairs], [joint for _, joint in pairs]


BELOW = np.array((1.0, 1.0, -1.0))  # x, y and down by x, y and z
LEVEL = np.array((1.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class Hang(SumOfSquares):
    """Squared angles of upper arms from where they hang when the figure is upright [rad^2].

    A person who stands or kneels has this measure by default for each arm that no term moves. By `Effort` alone, which
    counts from the trunk, it would point back where the trunk bends.

    Attributes:
        arms: the segments that hang.
        weight: factor on the measure.
        places: of these, once resolved.
        down: (k, 3) directions in their joints that hang.

    Raises:
        InputError: no name, or a weight out of range.
        UnknownNameError: in a problem, an arm that the figure does not have.

    Examples:
        >>> at_ease = wb.tasks.Hang(["left_upper_arm"])
    """

    arms: Annotated[Sequence[str], Names("['left_upper_arm']")] = ("left_upper_arm", "right_upper_arm")
    weight: inputs.Weight = 6.0  # 1/rad², beside an effort of 0.7 that counts from the trunk: ESTIMATE
    places: tuple[inputs.Place, ...] = field(init=False, repr=False)
    down: Array = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Hang:
        """Find the upper arms, and how they hang in the first posture."""
        places, figure = tuple(inputs.find_place(scene, arm, "Hang") for arm in self.arms), scene.figure
        with figure.posed(figure.neutral) as upright:
            down = np.array([-upright.data.oMi[place.joint].rotation[2] for place in places])
        return filled(self, places=places, down=down)

    def squares(self, state: State) -> tuple[Array, Array]:
        """The angle of each along the world's x and y axes (2 k,), and the derivatives (2 k, nv)."""
        found, moves = [], []
        for place, down in zip(self.places, self.down, strict=True):
            way = state.data.oMi[place.joint].rotation @ down
            x, y, z = way.tolist()
            wrench = np.zeros((2, 6))
            wrench[:, 3:] = -(equidistant_jacobian(x, y, -z) * BELOW) @ pin.skew(way)
            found.append(equidistant_error(x, y, -z))
            moves.append(state.wrench_jacobian(Wrench(wrench, place.joint)))
        return np.concatenate(found), np.vstack(moves)


@dataclass(frozen=True, eq=False)
class LevelHead(SumOfSquares):
    """Squared sine of the angle by which a head is tilted to a side [no unit].

    A person of whom a term places eyes or head has this measure by default: people keep their eyes level where a trunk
    bends or a roof is low. By `Effort` alone a head would tilt, as lateral joints of the neck are cheaper than a bend.

    Attributes:
        frame: of the head, with x ahead.
        weight: factor on the measure.
        place: of the frame, once resolved.

    Raises:
        InputError: a weight out of range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> level = wb.tasks.LevelHead()
    """

    frame: inputs.Name = "gaze"
    weight: inputs.Weight = 40.0  # 10 degrees count as 1.2: ESTIMATE
    place: inputs.Place = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> LevelHead:
        """Find the head."""
        return filled(self, place=inputs.find_place(scene, self.frame, "LevelHead"))

    def squares(self, state: State) -> tuple[Array, Array]:
        """The height of the axis to the left (1,), and its derivative (1, nv)."""
        left = state.frame(self.place.frame).rotation[:, 1]
        wrench = np.append(np.zeros(3), cross(left, UP))[None]
        return left[2:], state.wrench_jacobian(Wrench(wrench, self.place.joint))

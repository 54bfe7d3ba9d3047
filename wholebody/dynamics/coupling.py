"""Springs between a tracker and what it drives: `Spring`, equation 6 of Schmidl and Lin, m x'' = -K x - R x'.

x is where the driven posture is, seen from the tracked one, in the tangent space of postures: one equation for each
degree of freedom. During a frame the tracked posture moves with constant velocity, and x' is relative to that, so a
figure that follows a steady motion does not lag behind. The equation is solved exactly for a frame, so any mass is
stable at any frame time.

Overlap removal stops a hand at the surface of a thing that is in its way, and what the spring between tracker and hand
still wants there becomes an impulse on the thing: equations 7 to 10. The hand's side of equation 9 is the joint's mass
and inertia, with what it carries; friction is capped where sliding ends.

`Actuated` is the other one: a spring and a damper at each freedom of a figure that yields (`articulated`).
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, cross, with_values
from wholebody.base.checks import TIME_STEP, a, instance, known, number, posture, time_step
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.dynamics import impulse_kernel
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.geometry.flesh import Flesh, spreading
from wholebody.geometry.pieces import ENDLESS
from wholebody.geometry.proximity import Contacts, PairTable
from wholebody.scene.matter.body import Surface

Gains = float | Mapping[str, float] | None
MOST = 1e9  # N m/rad, N/m, N m s/rad, N s/m


@dataclass(frozen=True)
class Spring(Checked):
    """Constants of equation 6; those of Schmidl and Lin, and the mass of a hand, with which it is critically damped.

    Attributes:
        stiffness: K [N/m].
        damping: R [N s/m].
        mass: m [kg].

    Raises:
        InputError: K is not within 1e-9 and 1e12 N/m, R not within 0 and 1e12 N s/m, or m not within 1e-9 and 1e6 kg.

    Examples:
        >>> world = wb.World(scene, standing, spring=wb.dynamics.Spring(stiffness=500.0, damping=30.0))
    """

    stiffness: Annotated[float, Range(1e-9, 1e12, "N/m")] = 1000.0
    damping: Annotated[float, Range(0.0, 1e12, "N s/m")] = 40.0
    mass: Annotated[float, Range(1e-9, 1e6, "kg")] = 0.4

    def transition(self, time: float) -> Array:
        """The matrix (2, 2) that takes x and x' over a time of so many seconds.

        With a = R / 2m and s^2 = a^2 - K / m it is exp(-a t) [[C + a S, S], [-K / m S, C - a S]], C = cosh(s t) and
        S = sinh(s t) / s, also where s is imaginary.
        """
        time = number(time, "time", *TIME_STEP, "s")
        rate, stiff = 0.5 * self.damping / self.mass, self.stiffness / self.mass
        square = rate * rate - stiff
        if abs(square) <= 1e-6 * rate * rate:  # the two roots count as one
            c = exp(-rate * time)
            s = c * time
        else:
            root = cmath.sqrt(square)
            slow = cmath.exp(-stiff / (rate + root) * time)  # (rate - root) without the loss of digits
            fast = cmath.exp(-(rate + root) * time)
            c, s = 0.5 * (slow + fast).real, (0.5 * (slow - fast) / root).real
        return np.array([[c + rate * s, s], [-stiff * s, c - rate * s]])


class Coupling:
    """The driven posture of one figure on its spring, with its velocity (nv,) [rad/s, m/s]."""

    def __init__(self, model: pin.Model, q: Array, spring: Spring | None = None) -> None:
        """Begin at rest, at the posture q (nq,), which is tracked too."""
        self.spring = Spring() if spring is None else spring
        self._model = model
        self._shown = self._tracked = posture(q, model.nq)
        self.velocity: Array = np.zeros(model.nv)

    def toward(self, tracked: Array, dt: float) -> Array:
        """The posture (nq,) to which the spring brings the driven one in a frame, by itself; tracked is its end."""
        dt, model = time_step(dt, "dt"), self._model
        tracked = posture(tracked, model.nq, "tracked")
        steady = pin.difference(model, self._tracked, tracked) / dt
        apart = pin.difference(model, self._tracked, self._shown)
        (xx, xv), (vx, vv) = self.spring.transition(dt)
        relative = self.velocity - steady
        self.velocity = steady + vx * apart + vv * relative
        self._tracked = tracked
        return np.asarray(pin.integrate(model, tracked, xx * apart + xv * relative))

    def stopped(self, shown: Array, wanted: Array, dt: float) -> None:
        """Take the posture (nq,) that contact allowed for the wanted one; the velocity becomes that of a frame."""
        model = self._model
        missed = np.abs(pin.difference(model, wanted, shown))
        done = pin.difference(model, self._shown, shown) / dt
        # rad, m: less is the accuracy with which overlap is removed
        self.velocity = np.where(missed > 1e-3, done, self.velocity)
        self._shown = np.array(shown)


class PushedContacts:
    """The contacts of one frame in which the figure touches things that move by themselves."""

    def __init__(
        self, engine: RigidBodies, state: State, table: PairTable, near: Contacts, bodies: Mapping[int, str]
    ) -> None:
        """Gather pairs that touch where the figure was stopped; `bodies` are things by the pieces that move."""
        self._engine, self._state = engine, state
        self.rows: list[tuple[int, str, int, Array, Array]] = []
        """Joint, thing, piece of the figure or what it carries, point (3,), normal (3,) towards the thing."""
        for (first, second), normal, at_a, at_b in zip(
            near.pair.tolist(), near.normal, near.point_a, near.point_b, strict=True
        ):
            for own, other, out in ((first, second, normal), (second, first, -normal)):
                if other in bodies and table.joint[own] > 0:
                    self.rows.append((int(table.joint[own]), bodies[other], own, 0.5 * (at_a + at_b), out))

    def push(self, velocity: Array, surfaces: Mapping[tuple[int, str], Surface]) -> dict[str, Array]:
        """Give the things the impulses (3,) of a figure that wants to move with a velocity (nv,); by thing, N s."""
        engine, state = self._engine, self._state
        twists = (state.support * state.spread(velocity)) @ state.columns
        hands = [twists[joint, :3] + pin.skew(twists[joint, 3:]) @ point for joint, _, _, point, _ in self.rows]
        mobilities = [
            engine.mobility(thing, point) + self._mobility(joint, point) for joint, thing, _, point, _ in self.rows
        ]
        given: dict[str, Array] = {}
        for _ in range(10):  # of several contacts one undoes a part of another
            moved = False
            for (_, thing, piece, point, normal), hand, mobility in zip(self.rows, hands, mobilities, strict=True):
                relative = engine.velocity_at(thing, point) - hand
                impulse = contact_impulse(relative, normal, mobility, surfaces[piece, thing])
                if impulse is not None:
                    engine.push(thing, impulse, point)
                    given[thing] = given.get(thing, np.zeros(3)) + impulse
                    moved = True
            if not moved:
                break
        return given

    def _mobility(self, joint: int, point: Array) -> Array:
        """Change of velocity (3, 3) of a point of a joint's own mass by an impulse there; zero without mass."""
        inertia, place = self._state.model.inertias[joint], self._state.data.oMi[joint]
        if not (inertia.mass > 0.0 and np.linalg.eigvalsh(inertia.inertia).min() > 0.0):
            return np.zeros((3, 3))
        arm = pin.skew(point - place.act(inertia.lever))
        turned = place.rotation @ np.linalg.inv(inertia.inertia) @ place.rotation.T
        return np.asarray(np.eye(3) / inertia.mass - arm @ turned @ arm)


def contact_impulse(relative: Array, normal: Array, mobility: Array, surface: Surface) -> Array | None:
    """Impulse (3,) on B [N s] by equations 9 and 10, for a velocity `relative` (3,) to A; None if they part."""
    # `normal` (3,) from A to B; `mobility` (3, 3): change of that velocity by an impulse on B, and its opposite on A
    approach, least = -float(normal @ relative), 1e-6  # m/s
    if approach <= least:
        return None
    bounce = surface.restitution if approach > 0.05 else 0.0  # m/s: what is held lies still
    size = (1.0 + bounce) * approach / float(normal @ mobility @ normal)
    impulse = size * normal
    sliding = relative + mobility @ impulse
    sliding = sliding - (normal @ sliding) * normal
    speed = float(np.linalg.norm(sliding))
    if speed > least:
        along = sliding / speed
        impulse = impulse - min(surface.friction * size, speed / float(along @ mobility @ along)) * along
    return np.asarray(impulse)


@dataclass(frozen=True)
class Actuated:
    """A figure whose joints follow a tracker through springs and dampers, and yield to what they meet.

    Equation 6 of Schmidl and Lin for each freedom, as torques: I q'' = -K (q - tracked) - R (q' - tracked').
    A freedom with a spring also bears the figure's own weight there; one without is free, and all of them a ragdoll.

    Attributes:
        figure: whose joints are meant.
        stiffness: K [N m/rad], of translations [N/m]: one for all freedoms, or a mapping of joints, groups and "root",
            where what is not named has none. None: 2500 /s^2 times the inertia that the freedom moves at the start.
        damping: R [N m s/rad, N s/m] likewise. None: critical, at that inertia.

    Raises:
        InputError: no figure, or a number that is negative or too large.
        UnknownNameError: a name that is no joint or group of the figure.

    Examples:
        >>> soft = wb.Actuated(human, stiffness={"right_arm": 40.0})  # the other joints are limp
        >>> world = wb.World(scene, standing, spring=soft)
    """

    figure: Figure
    stiffness: Gains = None
    damping: Gains = None

    def __post_init__(self) -> None:
        instance(self.figure, Figure, "Actuated: figure", "give a figure, such as scene.figure")
        for what, gains in (("stiffness", self.stiffness), ("damping", self.damping)):
            if gains is not None:
                self._spread(gains, f"Actuated: {what}")

    def gains(self, inertia: Array) -> tuple[Array, Array]:
        """K and R (nv,) of freedoms that move inertias (nv,) [kg m2, kg]."""
        # 1/s²: stiffness over inertia of Schmidl and Lin's spring, 1000 N/m at 0.4 kg
        stiffness = 2500.0 * inertia if self.stiffness is None else self._spread(self.stiffness, "Actuated: stiffness")
        critical = 2.0 * np.sqrt(stiffness * inertia)
        return stiffness, critical if self.damping is None else self._spread(self.damping, "Actuated: damping")

    def _spread(self, gains: float | Mapping[str, float], what: str) -> Array:
        model, figure = self.figure.model, self.figure
        if not isinstance(gains, Mapping):
            return np.full(model.nv, number(gains, what, 0.0, MOST))
        found = np.zeros(model.nv)
        roots = {name: [str(model.names[joint])] for name, joint in figure.roots.items()}
        names = {**roots, **figure.groups, **{name: [name] for name in figure.joints}}
        for name, value in gains.items():
            size = number(value, f"{what}[{name!r}]", 0.0, MOST)
            if (law := figure.followers.get(name)) is not None:
                raise InputError(f"{what}: {name!r} follows {law.joint!r}; give that of {law.joint!r}")
            for joint in names[known(name, names, "joint or group", what)]:
                moved = model.joints[model.getJointId(joint)]
                found[moved.idx_v : moved.idx_v + moved.nv] = size
        return found

    def check(self, model: pin.Model) -> None:
        """Raise InputError for a scene with another model."""
        if list(model.names) != list(self.figure.model.names):
            raise InputError(f"Actuated: the scene is not one of {a(self.figure.name)}; give scene.figure")


Moved = Mapping[str, tuple[pin.SE3, pin.SE3]]


class Points(NamedTuple):
    """Points at which a figure is touched, and its joint limits, as m points of which only the normal counts."""

    figure: Array  # (3 m, nv) velocities of the second body relative to the first along n, t1, t2, by those of joints
    things: Array  # (3 m, 6 b) the same by the twists of the bodies that move by themselves
    given: Array  # (3 m,) the same by what is moved, m/s
    gap: Array  # (m,) metres, radians
    friction: Array  # (m,)
    restitution: Array  # (m,)
    driven: Mask  # (m,) points of what moves
    pair: Indices  # (m,) of pieces, or limit
    place: Array  # (m, 3) in the world
    axes: Array  # (m, 3, 3) n, t1, t2, one a row
    bodies: list[str]  # (b,)
    responses: Array  # (b, 6, 6) changes of their twists by unit impulses; see `RigidBodies.response`

    @staticmethod
    def room(count: int, freedoms: int, bodies: list[str], engine: RigidBodies | None) -> Points:
        """Points of which nothing is known yet, near bodies that move by themselves."""
        rows, one = 3 * count, np.zeros(count)
        responses = [] if engine is None else [engine.response(name) for name in bodies]
        return Points(
            np.zeros((rows, freedoms)), np.zeros((rows, 6 * len(bodies))), np.zeros(rows), one, one.copy(), one.copy(),
            np.zeros(count, dtype=bool), np.zeros(count, dtype=np.intp), np.zeros((count, 3)),
            np.tile(np.eye(3), (count, 1, 1)), bodies, np.array(responses).reshape(-1, 6, 6),
        )  # fmt: skip

    def met(self, speed: Array, skin: float, now: float, soon: float) -> Mask:
        """(m,) points with velocities (3 m,) that come within a skin [m] so `soon` that they count as met, s.

        What goes 5 mm along a surface until then may miss it, as surfaces are round: it is met only `now`.
        """
        due = (self.gap - skin) / np.maximum(np.abs(speed[::3]), 1e-9)
        passing = due * np.hypot(speed[1::3], speed[2::3]) > 0.005
        return np.asarray(due <= np.where(passing, now, soon))

    def add_flesh(self, state: State, geometry: pin.GeometryModel, bent: Sequence[Flesh], pieces: Indices) -> None:
        """Add the motion of flesh beside its limb at the first points, whose pieces are (k, 2)."""
        for flesh in bent:
            rows, side = np.nonzero(pieces == flesh.piece)
            moves = spreading(geometry, flesh, state.data.oMi) if len(rows) else None
            if moves is not None:
                wrench = np.concatenate([np.zeros(3), moves.turn])[None]
                turned = state.rows(wrench, np.array([moves.limb]), np.array([moves.trunk]))[0]
                for k, sign in zip(rows.tolist(), (2.0 * side - 1.0).tolist(), strict=True):
                    rate = sign * self.axes[k] @ moves.rate(self.place[k])
                    self.figure[3 * k : 3 * k + 3] += np.outer(rate, turned)

    def sag(self, ended: Array, near: Contacts, time: float, count: int) -> Array:
        """By how much pairs, of `count` numbers, came nearer in a step than to the gaps (m,) that it sought, m/s2.

        What rolls does so again in the next step, over the square of its time.
        """
        least, found = np.full(count, np.inf), np.zeros(count)
        np.minimum.at(least, np.minimum(self.pair, count - 1), ended)
        pair = 2 * self.figure.shape[1] + near.number
        met = np.isfinite(least[pair])
        found[pair[met]] = np.minimum(near.distance[met] - least[pair[met]], 0.0) / time**2
        return found

    def with_limits(self, model: pin.Model, limited: Indices, q: Array, reach: Array) -> Points:
        """These and the limits within reaches (nv,) at a posture; of `limited` (k, 2): places in q, in the velocity."""
        at, freedom = limited.T
        room: Array = np.array([q[at] - model.lowerPositionLimit[at], model.upperPositionLimit[at] - q[at]])
        pair = 2 * freedom + np.array([[0], [1]])  # each side of each freedom, before the pairs of pieces
        known = np.zeros(2 * model.nv, dtype=bool)
        known[self.pair[self.pair < len(known)]] = True
        side, which = np.nonzero((room < reach[freedom]) & ~known[pair])
        if not len(side):
            return self
        more = Points.room(len(side), model.nv, self.bodies, None)
        more.figure[3 * np.arange(len(side)), freedom[which]] = np.array([1.0, -1.0])[side]
        more.gap[:], more.pair[:] = room[side, which], pair[side, which]
        both = (self[:-2], more[:-2])
        joined = {name: np.concatenate(arrays) for name, *arrays in zip(self._fields[:-2], *both, strict=True)}
        return with_values(self, **joined)

    def share(self, way: Array) -> float:
        """The share of a way (nv,) that takes no joint farther than 0.01 rad or m beyond a limit, or ever 0.02."""
        limits = np.flatnonzero(self.pair < 2 * len(way))
        beyond, gap = -(self.figure[3 * limits] @ way), self.gap[limits]
        room = np.maximum(np.maximum(gap + 0.01, 0.01 * (gap + 0.02)), 1e-12)
        return float((room / np.maximum(beyond, room)).min(initial=1.0))

    def held(self, impulse: Array) -> set[str]:
        """Names of the bodies that impulses (m, 3) act on."""
        acted = self.things.reshape(len(self.gap), 3, len(self.bodies), 6)[impulse.any(axis=1)].any(axis=(0, 1, 3))
        return {self.bodies[b] for b in np.flatnonzero(acted).tolist()}


def approaches(table: PairTable, centres: Array, twist: Array) -> Array:
    """Bounds (pairs,) [m/s] of the approach of pieces with `centres` (n, 3) and twists (n, 6) at the origin."""
    reach = np.minimum(table.reach, ENDLESS)
    return np.asarray(impulse_kernel.approaches(table.pairs, reach, centres, twist))


def torques(model: pin.Model, data: pin.Data, q: Array, wrenches: Sequence[tuple[int, Array]]) -> Array:
    """Impulses (nv,) of freedoms at a posture (nq,) from wrenches (6,) about the world's origin on joints."""
    pin.computeJointJacobians(model, data, q)
    total = np.zeros(model.nv)
    for joint, wrench in wrenches:
        if joint:
            total += pin.getJointJacobian(model, data, joint, pin.WORLD).T @ wrench
    return total


def drift(
    data: pin.Data, root: int, momentum: Array, gravity: Array, time: float, borne: bool
) -> tuple[pin.Force, Array]:
    """Momentum about the origin, and centre (3,), of what a free root carries, a time after its momentum (6,)."""
    # the centre moves by the mean of both velocities, in a step with contacts (`borne`) by the later, as joints do
    place, share = data.oMi[root], 1.0 if borne else 0.5
    now = place.act(pin.Force(momentum))
    mass, centre = data.mass[root], place.act(data.com[root])
    weight = time * mass * gravity
    way = time / mass * (now.linear + share * weight)
    return now + pin.Force(weight, cross(centre + (1.0 - share) * way, weight)), centre + way

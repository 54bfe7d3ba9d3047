"""Rigid bodies that move by themselves among things and a figure that do not.

A frame is advanced in steps of at most `STEP`. A step ends early at the next impact; there the impacts are
resolved one by one (`impact_kernel`), and the motion goes on. In a step all contacts together have one program
(`step_program`) that keeps every gap at `SKIN` or more at its end; then the bodies move (`motion_kernel`). A step after
which pieces are in each other is made again with the points where they are; if that does not help, or pieces may have
passed through each other on the way, with half the time. After too many stops a step's program has its impacts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, cross
from wholebody.base.checks import TIME_STEP
from wholebody.base.errors import InputError, millimetres
from wholebody.dynamics import motion_kernel
from wholebody.dynamics.bodies_state import BodiesState, Joints
from wholebody.dynamics.frame import EngineFrame, Event, FrameRecord, Given, bounded, given_placements
from wholebody.dynamics.passing import StepStart, free_between
from wholebody.dynamics.pieces import ContactFinder, ContactPoints, Pieces
from wholebody.dynamics.sleeping import Sleepers
from wholebody.dynamics.step_program import SKIN, Impulses, StepProgram, compiled_kernel
from wholebody.geometry.placement import FARTHEST, PlacementLike, placement
from wholebody.geometry.proximity import Contacts
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import NotCopyable

GRAVITY = (0.0, 0.0, -9.81)  # m/s2
STEP = 1.0 / 240.0  # s, at most; smaller: more accurate and slower
LEAST_GAP = 2e-6  # m: pieces nearer than this are parted before the next step


class RigidBodies(NotCopyable):
    """The things of a scene that have a `wb.Body`, and everything that they can touch.

    Methods raise an `UnknownNameError` for a name that no body has, and an `InputError` for a value of another kind,
    shape or range.

    Attributes:
        state: where all bodies are, and how they move.
        names: of the bodies.
        notes: what was assumed about masses.
        time: seconds since the start.
    """

    def __init__(self, scene: Scene, gravity: ArrayLike = GRAVITY, start: ArrayLike | None = None) -> None:
        """Put all bodies where the scene has them, and the figure into a posture.

        Args:
            scene: figure and things; at least one has a `wb.Body`.
            gravity: (3,) m/s2, each entry within 1000.
            start: (nq,) posture of the figure; its first one by default.

        Raises:
            InputError: nothing in the scene has a body, a thing that moves by itself overlaps something, two materials
                do not know each other, a thing has a joint to itself, or gravity or start is no such value.
            UnknownNameError: a joint names a thing that is not there.
        """
        checks.instance(scene, Scene, "scene", "give a wb.Scene")
        self.gravity = bounded(gravity, 1e3, "gravity")
        first = scene.figure.posture(scene.figure.postures[0]) if start is None else start
        pieces = Pieces(scene, checks.posture(first, scene.model.nq, "start"))
        if not pieces.dynamic.any():
            raise InputError("nothing in the scene moves by itself; add a thing with body=wb.Body(density=700)")
        compiled_kernel()
        self._pieces, self.state = pieces, BodiesState(scene, pieces)
        self.names, self.notes, self.time = pieces.names, pieces.notes, 0.0
        self._things = sum(thing.segment is None for thing in scene.objects.values())  # the first of the names
        self._pushed = 0.0  # J: by pushes since the last frame
        self._joints = Joints(scene, pieces)
        self._finder, self._old = ContactFinder(pieces), Impulses.nothing(len(self._joints))
        self._sleepers = Sleepers(self.state, self._joints.together())
        self._falling, self._borne = pieces.dynamic.copy(), np.zeros_like(pieces.dynamic)
        self._near: Contacts
        self._find_near(STEP)
        self._check_start()
        # given velocities may part joints
        self._joints.project_velocities(self.state, self.state.bodies.twist, self.state.bodies.moving)

    def _check_start(self) -> None:
        if len(self._near.distance) and self._near.distance.min() < -1e-4:
            worst = int(self._near.distance.argmin())
            first, second = (self.names[self._pieces.body[piece]] for piece in self._near.pair[worst])
            raise InputError(
                f"{first!r} and {second!r} overlap by {millimetres(-self._near.distance[worst])} at the start; "
                "move one of them away"
            )

    def placement(self, name: str) -> pin.SE3:
        """Where a body is."""
        return self.state.placement(self._number(name))

    def twist(self, name: str) -> Array:
        """Velocity of a body's centre of mass [m/s] and angular velocity [rad/s], (6,), along the world's axes."""
        return np.array(self.state.bodies.twist[self._number(name)])

    def velocity_at(self, name: str, point: Array) -> Array:
        """Velocity (3,) of a body's point at a place (3,) in the world, m/s."""
        number, point = self._number(name), bounded(point, FARTHEST, "point")
        return self._velocity(number, point - self.state.bodies.position[number])

    def _velocity(self, number: int, lever: Array) -> Array:
        """Velocity (3,) of a body's point at a place (3,) seen from its centre of mass, m/s."""
        return np.asarray(self.state.velocity[number] + pin.skew(self.state.spin[number]) @ lever)

    def mobility(self, name: str, point: Array) -> Array:
        """Change (3, 3) of the velocity of a body's point (3,) by an impulse there, 1/kg."""
        number, point = self._number(name), bounded(point, FARTHEST, "point")
        arm = np.hstack([np.eye(3), -pin.skew(point - self.state.bodies.position[number])])
        return np.asarray(arm @ self.response(name) @ arm.T)

    def response(self, name: str) -> Array:
        """Change (6, 6) of a body's twist by impulse and angular impulse about its centre, joints at work."""
        number, found = self._number(name), np.zeros((6, 6))
        found[:3, :3], found[3:, 3:] = np.eye(3) / self._pieces.mass[number], self._inverse_inertia(number)
        if self.state.bodies.jointed[number]:
            movable = self.state.bodies.moving | self._joints.linked(number)
            for column in found.T:
                twist = np.zeros_like(self.state.bodies.twist)
                twist[number] = column
                self._joints.project_velocities(self.state, twist, movable)
                column[:] = twist[number]
        return found

    def centre(self, name: str) -> Array:
        """A body's centre of mass (3,), metres."""
        return np.array(self.state.bodies.position[self._number(name)])

    def weight(self, name: str) -> Array:
        """The weight (3,) of a body that moves by itself, newtons."""
        return np.asarray(self._pieces.mass[self._number(name)] * self.gravity)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that move by themselves."""
        return tuple(name for name, free in zip(self.names, self._pieces.dynamic, strict=True) if free)

    def push(self, name: str, impulse: Array, point: Array) -> None:
        """Give a body that moves by itself an impulse (3,) at a place (3,) in the world, N s; it wakes."""
        lever, impulse = bounded(point, FARTHEST, "point") - self.centre(name), bounded(impulse, 1e6, "impulse")
        self.push_about_centre(name, np.concatenate([impulse, pin.skew(lever) @ impulse]))

    def push_about_centre(self, name: str, wrench: Array) -> None:
        """The same with an impulse and an angular impulse about the body's centre of mass, (6,), N s and N m s."""
        number, twist = self._number(name), self.state.bodies.twist
        if not self._pieces.dynamic[number]:
            raise InputError(f"{name!r} does not move by itself; push one that has a wb.Body")
        wrench, before = bounded(wrench, 1e6 * FARTHEST, "wrench", 6), twist[number].copy()
        self.state.velocity[number] += wrench[:3] / self._pieces.mass[number]
        self.state.spin[number] += self._inverse_inertia(number) @ wrench[3:]
        self.state.bodies.moving[self._joints.linked(number)] = True
        if self.state.bodies.jointed[number]:
            self._joints.project_velocities(self.state, twist, self.state.bodies.moving)
        # along the mean of both velocities, where joints, which hold in both, do no work
        self._pushed += 0.5 * float(wrench @ (before + twist[number]))

    def put(self, name: str, at: PlacementLike) -> None:
        """Put a body elsewhere, with its velocity; it wakes, and what lay on it. What that raises is work."""
        number, before, kept = self._number(name), self.energy(), self.state.copies()
        self.state.put(number, placement(at, "put: at"))
        self.state.bodies.moving[self._joints.linked(number)] = True
        self._sleepers.wake_where_put(self._finder, kept)
        self._pushed += self.energy() - before

    def _inverse_inertia(self, number: int) -> Array:
        rotation = self.state.bodies.rotation[number]
        return np.asarray(rotation @ self.state.bodies.inverse[number] @ rotation.T)

    def energy(self) -> float:
        """Kinetic and potential energy of the bodies that move by themselves, joules."""
        return self.state.energy(self.gravity)

    def momentum(self) -> Array:
        """Momentum [kg m/s] and angular momentum about the world's origin [kg m2/s], (6,), of the same bodies."""
        return self.state.momentum()

    def _number(self, name: str) -> int:
        index = self._pieces.index
        return index[name if type(name) is str and name in index else checks.known(name, index, "body")]

    def advance(
        self,
        dt: float,
        kinematic: Mapping[str, tuple[pin.SE3, pin.SE3]] | Given | None = None,
        borne: Collection[str] = (),
        yielding: Collection[str] = (),
        until: float = np.inf,
    ) -> EngineFrame:
        """Advance by a frame.

        Args:
            dt: seconds.
            kinematic: name of a segment, or of a thing without a body, to its placements at the start and at the end of
                the frame, between which it moves with constant velocity and angular velocity. What is not named stands.
            borne: bodies that pushes given before bear during the frame: they move with their velocity at its end.
            yielding: segments whose motion is that of a figure to which their impulses are given after the frame. To
                contacts they weigh what their joints carry; others of `kinematic` are as heavy as anything.
            until: ends the frame early, to be taken back, where the rebound from those is faster than this, m/s.
        """
        dt = checks.number(dt, "dt", TIME_STEP[0], 10.0, "s, such as 1/60")
        state, names, placed = self.state, *given_placements(kinematic)
        given: Indices = np.array([self._number(name) for name in names], dtype=np.intp)
        for number in given[self._pieces.dynamic[given]]:
            raise InputError(f"{self.names[number]!r} moves by itself; leave it out of kinematic")
        ended = state.copies()
        state.give(given, placed, dt)
        self._sleepers.wake_where_put(self._finder, ended)
        self._borne = np.array([name in borne for name in self.names])
        self._yielding = np.array([name in yielding for name in self.names]) & np.isfinite(self._pieces.mass)
        count = int(np.ceil(dt / STEP - 1e-9))
        # early ends of steps: eight for a dozen bodies, as each costs a step of all of them
        stops = 96 // max(12, int(state.bodies.moving.sum()))
        given_up = max(0, 3 - count)  # a frame of one step gives halving up once, others three times
        record = FrameRecord(stops, np.zeros((len(self.names), 6)), work=self._pushed, given_up=given_up)
        self._pushed = 0.0
        if not self._still_near(dt / count):
            self._find_near(dt / count)
        for number in range(count):
            end = dt * (number + 1) / count
            while end - record.time > 1e-9 * dt and not (until < np.inf and record.met(yielding, until)):
                self._step(end - record.time, record, dt - record.time)
        state.stop(given, placed[:, 1])
        state.bodies.given[:] = False
        self._sleepers.update(self._near, dt)
        self.time += dt
        return record.finished(self.names, self.energy(), self._sleepers.count)

    def contacts(self, names: Collection[str]) -> ContactPoints:
        """Points at which bodies with these names, and those that touch them in turn, can touch other things."""
        linked = np.zeros(len(self.names), dtype=bool)
        linked[[self._number(name) for name in checks.listed(names, "names", "['ball']")]] = True
        near, (position, rotation, active) = self._near, self._found
        if (linked & ~active).any():  # what bears those that sleep was not looked at
            near = self._finder.near(position, rotation, self._margin, active | self._pieces.dynamic)
        return self._finder.points(near).linked(linked, self._pieces.dynamic, self._things, 2.0 * SKIN)

    def way_back(self) -> Callable[[], None]:
        """A function that takes back what is advanced from now on."""
        state, sleepers = self.state, self._sleepers.way_back()
        copies, moving = state.copies(), state.bodies.moving.copy()
        old, falling, pushed, now = self._old, self._falling, self._pushed, self.time

        def back() -> None:
            state.restore(copies)
            state.bodies.moving[:] = moving
            self._old, self._falling, self._pushed, self.time = old, falling, pushed, now
            sleepers()
            self._find_near(STEP)

        return back

    def _step(self, time: float, record: FrameRecord, left: float) -> None:
        """Advance by at most a time of the `left` s of a frame, to its end, an impact, or where a short step leads."""
        state = self.state
        if self._sleepers.wake(self._near):
            self._find_near(STEP)  # what bears the woken ones was not looked at while all of it was still
        ahead = np.outer(left * (self._borne & state.bodies.moving), [*self.gravity, 0.0, 0.0, 0.0])
        points = self._finder.points(self._near)
        program = StepProgram(state, points, self.gravity, self._joints, self._yielding, ahead)
        events, ended = program.resolve_impacts()
        if len(events):
            self._record(events, program, record)
        falling = self._falling & ~self._borne
        program.read_velocities(falling)
        together = record.stops <= 0 or not ended
        time, stopped = self._until_impact(program, time, together)
        before = StepStart(state, self._near, self._margin, self._finder)
        start, weight = self._old, float(np.linalg.norm(self.gravity))
        halvings, predicted = 0, 0
        while True:
            self._move(program, time, together, start, before.kept)
            impulse, least = program.world_impulse(), self._find_near(STEP)
            record.steps += 1
            if record.given_up >= 3:  # then nothing helps, as where bodies are pushed together
                break
            if halvings == 6:
                record.given_up += 1
                break
            deep = least < -(1e-4 if predicted else 2e-5)  # m: less is made again more often, and parted less often
            if not deep and free_between(state, before, self._near, self._margin, self._travel(time), time, weight):
                break
            start, met = program.remembered(time), deep and predicted < 2
            if met:
                program.add_points(self._finder.points(self._near.nearer(LEAST_GAP)), time)
                predicted += 1
            state.restore(before.kept)
            if met:
                program.read_velocities(falling)
                time, again = self._until_impact(program, time, together)
                stopped |= again
            else:
                halvings, time = halvings + 1, 0.5 * time
        record.stops -= stopped
        record.time += time
        self._old = program.remembered(time)
        work = program.work()
        record.work += float(work.sum())
        self._joints.project_velocities(state, state.bodies.twist, state.bodies.moving)
        state.bodies.twist[:] -= (1.0 - time / left) * ahead  # what the rest of it will add is no energy of this step
        program.settle(before.kept, work)
        by = np.flatnonzero(impulse.any(axis=1) & state.bodies.given[program.points.bodies].any(axis=1))
        record.given += self._events(program, record.time, by, np.zeros(len(by)), impulse[by])
        wrench = np.hstack([impulse, cross(program.points.point, impulse)])
        np.add.at(record.impulse, program.points.bodies[:, 1], wrench)
        np.add.at(record.impulse, program.points.bodies[:, 0], -wrench)
        record.contacts = int((impulse != 0.0).any(axis=1).sum())
        record.signorini = max(record.signorini, program.residuals[0])
        record.coulomb = max(record.coulomb, program.residuals[1])
        if least < LEAST_GAP:
            least, lifted, lent = self._separate(least)
            record.work, record.lent = record.work + lifted, record.lent + lent
        record.deepest = max(record.deepest, -least)

    @staticmethod
    def _until_impact(program: StepProgram, time: float, together: bool) -> tuple[float, bool]:
        """The time to the first impact if that comes before a time and is not part of the program, and whether so."""
        first = float(program.hits.min(initial=np.inf))
        return (time, False) if together or first >= time else (max(first, 1e-6), True)

    def _move(
        self, program: StepProgram, time: float, together: bool, start: Impulses, kept: tuple[Array, Array, Array]
    ) -> None:
        """Solve the program of a step and move the bodies, again until joints are closed at its end."""
        joints, state = self._joints, self.state
        hold = np.zeros((len(joints), 3))
        for closing in range(6):  # each closes what the one before left by bodies' turning
            program.solve(time, together, start, hold)
            pushed = program.pushed() | self._borne
            motion_kernel.drift(state.bodies, pushed, self.gravity, time)
            self._falling = ~pushed
            # s: in shorter steps joints only keep their velocities; rounding over such a time is no velocity
            if not len(joints) or time < 1e-5 or closing == 5:
                return
            off = joints.gaps(state)
            if np.abs(off).max() <= 1e-9:  # m
                return
            hold -= off / time
            start = program.remembered(time)
            state.restore(kept)

    def _record(self, events: Array, program: StepProgram, record: FrameRecord) -> None:
        points, state, number = program.points, self.state, events[:, 0].astype(np.intp)  # squeezed bodies: thousands
        bodies, place, impulse = points.bodies[number], points.point[number], events[:, 2:]
        wrench = np.hstack([impulse, cross(place, impulse)])
        for side, sign in ((0, 1.0), (1, -1.0)):
            np.add.at(record.impulse, bodies[:, side], -sign * wrench)
            given = state.bodies.given[bodies[:, side]]
            body = bodies[given, side]
            velocity = state.velocity[body] + cross(state.spin[body], place[given] - state.bodies.position[body])
            record.work += sign * float((impulse[given] * velocity).sum())
        met = self._events(program, record.time, number, events[:, 1], impulse)
        record.events += met
        record.given += [met[k] for k in np.flatnonzero(state.bodies.given[bodies].any(axis=1))]

    def _events(self, program: StepProgram, time: float, number: Indices, speed: Array, impulse: Array) -> list[Event]:
        """Impulses (k, 3) on B at points (k,), with speeds (k,) of approach, as events."""
        points, bounce = program.points, self._pieces.restitution[program.points.pair[number]].tolist()
        values = zip(points.point[number], points.normal[number], speed.tolist(), impulse, bounce, strict=True)
        both = zip(points.bodies[number].tolist(), values, strict=True)
        return [Event(time, self.names[first], self.names[second], *each) for (first, second), each in both]

    def _find_near(self, time: float) -> float:
        """Find the pairs that can meet within a time; the least distance of any."""
        state, way = self.state, self._travel(time)
        self._margin = 1.5 * way + 2e-3  # m
        self._near = self._finder.near(state.bodies.position, state.bodies.rotation, self._margin, state.active)
        self._found = state.bodies.position.copy(), state.bodies.rotation.copy(), state.active
        return float(self._near.distance.min(initial=np.inf))

    def _still_near(self, time: float) -> bool:
        """Whether the pairs found last are those that can meet within a time: no body is elsewhere or faster."""
        (position, rotation, active), state = self._found, self.state
        moved = max(np.abs(state.bodies.position - position).max(), np.abs(state.bodies.rotation - rotation).max())
        faster = (self._travel(time) > self._margin).any() or (state.active & ~active).any()
        return bool(moved < 1e-9 and not faster)  # m: rounding of what is given

    def _travel(self, time: float) -> Array:
        """Most that a point of each body (n,) moves in a time, metres."""
        return np.asarray(motion_kernel.travel(self.state.bodies, self._pieces.lever, self.gravity, time))

    def _separate(self, least: float) -> tuple[float, float, float]:
        """Part pieces nearer than `LEAST_GAP`; the least distance then, the energy that was not paid [J], that lent."""
        state = self.state
        before, position = self.energy(), state.bodies.position.copy()
        for _ in range(4):
            last, points = least, self._finder.points(self._near)
            program = StepProgram(state, points, self.gravity, self._joints, np.zeros_like(self._yielding))
            motion_kernel.displace(state.bodies, program.separation(0.5 * SKIN))
            least = self._find_near(STEP)
            if least >= LEAST_GAP or least < 0.9 * last:  # what is squeezed cannot be parted
                break
        borne = points.bodies[self._yielding[points.bodies].any(axis=1)]
        lent = state.pay(position, self.gravity, borne)
        return least, max(0.0, self.energy() - before), lent

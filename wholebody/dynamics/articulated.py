"""A figure that yields: motion and impulses in joint space.

With the inertia M of the joints, springs K and dampers R towards a tracker, a step of h seconds has

    (M + h R + h^2 K) v+ = M v + h (K e - c) + (h R + h^2 K) v_tracked + J^T p,

e from the figure to the tracker, c the forces of motion and weight: implicit springs, of which any are stable. Those
that are soft, and move nothing that is near, have their forces half way (`free_motion`). The impulses p are equation 9
of Schmidl and Lin with the whole articulated body in it, J M^-1 J^T in place of its mass and inertia: what is hit
anywhere moves all joints. All contacts of the figure, and of what touches it with other things, have one program.
Impacts come first, without forces; a step ends where the next begins. M and c are those half way (midpoint rule);
joints without springs, in a step without contacts, move by the mean of v and v+. A root without spring and damper
ends a step with the momentum that impulses and weight gave what it carries; the velocities beside that are scaled so
that energy is conserved where nothing drives or touches the figure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross, with_values
from wholebody.base.checks import TIME_STEP
from wholebody.dynamics import impulse_kernel, solve_kernel
from wholebody.dynamics.coupling import Actuated, Moved, Points, drift, torques
from wholebody.dynamics.frame import EngineFrame, impacts
from wholebody.dynamics.free_motion import Springs, aligning, free_motion
from wholebody.dynamics.rigid_bodies import GRAVITY, STEP, RigidBodies
from wholebody.dynamics.sleeping import AFTER, STILL
from wholebody.dynamics.step_program import SKIN, Impulses
from wholebody.dynamics.touching import BOUNCE, Touching, pushed, undo
from wholebody.figures.state import free_roots
from wholebody.scene.scene import Scene

CREEPS = 1e-4  # m/s, as `STILL`, of a figure that springs or dampers lead to where it is to stay
LONGEST = 1.0 / 120.0  # s: of a step; with bodies near a fast figure it is the engine's
FAR = 0.15  # rad: gaps are not linear in a step that turns a piece by more
SHORTEST = 2e-4  # s: steps do not end earlier at an impact


class Articulated:
    """The joints of a figure in motion.

    Attributes:
        q: (nq,) the posture.
        velocity: (nv,) rad/s, m/s.
        impulses: name of a thing that moves by itself to the impulse (3,) that the figure gave it in the last frame.
        frames: of the engine, one for each step of the last frame.
        ends: when these steps ended, seconds since the frame began.
        points: contact points and joint limits in the last step.
    """

    def __init__(
        self, scene: Scene, q: Array, actuated: Actuated, engine: RigidBodies | None, gravity: Array | None = None
    ) -> None:
        """Begin at rest at the posture q (nq,), among the bodies of an engine."""
        actuated.check(scene.model)
        self._scene, self._engine, self._model, self.q = scene, engine, pin.Model(scene.model), np.array(q)
        self._gravity = np.array(GRAVITY if engine is None else engine.gravity) if gravity is None else gravity
        self._model.gravity.linear = self._gravity
        self._data, self._workspace = self._model.createData(), scene.workspace()
        self._touching = Touching(scene, self._workspace, self._model, engine)
        # m: most distances of pairs that a step may lead into each other; the engine looks at the others
        self._own_pairs = np.where(self._touching.free[self._workspace.table.pairs].any(axis=1), -np.inf, 1e-3)
        self._sag = np.zeros(2 * self._model.nv + len(self._own_pairs) + 1)  # m/s2: by limit, pair; the last for others
        self._old = Impulses.nothing(0)
        self.velocity, self.impulses, self.points = np.zeros(self._model.nv), dict[str, Array](), 0
        self.frames, self.ends = list[EngineFrame](), list[float]()
        self._tracked, self._asked, self._masses = self.q, b"", np.zeros((0, 0))
        self._turned, self._turning = 0.0, 0.0  # rad in the last step, rad/s
        self._slow_for, self._beside = 0.0, list[str]()  # s; bodies that the last step was about
        own = pin.crba(self._model, self._data, self.q).diagonal()
        light = own < 1e-5  # kg m2: of links without mass; turns of axes that align have nearly none either
        self._model.armature += np.where(light, 1e-5, 1e-3 * own * aligning(self._model))
        self.stiffness, self.damping = actuated.gains(self._inertia(self.q).diagonal())
        driven = (self.stiffness > 0.0) | (self.damping > 0.0)
        self._driven = bool(driven.any())
        freedoms = {k: np.arange(6) + self._model.idx_vs[k] for k in free_roots(self._model)}
        self._roots = [k for k in freedoms if not driven[freedoms[k]].any()]
        self._adrift: Indices = np.concatenate([np.zeros(0, dtype=np.intp), *(freedoms[k] for k in self._roots)])
        impulse_kernel.compiled_kernel()

    def advance(self, tracked: Array, dt: float, moved: Moved, segments: Mapping[str, int]) -> None:
        """Go on by a frame, towards the tracked posture (nq,) at its end; the things go on with it."""
        if self._rests(tracked, dt, moved, segments):
            return
        steady = pin.difference(self._model, self._tracked, tracked) / dt
        # so often steps may be made again to end at an impact: what is squeezed meets thousands
        now, left, self._stops, self._soon = 0.0, dt, 12, SHORTEST
        self.impulses, self.frames, self.ends = {}, [], []
        while left > TIME_STEP[0]:  # less is no step of the engine
            shares = (now / dt, min(1.0, (now + min(left, LONGEST)) / dt))
            motions = {name: tuple(pin.SE3.Interpolate(*way, s) for s in shares) for name, way in moved.items()}
            aim = np.asarray(pin.integrate(self._model, self._tracked, steady * now))
            step = self._step(min(left, LONGEST), aim, steady, motions, segments)
            now, left = now + step, left - step
            self.ends.append(now)
        self._tracked = np.array(tracked)
        # springs and dampers lead to their ends ever more slowly
        still = STILL if len(self._old.pair) and not self.stiffness.any() else CREEPS
        slow = np.abs(self.velocity).max(initial=0.0) < 1.0 and self._touching.fastest(self.q, self.velocity) < still
        self._slow_for = self._slow_for + dt if slow else 0.0

    def _rests(self, tracked: Array, dt: float, moved: Moved, segments: Mapping[str, int]) -> bool:
        """Whether the figure lies still for a frame, as what lies beside it does, and nothing hits it; then it is over.

        What is free of contacts and springs drifts on, however slow it is.
        """
        engine, pulled = self._engine, self._driven and bool((tracked != self._tracked).any())
        floats = len(self._roots) > 0 and not len(self._old.pair)
        self._slow_for = 0.0 if moved or pulled else self._slow_for  # one frame says little of how it goes on
        if self._slow_for < AFTER or floats or self._touching.awake(self._beside):
            return False
        back = None if engine is None else engine.way_back()
        frame = None if engine is None else engine.advance(dt, yielding=segments)
        if back is not None and frame is not None and not segments.keys().isdisjoint(frame.wrenches):
            back()
            self._slow_for = 0.0
            return False
        if engine is not None and frame is not None and frame.lent > 0.0:
            engine.state.slow(pushed(engine, frame), frame.lent)  # what lies still cannot pay
        self.velocity = np.zeros_like(self.velocity)  # its impulses go on as in the frame before
        self.frames, self.ends = [] if frame is None else [frame], [dt]
        return True

    def energy(self) -> float:
        """Kinetic and potential energy, joules."""
        return 0.5 * float(self.velocity @ self._inertia(self.q) @ self.velocity) + self._potential()

    def _potential(self) -> float:
        pin.centerOfMass(self._model, self._data, self.q, False)
        return -float(self._data.mass[0] * (self._gravity @ self._data.com[0]))

    def momentum(self) -> Array:
        """Momentum [kg m/s] and angular momentum about the world's origin [kg m2/s], (6,)."""
        centroidal = pin.computeCentroidalMomentum(self._model, self._data, self.q, self.velocity)
        linear = np.array(centroidal.linear)
        return np.concatenate([linear, centroidal.angular + cross(self._data.com[0], linear)])

    def _inertia(self, q: Array) -> Array:
        """The inertia (nv, nv) of the joints at a posture (nq,): the last one again where that is the same."""
        if (asked := q.tobytes()) != self._asked:  # of joints that follow, the other convention adds to the last one
            self._asked, self._masses = asked, np.array(pin.crba(self._model, self._data, q, pin.Convention.WORLD))
        return self._masses

    def _step(self, time: float, aim: Array, steady: Array, moved: Moved, segments: Mapping[str, int]) -> float:
        """Advance by at most a time, to the next impact if that comes first; by how much."""
        figure, impulses = (self.q, self.velocity, self._old), self.impulses.copy()
        back = None if self._engine is None else self._engine.way_back()
        most, again = min(STEP, time) if self._turning * time > FAR else time, False
        if back is None and self._turning * most > FAR and self._stops > 0:  # as limbs turned in the last step
            self._stops, most = self._stops - 1, max(0.5 * SHORTEST, 0.14 / self._turning)
        while True:
            done, frame, sunk = self._attempt(most, time, aim, steady, moved, segments)
            met = [] if frame is None else [event.time for event in impacts(frame.events, segments, BOUNCE)]
            angle = self._turned
            far = angle > FAR or sunk
            if far and done > STEP:
                most = STEP
            elif (met or sunk or (far and back is None)) and done > SHORTEST and self._stops > 0:
                # what is squeezed meets it again and again
                self._stops = 0 if frame is not None and frame.deepest > 1e-4 else self._stops - 1
                # the next step begins with the impact; one that comes earlier in a shorter step is not waited for
                shorter = 0.7 * done if sunk or again or not met else done
                until = min(min(met, default=done) - 0.5 * SHORTEST, shorter, 0.14 * done / max(angle, 0.14))
                most, again = max(0.5 * SHORTEST, until), True
            else:
                self.frames += [] if frame is None else [frame]
                self._turning = angle / done
                return done
            (self.q, self.velocity, self._old), self.impulses = figure, impulses.copy()
            if back is not None:
                back()

    def _attempt(
        self, time: float, planned: float, aim: Array, steady: Array, moved: Moved, segments: Mapping[str, int]
    ) -> tuple[float, EngineFrame | None, bool]:
        """A step of at most a time, of a `planned` one: by how much, what the things did, whether it led too deep."""
        model, engine = self._model, self._engine
        began, start, stood = self.energy(), self.velocity, self._touching.joints(self.q)
        had = began + (0.0 if engine is None else engine.energy())
        points = self._touching.points(self.q, start, planned, moved)
        masses_begun = self._inertia(self.q)
        blow = self._bounce(masses_begun, points)
        fast = bool(points.bodies) and self._touching.fastest(self.q, start) > 2.0  # m/s
        time = self._until_impact(points, min(time, STEP) if fast else time)
        begin, apart = self.velocity, np.asarray(pin.difference(model, self.q, aim))
        share = Springs.shares(self.stiffness, self.damping, masses_begun.diagonal(), time, points.figure)
        springs = Springs(self.stiffness, self.damping, apart, steady, share)
        driven, self.velocity, mean, borne = free_motion(model, self._data, self._inertia, self.q, begin, time, springs)
        points, bearing, parting = self._bear(driven, points, time)
        self._beside = points.bodies
        blow = np.vstack([blow, np.zeros((len(bearing) - len(blow), 3))])
        impulse, after, pressed = blow + bearing, self.velocity, bool(bearing.any())
        pin.centerOfMass(model, self._data, self.q)
        momentum = masses_begun @ start + points.figure.T @ impulse.ravel()
        drifted = [
            drift(self._data, root, momentum[model.idx_vs[root] :][:6], self._gravity, time, pressed)
            for root in self._roots
        ]
        springs = with_values(springs, share=np.where(points.figure.any(axis=0), 1.0, share))  # of far limits too
        way = np.where((self.stiffness > 0.0) | pressed, springs.taken(begin, after), mean)
        way *= points.share(time * way)  # what a program that is not solved leaves
        motor, moves = springs.forces(time, way) + borne, time * way
        first, last = points.figure @ (0.5 * (start + begin)), points.figure @ after
        work = (blow * first.reshape(-1, 3) + bearing * last.reshape(-1, 3)).sum(axis=1)
        # what parts an overlap has its energy from nowhere
        work -= np.maximum(0.0, (bearing * parting.reshape(-1, 3)).sum(axis=1))
        had += float(motor @ moves)
        paid = float(motor @ moves + work[points.driven].sum())
        rise = self._move(moves, drifted, np.inf if self.stiffness.any() else began + paid)
        if self._driven:
            paid -= springs.excess(time, way, pin.difference(model, self.q, pin.integrate(model, aim, time * steady)))
            paid += rise - float(borne @ moves) if self.stiffness.all() else 0.0  # all the weight is borne
        stands = self._touching.joints(self.q)
        self._turned = self._touching.turned(stood, stands)
        motions = {name: (way[0], pin.SE3.Interpolate(*way, time / planned)) for name, way in moved.items()}
        again = time > SHORTEST and self._stops > 0
        ended = points.gap + points.figure[::3] @ moves + time * points.given[::3]
        if self._sunk(points, ended, time, {name: way[1] for name, way in motions.items()}) and again:
            return time, None, True
        most = 1.0 if impulse.any() or self.stiffness.any() else 1.05
        things = 0.0 if engine is None else engine.energy()
        if self._settle(began + paid, most, [momentum for momentum, _ in drifted], had - things) and again:
            return time, None, True
        if engine is None:
            return time, None, False
        held, places = points.held(bearing), self._touching.carried(segments, stood, stands)
        unpushed = engine.state.bodies.twist + [*(time * self._gravity), 0.0, 0.0, 0.0]
        frame = engine.advance(time, places.and_others(motions), held, segments, BOUNCE if again else np.inf)
        given = {name: wrench for name, wrench in frame.wrenches.items() if name in segments}
        ways = {name: places.way(name) for name in given}
        paid = self.energy() + sum(float(wrench @ ways[name]) for name, wrench in given.items()) / time - frame.lent
        late = not again and bool(impacts(frame.events, given, BOUNCE))
        if late or self._react(given, paid, segments, had - engine.energy()):
            undo(engine, frame, unpushed, had - self.energy())
        elif frame.lent > 0.0 and (over := self.energy() - paid) > 0.0:  # what lies still cannot pay
            engine.state.slow(pushed(engine, frame), min(over, frame.lent))
        return time, frame, False

    def _sunk(self, points: Points, ended: Array, time: float, moved: Mapping[str, pin.SE3]) -> bool:
        """Whether a step of points that sought gaps (m,) led deeper into what the engine does not keep apart."""
        self._workspace.place(moved)
        near = self._workspace.proximity.query(self._workspace.state.at(self.q).data, 1e-3, self._own_pairs)
        self._sag = points.sag(ended, near, time, len(self._sag))
        began = points.gap[points.pair >= 2 * self._model.nv].min(initial=0.0)
        return bool(near.distance.min(initial=0.0) < min(-1e-4, began))  # m

    def _relative(self, points: Points) -> Array:
        """Velocities (3 m,) at the points along their axes, m/s."""
        engine = self._engine
        twists = [engine.twist(name) for name in points.bodies] if engine is not None else []
        moving = points.things @ np.concatenate(twists) if twists else 0.0
        return np.asarray(points.figure @ self.velocity + moving + points.given)

    def _until_impact(self, points: Points, time: float) -> float:
        """The time to the first impact if that comes within a time."""
        speed = (relative := self._relative(points))[::3]
        coming = (points.restitution * speed < -BOUNCE) & ~points.met(relative, SKIN, SHORTEST, self._soon)
        first = float(((points.gap[coming] - SKIN) / -speed[coming]).min(initial=time))
        self._soon += SHORTEST if first < time else 0.0  # of many impacts in a frame the later ones are taken together
        return min(max(first, SHORTEST), time)

    def _bounce(self, inertia: Array, points: Points) -> Array:
        speed = self._relative(points)
        approach = speed[::3]
        hit = (points.restitution * approach < -BOUNCE) & points.met(speed, SKIN, SHORTEST, self._soon)
        target = np.where(hit, -points.restitution * approach, -np.inf)
        target = np.where((points.gap <= 2.0 * SKIN) & ~hit, 0.0, target)  # what is pressed together passes the blow on
        if not hit.any():
            return np.zeros((len(target), 3))
        impulse, _, change = self._solved(inertia, points, speed, target)
        self._give(points, impulse, change)
        return impulse

    def _bear(self, inertia: Array, points: Points, time: float) -> tuple[Points, Array, Array]:
        """Keep points, and joints, apart at the end of a step: these, impulses (m, 3), velocities (3 m,) there."""
        old, falling, found = self._old.over(time), 0.0, np.zeros((len(points.gap), 3))
        solve_kernel.warm_start((old.pair, old.local, old.impulse), (points.pair, points.place), points.axes, found)
        if points.bodies and self._engine is not None:
            weights = np.array([self._engine.weight(name) for name in points.bodies])
            falling = time * np.einsum("bij,bj->bi", points.responses[:, :, :3], weights).ravel()
        for again in range(4):
            sag = self._sag[np.minimum(points.pair, len(self._sag) - 1)]
            room = points.gap + time**2 * sag - SKIN  # a step removes an overlap
            # m/s, at most; what comes from afar stops short by a tolerance, so that the engine does not meet it before
            target = np.where(room >= 0.0, -room / time, np.minimum(-room / time, 0.5)) + 1e-6 * (room > 1e-3 * time)
            speed = self._relative(points) + (points.things @ falling if points.bodies else 0.0)
            found, after, change = self._solved(inertia, points, speed, target, found)
            ahead = self.velocity + change  # impulses turn joints towards limits that were far away
            reach = np.full(len(ahead), np.inf) if again == 2 else time * np.abs(ahead)
            count, points = len(found), self._touching.limits(points, self.q, reach)
            if len(points.gap) == count:
                break
            found = np.vstack([found, np.zeros((len(points.gap) - count, 3))])
        self._give(points, found, change)
        bearing, self.points = np.flatnonzero(found[:, 0] > 0.0), len(found)
        world = np.einsum("cr,crk->ck", found[bearing], points.axes[bearing])
        self._old = Impulses(points.pair[bearing], points.place[bearing], world, np.zeros((0, 3)), time)
        return points, found, after

    def _solved(
        self, inertia: Array, points: Points, speed: Array, target: Array, start: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Impulses (m, 3) of least normal velocities from others, these (3 m,), and what they change of the joints'.

        Without a start they are those of blows. Points that part fast are in the program if its impulses stop that.
        """
        impulse, velocities, change = np.zeros((len(target), 3)), speed.copy(), np.zeros(len(inertia))
        kept = (target > -np.inf) & (speed[::3] < target + 0.3)  # m/s
        kept |= False if start is None else start[:, 0] > 0.0
        while len(chosen := np.flatnonzero(kept)):
            rows = (3 * chosen[:, None] + np.arange(3)).ravel()
            begun, mobility = speed[rows], impulse_kernel.mobilities(inertia, points.figure[rows])
            impulse_kernel.add_bodies(mobility, points.things[rows], points.responses)
            begin = None if start is None else start[chosen]
            found, after = impulse_kernel.impulses(mobility, begun, points.friction[chosen], target[chosen], begin)
            flat = found.ravel()
            gain = float(flat @ (begun + after))
            if start is None and gain > 0.0:  # as friction can where it is coupled with the normal: then less
                found = found * max(0.0, 1.0 - gain / float(flat @ mobility @ flat))
                flat, after = found.ravel(), begun + mobility @ found.ravel()
            impulse[chosen] = found
            change = impulse_kernel.by_inertia(inertia, points.figure[rows].T @ flat)
            pushed = np.einsum("bij,bj->bi", points.responses, (points.things[rows].T @ flat).reshape(-1, 6))
            velocities = speed + points.figure @ change + points.things @ pushed.ravel()
            velocities[rows] = after
            more = (target > -np.inf) & ~kept & (velocities[::3] < target - 1e-6)
            if not more.any():
                break
            kept, start = kept | more, None if start is None else impulse
        return impulse, velocities, change

    def _give(self, points: Points, impulse: Array, change: Array) -> None:
        """Give impulses (m, 3), which change the velocity by (nv,), to the joints and to the things."""
        self.velocity = self.velocity + change
        for name, wrench in zip(points.bodies, (points.things.T @ impulse.ravel()).reshape(-1, 6), strict=True):
            if wrench.any():
                self._engine.push_about_centre(name, wrench)  # type: ignore[union-attr]
                self.impulses[name] = self.impulses.get(name, np.zeros(3)) + wrench[:3]

    def _move(self, way: Array, drifted: Sequence[tuple[pin.Force, Array]], energy: float) -> float:
        """Move the joints by a way (nv,), and nothing above a potential energy [J]; by how much it rises."""
        model, data = self._model, self._data
        start, lowest = self.q, self._potential()
        self.q = np.array(pin.integrate(model, start, way))
        pin.centerOfMass(model, data, self.q)
        for root, (_, centre) in zip(self._roots, drifted, strict=True):
            first, seat = model.idx_qs[root], model.jointPlacements[root].rotation
            self.q[first : first + 3] += seat.T @ (centre - data.oMi[root].act(data.com[root]))
        rise, most = self._potential() - lowest, max(0.0, energy - lowest)
        if rise > most:  # of so little, the rise is nearly proportional to the way
            part = 0.99 * most / rise * pin.difference(model, start, self.q)
            self.q, rise = np.array(pin.integrate(model, start, part)), most
        return rise

    def _settle(self, energy: float, most: float, momenta: Sequence[pin.Force], left: float) -> bool:
        """Give free roots their momenta, and scale other velocities so that the energy is at most `energy`.

        Momenta alone may take what is `left` of the energy of all that moves by itself, of which blows lose some. True
        where that is not nearly enough for them.
        """
        masses, roots, velocity = self._inertia(self.q), self._adrift, self.velocity
        pin.forwardKinematics(self._model, self._data, self.q)
        drift = np.zeros_like(velocity)
        if len(roots):
            kept = [self._data.oMi[k].actInv(one).vector for k, one in zip(self._roots, momenta, strict=True)]
            locked = masses[np.ix_(roots, roots)]
            drift[roots] = impulse_kernel.by_inertia(locked, np.concatenate(kept))
            velocity = velocity.copy()
            velocity[roots] = 0.0
            velocity[roots] = -impulse_kernel.by_inertia(locked, masses[roots] @ velocity)
        kinetic = [0.5 * float(part @ masses @ part) for part in (drift, velocity)]
        room = max(energy, min(left, kinetic[0] + self._potential())) - self._potential()
        if kinetic[1] > 0.0:
            velocity = velocity * min(most, np.sqrt(max(0.0, (room - kinetic[0]) / kinetic[1])))
        short = kinetic[0] - max(0.0, room)
        if short > 0.0:
            drift = drift * np.sqrt(max(0.0, room) / kinetic[0])
        self.velocity = drift + velocity
        return bool(short > 1e-6 * self._data.mass[0])  # J/kg: what rests has less

    def _react(self, given: Mapping[str, Array], paid: float, segments: Mapping[str, int], left: float) -> bool:
        """Give the figure the impulses that things gave its segments while they went on; arguments as of `_settle`.

        True, and nothing changes, where that would take more energy than is left.
        """
        if not given and paid >= self.energy():
            return False
        before, first, inertia = self.velocity, self._model.idx_vs, self._inertia(self.q)
        joints = {name: self._model.frames[segments[name]].parentJoint for name in given}
        pushed = torques(self._model, self._data, self.q, [(joints[name], wrench) for name, wrench in given.items()])
        self.velocity = before + impulse_kernel.by_inertia(inertia, pushed)
        pushed = inertia @ self.velocity
        momenta = [self._data.oMi[k].act(pin.Force(pushed[first[k] : first[k] + 6])) for k in self._roots]
        if short := self._settle(paid, 1.0, momenta, left):
            self.velocity = before
        return short

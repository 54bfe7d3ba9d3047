"""What a figure that yields can touch within a step: its points, those of things, and their blows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, cross, with_values
from wholebody.dynamics import impulse_kernel
from wholebody.dynamics.coupling import Moved, Points, approaches
from wholebody.dynamics.frame import EngineFrame, Given
from wholebody.dynamics.pieces import Surfaces, needed, places
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.dynamics.step_program import SKIN, TOUCH
from wholebody.geometry.contact_rows import ContactRowBuilder, compiled_kernel
from wholebody.geometry.flesh import flesh_of
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace

BOUNCE = 0.1  # m/s: slower rebounds, of up to 0.5 mm, are left out


class Touching:
    """Finds the points of a figure, for one run.

    Attributes:
        free: (pieces,) which are of bodies that move by themselves.
    """

    def __init__(self, scene: Scene, workspace: Workspace, model: pin.Model, engine: RigidBodies | None) -> None:
        self._workspace, self._model, self._engine = workspace, model, engine
        self._rows, self._flesh = ContactRowBuilder(workspace.table, 4, 0.995), flesh_of(scene.geometry)
        bodies = () if engine is None else engine.names
        self._names = list(dict.fromkeys((*bodies, *workspace.owners)))  # the engine's first
        self._number = {name: k for k, name in enumerate(self._names)}
        self._owners: Indices = np.array([self._number[name] for name in workspace.owners], dtype=np.intp)
        self._bodies = () if engine is None else engine.bodies
        self.free: Mask = self._owners < len(self._bodies)
        self._carrying = np.unique(workspace.table.joint)
        self._where = np.full((len(self._bodies), 12), np.nan)
        self._surfaces = Surfaces(scene, self._names)
        single = [(one.idx_q, one.idx_v) for one in model.joints[1:] if one.nq == one.nv == 1]  # [0]: the world
        self._limited: Indices = np.array(single, dtype=np.intp).reshape(-1, 2)
        self._seats: tuple[Mapping[str, int], Indices, Array] | None = None  # of segments in their joints
        compiled_kernel()

    def carried(self, segments: Mapping[str, int], before: Array, after: Array) -> Given:
        """The motions of segments whose joints are at placements (joints, 4, 3) before and after."""
        if self._seats is None or self._seats[0] is not segments:
            frames = [self._model.frames[number] for number in segments.values()]
            joints: Indices = np.array([frame.parentJoint for frame in frames], dtype=np.intp)
            seats = np.array([frame.placement.homogeneous for frame in frames]).reshape(-1, 4, 4)
            self._seats = segments, joints, seats
        _, joints, seats = self._seats
        placed = np.zeros((len(joints), 2, 4, 4))
        placed[:, 0, :3], placed[:, 1, :3] = before[joints].transpose(0, 2, 1), after[joints].transpose(0, 2, 1)
        placed[:, :, 3, 3] = 1.0
        return Given(list(segments), placed @ seats[:, None])

    def points(self, q: Array, velocity: Array, time: float, moved: Moved) -> Points:
        """What the figure can touch within a time, at a posture (nq,) and a velocity (nv,), and limits in its reach."""
        workspace, engine, model, free = self._workspace, self._engine, self._model, len(self._bodies)
        self._place({name: way[0] for name, way in moved.items()})
        twists = np.zeros((len(self._names), 6))  # at the origin, of what is moved
        for name, (before, after) in moved.items():
            twists[self._number[name]] = pin.log6(after * before.inverse()).vector / time
        speed = self._approach(q, velocity, twists)
        # m: what is hit in this step can be faster after it
        most = 2e-3 + np.minimum(0.2, time * (1.5 * speed + 0.5 * min(float(speed.max(initial=0.0)), 10.0)))
        near = workspace.proximity.query(workspace.state.data, float(most.max(initial=0.0)), most)
        rows = self._rows.rows(near)
        normal, place = np.ascontiguousarray(rows.wrench[:, :3]), places(rows.wrench, near, rows.contact)
        own = (rows.first > 0) | (rows.second > 0)
        kept = np.flatnonzero(own & needed(rows.contact, len(near.distance), normal, place, rows.gap, TOUCH))
        contact, sides = rows.contact[kept], np.stack([rows.first[kept], rows.second[kept]], axis=1)
        normal, place, gap = normal[kept], place[kept], rows.gap[kept]
        owner, pair = self._owners[near.pair[contact]], near.number[contact]
        if engine is not None and (touched := np.unique(owner[owner < free])).size:
            others = engine.contacts([self._names[k] for k in touched.tolist()])
            owner, gap = np.concatenate([owner, others.bodies]), np.concatenate([gap, np.maximum(others.gap, SKIN)])
            normal, place = np.concatenate([normal, others.normal]), np.concatenate([place, others.point])
            pair = np.concatenate([pair, len(workspace.table.pairs) + others.pair])
        bodies = np.unique(owner[owner < free])
        made = Points.room(
            len(owner), workspace.state.jacobian.shape[1], [self._names[k] for k in bodies.tolist()], engine
        )
        made.place[:], made.gap[:] = place, gap
        made.restitution[:], made.friction[:] = self._surfaces(owner)
        made.pair[:] = 2 * model.nv + pair  # after the limits
        slot: Indices = np.full(len(self._names), -1, dtype=np.intp)
        slot[bodies] = np.arange(len(bodies))
        centres = np.zeros((0, 3)) if engine is None else engine.state.bodies.position[bodies]
        state = workspace.state
        impulse_kernel.point_rows(
            (normal, place, owner), (sides, state.support, np.ascontiguousarray(state.jacobian)),
            (slot, centres, twists), (made.axes, made.figure, made.things, made.given, made.driven),
        )  # fmt: skip
        made = with_values(made, figure=state.folded(made.figure))  # joints that follow others move with them
        made.add_flesh(state, workspace.geometry, self._flesh, near.pair[contact])
        return self.limits(made, q, 0.02 + 1.5 * time * np.abs(velocity))

    def _place(self, moved: Mapping[str, pin.SE3]) -> None:
        """See things where they are: those that moved by themselves since, and those that are moved."""
        engine, now = self._engine, dict(moved)
        if engine is not None:
            bodies, free = engine.state.bodies, len(self._bodies)
            where = np.hstack([bodies.position[:free], bodies.rotation[:free].reshape(-1, 9)])
            for k in np.flatnonzero((where != self._where).any(axis=1)).tolist():
                now[self._bodies[k]] = engine.placement(self._bodies[k])
            self._where = where
        self._workspace.place(now)

    def limits(self, points: Points, q: Array, reach: Array) -> Points:
        """Points and the limits within reaches (nv,) at a posture (nq,)."""
        return points.with_limits(self._model, self._limited, q, reach)

    def joints(self, q: Array) -> Array:
        """Placements (joints, 4, 3) of the joints at a posture (nq,), see `State.joints`."""
        return np.array(self._workspace.state.at(q).joints)

    def turned(self, before: Array, after: Array) -> float:
        """By how much any piece of the figure turns between placements (joints, 4, 3) of the joints, radians."""
        ends = (placed[self._carrying, :3] for placed in (before, after))
        cosine = 0.5 * (np.einsum("kij,kij->k", *ends) - 1.0)
        return float(np.arccos(np.clip(cosine.min(initial=1.0), -1.0, 1.0)))

    def _twists(self, q: Array, velocity: Array) -> Array:
        """Twists (pieces, 6) at the origin of the pieces, those of things zero."""
        state = self._workspace.state.at(q)
        twists: Array = ((state.support * state.spread(velocity)) @ state.columns)[self._workspace.table.joint]
        return twists

    def _approach(self, q: Array, velocity: Array, moved: Array) -> Array:
        """How fast the pieces of every pair can approach each other (pairs,), m/s; `moved` (n, 6): see `points`."""
        workspace, twists = self._workspace, moved
        twist = self._twists(q, velocity)
        if self._engine is not None:
            bodies, free = self._engine.state.bodies, len(self._bodies)
            own = bodies.twist[:free]
            twists = moved.copy()
            twists[:free] = np.hstack([own[:, :3] + cross(bodies.position[:free], own[:, 3:]), own[:, 3:]])
        twist = twist + twists[self._owners]
        return approaches(workspace.table, workspace.proximity.place(workspace.state.data)[:, 3], twist)

    def fastest(self, q: Array, velocity: Array) -> float:
        """A bound of the speed of all points of the figure, m/s."""
        workspace, own = self._workspace, self._workspace.table.joint > 0
        twist = self._twists(q, velocity)[own]
        centres = workspace.proximity.place(workspace.state.data)[own, 3]
        speed = np.linalg.norm(twist[:, :3] + cross(twist[:, 3:], centres), axis=1)
        return float((speed + workspace.table.reach[own] * np.linalg.norm(twist[:, 3:], axis=1)).max(initial=0.0))

    def awake(self, bodies: list[str]) -> bool:
        """Whether one of these bodies moves."""
        return self._engine is not None and bool(
            self._engine.state.bodies.moving[[self._number[name] for name in bodies]].any()
        )


def undo(engine: RigidBodies, frame: EngineFrame, began: Array, most: float) -> None:
    """Give the things that were pushed in a step the velocities that they would have without.

    To the engine the motion of the figure is given, which brings energy. The next step has the blows at its start.

    Args:
        engine: after the step.
        frame: the step.
        began: (n, 6) the twists of the engine's bodies that weight alone would give them.
        most: energy of the things before, J.
    """
    moved = pushed(engine, frame)
    for number in np.flatnonzero(moved).tolist():
        name = engine.names[number]
        change = began[number] - engine.twist(name)
        wrench = np.asarray(np.linalg.lstsq(engine.response(name), change, rcond=None)[0], dtype=np.float64)
        engine.push_about_centre(name, wrench)
    if (gain := engine.energy() - most) > 0.0:  # they are not where they would be
        engine.state.slow(moved, gain)


def pushed(engine: RigidBodies, frame: EngineFrame) -> Mask:
    """Bodies (n,) of the engine that move by themselves and were pushed in a frame."""
    things = frozenset(engine.bodies) & frame.wrenches.keys()
    return np.array([name in things for name in engine.names])

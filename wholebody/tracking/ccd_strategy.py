"""overlap="ccd": overlap is removed limb by limb by coordinate descent, or by a displacement of a rigid figure."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.passing_through import last_free
from wholebody.geometry.penetration import global_depth
from wholebody.methods.ccd.frames import resolve_overlap
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import Resolution
from wholebody.tracking.qp_strategy import largest_motions


class CCDStrategy:
    """Follows tracked postures by the loop of Schmidl and Lin, in frames of `dt` seconds, from a shown posture."""

    sweep_tolerance = 8e-4

    def __init__(self, scene: Scene, shown: Array, dt: float, seed: int) -> None:
        self.scene = scene
        # rad/s and m/s: fast enough to return from 2 rad in half a second, slow enough not to look like a jump
        self._largest_motion = largest_motions(scene, 4.0 * dt, 2.0 * dt)
        self._tracked = shown
        self._rng = np.random.default_rng(seed)

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
        largest_motion = self._largest_motion + np.abs(pin.difference(self.scene.model, self._tracked, tracked))
        self._tracked = tracked
        result = resolve_overlap(self.scene, shown, tracked, self._rng, largest_motion)
        # remaining depth, metres, from which a frame's note reports it
        note = f"{1e3 * result.deepest:.1f} mm of overlap are left" if result.deepest > 1e-3 else ""
        return Resolution(
            candidates=(result.q,),
            contact_seconds=result.contact_seconds,
            solve_seconds=result.ik_seconds,
            iterations=result.iterations,
            joints=result.joints,
            pairs=result.pairs,
            note=note,
            swept=result.swept,
        )


class RigidTranslation:
    """Tracked postures with a free root translated as a rigid body by PD_g (Schmidl and Lin, equation 1) until free."""

    sweep_tolerance = 2e-4

    def __init__(self, scene: Scene) -> None:
        if scene.figure.root != "free":
            what = "are several figures" if scene.figure.members else "is fixed to the world"
            raise InputError(f"{scene.figure.name} {what} and cannot be displaced as one; leave rigid out")
        self.scene, self.model, self._workspace = scene, scene.model, scene.workspace()
        segments = set(scene.figure.segments) | {n for n, thing in scene.objects.items() if thing.segment is not None}
        self._mine = np.array([owner in segments for owner in scene.piece_owner])
        owners = list(dict.fromkeys(scene.piece_owner))
        self._owner = np.array([owners.index(owner) for owner in scene.piece_owner])

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
        self._workspace.refresh()
        began, queried = time.perf_counter(), self._workspace.proximity.seconds
        self._displacements, self._pairs = 0, 0
        self._out: list[Array] = []
        note, q = "", self._displaced(np.concatenate([shown[:7], tracked[7:]]))
        if q is None:
            q, note = shown, "the fingers would be inside each other or have no room; they stay"
        for _ in range(6):  # most steps a frame: 3.6 m/s at 60 frames a second
            drawn = self._toward(q, tracked)
            following = self._displaced(drawn)
            if following is None:  # the last free position of the motion (algorithm 1, step 4), by 8 halvings
                following = last_free(self.model, q, drawn, lambda q: len(self._overlaps(q)[0]), 8)
            # m, rad: a step that brings the hand nearer by less than this ends the frame
            if self._root_distance(following, tracked) > self._root_distance(q, tracked) - 1e-5:
                break
            q = following
        queried = self._workspace.proximity.seconds - queried
        spent = time.perf_counter() - began - queried
        return Resolution((q,), queried, spent, self._displacements, 0, self._pairs, note)

    def _toward(self, q: Array, tracked: Array) -> Array:
        """A step of the root towards the tracked one, tangential to the obstacles of this frame, so that it slides."""
        way = np.asarray(pin.difference(self.model, q, tracked))
        turn = pin.Quaternion(q[3:7]).toRotationMatrix()
        for out in self._out:
            way[:3] -= min(0.0, float(way[:3] @ (turn.T @ out))) * (turn.T @ out)
        # steps of 10 mm and 0.1 rad: less than half the width of thin pieces (a table's top, a finger), to the far
        # side of which the hand would leave
        long = max(float(np.linalg.norm(way[:3])) / 0.01, float(np.linalg.norm(way[3:6])) / 0.1, 1.0)
        way[:6] /= long
        way[6:] = 0.0
        return np.asarray(pin.integrate(self.model, q, way))

    def _displaced(self, q: Array) -> Array | None:
        """The hand displaced by PD_g until nothing overlaps; None if that does not end."""
        q = q.copy()
        # most displacements a step; one is enough for one pair, and in a corner the walls alternate
        for _ in range(30):
            depths, normals, obstacles = self._overlaps(q)
            if not len(depths):
                return q
            self._displacements += 1
            self._pairs = max(self._pairs, len(depths))
            if (obstacles < 0).any():
                return None  # two of its own pieces: no translation separates them
            for obstacle in np.unique(obstacles):
                of = obstacles == obstacle
                push = global_depth(depths[of], normals[of])
                length = float(np.linalg.norm(push))
                if length < 1e-6:  # m: a shorter PD_g has no direction
                    return None  # opposed normals cancel (figure 4b)
                # m beyond PD_g: room for the arcs of fingertips from frame to frame
                q[:3] += push * (1.0 + 5e-4 / length)
                self._out = [*self._out[-1:], push / length]
        return None

    def _overlaps(self, q: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """Depths (k,), normals (k, 3) out of the obstacle, and the obstacles (k,), -1 for pieces of its own."""
        contacts = self._workspace.near(q, 0.0).nearest_first()
        first, second = contacts.pair[:, 0], contacts.pair[:, 1]
        mine = self._mine[first]
        normals = np.where(mine[:, None], -contacts.normal, contacts.normal)
        obstacle = self._owner[np.where(mine, second, first)]
        obstacle = np.where(self._mine[first] & self._mine[second], -1, obstacle)
        return -contacts.distance, normals, obstacle

    def _root_distance(self, q: Array, tracked: Array) -> float:
        """Remaining distance of the root, metres, with radians converted by a hand's length of 0.2 m."""
        way = np.asarray(pin.difference(self.model, q, tracked))
        return float(np.linalg.norm(way[:3]) + 0.2 * np.linalg.norm(way[3:6]))

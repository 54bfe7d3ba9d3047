"""overlap="qp": the nearest posture to the tracked one without overlap, by a few quadratic programs a frame."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.geometry.proximity import PENETRATION, Contacts
from wholebody.methods.ccd.resolver import OverlapResolver, chains_of
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace
from wholebody.tasks import ReachCones
from wholebody.tasks.base import Bound
from wholebody.tasks.bounds import clipped
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance
from wholebody.tracking.frame import Resolution

CLEARANCE = 1e-3
"""Clearance of pieces, metres. A step is exact to first order only; the clearance must exceed its error."""


class Attraction(DistanceMeasure):
    """Weighted squared distance from the tracked posture: ``sum_i w_i d_i^2``, d the tangent vector from there."""

    def __init__(self, q: Array, weights: Array) -> None:
        """Attract to q (nq,) with weights (nv,), 1/rad^2 and 1/m^2."""
        self.distance = SquaredDistance.build(q, weights)
        self._weights = self.distance.weights.copy()

    def toward(self, q: Array) -> None:
        """Attract to another posture (nq,)."""
        self.distance.reference[:] = q

    def weigh(self, factors: Array) -> None:
        """Multiply the weights of the beginning by factors (nv,), which are positive."""
        np.multiply(self._weights, factors, out=self.distance.weights)
        np.multiply(2.0, self.distance.weights, out=self.distance.curvature)


class FrameMotionLimit(Bound):
    """Bounds the motion of a whole frame, whatever the number of its steps."""

    def __init__(self, model: pin.Model, limit: Array) -> None:
        """Allow `limit` (nv,) a frame to either side, radians and metres."""
        self._limit = limit
        self._begin = pin.neutral(model)

    def begin(self, q: Array) -> None:
        """Begin a frame at the posture q (nq,)."""
        self._begin = np.array(q)

    def kept(self, model: pin.Model, q: Array) -> Array:
        """The posture q (nq,), or the nearest one within the motion of a frame."""
        return clipped(model, self._begin, q, np.stack([-self._limit, self._limit]))

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """The remaining motion of the frame."""
        gone = np.asarray(pin.difference(state.model, self._begin, state.q))
        return np.minimum(-self._limit - gone, 0.0), np.maximum(self._limit - gone, 0.0)


class QPStrategy:
    """Follows tracked postures by a tracker of `QP`, `dt` [s], from a free start (nq,); `rigid` figures as a whole."""

    # things in `touching` may be touched; from all others the figure keeps `CLEARANCE`

    sweep_tolerance = 5e-5

    def __init__(self, scene: Scene, start: Array, dt: float, rigid: bool, touching: Sequence[str] = ()) -> None:
        self.scene, self.dt = scene, dt
        # rad/s, above that of people, and m/s: a released figure returns soon but does not jump
        most = largest_motions(scene, 8.0 * dt, 3.0 * dt)
        self._motion_limit = FrameMotionLimit(scene.model, most)
        self._attraction = Attraction(start, weights(scene, rigid))
        cones = [ReachCones()] if scene.figure.cones else []
        mine = [*scene.figure.segments, *(name for name, thing in scene.objects.items() if thing.segment is not None)]
        self.problem = Problem(
            scene, start, constraints=[self._motion_limit, *cones], measures=[self._attraction], clearance=CLEARANCE,
            touching=[(part, name) for name in touching for part in mine],
        )  # fmt: skip
        self._tracker = QP().tracker(self.problem, dt)
        self._entanglement = None if rigid else Entanglement(scene, self._tracker.workspace, most)
        self._into_cones = OverlapResolver(scene, scene.workspace()).into_cones if cones else np.array

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame: from the overlap-free posture `shown` towards `tracked`, both (nq,), as near as possible."""
        workspace = self._tracker.workspace
        proximity = workspace.proximity
        began, queried = time.perf_counter(), proximity.seconds
        tracked = self._into_cones(tracked)
        self._attraction.toward(tracked)
        if self._entanglement is not None:
            self._attraction.weigh(self._entanglement.weights(shown, tracked))
        self._motion_limit.begin(shown)
        q = shown
        candidates: list[Array] = []
        path: list[tuple[float, Array]] = []
        # One program is enough without contact, the second corrects its second-order error; more take longer.
        while len(candidates) < 2:
            step = self._tracker.step(q)
            # steps of a root that turns do not add, and rows of cones are exact to first order only
            q = self._into_cones(self._motion_limit.kept(self.scene.model, step.q))
            candidates.append(q)
            path += [*step.path[:-1], (1.0, q)] if step.path else [(1.0, q)] if path else []
            # largest entry of a step, radians and metres, below which the frame is done
            if np.abs(step.displacement).max() < 1e-4 or not step.rows:
                break
        contacts = workspace.near(q, 1.01 * CLEARANCE)
        if self._entanglement is not None:
            self._entanglement.update(shown, q, tracked, contacts)
        pairs = int((contacts.distance < self.problem.clearances[contacts.number] + 0.01 * CLEARANCE).sum())
        queried = proximity.seconds - queried
        whole = time.perf_counter() - began
        joints = len(candidates) * (self.scene.model.njoints - 1) if pairs else 0
        return Resolution(
            tuple(candidates[::-1]), queried, whole - queried, len(candidates), joints, pairs, "", path=tuple(path)
        )


def weights(scene: Scene, rigid: bool) -> Array:
    """Weights (nv,) of the attraction, 1/m^2 and 1/rad^2: limbs give way before the body, a rigid root first."""
    result = np.full(scene.model.nv, 100.0 if rigid else 1.0)
    for root in scene.figure.roots.values():
        first = int(scene.model.joints[root].idx_v)
        result[first : first + 3] = 1.0 if rigid else 1000.0
        result[first + 3 : first + 6] = 100.0 if rigid else 1000.0
    return result


def largest_motions(scene: Scene, turn: float, shift: float) -> Array:
    """Largest motion of every degree of freedom (nv,): `turn` [rad], and `shift` [m] of where a free root is."""
    result = np.full(scene.model.nv, turn)
    for root in scene.figure.roots.values():
        first = int(scene.model.joints[root].idx_v)
        result[first : first + 3] = shift
    return result


class Entanglement:
    """Determines whether two limbs block each other, and which yields; `largest_motion` (nv,) in a frame."""

    def __init__(self, scene: Scene, workspace: Workspace, largest_motion: Array) -> None:
        self._model, self._workspace, self._largest_motion = scene.model, workspace, largest_motion
        limb_of = np.full(scene.model.njoints, -1)
        self._dofs: list[Array] = []
        for number, (joints, _) in enumerate(chains_of(scene.figure).values()):
            limb_of[joints] = number
            spans = [(scene.model.idx_vs[joint], scene.model.nvs[joint]) for joint in joints]  # none of a lone root
            self._dofs.append(np.array([at for first, nv in spans for at in range(first, first + nv)], dtype=np.intp))
        self._limb = limb_of[workspace.table.joint]
        self._holding: tuple[int, int] | None = None
        self._giving, self._frames = 0, 0

    def weights(self, shown: Array, tracked: Array) -> Array:
        """(nv,) factors of the weights for a frame from the posture `shown` towards `tracked`, both (nq,)."""
        factors = np.ones(self._model.nv)
        if self._holding is not None and not len(self._workspace.near(tracked, -PENETRATION).distance):
            away = np.abs(pin.difference(self._model, shown, tracked))
            if not self._frames:  # the limb nearer to its tracked posture yields
                self._giving = int(np.argmin([away[self._dofs[limb]].max() for limb in self._holding]))
            elif not self._frames % 10:  # frames after which the other limb gives way instead
                self._giving = 1 - self._giving
            self._frames += 1
            # damping slows it down in proportion: with 0.01 it comes back in a second only after it was pushed aside
            factors[self._dofs[self._holding[self._giving]]] = 0.1
        else:
            self._frames = 0
        return factors

    def update(self, before: Array, shown: Array, tracked: Array, contacts: Contacts) -> None:
        """Look at a frame that led from `before` to `shown`, at which the contacts touch; all postures are (nq,)."""
        pairs = self._limb[contacts.pair]
        pairs = pairs[(pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
        if not len(pairs):
            self._holding = None
            return
        pair = (int(pairs[0, 0]), int(pairs[0, 1]))
        if self._frames and self._holding is not None and set(pair) == set(self._holding):
            return
        self._frames = 0
        dofs = np.concatenate([self._dofs[limb] for limb in pair])
        was, now = (np.abs(pin.difference(self._model, q, tracked))[dofs] for q in (before, shown))
        possible = np.minimum(was, self._largest_motion[dofs]).max()
        # rad, m: the clearance keeps it off by less. Limbs in contact hold each other that come nearer by less than a
        # share of what a frame allows; more lets limbs give way that only slide along each other.
        held = now.max() > 0.05 and was.max() - now.max() < 0.2 * possible
        self._holding = pair if held else None

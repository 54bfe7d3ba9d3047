"""overlap="qp": the nearest posture to the tracked one without overlap, by a few quadratic programs a frame."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.ccd.resolver import OverlapResolver
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import ReachCones
from wholebody.tracking.attraction import Attraction, FrameMotionLimit
from wholebody.tracking.entanglement import Entanglement
from wholebody.tracking.frame import Resolution

CLEARANCE = 1e-3
"""Clearance of pieces, metres. A step is exact to first order only; the clearance must exceed its error."""


SPEED = 8.0
"""Velocity limit of joints, rad/s: above that of people, so that a released figure returns soon but does not jump."""

ROOT_SPEED = 3.0  # m/s
ROOT_WEIGHT = 1000.0
"""Weight of the root relative to that of a joint, 1/m^2 to 1/rad^2: limbs give way before the whole body."""

RIGID_WEIGHT = 100.0
"""Weight of joints and of the root's rotation relative to that of the root's position, for a rigid figure. A finger
8 cm long then takes a ten-thousandth of a displacement."""


class QPStrategy:
    """Follows tracked postures by a tracker of `QP`."""

    sweep_tolerance = 5e-5

    def __init__(self, scene: Scene, start: Array, dt: float, rigid: bool, touching: Sequence[str] = ()) -> None:
        """Prepare for frames of `dt` seconds, from the overlap-free posture `start`, (nq,).

        Args:
            scene: the figure among things.
            start: (nq,) the present posture.
            dt: seconds from frame to frame.
            rigid: whether the figure is displaced as a whole while its joints follow the tracker.
            touching: things that the figure may touch; from all others it keeps `CLEARANCE`.
        """
        self.scene, self.dt = scene, dt
        most = largest_motions(scene, dt)
        self._motion_limit = FrameMotionLimit(scene.model, most)
        self._attraction = Attraction(scene.model, start, weights(scene, rigid))
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
        """One frame: from the shown posture towards the tracked one, as near as possible.

        Args:
            shown: (nq,) of the frame before, overlap-free.
            tracked: (nq,) the tracked posture.
        """
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
        # Most programs a frame. One is enough without contact; the second corrects the second-order error of
        # the first. More would converge in fewer frames and take longer in each.
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
    """Weights (nv,) of the attraction."""
    result = np.full(scene.model.nv, RIGID_WEIGHT if rigid else 1.0)
    if scene.figure.root == "free":
        result[:3] = 1.0 if rigid else ROOT_WEIGHT
        result[3:6] = RIGID_WEIGHT if rigid else ROOT_WEIGHT
    return result


def largest_motions(scene: Scene, dt: float) -> Array:
    """Largest motion of every degree of freedom in a frame, (nv,)."""
    result = np.full(scene.model.nv, SPEED * dt)
    if scene.figure.root == "free":
        result[:3] = ROOT_SPEED * dt
    return result

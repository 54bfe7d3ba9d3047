"""What a recording is judged by, computed from its postures alone.

All pairs are asked at every frame, without culling and on data of its own, as `wholebody.assess` does for one posture.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.checks import instance
from wholebody.figures.state import State
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.interaction.recording import Recording
from wholebody.scene import Scene
from wholebody.tasks import ReachCones

Counts = NDArray[np.intp]

PASSING = {"qp": 1e-4, "ccd": 1e-3}
"""Depth on the way between two frames that counts as passing, metres: what may be left in the frames themselves."""

OVERLAPS = 1e-5  # m: deeper than this a tracked posture counts as in contact
BACK = 1e-3  # rad, m: nearer than this to the tracked posture the shown one is back
IN_TIME = 30  # frames after the end of contact in which it should be back


@dataclass(frozen=True, eq=False)
class Judgement:
    """How good a recording is; arrays have a row a frame.

    Attributes:
        depth: (n,) deepest overlap of any pair in the shown posture, metres; 0 where there is none.
        tracked_depth: (n,) the same of the tracked posture.
        tracked_pairs: (n,) overlapping pairs of pieces in the tracked posture.
        limit_violation: how far the worst joint of any shown posture is out of its limits, radians.
        cone_violation: how far the worst limb is out of its reach cone, radians.
        passed: frames on the way to which some pair went deeper than 0.1 mm (qp) or 1 mm (ccd).
        distance: (n,) root of the mean square of joint angles between shown and tracked posture, radians.
        root_distance: (n,) distance between the two places of a free root, metres.
        jerk: (n - 3,) the root of the mean square of the third difference of the shown joint angles, rad/s^3.
        tracked_jerk: (n - 3,) of the tracked ones.
        returns: for every end of contact that was followed by 30 frames without, the frame, and after how many frames
            the shown posture was back at the tracked one to 1 mrad; -1 where it was not back by the next contact.
    """

    depth: Array
    tracked_depth: Array
    tracked_pairs: Counts
    limit_violation: float
    cone_violation: float
    passed: tuple[int, ...]
    distance: Array
    root_distance: Array
    jerk: Array
    tracked_jerk: Array
    returns: tuple[tuple[int, int], ...]


def judge(scene: Scene, recording: Recording) -> Judgement:
    """Judge a recording of a scene."""
    instance(scene, Scene, "judge: scene", "make one with wb.Scene(figure)")
    instance(recording, Recording, "judge: recording", "make one with follow(scene, track)")
    depth, _ = overlaps(scene, recording.q)
    tracked_depth, tracked_pairs = overlaps(scene, recording.tracked)
    model = scene.model
    each = [pin.difference(model, *pair) for pair in zip(recording.tracked, recording.q, strict=True)]
    apart = np.array(each)
    joints = slice(6 if scene.figure.root == "free" else 0, None)
    limits = scene.figure.limits
    values = recording.q[:, limits.idx_q]
    sweep = Sweep(model, scene.geometry)
    ways, passing = enumerate(pairwise(recording.q), start=1), PASSING[recording.overlap]
    return Judgement(
        depth=depth,
        tracked_depth=tracked_depth,
        tracked_pairs=tracked_pairs,
        limit_violation=float(np.maximum(limits.lower - values, values - limits.upper).max(initial=0.0)),
        cone_violation=_cone_violation(scene, recording.q),
        passed=tuple(frame for frame, (a, b) in ways if sweep.first_contact(a, b, tolerance=passing) is not None),
        distance=_root_mean_square(apart[:, joints]),
        root_distance=np.linalg.norm(recording.q[:, :3] - recording.tracked[:, :3], axis=1)
        if scene.figure.root == "free"
        else np.zeros(len(recording)),
        jerk=jerk(model, recording.q, recording.dt),
        tracked_jerk=jerk(model, recording.tracked, recording.dt),
        returns=_returns(tracked_depth > OVERLAPS, np.abs(apart).max(axis=1)),
    )


def overlaps(scene: Scene, postures: Array) -> tuple[Array, Counts]:
    """Depth of the deepest overlap and number of overlapping pairs at each posture, (n, nq), by all pairs."""
    model, geometry = scene.model, scene.geometry
    data, results = model.createData(), pin.GeometryData(geometry)
    depth, count = np.zeros(len(postures)), np.zeros(len(postures), dtype=np.intp)
    for frame, q in enumerate(postures):
        pin.updateGeometryPlacements(model, data, geometry, results, np.asarray(q))
        pin.computeDistances(geometry, results)
        distance = np.array([result.min_distance for result in results.distanceResults])
        depth[frame] = max(0.0, -float(distance.min(initial=np.inf)))
        count[frame] = int((distance < -OVERLAPS).sum())
    return depth, count


def _cone_violation(scene: Scene, postures: Array) -> float:
    if not scene.figure.cones:
        return 0.0
    cones, state = ReachCones().resolve(scene, postures[0]), State(scene.model)
    return max(0.0, *(-float(cones.value(state.update(q)).min()) for q in postures))


def jerk(model: pin.Model, q: Array, dt: float) -> Array:
    """(n - 3,) root of the mean square of the third difference of the joint angles, rad/s^3."""
    velocity = np.array([pin.difference(model, *pair) for pair in pairwise(q)]) / dt
    joints = slice(6 if model.nq != model.nv else 0, None)
    return _root_mean_square(np.diff(velocity[:, joints], n=2, axis=0) / dt**2) if len(q) > 3 else np.zeros(0)


def _root_mean_square(values: Array) -> Array:
    return np.asarray(np.sqrt((values**2).mean(axis=1)))


def _returns(touching: NDArray[np.bool_], apart: Array) -> tuple[tuple[int, int], ...]:
    found = []
    for end in np.flatnonzero(touching[:-1] & ~touching[1:]) + 1:
        later = np.flatnonzero(touching[end:])
        free = int(later[0]) if len(later) else len(touching) - end
        if free < IN_TIME:
            continue
        back = np.flatnonzero(apart[end : end + free] < BACK)
        found.append((int(end), int(back[0]) if len(back) else -1))
    return tuple(found)

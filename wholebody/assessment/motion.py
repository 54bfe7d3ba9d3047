"""The assessment of a motion, a sequence of postures: all pairs at each of them, and sweeps between them."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.assessment.all_pairs import AllPairs, all_pairs
from wholebody.base.arrays import Array, brief
from wholebody.figures.figure import Figure
from wholebody.figures.state import State, root_freedoms
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.scene.scene import Scene
from wholebody.tasks import ReachCones

Counts = NDArray[np.intp]

OVERLAPS = 1e-5  # m: a pair overlaps if it is deeper than this

DEPTHS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Depths, metres, that are tried in turn as a bound on the depth of a motion between two postures."""


@dataclass(frozen=True, eq=False)
class MotionAssessment:
    """How good a motion is."""

    __repr__ = brief

    depth: Array  # (n,) deepest overlap of any pair at each posture, metres; 0 if there is none
    overlapping: Counts  # (n,) number of pairs that overlap by more than 0.01 mm
    limit_violation: float  # largest violation of a joint limit at any posture, radians or metres
    velocity: Array  # (n - 1, nv) from posture to posture, radians and metres a second
    jerk: Array  # (n - 3,) root of the mean square of the third difference of the joint angles over time, rad/s^3


def assess_motion(
    scene: Scene, q: Array, dt: float, moves: Mapping[str, Sequence[pin.SE3]] | None = None
) -> MotionAssessment:
    """Assess postures (n, nq), `dt` seconds apart; `moves` has n placements of each thing that moves, others stay."""
    depth, overlapping = np.zeros(len(q)), np.zeros(len(q), dtype=np.intp)
    for frame, pairs in enumerate(pairs_along(scene, q, moves)):
        depth[frame] = max(0.0, -pairs.least)
        overlapping[frame] = int((pairs.distance < -OVERLAPS).sum())
    return MotionAssessment(
        depth, overlapping, limit_violation(scene.figure, q), velocities(scene.model, q, dt), jerk(scene.model, q, dt)
    )


def pairs_along(scene: Scene, q: Array, moves: Mapping[str, Sequence[pin.SE3]] | None = None) -> Iterator[AllPairs]:
    """All pairs at each of the postures (n, nq), valid until the next; `moves` has n placements of moving things."""
    scene = copy.copy(scene) if moves else scene
    built = scene.built
    with all_pairs(built).borrow() as pairs:
        for frame, posture in enumerate(q):
            for name, places in (moves or {}).items():
                scene.move(name, at=places[frame])
            pairs.move(np.asarray(posture, dtype=float))
            yield pairs


def limit_violation(figure: Figure, q: Array) -> float:
    """Largest violation of a joint limit at any posture (n, nq) or (nq,), radians or metres."""
    limits = figure.limits
    values = q[..., limits.idx_q] if len(limits.idx_q) < q.shape[-1] else q  # all, in order
    return float(np.maximum.reduce(np.maximum(limits.lower - values, values - limits.upper), axis=None, initial=0.0))


def cone_violation(scene: Scene, q: Array) -> float:
    """Largest angle of a limb outside its reach cone at any posture (n, nq), radians."""
    if not scene.figure.cones:
        return 0.0
    cones, state = ReachCones().resolve(scene, q[0]), State(scene.model)
    return float(np.max([0.0, *(-float(cones.value(state.update(posture)).min()) for posture in q)]))


def velocities(model: pin.Model, q: Array, dt: float) -> Array:
    """(n - 1, nv) from posture to posture of (n, nq), `dt` seconds apart, radians and metres a second."""
    return np.array([pin.difference(model, *pair) for pair in pairwise(q)]).reshape(-1, model.nv) / dt


def jerk(model: pin.Model, q: Array, dt: float) -> Array:
    """(n - 3,) root of the mean square of the third difference of the joint angles, rad/s^3."""
    return root_mean_square(third_differences(model, q, dt)[:, ~root_freedoms(model)])


def third_differences(model: pin.Model, q: Array, dt: float) -> Array:
    """(n - 3, nv) of postures (n, nq) over time, rad/s^3 and m/s^3."""
    return np.diff(velocities(model, q, dt), n=2, axis=0) / dt**2 if len(q) > 3 else np.zeros((0, model.nv))


def root_mean_square(values: Array) -> Array:
    """(n,) root mean square of each row of (n, k); 0 where the rows are empty."""
    return np.asarray(np.sqrt((values**2).sum(axis=1) / max(1, values.shape[1])))


def frames_passed_through(
    scene: Scene, q: Array, depth: float, moves: Mapping[str, Sequence[pin.SE3]] | None = None
) -> tuple[int, ...]:
    """Indices of postures (n, nq) before which a pair gets deeper than `depth` [m]; `moves` as for `pairs_along`."""
    if moves:
        return tuple(
            frame
            for frame, (before, after) in enumerate(pairwise(q), start=1)
            if scene.sweep(
                before, after, depth, moves={name: (path[frame - 1], path[frame]) for name, path in moves.items()}
            )
            is not None
        )
    sweep, motions = Sweep(scene.model, scene.geometry, scene.pair_table), enumerate(pairwise(q), start=1)
    return tuple(frame for frame, motion in motions if sweep.first_contact(*motion, tolerance=depth) is not None)


def deepened(scene: Scene, q: Array) -> Array:
    """(n - 1,) least of `DEPTHS` [m] that no pair deepens by between two postures (n, nq), swept from either end."""
    sweep, found = Sweep(scene.model, scene.geometry, scene.pair_table), []
    for path in pairwise(q):
        free = (
            depth
            for depth in DEPTHS
            if any(sweep.first_contact(*ends, tolerance=depth) is None for ends in (path, path[::-1]))
        )
        found.append(next(free, np.inf))
    return np.array(found)

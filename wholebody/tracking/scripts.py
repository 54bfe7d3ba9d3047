"""Scripted trackers: smooth motion from posture to posture in given times, with the tremor of a tracked person."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import number, whole
from wholebody.figures import load
from wholebody.figures.figure import Figure
from wholebody.methods.inputs import SEED
from wholebody.tracking.frame import FRAME
from wholebody.tracking.tracks import MOST_FRAMES, Track

Place = tuple[float, float, float]
Keys = list[tuple[float, Array]]

STILL = ("hip", "knee", "ankle", "toe")
"""Parts of the names of joints without tremor, because the feet stand on the floor."""
WAVES = 5


@dataclass(frozen=True)
class ScenePlan:
    """What a scene with a scripted tracker is made of; see `InteractionScene` and, for keys, `script`."""

    about: str
    figure: str
    keys: Callable[[Figure], Keys]
    eye: Place
    target: Place
    see_through: tuple[str, ...] = ()

    def played(self, name: str, *, frames: int | None, seed: int, dt: float) -> tuple[Figure, Track]:
        """The figure, and the script as its track; cut or repeated to a number of frames, unless that is None.

        Raises InputError for fewer than one frame, or a seed or a time step out of range.
        """
        if frames is not None:
            frames = whole(frames, "frames", 1, MOST_FRAMES)
        SEED(seed, "seed")
        dt = number(dt, "dt", 1e-3, 1.0, "s")  # s: least and greatest from frame to frame
        figure = load(self.figure)
        track = script(figure, self.keys(figure), dt=dt, seed=seed, name=name)
        return figure, track if frames is None else track.repeated(frames)


def script(
    figure: Figure, keys: Sequence[tuple[float, Array]], *, dt: float = FRAME, seed: int = 0, name: str = "script"
) -> Track:
    """Move through postures, at rest in each.

    Between two keys the share of the motion is ``10 s^3 - 15 s^4 + 6 s^5``, the straight movement of least jerk (Flash
    and Hogan 1985, "The Coordination of Arm Movements", J. Neuroscience 5(7)). Two equal keys make a pause.

    Args:
        figure: the figure that moves.
        keys: seconds from the key before (the first one's are not used), and the posture (nq,).
        dt: seconds from frame to frame.
        seed: of the tremor.
        name: name of the track in messages.
    """
    frames = [keys[0][1]]
    for (_, before), (seconds, after) in pairwise(keys):
        count = max(1, round(seconds / dt))
        for s in np.arange(1, count + 1) / count:
            frames.append(np.asarray(pin.interpolate(figure.model, before, after, smooth(float(s)))))
    return Track.of(figure, _trembling(figure, np.array(frames), dt, np.random.default_rng(seed)), dt, name)


def standing_at(figure: Figure, x: float, y: float, yaw: float, degrees: Mapping[str, float]) -> Array:
    """The figure as it stands, at (x, y) and turned by yaw, some joints at other angles.

    A name of a joint without a side means both sides.
    """
    values = {}
    for name, angle in degrees.items():
        for joint in (name, f"left_{name}", f"right_{name}"):
            if joint in figure.joints:
                values[joint] = math.radians(angle)
    q = figure.with_joints(figure.posture("standing"), values)
    q[0], q[1], q[3:7] = x, y, (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    return figure.clamp(q)


def smooth(s: float) -> float:
    """Share of the motion after the share s of the time."""
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def _trembling(figure: Figure, q: Array, dt: float, rng: np.random.Generator) -> Array:
    """Add slow waves of small amplitude that begin and end at zero."""
    time = dt * np.arange(len(q))
    size = np.zeros(figure.model.nv)
    for joint in figure.joints:
        # rad: amplitude of a tracker's noise and a person's tremor in arms, fingers and neck
        size[figure.dofs(joint)] = 0.0 if any(part in joint for part in STILL) else 2e-3
    shake = np.zeros((len(q), figure.model.nv))
    for _ in range(WAVES):
        rate = 2.0 * np.pi * rng.uniform(0.3, 2.0, figure.model.nv)  # Hz
        shake += np.sin(np.outer(time, rate) + rng.uniform(0.0, 2.0 * np.pi, figure.model.nv))
    ramp = np.minimum(1.0, np.minimum(time, time[::-1]) / 0.5)
    shake *= size / WAVES * ramp[:, None]
    return np.array([figure.clamp(pin.integrate(figure.model, *pair)) for pair in zip(q, shake, strict=True)])

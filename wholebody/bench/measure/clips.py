"""The clips and the equipment of `wholebody bench motion`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import NOTHING, READY

RATE = 30.0  # Hz: of all clips

Key = tuple[float, str, dict[str, float]]
"""Seconds from the key before, a posture of the figure, and joints that are otherwise, radians."""


def _both(**angles: float) -> dict[str, float]:
    return {f"{side}_{joint}": value for joint, value in angles.items() for side in ("left", "right")}


def _swung(forward: str, back: str) -> dict[str, float]:
    arms = {f"{forward}_shoulder_flexion": 0.6, f"{back}_shoulder_flexion": -0.5}
    return {**arms, **_both(shoulder_abduction=-0.02, elbow_flexion=0.35)}


SYNTHETIC: Mapping[str, tuple[Key, ...]] = MappingProxyType(
    {
        "arms that swing close by": (
            (0.0, "standing", {}),
            *((0.45, "standing", _swung(*sides)) for sides in (("left", "right"), ("right", "left")) * 3),
            (0.5, "standing", {}),
        ),
        "arms crossed": (
            (0.0, "standing", {}),
            (0.8, "standing", _both(shoulder_flexion=0.8, shoulder_abduction=-0.35, elbow_flexion=1.7)),
            (0.5, "standing", _both(shoulder_flexion=1.0, shoulder_abduction=-0.55, elbow_flexion=1.2)),
            (0.8, "standing", {}),
        ),
        "squat": (
            (0.0, "standing", {}),
            (0.9, "squatting", _both(hip_flexion=2.1, shoulder_flexion=0.5, elbow_flexion=0.4)),
            (0.4, "squatting", _both(hip_flexion=2.1, shoulder_flexion=0.3, elbow_flexion=1.1)),
            (0.9, "standing", {}),
        ),
        "sword cut": (
            (0.0, "standing", {}),
            (0.5, "arms_forward", _both(shoulder_flexion=2.5, shoulder_abduction=-0.25, elbow_flexion=0.9)),
            (0.25, "arms_forward", {
                **_both(shoulder_abduction=-0.45, elbow_flexion=0.3),
                "left_shoulder_flexion": 0.5, "right_shoulder_flexion": 0.9, "spine2_rotation": 0.25,
            }),
            (0.4, "standing", _both(shoulder_flexion=0.2, shoulder_abduction=-0.2, elbow_flexion=0.8)),
            (0.6, "standing", {}),
        ),
        "from the belly to the feet": (
            (0.0, "prone", {}),
            (0.8, "prone", _both(shoulder_flexion=0.3, shoulder_abduction=-0.05, elbow_flexion=2.2)),
            (1.0, "kneeling", _both(hip_flexion=1.2, shoulder_flexion=0.6, elbow_flexion=0.5)),
            (0.8, "squatting", {}),
            (0.9, "standing", {}),
        ),
    }
)  # fmt: skip
"""Clips that need no recordings: the way between two postures has no velocity and no acceleration at its ends."""


def synthetic(name: str, figure: Figure) -> Clip:
    """A clip that needs no recording: one of `SYNTHETIC`, of a person."""
    postures, q = [(0.0, figure.posture(SYNTHETIC[name][0][1]))], list[Array]()
    for seconds, posture, angles in SYNTHETIC[name][1:]:
        postures.append((seconds, figure.clamp(figure.with_joints(figure.posture(posture), angles))))
    for (_, before), (seconds, after) in pairwise(postures):
        for k in range(round(seconds * RATE)):
            s = k / round(seconds * RATE)
            way = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)  # the polynomial of least jerk
            q.append(np.asarray(pin.interpolate(figure.model, before, after, way)))
    return Clip(figure, np.array([*q, postures[-1][1]]), 1.0 / RATE, name)


def recorded(path: Path, figure: Figure) -> Clip:
    """A recording at the rate of all clips, cut to twelve seconds."""
    clip = read_clip(path, figure).resampled(1.0 / RATE)
    frames = round(12.0 * RATE) + 1
    return Clip(figure, clip.q[:frames], clip.dt, path.stem)


def recordings(folder: Path | None) -> tuple[Path, ...]:
    """The recordings of a folder, by name; InputError where there is none."""
    if folder is None:
        return ()
    found = sorted(path for path in folder.glob("*") if path.suffix == ".bvh") if folder.is_dir() else []
    if not found:
        raise InputError(f"--clips {folder}: there are no .bvh files; give a folder of recordings")
    return tuple(found)


EQUIPMENT = (NOTHING, *READY)
"""What a person wears."""


def chosen(wanted: Sequence[str] | None, known: Sequence[str], option: str) -> tuple[str, ...]:
    """The names that an option chooses, all of them where it is left out; UnknownNameError for others."""
    return tuple(known) if wanted is None else tuple(checks.known(name, known, "name", option) for name in wanted)

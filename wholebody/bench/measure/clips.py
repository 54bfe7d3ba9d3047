"""The clips and the equipment of `wholebody bench motion`."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import parsed_toml
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import NOTHING, READY

RATE = 30.0  # Hz: of all clips


def _read() -> dict[str, list[tuple[float, str, dict[str, float]]]]:
    """Seconds from the key before, a posture, and joints that are otherwise, of each clip."""
    file = Path(__file__).with_name("clips.toml")
    return {
        name: [
            (
                seconds,
                posture,
                {joint.replace("both", side): value for joint, value in joints.items() for side in ("left", "right")},
            )
            for seconds, posture, joints in keys
        ]
        for name, keys in parsed_toml(file.read_text("utf-8"), file.name).items()
    }


SYNTHETIC = _read()
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

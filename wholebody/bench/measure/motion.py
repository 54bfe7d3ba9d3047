"""`wholebody bench motion`: its clips, and cases of `wb.motion.avoid_many` summed up by method, and charted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import isfinite, nan
from pathlib import Path

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import packaged_toml
from wholebody.bench.rows import Figure as Value
from wholebody.bench.rows import Panel, Row, report, shares, texts
from wholebody.figures.figure import Figure
from wholebody.motion.batch_table import AvoidedCase
from wholebody.motion.clip import Clip
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import NOTHING, READY

RATE = 30.0  # Hz: of all clips


SYNTHETIC = packaged_toml(Path(__file__).with_name("clips.toml"))
"""Clips that need no recordings: seconds from the key before, a posture, and joints that are otherwise, of each key.

The way between two postures has no velocity and no acceleration at its ends.
"""


def synthetic(name: str, figure: Figure) -> Clip:
    """A clip that needs no recording: one of `SYNTHETIC`, of a person."""
    postures, q = [(0.0, figure.posture(SYNTHETIC[name][0][1]))], list[Array]()
    for seconds, posture, joints in SYNTHETIC[name][1:]:
        angles = {joint.replace("both", side): value for joint, value in joints.items() for side in ("left", "right")}
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


EQUIPMENT = (NOTHING, *READY)  # what a person wears

FIGURES: Mapping[str, Callable[[AvoidedCase], float]] = {
    "deviation rad": lambda case: case.angle,
    "deviation mm": lambda case: 1e3 * case.distance,
    "jerk": lambda case: nan if case.jerk is None else case.jerk,
    "feet slide mm": lambda case: 1e3 * case.sliding,
    "s a second of motion": lambda case: case.seconds / case.duration if case.duration > 0.0 else 0.0,
}
"""Figures of a case of which a summary has the median and the 95 % quantile."""


def summary(cases: Sequence[AvoidedCase]) -> list[Row]:
    """A row for each method, over all its cases that have a clip."""
    found = []
    for method in dict.fromkeys(case.method for case in cases):
        asked = [case for case in cases if case.method == method]
        mine = [case for case in asked if case.frames]
        figures: dict[str, Value] = {
            "free": f"{sum(case.outcome == 'free' for case in asked)} of {len(asked)}",
            "deepest, most mm": 1e3 * max((case.deepest for case in mine), default=nan),
            "between, most mm": 1e3 * max((case.deepest_between for case in mine), default=nan),
        }
        for name, of in FIGURES.items():
            values = [value for value in map(of, mine) if isfinite(value)] or [nan]
            figures[f"{name}, median"] = float(np.median(values))
            figures[f"{name}, p95"] = float(np.quantile(values, 0.95))
        found.append(Row("all clips", method, figures))
    return found


def motion_report(cases: Sequence[AvoidedCase], facts: Mapping[str, str]) -> str:
    """The summary as Markdown; `cases.csv` has every case."""
    notes = [
        f"{case.clip}, {case.equipment}, {case.method}: {case.outcome} ({case.message})"
        for case in cases
        if not case.frames
    ]
    return report(texts()["motion"], {"": summary(cases)}, facts, notes)


def panels(cases: Sequence[AvoidedCase]) -> list[Panel]:
    """Shares of the cases that a method frees within a deviation, a jerk, and a time."""
    methods = list(dict.fromkeys(case.method for case in cases))
    counts = {name: sum(case.method == name for case in cases) for name in methods}
    free = {name: [case for case in cases if case.method == name and case.outcome == "free"] for name in methods}
    drawn = []
    for figure, title in (
        ("deviation mm", "deviation of the joints' centres [mm]"),
        ("jerk", "jerk, of that before"),
        ("s a second of motion", "seconds a second of motion"),
    ):
        values = {
            name: np.maximum(np.nan_to_num([FIGURES[figure](case) for case in mine]), 1e-3)
            for name, mine in free.items()
            if mine
        }
        if values:
            drawn.append(shares("free", title, values, counts))
    return drawn

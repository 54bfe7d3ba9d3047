"""What freeing a clip does to its torques and its balance, without and with `avoid(..., dynamics=True)`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.audits.templates import TEMPLATES
from wholebody.bench.measure.motion import recorded, synthetic
from wholebody.bench.tables import render
from wholebody.figures import load
from wholebody.motion.avoidance import avoid
from wholebody.motion.checking import ClipCheck
from wholebody.motion.clip import Clip
from wholebody.motion.clip_torques import torques
from wholebody.motion.load_change import PLACE, LoadChange
from wholebody.motion.measures import deviation, foot_sliding
from wholebody.motion.stance import usual_feet
from wholebody.motion.strength import Strength
from wholebody.motion.worn_equipment import dressed

WAYS = ("before", "avoided", "avoided with dynamics")


@dataclass(frozen=True)
class LoadRow:
    """One clip with one piece of equipment, as it is or freed.

    Attributes:
        clip, equipment, way: what was asked; `way` is of `WAYS`.
        frames, standing: of the clip, and in how many of them a foot stands.
        solved: whether the report says so.
        colliding, dips: frames in collision, and motions between free frames that dip.
        deepest_mm: in any frame.
        torque: largest torque of a joint, in parts of its strength.
        beyond: by how much the worst joint needs more than its strength or than before, whichever is larger.
        outside_mm: farthest that the zero moment point is outside of the support.
        outside: share of the standing frames in which it is outside by more than 2 mm.
        farther_mm: by how much it is farther outside than before, in the worst frame.
        farther: in how many frames it is by more than 2 mm.
        distance_mm: deviation of the joints' centres, root of the mean square.
        sliding_mm: by how much standing feet slide more than before.
        seconds: processor time of freeing.
    """

    clip: str
    equipment: str
    way: str
    frames: int
    standing: int
    solved: bool
    colliding: int
    dips: int
    deepest_mm: float
    torque: float
    beyond: float
    outside_mm: float
    outside: float
    farther_mm: float
    farther: int
    distance_mm: float
    sliding_mm: float
    seconds: float


def rows(clips: Mapping[str, Path | None], equipment: Sequence[str], longest: float) -> Iterator[LoadRow]:
    """Measure clips with each piece of equipment; those of a path are recordings.

    Args:
        clips: name to its recording; None for a synthetic clip.
        equipment: names of `cases.EQUIPMENT`.
        longest: seconds, of a clip; what is longer is cut.
    """
    figure, strength = load("human"), Strength()
    for name, path in clips.items():
        clip = synthetic(name, figure) if path is None else recorded(path, figure)
        clip = clip[: 1 + round(longest / clip.dt)]
        for worn in equipment:
            scene = dressed(figure, worn)
            feet = usual_feet(scene.figure, ())
            old = torques(Clip(scene.figure, clip.q, clip.dt), feet=feet, strength=strength)
            for way, dynamics in zip(WAYS[1:], (False, True), strict=True):
                began = time.process_time()
                freed = avoid(clip, scene, dynamics=dynamics)
                spent = time.process_time() - began
                report = freed.report
                after = torques(Clip(scene.figure, freed.clip.q, clip.dt), scene, feet=feet, strength=strength)
                change = LoadChange(old, after, np.arange(len(clip), dtype=float))
                if not dynamics:
                    same = LoadChange(change.before, change.before, change.times)
                    yield _row(name, worn, WAYS[0], clip, clip, same, report.before, False, 0.0)
                yield _row(name, worn, way, clip, freed.clip, change, report.after, report.solved, spent)


def _row(
    name: str, worn: str, way: str, before: Clip, after: Clip, change: LoadChange, found: ClipCheck, solved: bool,
    seconds: float,
) -> LoadRow:  # fmt: skip
    now, farther = change.after, change.farther
    standing = int(now.supported.sum())
    return LoadRow(
        name, worn, way, len(before), standing, solved, found.colliding, found.dips, 1e3 * found.deepest,
        now.largest_share, float(change.beyond.max()), 1e3 * float(now.outside.max()),
        float((now.outside > PLACE).sum()) / max(standing, 1), 1e3 * float(farther.max()), int((farther > PLACE).sum()),
        1e3 * deviation(before, after).distance, 1e3 * foot_sliding(before, after), seconds,
    )  # fmt: skip


def report(measured: Sequence[LoadRow], facts: Mapping[str, str]) -> str:
    """The table."""
    return render("loads.md", TEMPLATES, rows=measured, facts=facts)

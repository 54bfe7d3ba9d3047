"""What freeing a clip does to its torques and its balance, without and with `avoid(..., dynamics=True)`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.bench.measure.motion import recorded, synthetic
from wholebody.bench.rows import Row, only
from wholebody.bench.rows import report as tables_of
from wholebody.figures import load
from wholebody.figures.strength import Strength
from wholebody.motion.avoidance import avoid
from wholebody.motion.checking import ClipCheck
from wholebody.motion.clip import Clip
from wholebody.motion.clip_torques import torques
from wholebody.motion.load_change import PLACE, LoadChange
from wholebody.motion.measures import deviation, foot_sliding
from wholebody.motion.stance import usual_feet
from wholebody.motion.worn_equipment import dressed

WAYS = ("before", "avoided", "avoided with dynamics")


def rows(clips: Mapping[str, Path | None], equipment: Sequence[str], longest: float) -> Iterator[Row]:
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
) -> Row:  # fmt: skip
    now, farther = change.after, change.farther
    figures: dict[str, Any] = {
        "frames": len(before),
        "standing": int(now.supported.sum()),
        "solved": solved,
        "colliding": found.colliding,
        "dips": found.dips,
        "deepest mm": 1e3 * found.deepest,
        "torque": now.largest_share,
        "beyond": float(change.beyond.max()),
        "outside mm": 1e3 * float(now.outside.max()),
        "outside in": int((now.outside > PLACE).sum()),
        "farther mm": 1e3 * float(farther.max()),
        "farther in": int((farther > PLACE).sum()),
        "deviation mm": 1e3 * deviation(before, after).distance,
        "sliding mm": 1e3 * foot_sliding(before, after),
        "s": seconds,
    }
    return Row(f"{name}, {worn}", way, figures)


def report(measured: Sequence[Row], facts: Mapping[str, str]) -> str:
    """The table."""
    about = (
        "Torques and balance of clips as they are, freed by `wb.avoid`, and freed by `wb.avoid(dynamics=True)`, of a "
        "person of median strength. Torque: the largest of any joint, in parts of its strength; beyond: by how much "
        "the worst joint needs more than its strength or than its largest torque before. Outside: how far the zero "
        "moment point is outside of the feet that stand, and in how many frames; farther: by how much more than in the "
        "same frame before. Colliding are frames, dips motions between free ones."
    )
    names = (
        "frames",
        "colliding",
        "dips",
        "torque",
        "beyond",
        "outside mm",
        "farther mm",
        "farther in",
        "deviation mm",
    )
    return tables_of(about, {"": only(measured, *names)}, facts)

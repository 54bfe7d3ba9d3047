"""`wholebody bench motion`: clips freed of collisions by each method, with each piece of equipment, and judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wholebody.base.batches import run_batch
from wholebody.base.errors import WholebodyError
from wholebody.base.files import make_folder
from wholebody.base.runner import BY_THE_CLOCK, Job, allow_processor
from wholebody.bench.measure.clips import recorded, synthetic
from wholebody.bench.rows import Figure, Panel, Row, measured_ms, report, shares
from wholebody.bench.tables import read_rows, write_rows

if TYPE_CHECKING:
    from wholebody.motion.checking import ClipCheck
    from wholebody.motion.clip import Clip

CHECKED = "check"  # in place of a method: the clip as it is


Case = tuple[str, str, str]
"""Clip, equipment and method; `CHECKED` leaves the clip as it is."""


def measured(worn: str, method: str, path: str, most: float) -> dict[str, Figure]:
    """Measure one case, in a process of its own that has `most` seconds of the processor.

    "outcome": "free"; "left" where something overlaps still, or a limit or what is held is missed; else why there is no
    clip. "s a second": the processor's seconds for each second of motion. "dips": between two free frames. "deepest mm"
    in a frame, "between mm" at any time. The deviation is the root mean square of the joints, and of their centres;
    "jerk" is in parts of that before; "feet slide": by how much more standing feet do.
    """
    from wholebody.figures import load
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.checking import check
    from wholebody.motion.reading import read_clip
    from wholebody.motion.stance import StanceFeet
    from wholebody.motion.worn_equipment import dressed

    allow_processor(most)
    figure, middle = load("human"), 7  # frames around a collision, with which all is compiled or read back first
    scene, clip = dressed(figure, worn), read_clip(path, figure)
    check(clip[:middle], scene)
    spent, _, found = measured_ms(lambda: check(clip, scene))
    if method == CHECKED:
        return {"said": "", **_judged(clip, clip, found, 0, 0), **_spent(spent, clip)}
    first = max(0, int(np.argmax(found.depth > found.tolerance)) - middle // 2)
    freeing: Any = partial(avoid, scene=scene, method=method, constraints=[StanceFeet()])
    freeing(clip[first : first + middle])
    try:
        spent, _, freed = measured_ms(lambda: freeing(clip))
    except WholebodyError as error:
        return {"outcome": "refused", "said": str(error)}
    told = freed.report
    if len(freed.clip) != len(clip):
        return {"outcome": "retimed", "said": told.message}
    figures = _judged(clip, freed.clip, check(freed.clip, scene), told.posture_solves, told.programs, told.missed)
    return {"said": told.message, **figures, "collide before": found.colliding, **_spent(spent, clip)}


def _spent(milliseconds: float, clip: Clip) -> dict[str, Figure]:
    return {"s a second": 1e-3 * milliseconds / clip.duration if clip.duration > 0.0 else 0.0}


def _judged(
    before: Clip, after: Clip, found: ClipCheck, solves: int, programs: int, missed: float = 0.0
) -> dict[str, Figure]:
    """The figures of an answer; `missed`: by how much what is held is missed, at most 1 mm or mrad."""
    from wholebody.motion import measures

    apart = measures.deviation(before, after)
    excess = max((abs(each.value - each.limit) for each in found.limits), default=0.0)
    held = after is before or (excess <= 1e-6 and missed <= 1e-3)
    return {
        "frames": len(after),
        "outcome": "free" if found.free and held else "left",
        "collide before": found.colliding,
        "after": found.colliding,
        "dips": found.dips,
        "deepest mm": 1e3 * found.deepest,
        "between mm": 1e3 * found.deepest_between,
        "beyond limits": excess,
        "deviation rad": apart.angle,
        "mm": 1e3 * apart.distance,
        "jerk": measures.jerk_ratio(before, after),
        "feet slide mm": 1e3 * measures.foot_sliding(before, after),
        "posture solves": solves,
        "programs": programs,
    }


def run(
    clips: Mapping[str, Path | None],
    cases: Sequence[Case],
    folder: Path,
    facts: Mapping[str, str],
    jobs: int = 1,
    tell: Callable[[str], object] = lambda said: None,
    slowest: Callable[[float], float] = lambda duration: 120.0 + 60.0 * duration,
) -> list[Row]:
    """Measure all cases, and keep what was measured in `motion.csv`, where a run that was ended goes on.

    `clips` name their recordings, None for a synthetic one; `slowest` has the seconds of the processor after which a
    case is ended, from those of its clip. Raises FileFormatError where `motion.csv` is of another command.
    """
    kept = folder / "motion.csv"
    make_folder(folder / "clips")
    rows = {(row.case, row.tool): row for row in (read_rows(kept, Row)[1] if kept.is_file() else [])}
    missing = [case for case in cases if _key(case) not in rows]
    made = {name: _made(name, clips[name], folder) for name in dict.fromkeys(clip for clip, _, _ in missing)}
    waiting = []
    for case in missing:
        name, worn, method = case
        duration, fault = made[name]
        if fault:
            rows[_key(case)] = Row(*_key(case), {"outcome": "no clip", "said": fault})
        else:
            most = slowest(duration)
            waiting.append(Job(case, measured, (worn, method, str(clip_file(name, folder)), most), BY_THE_CLOCK * most))
    for outcome in run_batch(iter(waiting), jobs):
        figures = outcome.answer
        if figures is None:
            ended = "overtime" if outcome.error and outcome.error.overtime else "ended"
            figures = {"outcome": ended, "said": str(outcome.error)}
        key = _key(outcome.job.name)
        rows[key] = Row(*key, figures)
        write_rows(kept, facts, list(rows.values()))
        tell(f"{', '.join(key)}: {figures['outcome']}")
    if rows:
        write_rows(kept, facts, list(rows.values()))
    return [rows[_key(case)] for case in cases]


def _key(case: Case) -> tuple[str, str]:
    """Case and tool of the row of a case."""
    clip, worn, method = case
    return f"{clip}, {worn}", method


def clip_file(name: str, folder: Path) -> Path:
    """Where a clip is kept."""
    return folder / "clips" / f"{name.replace(' ', '_')}.npz"


def _made(name: str, recording: Path | None, folder: Path) -> tuple[float, str]:
    """Duration of a clip, made unless an earlier run did; and the sentence with which it is refused."""
    from wholebody.figures import load
    from wholebody.motion.reading import read_clip

    figure, path = load("human"), clip_file(name, folder)
    try:
        if not path.is_file():
            (recorded(recording, figure) if recording else synthetic(name, figure)).write(path)
        clip = read_clip(path, figure)
    except WholebodyError as error:
        return 0.0, str(error)
    return clip.duration, ""


def _answered(rows: Sequence[Row]) -> list[Row]:
    """Those that have a clip to measure."""
    return [row for row in rows if row["outcome"] in ("free", "left")]


def summary(rows: Sequence[Row]) -> list[Row]:
    """A row a method, over all its cases."""
    found = []
    for method in dict.fromkeys(row.tool for row in rows):
        cases = [row for row in rows if row.tool == method]
        mine = _answered(cases)
        figures: dict[str, Figure] = {"free": f"{sum(row['outcome'] == 'free' for row in mine)} of {len(cases)}"}
        for name in ("deepest", "between"):
            figures[f"{name}, most mm"] = max((row[f"{name} mm"] for row in mine), default=float("nan"))
        for name, called in (
            ("deviation rad", "deviation rad"), ("mm", "deviation mm"), ("jerk", "jerk"),
            ("feet slide mm", "feet slide mm"), ("s a second", "s a second of motion"),
        ):  # fmt: skip
            values = [row[name] for row in mine] or [float("nan")]
            figures[f"{called}, median"] = float(np.median(values))
            figures[f"{called}, p95"] = float(np.quantile(values, 0.95))
        found.append(Row("all clips", method, figures))
    return found


def motion_report(rows: Sequence[Row], facts: Mapping[str, str]) -> str:
    """The table as Markdown; the CSV file has every case."""
    about = (
        "Clips of a person at 30 Hz, each with each piece of equipment. Every frame is judged by all pairs, and every "
        "motion between frames by sweeps (`wb.check`), whatever made it. Free: no frame and no motion deeper than 0.1 "
        "mm, all joint limits hold, and what is held is missed by at most 1 mm or 1 mrad. Deviation is from the clip "
        "before: root of the mean square of the joint coordinates, and of the distances of the joints' centres. "
        "Sliding: by how much standing feet slide more than before. Times are the processor's; a method's includes "
        "its own report."
    )  # fmt: skip
    missing = [row for row in rows if row not in _answered(rows)]
    notes = [f"{row.case}, {row.tool}: {row['outcome']} ({row['said']})" for row in missing]
    return report(about, {"": summary(rows)}, facts, notes)


def panels(rows: Sequence[Row]) -> list[Panel]:
    """Shares of the cases that a method frees within a deviation, a jerk, and a time."""
    methods = [name for name in dict.fromkeys(row.tool for row in rows) if name != CHECKED]
    counts = {name: sum(row.tool == name for row in rows) for name in methods}
    free = {name: [row for row in rows if row.tool == name and row["outcome"] == "free"] for name in methods}
    drawn = []
    for figure, title in (
        ("mm", "deviation of the joints' centres [mm]"), ("jerk", "jerk, of that before"),
        ("s a second", "CPU seconds a second of motion"),
    ):  # fmt: skip
        values = {name: [max(row[figure], 1e-3) for row in mine] for name, mine in free.items() if mine}
        if values:
            drawn.append(shares("free", title, values, counts))
    return drawn

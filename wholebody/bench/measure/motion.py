"""`wholebody bench motion`: clips freed of collisions by each method, with each piece of equipment, and judged.

Each case runs in a process of its own; what was measured is kept in a file, where a run that was ended goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
MIDDLE = 7  # frames, around a collision, with which everything is compiled or read back first


@dataclass(frozen=True)
class MotionRow:
    """One clip with one piece of equipment by one method; `check` leaves the clip as it is.

    Attributes:
        clip, equipment, method: what was asked.
        frames, duration: of the clip, seconds.
        outcome: "free"; "left" where something overlaps still, or a limit or what is held is missed; or why there is no
            clip.
        seconds: CPU time of the method, or of the check.
        before, after: frames in collision.
        dips: motions between two free frames that overlap, of the answer.
        deepest_mm, between_mm: deepest in any frame, and at any time, of the answer.
        limit: largest excess over a joint limit in the answer, radians or metres.
        angle, distance_mm: deviation from the clip before: joints' root mean square, radians; their centres', mm.
        jerk: of the answer, in parts of that before.
        sliding_mm: by how much standing feet slide more than before.
        solves, programs: posture solves, and quadratic programs.
        said: the method's own sentence.
    """

    clip: str
    equipment: str
    method: str
    frames: int = 0
    duration: float = 0.0
    outcome: str = ""
    seconds: float = 0.0
    before: int = 0
    after: int = 0
    dips: int = 0
    deepest_mm: float = 0.0
    between_mm: float = 0.0
    limit: float = 0.0
    angle: float = 0.0
    distance_mm: float = 0.0
    jerk: float = 1.0
    sliding_mm: float = 0.0
    solves: int = 0
    programs: int = 0
    said: str = ""

    @property
    def key(self) -> tuple[str, str, str]:
        """What was asked."""
        return self.clip, self.equipment, self.method

    @property
    def slowness(self) -> float:
        """Seconds for each second of motion."""
        return self.seconds / self.duration if self.duration > 0.0 else 0.0

    @property
    def measured(self) -> bool:
        """Whether there is a clip to measure."""
        return self.outcome in ("free", "left")


def measured(row: MotionRow, path: str, most: float) -> MotionRow:
    """Measure one case; a job of a process of its own.

    Args:
        row: the case.
        path: of the clip.
        most: seconds of the processor that it has.
    """
    from wholebody.figures import load
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.checking import check
    from wholebody.motion.reading import read_clip
    from wholebody.motion.stance import StanceFeet
    from wholebody.motion.worn_equipment import dressed

    allow_processor(most)
    figure = load("human")
    scene, clip = dressed(figure, row.equipment), read_clip(path, figure)
    check(clip[:MIDDLE], scene)  # compiles or reads back what is needed
    spent, _, found = measured_ms(lambda: check(clip, scene))
    row = replace(row, seconds=1e-3 * spent, before=found.colliding)
    if row.method == CHECKED:
        return _judged(row, clip, clip, found)
    first = max(0, int(np.argmax(found.depth > found.tolerance)) - MIDDLE // 2)
    freeing: Any = partial(avoid, scene=scene, method=row.method, constraints=[StanceFeet()])
    freeing(clip[first : first + MIDDLE])
    try:
        spent, _, freed = measured_ms(lambda: freeing(clip))
    except WholebodyError as error:
        return replace(row, outcome="refused", said=str(error))
    told = freed.report
    row = replace(
        row, seconds=1e-3 * spent, solves=told.posture_solves, programs=told.programs, said=told.message
    )  # fmt: skip
    if len(freed.clip) != len(clip):
        return replace(row, outcome="retimed")
    return _judged(row, clip, freed.clip, check(freed.clip, scene), told.missed)


def _judged(row: MotionRow, before: Clip, after: Clip, found: ClipCheck, missed: float = 0.0) -> MotionRow:
    """With the figures of the answer; `missed`: by how much what is held is missed, at most 1 mm or mrad."""
    from wholebody.motion import measures

    apart = measures.deviation(before, after)
    excess = max((abs(each.value - each.limit) for each in found.limits), default=0.0)
    held = row.method == CHECKED or (excess <= 1e-6 and missed <= 1e-3)
    return replace(
        row,
        outcome="free" if found.free and held else "left",
        after=found.colliding,
        dips=found.dips,
        deepest_mm=1e3 * found.deepest,
        between_mm=1e3 * found.deepest_between,
        limit=excess,
        angle=apart.angle,
        distance_mm=1e3 * apart.distance,
        jerk=measures.jerk_ratio(before, after),
        sliding_mm=1e3 * measures.foot_sliding(before, after),
    )


def run(
    clips: Mapping[str, Path | None],
    cases: Sequence[tuple[str, str, str]],
    folder: Path,
    facts: Mapping[str, str],
    jobs: int = 1,
    tell: Callable[[str], object] = lambda said: None,
    slowest: Callable[[float], float] = lambda duration: 120.0 + 60.0 * duration,
) -> list[MotionRow]:
    """Measure all cases, and keep what was measured in `motion.csv`, where a run that was ended goes on.

    Args:
        clips: name to its recording; None for a synthetic clip.
        cases: clips, equipment and methods.
        folder: where clips and results are kept.
        facts: of the machine.
        jobs: cases at a time.
        tell: is told what was done.
        slowest: seconds of the processor after which a case is ended, from the seconds of its clip.

    Raises:
        FileFormatError: `motion.csv` is of another command.
        InputError: the folder cannot be written.
    """
    kept = folder / "motion.csv"
    make_folder(folder / "clips")
    rows = {row.key: row for row in (read_rows(kept, MotionRow)[1] if kept.is_file() else [])}
    missing = [MotionRow(*case) for case in cases if case not in rows]
    made = {name: _made(name, clips[name], folder) for name in dict.fromkeys(row.clip for row in missing)}
    waiting = []
    for row in missing:
        frames, duration, fault = made[row.clip]
        row = replace(row, frames=frames, duration=duration)
        if fault:
            rows[row.key] = replace(row, outcome="no clip", said=fault)
        else:
            most, path = slowest(duration), str(clip_file(row.clip, folder))
            waiting.append(Job(row, measured, (row, path, most), BY_THE_CLOCK * most))
    for outcome in run_batch(iter(waiting), jobs):
        row = outcome.answer
        if row is None:
            ended = "overtime" if outcome.error and outcome.error.overtime else "ended"
            row = replace(outcome.job.name, outcome=ended, said=str(outcome.error))
        rows[row.key] = row
        write_rows(kept, facts, list(rows.values()))
        tell(f"{', '.join(row.key)}: {row.outcome}")
    if rows:
        write_rows(kept, facts, list(rows.values()))
    return [rows[case] for case in cases]


def clip_file(name: str, folder: Path) -> Path:
    """Where a clip is kept."""
    return folder / "clips" / f"{name.replace(' ', '_')}.npz"


def _made(name: str, recording: Path | None, folder: Path) -> tuple[int, float, str]:
    """Frames and duration of a clip, made unless an earlier run did; and the sentence with which it is refused."""
    from wholebody.figures import load
    from wholebody.motion.reading import read_clip

    figure, path = load("human"), clip_file(name, folder)
    try:
        if not path.is_file():
            (recorded(recording, figure) if recording else synthetic(name, figure)).write(path)
        clip = read_clip(path, figure)
    except WholebodyError as error:
        return 0, 0.0, str(error)
    return len(clip), clip.duration, ""


def summary(rows: Sequence[MotionRow]) -> list[Row]:
    """A row a method, over all its cases."""
    found = []
    for method in dict.fromkeys(row.method for row in rows):
        cases = [row for row in rows if row.method == method]
        mine = [row for row in cases if row.measured]
        figures: dict[str, Figure] = {"free": f"{sum(row.outcome == 'free' for row in mine)} of {len(cases)}"}
        for name, unit in (("deepest", "mm"), ("between", "mm")):
            figures[f"{name}, most {unit}"] = max((getattr(row, f"{name}_mm") for row in mine), default=float("nan"))
        for attribute, name in (
            ("angle", "deviation rad"), ("distance_mm", "deviation mm"), ("jerk", "jerk"),
            ("sliding_mm", "feet slide mm"), ("slowness", "s a second of motion"),
        ):  # fmt: skip
            values = [getattr(row, attribute) for row in mine] or [float("nan")]
            figures[f"{name}, median"] = float(np.median(values))
            figures[f"{name}, p95"] = float(np.quantile(values, 0.95))
        found.append(Row("all clips", method, figures))
    return found


def motion_report(rows: Sequence[MotionRow], facts: Mapping[str, str]) -> str:
    """The table as Markdown; the CSV file has every case."""
    about = (
        "Clips of a person at 30 Hz, each with each piece of equipment. Every frame is judged by all pairs, and every "
        "motion between frames by sweeps (`wb.check`), whatever made it. Free: no frame and no motion deeper than 0.1 "
        "mm, all joint limits hold, and what is held is missed by at most 1 mm or 1 mrad. Deviation is from the clip "
        "before: root of the mean square of the joint coordinates, and of the distances of the joints' centres. "
        "Sliding: by how much standing feet slide more than before. Times are the processor's; a method's includes "
        "its own report."
    )  # fmt: skip
    missing = [f"{', '.join(row.key)}: {row.outcome} ({row.said})" for row in rows if not row.measured]
    return report(about, {"": summary(rows)}, facts, missing)


def panels(rows: Sequence[MotionRow]) -> list[Panel]:
    """Shares of the cases that a method frees within a deviation, a jerk, and a time."""
    methods = [name for name in dict.fromkeys(row.method for row in rows) if name != CHECKED]
    counts = {name: sum(row.method == name for row in rows) for name in methods}
    free = {name: [row for row in rows if row.method == name and row.outcome == "free"] for name in methods}
    drawn = []
    for attribute, title in (
        ("distance_mm", "deviation of the joints' centres [mm]"), ("jerk", "jerk, of that before"),
        ("slowness", "CPU seconds a second of motion"),
    ):  # fmt: skip
        values = {name: [max(getattr(row, attribute), 1e-3) for row in mine] for name, mine in free.items() if mine}
        if values:
            drawn.append(shares("free", title, values, counts))
    return drawn

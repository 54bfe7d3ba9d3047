"""One clip with one piece of equipment, freed by one method: what is measured, each in a child process."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wholebody.base.batches import run_batch
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import make_folder
from wholebody.base.runner import BY_THE_CLOCK, Job, allow_processor
from wholebody.bench.measure.motion.cases import SYNTHETIC, WEAPON, recorded, synthetic
from wholebody.bench.tables import read_rows, write_rows

if TYPE_CHECKING:
    from wholebody.motion.checking import ClipCheck
    from wholebody.motion.clip import Clip

FIGURE = "human"
CHECKED = "check"  # in place of a method: the clip as it is
NEAREST = "nearest"  # in place of a method: each frame for itself, as near to the original as can be
NEAREST_OF = ("trajectory", "bisection", "frames")
"""Methods from whose answers the nearest frames are looked for."""
MAKING = 600.0  # s: to read a clip and bring it onto the figure
START = 120.0  # s of the processor that a case has beside those for its length: imports, compilation
SLOWEST = 60.0  # s of the processor for a second of motion, after which a method is ended
MIDDLE = 7  # frames, around a collision, with which everything is compiled or read back first

LIMIT = 1e-6  # rad, m: by which a limit may be missed
HELD = 1e-3  # m, rad: by which what is held may be missed


@dataclass(frozen=True)
class MotionRow:
    """One clip with one piece of equipment by one method.

    The method `check` leaves the clip as it is; `nearest` brings each frame for itself as near to it as can be.

    Attributes:
        clip, equipment, method: what was asked.
        frames: of the clip.
        duration: of the clip, seconds.
        outcome: "free"; "left" where something overlaps still, or a limit or what is held is missed; or why there is no
            clip.
        seconds: CPU time of the method, or of the check.
        check_ms: CPU time of a check of the answer, for each frame.
        before, after: frames in collision.
        dips: motions between two free frames that overlap, of the answer.
        deepest_before_mm, deepest_mm: in any frame, before and after.
        between_mm: deepest at any time of the answer.
        deeper: share of the frames of the answer deeper than 1 cm.
        limit: largest excess over a joint limit in the answer, radians or metres.
        angle, distance_mm: deviation from the clip before: joints' root mean square, radians; their centres', mm.
        jerk: of the answer, in parts of that before.
        sliding_mm: by how much standing feet slide more than before.
        hand_mm: by how much the hands leave their places at each other; -1 where they hold no weapon.
        off_mm: by how much of that they leave the line through both hands, along which the weapon lies; or -1.
        beside_mm: by how much the method holds them beside their places, because they overlap there.
        changed: frames that are others than before.
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
    check_ms: float = 0.0
    before: int = 0
    after: int = 0
    dips: int = 0
    deepest_before_mm: float = 0.0
    deepest_mm: float = 0.0
    between_mm: float = 0.0
    deeper: float = 0.0
    limit: float = 0.0
    angle: float = 0.0
    distance_mm: float = 0.0
    jerk: float = 1.0
    sliding_mm: float = 0.0
    hand_mm: float = -1.0
    off_mm: float = -1.0
    beside_mm: float = 0.0
    changed: int = 0
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


def made(name: str, recording: str, path: str) -> tuple[int, float]:
    """Make a clip and write it; a job of a process of its own. Returns its frames and its duration.

    Args:
        name: of the clip.
        recording: path of the recording; "" for a synthetic clip.
        path: where to write it.
    """
    from wholebody.figures import load

    figure = load(FIGURE)
    clip = recorded(Path(recording), figure) if recording else synthetic(name, figure)
    clip.write(path)
    return len(clip), clip.duration


def kept_length(path: str) -> tuple[int, float]:
    """Frames and duration of a clip that was made before."""
    from wholebody.figures import load
    from wholebody.motion.reading import read_clip

    clip = read_clip(path, load(FIGURE))
    return len(clip), clip.duration


def measured(row: MotionRow, path: str, most: float) -> MotionRow:
    """Measure one case; a job of a process of its own.

    Args:
        row: the case.
        path: of the clip.
        most: seconds of the processor that it has.
    """
    from wholebody.figures import load
    from wholebody.motion.checking import check
    from wholebody.motion.reading import read_clip
    from wholebody.motion.worn_equipment import dressed

    allow_processor(most)
    figure = load(FIGURE)
    scene, clip = dressed(figure, row.equipment), read_clip(path, figure)
    check(clip[:MIDDLE], scene)  # compiles or reads back what is needed
    began = time.process_time()
    found = check(clip, scene)
    spent = time.process_time() - began
    row = replace(
        row, frames=len(clip), duration=clip.duration, seconds=spent, check_ms=1e3 * spent / len(clip),
        before=found.colliding, deepest_before_mm=1e3 * found.deepest,
    )  # fmt: skip
    if row.method == CHECKED:
        return _judged(row, clip, clip, found)
    if row.method == NEAREST:
        return _nearest(row, clip, scene)
    return _freed(row, clip, found, scene)


def _freed(row: MotionRow, clip: Clip, found: ClipCheck, scene: Any) -> MotionRow:
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.checking import check

    constraints = _held(row)
    avoid(_colliding(clip, found), scene, method=row.method, constraints=constraints)  # compiles what is needed
    began = time.process_time()
    try:
        freed = avoid(clip, scene, method=row.method, constraints=constraints)
    except WholebodyError as error:
        return replace(row, outcome="refused", said=str(error), seconds=time.process_time() - began)
    spent, report = time.process_time() - began, freed.report
    row = replace(row, seconds=spent, solves=report.posture_solves, programs=report.programs, said=report.message)
    if len(freed.clip) != len(clip):
        return replace(row, outcome="retimed")
    began = time.process_time()
    found = check(freed.clip, scene)
    row = replace(row, check_ms=1e3 * (time.process_time() - began) / len(clip))
    row = replace(row, beside_mm=1e3 * report.beside)
    return _judged(row, clip, freed.clip, found, report.missed)


def _nearest(row: MotionRow, clip: Clip, scene: Any) -> MotionRow:
    from wholebody.bench.measure.motion.nearest import nearest
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.checking import check

    constraints = _held(row)
    answers = [avoid(clip, scene, method=method, constraints=constraints).clip for method in NEAREST_OF]
    began = time.process_time()
    found = nearest(clip, scene, constraints, answers)
    row = replace(row, seconds=time.process_time() - began)
    if found is None:
        return replace(row, outcome="none", said="no answer leads to frames that are free")
    return _judged(row, clip, found, check(found, scene))


def _held(row: MotionRow) -> list[Any]:
    """What is held in a case."""
    from wholebody.motion.stance import StanceFeet
    from wholebody.tasks import Hold

    constraints: list[Any] = [StanceFeet()]
    if row.clip in WEAPON:
        hand, other = WEAPON[row.clip]
        constraints.append(Hold(other, relative_to=hand))
    return constraints


def _colliding(clip: Clip, found: ClipCheck) -> Clip:
    """A few frames around the first collision; the first ones where there is none."""
    first = max(0, int(np.argmax(found.depth > found.tolerance)) - MIDDLE // 2)
    return clip[first : first + MIDDLE]


def _judged(row: MotionRow, before: Clip, after: Clip, found: ClipCheck, missed: float = 0.0) -> MotionRow:
    from wholebody.motion import measures

    apart, hands = measures.deviation(before, after), WEAPON.get(row.clip)
    excess = max((abs(each.value - each.limit) for each in found.limits), default=0.0)
    held = excess <= LIMIT and missed <= HELD
    return replace(
        row,
        outcome="free" if found.free and (held or row.method == CHECKED) else "left",
        after=found.colliding,
        dips=found.dips,
        deepest_mm=1e3 * found.deepest,
        between_mm=1e3 * found.deepest_between,
        deeper=float((found.depth > 0.01).mean()),
        limit=excess,
        angle=apart.angle,
        distance_mm=1e3 * apart.distance,
        jerk=measures.jerk_ratio(before, after),
        sliding_mm=1e3 * measures.foot_sliding(before, after),
        hand_mm=1e3 * measures.hand_error(before, after, *hands) if hands else -1.0,
        off_mm=1e3 * measures.hand_off_weapon(before, after, *hands) if hands else -1.0,
        changed=apart.frames_changed,
    )


def run(
    clips: Mapping[str, Path | None],
    equipment: Sequence[str],
    ways: Sequence[str],
    folder: Path,
    facts: Mapping[str, str],
    jobs: int = 1,
    tell: Callable[[int, int, str], object] = lambda done, count, said: None,
) -> list[MotionRow]:
    """Measure all cases, and keep what was measured in `motion.csv`, where a run that was ended goes on.

    Args:
        clips: name to its recording; None for a synthetic clip.
        equipment: names of `EQUIPMENT`.
        ways: methods, and `CHECKED`.
        folder: where clips and results are kept.
        facts: of the machine.
        jobs: cases at a time.
        tell: is told how many cases are done, of how many, and what was done last.

    Raises:
        FileFormatError: `motion.csv` is of another command.
        InputError: the folder cannot be written.
    """
    kept = folder / "motion.csv"
    make_folder(folder / "clips")
    rows = {row.key: row for row in (read_rows(kept, MotionRow)[1] if kept.is_file() else [])}
    wanted = [MotionRow(clip, worn, way) for clip in clips for worn in equipment for way in ways]
    missing = [row for row in wanted if row.key not in rows]
    needed = dict.fromkeys(row.clip for row in missing)
    lengths, faults = _clips({name: clips[name] for name in needed}, folder, jobs, tell)
    for row in missing:
        if row.clip in faults:
            rows[row.key] = replace(row, outcome="no clip", said=faults[row.clip])
    waiting = [row for row in missing if row.clip not in faults]
    for outcome in run_batch((_job(row, lengths[row.clip][1], folder) for row in waiting), jobs):
        row = outcome.answer or replace(
            outcome.job.name, outcome="overtime" if outcome.error and outcome.error.overtime else "ended",
            said=str(outcome.error), frames=lengths[outcome.job.name.clip][0],
            duration=lengths[outcome.job.name.clip][1],
        )  # fmt: skip
        rows[row.key] = row
        write_rows(kept, facts, list(rows.values()))
        done = sum(each.key in rows for each in wanted)
        tell(done, len(wanted), f"{row.clip}, {row.equipment}, {row.method}: {row.outcome}")
    if rows:
        write_rows(kept, facts, list(rows.values()))
    return [rows[row.key] for row in wanted]


def clip_file(name: str, folder: Path) -> Path:
    """Where a clip is kept."""
    return folder / "clips" / f"{name.replace(' ', '_')}.npz"


def _job(row: MotionRow, duration: float, folder: Path) -> Job:
    most = START + SLOWEST * duration
    return Job(row, measured, (row, str(clip_file(row.clip, folder)), most), BY_THE_CLOCK * most)


def _clips(
    clips: Mapping[str, Path | None], folder: Path, jobs: int, tell: Callable[[int, int, str], object]
) -> tuple[dict[str, tuple[int, float]], dict[str, str]]:
    """Make the clips; the length of each, and the faults of those that could not be made."""
    for name, recording in clips.items():
        if recording is None and name not in SYNTHETIC:
            raise InputError(f"there is no clip {name!r}; give one of {', '.join(SYNTHETIC)}")
    work = (
        Job(name, _made_or_fault, (name, str(recording or ""), str(clip_file(name, folder))), MAKING)
        for name, recording in clips.items()
    )
    lengths, faults = dict[str, tuple[int, float]](), dict[str, str]()
    for outcome in run_batch(work, jobs):
        name = outcome.job.name
        if outcome.error is not None or isinstance(outcome.answer, str):
            faults[name] = outcome.answer or str(outcome.error)
        else:
            lengths[name] = outcome.answer
        tell(0, len(clips), f"clip {name}: {faults.get(name, 'ready')}")
    return lengths, faults


def _made_or_fault(name: str, recording: str, path: str) -> tuple[int, float] | str:
    """The length of a clip, or the sentence with which it is refused; a job of a process of its own.

    A clip that an earlier run made is kept.
    """
    try:
        if Path(path).is_file():
            return kept_length(path)
        return made(name, recording, path)
    except WholebodyError as error:
        return str(error)

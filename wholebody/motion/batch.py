"""`wb.motion.avoid_many`: clips freed of collisions, each with each equipment by each method, many at a time."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.batches import Jobs, fingerprint, run_batch
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import is_file, read_bytes
from wholebody.base.runner import Job
from wholebody.figures.figure import Figure
from wholebody.motion.avoidance import as_avoider, avoid
from wholebody.motion.avoider import Avoider
from wholebody.motion.batch_table import AvoidedCase, BatchTable, first_twice
from wholebody.motion.clip import Clip, check_figure
from wholebody.motion.frame_terms import Given, frame_terms
from wholebody.motion.judging import Avoided
from wholebody.motion.measures import deviation, foot_sliding, jerk_ratio
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import NOTHING, Worn, dressed, label

if TYPE_CHECKING:
    from typing_extensions import Unpack

Source = Clip | str | os.PathLike[str]


class BatchProgress(NamedTuple):
    """Called when a case is done: how many are, those of an earlier run included, of how many, and which was the last.

    Examples:
        >>> done = wb.motion.BatchProgress(3, 12, None)
    """

    done: int
    total: int
    case: AvoidedCase | None


class _Asked(NamedTuple):
    """A case before it is done; its clip is read when it begins."""

    row: AvoidedCase
    worn: Worn
    method: Avoider


class AvoidOptions(TypedDict, total=False):
    """What every case is asked for; see `avoid`."""

    constraints: Iterable[Given]
    hold_feet: bool
    keep_ends: bool


def avoid_many(
    clips: Iterable[Source],
    folder: str | os.PathLike[str],
    *,
    figure: Figure | None = None,
    equipment: Iterable[Worn] = (NOTHING,),
    methods: Iterable[str | Avoider] = ("trajectory",),
    jobs: int = 1,
    cluster: str | None = None,
    progress: Callable[[BatchProgress], Any] | bool | None = None,
    **options: Unpack[AvoidOptions],
) -> tuple[AvoidedCase, ...]:
    """Free clips of collisions: each clip, with each equipment, by each method.

    The folder gets a clip for each case, the clips as they were (`originals`), and all cases as `cases.jsonl` and
    `cases.csv`. What it holds already, of the same clip, figure, equipment, method and constraints, is not done
    again: a run that was ended goes on. Files are written whole. Each case runs in a process of its own, so that one
    that fails ends no other.

    Args:
        clips: clips, or files of motion, which are read or retargeted for `figure` as `read_clip` does.
        folder: is made if it does not exist.
        figure: of the files; a clip has its own.
        equipment: what is worn in turn: "nothing", names of `wb.motion.equipment` such as "pack", joined by "+" where
            they are worn together, paths of meshes for the back, `wb.motion.Equipment`, or tuples of these.
        methods: names or settings, see `avoid`.
        jobs: cases at a time.
        cluster: address of a dask scheduler that runs them; None for this machine.
        progress: called with a `BatchProgress` after each case; True for a line that counts.
        options: `constraints`, `hold_feet` and `keep_ends`, as of `avoid`.

    Returns:
        The rows of the table, in the order in which they were asked.

    Raises:
        InputError: something else than a clip or a file, no figure for a file, two clips of one name.
        UnknownNameError: there is no such method or equipment.
        FileFormatError: the folder holds another table.
        MissingPackageError: dask is not installed.
        WholebodyError: the cluster does not answer.

    Examples:
        >>> rows = wb.motion.avoid_many([clip], folder)
        >>> rows[0].outcome
        'free'
    """
    what = "avoid_many"
    checks.keywords(options, AvoidOptions, what)
    sources = _sources(checks.listed(clips, f"{what}: clips", "['walk.bvh']"), figure, what)
    given = tuple(checks.listed(options.get("constraints", ()), f"{what}: constraints", "[wb.motion.StanceFeet()]"))
    pieces = checks.listed(equipment, f"{what}: equipment", "['nothing', 'pack']")
    twice = first_twice(label(one) for one in pieces)
    if twice is not None:
        raise InputError(f"{what}: two pieces of equipment are named {checks.shown(twice)}; give each another name")
    worn: dict[str, Worn] = {label(one): one for one in pieces}
    avoiders = _by_name([as_avoider(one) for one in checks.listed(methods, f"{what}: methods", "['trajectory']")])
    feet = checks.flag(options.get("hold_feet", True), f"{what}: hold_feet")
    held: AvoidOptions = {"constraints": given, "hold_feet": feet}
    if checks.flag(options.get("keep_ends", False), f"{what}: keep_ends"):
        held["keep_ends"] = True
    running = Jobs.checked(what, jobs, cluster, progress)
    owners = [source.figure if isinstance(source, Clip) else figure for source in sources.values()]
    for owner in {id(owner): owner for owner in owners if owner is not None}.values():
        for one in pieces:  # what does not fit is said before anything is computed
            frame_terms(dressed(owner, one), owner.neutral[None], 1.0 / 30.0, given)
    batch = _Batch(sources, figure, BatchTable(checks.path(folder, f"{what}: folder")), running)
    marks, faults = batch.originals()
    asked = [
        _Asked(AvoidedCase(name, wears, way, asked=fingerprint(marks[name], one, mesh, method, held)), one, method)
        for name in sources
        for wears, one in worn.items()
        for mesh in [read_bytes(one, "mesh") if isinstance(one, str) and is_file(one) else None]
        for way, method in avoiders.items()
    ]
    return batch.freed(asked, faults, held)


class _Batch(NamedTuple):
    """Clips and files by name, the figure of the files, the folder, and how jobs are run."""

    sources: Mapping[str, Clip | Path]
    figure: Figure | None
    table: BatchTable
    running: Jobs

    def originals(self, tell: Callable[[int, str], Any] | None = None) -> tuple[dict[str, str], dict[str, str]]:
        """Make the clips of files; fingerprints of all clips, and the sentences with which files were refused."""
        marks = {name: _mark(source, self.figure) for name, source in self.sources.items()}
        waiting = [
            (name, source)
            for name, source in self.sources.items()
            if isinstance(source, Path) and not self.table.has_original(name, marks[name])
        ]
        faults, done = {}, len(self.sources) - len(waiting)
        work = (Job(name, _read, (str(source.absolute()), self.figure), 0.0) for name, source in waiting)  # no deadline
        for outcome in run_batch(work, self.running.jobs, self.running.cluster) if waiting else ():
            name, done = outcome.job.name, done + 1
            if tell is not None:
                tell(done, name)
            if outcome.error is not None or isinstance(outcome.answer, str):
                faults[name] = outcome.answer or str(outcome.error)
                continue
            assert self.figure is not None
            q, dt = outcome.answer
            self.table.add_original(name, Clip(self.figure, q, dt, name), marks[name])
        return marks, faults

    def freed(self, asked: Sequence[_Asked], faults: Mapping[str, str], held: AvoidOptions) -> tuple[AvoidedCase, ...]:
        """The rows of the cases that were asked; those that the folder has not are done, if their file was read."""
        rows = {each.row.stem: row for each in asked if (row := self.table.done(each.row)) is not None}

        def keep(row: AvoidedCase, clip: Clip | None) -> None:
            rows[row.stem] = self.table.add(row, clip)
            tell(row)

        def tell(row: AvoidedCase | None) -> None:
            if self.running.tell is not None:
                self.running.tell(BatchProgress(len(rows), len(asked), row))

        tell(None)
        missing = [each for each in asked if each.row.stem not in rows]
        for each in missing:
            if each.row.clip in faults:
                keep(replace(each.row, outcome="refused", message=faults[each.row.clip]), None)
        waiting = [each for each in missing if each.row.clip not in faults]

        def work() -> Iterator[Job]:
            for each in waiting:
                clip = self.sources[each.row.clip]
                if not isinstance(clip, Clip):
                    assert self.figure is not None
                    clip = read_clip(self.table.original(each.row.clip), self.figure)
                yield Job(each, _case, (clip, each.worn, each.method, held), 0.0)

        for outcome in run_batch(work(), self.running.jobs, self.running.cluster) if waiting else ():
            each = outcome.job.name
            if outcome.error is not None:
                keep(replace(each.row, message=str(outcome.error)), None)
                continue
            found, q, dt = outcome.answer
            clip = outcome.job.arguments[0]
            keep(replace(each.row, **found), None if q is None else Clip(clip.figure, q, dt, clip.name))
        return tuple(rows[each.row.stem] for each in asked)


def _case(clip: Clip, worn: Worn, method: Avoider, held: AvoidOptions) -> tuple[dict[str, Any], Array | None, float]:
    """Free a clip, in a process of its own: the fields of its row, and its postures with their time step."""
    try:
        avoided = avoid(clip, dressed(clip.figure, worn), method=method, **held)
    except WholebodyError as error:
        return {"outcome": "refused", "message": str(error)}, None, clip.dt
    return _measured(clip, avoided), avoided.clip.q, avoided.clip.dt


def _measured(before: Clip, avoided: Avoided) -> dict[str, Any]:
    """The fields of a row that are known of a clip that was freed."""
    report, after = avoided.report, avoided.clip
    counts = ("message", "seconds", "missed", "frames_changed", "posture_solves", "programs")
    found: dict[str, Any] = {name: getattr(report, name) for name in counts}
    found |= {name: getattr(report.after, name) for name in ("colliding", "dips", "deepest", "deepest_between")}
    found |= {f"{name}_before": getattr(report.before, name) for name in ("colliding", "deepest")}
    found |= {"outcome": "free" if report.solved else "left", "frames": len(after), "duration": before.duration}
    if len(before) == len(after):  # and not retimed
        after = Clip(after.figure, after.q, before.dt, after.name)
        apart, jerk = deviation(before, after), jerk_ratio(before, after)
        found |= {"angle": apart.angle, "distance": apart.distance, "jerk": jerk if math.isfinite(jerk) else None}
        found["sliding"] = foot_sliding(before, after)
    return found


def read_many(
    files: Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    figure: Figure,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    progress: Callable[[int, str], Any] | None = None,
) -> dict[str, Path | str]:
    """Read or retarget files of motion, many at a time, and write their clips into the folder `originals` of a folder.

    What was made before, of the same file and figure, is not made again.

    Args:
        files: as for `read_clip`.
        folder: is made if it does not exist.
        figure: of the clips.
        jobs: files at a time.
        cluster: address of a dask scheduler that reads them; None for this machine.
        progress: called with how many are done, and the name of the last one.

    Returns:
        Name of each clip, to its file, or to the sentence with which it was refused.

    Raises:
        InputError: two files of one name, or no figure.
        WholebodyError: as for `avoid_many`.

    Examples:
        >>> made = wb.motion.read_many([recording], folder, human)
    """
    what = "read_many"
    check_figure(figure, what)
    sources = _sources(checks.listed(files, f"{what}: files", "['walk.bvh']"), figure, what)
    table = BatchTable(checks.path(folder, f"{what}: folder"))
    checks.function(progress, f"{what}: progress")
    running = Jobs.checked(what, jobs, cluster)
    faults = _Batch(sources, figure, table, running).originals(progress)[1]
    return {name: faults.get(name) or table.original(name) for name in sources}


def _read(path: str, figure: Figure) -> tuple[Array, float] | str:
    """Postures and time step of a file, or the sentence with which it is refused; in a process of its own."""
    try:
        clip = read_clip(path, figure)
    except WholebodyError as error:
        return str(error)
    return clip.q, clip.dt


def _sources(given: Sequence[Any], figure: Figure | None, what: str) -> dict[str, Clip | Path]:
    found: list[tuple[str, Clip | Path]] = []
    sources = [one if isinstance(one, Clip) else checks.path(one, f"{what}: a clip") for one in given]
    stems = Counter(one.stem for one in sources if isinstance(one, Path))
    for path in sources:
        if isinstance(path, Clip):
            found.append((path.name, path))
            continue
        if figure is None:
            raise InputError(
                f"{what}: {checks.shown(path.name)} is a file; say of which figure: figure=wb.load('human')"
            )
        check_figure(figure, what)
        found.append((f"{path.parent.name} {path.stem}".strip() if stems[path.stem] > 1 else path.stem, path))
    twice = first_twice(name for name, _ in found)
    if twice is not None:
        raise InputError(f"{what}: two clips are named {checks.shown(twice)}; give each another name")
    return dict(found)


def _by_name(methods: Sequence[Avoider]) -> dict[str, Avoider]:
    """The methods by name; further settings of one name have a number."""
    found: dict[str, Avoider] = {}
    for method in methods:
        name, number = str(method.name), 2
        while name in found:
            name, number = f"{method.name} {number}", number + 1
        found[name] = method
    return found


def _mark(source: Clip | Path, figure: Figure | None) -> str:
    """Fingerprint of a clip and its figure; a file that cannot be read is refused later, with its sentence."""
    if isinstance(source, Clip):
        return fingerprint(source.q, source.dt, source.figure)
    try:
        return fingerprint(read_bytes(source, "motion"), figure)
    except WholebodyError as error:
        return fingerprint(str(error))

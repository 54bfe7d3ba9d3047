"""What a batch has made so far: its rows, the same as CSV, and one clip a case, in a folder."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

from wholebody.base.arrays import brief
from wholebody.base.errors import InputError
from wholebody.base.files import csv_text, write
from wholebody.base.records import RecordFile
from wholebody.motion.clip import Clip

TABLE, SHEET, ORIGINALS = "cases.jsonl", "cases.csv", "originals"


@dataclass(frozen=True)
class AvoidedCase:
    """One clip with one piece of equipment, freed by one method: a row of the table of `avoid_many`.

    Attributes:
        clip, equipment, method: what was asked.
        outcome: "free"; "left" where faults remain; "refused" where the input is wrong; "ended" where its process
            ended, which a further run does again.
        message: one sentence: the remaining faults, or why there is no clip.
        file: the clip, below the folder; empty where there is none.
        frames: of the clip.
        duration: of the clip before, seconds.
        seconds: that the method took, without the judgement.
        colliding_before, colliding: frames in collision, before and after.
        dips: motions between two free frames that overlap, after.
        deepest_before, deepest: of any pair in any frame, metres.
        deepest_between: of any pair at any time after, metres.
        angle: root of the mean square of the change of the joints, radians.
        distance: root mean square displacement of the joints' centres, metres.
        jerk: of the joints, in parts of that before; None where the clip before has none.
        sliding: by how much standing feet slide more than before, metres.
        missed: largest miss of a constraint, metres or radians.
        frames_changed, posture_solves, programs: counts.
        asked: fingerprint of clip, figure, equipment, method and constraints; a case with the same is not done again.

    Examples:
        >>> wb.motion.avoid_many([clip], folder)[0].colliding
        0
    """

    clip: str
    equipment: str
    method: str
    outcome: str = "ended"
    message: str = ""
    file: str = ""
    frames: int = 0
    duration: float = 0.0
    seconds: float = 0.0
    colliding_before: int = 0
    colliding: int = 0
    dips: int = 0
    deepest_before: float = 0.0
    deepest: float = 0.0
    deepest_between: float = 0.0
    angle: float = 0.0
    distance: float = 0.0
    jerk: float | None = None
    sliding: float = 0.0
    missed: float = 0.0
    frames_changed: int = 0
    posture_solves: int = 0
    programs: int = 0
    asked: str = ""

    __repr__ = brief

    @property
    def stem(self) -> str:
        """The case as the name of a file."""
        return "-".join(file_name(part) for part in (self.clip, self.equipment, self.method))


class BatchTable:
    """The folder of a batch. A clip is there before its row is."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        of = "cases of wb.motion.avoid_many"
        self._cases = RecordFile(folder / TABLE, of, lambda row: AvoidedCase(**row))  # by the names of the clips' files
        with suppress(InputError):  # where a finished batch is only read
            self._write_sheet()  # it may be gone, or a row short

    @cached_property
    def _originals(self) -> RecordFile[str]:
        """Fingerprints of recordings, by the names of their clips."""
        return RecordFile(self.folder / ORIGINALS / "clips.jsonl", "clips of wb.motion.read_many", str)

    def done(self, asked: AvoidedCase) -> AvoidedCase | None:
        """The row of a case that need not be done again; None if there is none, or its clip was taken away."""
        row = self._cases.kept.get(asked.stem)
        if row is None or row.asked != asked.asked or row.outcome == "ended":
            return None
        return None if row.file and not (self.folder / row.file).is_file() else row

    def add(self, row: AvoidedCase, clip: Clip | None) -> AvoidedCase:
        """Keep a case with its clip; returns the row with the clip's file."""
        if clip is not None:
            row = replace(row, file=f"{row.stem}.npz")
            clip.write(self.folder / row.file)
        self._cases.add(row.stem, row)
        self._write_sheet()
        return row

    def _write_sheet(self) -> None:
        if self._cases.kept:
            write(self.folder / SHEET, csv_text(map(asdict, self._cases.kept.values())))

    def original(self, name: str) -> Path:
        """The file of a clip as it was before."""
        return self.folder / ORIGINALS / f"{file_name(name)}.npz"

    def has_original(self, name: str, asked: str) -> bool:
        """Whether the clip of a recording was made before, of the same file and figure."""
        return self._originals.kept.get(name) == asked and self.original(name).is_file()

    def add_original(self, name: str, clip: Clip, asked: str) -> None:
        """Keep the clip of a recording."""
        clip.write(self.original(name))
        self._originals.add(name, asked)


def file_name(text: str) -> str:
    """A text as a part of a file's name."""
    return re.sub(r"[^\w.+]+", "_", text)


def first_twice(names: Iterable[str]) -> str | None:
    """The first name that is the same file's name as one before it."""
    seen = set[str]()
    for name in names:
        if (short := file_name(name).lower()) in seen:
            return name
        seen.add(short)
    return None

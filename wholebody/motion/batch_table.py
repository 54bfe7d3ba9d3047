"""What a batch has made so far: its table as JSON and CSV, and one clip a case, in a folder."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from wholebody.base.arrays import brief
from wholebody.base.errors import FileFormatError
from wholebody.base.files import make_folder, read_text, write
from wholebody.motion.clip import Clip

TABLE = "cases.json"
SHEET = "cases.csv"


@dataclass(frozen=True)
class AvoidedCase:
    """One clip with one piece of equipment, freed by one method: a row of the table of `avoid_many`.

    Attributes:
        clip, equipment, method: what was asked.
        outcome: "free"; "left" where something is left; "refused" where the input is wrong; "ended" where its process
            ended, which a further run does again.
        message: one sentence: what is left, or why there is no clip.
        file: the clip, below the folder; empty where there is none.
        frames: of the clip.
        duration: of the clip before, seconds.
        seconds: that the method took, without the judgement.
        colliding_before, colliding: frames in collision, before and after.
        dips: motions between two free frames that overlap, after.
        deepest_before, deepest: of any pair in any frame, metres.
        deepest_between: of any pair at any time after, metres.
        angle: root of the mean square of the change of the joints, radians.
        distance: root of the mean square of the way of the joints' centres, metres.
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
    """The folder of a batch. Each file is written whole; a clip is there before its row is."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._cases: dict[str, AvoidedCase] = {}
        self._originals: dict[str, str] = {}
        make_folder(folder)
        if (folder / TABLE).exists():
            self._read()

    def done(self, asked: str) -> AvoidedCase | None:
        """The row of a case that need not be done again; None if there is none, or its clip was taken away."""
        row = self._cases.get(asked)
        if row is None or row.outcome == "ended" or (row.file and not (self.folder / row.file).is_file()):
            return None
        return row

    def add(self, row: AvoidedCase, clip: Clip | None) -> AvoidedCase:
        """Keep a case with its clip; returns the row with the clip's file."""
        if clip is not None:
            row = replace(row, file=f"{row.stem}.npz")
            clip.write(self.folder / row.file)
        self._cases = {asked: other for asked, other in self._cases.items() if other.stem != row.stem}
        self._cases[row.asked] = row
        self._write()
        return row

    def original(self, name: str) -> Path:
        """The file of a clip as it was before."""
        return self.folder / "originals" / f"{file_name(name)}.npz"

    def has_original(self, name: str, asked: str) -> bool:
        """Whether the clip of a recording was made before, of the same file and figure."""
        return self._originals.get(name) == asked and self.original(name).is_file()

    def add_original(self, name: str, clip: Clip, asked: str) -> None:
        """Keep the clip of a recording."""
        make_folder(self.original(name).parent)
        clip.write(self.original(name))
        self._originals[name] = asked
        self._write()

    def _write(self) -> None:
        rows = [asdict(row) for row in self._cases.values()]
        names = [field.name for field in fields(AvoidedCase)]
        sheet = io.StringIO()
        made = csv.DictWriter(sheet, names, lineterminator="\n")
        made.writeheader()
        made.writerows(rows)
        write(self.folder / TABLE, json.dumps({"cases": rows, "originals": self._originals}, indent=1))
        write(self.folder / SHEET, sheet.getvalue())  # nobody reads it back: it may be older by a row after a crash

    def _read(self) -> None:
        path = self.folder / TABLE
        try:
            found = json.loads(read_text(path, "table"))
            rows = [AvoidedCase(**row) for row in found["cases"]]
            self._originals = {str(name): str(asked) for name, asked in found["originals"].items()}
        except (ValueError, TypeError, KeyError, AttributeError):
            raise FileFormatError(f"{path}: is no table of a batch of clips; give another folder") from None
        self._cases = {row.asked: row for row in rows}


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

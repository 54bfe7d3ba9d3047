"""What a run has found so far, in a file that is only ever appended to: a killed run goes on where it was.

One line is one chunk of work, written and flushed at once. A line that was not finished when the run was killed is cut
off before the run goes on; it is the only work that is done again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from wholebody.base.errors import FileFormatError, InputError
from wholebody.bench.suite.compare.record import Record

NAME = "chunks.jsonl"


@dataclass(frozen=True)
class Chunk:
    """One case by some methods.

    Attributes:
        set, number: which case.
        records: what came of it.
        spent: seconds that each method took at the default budget, all that it brought about included.
        swept: the same at all its other budgets.
        building: seconds to build the case.
        cold: seconds of the first solve of each method in its process, what it imports and compiles included; of the
            methods for which the process was new.
        kernel: seconds of the reference kernel in the process, before the case was solved.
        fault: why the case could not be built; empty where it was.
    """

    set: str
    number: int
    records: tuple[Record, ...]
    spent: Mapping[str, float] = field(default_factory=dict)
    swept: Mapping[str, float] = field(default_factory=dict)
    building: float = 0.0
    cold: Mapping[str, float] = field(default_factory=dict)
    kernel: float = 0.0
    fault: str = ""


class Store:
    """The file of a run."""

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        """Open or begin the file of a folder.

        Raises:
            InputError: the folder holds a run with other settings.
            FileFormatError: the file is none of ours.
        """
        self.path = folder / NAME
        folder.mkdir(parents=True, exist_ok=True)
        self.chunks: list[Chunk] = []
        wanted = json.loads(json.dumps(settings))
        if self.path.exists() and self.path.stat().st_size:
            self._resume(wanted)
        else:
            self._append(wanted)

    def add(self, chunk: Chunk) -> None:
        """Keep a chunk, on the disk before this returns."""
        self.chunks.append(chunk)
        self._append(asdict(chunk))

    @property
    def records(self) -> list[Record]:
        """All records, in the order of cases, methods and budgets as they were run."""
        chunks = sorted(self.chunks, key=lambda chunk: (chunk.set, chunk.number))
        return [record for chunk in chunks for record in chunk.records]

    def _append(self, value: Any) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(value) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def _resume(self, wanted: Any) -> None:
        data = self.path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        lines = whole.decode("utf-8").splitlines()
        if not lines:
            raise FileFormatError(f"{self.path}: it was cut off before its first line; remove it and run again")
        try:
            found, *chunks = [json.loads(line) for line in lines]
            self.chunks = [_chunk(value) for value in chunks]
        except (ValueError, TypeError, KeyError) as error:
            raise FileFormatError(f"{self.path}: not a file of this command ({error}); give another --out") from None
        if found != wanted:
            name = next(key for key in {**wanted, **found} if found.get(key) != wanted.get(key))
            raise InputError(
                f"{self.path.parent} holds a run with {name} = {_short(found.get(name))}, "
                f"and {_short(wanted.get(name))} is asked for; give another --out, or the settings "
                "of that run to go on with it"
            )
        if len(whole) < len(data):
            with self.path.open("r+b") as file:
                file.truncate(len(whole))


def _chunk(value: dict[str, Any]) -> Chunk:
    records = tuple(Record(**inner) for inner in value.pop("records"))
    return Chunk(records=records, **value)


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 80 else text[:77] + "..."

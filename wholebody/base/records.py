"""Records of a run in a folder, written one by one: a run that was cut off goes on where it ended."""

from __future__ import annotations

import fcntl
import functools
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO, Generic, Literal, TypeVar

from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.base.files import LARGEST, make_folder

T = TypeVar("T")
NO_HEAD = "its first line is not the head of a run"


class RecordFile(Generic[T]):
    """Records by key, in a file of JSON lines, the first of which says of what run they are.

    A record is in the file whole or not at all: a line that was cut off is removed. Of records of one key the last one
    counts. Several processes may write to one file; each sees what the others wrote at its next `add`. Numbers that are
    not finite come back as they were. `kept` has the records by key, in the order in which the keys came.

    `content` says in words what the records are, `make` makes one of the plain values that `dataclasses.asdict` gives
    (of a text it gets the text), `settings` are plain values of the run. InputError for other settings, or a file that
    cannot be written; FileFormatError for another file, or version.
    """

    def __init__(
        self, path: Path, content: str, make: Callable[[Any], T], settings: Mapping[str, Any] | None = None
    ) -> None:
        make_folder(path.parent)
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is no file; give another folder")
        self.path, self._make, self._read = path, make, 0
        self.kept: dict[str, T] = {}
        self._head = {"content": content, "version": "1.0", "code": source_digest(), **(settings or {})}
        with self._opened():
            pass

    def add(self, key: str, record: T) -> None:
        """Keep a record: it stays whatever comes of this process; without power its last seconds may be lost."""
        plain = asdict(record) if is_dataclass(record) and not isinstance(record, type) else record
        with self._opened() as file:
            self._read += file.write(_line([key, plain]))
        self.kept[key] = record

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        """The file, locked and read to its end."""
        # a finished run is read where nothing can be written
        mode: Literal["rb", "a+b"] = "rb" if self.path.exists() and not os.access(self.path, os.W_OK) else "a+b"
        try:
            with self.path.open(mode) as file:
                with suppress(OSError):  # a network file system may have no locks
                    fcntl.flock(file, fcntl.LOCK_EX)
                self._read_on(file)
                yield file
        except OSError as error:
            why = error.strerror or error
            raise InputError(f"{self.path} cannot be written ({why}); give another folder") from None

    def _read_on(self, file: BinaryIO) -> None:
        """Read what was written since the last time, and remove what was cut off."""
        if os.fstat(file.fileno()).st_size < self._read:  # somebody began it anew
            self._read = 0
        file.seek(self._read)
        data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise self._foreign("it is larger than any run")
        whole = data[: data.rfind(b"\n") + 1]
        lines = whole.split(b"\n")[:-1]
        if not self._read and not lines:
            head = _line(self._head)
            if not head.startswith(data):
                raise self._foreign(NO_HEAD)
            file.truncate(0)
            self._read = file.write(head)
            return
        try:
            if not self._read:
                self._check_head(lines.pop(0))
            for line in lines:
                key, plain = json.loads(line)
                self.kept[str(key)] = self._make(plain)
        except (FileFormatError, InputError):
            raise
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise self._foreign("a line is no record of it") from None
        if len(whole) < len(data) and file.writable():
            file.truncate(self._read + len(whole))
        self._read += len(whole)

    def _check_head(self, line: bytes) -> None:
        try:
            found = json.loads(line)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or not {"content", "version"} <= found.keys():
            raise self._foreign(NO_HEAD)
        for name in ("content", "version"):
            if found[name] != self._head[name]:
                raise self._foreign(f"its {name} is {found[name]}, not {self._head[name]}")
        for name in {**self._head, **found}:
            kept, wanted = found.get(name), self._head.get(name)
            if _line(kept) != _line(wanted):  # as text: NaN is equal to itself, and tuples to lists
                raise InputError(
                    f"{self.path.parent} holds a run with {name} = {one_line(str(kept))}, and {one_line(str(wanted))} "
                    "is asked for; give another folder, or the settings of that run to go on with it"
                )

    def _foreign(self, why: str) -> FileFormatError:
        content = self._head["content"]
        return FileFormatError(f"{self.path}: holds no {content} ({one_line(why)}); give another folder")


@functools.cache
def source_digest() -> str:
    """Digest of the Python files of the package, by which a run knows whether the same code began it."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def _line(value: Any) -> bytes:
    return json.dumps(value, default=lambda array: array.tolist()).encode() + b"\n"

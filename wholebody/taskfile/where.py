"""The place in a task file that an error names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from wholebody.base.errors import FileFormatError, InputError, UnknownNameError, WholebodyError, one_line

_HEADER = re.compile(r"^\s*\[\[?\s*([\w.-]+)\s*\]\]?")


@dataclass(frozen=True)
class Where:
    """A table of a task file, or a key in it."""

    file: Path  # the task file
    text: str = ""  # its text, used to find lines
    table: str = ""  # name of the table; empty at the top of the file
    number: int = 0  # number of the table among those of its name, from 1; 0 if there can be only one
    key: str = ""  # key in the table; empty for the table as a whole

    def at(self, key: str) -> Where:
        """The place of a key in this table, or of an entry (such as "[0]") in this key."""
        dot = "." if self.key and not key.startswith("[") else ""
        return Where(self.file, self.text, self.table, self.number, f"{self.key}{dot}{key}")

    def in_table(self, table: str, number: int = 0) -> Where:
        """The place of a table in this file."""
        return replace(self, table=table, number=number, key="")

    def fault(self, sentence: str) -> FileFormatError:
        """Make an error that names this place."""
        return FileFormatError(f"{self}: {sentence}")

    @contextmanager
    def named(self) -> Iterator[None]:
        """Inside it an error names this place."""
        try:
            yield
        except UnknownNameError as error:
            raise UnknownNameError(error.kind, error.name, error.known, str(self)) from None
        except InputError as error:
            raise InputError(f"{self}: {error}") from None
        except WholebodyError as error:
            raise type(error)(f"{self}: {error}") from None

    def __str__(self) -> str:
        """Return file, line if known, table and key."""
        line = self._line()
        table = f"{self.table} {self.number}" if self.number else self.table
        file, key = one_line(self.file.name), one_line(self.key)
        parts = [f"{file}:{line}" if line else file, table, f"key {key}" if key else ""]
        return ", ".join(part for part in parts if part)

    def _line(self) -> int | None:
        """Line of the key if it is on a line of its own, otherwise of its table's header."""
        header: int | None = None if self.table else 0
        seen = 0
        key = self.key.split(".")[0].split("[")[0]
        for number, line in enumerate(self.text.splitlines(), start=1):
            found = _HEADER.match(line)
            if found and self.table:
                if header is not None:
                    break
                if found[1] == self.table:
                    seen += 1
                    header = number if seen == max(self.number, 1) else None
            elif found:
                break
            elif header is not None and key and re.match(rf"\s*{re.escape(key)}\s*=", line):
                return number
        return header or None

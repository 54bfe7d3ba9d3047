"""The records of a run on disk, so that a run that was ended goes on: one SQLite file, one transaction a record."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import make_folder
from wholebody.studies.records import CANCELLED, ENDED, SolveRecord

NAME = "records.sqlite"


class RecordStore:
    """Records by the fingerprint of what was asked; a record is there whole or not at all."""

    def __init__(self, folder: Path) -> None:
        """Open the folder, or make it."""
        make_folder(folder)
        self.path = folder / NAME
        try:
            with closing(self._connection()) as connection, connection:
                connection.execute("CREATE TABLE IF NOT EXISTS records (asked TEXT PRIMARY KEY, record TEXT NOT NULL)")
        except sqlite3.OperationalError as error:
            raise InputError(f"{self.path} cannot be written ({error}); give another folder") from None
        except sqlite3.DatabaseError:
            raise self._foreign() from None

    def read(self) -> dict[str, SolveRecord]:
        """All records by fingerprint, without those whose process ended, which are done again."""
        try:
            with closing(self._connection()) as connection:
                rows = connection.execute("SELECT asked, record FROM records").fetchall()
            found = {str(asked): SolveRecord.from_json(record) for asked, record in rows}
        except (sqlite3.DatabaseError, ValueError, TypeError, KeyError, AttributeError):
            raise self._foreign() from None
        return {asked: record for asked, record in found.items() if record.outcome not in (ENDED, CANCELLED)}

    def add(self, asked: str, record: SolveRecord) -> None:
        """Keep a record."""
        with closing(self._connection()) as connection, connection:
            connection.execute("INSERT OR REPLACE INTO records VALUES (?, ?)", (asked, record.as_json()))

    def _connection(self) -> sqlite3.Connection:
        return sqlite3.connect(self.path, timeout=60.0)  # s: that another process may hold the file

    def _foreign(self) -> FileFormatError:
        return FileFormatError(f"{self.path}: holds no records of wb.solve_many; give another folder")

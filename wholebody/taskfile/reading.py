"""Reading of TOML into checked values: all keys of the file are checked before anything is computed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, UnknownNameError, one_line
from wholebody.base.files import is_file, parsed_toml, read_text
from wholebody.figures.figure import Figure
from wholebody.taskfile.kinds import Form, Key, Table, Where, values_of
from wholebody.taskfile.schema import TABLES, TOP

_ROBOT = "a robot; name it by path = {0!r} in the [figure] of a task file, or see it by `wholebody show {0}`"
OTHERS = {".urdf": _ROBOT, ".xml": _ROBOT, ".json": "no {1}; `wholebody show {0}` shows a result"}
"""What a file is that is no task file, by the ending of its name, and what to do with it."""


class Entry(NamedTuple):
    """One table of the file, checked."""

    where: Where  # its place
    form: Form | None  # its type; None if the table has no types
    name: str  # name of the type
    keys: Mapping[str, Key]  # the keys that it can have
    values: dict[str, Any]  # the values of the keys that it has

    def check_names(self, figure: Figure) -> None:
        """Check names against the figure."""
        for name, value in self.values.items():
            self.keys[name].kind.names(value, figure, self.where.at(name))

    def make(self) -> Any:
        """Make the object of this type."""
        assert self.form is not None
        assert self.form.make is not None
        try:
            own = {key.name for key in self.form.keys}
            return self.form.make(**{name: value for name, value in self.values.items() if name in own})
        except (UnknownNameError, ValueError, TypeError) as error:
            raise self.where.fault(str(error)) from None


class Contents(NamedTuple):
    """A task file, checked: its top and its tables by name."""

    top: Entry
    tables: dict[str, list[Entry]]

    def one(self, name: str) -> Entry | None:
        """The only table of a name, or None."""
        found = self.tables.get(name)
        return found[0] if found else None


def read_contents(path: Path) -> Contents:
    """Read a task file and check every table, key and value."""
    contents = contents_of(path, "task file", TOP, TABLES)
    if not contents.tables.get("figure"):
        raise contents.top.where.fault('there is no [figure] table; add [figure] with name = "human"')
    return contents


def contents_of(path: Path, kind: str, keys: tuple[Key, ...], known: Mapping[str, Table]) -> Contents:
    """Read a TOML file of a kind, such as "task file", with these keys at its top and these tables."""
    try:
        text = read_text(path, kind).replace("\r\n", "\n")
    except FileFormatError:
        if is_file(path) or os.path.lexists(path):
            raise
        there = sorted(file.name for file in path.parent.glob("*.toml")) if os.path.isdir(path.parent) else []
        place = "" if path.parent == Path() else one_line(str(path.parent))
        raise UnknownNameError(kind, path.name, there, place) from None
    if other := OTHERS.get(path.suffix.lower()):
        raise FileFormatError(f"{one_line(path.name)} is {other.format(one_line(path.name), kind)}")
    data, where, names = parsed_toml(text, path.name), Where(path, text), {key.name: key for key in keys}
    plain = {name: value for name, value in data.items() if name not in known}
    for name in plain:
        if name not in names:
            raise UnknownNameError(f"key or table of a {kind}", name, [*names, *known], str(where))
    top = Entry(where, None, "", names, values_of(plain, keys, where))
    return Contents(top, {name: _entries(name, data[name], known[name], where) for name in known if name in data})


def _entries(name: str, data: Any, table: Table, where: Where) -> list[Entry]:
    written = data if isinstance(data, list) else [data]
    wanted = f"[[{name}]]" if table.many else f"[{name}]"
    many = isinstance(data, list)
    if (many != table.many and not (many and table.either)) or not all(isinstance(entry, dict) for entry in written):
        raise where.in_table(name).fault(f"is written in another way; write {wanted}")
    places = [where.in_table(name, number + 1 if many else 0) for number in range(len(written))]
    return [_entry(entry, table, place) for entry, place in zip(written, places, strict=True)]


def _entry(data: dict[str, Any], table: Table, where: Where) -> Entry:
    data = dict(data)
    form, name = None, ""
    if table.forms is not None:
        known = list(table.forms)
        for key, implied in table.implied:
            if key in data:
                data.setdefault(table.chooser, implied)
        if table.chooser not in data:
            raise where.fault(f"key {table.chooser} is missing; write {table.chooser} = one of {', '.join(known)}")
        name = data.pop(table.chooser)
        if name not in known:
            raise UnknownNameError(
                f"{where.table} {table.chooser}", name if isinstance(name, str) else shown(name), known,
                str(where.at(table.chooser)),
            )  # fmt: skip
        form = table.forms[name]
    keys = (*table.keys, *(form.keys if form else ()))
    return Entry(where, form, name, {key.name: key for key in keys}, values_of(data, keys, where))

"""A study as a TOML file: a task file, and the people, targets and layouts that it is solved for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wholebody.base.checks import shown
from wholebody.base.errors import UnknownNameError
from wholebody.base.files import is_file
from wholebody.methods import METHODS
from wholebody.taskfile.kinds import PLACEMENT, POSITION, ByName, Choice, Flag, Kind, Text
from wholebody.taskfile.reading import read_toml
from wholebody.taskfile.things import FIGURES
from wholebody.taskfile.where import Where


@dataclass(frozen=True)
class StudyFile:
    """The content of a study file: the arguments of `wb.study`.

    Attributes:
        path: the file.
        task: the task file.
        people, targets, layouts: by name; None where the file has none.
        method: None for that of the task.
        warm_start: see `wb.study`.
    """

    path: Path
    task: Path
    people: dict[str, Any] | None
    targets: dict[str, Any] | None
    layouts: dict[str, Any] | None
    method: str | None
    warm_start: bool


_PLACES = ByName(PLACEMENT, "things that move", "table = [0.6, 0.0, 0.4]", "m")
_PERSON: dict[str, Kind] = {key.name: key.kind for key in FIGURES["human"].keys}
_TOP: dict[str, Kind] = {"task": Text(), "method": Choice(tuple(METHODS)), "warm_start": Flag()}
_TABLES = ("person", "target", "layout")


def read_study(path: Path) -> StudyFile:
    """Read a study file; paths in it are relative to its folder.

    Raises:
        FileFormatError: a file that cannot be read, or a value of the wrong kind; file, key and fix are named.
        UnknownNameError: an unknown key or a missing file, with the nearest names.
    """
    text, data = read_toml(path, "study file")
    where = Where(path, text)
    for name in data:
        if name not in (*_TOP, *_TABLES):
            raise UnknownNameError("key or table", name, [*_TOP, *_TABLES], str(where))
    top = {name: kind.read(data[name], where.at(name)) for name, kind in _TOP.items() if name in data}
    if "task" not in top:
        raise where.fault('key task is missing; write task = "TASK.toml"')
    task = path.parent / top["task"]
    if not is_file(task):
        there = sorted(file.name for file in task.parent.glob("*.toml")) if task.parent.is_dir() else []
        raise UnknownNameError("task file", top["task"], there, str(where.at("task")))
    people = _entries(data, "person", where, _person)
    targets = _entries(data, "target", where, lambda entry, at: _only(entry, at, "at", POSITION))
    layouts = _entries(data, "layout", where, _layout)
    if not (people or targets or layouts):
        raise where.fault("nothing varies; write a [[person]], [[target]] or [[layout]]")
    return StudyFile(path, task, people, targets, layouts, top.get("method"), top.get("warm_start", False))


def _entries(data: dict[str, Any], table: str, where: Where, read: Any) -> dict[str, Any] | None:
    """The entries of a table by name."""
    if table not in data:
        return None
    written = data[table]
    if not isinstance(written, list) or not all(isinstance(entry, dict) for entry in written):
        raise where.in_table(table).fault(f"is written in another way; write [[{table}]]")
    found: dict[str, Any] = {}
    for number, entry in enumerate(written, 1):
        place = where.in_table(table, number)
        rest = dict(entry)
        if "name" not in rest:
            raise place.fault('key name is missing; write name = "..."')
        name = Text().read(rest.pop("name"), place.at("name"))
        if name in found:
            raise place.at("name").fault(f"{shown(name)} is the name of another {table} too; give it another one")
        found[name] = read(rest, place)
    return found


def _person(entry: dict[str, Any], where: Where) -> dict[str, Any]:
    for name in entry:
        if name not in _PERSON:
            raise UnknownNameError("key", name, ["name", *_PERSON], str(where.at(name)))
    return {name: _PERSON[name].read(value, where.at(name)) for name, value in entry.items()}


def _layout(entry: dict[str, Any], where: Where) -> dict[str, Any]:
    found: dict[str, Any] = _only(entry, where, "move", _PLACES)
    return found


def _only(entry: dict[str, Any], where: Where, key: str, kind: Kind) -> Any:
    """The value of the only key of a table besides its name."""
    for name in entry:
        if name != key:
            raise UnknownNameError("key", name, ["name", key], str(where.at(name)))
    if key not in entry:
        raise where.fault(f"key {key} is missing; write {key} = {kind.words}")
    return kind.read(entry[key], where.at(key))

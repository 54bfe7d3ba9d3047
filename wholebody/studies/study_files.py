"""Studies from files: variants of a task file, and a study as a TOML file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from wholebody.base import checks
from wholebody.base.arrays import with_values
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.files import is_file
from wholebody.figures.adjustable import ADJUSTABLE
from wholebody.geometry.placement import placement
from wholebody.methods import METHODS
from wholebody.problem import Problem
from wholebody.taskfile.kinds import FLAG, PLACEMENT, POSITION, TEXT, ByName, Key, Table, choice
from wholebody.taskfile.reading import Contents, Entry, contents_of, read_contents
from wholebody.taskfile.schema import FIGURES
from wholebody.taskfile.task import task_from

SIZE = frozenset(("sex", "stature", "mass", "percentile", "proportions", "age"))
"""Options of a figure that together say what person it is."""


class TaskFile:
    """A task file of which variants are made; it can be sent to another process."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._place = path.absolute()  # a process that reads it again may work in another folder
        self.contents = read_contents(path)
        self.task = task_from(self.contents, path)

    def check(self, people: Iterable[Mapping[str, Any]], targets: Iterable[Any], layouts: Iterable[Any]) -> None:
        """Check values of variants."""
        for person in people:
            self._figures(person)
        for target in targets:
            self._goal()
            checks.numbers(target, (3,), "study: a target")
        for layout in layouts:
            self._things(layout)

    def __call__(self, person: Mapping[str, Any] | None, target: Any, layout: Any) -> Problem:
        """The problem of a variant."""
        tables = dict(self.contents.tables)
        if person is not None:
            tables["figure"] = self._figures(person)
        if target is not None:
            tables["goal"] = list(tables["goal"])
            number = self._goal()
            goal = tables["goal"][number]
            place = tuple(float(value) for value in target)
            old = goal.values["target"]
            if goal.name == "frame" and len(old) == 7:
                place = (*place, *old[3:])
            tables["goal"][number] = with_values(goal, values={**goal.values, "target": place})
        if layout is not None:
            moved = self._things(layout)
            tables["object"] = [
                with_values(entry, values={**entry.values, "at": moved[name]})
                if (name := entry.values["name"]) in moved else entry
                for entry in tables["object"]
            ]  # fmt: skip
        return task_from(with_values(self.contents, tables=tables), self.path).problem

    def __reduce__(self) -> tuple[Any, ...]:
        return TaskFile, (self._place,)

    def _figures(self, person: Mapping[str, Any]) -> list[Entry]:
        """The figures of the file, with a person in place of the only one, or of the one called so."""
        entries = list(self.contents.tables["figure"])
        known = {e.values.get("called", ""): place for place, e in enumerate(entries)
                 if "on" not in e.values and e.name != ADJUSTABLE}  # fmt: skip
        if len(known) > 1 and "called" not in person:
            raise InputError(
                f"study: {self.path.name} has several figures; say whose place a person takes: "
                f"{{'called': {next(iter(known))!r}, 'stature': 1.6}}"
            )
        if "called" in person and [*known] == [""]:
            raise InputError(f"study: {self.path.name} has one figure, which has no name; leave 'called' out")
        place = known[checks.known(person.get("called", next(iter(known))), known, "figure", "study: a person")]
        entry = entries[place]
        for name in person:
            if name not in entry.keys:
                raise UnknownNameError("option", name, entry.keys, "study: a person")
        kept = dict(entry.values)
        if SIZE & person.keys():  # a stature of the file does not belong to another person
            kept = {name: value for name, value in kept.items() if name not in SIZE}
        entries[place] = with_values(entry, values={**kept, **person})
        return entries

    def _goal(self) -> int:
        for number, entry in enumerate(self.contents.tables.get("goal", ())):
            if entry.name in ("point", "frame") and "soft" not in entry.values:  # types whose target is a place
                return number
        raise InputError(f"study: {self.path.name} has no goal of type point or frame to be met; targets mean nothing")

    def _things(self, layout: Any) -> dict[str, Any]:
        if not isinstance(layout, Mapping):
            raise InputError(
                f"study: a layout is {checks.shown(layout)}; give places by thing, such as {{'desk': (x, y, z)}}"
            )
        known = [entry.values["name"] for entry in self.contents.tables.get("object", ())]
        for name, at in layout.items():
            checks.known(name, known, "thing", "study: a layout")
            placement(at, f"study: the layout's {name}")
        return dict(layout)


_TOP = (Key("task", TEXT, True), Key("method", choice(METHODS)), Key("warm_start", FLAG))
_NAME = Key("name", TEXT, True)
_PLACES = ByName(PLACEMENT, "things that move", "table = [0.6, 0.0, 0.4]", "m")
_TABLES = {
    "person": Table((_NAME, Key("called", TEXT), *FIGURES["human"].keys), True),
    "target": Table((_NAME, Key("at", POSITION, True)), True),
    "layout": Table((_NAME, Key("move", _PLACES)), True),
}


def read_study(path: Path) -> dict[str, Any]:
    """The arguments of `wb.study` that a study file says; paths in it are relative to its folder."""
    contents = contents_of(path, "study file", _TOP, _TABLES)
    top, where = contents.top.values, contents.top.where
    task = path.parent / top["task"]
    if not is_file(task):
        there = sorted(file.name for file in task.parent.glob("*.toml")) if task.parent.is_dir() else []
        raise UnknownNameError("task file", top["task"], there, str(where.at("task")))
    found = {f"{factor}s": _by_name(contents, factor) for factor in ("target", "layout")}
    found["people"] = _by_name(contents, "person")
    if not any(found.values()):
        raise where.fault("nothing varies; write a [[person]], [[target]] or [[layout]]")
    return {**found, **top, "task": task}


def _by_name(contents: Contents, table: str) -> dict[str, Any] | None:
    """What the entries of a table say by name; None without the table."""
    found: dict[str, Any] = {}
    for entry in contents.tables.get(table, ()):
        name = entry.values["name"]
        if name in found:
            message = f"{shown(name)} is the name of another {table} too; give it another one"
            raise entry.where.at("name").fault(message)
        rest = {key: value for key, value in entry.values.items() if key != "name"}
        found[name] = rest if table == "person" else next(iter(rest.values()), {})  # a layout may move nothing
    return found or None

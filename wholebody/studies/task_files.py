"""Variants of a task file: another person, another target of its first goal, things at other places."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wholebody.base import checks
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.records import with_values
from wholebody.geometry.placement import placement
from wholebody.problem import Problem
from wholebody.taskfile.reading import Entry, read_contents
from wholebody.taskfile.task import task_from

SIZE = frozenset(("sex", "stature", "mass", "percentile", "proportions", "age"))
"""Options of a figure that together say what person it is."""


class TaskFile:
    """A task file of which variants are made; it can be sent to another process."""

    def __init__(self, path: Path) -> None:
        """Read the file and check it."""
        self.path = path
        self._place = path.absolute()  # a process that reads it again may work in another folder
        self.contents = read_contents(path)
        self.task = task_from(self.contents, path)

    def check(self, person: Mapping[str, Any] | None, target: Any, layout: Any) -> None:
        """Check values of a variant."""
        if target is not None:
            self._goal()
            checks.numbers(target, (3,), "study: a target")
        if layout is not None:
            self._things(layout)
        if person is not None:
            self._figure(person)

    def __call__(self, person: Mapping[str, Any] | None, target: Any, layout: Any) -> Problem:
        """The problem of a variant."""
        tables = dict(self.contents.tables)
        if person is not None:
            tables["figure"] = [self._figure(person)]
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

    def _figure(self, person: Mapping[str, Any]) -> Entry:
        entry = self.contents.one("figure")
        assert entry is not None
        for name in person:
            if name not in entry.keys:
                raise UnknownNameError("option", name, entry.keys, "study: a person")
        kept = dict(entry.values)
        if SIZE & person.keys():  # a stature of the file does not belong to another person
            kept = {name: value for name, value in kept.items() if name not in SIZE}
        return with_values(entry, values={**kept, **person})

    def _goal(self) -> int:
        for number, entry in enumerate(self.contents.tables.get("goal", ())):
            if entry.name in ("point", "frame"):  # types of goals whose target is a place
                return number
        raise InputError(f"study: {self.path.name} has no goal of type point or frame, so targets mean nothing")

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

"""The tables of a task file: keys, each of a kind, and types with keys of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from wholebody.taskfile.kinds import Kind


@dataclass(frozen=True)
class Key:
    """One key of a table.

    Attributes:
        name: its name in the file; also the name of the argument.
        kind: the accepted values.
        says: its meaning, for the documentation.
        required: whether the table must have it.
    """

    name: str
    kind: Kind
    says: str
    required: bool = False


@dataclass(frozen=True)
class Form:
    """One type of a table, such as a goal of type "point".

    Attributes:
        says: its meaning, for the documentation.
        keys: its own keys, in addition to those of the table.
        make: makes the object from the keys; None if the caller makes it.
    """

    says: str
    keys: tuple[Key, ...] = ()
    make: Callable[..., Any] | None = None


@dataclass(frozen=True)
class Table:
    """A table of the file.

    Attributes:
        says: its meaning, for the documentation.
        keys: keys of every type.
        many: whether the file can have several, written in double brackets.
        chooser: key that names the type; empty if there are no types.
        implied: keys that only one type has and that imply it: (key, type).
        forms: types by name.
    """

    says: str
    keys: tuple[Key, ...] = ()
    many: bool = False
    chooser: str = ""
    implied: tuple[tuple[str, str], ...] = ()
    forms: dict[str, Form] | None = None

"""What a table of a task file is: keys, each of a kind, and types with keys of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from wholebody.taskfile.kinds import Kind


@dataclass(frozen=True)
class Key:
    """One key of a table.

    Attributes:
        name: as it is written in the file; also the argument it becomes.
        kind: what it accepts.
        says: what it is for.
        required: whether it must be there.
    """

    name: str
    kind: Kind
    says: str
    required: bool = False


@dataclass(frozen=True)
class Form:
    """One type of a table, such as a goal of type "point".

    Attributes:
        says: what it is.
        keys: its own keys, beside those of the table.
        make: makes the object from the keys; None where the builder of the whole does it.
    """

    says: str
    keys: tuple[Key, ...] = ()
    make: Callable[..., Any] | None = None


@dataclass(frozen=True)
class Table:
    """A table of the file.

    Attributes:
        says: what it is for.
        keys: keys of every type.
        many: whether there can be several, written in double brackets.
        chooser: key that names the type; empty where there are no types.
        implied: keys that only one type has and that stand for naming it: (key, type).
        forms: types by name.
    """

    says: str
    keys: tuple[Key, ...] = ()
    many: bool = False
    chooser: str = ""
    implied: tuple[tuple[str, str], ...] = ()
    forms: dict[str, Form] | None = None

"""Tables of a task file and kinds of values: what is accepted, its description, and the message about a wrong one."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from wholebody.base import fields
from wholebody.base.checks import color, flag, plain, shown, text
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError, WholebodyError, either, one_line
from wholebody.base.fields import Check, Range, Vector, check_of
from wholebody.figures.anthropometry import DIMENSION
from wholebody.figures.figure import Figure
from wholebody.geometry.placement import unit_vector
from wholebody.tasks import inputs
from wholebody.tasks.inputs import FARTHEST

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


class Kind(Protocol):
    """The values that a key accepts."""

    @property
    def words(self) -> str:
        """The accepted values in words, for the documentation and for errors."""

    def read(self, value: Any, where: Where) -> Any:
        """Return the value in the form that Python code takes."""

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Check names against the figure."""


class Nameless:
    """Base of kinds whose values name nothing of a figure."""

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Check nothing."""


_IN_TOML = {"True or False": "true or false, without quotes", "math.inf": "inf", "(1.0, 0.0, 0.0)": "[1.0, 0.0, 0.0]"}
"""How a file has what checks ask for in Python."""


@dataclass(frozen=True)
class Value(Nameless):
    """What a check accepts, as it is in Python."""

    words: str
    check: Check

    def read(self, value: Any, where: Where) -> Any:
        """Return what the check returns."""
        try:
            return self.check(value, "")
        except InputError as error:
            said = str(error)
            for python, toml in _IN_TOML.items():
                said = said.replace(python, toml)
            raise FileFormatError(f"{where}{said}") from None


def _text(value: object, what: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{what} is {shown(value)}; give a text, in quotes")
    return value


def number(within: Range) -> Value:
    """A number within a range."""
    ends = f"from {plain(within.low)} to {plain(within.high)} {within.unit}"
    return Value(f"{'whole number' if within.whole else 'number'} {ends}".strip(), within)


def choice(options: Iterable[str]) -> Value:
    """One of a few words."""
    words = tuple(options)
    return Value(either(f'"{word}"' for word in words), fields.Choice(words))


@dataclass(frozen=True)
class Numbers(Nameless):
    """A fixed count of numbers of one range."""

    vector: Vector
    axes: str = ""

    @property
    def words(self) -> str:
        """Count and unit."""
        unit = self.vector.each.unit
        return f"{self.axes or f'{self.vector.count} numbers'}{', ' + unit if unit else ''}"

    def read(self, value: Any, where: Where) -> tuple[float, ...]:
        """Return the numbers."""
        count, each = self.vector.count, number(self.vector.each)
        if not isinstance(value, list) or len(value) != count:
            raise where.fault(f"{shown(value)} is not {self.words}; write {count} numbers in brackets")
        return tuple(each.read(entry, where.at(f"[{i}]")) for i, entry in enumerate(value))


class Placement(Nameless):
    """Position, or position and orientation."""

    words = "[x, y, z], [x, y, z, qx, qy, qz, qw] or a 4x4 matrix, m"

    def read(self, value: Any, where: Where) -> Any:
        """Return the placement, as `wholebody.geometry.placement` takes it."""
        if isinstance(value, list) and len(value) == 4 and all(isinstance(row, list) for row in value):
            row = Numbers(Vector(4, POSITION.vector.each))
            return [row.read(entries, where.at(f"[{i}]")) for i, entries in enumerate(value)]
        if isinstance(value, list) and len(value) == 7:
            return POSITION.read(value[:3], where) + QUATERNION.read(value[3:], where)
        if isinstance(value, list) and len(value) == 3:
            return POSITION.read(value, where)
        raise where.fault(f"{shown(value)} is no place; write {self.words}")


@dataclass(frozen=True)
class Name:
    """A name that the figure knows."""

    noun: str
    known: Callable[[Figure], Iterable[str]]

    @property
    def words(self) -> str:
        """The kind of object that is named."""
        return f"name of a {self.noun}"

    def read(self, value: Any, where: Where) -> str:
        """Return the name."""
        name: str = TEXT.read(value, where)
        return name

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Look the name up."""
        known = list(self.known(figure))
        if value not in known:
            raise UnknownNameError(self.noun, value, known, str(where))


@dataclass(frozen=True)
class Several:
    """One or more values of one kind."""

    kind: Kind
    least: int = 1
    example: str = ""

    @property
    def words(self) -> str:
        """The list and its entries."""
        if self.example:
            return f"list such as {self.example}"
        article = "a " if isinstance(self.kind, Name) or self.kind is TEXT else ""
        return f"list, each {article}{self.kind.words}"

    def read(self, value: Any, where: Where) -> list[Any]:
        """Return the list."""
        if not isinstance(value, list) or len(value) < self.least:
            what = f"list of {self.kind.noun}s" if isinstance(self.kind, Part) else self.words
            raise where.fault(f"{shown(value)} is no {what}; write {self.least} or more in brackets")
        return [self.kind.read(entry, where.at(f"[{i}]")) for i, entry in enumerate(value)]

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Look all names up."""
        for i, entry in enumerate(value):
            self.kind.names(entry, figure, where.at(f"[{i}]"))


@dataclass(frozen=True)
class ByName:
    """Values by name, which whoever uses them looks up."""

    kind: Kind  # of the values
    what: str  # the names, such as "dimensions"
    example: str  # a name and a value as they are written
    unit: str  # of the values
    names_of: Kind | None = None  # of the names, where the figure knows them

    @property
    def words(self) -> str:
        """Return how it is written."""
        return f"{{ {self.example}, ... }}, {self.unit}"

    def read(self, value: Any, where: Where) -> dict[str, Any]:
        """Return the values by name."""
        if not isinstance(value, dict):
            raise where.fault(f"{shown(value)} is not a table of {self.what}; write {{ {self.example} }}")
        return {name: self.kind.read(entry, where.at(name)) for name, entry in value.items()}

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Look the names up."""
        if self.names_of is not None:
            for name in value:
                self.names_of.names(name, figure, where.at(name))


@dataclass(frozen=True)
class Part:
    """A table in braces, within a value, that makes an object."""

    noun: str
    example: str  # a table as it is written, without its braces
    forms: dict[str, Form]  # by the values of `chooser`; one of name "" where there is none
    chooser: str = ""  # key that names the form
    note: str = ""  # about the keys, for the documentation

    @property
    def words(self) -> str:
        """An example, and what its keys mean."""
        return f"{{ {self.example} }}{self.note}"

    def read(self, value: Any, where: Where) -> Any:
        """Return the object."""
        if not isinstance(value, dict):
            raise where.fault(f"{shown(value)} is no {self.noun}; write {{ {self.example} }}")
        if self.chooser and self.chooser not in value:
            choices = either(f'{self.chooser} = "{name}"' for name in self.forms)
            raise where.fault(f"the {self.noun} has no {self.chooser}; write {choices}")
        data = {name: entry for name, entry in value.items() if name != self.chooser}
        chosen = choice(self.forms)
        form = self.forms[chosen.read(value[self.chooser], where.at(self.chooser)) if self.chooser else ""]
        assert form.make is not None
        read = values_of(data, form.keys, where)
        try:
            return form.make(**read)
        except InputError as error:
            raise where.fault(str(error)) from None

    def names(self, value: Any, figure: Figure, where: Where) -> None:
        """Look up the names in it."""
        for key in {key.name: key for form in self.forms.values() for key in form.keys}.values():
            if (found := getattr(value, key.name, None)) is not None:
                key.kind.names(found, figure, where.at(key.name))


TEXT = Value("text", _text)
LINE = Value("text", text)  # which is shown
FLAG = Value("true or false", flag)
COLOR = Value(
    'red, green, blue and, if given, alpha, each from 0 to 1; a name such as "steelblue"; or "#rrggbb"', color
)
POSITION = Numbers(Vector(3, Range(-FARTHEST, FARTHEST, "m")), "[x, y, z]")
DIRECTION = Numbers(Vector(3, Range(-1e6, 1e6)), "[x, y, z], any length")
PLACEMENT = Placement()
QUATERNION = Numbers(Vector(4, Range(-1.001, 1.001)), "[qx, qy, qz, qw]")
ROOT = Name("free root", lambda figure: figure.roots)
JOINT = Name("joint", lambda figure: figure.joints)
GROUP = Name("joint or group", lambda figure: {*figure.joints, *figure.groups, *figure.roots})
FRAME = Name("frame", lambda figure: {*figure.frames, *figure.segments, *figure.joints})
SEGMENT = Name("segment", lambda figure: figure.segments)
MEMBER = Name("figure", lambda figure: figure.members)
POSTURE = Name("posture", lambda figure: figure.postures)
PROPORTIONS = ByName(number(DIMENSION), "dimensions", "sitting_height = 0.93", "m")
JOINT_VALUES = ByName(
    number(Range(-2.0 * math.pi, 2.0 * math.pi, "rad")), "joints", "left_elbow_flexion = 0.5",
    "rad (m for sliding joints)", JOINT,
)  # fmt: skip
ROOT_PLACES = ByName(PLACEMENT, "free roots", '"anna/root" = [0.0, 0.0, 0.93]', "m", ROOT)
CONE = Name("reach cone", lambda figure: figure.cones)
RANGE = Name("range of motion", lambda figure: figure.ranges)

_OF_CHECKS: dict[Check, Kind] = {
    inputs.point: POSITION,
    inputs.direction: DIRECTION,
    unit_vector: DIRECTION,
    inputs.target_placement: PLACEMENT,
    inputs.target_rotation: QUATERNION,
    flag: FLAG,
    inputs.name: TEXT,
    text: TEXT,
}


def kind_of(record: type, field: str) -> Kind:
    """The values that a field of a class accepts, as they are written in a file."""
    check = check_of(record, field)
    if isinstance(check, Range):
        return number(check)
    if isinstance(check, Vector):
        return Numbers(check)
    return choice(check.options) if isinstance(check, fields.Choice) else _OF_CHECKS[check]


@dataclass(frozen=True)
class Key:
    """One key of a table."""

    name: str  # its name in the file; also the name of the argument
    kind: Kind  # the accepted values
    required: bool = False  # whether the table must have it


@dataclass(frozen=True)
class Form:
    """One type of a table, such as a goal of type "point"."""

    keys: tuple[Key, ...] = ()  # its own keys, in addition to those of the table
    make: Callable[..., Any] | None = None  # makes the object from the keys; None if the caller makes it


@dataclass(frozen=True)
class Table:
    """A table of the file."""

    keys: tuple[Key, ...] = ()  # keys of every type
    many: bool = False  # whether the file can have several, written in double brackets
    chooser: str = ""  # key that names the type; empty if there are no types
    implied: tuple[tuple[str, str], ...] = ()  # keys that only one type has and that imply it: (key, type)
    forms: Mapping[str, Form] | None = None  # types by name
    either: bool = False  # whether it may have one in single brackets, or several in double ones


def values_of(data: dict[str, Any], keys: tuple[Key, ...], where: Where) -> dict[str, Any]:
    """The values of a table, checked and in the form that Python code takes."""
    known = {key.name: key for key in keys}
    for name in data:
        if name not in known:
            raise UnknownNameError("key", name, known, str(where.at(name)))
    for key in keys:
        if key.required and key.name not in data:
            raise where.fault(f"key {key.name} is missing; write {key.name} = {key.kind.words}")
    return {name: known[name].kind.read(value, where.at(name)) for name, value in data.items()}

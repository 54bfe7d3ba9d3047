"""The text of a BVH file: joints, channels and numbers, every fault with its line."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, one_line
from wholebody.motion.files.base import frame_count, seconds, table
from wholebody.motion.files.base import number as read_number

MOST_JOINTS = 1000


@dataclass
class BvhJoint:
    """A joint, or the end of a limb, which has no channels."""

    name: str  # such as "LeftUpLeg"
    parent: int  # index, -1 for the root
    line: int  # where it begins
    offset: tuple[float, ...] = ()  # in the parent's axes, units of the file
    # (axis, "position" or "rotation") in the order of the file
    channels: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class BvhText:
    """What the text says."""

    joints: list[BvhJoint]  # parents before children
    table: Array  # (frames, channels) numbers of the motion
    dt: float  # seconds
    notes: tuple[str, ...] = ()  # sentences on what was changed

    @property
    def parents(self) -> Indices:
        """(j,) index of each joint's parent; -1 for the root."""
        return np.array([joint.parent for joint in self.joints], dtype=np.intp)

    @cached_property
    def columns(self) -> list[dict[tuple[str, str], Array]]:
        """The channels of each joint: (axis, kind) to its numbers (n,)."""
        columns, at = [], 0
        for joint in self.joints:
            columns.append({channel: self.table[:, at + k] for k, channel in enumerate(joint.channels)})
            at += len(joint.channels)
        return columns

    def moves(self, joint: int) -> bool:
        """Whether a joint has positions; some programs write zeros, which are to be added to the offsets."""
        return any(values.any() for (_, kind), values in self.columns[joint].items() if kind == "position")

    def positions(self, joint: int) -> Array:
        """Positions of a joint in its parent (n, 3): its channels, and its offset where it has none."""
        still, offset, columns = np.zeros(len(self.table)), self.joints[joint].offset, self.columns[joint]
        return np.stack(
            [columns.get((axis, "position"), still + at) for axis, at in zip("XYZ", offset, strict=True)], axis=1
        )


def parsed(text: str, name: str) -> BvhText:
    """Joints and numbers of the text of a file of a name; an error names its line."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    place = _Hierarchy(name, lines).read()
    frames, rest = _counted(name, lines, place.at, r"frames\s*:\s*(\S+)", "Frames:")
    step, rest = _counted(name, lines, rest, r"frame\s*time\s*:\s*(\S+)", "Frame Time:")
    count = frame_count(frames, f"{name}, line {lines[rest - 2][0]}")
    number = lines[rest - 1][0]
    dt = seconds(step, f"{name}, line {number}")
    wide = sum(len(joint.channels) for joint in place.joints)
    rows = _unwrapped([(number, line.split()) for number, line in lines[rest:]], count, wide)
    values = table(name, rows[:count], [f"value {k + 1}" for k in range(wide)])
    if len(rows) != count:
        number = rows[-1][0] if rows else number
        what = "cut off" if len(rows) < count else "longer than it says"
        raise FileFormatError(f"{name}, line {number}: {len(rows)} frames and not {count}; the file is {what}")
    return BvhText(place.joints, values, dt, tuple(place.notes))


def _unwrapped(rows: list[tuple[int, list[str]]], count: int, wide: int) -> list[tuple[int, list[str]]]:
    """The rows of the frames where their lines are wrapped: as many words as the frames have, in other lines."""
    if len(rows) == count or not wide or sum(len(words) for _, words in rows) != count * wide:
        return rows
    words = [(number, word) for number, line in rows for word in line]
    return [
        (words[k][0], [word for _, word in words[k : k + wide]]) for k in range(0, count * wide, wide)
    ]  # fmt: skip


class _Hierarchy:
    def __init__(self, name: str, lines: list[tuple[int, str]]) -> None:
        self.name, self.lines = name, lines
        self.joints: list[BvhJoint] = []
        self.notes: list[str] = []
        self.at = 0
        self._open: list[int] = []

    def read(self) -> _Hierarchy:
        """Read up to and with the line MOTION; `at` is the line after it."""
        if not self.lines or self.lines[0][1].upper() != "HIERARCHY":
            raise FileFormatError(f"{self.name}, line 1: is no BVH file; its first line is not HIERARCHY")
        for at, (number, line) in enumerate(self.lines[1:], 2):
            self.at = at
            if line.upper() == "MOTION":
                break
            self._line(f"{self.name}, line {number}", number, line)
        else:
            raise FileFormatError(f"{self.name}, line {self.lines[-1][0]}: the file is cut off; there is no MOTION")
        where = f"{self.name}, line {self.lines[self.at - 1][0]}"
        if self._open:
            raise FileFormatError(f"{where}: {len(self._open)} braces are not closed before MOTION")
        if not self.joints:
            raise FileFormatError(f"{where}: there is no ROOT")
        for joint in self.joints:
            if len(joint.offset) != 3:
                raise FileFormatError(f"{self.name}, line {joint.line}: {one_line(joint.name)} has no OFFSET")
        if sum(kind == "position" for _, kind in self.joints[0].channels) not in (0, 3):
            where = f"{self.name}, line {self.joints[0].line}"
            raise FileFormatError(f"{where}: the root has one or two position channels; give three, or none")
        return self

    def _line(self, where: str, number: int, line: str) -> None:
        word, rest = (*line.split(None, 1), "")[:2]
        word, rest = word.upper(), rest.strip()
        if word in ("ROOT", "JOINT", "END"):
            self._begin(where, number, word, rest)
        elif line == "{":
            if not self.joints or len(self._open) > 200:
                raise FileFormatError(f"{where}: a brace that opens no joint")
        elif line == "}":
            if not self._open:
                raise FileFormatError(f"{where}: a brace that closes nothing")
            self._open.pop()
        elif word in ("OFFSET", "CHANNELS") and self._open:
            self._field(where, self.joints[self._open[-1]], word, rest.split())
        else:
            raise FileFormatError(f"{where}: {one_line(line, 40)!r} is no line of a hierarchy")

    def _begin(self, where: str, number: int, word: str, rest: str) -> None:
        name = rest.removesuffix("{").strip()
        if word == "ROOT" and self.joints:
            raise FileFormatError(f"{where}: a second root, {one_line(name)!r}; give each skeleton a file of its own")
        if word != "ROOT" and not self._open:
            raise FileFormatError(f"{where}: {word} outside of the root")
        if len(self.joints) >= MOST_JOINTS:
            raise FileFormatError(f"{where}: more than {MOST_JOINTS} joints")
        parent = self._open[-1] if self._open else -1
        if word == "END":
            name = f"{self.joints[parent].name}_end"
        if not name:
            raise FileFormatError(f"{where}: a joint without a name")
        while word == "END" and any(joint.name == name for joint in self.joints):
            name += "_"
        if any(joint.name == name for joint in self.joints):
            known = {joint.name for joint in self.joints}
            other = next(f"{name}_{k}" for k in range(2, MOST_JOINTS + 2) if f"{name}_{k}" not in known)
            self.notes.append(f"a second joint is called {one_line(name)!r}; it is {one_line(other)!r} here")
            name = other
        self._open.append(len(self.joints))
        self.joints.append(BvhJoint(name, parent, number))

    def _field(self, where: str, joint: BvhJoint, word: str, words: list[str]) -> None:
        if word == "OFFSET":
            if joint.offset or len(words) != 3:
                raise FileFormatError(f"{where}: an OFFSET has three numbers, once for each joint")
            joint.offset = tuple(read_number(value, where) for value in words)
            return
        found = [re.fullmatch(r"([XYZ])(position|rotation)", value, re.IGNORECASE) for value in words[1:]]
        if not words or joint.channels or words[0] != str(len(found)) or None in found:
            raise FileFormatError(
                f"{where}: CHANNELS are a count and as many names, such as 3 Zrotation Xrotation Yrotation"
            )
        joint.channels = [(match[1].upper(), match[2].lower()) for match in found if match]
        if len(set(joint.channels)) != len(joint.channels):
            raise FileFormatError(f"{where}: a channel stands there twice")


def _counted(name: str, lines: list[tuple[int, str]], at: int, pattern: str, word: str) -> tuple[str, int]:
    if at >= len(lines):
        raise FileFormatError(f"{name}, line {lines[-1][0]}: the file is cut off; there is no {word}")
    number, line = lines[at]
    match = re.fullmatch(pattern, line, re.IGNORECASE)
    if match is None:
        raise FileFormatError(f"{name}, line {number}: {one_line(line, 40)!r} stands where {word} is due")
    return match[1], at + 1

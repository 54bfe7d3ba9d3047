"""Reading of XML files of robots, and of their numbers, with checks against impossible values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from wholebody.base.checks import shown, warn_of_degrees
from wholebody.base.errors import FileFormatError, one_line
from wholebody.base.files import read_bytes


def read_robot(path: Path, kind: str) -> Element:
    """Return the `<robot>` of a "URDF" or an "SRDF"."""
    data = read_bytes(path, kind, 64 * 2**20)  # the largest that is accepted as a description of a robot
    try:
        robot = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        if b"\0" in data or "\ufffd" in data.decode("utf-8", "replace"):
            raise FileFormatError(f"{path}: this is not a text file; give a {kind}") from None
        raise FileFormatError(f"{path}: the XML is broken ({one_line(str(error))}); correct that place") from None
    except (LookupError, ValueError) as error:
        raise FileFormatError(
            f"{path}: its encoding cannot be read ({one_line(str(error))}); save the file as UTF-8 and say so in its "
            "first line"
        ) from None
    if robot.tag != "robot":
        mend = {"mujocoinclude": "load the MJCF file that includes it"}.get(robot.tag, f"give a robot's {kind}")
        raise FileFormatError(f"{path}: the outermost element is <{robot.tag}>, not <robot>; {mend}")
    if path.suffix == ".xacro" or robot.find(".//{http://www.ros.org/wiki/xacro}*") is not None:
        raise FileFormatError(
            f"{path}: this is a xacro macro file; expand it first with `xacro {path.name} > robot.{kind.lower()}`"
        )
    return robot


def unique_names(elements: Sequence[Element], kind: str, path: Path) -> tuple[str, ...]:
    """Return the names of elements; one without a name, or two of one name, are refused by a `FileFormatError`."""
    names: dict[str, None] = {}
    for k, element in enumerate(elements):
        name = element.get("name")
        if not name:
            raise FileFormatError(f"{path}: {kind} number {k + 1} has no name; give it one")
        if name in names:
            raise FileFormatError(f"{path}: two {kind}s are called {shown(name)}; rename one")
        names[name] = None
    return tuple(names)


def numbers(element: Element, name: str, place: str, count: int, default: str | None = None) -> tuple[float, ...]:
    """Return the finite numbers of an attribute, and take out blanks, which Pinocchio does not read."""
    text: Any = element.get(name, default)
    try:
        words = text.split()
        found = tuple(float("_" if "_" in word else word) for word in words)  # Python alone reads 1_0 as a number
    except (ValueError, AttributeError):
        found = ()
    if len(found) != count or not all(math.isfinite(number) for number in found):
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise FileFormatError(f"{place}: <{element.tag}> has {name}={one_line(repr(text), 60)}; give {wanted}")
    if name in element.attrib:
        element.set(name, " ".join(words))
    return found


def bounded(
    element: Element, name: str, place: str, count: int, default: str | None = None, most: float = 1e9
) -> tuple[float, ...]:
    """Return the numbers of an attribute as `numbers` does, none of them larger than `most`."""
    found = numbers(element, name, place, count, default)
    if max(abs(number) for number in found) > most:
        said = one_line(repr(element.get(name)), 60)
        raise FileFormatError(f"{place}: <{element.tag}> has {name}={said}; give SI units, at most {most:g}")
    return found


def placement(element: Element, place: str, most: float) -> pin.SE3:
    """Return the ``<origin>`` of an element, at most `most` metres away; the identity without one."""
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    roll, pitch, yaw = bounded(origin, "rpy", place, 3, "0 0 0", 1e6)
    for name, angle in (("roll", roll), ("pitch", pitch), ("yaw", yaw)):
        warn_of_degrees(angle, f"{place}: the {name} of <origin>", 2.0 * math.pi)
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(bounded(origin, "xyz", place, 3, "0 0 0", most)))

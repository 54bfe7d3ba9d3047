"""Reading a URDF: all is checked in the file itself, so that an error names its place, before Pinocchio sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.errors import FileFormatError

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
Element = ElementTree.Element


class Collision(NamedTuple):
    """One collision element: on which link, where, and what.

    Attributes:
        link: name of the link.
        placement: in the link's frame.
        kind: "box", "sphere", "cylinder", "capsule" or "mesh".
        size: box: three edges; sphere: radius; cylinder and capsule: radius, length; mesh: scale along x, y, z.
        file: of a mesh.
    """

    link: str
    placement: pin.SE3
    kind: str
    size: tuple[float, ...]
    file: Path | None = None


class UrdfFile(NamedTuple):
    """A checked URDF.

    Attributes:
        path: the file.
        name: of the robot.
        text: as Pinocchio reads it.
        links: names, the root link first.
        collisions: in the order of the file.
    """

    path: Path
    name: str
    text: str
    links: tuple[str, ...]
    collisions: tuple[Collision, ...]


def read_urdf(path: Path, package_dirs: Sequence[Path] = ()) -> UrdfFile:
    """Read and check a URDF file.

    Args:
        path: the file.
        package_dirs: folders that hold the packages of ``package://<package>/...`` names, after the file's own parents.

    Raises:
        FileFormatError: one sentence with the place and the mend.
    """
    if not path.is_file():
        raise FileFormatError(f"{path}: there is no such file; give the path of a URDF, or 'human', 'avatar', 'hand'")
    try:
        text = path.read_text(encoding="utf-8")
        robot = ElementTree.fromstring(text.encode())
    except UnicodeDecodeError:
        raise FileFormatError(f"{path}: this is not a text file; give a URDF") from None
    except ElementTree.ParseError as error:
        raise FileFormatError(f"{path}: the XML is broken ({error}); mend that place") from None
    if robot.tag != "robot":
        raise FileFormatError(f"{path}: the outermost element is <{robot.tag}>, not <robot>; give a URDF")
    if "xacro" in text and (path.suffix == ".xacro" or robot.find(".//{http://www.ros.org/wiki/xacro}*") is not None):
        raise FileFormatError(
            f"{path}: this is a xacro macro file; expand it first with `xacro {path.name} > robot.urdf`"
        )
    links = _names(robot.findall("link"), "link", path)
    root = _check_joints(robot, links, path)
    collisions = tuple(
        collision for link in robot.findall("link") for collision in _collisions(link, path, tuple(package_dirs))
    )
    ordered = (root, *(name for name in links if name != root))
    return UrdfFile(path, robot.get("name", path.stem), text, ordered, collisions)


def _names(elements: list[Element], kind: str, path: Path) -> tuple[str, ...]:
    names: list[str] = []
    for k, element in enumerate(elements):
        name = element.get("name")
        if not name:
            raise FileFormatError(f"{path}: {kind} number {k + 1} has no name; give it one")
        if name in names:
            raise FileFormatError(f"{path}: two {kind}s are called {name!r}; rename one")
        names.append(name)
    if kind == "link" and not names:
        raise FileFormatError(f"{path}: there are no links in it; give a URDF of a robot")
    return tuple(names)


def _check_joints(robot: Element, links: tuple[str, ...], path: Path) -> str:
    """Check the tree of joints; return the root link."""
    joints = robot.findall("joint")
    _names(joints, "joint", path)
    parent_of: dict[str, str] = {}
    for joint in joints:
        place = f"{path}: joint {joint.get('name')!r}"
        kind = joint.get("type")
        if kind not in JOINT_TYPES:
            raise FileFormatError(f"{place} has the type {kind!r}; use one of {', '.join(JOINT_TYPES)}")
        ends = [
            element.get("link") if (element := joint.find(tag)) is not None else None for tag in ("parent", "child")
        ]
        for tag, end in zip(("parent", "child"), ends, strict=True):
            if end not in links:
                raise FileFormatError(
                    f"{place} has the {tag} link {end!r}, which is not in the file; add it or mend the name"
                )
        parent, child = str(ends[0]), str(ends[1])
        if child in parent_of:
            raise FileFormatError(f"{place}: link {child!r} already hangs on {parent_of[child]!r}; a URDF is a tree")
        parent_of[child] = parent
        _origin(joint, place)
        if kind in ("revolute", "prismatic"):
            _check_limit(joint, place)
        axis = joint.find("axis")
        if kind not in ("fixed", "floating") and axis is not None and not any(_floats(axis, "xyz", place, 3)):
            raise FileFormatError(f"{place} has a zero axis; give a direction")
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        found = (
            "no link without a parent: the joints form a loop"
            if not roots
            else f"{len(roots)} roots: {', '.join(roots[:4])}"
        )
        raise FileFormatError(f"{path}: a URDF is one tree, but there is {found}; connect it")
    for link in links:
        seen = {link}
        while link in parent_of:
            link = parent_of[link]
            if link in seen:
                raise FileFormatError(f"{path}: the joints around link {link!r} form a loop; a URDF is a tree")
            seen.add(link)
    return roots[0]


def _check_limit(joint: Element, place: str) -> None:
    limit = joint.find("limit")
    if limit is None:
        raise FileFormatError(f"{place} has no <limit>; add one, or make the joint continuous")
    low, high = (_floats(limit, name, place, 1, "0")[0] for name in ("lower", "upper"))
    if low > high:
        raise FileFormatError(f"{place} has the lower limit {low:g} above the upper {high:g}; exchange them")
    for name in ("effort", "velocity"):
        if limit.get(name) is None:
            raise FileFormatError(f'{place} has a limit without {name}; URDF demands it, add {name}="1"')


def _collisions(link: Element, path: Path, package_dirs: tuple[Path, ...]) -> list[Collision]:
    name = str(link.get("name"))
    capsules = {element.get("name") for element in link.findall("collision_checking/capsule")}
    found = []
    for collision in link.findall("collision"):
        place = f"{path}: collision of link {name!r}"
        shapes = list(collision.find("geometry") or ())
        if len(shapes) != 1:
            raise FileFormatError(f"{place} has {len(shapes)} shapes in its <geometry>; give one")
        shape = shapes[0]
        kind, file = shape.tag, None
        if kind == "box":
            size = _floats(shape, "size", place, 3)
        elif kind == "sphere":
            size = _floats(shape, "radius", place, 1)
        elif kind in ("cylinder", "capsule"):
            size = (*_floats(shape, "radius", place, 1), *_floats(shape, "length", place, 1))
            kind = "capsule" if collision.get("name") in capsules - {None} else kind
        elif kind == "mesh":
            size = _floats(shape, "scale", place, 3, "1 1 1")
            file = _mesh_file(shape.get("filename", ""), place, path, package_dirs)
        else:
            raise FileFormatError(f"{place} is a <{kind}>; use box, sphere, cylinder or mesh")
        if kind != "mesh" and min(size) <= 0.0:
            raise FileFormatError(f"{place}: the {kind} has the size {min(size):g}; give metres above zero")
        found.append(Collision(name, _origin(collision, place), kind, size, file))
    return found


def _mesh_file(name: str, place: str, path: Path, package_dirs: tuple[Path, ...]) -> Path:
    """Find a mesh: by path, by ``file://``, or by ``package://`` below `package_dirs` and the parents of the URDF."""
    if not name:
        raise FileFormatError(f"{place} has a mesh without filename; add it")
    folder = path.resolve().parent
    if name.startswith(("package://", "model://")):
        rest = name.split("://", 1)[1]
        tails = [Path(rest), Path(*Path(rest).parts[1:])]
        candidates = [base / tail for base in (*package_dirs, folder, *folder.parents) for tail in tails]
    else:
        plain = Path(name.removeprefix("file://"))
        candidates = [plain if plain.is_absolute() else folder / plain, *(base / plain for base in package_dirs)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise FileFormatError(
        f"{place}: the mesh {name!r} is not found; put it in place or name its folder in package_dirs"
    )


def _origin(element: Element, place: str) -> pin.SE3:
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    roll, pitch, yaw = _floats(origin, "rpy", place, 3, "0 0 0")
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(_floats(origin, "xyz", place, 3, "0 0 0")))


def _floats(element: Element, name: str, place: str, count: int, default: str | None = None) -> tuple[float, ...]:
    text: Any = element.get(name, default)
    try:
        numbers = tuple(float(word) for word in text.split())
    except (ValueError, AttributeError):
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise FileFormatError(f"{place}: <{element.tag}> has {name}={text!r}; give {wanted}")
    return numbers

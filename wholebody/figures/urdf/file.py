"""Reading a URDF: the file itself is checked before Pinocchio reads it, so that an error names its place."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from wholebody.base.arrays import with_values
from wholebody.base.checks import color, shown
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import is_file
from wholebody.figures.link_pieces import Color, LinkShape
from wholebody.figures.urdf.joints import UrdfJoint, read_joints
from wholebody.figures.urdf.xml_reading import bounded, numbers, placement, read_robot, unique_names
from wholebody.geometry.pieces import LARGEST


class LinkVisual(NamedTuple):
    """One visual of a link, whose file is absolute; red, green, blue, alpha of its material, None without one."""

    shape: LinkShape
    color: Color | None


class UrdfFile(NamedTuple):
    """A checked URDF."""

    path: Path  # the file
    name: str  # of the robot
    links: tuple[str, ...]  # names, the root link first
    inertials: dict[str, Element]  # link to its ``<inertial>`` element
    joints: tuple[UrdfJoint, ...]  # in the order of the file
    shapes: tuple[LinkShape, ...]  # collision shapes in the order of the file
    colors: dict[str, Color]  # link to red, green, blue, alpha of the first of its visuals that has a colour
    visuals: tuple[LinkVisual, ...]  # what the file wants drawn, without what is wholly transparent or cannot be read
    extension: Element | None  # the element "wholebody", or None
    notes: tuple[str, ...]  # one sentence for each missing part that was filled in


def read_urdf(path: Path, package_dirs: Sequence[Path] = ()) -> UrdfFile:
    """Read and check a URDF file; `find_mesh` looks in the folders."""
    robot = read_robot(path, "URDF")
    links = unique_names(robot.findall("link"), "link", path)
    if not links:
        raise FileFormatError(f"{path}: there are no links in it; give a URDF of a robot")
    joints, root, notes = read_joints(robot, links, path)
    painted, remarks = _paint(robot)
    inertials, shapes, colors, visuals = dict[str, Element](), list[LinkShape](), dict[str, Color](), list[LinkVisual]()
    for link in robot.findall("link"):
        own, inertial = str(link.get("name")), link.find("inertial")
        if inertial is not None:
            _check_inertial(inertial, f"{path}: link {shown(own)}")
            inertials[own] = inertial
        shapes += _shapes(link, path, package_dirs)
        for visual in link.findall("visual"):
            paint = painted.get(visual)
            # what is wholly transparent in the file is still a body that touches, so it keeps the usual colour
            if paint is not None and paint[3] == 0.0:
                continue
            if paint is not None:
                colors.setdefault(own, paint)
            with suppress(FileFormatError):  # the collision shapes are drawn where there is no other
                visuals.append(LinkVisual(_shape(visual, own, path, package_dirs), paint))
    ordered = (root, *(name for name in links if name != root))
    name = robot.get("name") or path.stem
    return UrdfFile(
        path, name, ordered, inertials, joints, tuple(shapes), colors, tuple(visuals), robot.find("wholebody"),
        (*notes, *remarks),
    )  # fmt: skip


def _paint(robot: Element) -> tuple[dict[Element, Color], list[str]]:
    """Colours of visuals, and one sentence on each material that has none; no robot is refused for one."""
    named: dict[str, Color] = {}
    notes = []
    own = {}
    for material in (*robot.findall("material"), *robot.findall("link/visual/material")):
        element = material.find("color")
        if element is None:
            continue
        name, text = material.get("name") or "", element.get("rgba", "")
        try:
            own[material] = color(tuple(float(part) for part in text.split()), "rgba")
        except (ValueError, InputError):
            notes.append(f"material {shown(name)}: rgba={shown(text)} is no colour, so it is left out")
            continue
        named.setdefault(name, own[material])
    painted = {}
    for visual in robot.findall("link/visual"):
        asked = visual.find("material")
        paint = None if asked is None else own.get(asked, named.get(asked.get("name") or ""))
        if paint is not None:
            painted[visual] = paint
    return painted, notes


def _check_inertial(inertial: Element, place: str) -> None:
    """Check masses, and moments only against absurd values: many robots' moments are not quite physical."""
    mass = inertial.find("mass")
    if mass is None:
        raise FileFormatError(f"{place} has an <inertial> without <mass>; add it")
    if bounded(mass, "value", place, 1)[0] < 0.0:
        raise FileFormatError(f"{place} has the mass {mass.get('value')}; give kilograms, not less than zero")
    inertia = inertial.find("inertia")
    if inertia is None:
        raise FileFormatError(f"{place} has an <inertial> without <inertia>; add it")
    for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        bounded(inertia, name, place, 1)
    placement(inertial, place, LARGEST)


def _shapes(link: Element, path: Path, package_dirs: Sequence[Path]) -> Iterator[LinkShape]:
    capsules = {element.get("name") for element in link.findall("collision_checking/capsule")} - {None}
    for collision in link.findall("collision"):
        shape = _shape(collision, str(link.get("name")), path, package_dirs)
        capsule = collision.get("name") in capsules and len(shape.size) == 2
        yield with_values(shape, kind="capsule") if capsule else shape


def _shape(element: Element, link: str, path: Path, package_dirs: Sequence[Path]) -> LinkShape:
    place = f"{path}: {element.tag} of link {shown(link)}"
    shapes = element.findall("geometry/*")
    if len(shapes) != 1:
        raise FileFormatError(f"{place} has {len(shapes)} shapes in its <geometry>; give one")
    shape = shapes[0]
    kind, file = shape.tag, None
    if kind == "box":
        size = numbers(shape, "size", place, 3)
    elif kind == "sphere":
        size = numbers(shape, "radius", place, 1)
    elif kind in ("cylinder", "capsule"):
        size = (*numbers(shape, "radius", place, 1), *numbers(shape, "length", place, 1))
    elif kind == "mesh":
        size = bounded(shape, "scale", place, 3, "1 1 1")
        file = find_mesh(shape.get("filename", ""), place, path, package_dirs)
        if not all(size):
            raise FileFormatError(f"{place}: the mesh has the scale {shown(shape.get('scale'))}; give no zeros")
    else:
        raise FileFormatError(f"{place} is a <{kind}>; use box, sphere, cylinder or mesh")
    if kind != "mesh" and min(size) < 0.0:
        raise FileFormatError(f"{place}: the {kind} has the size {min(size):g}; give metres above zero")
    if kind != "mesh" and max(size) > LARGEST:
        raise FileFormatError(f"{place}: the {kind} has the size {max(size):g}; give metres, at most {LARGEST:g}")
    return LinkShape(link, placement(element, place, LARGEST), kind, size, file, name=element.get("name", ""))


def find_mesh(name: str, place: str, path: Path, package_dirs: Sequence[Path]) -> Path:
    """Find a mesh beside the file, in `package_dirs`, or by ``package://`` in folders of ROS; else FileFormatError."""
    # A name not found is tried with slashes for backslashes and ``%20`` decoded. A folder may hold packages or be one.
    if not name.strip():
        raise FileFormatError(f"{place} has a mesh without filename; add it")
    for tried in dict.fromkeys((name, unquote(name), unquote(name).replace("\\", "/"))):
        found = _found(tried, place, path, package_dirs)
        if found is not None:
            return found
    raise FileFormatError(
        f"{place}: the mesh {shown(name)} is not found; put it in place, or name the folder of its package in "
        "package_dirs or ROS_PACKAGE_PATH"
    )


def _found(name: str, place: str, path: Path, package_dirs: Sequence[Path]) -> Path | None:
    folder = Path(os.path.abspath(path)).parent
    if name.startswith(("package://", "model://")):
        parts = [part for part in name.split("://", 1)[1].split("/") if part not in ("", ".")]
        if not parts or ".." in parts[:1]:
            raise FileFormatError(f"{place}: the mesh {shown(name)} names no package; write package://<package>/<path>")
        bases = [*package_dirs, folder, *folder.parents, *_ros_folders()]
        candidates = [base.joinpath(*tail) for base in bases for tail in (parts, parts[1:]) if tail]
    else:
        plain = Path(name.removeprefix("file://"))
        candidates = [plain if plain.is_absolute() else folder / plain, *(base / plain for base in package_dirs)]
    return next(filter(is_file, candidates), None)


def _ros_folders() -> list[Path]:
    given = (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"))
    listed = ((os.environ.get(variable, "").split(os.pathsep), below) for variable, below in given)
    return [Path(entry) / below for entries, below in listed for entry in entries if entry]

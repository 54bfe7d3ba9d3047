"""A figure from an MJCF file (MuJoCo), as far as Pinocchio reads it: bodies, joints, and collision geoms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown, warn_of_degrees
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import Scratch, write
from wholebody.figures.degrees import SLIDING
from wholebody.figures.description import ROOT_JOINT
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Concavity, LinkShape, check_concavity
from wholebody.figures.robot_figure import check_size, geometry_of_links, robot_figure
from wholebody.figures.urdf.figure import SAMPLES, urdf_figure
from wholebody.figures.urdf.xml_reading import read_xml

_PLACED = {"pos", "quat", "euler", "axisangle", "xyaxes", "zaxis"}
"""Attributes for the placement of a body; Pinocchio ignores them for a first body that is fixed."""
WORLD = "universe"
"""Pinocchio's frame of the world, whose geoms it reads from 4.0 on."""


def xml_figure(
    path: str | PathLike[str],
    root: str | None = None,
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: Concavity = None,
    samples: int = SAMPLES,
    seed: int = 0,
) -> Figure:
    """Return the figure of an ``.xml`` file: an MJCF if its outermost element is ``<mujoco>``, otherwise a URDF.

    Args:
        path: the file.
        root: "fixed" to the world, or "free"; if left out, as in the file.
        package_dirs: as for `urdf_figure`; an MJCF has no packages.
        concavity: as for `urdf_figure`.
        samples: as for `urdf_figure`.
        seed: as for `urdf_figure`.

    Raises:
        FileFormatError: a file that cannot be read, with the place and the correction.
        InputError: another root, a concavity out of range, or too many joints for the memory.
        UnknownNameError: `concavity` names an unknown link.
    """
    place = Path(path)
    outermost = read_xml(place, "URDF or MJCF")
    if outermost.tag != "mujoco":
        return urdf_figure(path, root, package_dirs, concavity, samples, seed)
    if root not in (None, "fixed", "free"):
        raise InputError(f"root is {shown(root)}; give 'fixed' or 'free'")
    with _readable(place, outermost) as file:
        model, meshes = _read(place, file, root)
    check_size(model, place)
    links = tuple(frame.name for frame in model.frames if frame.type == pin.FrameType.BODY)
    if not links:
        raise FileFormatError(f"{place}: there are no bodies in it; give an MJCF of a robot")
    pieces = [piece for piece in meshes.geometryObjects if model.frames[piece.parentFrame].name != WORLD]
    shapes = [_shape(model, piece, place) for piece in pieces]
    geometry, notes = geometry_of_links(model, shapes, check_concavity(concavity, links), place)
    name = outermost.get("model") or place.stem
    return robot_figure(name, model, links, geometry, (*_unread(outermost), *notes), samples, seed)


@contextmanager
def _readable(path: Path, outermost: Element) -> Iterator[Path]:
    """The file that Pinocchio reads: the given one, or a copy without textures if one of them has no file.

    Of each texture without a file Pinocchio prints a line on standard output. Collision geometry has no textures. The
    copy finds its meshes where the file does.
    """
    textures = [(asset, one) for asset in outermost.iter("asset") for one in asset.findall("texture")]
    if all(texture.get("file") is not None for _, texture in textures):
        yield path
        return
    for asset, texture in textures:
        asset.remove(texture)
    for material in outermost.iter("material"):
        material.attrib.pop("texture", None)
    compiler = outermost.find("compiler")  # Pinocchio reads the first
    if compiler is None:
        compiler = Element("compiler")
        outermost.insert(0, compiler)
    for name in {"meshdir", "assetdir"} & set(compiler.attrib) or {"meshdir"}:
        compiler.set(name, str(path.absolute().parent / compiler.get(name, "")))
    with Scratch() as folder:
        yield write(folder / path.name, ElementTree.tostring(outermost))


def _read(path: Path, file: Path, root: str | None) -> tuple[pin.Model, pin.GeometryModel]:
    """What Pinocchio reads of a file, or of its copy; messages name the file."""
    base = [pin.JointModelFreeFlyer(), ROOT_JOINT] if root == "free" else []
    try:
        built = pin.buildModelFromMJCF(str(file), *base)
        model = built[0] if isinstance(built, tuple) else built  # a tuple with its constraints, if the root has a name
        meshes = pin.buildGeomFromMJCF(model, str(file), pin.COLLISION)
    except Exception as error:  # boost's and Pinocchio's own, of several kinds
        reason = " ".join(str(error).split()).rpartition("message: ")[2].replace(str(file), str(path))
        raise FileFormatError(f"{path}: Pinocchio cannot read it ({reason}); convert it to URDF") from None
    first = model.joints[1] if model.njoints > 1 else None
    if first is not None and first.nq == 7:
        if root == "fixed":
            raise InputError(f"{path}: root is 'fixed', but its first body has a free joint; give root='free'")
        model.names[1] = ROOT_JOINT
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.shortname() == "JointModelComposite":
            raise FileFormatError(
                f"{path}: the body of joint {shown(name)} has several joints; give each of them a body of its own"
            )
    limits = [np.array(limit) for limit in (model.lowerPositionLimit, model.upperPositionLimit)]
    for joint in list(model.joints)[1:]:
        if joint.nq != 1 or joint.nv != 1:
            continue
        place, ends = f"{path}: joint {shown(model.names[joint.id])}", [limit[joint.idx_q] for limit in limits]
        if ends[0] > ends[1]:
            raise FileFormatError(f"{place} has a lower limit above the upper; correct it")
        for end, value in zip(("lower", "upper"), ends, strict=True):
            if not joint.shortname().startswith(SLIDING):
                warn_of_degrees(value, f"{place}: the {end} limit")
    model.lowerPositionLimit, model.upperPositionLimit = limits[0] + 0.0, limits[1] + 0.0  # no negative zeros
    return model, meshes


def _shape(model: pin.Model, piece: pin.GeometryObject, path: Path) -> LinkShape:
    frame = model.frames[piece.parentFrame]
    solid: Any = piece.geometry
    kind, at = type(solid).__name__, frame.placement.actInv(piece.placement)
    if kind == "Box":
        return LinkShape(frame.name, at, "box", tuple(2.0 * np.asarray(solid.halfSide)))
    if kind == "Sphere":
        return LinkShape(frame.name, at, "sphere", (solid.radius,))
    if kind in ("Capsule", "Cylinder"):
        return LinkShape(frame.name, at, kind.lower(), (solid.radius, 2.0 * solid.halfLength))
    if kind == "Ellipsoid":
        return LinkShape(frame.name, at, "ellipsoid", tuple(np.asarray(solid.radii)))
    if kind.startswith("BVHModel"):
        faces = [solid.tri_indices(k) for k in range(solid.num_tris)]
        return _triangles(frame.name, at, np.array(solid.vertices()), faces)
    if kind.startswith("Convex"):
        faces = [solid.polygons(k) for k in range(solid.num_polygons)]
        return _triangles(frame.name, at, np.array(solid.points()), faces)
    raise FileFormatError(
        f"{path}: a geom of body {shown(frame.name)} is a {kind}; use boxes, capsules, meshes and the like"
    )


def _triangles(link: str, at: pin.SE3, vertices: Array, faces: list[Any]) -> LinkShape:
    triangles = np.array([[face[0], face[1], face[2]] for face in faces], dtype=np.int64).reshape(-1, 3)
    return LinkShape(link, at, "triangles", (), triangles=(vertices.reshape(-1, 3), triangles))


def _unread(outermost: Element) -> list[str]:
    """Sentences on the parts of the file that are ignored."""
    notes = []
    if outermost.find("worldbody/geom") is not None:
        notes.append("the geoms of the world are not read; add them to the scene")
    first = outermost.find("worldbody/body")
    if first is not None and first.find("freejoint") is None and set(first.attrib) & _PLACED:
        notes.append(f"body {shown(first.get('name'))}: its place in the world is not kept, it stands at the origin")
    equality = outermost.find("equality")
    if equality is not None and len(equality):
        notes.append(f"the {len(equality)} constraints in <equality> are not kept: the joints move by themselves")
    return notes

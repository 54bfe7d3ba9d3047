"""A figure from any URDF: its own collision geometry as convex pieces, and the pairs that can touch, by sampling."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.errors import FileFormatError, InputError, WholebodyError
from wholebody.figures.description import Chain, Description
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import choose_pairs
from wholebody.figures.urdf_file import Collision, UrdfFile, read_urdf

Array = NDArray[np.float64]

CYLINDER_SIDES = 32
"""A cylinder becomes a prism around it with this many sides; its corners stand out by 0.5 % of the radius."""

CONCAVITY = 0.2
"""Concavity left in the pieces of a link's mesh, as a share of its size (see `convex_pieces`). Coarser than for
things in a scene: at the 0.05 used there an industrial arm became 173 pieces in 90 s, at 0.2 it has 23 in 4 s."""

COLOR = (0.62, 0.66, 0.70, 1.0)


def urdf_figure(
    path: str | PathLike[str],
    root: str = "fixed",
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: float = CONCAVITY,
    samples: int = 400,
    seed: int = 0,
) -> Figure:
    """Return the figure of a URDF file.

    Args:
        path: the file.
        root: "fixed" to the world, or "free".
        package_dirs: folders in which ``package://`` names are looked up, beside the file's own parents.
        concavity: left in the convex pieces of meshes, 0.01 (close) to 1 (hulls), as a share of a mesh's size.
        samples: random postures by which always-overlapping pairs are found.
        seed: of those postures.

    Raises:
        FileFormatError: a file that cannot be read, with the place and the mend.
        InputError: another root.
    """
    if root not in ("fixed", "free"):
        raise InputError(f"root is {root!r}; give 'fixed' or 'free'")
    folders = [package_dirs] if isinstance(package_dirs, (str, PathLike)) else package_dirs
    urdf = read_urdf(Path(path), [Path(folder) for folder in folders])
    try:
        base = [pin.JointModelFreeFlyer()] if root == "free" else []
        model = pin.buildModelFromXML(urdf.text, *base)
    except Exception as error:  # what passed our checks and still fails in urdfdom
        raise FileFormatError(f"{urdf.path}: Pinocchio cannot read it ({error}); mend the file") from error
    geometry, notes = _geometry(model, urdf, concavity)
    excluded = choose_pairs(model, geometry, samples, seed)
    carrying = {collision.link for collision in urdf.collisions}
    segments = tuple(name for name in urdf.links if name in carrying) or urdf.links
    joints = tuple(name for name in list(model.names)[1:] if name != "root_joint")
    description = Description(
        groups={"all": joints},
        chains=_chains(model, urdf),
        frames=urdf.links,
        segments=segments,
        postures={"neutral": _neutral},
        excluded=excluded,
        notes=notes,
    )
    return Figure(urdf.name, model, geometry, "own", description)


def _neutral(figure: Figure) -> Array:
    """Zero, or where zero is outside the limits, the nearest value."""
    return figure.clamp(pin.neutral(figure.model))


def _chains(model: pin.Model, urdf: UrdfFile) -> dict[str, Chain]:
    """One chain from the root to each link after which no joint follows; named after that link."""
    inner = {model.parents[joint] for joint in range(1, model.njoints)}
    chains = {}
    for link in urdf.links:
        joint = model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint
        if joint in inner or joint == 0:
            continue
        names = [model.names[k] for k in model.supports[joint] if k > 0 and model.names[k] != "root_joint"]
        chains[link] = Chain(tuple(names), link)
    return chains


def _geometry(model: pin.Model, urdf: UrdfFile, concavity: float) -> tuple[pin.GeometryModel, tuple[str, ...]]:
    geometry, notes = pin.GeometryModel(), []
    count: dict[str, int] = {}
    for collision in urdf.collisions:
        try:
            pieces, remarks = _pieces(collision, concavity)
        except WholebodyError as error:
            raise FileFormatError(f"{urdf.path}: collision of link {collision.link!r}: {error}") from error
        notes += [f"link {collision.link!r}: {remark}" for remark in remarks]
        frame_id = model.getFrameId(collision.link, pin.FrameType.BODY)
        frame = model.frames[frame_id]
        for shape, placement in pieces:
            k = count[collision.link] = count.get(collision.link, -1) + 1
            piece = pin.GeometryObject(
                f"{collision.link}:{k}",
                frame.parentJoint,
                frame_id,
                frame.placement * collision.placement * placement,
                shape,
            )
            piece.meshColor[:] = COLOR
            geometry.addGeometryObject(piece)
    return geometry, tuple(notes)


def _pieces(collision: Collision, concavity: float) -> tuple[list[tuple[Any, pin.SE3]], tuple[str, ...]]:
    """Convex pieces of one collision element, in its frame, and what was changed about them."""
    from wholebody.geometry.convex import convex_pieces, hull_piece
    from wholebody.geometry.meshes import read_mesh

    size, here = collision.size, pin.SE3.Identity()
    if collision.kind == "box":
        return [(coal.Box(*size), here)], ()
    if collision.kind == "sphere":
        return [(coal.Sphere(size[0]), here)], ()
    if collision.kind == "capsule":
        return [(coal.Capsule(size[0], size[1]), here)], ()
    if collision.kind == "cylinder":
        piece = hull_piece(_prism(*size), "cylinder")
        return [(piece.geometry, piece.placement)], ()
    assert collision.file is not None
    vertices, faces = read_mesh(collision.file)
    scale = np.array(size)
    if np.prod(scale) < 0.0:
        faces = faces[:, ::-1]
    name = f"mesh {collision.file.name}"
    split = convex_pieces(vertices * scale, faces, threshold=concavity, what=name)
    notes = split.notes
    if split.added_volume > 0.01:
        notes += (f"{name}: its convex pieces ({len(split.pieces)}) have {split.added_volume:.0%} more volume",)
    return [(piece.geometry, piece.placement) for piece in split.pieces], notes


def _prism(radius: float, length: float) -> Array:
    """Corners of the prism around a cylinder along z, shape (2 sides, 3)."""
    turn = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    outside = radius / np.cos(np.pi / CYLINDER_SIDES)
    ring = np.column_stack([outside * np.cos(turn), outside * np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(CYLINDER_SIDES, z)]) for z in (-0.5 * length, 0.5 * length)])

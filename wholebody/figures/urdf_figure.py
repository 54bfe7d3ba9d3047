"""A figure from any URDF: its own collision geometry as convex pieces, and the pairs that can touch, by sampling."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.errors import FileFormatError, InputError, WholebodyError
from wholebody.figures.description import Chain, Description
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Concavity, LinkShape, check_concavity, link_pieces
from wholebody.figures.self_pairs import choose_pairs
from wholebody.figures.urdf_file import UrdfFile, read_urdf
from wholebody.figures.urdf_model import urdf_model
from wholebody.geometry.large_models import geometry_model

Array = NDArray[np.float64]

COLOR = (0.62, 0.66, 0.70, 1.0)


def urdf_figure(
    path: str | PathLike[str],
    root: str = "fixed",
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: Concavity = None,
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
    model, remarks = urdf_model(urdf, root)
    geometry, notes = geometry_of_links(model, urdf.shapes, check_concavity(concavity, urdf.links), urdf.path)
    excluded = choose_pairs(model, geometry, samples, seed)
    carrying = {shape.link for shape in urdf.shapes}
    segments = tuple(name for name in urdf.links if name in carrying) or urdf.links
    joints = tuple(name for name in list(model.names)[1:] if name != "root_joint")
    description = Description(
        groups={"all": joints},
        chains=_chains(model, urdf),
        frames=urdf.links,
        segments=segments,
        postures={"neutral": _neutral},
        excluded=excluded,
        notes=(*urdf.notes, *remarks, *notes),
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


def geometry_of_links(
    model: pin.Model, shapes: Iterable[LinkShape], concavity: Concavity, path: Path
) -> tuple[pin.GeometryModel, tuple[str, ...]]:
    """Return the convex pieces of links, and one sentence on each thing that was changed about them.

    Raises:
        FileFormatError: a mesh that cannot be read, with the link.
    """
    made, notes = [], []
    count: dict[str, int] = {}
    for shape in shapes:
        try:
            pieces, remarks = link_pieces(shape, concavity)
        except WholebodyError as error:
            raise FileFormatError(f"{path}: collision of link {shape.link!r}: {error}") from error
        notes += [f"link {shape.link!r}: {remark}" for remark in remarks]
        frame_id = model.getFrameId(shape.link, pin.FrameType.BODY)
        frame = model.frames[frame_id]
        for solid, placement in pieces:
            k = count[shape.link] = count.get(shape.link, -1) + 1
            piece = pin.GeometryObject(
                f"{shape.link}:{k}",
                frame.parentJoint,
                frame_id,
                frame.placement * shape.placement * placement,
                solid,
            )
            piece.meshColor[:] = COLOR
            made.append(piece)
    return geometry_model(made), tuple(notes)

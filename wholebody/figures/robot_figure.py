"""The figure of a robot from its model and collision shapes: pieces, pairs, default posture, chains."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, InputError, WholebodyError
from wholebody.figures.description import ROOT_JOINT, Chain, Description, JointCone, copied
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import MANY, Color, Concavity, LinkShape, link_pieces, thinned
from wholebody.figures.self_pairs import RestPosture, choose_pairs, drop_pairs, rest_posture
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import SMALLEST

COLOR = (0.62, 0.66, 0.70, 1.0)


class Robot(NamedTuple):
    """A robot as a file has it."""

    name: str  # of the robot
    model: pin.Model  # Pinocchio's model
    links: tuple[str, ...]  # names, the root link first
    geometry: pin.GeometryModel  # the pieces; their pairs are chosen
    notes: tuple[str, ...] = ()  # sentences on what was changed or left out
    visual: pin.GeometryModel | None = None  # what is drawn; the pieces if None
    frames: tuple[str, ...] = ()  # names of more frames for goals
    postures: Mapping[str, Array] = MappingProxyType({})  # named postures of the file, (nq,)
    cones: Mapping[str, JointCone] = MappingProxyType({})  # limits of ball joints
    groups: Mapping[str, tuple[str, ...]] = MappingProxyType({})  # named groups of joints; "all" is added
    # why two pieces, by their numbers, are never tested by the file; None where it does not say
    untested: Callable[[int, int], str | None] | None = None
    place: pin.SE3 | None = None  # of a free root in the first posture


def robot_figure(robot: Robot, samples: int) -> Figure:
    """Return the figure of a robot; its pairs are chosen by a number of random postures."""
    model, geometry, links = robot.model, robot.geometry, robot.links
    excluded = choose_pairs(model, geometry, samples)
    if robot.untested is not None:
        reasons = [robot.untested(pair.first, pair.second) for pair in geometry.collisionPairs]
        gone = drop_pairs(geometry, [k for k, why in enumerate(reasons) if why], "")
        named = [with_values(pair, reason=why) for pair, why in zip(gone, filter(None, reasons), strict=True)]
        excluded += tuple(sorted(named, key=lambda pair: pair.reason))
    rest = rest_posture(model, geometry)
    if robot.place is not None:
        rest.q[:7] = rest.zero[:7] = pin.SE3ToXYZQUAT(robot.place)
    carrying = {model.frames[piece.parentFrame].name for piece in geometry.geometryObjects}
    postures = {"neutral": partial(copied, q=rest.q)}
    if np.abs(rest.q - rest.zero).max(initial=0.0) > 1e-12:
        postures["zero"] = partial(copied, q=rest.zero)
    called = {name: f"{name} of the file" if name in postures else name for name in robot.postures}
    postures |= {called[name]: partial(copied, q=q) for name, q in robot.postures.items()}
    renamed = [f"posture {name!r} of the file is called {now!r}" for name, now in called.items() if now != name]
    description = Description(
        groups={**robot.groups, "all": tuple(name for name in list(model.names)[1:] if name != ROOT_JOINT)},
        chains=link_chains(model, links),
        frames=(*links, *robot.frames),
        segments=tuple(link for link in links if link in carrying) or links,
        postures=postures,
        cones=robot.cones,
        excluded=(*excluded, *rest.excluded),
        notes=(*robot.notes, *renamed, *_notes_on(rest)),
    )
    return Figure(robot.name, model, geometry, "own", description, robot.visual)


def _notes_on(rest: RestPosture) -> list[str]:
    notes = []
    if rest.parted:
        shown = ", ".join(f"{a} and {b}" for a, b in rest.parted[:3])
        more = f" and {len(rest.parted) - 3} more pairs" if len(rest.parted) > 3 else ""
        notes.append(f"posture 'neutral': moved away from zero, where {shown}{more} overlap")
    notes += [f"pair {pair.a} and {pair.b}: not tested, {pair.reason}" for pair in rest.excluded]
    return notes


def check_size(model: pin.Model, path: Path) -> None:
    """Refuse by an `InputError` a model that needs more memory than this machine has."""
    # Pinocchio's data has four tables of the cube of the degrees of freedom: 108 GB for 1,500.
    needed = 4 * 4 * 8 * model.nv**3  # a scene with one problem has four of Pinocchio's data objects
    try:
        memory = float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return  # the system does not report it
    if needed > memory:
        raise InputError(
            f"{path}: {model.nv} degrees of freedom need {needed / 1e9:.0f} GB, since Pinocchio keeps tables of their "
            f"cube, and this machine has {memory / 1e9:.0f} GB; make joints fixed that need not move"
        )


def link_chains(model: pin.Model, links: Iterable[str]) -> dict[str, Chain]:
    """One chain from the root to each link after which no joint follows; named after that link."""
    inner = {model.parents[joint] for joint in range(1, model.njoints)}
    chains = {}
    for link in links:
        joint = model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint
        if joint in inner or joint == 0:
            continue
        names = [model.names[k] for k in model.supports[joint] if k > 0 and model.names[k] != ROOT_JOINT]
        chains[link] = Chain(tuple(names), link)
    return chains


def visual_of_links(
    model: pin.Model, visuals: Iterable[tuple[int, LinkShape, Color | None]]
) -> pin.GeometryModel | None:
    """Return what is drawn of links, named by link and number; mesh files are read when they are drawn."""
    made = []
    for number, shape, color in visuals:
        frame_id = model.getFrameId(shape.link, pin.FrameType.BODY)
        frame = model.frames[frame_id]
        solid, file, scale = coal.Sphere(SMALLEST), "", np.ones(3)
        if shape.file is not None:
            file, scale = str(shape.file), np.array(shape.size)
        elif shape.triangles is not None:
            solid = _mesh(*(shape.triangles if len(shape.triangles[1]) <= MANY else thinned(*shape.triangles)))
        else:
            solid = getattr(coal, shape.kind.capitalize())(*(max(length, SMALLEST) for length in shape.size))
        paint = np.array(COLOR if color is None else color)
        made.append(
            pin.GeometryObject(
                f"{shape.link}:visual {number}", frame.parentJoint, frame_id, frame.placement * shape.placement,
                solid, file, scale, color is not None, paint,
            )
        )  # fmt: skip
    return geometry_model(made) if made else None


def _mesh(vertices: Array, faces: NDArray[np.int64]) -> Any:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(np.asarray(vertices, dtype=float))
    mesh.addTriangles(np.asarray(faces, dtype=np.uint32))
    mesh.endModel()
    return mesh


def geometry_of_links(
    model: pin.Model,
    shapes: Iterable[LinkShape],
    concavity: Concavity,
    path: Path,
    named: bool = False,
    colors: Mapping[str, Color] = MappingProxyType({}),
) -> tuple[pin.GeometryModel, tuple[str, ...], tuple[int, ...]]:
    """Return the convex pieces of links, sentences on changes, and the number of the shape of each piece."""
    made, notes, numbers = [], [], []
    count: dict[str, int] = {}
    for number, shape in enumerate(shapes):
        try:
            pieces, remarks = link_pieces(shape, concavity)
        except WholebodyError as error:
            raise FileFormatError(f"{path}: collision of link {shown(shape.link)}: {error}") from error
        notes += [f"link {shown(shape.link)}: {remark}" for remark in remarks]
        frame_id = model.getFrameId(shape.link, pin.FrameType.BODY)
        frame = model.frames[frame_id]
        for solid, placement in pieces:
            k = count[shape.link] = count.get(shape.link, -1) + 1
            piece = pin.GeometryObject(
                shape.name if named and shape.name and len(pieces) == 1 else f"{shape.link}:{k}",
                frame.parentJoint,
                frame_id,
                frame.placement * shape.placement * placement,
                solid,
            )
            piece.meshColor[:] = colors.get(shape.link, COLOR)
            piece.overrideMaterial = shape.link in colors  # Pinocchio's sign that a viewer shall use this colour
            made.append(piece)
            numbers.append(number)
    return geometry_model(made), tuple(notes), tuple(numbers)

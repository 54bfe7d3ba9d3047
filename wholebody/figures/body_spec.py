"""A body as plain data, its URDF text, and Pinocchio's model and geometry of it.

The builders (human, avatar, hand) write a `BodySpec`. Pinocchio reads the same URDF text that is packaged, so the
figure in memory and the file on disk cannot differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.figures.anthropometry import Person
from wholebody.geometry.flesh import mark_flesh
from wholebody.geometry.hull import hull_piece
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import CORNERS


class Solid(NamedTuple):
    """One convex piece on a segment."""

    name: str  # unique in the figure: "<segment>" or "<segment>:<k>"
    segment: str  # name of the segment that carries it
    geometry: Any  # coal's Sphere, Capsule, Box or Convex
    placement: pin.SE3  # of the geometry in the segment's frame
    # for a Convex, the file (relative to the URDF) and the scale along x, y, z that give its vertices
    mesh: tuple[str, tuple[float, float, float]] | None = None
    flesh: bool = False  # whether it spreads out of the piece before it where the limb is bent


class Link(NamedTuple):
    """A segment, or a massless link between two joints of one ball joint (mass 0)."""

    name: str
    mass: float = 0.0
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Joint(NamedTuple):
    """A revolute joint, or a fixed one if `axis` is None; `origin` is the child's placement in the parent link."""

    name: str
    parent: str
    child: str
    origin: pin.SE3
    axis: tuple[float, float, float] | None
    lower: float = 0.0
    upper: float = 0.0


class Landmark(NamedTuple):
    """A frame for goals, fixed on a segment."""

    name: str
    segment: str
    placement: pin.SE3


@dataclass(frozen=True)
class BodySpec:
    """The content of a body's URDF."""

    name: str  # name of the robot in the URDF
    title: str  # one line for the head of the file
    links: tuple[Link, ...]  # the root link first
    joints: tuple[Joint, ...]  # in the order of the links they end in
    landmarks: tuple[Landmark, ...]  # frames for goals
    solids: tuple[Solid, ...]  # collision pieces
    person: Person | None = None  # whose body it is


def place(x: float = 0.0, y: float = 0.0, z: float = 0.0, rotation: Array | None = None) -> pin.SE3:
    """Return a placement from a point and, if not the identity, a rotation matrix."""
    return pin.SE3(np.eye(3) if rotation is None else rotation, np.array([x, y, z], dtype=float))


VIRTUAL_MASS = 1e-6
"""Kilograms of a link between two joints of a ball joint: simulators refuse moving links without mass. It is taken from
the next link outwards, so that the total is right."""


def urdf_text(spec: BodySpec, extension: str = "") -> str:
    """Return the URDF of a body: metres, radians (degrees in comments); cylinders tagged as capsules for Pinocchio."""
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- {spec.title} -->",
        f'<robot name="{spec.name}">',
    ]
    for link in _with_virtual_masses(spec):
        lines += _link(link, [solid for solid in spec.solids if solid.segment == link.name])
    for joint in spec.joints:
        lines += _joint(joint)
    for mark in spec.landmarks:
        lines.append(f'  <link name="{mark.name}"/>')
        lines += _joint(Joint(f"{mark.name}_mount", mark.segment, mark.name, mark.placement, None))
    return "\n".join(lines) + "\n" + extension + "</robot>\n"


def _with_virtual_masses(spec: BodySpec) -> list[Link]:
    """The links, those without mass between two joints of a ball joint with `VIRTUAL_MASS` of the next one."""
    outwards = {joint.parent: joint.child for joint in spec.joints}
    masses = {link.name: link.mass for link in spec.links}
    taken = dict.fromkeys(masses, 0.0)
    for link in spec.links:
        heavy = link.name
        while not masses[heavy]:
            heavy = outwards[heavy]
        taken[heavy] += 0.0 if link.mass else VIRTUAL_MASS
    return [
        # a moment of inertia about any axis, kg m^2
        with_values(link, mass=link.mass - taken[link.name])
        if link.mass
        else with_values(link, mass=VIRTUAL_MASS, inertia=(1e-9,) * 3)
        for link in spec.links
    ]


def _link(link: Link, solids: Sequence[Solid]) -> list[str]:
    ixx, iyy, izz = link.inertia
    lines = [
        f'  <link name="{link.name}">',
        "    <inertial>",
        f'      <origin xyz="{digits(link.center)}"/>',
        f'      <mass value="{_digit(link.mass)}"/>',
        f'      <inertia ixx="{_digit(ixx)}" ixy="0" ixz="0" iyy="{_digit(iyy)}" iyz="0" izz="{_digit(izz)}"/>',
        "    </inertial>",
    ]
    for tag in ("visual", "collision"):
        for solid in solids:
            lines += [
                f'    <{tag} name="{solid.name}">',
                f"      {_origin(solid.placement)}",
                f"      <geometry>{_geometry(solid)}</geometry>",
                f"    </{tag}>",
            ]
    capsules = [solid.name for solid in solids if type(solid.geometry).__name__ == "Capsule"]
    if capsules:
        lines.append("    <collision_checking>")
        lines += [f'      <capsule name="{name}"/>' for name in capsules]
        lines.append("    </collision_checking>")
    lines.append("  </link>")
    return lines


def _joint(joint: Joint) -> list[str]:
    kind = "fixed" if joint.axis is None else "revolute"
    lines = [
        f'  <joint name="{joint.name}" type="{kind}">',
        f'    <parent link="{joint.parent}"/>',
        f'    <child link="{joint.child}"/>',
        f"    {_origin(joint.origin)}",
    ]
    if joint.axis is not None:
        # URDF demands an effort and a velocity; nothing here uses them.
        lines += [
            f'    <axis xyz="{digits(joint.axis)}"/>',
            f'    <limit lower="{_digit(joint.lower)}" upper="{_digit(joint.upper)}" effort="1000" velocity="10"/>'
            f" <!-- {math.degrees(joint.lower):.4g} to {math.degrees(joint.upper):.4g} degrees -->",
        ]
    lines.append("  </joint>")
    return lines


def _geometry(solid: Solid) -> str:
    shape, kind = solid.geometry, type(solid.geometry).__name__
    if solid.mesh is not None:
        file, scale = solid.mesh
        return f'<mesh filename="{file}" scale="{digits(scale)}"/>'
    if kind == "Capsule":
        return f'<cylinder radius="{_digit(shape.radius)}" length="{_digit(2.0 * shape.halfLength)}"/>'
    return f'<box size="{digits(2.0 * np.array(shape.halfSide))}"/>'


def _origin(placement: pin.SE3) -> str:
    angles = pin.rpy.matrixToRpy(placement.rotation)
    text = f'<origin xyz="{digits(placement.translation)}"'
    return text + (f' rpy="{digits(angles)}"/>' if np.abs(angles).max() > 1e-12 else "/>")


def digits(values: Iterable[float] | Array) -> str:
    """Numbers as the files of figures have them: twelve digits, which are the same on different processors."""
    return " ".join(map(_digit, values))


def _digit(value: float) -> str:
    return f"{float(value):.12g}" if abs(value) > 1e-12 else "0"


def model_of(spec: BodySpec) -> pin.Model:
    """Return Pinocchio's model of a spec, with a free root, read from its URDF text (without the pieces)."""
    model = pin.buildModelFromXML(urdf_text(replace(spec, solids=())), pin.JointModelFreeFlyer())
    model.name = spec.name
    return model


def geometry_of(model: pin.Model, solids: tuple[Solid, ...], pairs: tuple[tuple[str, str], ...]) -> pin.GeometryModel:
    """Return Pinocchio's geometry: the pieces on their segments, and the pairs that can touch."""
    pieces = []
    for solid in solids:
        frame_id = model.getFrameId(solid.segment)
        frame = model.frames[frame_id]
        piece = pin.GeometryObject(
            solid.name, frame.parentJoint, frame_id, frame.placement * solid.placement, solid.geometry
        )
        piece.meshColor[:] = (0.85, 0.68, 0.55, 1.0)  # red, green, blue, opacity
        pieces.append(piece)
    index = {solid.name: number for number, solid in enumerate(solids)}
    numbers = [sorted((index[a], index[b])) for a, b in pairs]
    geometry = geometry_model(pieces, np.array(numbers, dtype=np.intp).reshape(-1, 2))
    for number, solid in enumerate(solids):
        if solid.flesh:
            mark_flesh(model, geometry, number)
    return geometry


RINGS = 5
AROUND = 10  # rings of vertices between the poles, and vertices on each: 52 vertices, 2 * 5 * 10 = 100 triangles


@lru_cache(maxsize=1)
def unit_sphere() -> Array:
    """Vertices (n, 3) on the unit sphere, mirror-symmetric in y; turned rings, so that no four lie in one plane."""
    points = [np.array([0.0, 0.0, 1.0])]
    for ring in range(1, RINGS + 1):
        polar = np.pi * ring / (RINGS + 1)
        for k in range(AROUND):
            turn = 2.0 * np.pi * (k + 0.5 * (ring % 2)) / AROUND
            points.append(np.array([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]))
    points.append(np.array([0.0, 0.0, -1.0]))
    return np.array(points)


def _convex(points: Array, what: str) -> tuple[Any, pin.SE3]:
    """The hull of points (n, 3) as coal's Convex about the centre of its bounding sphere, and that centre."""
    piece = hull_piece(points, what)
    return piece.geometry, piece.placement


@lru_cache(maxsize=256)  # of the figures that were loaded last: hulls take most of the time to load a hand
def ellipsoid(radii: tuple[float, float, float], what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron with its vertices on an ellipsoid, axes along x, y, z, centre at the origin."""
    return _convex(unit_sphere() * np.array(radii), what)


@lru_cache(maxsize=256)
def tapered(radius_start: float, radius_end: float, length: float, what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron of a tapered capsule along -z: vertices on a ball at the origin and on one at -length."""
    ball = unit_sphere()
    return _convex(np.vstack([ball * radius_start, ball * radius_end - [0.0, 0.0, length]]), what)


def box(size: tuple[float, float, float], what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron of a box about the origin: eight vertices, twelve triangles."""
    return _convex(0.5 * CORNERS * np.array(size), what)

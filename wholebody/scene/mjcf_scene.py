"""A scene from an MJCF file: its robot among the geoms of the world, static, mocap and free bodies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from os import PathLike
from typing import Any

import pinocchio as pin

from wholebody.base.checks import path as as_path
from wholebody.base.checks import some, text, warn
from wholebody.base.errors import FileFormatError
from wholebody.base.files import check_file
from wholebody.figures.link_pieces import Concavity
from wholebody.figures.mjcf.compiled import Compiled, is_mjcf, placement
from wholebody.figures.mjcf.figure import SHAPES, geom_shape, height_field, mjcf_figure
from wholebody.geometry.shapes import Box, Capsule, Compound, Cylinder, Ellipsoid, HalfSpace, Hull, Mesh, Shape, Sphere
from wholebody.scene.matter.body import Body
from wholebody.scene.scene import Scene

MOST_PRISMS = 10_000  # convex pieces of a height field: making each takes half a millisecond


def read_scene(path: str | PathLike[str], root: str | None = None, concavity: Concavity = None) -> Scene:
    """Return the scene of an MJCF file, as MuJoCo compiles it.

    The robot is what `wb.load` returns; several have the name of their body before their names. The geoms of the
    world, of static and of mocap bodies are fixed things, at most one for each geom; a body with a free joint alone is
    a thing that moves by itself, with the mass of the file spread evenly. Geoms that can touch nothing are markers and
    left out. A height field is one thing of convex prisms; one that needs too many is left out with a warning.

    Args:
        path: the file.
        root: as for `wb.load`: "fixed", "free", or the name of one of several robots, the others being left out; of
            several robots each keeps its own without it.
        concavity: as for `wb.load`.

    Raises:
        FileFormatError: a file that cannot be read, with the place and the correction.
        InputError: several robots and a root for all, or a concavity out of range.
        MissingPackageError: MuJoCo is not installed.

    Examples:
        >>> cell = wb.read_scene("cell.xml")  # doctest: +SKIP
    """
    place = as_path(path, "read_scene: path")
    check_file(place, "scene")
    if not is_mjcf(place):
        raise FileFormatError(
            f"{place}: a scene is an MJCF file, whose outermost element is <mujoco>; wb.load reads a URDF"
        )
    if root is not None:
        text(root, "read_scene: root")
    compiled = Compiled(place)
    names, model = compiled.names, compiled.model
    if root is None and len(compiled.robots) > 1:
        robots = {names["body"][top]: top for top in compiled.robots}
        scene = Scene({_figure_name(name): mjcf_figure(compiled, name, concavity) for name in robots})
        mine = [body for top in robots.values() for body in compiled.tree(top)]
        if untested := _untested_between(compiled, list(robots.values())):
            warn(f"{place}: pairs of two robots that the file does not test are tested: {some(untested)}")
    else:
        scene = Scene(mjcf_figure(compiled, root, concavity))
        mine = list(compiled.tree(compiled.robot(None if root in (None, "fixed", "free") else root)))
    left: list[str] = []
    _add_fixed(scene, compiled, 0, pin.SE3.Identity(), left)
    for top in compiled.children[0]:
        if top in mine or (top in compiled.robots and not compiled.is_free(top)):
            continue
        if not compiled.is_free(top):
            for body, at in compiled.places(top, pin.SE3.Identity() * compiled.place(top)).items():
                _add_fixed(scene, compiled, body, at, left)
            continue
        parts = _parts(compiled, top, left)
        if parts:
            shape = parts[0][0] if len(parts) == 1 else Compound(tuple(part[:2] for part in parts))
            at = compiled.place(top) * (parts[0][1] if len(parts) == 1 else pin.SE3.Identity())
            color = compiled.color(parts[0][2])
            mass = float(model.body_subtreemass[top])
            scene.add(shape, name=_free_name(scene, names["body"][top]), at=at, body=Body(mass=mass), color=color)
    if left:
        warn(f"{place}: not kept, as they need over {MOST_PRISMS} convex pieces or move: {', '.join(left)}")
    return scene


def _add_fixed(scene: Scene, compiled: Compiled, body: int, place: pin.SE3, left: list[str]) -> None:
    """Add every geom of a body that does not move as a thing."""
    geoms = [geom for geom in compiled.geoms(body) if compiled.collides(geom)]
    for geom in geoms:
        found = _shape(compiled, geom)
        if found is None:
            left.append(compiled.names["geom"][geom])
            continue
        shape, at = found
        kind, number = ("body", body) if body and len(geoms) == 1 else ("geom", geom)
        name = compiled.names[kind][number]
        scene.add(shape, name=_free_name(scene, name), at=place * at, color=compiled.color(geom))


def _parts(compiled: Compiled, top: int, left: list[str]) -> list[tuple[Shape, pin.SE3, int]]:
    """Shapes of a body and of those on it, which move as one, with their placements in its frame and their geoms."""
    found = []
    for body, place in compiled.places(top, pin.SE3.Identity()).items():
        for geom in filter(compiled.collides, compiled.geoms(body)):
            made = _shape(compiled, geom)
            if made is None or isinstance(made[0], HalfSpace):
                left.append(compiled.names["geom"][geom])
            else:
                found.append((made[0], place * made[1], geom))
    return found


def _shape(compiled: Compiled, geom: int) -> tuple[Shape, pin.SE3] | None:
    """A geom's shape, and its placement on its body; None for a height field that is too fine."""
    model, known = compiled.model, geom_shape(compiled, geom)
    at = placement(model.geom_pos[geom], model.geom_quat[geom])
    if known is not None:
        return (Mesh(known.triangles) if known.triangles else _solid(known.kind, known.size)), at
    if SHAPES[int(model.geom_type[geom])] == "hfield":
        prisms = height_field(compiled, geom)
        if len(prisms) > MOST_PRISMS:
            return None
        return Compound(tuple((Hull(prism), pin.SE3.Identity()) for prism in prisms)), at
    return HalfSpace(), at


def _solid(kind: str, size: tuple[float, ...]) -> Shape:
    shape: Any = {"sphere": Sphere, "capsule": Capsule, "cylinder": Cylinder, "ellipsoid": Ellipsoid, "box": Box}[kind]
    return shape(size) if kind in ("ellipsoid", "box") else shape(*size)  # type: ignore[no-any-return]


def _untested_between(compiled: Compiled, robots: Sequence[int]) -> list[str]:
    """Pairs of bodies of two robots that <exclude> or their contact bits keep from touching."""
    names, found = compiled.names["body"], []
    for first, second in combinations(robots, 2):
        for one, other in product(compiled.tree(first), compiled.tree(second)):
            pairs = product(*(filter(compiled.collides, compiled.geoms(body)) for body in (one, other)))
            meet = [compiled.meet(*pair) for pair in pairs]
            if meet and (frozenset((one, other)) in compiled.excluded or not all(meet)):
                found.append(f"{names[one]} and {names[other]}")
    return found


def _figure_name(body: str) -> str:
    """The name of a figure: that of its body, whose slashes would end it; "root" is that of a placement."""
    name = body.strip("/").replace("/", "-")
    return "root-2" if name == "root" else name


def _free_name(scene: Scene, name: str) -> str:
    """The name, with a number if the figure or another thing has it."""
    taken = {*scene.objects, *scene.figure.members, *scene.figure.segments, *scene.figure.frames}
    return name if name not in taken else next(f"{name}-{k}" for k in range(2, 10**6) if f"{name}-{k}" not in taken)

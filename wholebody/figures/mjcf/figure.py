"""A figure from an MJCF file, as MuJoCo compiles it; shapes of its geoms, height fields as convex prisms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from os import PathLike
from pathlib import Path

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError
from wholebody.figures.description import ROUNDED, followers_of
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Color, Concavity, LinkShape, check_concavity
from wholebody.figures.mjcf.compiled import Compiled, is_mjcf, placement
from wholebody.figures.mjcf.model import RobotBuilder, RobotModel
from wholebody.figures.robot_figure import COLOR, Robot, check_size, geometry_of_links, robot_figure, visual_of_links
from wholebody.figures.urdf.figure import SAMPLES, urdf_figure

SHAPES = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Kinds of geoms, as MuJoCo numbers them."""


def geom_shape(compiled: Compiled, geom: int) -> LinkShape | None:
    """The shape of a geom on its body; None for planes and height fields, which only the world has."""
    model = compiled.model
    link = compiled.names["body"][int(model.geom_bodyid[geom])]
    at = placement(model.geom_pos[geom], model.geom_quat[geom])
    size = [float(value) for value in model.geom_size[geom]]
    kind = SHAPES[int(model.geom_type[geom])]
    if kind in ("mesh", "sdf"):
        return LinkShape(link, at, "triangles", (), triangles=compiled.mesh(geom))
    sizes: dict[str, tuple[float, ...]] = {
        "sphere": (size[0],), "capsule": (size[0], 2.0 * size[1]), "cylinder": (size[0], 2.0 * size[1]),
        "ellipsoid": tuple(size), "box": tuple(2.0 * value for value in size),
    }  # fmt: skip
    return LinkShape(link, at, kind, sizes[kind]) if kind in sizes else None


def height_field(compiled: Compiled, geom: int) -> list[Array]:
    """Corners (n, 3) of the convex prisms of a geom's height field, in its frame, below the triangles MuJoCo tests."""
    model, field = compiled.model, int(compiled.model.geom_dataid[geom])
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, below = (float(value) for value in model.hfield_size[field])
    first = int(model.hfield_adr[field])
    heights = top * np.array(model.hfield_data[first : first + rows * columns], dtype=float).reshape(rows, columns)
    if not np.isfinite(heights).all():
        row, column = np.argwhere(~np.isfinite(heights))[0]
        raise FileFormatError(
            f"{compiled.path}: a height field has {heights[row, column]} in row {row}, column {column}; give finite "
            "heights"
        )
    x, y = np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows)
    grid = np.stack([*np.meshgrid(x, y), heights], axis=2)
    bend = heights[:-1, :-1] - heights[:-1, 1:] - heights[1:, :-1] + heights[1:, 1:]
    found, flat = [], 1e-9  # m: a cell whose four corners are nearer than this to one plane is one prism
    for row in range(rows - 1):
        slopes = np.stack([np.diff(heights[row]), heights[row + 1, :-1] - heights[row, :-1]], axis=1)
        planes = [tuple(np.round(slope, 12)) for slope in slopes]
        for column in np.flatnonzero(np.abs(bend[row]) >= flat):
            planes[column] = ("bent", int(column))
        for plane, cells in groupby(range(columns - 1), planes.__getitem__):
            run = list(cells)
            (a, b), (c, d) = grid[row : row + 2, [run[0], run[-1] + 1]]
            tops = [(a, d, c), (a, b, d)] if plane[0] == "bent" else [(a, b, c, d)]
            found += [np.concatenate([top, [(x, y, -below) for x, y, _ in top]]) for top in tops]
    return found


def xml_figure(
    path: str | PathLike[str],
    root: str | None = None,
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: Concavity = None,
    samples: int = SAMPLES,
) -> Figure:
    """The figure of an ``.xml`` file, an MJCF or a URDF; arguments as for `urdf_figure`, `root` also a robot's body."""
    place = Path(path)
    if not is_mjcf(place):
        return urdf_figure(path, root, package_dirs, concavity, samples)
    return mjcf_figure(Compiled(place), root, concavity, samples)


def mjcf_figure(
    compiled: Compiled, root: str | None = None, concavity: Concavity = None, samples: int = SAMPLES
) -> Figure:
    """Return the figure of a robot in a compiled file; arguments and errors as for `xml_figure`."""
    named = None if root in (None, "fixed", "free") else root
    top = compiled.robot(named)
    robot = RobotBuilder(compiled, top, None if named else root).build()
    check_size(robot.model, compiled.path)
    names = compiled.names
    links = tuple(names["body"][body] for body in robot.bodies)
    geoms = [geom for body in robot.bodies for geom in compiled.geoms(body) if compiled.collides(geom)]
    notes = [*compiled.notes, *robot.notes, *_left_out(compiled, robot.bodies)]
    shapes: dict[int, LinkShape] = {}
    for geom in geoms:
        if (shape := geom_shape(compiled, geom)) is not None:
            shapes[geom] = shape
            continue
        kind = SHAPES[int(compiled.model.geom_type[geom])]
        notes.append(f"geom {shown(names['geom'][geom])}: a {kind} on a body that moves is not kept")
    if not shapes:
        notes.append("no geom of the robot can touch another one, so nothing of it collides")
    geometry, piece_notes, numbers = geometry_of_links(
        robot.model, shapes.values(), check_concavity(concavity, links), compiled.path, colors=_colors(compiled, robot)
    )
    kept, postures = list(shapes), _postures(compiled, robot, notes)
    found = Robot(
        compiled.name, robot.model, links, geometry, (*notes, *piece_notes),
        visual=_visual(compiled, robot),
        frames=robot.sites,
        postures=postures,
        cones=robot.cones,
        untested=_untested(compiled, [kept[number] for number in numbers]),
        place=compiled.place(top) if compiled.is_free(top) and root != "fixed" else None,
    )  # fmt: skip
    return robot_figure(found, samples)


def _visual(compiled: Compiled, robot: RobotModel) -> pin.GeometryModel | None:
    """The geoms that are drawn, meshes as they are and not their hulls; None where these are the pieces of contacts."""
    groups = 3  # of geoms that MuJoCo's viewer shows by itself; the others are for contacts
    shapes = [
        (geom, shape, color)
        for body in robot.bodies
        for geom in compiled.geoms(body)
        if compiled.model.geom_group[geom] < groups
        and ((color := compiled.color(geom)) or COLOR)[3] > 0.0
        and (shape := geom_shape(compiled, geom)) is not None
    ]
    if not any(shape.kind == "triangles" or not compiled.collides(geom) for geom, shape, _ in shapes):
        return None
    return visual_of_links(robot.model, shapes)


def _colors(compiled: Compiled, robot: RobotModel) -> dict[str, Color]:
    found = {}
    for body in robot.bodies:
        color = next(filter(None, map(compiled.color, compiled.geoms(body))), None)
        if color is not None:
            found[compiled.names["body"][body]] = (*color[:3], color[3] if color[3] > 0.0 else 1.0)
    return found


def _postures(compiled: Compiled, robot: RobotModel, notes: list[str]) -> dict[str, Array]:
    """The configuration that joints refer to, and the keyframes; notes say where an equality moves a joint of one."""
    followers = followers_of(robot.model)
    followed = {at: name for at, index in robot.joints.items() if (name := robot.model.names[index]) in followers}
    found = {"reference": robot.posture(compiled, compiled.model.qpos0)}
    for key, name in enumerate(compiled.names["key"]):
        qpos = compiled.model.key_qpos[key]
        found[name] = q = robot.posture(compiled, qpos)
        for at, joint in followed.items():
            if not abs(qpos[compiled.model.jnt_qposadr[at]] - followers[joint].value(q)) <= ROUNDED:
                notes.append(f"keyframe {shown(name)}: the joint {shown(joint)} is where its equality puts it")
    for name in [name for name, q in found.items() if not np.isfinite(q).all()]:
        raise FileFormatError(f"{compiled.path}: keyframe {shown(name)} has values that are not finite; correct it")
    return {name: pin.normalize(robot.model, q) for name, q in found.items()}


def _untested(compiled: Compiled, geoms: Sequence[int]) -> Callable[[int, int], str | None]:
    """Why two pieces, which belong to these geoms, are never tested: contact bits or <exclude>, and no <pair>."""

    def reason(first: int, second: int) -> str | None:
        pair = geoms[first], geoms[second]
        if frozenset(pair) in compiled.pairs:
            return None
        if not compiled.meet(*pair):
            return "their contact bits do not meet"
        bodies = frozenset(int(compiled.model.geom_bodyid[geom]) for geom in pair)
        return "the file excludes them" if bodies in compiled.excluded else None

    return reason


def _left_out(compiled: Compiled, mine: Sequence[int]) -> list[str]:
    """Sentences on what of the file belongs to the world and not to the robot."""
    names, model = compiled.names["body"], compiled.model
    tops = [top for top in compiled.children[0] if top not in mine]
    robots = [names[top] for top in tops if top in compiled.robots]
    others = [top for top in tops if top not in compiled.robots]
    things = [names[top] for top in others if compiled.has_shape(top)]
    bare = [names[top] for top in others if not compiled.has_shape(top)]
    notes = []
    if len(compiled.geoms(0)):
        notes.append(
            f"{len(compiled.geoms(0))} geoms of the world are no part of the robot: wb.read_scene(path) has them"
        )
    if things:
        notes.append(f"things beside the robot ({', '.join(things)}) are no part of it: wb.read_scene(path) has them")
    if bare:
        notes.append(f"bodies without a shape beside the robot ({', '.join(bare)}) are not kept")
    if robots:
        notes.append(f"other robots of the file ({', '.join(robots)}) are not read: root='{robots[0]}' reads one")
    if model.nflex:
        notes.append(f"{model.nflex} soft bodies (flex) are not kept")
    if model.ntendon:
        notes.append(f"{model.ntendon} tendons are not kept")
    return notes

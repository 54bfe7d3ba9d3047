"""A figure from an MJCF file, as MuJoCo compiles it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Concavity, check_concavity
from wholebody.figures.mjcf.compiled import Compiled, is_mjcf
from wholebody.figures.mjcf.geoms import SHAPES, geom_shape, visual_of
from wholebody.figures.mjcf.model import RobotModel, robot_model
from wholebody.figures.robot_figure import Robot, check_size, geometry_of_links, robot_figure
from wholebody.figures.urdf.figure import SAMPLES, urdf_figure


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
    robot = robot_model(compiled, top, None if named else root)
    check_size(robot.model, compiled.path)
    names = compiled.names
    links = tuple(names["body"][body] for body in robot.bodies)
    geoms = [geom for body in robot.bodies for geom in compiled.geoms(body) if compiled.collides(geom)]
    notes = [*compiled.notes, *robot.notes, *_left_out(compiled, robot.bodies)]
    shapes = []
    kept = []
    for geom in geoms:
        shape = geom_shape(compiled, geom)
        if shape is None:
            kind = SHAPES[int(compiled.model.geom_type[geom])]
            notes.append(f"geom {shown(names['geom'][geom])}: a {kind} on a body that moves is not kept")
        else:
            shapes.append(shape)
            kept.append(geom)
    if not shapes:
        notes.append("no geom of the robot can touch another one, so nothing of it collides")
    geometry, piece_notes, numbers = geometry_of_links(
        robot.model, shapes, check_concavity(concavity, links), compiled.path, colors=_colors(compiled, robot)
    )
    found = Robot(
        compiled.name, robot.model, links, geometry, (*notes, *piece_notes),
        visual=visual_of(compiled, robot),
        frames=robot.sites,
        postures=_postures(compiled, robot),
        cones=robot.cones,
        untested=_untested(compiled, [kept[number] for number in numbers]),
        place=compiled.place(top) if compiled.is_free(top) and root != "fixed" else None,
    )  # fmt: skip
    return robot_figure(found, samples)


def _colors(compiled: Compiled, robot: RobotModel) -> dict[str, tuple[float, float, float, float]]:
    """The colour of a body's first geom that has one."""
    found = {}
    for body in robot.bodies:
        color = next(filter(None, map(compiled.color, compiled.geoms(body))), None)
        if color is not None:
            found[compiled.names["body"][body]] = (*color[:3], color[3] if color[3] > 0.0 else 1.0)
    return found


def _postures(compiled: Compiled, robot: RobotModel) -> dict[str, Array]:
    """The configuration that joints refer to, and the keyframes."""
    found = {"reference": robot.posture(compiled, compiled.model.qpos0)}
    for key, name in enumerate(compiled.names["key"]):
        found[name] = robot.posture(compiled, compiled.model.key_qpos[key])
    for name in [name for name, q in found.items() if not np.isfinite(q).all()]:
        raise FileFormatError(f"{compiled.path}: keyframe {shown(name)} has values that are not finite; correct it")
    return {name: pin.normalize(robot.model, q) for name, q in found.items()}


def _untested(compiled: Compiled, geoms: Sequence[int]) -> Callable[[int, int], str | None]:
    """Why two pieces, which belong to these geoms, are never tested: contact bits or <exclude>, and no <pair>."""
    model = compiled.model
    types, affinities = np.array(model.geom_contype[geoms]), np.array(model.geom_conaffinity[geoms])
    bodies = np.array(model.geom_bodyid[geoms])
    excluded = {frozenset((value >> 16, value & 0xFFFF)) for value in map(int, model.exclude_signature)}

    def reason(first: int, second: int) -> str | None:
        if frozenset((geoms[first], geoms[second])) in compiled.pairs:
            return None
        if not (types[first] & affinities[second]) | (types[second] & affinities[first]):
            return "their contact bits do not meet"
        pair = frozenset((int(bodies[first]), int(bodies[second])))
        return "the file excludes them" if pair in excluded else None

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

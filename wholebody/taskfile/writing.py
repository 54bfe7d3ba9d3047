"""A problem as a task file: the inverse of `read_task`, by the same tables."""

from __future__ import annotations

import json
import os
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody import tasks
from wholebody.base import files
from wholebody.base.arrays import Array
from wholebody.base.checks import instance, text
from wholebody.base.errors import InputError
from wholebody.base.files import title_of
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Mesh, Shape
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneObject
from wholebody.scene.scene import Scene
from wholebody.taskfile.kinds import Kind, Part, Several
from wholebody.taskfile.schema import CONSTRAINTS, FIGURES, GOALS, JOINT_OF_A_THING, MEASURES, SHAPES
from wholebody.tasks.frame import PlacementTerm


def write_task(problem: Problem | Scene, path: str | PathLike[str], *, title: str | None = None) -> Path:
    """Write a problem, or a scene alone, as a task file that `read_task` and `wholebody pose` read.

    What terms took from the start (where a foot is held) is written as numbers. A mesh that was given as arrays is
    written as an OBJ file beside the task.

    Args:
        problem: a problem whose figure came from `wb.load`, or a scene.
        path: of the file; its folder must exist.
        title: one line; the name of the file if left out.

    Raises:
        InputError: a figure that was not loaded or was reduced, or a term, measure or shape that task files do not
            have, or no measures but `Soft`; or the file cannot be written or does not end in .toml.

    Examples:
        >>> path = wb.taskfile.write_task(problem, folder / "copy.toml", title="A reach")
    """
    target = files.checked_target(path, "write_task: path", "a task", (".toml",))
    if isinstance(problem, Scene):
        problem = Problem(problem)
    instance(problem, Problem, "write_task: problem", "give a problem or a scene")
    if title is not None:
        text(title, "write_task: title")
    scene, beside = problem.scene, dict[Path, str]()
    top: dict[str, Any] = {"title": title or title_of(target)}
    if problem.clearance:
        top["clearance"] = problem.clearance
    if problem.touching:
        top["touching"] = [list(pair) for pair in problem.touching]
    if not problem.range_of_motion:
        top["range_of_motion"] = False
    if problem.balance is not None:
        top["balance"] = problem.balance
    parts = [_lines(top), *_figures(scene.figure, target), _table("[start]", _start(problem))]
    for thing in scene.objects.values():
        parts.append(_table("[[object]]" if thing.segment is None else "[[attach]]", _thing(thing, target, beside)))
    parts += [_table("[[goal]]", _term(term, GOALS, "goals", n)) for n, term in enumerate(problem.goals)]
    held = (*problem.stated, *problem.bounds)
    parts += [_table("[[constraint]]", _term(term, CONSTRAINTS, "constraints", n)) for n, term in enumerate(held)]
    if problem.measures_given:
        if problem.measures and all(isinstance(term, tasks.Soft) for term in problem.measures):
            raise InputError("write_task: measures are all Soft, and a file would have the usual ones too; add another")
        parts += [_measure(term, n) for n, term in enumerate(problem.measures)]
    for file, written in beside.items():
        files.write(file, written)
    return files.write(target, "\n".join(parts))


def _measure(term: Any, number: int) -> str:
    """The table of a measure; a soft one is a goal with the key `soft`."""
    if not isinstance(term, tasks.Soft):
        return _table("[[measure]]", _term(term, MEASURES, "measures", number))
    return _table("[[goal]]", _term(term.goal, GOALS, "measures", number) | {"soft": term.weight})


def _figures(figure: Figure, target: Path) -> list[str]:
    if not figure.members:
        tables = _with_mounts(figure, target, "", {})
    else:
        named = figure.members.items()
        tables = [
            table
            for name, (one, at) in named
            for table in _with_mounts(one, target, f"{name}/", {"called": name, "at": _seven(at)})
        ]
    return [_table("[figure]" if len(tables) == 1 else "[[figure]]", table) for table in tables]


def _with_mounts(figure: Figure, target: Path, prefix: str, named: dict[str, Any]) -> list[dict[str, Any]]:
    """The tables of a figure, which is named so, and of what is mounted on it one after the other."""
    if figure.mount is None:
        return [{**named, **_figure(figure, target)}]
    base, other, on, name, at = figure.mount
    mounted = {"called": name, **_figure(other, target), "on": prefix + on, "at": _seven(at)}
    return [*_with_mounts(base, target, prefix, named), mounted]


def _figure(figure: Figure, target: Path) -> dict[str, Any]:
    if figure.mount is not None:
        raise InputError(
            f"write_task: {figure.name!r} carries something mounted and is mounted itself, which a task file "
            "cannot say; mount one figure after the other on the first one"
        )
    if figure.loaded_as is None:
        raise InputError(
            f"write_task: {figure.name!r} did not come from wb.load or was reduced, so a task file cannot name it; "
            "load a figure by name or by path"
        )
    spec, options = figure.loaded_as
    named = {"name": spec} if spec in FIGURES else {"path": _beside(spec, target)}
    if "parts" in options:
        known_parts: dict[str, tuple[Shape, Any]] = options["parts"]
        parts = [{"name": name, **_shape(shape, at, name, mesh=False)} for name, (shape, at) in known_parts.items()]
        options = {**options, "parts": parts}
    if options.get("package_dirs"):
        options = {**options, "package_dirs": [_beside(str(folder), target) for folder in options["package_dirs"]]}
    known = {key.name for form in FIGURES.values() for key in form.keys}
    for option in options:
        if option not in known or (option == "concavity" and isinstance(options[option], dict)):
            raise InputError(f"write_task: the figure was loaded with {option}, which a task file cannot say")
    return {**named, **{name: value for name, value in options.items() if value is not None}}


def _start(problem: Problem) -> dict[str, Any]:
    figure, q = problem.scene.figure, problem.start
    first = figure.joint_values(figure.posture(figure.postures[0]))
    # rad, m: a joint nearer than this to its value in the first posture is not written
    joints = {
        name: value
        for name, value in figure.joint_values(q).items()
        if name not in figure.followers and abs(value - first[name]) > 1e-12
    }
    start: dict[str, Any] = {"posture": figure.postures[0]}
    if joints:
        start["joints"] = joints
    roots = root_places(figure, q)
    return start | ({"root": roots["root"]} if "root" in roots else {"roots": roots} if roots else {})


def root_places(figure: Figure, q: Array) -> dict[str, list[float]]:
    """Position and quaternion x, y, z, w of each free root in a posture (nq,)."""
    places = {name: int(figure.model.joints[joint].idx_q) for name, joint in figure.roots.items()}
    return {name: q[first : first + 7].tolist() for name, first in places.items()}


def _thing(thing: SceneObject, target: Path, beside: dict[Path, str]) -> dict[str, Any]:
    found: dict[str, Any] = {"name": thing.name, **_shape(thing.shape, thing.placement, thing.name)}
    if thing.segment is not None:
        found["to"] = thing.segment
        if thing.rests_on:
            found["rests_on"] = list(thing.rests_on)
    if thing.color is not None:
        found["color"] = list(thing.color)
    if isinstance(thing.shape, Mesh):
        found["path"] = _mesh(thing.shape, thing.name, target, beside, found)
    if thing.body is not None:
        given = {"density": thing.body.density, "mass": thing.body.mass, "material": thing.material.name}
        found |= {name: value for name, value in given.items() if value is not None}
        if found.get("mass") is not None:
            found.pop("density", None)
        for name in ("velocity", "angular_velocity"):
            if any(getattr(thing.body, name)):
                found[name] = _plain(getattr(thing.body, name))
        if thing.body.joints:
            found["joints"] = [_part(joint, JOINT_OF_A_THING) for joint in thing.body.joints]
    return found


def _shape(shape: Shape, at: Any, name: str, *, mesh: bool = True) -> dict[str, Any]:
    """Kind, place and sizes of a shape; a mesh without its path, where it may be one."""
    kind = type(shape).__name__.lower()
    if kind not in SHAPES or not (mesh or kind != "mesh"):
        raise InputError(f"write_task: {name!r} is a {type(shape).__name__}, which task files do not have")
    sizes = {key.name: _plain(getattr(shape, key.name)) for key in SHAPES[kind].keys if key.name != "path"}
    return {"shape": kind, "at": _seven(at), **sizes}


def _mesh(shape: Mesh, name: str, target: Path, beside: dict[Path, str], found: dict[str, Any]) -> str:
    if isinstance(shape.source, (str, PathLike)):
        return _beside(str(shape.source), target)
    found |= {"scale": 1.0, "up": "z"}  # the vertices are scaled and turned already
    file = target.with_name(f"{target.stem}-{''.join(c if c.isalnum() else '_' for c in name)}.obj")
    corners = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in shape.vertices.tolist()]
    triangles = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in shape.faces.tolist()]
    beside[file] = "\n".join([*corners, *triangles, ""])
    return file.name


def _term(term: Any, forms: dict[str, Any], what: str, number: int) -> dict[str, Any]:
    kind = next((name for name, form in forms.items() if form.make is type(term)), None)
    if isinstance(term, tasks.Freeze):
        kind = "freeze"
    if kind is None:
        raise InputError(
            f"write_task: {what}[{number}] is a {type(term).__name__}, which task files do not have; leave it out"
        )
    found: dict[str, Any] = {"type": kind}
    for key in forms[kind].keys:
        value = getattr(term, key.name, None)
        if value is not None and (key.required or not (isinstance(value, (str, tuple)) and not value)):
            found[key.name] = _plain(value, key.kind)
    if isinstance(term, PlacementTerm):
        written = next(name for name in ("at", "placement", "target") if hasattr(term, name))
        found[written] = _seven(term.residual.placement)[0 if term.residual.position else 3 :]
    elif isinstance(term, tasks.Plane):
        found["point"] = _plain(term.resolved_normal * term.height)
    elif isinstance(term, tasks.Posture) and not isinstance(term.target, str):
        raise InputError(f"write_task: {what}[{number}] is a Posture of numbers; a task file names one of the figure's")
    return found


def _seven(placement: Any) -> list[float]:
    return [float(value) for value in pin.SE3ToXYZQUAT(placement)]


def _plain(value: Any, kind: Kind | None = None) -> Any:
    if isinstance(kind, Several):
        return [_plain(entry, kind.kind) for entry in value]
    if isinstance(kind, Part):
        return _part(value, kind)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, (tuple, list)) else value


def _part(made: Any, kind: Part) -> dict[str, Any]:
    """The table in braces of an object."""
    name, form = next((name, form) for name, form in kind.forms.items() if form.make is type(made))
    values = {key.name: _plain(getattr(made, key.name), key.kind) for key in form.keys}
    return ({kind.chooser: name} if kind.chooser else {}) | {key: one for key, one in values.items() if one is not None}


def _beside(file: str, target: Path) -> str:
    """Path of a file, relative to the folder of the task file."""
    return Path(os.path.relpath(Path(file).resolve(), target.parent.resolve())).as_posix()


def _table(header: str, values: dict[str, Any]) -> str:
    return f"{header}\n{_lines(values)}"


def _lines(values: dict[str, Any]) -> str:
    return "".join(f"{name} = {_toml(value)}\n" for name, value in values.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        keys = [name if name.isascii() and name.isidentifier() else json.dumps(name) for name in value]
        return f"{{ {', '.join(f'{key} = {_toml(one)}' for key, one in zip(keys, value.values(), strict=True))} }}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)

"""A task: the problem that a task file states, and the method that it names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import brief, with_values
from wholebody.base.checks import known, shown
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import UnknownNameError
from wholebody.base.files import is_file, is_folder, title_of
from wholebody.figures import Figure, join, load
from wholebody.figures.adjustable import ADJUSTABLE, adjustable
from wholebody.figures.loading import member
from wholebody.geometry.placement import placement
from wholebody.geometry.shapes import Mesh, Shape
from wholebody.methods.base import Method
from wholebody.methods.solve import method_named
from wholebody.problem import Problem
from wholebody.scene.matter.body import Body
from wholebody.scene.scene import Scene
from wholebody.taskfile.kinds import Where
from wholebody.taskfile.reading import Contents, Entry, read_contents
from wholebody.tasks import Soft

_OF_BODIES = ("density", "mass", "material", "velocity", "angular_velocity", "joints")


class View(NamedTuple):
    """The camera of a picture of the task."""

    eye: tuple[float, float, float] | None = None  # position of the camera, metres; None for an automatic one
    # the point in the middle of the picture, metres; given with the eye
    target: tuple[float, float, float] | None = None
    see_through: tuple[str, ...] = ()  # names of things drawn transparent


@dataclass(frozen=True)
class Task:
    """The content of a task file.

    Attributes:
        path: the file.
        title: its title, or its name.
        problem: to be solved, ready to be solved.
        method: the method that it names, with its settings.
        goal_names: the name of each goal in tables: its type and its frame.
        view: the camera of a picture.

    Examples:
        >>> task = wb.read_task(task_file)
        >>> task.problem.goals[0].frame
        'right_index_tip'
    """

    path: Path
    title: str
    problem: Problem
    method: Method
    goal_names: tuple[str, ...]
    view: View

    __repr__ = brief


def read_task(path: str | PathLike[str]) -> Task:
    """Read a task file; docs/taskfile.md lists all it can say.

    Args:
        path: a TOML file. Paths in it are relative to its folder.

    Raises:
        FileFormatError: a file that cannot be read, or a value of the wrong kind or out of range; file, key and fix
            are named.
        UnknownNameError: an unknown key, type, joint, frame or posture, or a missing file, with the nearest names.
        InputError: values that contradict each other.

    Examples:
        >>> path = wb.taskfile.write_task(problem, folder / "reach.toml")
        >>> wb.solve(wb.read_task(path).problem).status
        'solved'
    """
    file = checked_path(path, "path")
    return task_from(read_contents(file), file)


def task_from(contents: Contents, file: Path) -> Task:
    """The task that the contents of a file state."""
    figure = _figure(contents)
    for entries in contents.tables.values():
        for entry in entries:
            if entry.where.table != "figure":
                entry.check_names(figure)
    start = _start(contents, figure)
    scene = _scene(contents, figure)

    options = {name: value for name, value in contents.top.values.items() if name != "title"}
    terms = {name: _terms(contents, name, scene, start) for name in ("goal", "constraint", "measure")}
    if soft := [term for term in terms["goal"] if isinstance(term, Soft)]:
        terms["goal"] = [term for term in terms["goal"] if not isinstance(term, Soft)]
    options |= {f"{name}s": found for name, found in terms.items() if found}
    with contents.top.where.named():
        known = options | {"goals": [*terms["goal"], *(one.goal for one in soft)]}  # these move arms too
        usual = Problem(scene, start, **known).measures if soft and not terms["measure"] else ()
        problem = Problem(scene, start, **(options | {"measures": [*terms["measure"], *soft]} if soft else options))
        if usual:  # as they are: who is to kneel spares effort from elsewhere than the start
            problem.measures = (*usual, *problem.measures)
    method = contents.one("method")
    return Task(
        path=file,
        title=contents.top.values.get("title", title_of(file)),
        problem=problem,
        method=method.make() if method else method_named("qp"),
        goal_names=tuple(_goal_name(entry) for entry in contents.tables.get("goal", ()) if "soft" not in entry.values),
        view=_view(contents, scene),
    )


def _figure(contents: Contents) -> Figure:
    """The figure of the file, or its figures, each with what it is called; some may be mounted on others."""
    entries = contents.tables["figure"]
    mounts = [entry for entry in entries if "on" in entry.values]
    standing = [entry for entry in entries if "on" not in entry.values]
    if not standing:
        raise mounts[0].where.at("on").fault("no figure has the frame; add the one that carries this one")
    alone = len(standing) == 1 and (mounts or not standing[0].where.number)
    if alone and not standing[0].values.keys() & {"called", "at"}:
        figure = _loaded(standing[0])
        for mount in mounts:
            figure = _mounted(figure, mount, mount.values["on"])
        return figure
    found: dict[str, tuple[Figure, Any]] = {}
    for entry in standing:
        called = entry.values.get("called")
        if called is None or called in found:
            raise entry.where.fault('write called = "anna", another name for each figure: its parts begin with it')
        found[called] = _loaded(entry), entry.values.get("at", (0.0, 0.0, 0.0))
        with entry.where.named():
            member(called, found[called])
    for mount in mounts:
        called, _, frame = mount.values["on"].partition("/")
        with mount.where.at("on").named():
            figure, at = found[known(called, found, "figure")]
        found[called] = _mounted(figure, mount, frame), at
    return join(found)


def _mounted(figure: Figure, mount: Entry, on: str) -> Figure:
    """A figure with that of an entry on a frame of it."""
    other, at = _loaded(mount), mount.values.get("at", (0.0, 0.0, 0.0))
    with mount.where.at("on").named():
        figure.frame_id(on)
    with mount.where.named():
        return figure.mounted(other, on=on, name=mount.values.get("called"), at=at)


def _loaded(entry: Entry) -> Figure:
    options = {name: value for name, value in entry.values.items() if name not in ("called", "at", "on")}
    joints = options.pop("joints", None)
    spec: Any = entry.name
    if entry.name == "urdf":
        spec = _file(options.pop("path"), entry.where.at("path"))
        if "package_dirs" in options:
            options["package_dirs"] = [entry.where.file.parent / folder for folder in options["package_dirs"]]
    make: Callable[..., Figure] = load
    if entry.name == ADJUSTABLE:
        make, spec = adjustable, dict(options["parts"])
        if len(spec) < len(options.pop("parts")):
            raise entry.where.at("parts").fault("two parts have one name; give each another")
    with entry.where.named():
        figure: Figure = make(spec, **options)
    if joints is None:
        return figure
    entry.keys["joints"].kind.names(joints, figure, entry.where.at("joints"))
    with entry.where.at("joints").named():
        return figure.reduced(joints)


def _start(contents: Contents, figure: Figure) -> NDArray[np.float64]:
    entry = contents.one("start")
    if entry is None:
        return figure.posture(figure.postures[0])
    q = figure.posture(entry.values.get("posture", figure.postures[0]))
    joints = entry.values.get("joints", {})
    with entry.where.at("joints").named():
        q = figure.with_joints(q, joints)
    if not figure.within_limits(q):
        clamped = figure.joint_values(figure.clamp(q))
        far = max(joints, key=lambda name: abs(joints[name] - clamped[name]))
        raise entry.where.at(f"joints.{far}").fault(
            f"{joints[far]:g} is out of the joint's limits; the nearest within them is {clamped[far]:.4f} rad"
        )
    if "root" in entry.values:
        if figure.root != "free":
            correction = "write roots" if figure.members else "leave the key out, or load a free root"
            raise entry.where.at("root").fault(f"there is no one free root; {correction}")
        with entry.where.at("root").named():
            q[:7] = pin.SE3ToXYZQUAT(placement(entry.values["root"], "root"))
    for name, place in entry.values.get("roots", {}).items():
        first = int(figure.model.joints[figure.joint_id(name)].idx_q)
        with entry.where.at("roots").at(name).named():
            q[first : first + 7] = pin.SE3ToXYZQUAT(placement(place, name))
    return q


def _scene(contents: Contents, figure: Figure) -> Scene:
    scene = Scene(figure)
    for entry in [*contents.tables.get("object", ()), *contents.tables.get("attach", ())]:
        options = dict(entry.values)
        thing = {name: options.pop(name) for name in ("name", "at", "color", "to", "rests_on") if name in options}
        moves: dict[str, Any] = {name: options.pop(name) for name in _OF_BODIES if name in options}
        with entry.where.named():
            thing |= {"body": Body(**moves)} if moves.keys() - {"material"} else moves
        shape = _shape(entry, options)
        add: Callable[..., Scene] = scene.attach if "to" in thing else scene.add
        with entry.where.named():
            add(shape, **thing)
    things = [name for name, thing in scene.objects.items() if thing.segment is None]
    for entry in contents.tables.get("object", ()):
        for number, joint in enumerate(entry.values.get("joints", ())):
            where = entry.where.at("joints").at(f"[{number}]").at("to")
            if joint.to is not None and joint.to not in things:
                raise UnknownNameError("thing", joint.to, things, str(where))
            if joint.to == entry.values["name"]:
                raise where.fault("the thing cannot hold itself; name another thing, or leave to out for the world")
    return scene


def _shape(entry: Entry, options: dict[str, Any]) -> Shape:
    assert entry.form is not None
    if entry.form.make is not None:
        shape: Shape = with_values(entry, values=options).make()
        return shape
    file = _file(options.pop("path"), entry.where.at("path"))
    with entry.where.at("path").named():
        return Mesh(file, **options)


def _terms(contents: Contents, name: str, scene: Scene, start: NDArray[np.float64]) -> list[Any]:
    """Terms of one table; each is tried on the scene here so that an error can name its place in the file."""
    terms = []
    for entry in contents.tables.get(name, ()):
        _check_hand(entry, scene)
        weight = entry.values.get("soft")
        term = entry.make() if weight is None else Soft(entry.make(), weight)
        with entry.where.named():
            term.resolve(scene, start)
        terms.append(term)
    return terms


def _check_hand(entry: Entry, scene: Scene) -> None:
    """Refuse a hand that does not say which of several figures has it."""
    hand, members = entry.values.get("hand"), list(scene.figure.members)
    if not members or not isinstance(hand, str):
        return
    owner, slash, own = hand.partition("/")
    if not slash or owner not in members or own.rpartition("/")[2].split("_")[0] not in ("left", "right"):
        hands = [frame.removesuffix("_palm") for frame in scene.figure.frames if frame.endswith("_palm")]
        named = " or ".join(map(shown, hands[:6])) or "a figure with hands"
        raise entry.where.at("hand").fault(f"{shown(hand)} is no hand of one of the figures; give {named}")


def _view(contents: Contents, scene: Scene) -> View:
    entry = contents.one("view")
    if entry is None:
        return View()
    view = View(**{**entry.values, "see_through": tuple(entry.values.get("see_through", ()))})
    if (view.eye is None) != (view.target is None):
        raise entry.where.fault("eye and target belong together; write both or neither")
    for i, name in enumerate(view.see_through):
        if name not in scene.objects:
            raise UnknownNameError("thing", name, scene.objects, str(entry.where.at(f"see_through[{i}]")))
    return view


def _file(name: str, where: Where) -> Path:
    """A file that the task file names, relative to its folder."""
    path = where.file.parent / name
    if not is_file(path):
        folder = path.parent if is_folder(path.parent) else where.file.parent
        raise UnknownNameError("file", name, [file.name for file in folder.iterdir() if is_file(file)], str(where))
    return path


def _goal_name(entry: Entry) -> str:
    named = ("frame", "part", "on", "hand", *(("target",) if entry.name == "posture" else ()))
    moved = next((entry.values[key] for key in named if key in entry.values), "")
    return f"{entry.name} {moved}".strip()

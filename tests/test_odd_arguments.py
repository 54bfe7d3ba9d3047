"""Every public callable, fed with odd values: what is wrong is a WholebodyError, never a raw one, and nothing hangs.

Each callable has one call that works; each of its arguments is replaced by each odd value in turn. A call may succeed
(an odd value may be a right one), and what it makes is then used, so that nothing wrong is kept for later.
"""

from __future__ import annotations

import importlib
import inspect
import math
import re
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody import tracking
from wholebody.dynamics.live_world import LiveWorld
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.figures.state import State
from wholebody.geometry.shapes import Compound
from wholebody.motion import measures
from wholebody.motion.sphere_filling import Spheres, fill_with_spheres
from wholebody.planning.distinct_solutions import Solutions
from wholebody.tracking.live import LiveDrag
from wholebody.view import Viewer
from wholebody.view.motion_curves import timeline

ROOT = Path(__file__).resolve().parent.parent
CIRCLE: list[Any] = []
CIRCLE.append(CIRCLE)


class Unshowable:
    """A value that cannot be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("no words for it")


ODD: dict[str, Any] = {
    "None": None,
    "True": True,
    "zero": 0,
    "minus one": -1,
    "nan": math.nan,
    "inf": math.inf,
    "beyond int64": 2**63,
    "beyond printing": 10**5000,
    "complex": 1j,
    "text": "x",
    "null in text": "a\0b",
    "surrogate": "\ud800",
    "list": [],
    "list in itself": CIRCLE,
    "ragged": [[1.0, 2.0], [3.0]],
    "unshowable": Unshowable(),
    "function": lambda *_: None,
    "iterator": iter(()),
    "three numbers": (1.0, 2.0, 3.0),
    "array 0-d": np.array(1.0),
    "array empty": np.zeros((0, 3)),
    "array of nan": np.full((4, 4), math.nan),
    "array of text": np.array(["a", "b"]),
    "SE3 of nan": pin.SE3(np.eye(3), np.full(3, math.nan)),
    "namespace": SimpleNamespace(q=None, dt=None, model=None),
}


class Call(NamedTuple):
    """A call that works.

    Attributes:
        function: what is called.
        arguments: by name; each is replaced in turn.
        use: what is done with the answer.
    """

    function: Callable[..., Any]
    arguments: dict[str, Any]
    use: Callable[[Any], Any] = lambda answer: None


ARM = """<robot name="arm">
  <link name="base"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  {links}
</robot>"""
BVH = """HIERARCHY
ROOT hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT b
{
OFFSET 0 0.5 0
CHANNELS 3 Zrotation Xrotation Yrotation
JOINT a
{
OFFSET 0 1 0
CHANNELS 3 Zrotation Xrotation Yrotation
}
}
}
MOTION
Frames: 1
Frame Time: 0.1
0 0 0 0 0 0 10 0 0 0 0 0
"""
LINK = """<link name="link{n}"><inertial><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="joint{n}" type="revolute"><parent link="{before}"/><child link="link{n}"/><origin xyz="0 0 0.3"/>
  <axis xyz="{axis}"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with an arm, a task, a track and a path."""
    made = tmp_path_factory.mktemp("odd")
    chain = [("base", 1, "0 0 1"), ("link1", 2, "0 1 0"), ("link2", 3, "0 1 0"), ("link3", 4, "1 0 0")]
    links = "\n".join(LINK.format(n=n, before=before, axis=axis) for before, n, axis in chain)
    (made / "arm.urdf").write_text(ARM.format(links=links))
    (made / "task.toml").write_text('[figure]\npath = "arm.urdf"\n')
    (made / "person.toml").write_text('[figure]\nname = "human"\n')
    (made / "path.txt").write_text("0.1 0.2 0.3\n0.2 0.2 0.3\n")
    return made


@cache
def figure(path: Path) -> wb.Figure:
    return wb.load(path / "arm.urdf")


def scene(path: Path) -> wb.Scene:
    made = wb.Scene(figure(path))
    made.add(wb.Sphere(0.1), name="ball", at=(0.6, 0.0, 0.9))
    return made


def problem(path: Path, **terms: Any) -> wb.Problem:
    terms = {"goals": [wb.Point("link4", (0.2, 0.1, 1.0))], **terms}
    return wb.Problem(scene(path), **terms)


def solvable(path: Path, term: Any) -> None:
    """State and solve a problem with a term."""
    kind = {wb.Goal: "goals", wb.Measure: "measures"}
    key = next((key for base, key in kind.items() if isinstance(term, base)), "constraints")
    wb.solve(problem(path, **{key: [term]}), wb.methods.QP(budget=0, restarts=0))


class Level(wb.methods.AssemblyConstraint):
    """A body at the height of another."""

    bodies = ("crank", "rod")

    def residual(self, x: Any) -> Any:
        return x[1:, 2] - x[:1, 2] - 0.08

    def jacobian(self, x: Any) -> Any:
        result = np.zeros((1, 2, 7))
        result[0, 0, 2], result[0, 1, 2] = -1.0, 1.0
        return result


class Still(wb.Measure):
    """The same at all placements."""

    def value(self, state: Any) -> float:
        return 1.0

    def gradient(self, state: Any) -> Any:
        return np.zeros(state.model.nv)


def assembly() -> wb.Assembly:
    made = wb.Assembly()
    made.body("crank", size=0.1).body("rod", (0.06, 0.0, 0.08), size=0.3)
    return made.revolute("world", "crank", at=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))


def easily(path: Path, method: Any) -> None:
    """Solve something that needs restarts, with few of them."""
    far = problem(path, goals=[wb.Point("link4", (9.0, 0.0, 0.0))])
    method.solve(far)


def calls(path: Path) -> Iterator[tuple[str, Call]]:
    """Every public callable with a call that works; made anew at each use, since some of them change things."""
    arm, there, ask = figure(path), scene(path), problem(path)
    q = arm.neutral
    state = State(arm.model)
    places = [(0.2, 0.1, 1.0), (0.2, 0.12, 1.0)]
    track = wb.Clip(arm, np.array([q, q, q, q]), 0.1)
    solve_it = partial(solvable, path)
    person = wb.Scene(human())

    def on_a_person(term: Any) -> Any:
        return term.resolve(person, person.figure.neutral)

    person.add(wb.Box((0.4, 0.4, 0.1)), name="crate", at=(0.5, 0.0, 0.4)).add(wb.HalfSpace(), name="floor")
    person.add(wb.Box((0.1, 0.4, 0.8)), name="post", at=(-0.9, 0.0, 0.4))

    yield "load", Call(lambda spec, **options: wb.load(spec, **options), {"spec": path / "arm.urdf"})
    for option, value in {"root": "fixed", "package_dirs": [path], "concavity": 0.5, "samples": 10}.items():
        yield f"load({option})", Call(wb.load, {"spec": path / "arm.urdf", option: value})
    body = {"sex": "male", "stature": 1.7, "mass": 70.0, "detail": "spheres", "age": 50.0}
    for option, value in (body | {"shoes": 0.03, "clothing": 0.01}).items():
        yield f"load({option})", Call(lambda _option=option, **given: wb.load("human", **given), {option: value})
    yield "load(proportions)", Call(lambda **given: wb.load("human", **given), {"proportions": {"span": 1.85}})
    yield "finger_angles", Call(wb.figures.finger_angles, {"shape": "fist", "side": "left"})
    yield "load(hands)", Call(lambda **given: wb.load("human", **given), {"hands": "rigid"})
    yield "load(side)", Call(lambda **given: wb.load("hand", **given), {"side": "left", "stature": 1.7})
    yield "Figure.clamp", Call(arm.clamp, {"q": q})
    yield "Figure.describe", Call(arm.describe, {})
    yield "Figure.dofs", Call(arm.dofs, {"names": ["joint1"]})
    yield "Figure.frame_id", Call(arm.frame_id, {"name": "link1"})
    yield "Figure.joint_id", Call(arm.joint_id, {"name": "joint1"})
    yield "Figure.joint_names", Call(arm.joint_names, {"names": ["joint1"]})
    yield "Figure.joint_values", Call(arm.joint_values, {"q": q})
    yield "Figure.placement", Call(arm.placement, {"q": q, "name": "link1"})
    yield "Figure.posture", Call(arm.posture, {"name": arm.postures[0]})
    off = (1.0, 0.0, 0.0)
    both = wb.Scene({"one": arm, "two": (arm, off)}).figure
    mounted = {"other": arm, "on": "link4", "name": "it", "at": off}
    yield "Figure.mounted", Call(arm.mounted, mounted, lambda made: made.neutral)
    yield "Figure.part", Call(both.part, {"name": "one", "q": both.neutral})
    yield "Figure.posture(several)", Call(lambda posture: both.posture({"one": posture}), {"posture": q})
    added = {"figure": arm, "name": "two", "at": off, "root": None}
    yield "Scene.add_figure", Call(lambda **given: wb.Scene({"one": arm}).add_figure(**given), added, repr)
    yield "Scene(several)", Call(lambda figure: wb.Scene({"one": figure}), {"figure": (arm, off)}, repr)
    yield "Figure.reduced", Call(arm.reduced, {"joints": ["joint1"], "posture": q})
    yield "Figure.tangent_bounds", Call(arm.tangent_bounds, {"q": q})
    yield "Figure.with_joints", Call(arm.with_joints, {"q": q, "values": {"joint1": 0.1}}, arm.clamp)
    yield "Figure.with_joints(value)", Call(lambda v: arm.with_joints(q, {"joint1": v}), {"v": 0.1}, arm.clamp)
    yield "Figure.within_limits", Call(arm.within_limits, {"q": q, "tolerance": 0.1})

    yield "Scene", Call(wb.Scene, {"figure": arm}, lambda made: made.geometry)
    thing = {"shape": wb.Sphere(0.1), "name": "thing", "at": (0.0, 0.5, 0.5), "color": (1.0, 0.0, 0.0, 1.0)}
    yield "Scene.add", Call(lambda **given: scene(path).add(**given), thing, lambda made: Viewer(made).show(q))
    carried = {**thing, "to": "link2", "rests_on": ["link1"]}
    yield "Scene.attach", Call(lambda **given: scene(path).attach(**given), carried, lambda made: Viewer(made).show(q))
    yield "Scene.contacts", Call(there.contacts, {"q": q, "within": 0.1})
    yield "Scene.frame_id", Call(there.frame_id, {"name": "link1"})
    yield (
        "Scene.move",
        Call(
            lambda **given: scene(path).move(**given),
            {"name": "ball", "at": (1.0, 1.0, 1.0), "over": 0.1},
            lambda made: made.contacts(q),
        ),
    )
    near = there.contacts(q, within=1.0)
    yield "Contacts.nearer", Call(near.nearer, {"distance": 0.5})
    yield "Contacts.nearest_first", Call(near.nearest_first, {})
    yield "Scene.penetration", Call(there.penetration, {"q": q})
    yield "Scene.overlapping", Call(there.overlapping, {"q": q})
    yield "Scene.borrow", Call(there.borrow, {})
    yield "Scene.workspace", Call(there.workspace, {})
    yield "Scene.remove", Call(lambda **given: scene(path).remove(**given), {"name": "ball"})
    yield "Scene.state", Call(there.state, {"q": q})
    moves = {"ball": ((1.0, 1.0, 1.0), (1.0, 0.9, 1.0))}
    yield "Scene.sweep", Call(there.sweep, {"q0": q, "q1": q + 0.1, "tolerance": 1e-4, "moves": moves})
    world = {"scene": there, "start": q, "dt": 0.1, "overlap": "qp", "seed": 0, "spring": wb.dynamics.Spring()}
    world["give_way"] = "both"
    yield "World", Call(wb.World, world, lambda made: made.step(q))
    yield "World.step", Call(wb.World(there, q).step, {"tracked": q})
    body = {"mass": 0.5, "material": "wood", "velocity": (0.1, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.1)}

    def loose(body: Any) -> Any:
        return wb.Scene(arm).add(wb.Sphere(0.1), name="ball", at=(1.0, 1.0, 1.0), body=body)

    yield "Body", Call(wb.Body, body, lambda made: RigidBodies(loose(made)).advance(0.1))
    for joint in (wb.dynamics.BallJoint, wb.dynamics.Hinge):
        hung = {"at": (0.0, 0.0, 0.1), "to": None, **({"axis": (0.0, 1.0, 0.0)} if joint is wb.dynamics.Hinge else {})}
        yield joint.__name__, Call(joint, hung, lambda made: RigidBodies(loose(wb.Body(joints=[made]))).advance(0.1))
    yield "Body(joints)", Call(wb.Body, {"joints": ()}, lambda made: RigidBodies(loose(made)).advance(0.1))
    yield "Body(density)", Call(wb.Body, {"density": 500.0}, lambda made: RigidBodies(loose(made)).advance(0.1))
    material = {"name": "glass", "against": {"wood": (0.5, 0.1)}, "others": (0.5, 0.1)}
    yield "Material", Call(wb.dynamics.Material, material, lambda made: RigidBodies(loose(wb.Body(material=made))))
    engine = RigidBodies(loose(wb.Body()))
    yield "RigidBodies", Call(RigidBodies, {"scene": loose(wb.Body()), "gravity": (0.0, 0.0, -9.8)})
    still = {"link1": (np.eye(4), np.eye(4))}
    yield "RigidBodies.advance", Call(engine.advance, {"dt": 0.1, "kinematic": None})
    yield "RigidBodies.advance(kinematic)", Call(engine.advance, {"dt": 0.1, "kinematic": still})
    for name in ("placement", "twist", "response", "centre", "weight"):
        yield f"RigidBodies.{name}", Call(getattr(engine, name), {"name": "ball"})
    for name in ("energy", "momentum", "way_back"):
        yield f"RigidBodies.{name}", Call(getattr(engine, name), {})
    point = {"name": "ball", "point": (1.0, 1.0, 1.0)}
    for name in ("velocity_at", "mobility"):
        yield f"RigidBodies.{name}", Call(getattr(engine, name), point)
    yield "RigidBodies.contacts", Call(engine.contacts, {"names": ["ball"]})
    yield "RigidBodies.put", Call(engine.put, {"name": "ball", "at": pin.SE3.Identity()})
    yield "RigidBodies.push", Call(engine.push, {**point, "impulse": (0.0, 0.1, 0.0)}, lambda _: engine.energy())
    wrench = {"name": "ball", "wrench": (0.0, 0.1, 0.0, 0.0, 0.0, 0.01)}
    yield "RigidBodies.push_about_centre", Call(engine.push_about_centre, wrench, lambda _: engine.energy())
    spring = {"stiffness": 1000.0, "damping": 40.0, "mass": 0.4}
    yield "Spring", Call(wb.dynamics.Spring, spring, lambda made: made.transition(0.1))
    yield "Spring.transition", Call(wb.dynamics.Spring().transition, {"time": 0.1})
    actuated = {"figure": arm, "stiffness": {"joint1": 10.0}, "damping": 1.0}
    yield "Actuated", Call(wb.Actuated, actuated, lambda made: wb.World(there, q, spring=made).step(q))

    def put(shape: Any) -> Any:
        return wb.Scene(arm).add(shape, name="it").contacts(q)

    yield "Box", Call(wb.Box, {"size": (1.0, 1.0, 1.0)}, put)
    yield "Sphere", Call(wb.Sphere, {"radius": 1.0}, put)
    moved = {**thing, "body": wb.Body()}
    yield "Scene.add(body)", Call(lambda **given: scene(path).add(**given), moved)
    yield "Scene.add(material)", Call(lambda **given: scene(path).add(**given), {**thing, "material": "metal"})
    yield "Capsule", Call(wb.Capsule, {"radius": 1.0, "length": 1.0}, put)
    yield "Ellipsoid", Call(wb.Ellipsoid, {"semi_axes": (1.0, 1.0, 1.0)}, put)
    yield "HalfSpace", Call(wb.HalfSpace, {"normal": (0.0, 0.0, 1.0), "offset": 0.0}, put)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    yield "Hull", Call(wb.Hull, {"points": corners}, put)
    mesh = {"source": (corners, faces), "scale": 1.0, "up": "z", "max_vertices": 32, "threshold": 0.05}
    yield "Mesh", Call(wb.Mesh, mesh, put)
    yield "Mesh(vertices)", Call(lambda vertices: wb.Mesh((vertices, faces)), {"vertices": corners}, put)
    yield "Mesh(faces)", Call(lambda faces: wb.Mesh((corners, faces)), {"faces": faces}, put)
    simple = wb.Box((1, 1, 1)), wb.Sphere(1), wb.Capsule(1, 1), wb.Ellipsoid((1, 1, 1)), wb.HalfSpace()
    for shape in (*simple, wb.Cylinder(0.1, 0.2), wb.Torus(0.1, 0.02)):
        yield f"{type(shape).__name__}.pieces", Call(shape.pieces, {})
    yield "Hull.pieces", Call(wb.Hull(corners).pieces, {})
    yield "Mesh.pieces", Call(wb.Mesh((corners, faces)).pieces, {})
    yield "Mesh.convexified", Call(wb.Mesh((corners, faces)).convexified, {})

    at, turned = (0.2, 0.1, 1.0), (0.0, 0.0, 0.0, 1.0)
    yield "Point", Call(wb.Point, {"frame": "link4", "target": at, "offset": at, "weight": 1.0}, solve_it)
    yield "Frame", Call(wb.Frame, {"frame": "link4", "target": at, "weight": 1.0}, solve_it)
    yield "Orientation", Call(wb.Orientation, {"frame": "link4", "target": turned, "weight": 1.0}, solve_it)
    axis = {"frame": "link4", "axis": at, "direction": at, "weight": 1.0}
    yield "Axis", Call(wb.Axis, axis, solve_it)
    yield "Axis(toward)", Call(wb.Axis, {"frame": "link4", "axis": at, "toward": at}, solve_it)
    yield "CenterOfMass", Call(wb.CenterOfMass, {"target": at, "axes": "xyz", "weight": 1.0}, solve_it)
    relative = {"frame": "link4", "to": "link1", "placement": at, "orientation": False, "weight": 1.0}
    yield "Relative", Call(wb.Relative, relative, solve_it)
    yield "Posture", Call(wb.Posture, {"target": q, "joints": ["joint1"], "weight": 1.0}, solve_it)
    hold = {"frame": "link4", "at": at, "orientation": False, "relative_to": "link1"}
    yield "Hold", Call(wb.Hold, hold, solve_it)
    plane = {"frame": "link4", "normal": at, "point": at, "side": "above"}
    yield "Plane", Call(wb.Plane, plane, solve_it)
    yield "Balance", Call(wb.Balance, {"feet": ["left_foot"], "margin": 0.0}, on_a_person)
    carried = [wb.Force("left_palm", (0.0, 0.0, -10.0))]
    yield "Force", Call(wb.Force, {"frame": "left_palm", "force": (0.0, 0.0, -10.0)}, lambda force: force.frame)
    loaded = {"forces": carried, "feet": ["left_foot"], "margin": 0.0}
    yield "LoadedBalance", Call(wb.ergonomics.LoadedBalance, loaded, on_a_person)
    strong = {"forces": carried, "strength": wb.motion.Strength(), "standing": True}
    yield "Exertion", Call(wb.ergonomics.Exertion, {**strong, "weight": 1.0}, lambda term: term.weight)
    limited = {**strong, "share": 1.0, "compression": 3400.0}
    yield "StrengthLimit", Call(wb.ergonomics.StrengthLimit, limited, on_a_person)
    look = {"at": (1.0, 0.0, 1.0), "view": wb.ergonomics.FieldOfView(), "eyes": "gaze"}
    yield "Look", Call(wb.ergonomics.Look, look, on_a_person)
    settings = {"parts": {"seat": wb.Sphere(0.1)}, "slide": (0.0, 0.1), "height": (0.0, 0.1), "tilt": (0.0, 0.1)}
    yield "adjustable", Call(wb.figures.adjustable, settings)
    yield "ReachCones", Call(wb.tasks.ReachCones, {"names": ["left_shoulder"]}, on_a_person)
    yield "RangeOfMotion", Call(wb.tasks.RangeOfMotion, {"names": ["neck"]}, on_a_person)
    yield "Cylinder", Call(wb.Cylinder, {"radius": 0.1, "length": 0.2}, lambda shape: shape.pieces())
    parts = ((wb.Sphere(0.1), pin.SE3.Identity()),)
    yield "Compound", Call(Compound, {"parts": parts}, lambda shape: shape.pieces())
    yield "Compound.pieces", Call(Compound(parts).pieces, {})
    yield "Torus", Call(wb.Torus, {"radius": 0.1, "tube": 0.02}, lambda shape: shape.pieces())
    task = wb.read_task(path / "task.toml")
    given = {"problem": task.problem, "path": path / "written.toml", "title": "one line"}
    yield "write_task", Call(wb.taskfile.write_task, given)
    answer = wb.solve(task.problem)
    stored = path / "result.json"
    yield "write_result", Call(wb.taskfile.write_result, {"task": task, "solution": answer, "path": stored})
    wb.taskfile.write_result(task, answer, stored)
    yield "read_result", Call(wb.taskfile.read_result, {"path": stored})
    touch = {"part": "link4", "thing": "ball", "weight": 1.0}
    yield "Touch", Call(wb.Touch, touch, solve_it)
    lean = {"on": "crate", "part": "thorax", "side": at, "weight": 1.0}
    yield "Lean", Call(wb.tasks.Lean, lean, on_a_person)
    sit = {"on": "crate", "pelvis": "pelvis", "trunk": "thorax", "weight": 1.0}
    yield "Sit", Call(wb.Sit, sit, on_a_person)
    yield "Sit(back)", Call(lambda back: wb.Sit("crate", back), {"back": "post"}, on_a_person)
    yield "LevelHead", Call(wb.tasks.LevelHead, {"frame": "gaze", "weight": 1.0}, on_a_person)
    yield "Hang", Call(wb.tasks.Hang, {"arms": ["left_upper_arm"], "weight": 1.0}, on_a_person)
    yield "Stance", Call(wb.tasks.Stance, {"feet": ["left_foot", "right_foot"], "weight": 1.0}, on_a_person)
    middle = {"on": "crate", "pelvis": "pelvis", "weight": 1.0}
    yield "SeatCenterline", Call(wb.tasks.SeatCenterline, middle, on_a_person)
    yield "Stance.of_feet", Call(wb.tasks.Stance().resolve(person, person.figure.neutral).of_feet, {})
    yield "Stand", Call(wb.Stand, {"on": "crate", "feet": ["left_foot"], "balance": True, "margin": 0.0}, on_a_person)
    grasp = {"hand": "left", "thing": "crate", "kind": "palm", "side": at, "weight": 1.0}
    yield "Grasp", Call(wb.Grasp, grasp, on_a_person)
    yield "Figure.grounded", Call(person.figure.grounded, {"q": person.figure.neutral, "scene": person})
    yield "Freeze", Call(lambda name: wb.Freeze(name), {"name": "joint1"}, solve_it)
    limit = {"velocity": 1.0, "joints": {"joint1": 1.0}, "root_velocity": math.inf, "root_turn": math.inf}
    yield "StepLimit", Call(wb.tasks.StepLimit, limit, solve_it)
    yield "StepLimit(joint)", Call(lambda v: wb.tasks.StepLimit(joints={"joint1": v}), {"v": 1.0}, solve_it)
    yield "Rhythm", Call(wb.tasks.Rhythm, {"weight": 1.0}, on_a_person)
    for kind in (
        wb.Effort,
        wb.tasks.RotationEffort,
        wb.tasks.Discomfort,
        wb.tasks.Displacement,
        wb.tasks.PotentialEnergy,
    ):
        yield kind.__name__, Call(kind, {"weight": 1.0}, solve_it)
    soft = {"goal": wb.Point("link4", (0.5, 0.2, 0.0)), "weight": 1.0}
    yield "Soft", Call(wb.Soft, soft, solve_it)
    yield "State", Call(State, {"model": arm.model})
    yield "State.update", Call(state.update, {"q": q})
    yield "State.at", Call(state.at, {"q": q})
    yield "State.frame", Call(state.frame, {"index": 1})
    for method in ("center_of_mass", "center_of_mass_jacobian"):
        yield f"State.{method}", Call(getattr(state, method), {})

    moving = problem(path)

    def retarget(goals: Any) -> None:
        moving.retarget(goals)
        wb.solve(moving)

    stated = {
        "scene": there, "start": q, "goals": [wb.Point("link4", at)], "constraints": [wb.Freeze("joint1")],
        "measures": [wb.Effort()], "clearance": 0.01, "touching": [("link4", "ball")],
    }  # fmt: skip
    yield "Problem", Call(wb.Problem, stated, wb.solve)
    yield "Problem(touching)", Call(lambda pair: wb.Problem(there, touching=[pair]), {"pair": ("link4", "ball")})
    yield "Problem.with_start", Call(ask.with_start, {"q": q}, wb.solve)
    yield "Problem.check_fresh", Call(ask.check_fresh, {})
    yield "Problem.check_scene", Call(ask.check_scene, {})
    workspace = ask.workspace()
    yield "Problem.lineariser", Call(lambda dt: ask.lineariser(workspace, dt), {"dt": 0.1})
    yield "Problem.borrow", Call(ask.borrow, {})
    yield "Problem.workspace", Call(ask.workspace, {})
    yield "Problem.retarget", Call(retarget, {"goals": [wb.Point("link4", at)]})
    yield "solve", Call(wb.solve, {"problem": ask, "method": "qp", "progress": print})
    yield "assess", Call(wb.assess, {"problem": ask, "q": q})
    checked = {"term": wb.Point("link4", at), "scene": ask.scene, "q": q}
    yield "check_derivatives", Call(wb.check_derivatives, checked, str)
    yield "simplify", Call(wb.simplify, {"problem": ask})
    part = wb.simplify(ask)
    yield "Solution.plot", Call(wb.solve(part.problem).plot, {})
    yield "Simplified.restored", Call(part.restored, {"solution": wb.solve(part.problem)})
    judged = wb.assess(ask, q)
    yield "Assessment.holds", Call(judged.holds, {"tolerance": 0.1})
    yield "Assessment.met", Call(judged.met, {"tolerance": 0.1})
    yield "Assessment.summary", Call(judged.summary, {})
    yield "read_task", Call(wb.read_task, {"path": path / "task.toml"})
    (path / "cell.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j"/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    yield "read_scene", Call(wb.read_scene, {"path": path / "cell.xml", "root": "arm", "concavity": None})

    used = partial(easily, path)
    settings = {
        "tolerance": 1e-4,
        "iterations": 30,
        "budget": 20,
        "restarts": 1,
        "seed": 0,
        "measures": True,
        "time_limit": 4.0,
    }
    yield "QP", Call(wb.methods.QP, {"solver": "osqp", **settings}, used)
    yield "QP.solve", Call(wb.methods.QP().solve, {"problem": ask, "progress": print})
    yield "QP.tracker", Call(wb.methods.QP().tracker, {"problem": ask, "dt": 0.1}, lambda made: made.step(q))
    yield "QPTracker.step", Call(wb.methods.QP().tracker(ask, 0.1).step, {"q": q, "measures": True})
    for name, made in {
        "QP": wb.methods.QP(budget=0),
        "CCD": wb.methods.CCD(),
        "Newton": wb.methods.Newton(restarts=0),
        "Placo": wb.methods.Placo(),
        "DampedLeastSquares": wb.methods.DampedLeastSquares(),
    }.items():
        yield f"{name}.accepts", Call(made.accepts, {"problem": ask})
        yield f"{name}.leaves_out", Call(made.leaves_out, {"problem": ask})
        if name in ("CCD", "Placo", "DampedLeastSquares"):
            yield f"{name}.tracker", Call(made.tracker, {"problem": ask, "dt": 0.1}, lambda made: made.step(q))
    for name, made in {
        "QPTracker": wb.methods.QP(budget=0).tracker(ask, 0.1),
        "NewtonTracker": wb.methods.Newton(restarts=0).tracker(ask, 0.1),
        "SolvingTracker": wb.methods.DampedLeastSquares().tracker(ask, 0.1),
    }.items():
        yield f"{name}.frame", Call(made.frame, {"q": q, "tolerance": 1e-4})
        for method in ("solve", "nearest", "overlap_resolutions"):
            if (name, method) != ("NewtonTracker", "solve"):
                yield f"{name}.{method}", Call(getattr(made, method), {"q": q})
        if name == "SolvingTracker":
            yield "SolvingTracker.step", Call(made.step, {"q": q})
    yield (
        "CCD",
        Call(wb.methods.CCD, {"tolerance": 1e-4, "iterations": 5, "restarts": 1, "seed": 0, "time_limit": None}, used),
    )
    yield "CCD.solve", Call(wb.methods.CCD().solve, {"problem": ask, "progress": print})
    newton = {"algebra": "auto", "inequalities": "slack", "restarts": 1, "seed": 0, "time_limit": 1.0}
    yield "Newton", Call(wb.methods.Newton, {"tolerance": 1e-4, "iterations": 5, **newton}, used)
    yield "Newton.solve", Call(wb.methods.Newton().solve, {"problem": ask, "progress": print})
    yield "Newton.tracker", Call(wb.methods.Newton().tracker, {"problem": ask, "dt": 0.1}, lambda made: made.step(q))
    yield "NewtonTracker.step", Call(wb.methods.Newton().tracker(ask).step, {"q": q})
    yield "NewtonTracker.solve", Call(wb.methods.Newton().tracker(ask).solve, {"q": q})
    yield (
        "Placo",
        Call(wb.methods.Placo, {"tolerance": 1e-4, "iterations": 5, "time_limit": 1.0, "holds": "soft"}, used),
    )
    yield "Placo.solve", Call(wb.methods.Placo().solve, {"problem": ask, "progress": print})
    yield "Placo.prepare", Call(wb.methods.Placo().prepare, {"problem": ask})
    yield "Placo.pairs", Call(wb.methods.Placo().pairs, {"problem": ask})
    damped = {"tolerance": 1e-4, "iterations": 5, "damping": 1e-3, "time_limit": 1.0}
    yield "DampedLeastSquares", Call(wb.methods.DampedLeastSquares, damped, used)
    yield "DampedLeastSquares.solve", Call(wb.methods.DampedLeastSquares().solve, {"problem": ask, "progress": print})

    dragged = {"problem": ask, "method": "qp", "goal": 0, "dt": 0.1}
    yield "Drag", Call(wb.tracking.Drag, dragged, lambda drag: drag.to(at))
    yield "Drag.to", Call(wb.tracking.Drag(ask).to, {"target": at})
    yield "Drag.finish", Call(wb.tracking.Drag(ask).finish, {})
    yield (
        "follow_path",
        Call(wb.tracking.follow_path, {"problem": ask, "path": places, "method": "qp", "goal": 0, "spacing": 0.05}),
    )

    def taken(live: Any, method: str, /, **arguments: Any) -> Any:
        live.take("link4")
        return getattr(live, method)(**arguments)

    fed_live = {"take": {"name": "link4", "turn": False}, "move": {"place": at}, "toggle": {"name": "link4"}}
    fed_live |= {"choose": {"method": "qp"}, "orientation": {"name": "link4"}, "place": {"name": "link4"}}
    fed_live |= {"place_at": {"q": q, "name": "link4"}, "report": {}, "stated": {"goals": []}, "undo": {}, "let_go": {}}
    yield "LiveDrag", Call(LiveDrag, {"problem": ask, "method": "qp"})
    for name, arguments in fed_live.items():
        yield f"LiveDrag.{name}", Call(partial(taken, LiveDrag(ask), name), arguments)
    parts = LiveDrag(assembly())
    held = next(iter(parts.constraints))
    yield "LiveDrag.constrain", Call(parts.constrain, {"name": held, "holds": False})
    ball = wb.Scene(arm).add(wb.Sphere(0.1), name="ball", at=(3.0, 0.0, 0.0), body=wb.Body(mass=1.0))
    yield "LiveWorld", Call(LiveWorld, {"scene": ball, "start": q, "give_way": "figure"})
    in_world = {"take": {"name": "link4"}, "move": {"place": at}, "follow": {"places": {"link4": at}}}
    in_world |= {"toggle": {"name": "link4"}, "choose": {"method": "qp"}, "place": {"name": "ball"}}
    for name, arguments in (in_world | {"report": {}, "let_go": {}, "undo": {}}).items():
        yield f"LiveWorld.{name}", Call(partial(taken, LiveWorld(ball), name), arguments)

    def solve_parts(made: Any) -> Any:
        return made.solve(iterations=3)

    yield "Assembly", Call(wb.Assembly, {"clearance": 0.01, "metric": "rim"})
    third = {"name": "third", "at": at, "shape": wb.Sphere(0.1), "size": 0.1, "color": (1.0, 0.0, 0.0)}
    yield "Assembly.body", Call(assembly().body, third, solve_parts)
    given = {"name": "arm", "figure": arm, "start": q, "constraints": [], "color": (1.0, 0.0, 0.0)}
    yield "Assembly.figure", Call(assembly().figure, given, solve_parts)
    yield "Assembly.posture", Call(assembly().figure("arm", arm).posture, {"name": "arm"})
    yield "Assembly.add", Call(assembly().add, {"shape": wb.Sphere(0.1), "name": "ball", "at": at}, solve_parts)
    yield "Assembly.add_things", Call(assembly().add_things, {"scene": there}, solve_parts)
    solid = wb.Assembly().body("rod", shape=wb.Sphere(0.1)).add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 0.0))
    yield "Assembly.move", Call(solid.move, {"name": "ball", "at": at, "over": 0.1})
    yield "Assembly.ignore", Call(solid.ignore, {"first": "rod", "second": "ball"})
    surface = {"body": "pin", "place": at, "of": "ball"}
    yield "Assembly.on_surface", Call(solid.body("pin").on_surface, surface)
    yield "Assembly.constrain", Call(assembly().constrain, {"term": Level()}, solve_parts)
    goals = assembly().point_goal("rod", (0.1, 0.0, 0.1))
    yield "Assembly.retarget", Call(goals.retarget, {"goal": 0, "target": at}, solve_parts)
    yield "Assembly.goal_index", Call(goals.goal_index, {"goal": 0})
    yield "Assembly.goal_error", Call(goals.goal_error, {"goal": 0})
    yield (
        "Assembly.interpolate_goal",
        Call(goals.interpolate_goal, {"goal": 0, "share": 0.5, "target": at}, solve_parts),
    )
    yield "Assembly.step", Call(goals.step, {"tolerance": 1e-4})
    placed = assembly()
    yield "Assembly.place", Call(placed.place, {"variables": placed.variables()}, solve_parts)
    yield "Assembly.drop_goals", Call(assembly().drop_goals, {})
    yield "Assembly.drop_measures", Call(assembly().drop_measures, {})
    yield "Assembly.minimise", Call(assembly().minimise, {"measure": Still()})
    joined = assembly().fixed("crank", "rod")
    yield "Assembly.release", Call(joined.release, {"constraint": "fixed joint of 'crank' and 'rod'"})
    yield "Assembly.hold", Call(joined.hold, {"constraint": "fixed joint of 'crank' and 'rod'"})
    yield "Assembly.orientation_goal", Call(assembly().orientation_goal, {"body": "rod", "target": (0, 0, 0, 1)})
    fixed = {"first": "crank", "second": "rod", "placement_second": at}
    yield "Assembly.fixed", Call(assembly().fixed, fixed, solve_parts)
    yield "Assembly.frame_goal", Call(assembly().frame_goal, {"body": "rod", "target": at}, solve_parts)
    flat = {"body": "rod", "place": at, "normal": at, "through": at, "of": "world", "side": "on"}
    yield "Assembly.on_plane", Call(assembly().on_plane, flat, solve_parts)
    yield "Assembly.placement", Call(assembly().placement, {"name": "rod"})
    yield "Assembly.point_goal", Call(assembly().point_goal, {"body": "rod", "target": at, "place": at}, solve_parts)
    slid = {"first": "crank", "second": "rod", "axis": at}
    yield "Assembly.prismatic", Call(assembly().prismatic, slid, solve_parts)
    turn = {"axis": at, "limits": (-1.0, 1.0), "axis_second": at, "at_first": at, "at_second": at}
    yield "Assembly.revolute", Call(assembly().revolute, {"first": "crank", "second": "rod", **turn}, solve_parts)
    ball = {"first": "crank", "second": "rod", "at": at}
    yield "Assembly.spherical", Call(assembly().spherical, ball, solve_parts)
    solving = {"tolerance": 1e-4, "iterations": 5, "algebra": "auto", "inequalities": "slack", "nearest": False}
    yield "Assembly.solve", Call(assembly().solve, solving)
    for method in ("system", "variables", "prepare"):
        yield f"Assembly.{method}", Call(getattr(assembly(), method), {})

    looked = {"scene": there, "contact_distance": 0.01, "see_through": ["ball"], "names": True, "title": "x"}
    yield "Viewer", Call(Viewer, looked, lambda viewer: (viewer.show(q), viewer.save(path / "x.html")))
    viewer = Viewer(ask.scene)
    viewer.play([q, q + 0.1], 0.1)
    yield "Viewer.show", Call(viewer.show, {"q": q, "problem": ask})
    motion = {"motion": [q, q], "dt": 0.1, "problem": ask, "ghost": [q, q], "repeat": 1}
    yield "Viewer.play", Call(viewer.play, motion)
    yield "Viewer.ghosts", Call(viewer.ghosts, {"postures": [q], "color": (1.0, 0.0, 0.0, 1.0)})
    yield "Viewer.frames", Call(viewer.frames, {"names": ["link1"], "length": 0.1}, lambda _: viewer.show(q))
    yield "Viewer.color", Call(viewer.color, {"segments": {"link1": (1.0, 0.0, 0.0)}}, lambda _: viewer.show(q))
    yield "Viewer.look", Call(viewer.look, {"eye": at, "target": (0.0, 0.0, 0.0)}, lambda _: viewer.show(q))
    yield "Viewer.save", Call(viewer.save, {"path": path / "x.html"})

    followed = {
        "scene": there,
        "track": track,
        "overlap": "qp",
        "seed": 0,
        "rigid": False,
        "progress": print,
        "moves": None,
    }
    yield "follow", Call(tracking.follow, followed)
    loop = {"scene": there, "start": q, "overlap": "qp", "dt": 0.1, "seed": 0, "rigid": False, "touching": ["ball"]}
    loop["give_way"] = "both"
    yield "FrameLoop", Call(tracking.FrameLoop, loop, lambda made: made.frame(q))
    yield "FrameLoop.frame", Call(tracking.FrameLoop(there, q).frame, {"tracked": q})
    recording = tracking.follow(there, track)
    yield "judge", Call(tracking.judge, {"scene": there, "recording": recording})
    moved = {"figure": arm, "roots": None, "angles": {"joint1": [0.1]}, "posture": q, "dt": 0.1, "name": "it"}
    yield "posed", Call(wb.motion.posed, moved)
    yield "posed(angle)", Call(lambda v: wb.motion.posed(arm, angles={"joint1": v}, dt=0.1), {"v": [0.1, 0.2]})
    hand = human()
    yield "posed(roots)", Call(lambda v: wb.motion.posed(hand, roots=v, dt=0.1), {"v": [at, at]})
    yield "gallery", Call(tracking.gallery, {"figure": hand})
    yield "build_scene", Call(tracking.build_scene, {"name": "hand_on_table", "frames": 3, "seed": 0, "dt": 0.1})
    along = {"problem": ask, "places": places, "method": "qp", "goal": 0, "dt": 0.1, "progress": print}
    yield "drag_along", Call(tracking.drag_along, along)
    done = tracking.drag_along(ask, places, "qp")
    yield "judge_drag", Call(tracking.judge_drag, {"problem": ask, "dragged": done, "goal": 0})
    clip = wb.Clip(arm, [q, q + 0.1], 0.1)  # type: ignore[arg-type]
    yield "Clip", Call(wb.Clip, {"figure": arm, "q": [q, q], "dt": 0.1, "name": "it"}, lambda made: made.velocities())
    yield "Clip.at", Call(clip.at, {"t": 0.05})
    yield "Clip.resampled", Call(clip.resampled, {"dt": 0.05})
    yield "Clip.joined", Call(clip.joined, {"other": clip})
    pair_of = wb.Scene({"one": arm, "two": arm}).figure
    yield "Clip.part", Call(wb.Clip(pair_of, [pair_of.neutral], 0.1).part, {"name": "two"})
    yield "Clip.with_q", Call(clip.with_q, {"q": [q]})
    yield "Clip.plot", Call(clip.plot, {"joints": arm.joints[:2]})
    yield "Clip.write", Call(clip.write, {"path": path / "clip.npz"})
    for method in ("mirrored", "velocities", "accelerations"):
        yield f"Clip.{method}", Call(getattr(wb.Clip(hand, [hand.neutral], 0.1), method), {})  # type: ignore[arg-type]
    strong = {"percentile": 50.0, "sex": "female", "age": 50.0}
    yield "Strength", Call(wb.motion.Strength, strong, lambda made: made.limits(arm))
    yield "Strength.limits", Call(wb.motion.Strength().limits, {"figure": arm})
    found = wb.motion.torques(clip)
    yield "Torques.joint_of", Call(found.joint_of, {"column": 0})
    yield "Torques.largest", Call(found.largest, {})
    yield (
        "torques",
        Call(
            wb.motion.torques,
            {
                "clip": clip,
                "scene": wb.Scene(clip.figure),
                "friction": 0.5,
                "cutoff": 6.0,
                "strength": wb.motion.Strength(),
                "feet": ["link1"],
            },
        ),
    )
    yield "Clip(frames)", Call(lambda frames: clip[frames], {"frames": slice(0, 1)})
    clip.write(path / "walk.npz")
    (path / "walk.bvh").write_text(BVH)
    skeleton = wb.motion.read_skeleton(path / "walk.bvh")
    yield "read_skeleton", Call(wb.motion.read_skeleton, {"path": path / "walk.bvh", "unit": "metres", "up": "y"})
    moving_skeleton = {
        "names": ("hips", "head"), "parents": [-1, 0], "offsets": np.zeros((2, 3)),
        "dt": 0.1, "name": "it", "notes": (),
        "rotations": np.tile(np.eye(3), (3, 2, 1, 1)), "positions": np.zeros((3, 2, 3)),
    }  # fmt: skip
    yield "SkeletonMotion", Call(wb.motion.SkeletonMotion, moving_skeleton, lambda made: made.rest())
    yield "SkeletonMotion.resized", Call(skeleton.resized, {"factor": 2.0})
    yield "SkeletonMotion.part", Call(skeleton.part, {"first": 0, "last": 1})
    local = {**moving_skeleton, "local": np.tile(np.eye(3), (3, 2, 1, 1)), "root": np.zeros((3, 3))}
    del local["rotations"], local["positions"]
    yield "SkeletonMotion.moved", Call(wb.motion.SkeletonMotion.moved, local)
    yield "SkeletonMotion.rest", Call(skeleton.rest, {})
    bones = {
        "skeleton": {"left_wrist": "a", "left_elbow": "b"},
        "figure": {"left_wrist": "link4", "left_elbow": "link2"},
    }
    yield "retarget", Call(wb.retarget, {"motion": skeleton, "figure": arm, "names": bones, "progress": print})
    fed = {"motion": skeleton, "figure": arm, "scene": wb.Scene(arm), "ground": None, "names": bones}
    yield "Retargeter", Call(wb.motion.Retargeter, fed)
    yield "Retargeter.push", Call(lambda motion: wb.motion.Retargeter(**fed).push(motion), {"motion": skeleton})
    yield "Retargeter.finish", Call(wb.motion.Retargeter(**fed).finish, {})
    errors = {"motion": skeleton, "clip": wb.retarget(skeleton, arm, names=bones), "names": bones}
    errors["scene"] = wb.Scene(arm)
    yield "bone_errors", Call(wb.motion.bone_errors, errors)
    named = {"skeleton": {"left_ankle": "a"}, "figure": {"left_ankle": "link4"}}
    yield "ground", Call(wb.motion.ground, {"motion": skeleton, "names": named, "scene": wb.Scene(arm)}, str)
    stood = wb.motion.ground(skeleton, named)
    yield "Ground.below", Call(stood.below, {"frames": 3})
    yield "Ground.chart", Call(stood.chart, {"path": path / "ground.png"})
    paced = {"velocity": 1.0, "acceleration": 5.0, "dt": 0.1}
    yield "Pace", Call(wb.planning.Pace, paced, lambda made: made.fastest(arm))
    yield "Pace.fastest", Call(wb.planning.Pace().fastest, {"figure": arm})
    planned = {"start": q, "goal": q + 0.1, "constraints": (), "clearance": 0.0, "pace": None, "seed": 0}
    yield "plan", Call(partial(wb.plan, there, time_limit=1.0), planned)
    yield "plan(scene)", Call(lambda **given: wb.plan(start=q, goal=q, **given), {"scene": there, "time_limit": 1.0})
    yield "read_clip", Call(wb.read_clip, {"path": path / "walk.npz", "figure": arm})
    checked = {"clip": clip, "scene": wb.Scene(arm), "depth": 1e-3, "progress": lambda done: None}
    yield "check", Call(wb.check, checked, lambda found: found.as_dict())
    avoided = {"clip": clip, "scene": wb.Scene(arm), "constraints": [], "progress": lambda told: None}
    yield "avoid", Call(wb.avoid, {**avoided, "method": "bisection", "hold_feet": False, "dynamics": False})
    yield "avoid", Call(wb.avoid, {**avoided, "method": "bisection"})
    many = {"clips": [], "folder": path / "many", "equipment": ["nothing"], "methods": ["bisection"], "jobs": 1}
    yield "avoid_many", Call(wb.motion.avoid_many, {**many, "hold_feet": True, "progress": print})
    given = {"clips": [clip], "constraints": []}
    yield "avoid_many(case)", Call(partial(wb.motion.avoid_many, folder=path / "many", methods=["bisection"]), given)
    yield "avoid_many(figure)", Call(partial(wb.motion.avoid_many, ["walk.npz"], path / "many"), {"figure": arm})
    clip.write(path / "read.npz")
    files = {"files": [], "folder": path / "many", "jobs": 1, "progress": print}
    yield "read_many", Call(partial(wb.motion.read_many, figure=arm), files)
    yield "read_many(figure)", Call(partial(wb.motion.read_many, [path / "read.npz"], path / "many"), {"figure": arm})
    at_once: dict[str, Any] = {"method": "qp", "jobs": 1, "seconds": 9.0, "warm_start": True}
    at_once |= {"folder": path / "records", "progress": lambda told: True}
    yield "solve_many", Call(wb.solve_many, {"problems": [], **at_once})
    several = {"most": 2, "apart": 0.2, "starts": 2, "seed": 0, "time_limit": 1.0}
    yield "solutions", Call(wb.solutions, {"problem": ask, **several}, str)
    listed = {"answers": (), "found": 0, "descents": 0, "starts": 0, "complete": False, "ended": ""}
    yield "Solutions", Call(Solutions, listed)
    yield "QP.minima", Call(wb.methods.QP().minima, {"problem": ask, "starts": [ask.start]}, list)
    varied = {"task": path / "task.toml", "layouts": {"as it is": {}}}
    yield "study", Call(partial(wb.study, progress=lambda told: True), varied)
    anything = {"people": [arm], "targets": [places[0]], "layouts": [None], **at_once}
    yield "study(function)", Call(partial(wb.study, lambda *given: ask), anything)
    grid = {"problem": ask, "frame": "link4", "low": (0.1, 0.1, 1.0), "high": (0.2, 0.1, 1.0), "step": 0.1}
    grid |= {"offset": (0.0, 0.0, 0.1), "jobs": 1, "progress": lambda *told: True}

    def map_it(progress: Any, **given: Any) -> Any:  # `str` of two numbers raises an error of its own
        return wb.reach_map(**given, progress=grid["progress"] if progress is str else progress)

    yield "reach_map", Call(map_it, grid, repr)
    mapped = wb.reach_map(**grid)
    for write, ending in ((mapped.save, "npz"), (mapped.to_vtk, "vtk"), (mapped.picture, "png"), (mapped.html, "html")):
        yield f"ReachMap.{write.__name__}", Call(write, {"path": path / f"reach.{ending}"})
    yield "ReachMap.plot", Call(mapped.plot, {})
    yield "ReachMap.counts", Call(mapped.counts, {})
    kept = wb.studies.Records([wb.studies.SolveRecord("a")])
    yield "Records.counts", Call(kept.counts, {})
    yield "Records.remarks", Call(kept.remarks, {})
    yield "Records.rows", Call(kept.rows, {})
    yield "Records.plot", Call(kept.plot, {})
    yield "Records.chart", Call(kept.chart, {"path": path / "records.png"})
    yield "Records.to_csv", Call(kept.to_csv, {"path": path / "records.csv"})
    yield "people", Call(wb.people, {"count": 2, "sex": "male", "seed": 1})
    yield "people(percentiles)", Call(wb.people, {"percentiles": [5, 95]})
    yield "boundary", Call(wb.boundary, {"confidence": 0.9, "dimensions": ["stature"], "sex": "male"})
    counted = {"task": path / "person.toml", "sees": (1.0, 0.0, 1.0), "people": wb.people(1, "male")}

    def accommodation(people: Any, **others: Any) -> Any:
        some = counted["people"] if people is None else people  # which stands for a hundred people
        return wb.accommodation(people=some, jobs=1, progress=lambda told: True, **others)

    yield "accommodation", Call(accommodation, counted)
    of_one = wb.studies.Records([wb.studies.SolveRecord("a", q=np.zeros(1))])
    sizes = ({"stature": 1.8, "mass": 80.0},)
    judged = wb.studies.Accommodation(of_one, ("male",), sizes, (True,), (True,), None)
    yield "Accommodation.plot", Call(judged.plot, {})
    upright, work = person.figure.neutral, wb.ergonomics.Work(load=5.0)
    posed = {"figure": person.figure, "q": upright, "work": work}
    for judge in (wb.ergonomics.rula, wb.ergonomics.reba, wb.ergonomics.owas):
        yield judge.__name__, Call(judge, posed)
    yield "ergonomics_of", Call(wb.ergonomics.ergonomics_of, {**posed, "strength": wb.motion.Strength()})
    yield (
        "body_angles",
        Call(wb.ergonomics.body_angles, {"figure": person.figure, "q": upright}, lambda made: made.side("left")),
    )
    yield (
        "static_torques",
        Call(wb.ergonomics.static_torques, {"figure": person.figure, "q": upright, "load": 5.0, "seated": True}),
    )
    pressed = {"figure": person.figure, "q": upright, "forces": [wb.Force("left_palm", (0.0, 0.0, -10.0))]}
    yield "back_compression", Call(wb.ergonomics.back_compression, pressed)
    scored = wb.ergonomics.ergonomics_of(person.figure, upright)
    yield "BodyAngles.side", Call(scored.angles.side, {"name": "left"})
    yield "StaticTorques.of_side", Call(scored.torques.of_side, {"side": "left"})
    yield "Ergonomics.rows", Call(scored.rows, {})
    yield "Ergonomics.summary", Call(scored.summary, {})
    yield "Ergonomics.colors", Call(scored.colors, {"figure": person.figure})
    yield "Work.sits", Call(work.sits, {"angles": scored.angles})
    yield "FieldOfView.off", Call(wb.ergonomics.FieldOfView().off, {"direction": (1.0, 0.0, 0.0)})
    lifted = {"figure": person.figure, "origin": upright, "destination": upright, "floor": 0.1}
    yield "lift_between", Call(wb.ergonomics.lift_between, lifted)
    lift = {"horizontal": 0.3, "vertical": 0.7, "travel": 0.3, "asymmetry": 0.1, "frequency": 1.0, "duration": 1.0}
    yield (
        "Lift",
        Call(wb.ergonomics.Lift, {**lift, "coupling": "good", "load": 5.0}, lambda made: (made.limit, made.index)),
    )
    yield "Work", Call(wb.ergonomics.Work, {"load": 5.0, "static": True, "coupling": "good", "seated": None})
    yield (
        "sight",
        Call(
            wb.ergonomics.sight,
            {"scene": person, "q": upright, "point": (1.0, 0.0, 1.5)},
        ),
    )
    cone = {"horizontal": 0.5, "up": 0.5, "down": 0.5, "declination": 0.2}
    yield "FieldOfView", Call(wb.ergonomics.FieldOfView, cone, lambda made: made.off(np.array((1.0, 0.0, 0.0))))
    for parts in (wb.ergonomics.RulaParts, wb.ergonomics.RebaParts):
        ones = dict.fromkeys(parts.__dataclass_fields__, 1)
        yield parts.__name__, Call(parts, ones, lambda made: made.score)
    yield "Owas", Call(wb.ergonomics.Owas, {"back": 1, "arms": 1, "legs": 1, "load": 1}, lambda made: made.category)
    record = wb.studies.SolveRecord("a")
    yield (
        "Records",
        Call(wb.studies.Records, {"records": [record]}, lambda made: (repr(made), made.counts(), made.rows())),
    )
    settings: dict[str, Any] = {"clearance": 0.01, "time": 0.1, "margin": 0.5}
    settings |= {"stretch": 1.5, "dynamics": wb.motion.Strength()}
    yield "Trajectory", Call(wb.motion.Trajectory, settings)
    bisection = {
        "evaluation": (0,), "buffer": 20.0, "least": 2, "interpolation": "linear", "planes": ("tool",), "frozen": (),
        "room": 0.01, "method": "qp",
    }  # fmt: skip
    yield "Bisection", Call(wb.motion.Bisection, bisection)
    worn = {"name": "bag", "shape": wb.Sphere(0.1), "to": "link2", "at": at, "rests_on": ("link1",), "color": None}
    yield "Equipment", Call(wb.motion.Equipment, worn, lambda made: made.attach(wb.Scene(arm)))
    bag = wb.motion.Equipment("bag", wb.Box((0.1, 0.1, 0.1)), "link2")
    yield "Equipment.filled", Call(bag.filled, {"count": 1, "envelope": False})
    yield "Equipment.attach", Call(lambda scene: bag.attach(scene), {"scene": wb.Scene(arm)})
    put = {"shape": wb.Sphere(0.1), "figure": hand, "name": "bag", "to": "left_hand", "side": "back"}
    put |= {"middle": (0.0, 0.0), "color": None}
    yield "Equipment.worn", Call(wb.motion.Equipment.worn, put)
    yield "equipment", Call(wb.motion.equipment, {"name": "pack", "figure": hand})
    yield "fill_with_spheres", Call(fill_with_spheres, {"shape": wb.Sphere(0.1), "count": 1, "envelope": False})
    yield "Spheres", Call(Spheres, {"centers": [[0.0, 0.0, 0.0]], "radii": [0.1]})
    yield "Spheres.pieces", Call(Spheres([[0.0, 0.0, 0.0]], [0.1]).pieces, {})
    stance = {"feet": ["link1"], "speed": 0.1, "height": 0.05, "least": 0.1}
    yield "MotionBounds", Call(wb.motion.MotionBounds, {"jerk": 2.0, "speed": 1.5, "deviation": 0.5, "keep_ends": True})
    yield "StanceFeet", Call(wb.motion.StanceFeet, stance, lambda made: made.names(arm))
    yield "StanceFeet.names", Call(wb.motion.StanceFeet(["link1"]).names, {"figure": arm})
    yield "RestingHands", Call(wb.motion.RestingHands, {"hands": ["link1"]}, lambda made: made.names(wb.Scene(arm)))
    yield "RestingHands.names", Call(wb.motion.RestingHands(["link1"]).names, {"scene": wb.Scene(arm)})
    yield "timeline", Call(timeline, {"found": wb.check(clip), "scene": wb.Scene(arm)})
    pair = {"before": clip, "after": clip}
    for measure in (measures.deviation, measures.jerk_ratio, measures.foot_sliding):
        yield measure.__name__, Call(measure, pair)
    yield "ClipCheck.plot", Call(wb.check(clip).plot, {})
    yield "ClipCheck.as_dict", Call(wb.check(clip).as_dict, {})
    yield "spread", Call(tracking.spread, {"corners": places, "frames": 3, "dt": 0.1})
    yield "circle", Call(tracking.circle, {"center": at, "radius": 0.1, "normal": at})
    yield "read_path", Call(tracking.read_path, {"path": path / "path.txt"})


@cache
def human() -> wb.Figure:
    return wb.load("human")


def public() -> Iterator[tuple[str, Any]]:
    """Names and objects of the reference page, of `wholebody.__all__` and of `wholebody.tracking.__all__`."""
    for entry in re.findall(r"^::: ([\w.]+)$", (ROOT / "docs" / "reference.md").read_text(), re.MULTILINE):
        module, _, name = entry.rpartition(".")
        try:
            found = importlib.import_module(entry)
            yield from ((name, getattr(found, name)) for name in getattr(found, "__all__", ()))
        except ImportError:
            yield name, getattr(importlib.import_module(module), name)
    yield from ((name, getattr(wb, name)) for name in wb.__all__)
    yield from ((name, getattr(tracking, name)) for name in tracking.__all__)


def surface() -> list[str]:
    """Every public function, class and method of a class."""
    found: dict[str, None] = {}
    for name, value in public():
        if not callable(value) or (inspect.isclass(value) and issubclass(value, Exception)):
            continue
        found[name] = None
        for attribute in dir(value) if inspect.isclass(value) else ():
            static = inspect.getattr_static(value, attribute)
            function = getattr(static, "__func__", static)
            if not attribute.startswith("_") and inspect.isfunction(function) and "wholebody" in function.__module__:
                found[f"{name}.{attribute}"] = None
    return list(found)


ANSWERS = (
    "SceneObject", "Contacts", "ObjectPenetration", "FirstContact", "Piece", "Solution", "TraceEntry", "Assessment",
    "Task", "Step", "QPStep", "Simplified", "LeftOut", "Recording", "Judgement", "Dragged", "DragJudgement",
    "InteractionScene", "Wrench", "Recording.of", "Scene.of_parts", "ClipCheck", "Beyond", "Avoided",
    "AvoidanceReport", "Contact", "Sliding", "Deviation", "Torques", "SphereFilling", "AssemblySolution",
    "AssemblyStep", "SolveRecord", "SolveRecord.of", "SolveRecord.row", "SolveRecord.as_json",
    "SolveRecord.from_json", "SolveProgress", "ReachMap", "Accommodation", "Ergonomics",
    "BodyAngles", "Rula", "Reba", "StaticTorques", "Sight", "Result", "Contacts.joined", "DerivativeCheck",
    "AvoidedCase", "BatchProgress", "Ground", "Plan", "WorldFrame", "Overlap", "EngineFrame", "Event",
)  # fmt: skip
"""What calls return: nobody builds it, so its constructor is not fed."""

OF_METHODS = ("QPTracker", "NewtonTracker", "SolvingTracker")
"""What `tracker` of a method builds; and workspaces, which a run has to itself, are for methods of one's own."""

BY_OWNERS = ("Trajectory.avoid", "Bisection.avoid", "QP.batches", "Actuated.check", "Actuated.gains")
"""Called by `avoid`, `solve_many` and a world alone, with what they set up."""

DERIVATIVES = (
    "of_arms",
    "on_points",
    "posed",
    "place_of",
    "companion",
    "folded",
    "spread",
    "resolve",
    "error",
    "jacobian",
    "value",
    "gradient",
    "curvature",
    "curvature_of",
    "expansion",
    "squares",
    "braking",
    "bounds",
    "parts",
    "rows",
    "dense_jacobian",
    "wrench_jacobian",
    "supporting_planes",
    "value_and_jacobian",
    "nearest_points",
    "placed",
    "bounded",
    "warn_of_angles",
    "squared",
)
"""What problems and methods, not people, ask of terms and states; at every posture, which is too often for checks."""

ABSTRACT = (
    "Shape", "Term", "Goal", "Constraint", "AssemblyConstraint", "Bound", "Measure", "Method", "Tracker", "Figure",
)  # fmt: skip
"""Classes to derive from, protocols, and the figure, which `load` builds."""

BROWSER = ["open", "wait", "wait_until_closed", "sync", "picture", "begin_picture", "movie", "close"]
"""Methods of the viewer that need a browser or a server: see tests/view."""


def fed(name: str) -> bool:
    """Whether a name of the surface is fed here."""
    owner, _, method = name.partition(".")
    if name in ANSWERS or (owner == "Viewer" and method in BROWSER) or name == "write_filmstrip":
        return False
    if name in OF_METHODS or name in BY_OWNERS or owner == "Workspace":
        return False
    if method in DERIVATIVES and owner not in ("Assembly", "Records", "Ergonomics"):
        return False
    return owner not in ABSTRACT or (owner == "Figure" and bool(method))


NAMES = [name for name in surface() if fed(name)]
OWNERS = list(dict.fromkeys(name.partition(".")[0] for name in NAMES))


@pytest.fixture(scope="module")
def every(folder: Path) -> dict[str, list[tuple[str, Call]]]:
    """Return all calls by the name of what is called; variants have the same name with something in brackets."""
    q = figure(folder).neutral
    wb.Clip(figure(folder), np.array([q, q]), 0.1).write(folder / "track.csv")
    found: dict[str, list[tuple[str, Call]]] = {}
    for name, call in calls(folder):
        found.setdefault(name.partition("(")[0], []).append((name, call))
    return found


def test_every_public_callable_is_fed(every: dict[str, list[tuple[str, Call]]]) -> None:
    assert sorted(every) == sorted(NAMES)


@pytest.mark.parametrize("owner", OWNERS)
def test_odd_arguments_are_refused_in_one_sentence(
    owner: str, every: dict[str, list[tuple[str, Call]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # an odd path may be a right one
    raw = []
    for variant, call in [one for name in NAMES if name.partition(".")[0] == owner for one in every[name]]:
        call.use(call.function(**call.arguments))
        for argument in call.arguments:
            for label, odd in ODD.items():
                try:
                    call.use(call.function(**{**call.arguments, argument: odd}))
                except wb.WholebodyError as error:
                    if "\n" in str(error) or len(str(error)) > 600:
                        raw.append(f"{variant}, {argument} = {label}: not one short sentence: {error!s:.300}")
                except Exception as error:
                    raw.append(f"{variant}, {argument} = {label}: {type(error).__name__}: {str(error)!r:.100}")
    assert not raw, "\n" + "\n".join(raw[:40])

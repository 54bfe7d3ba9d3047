"""Figures, scenes, problems and answers are pickled and copied whole, and a copy is independent."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.live_world import LiveWorld
from wholebody.tracking.live import LiveDrag
from wholebody.tracking.loop import FrameLoop


def pickled(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


WAYS = pytest.mark.parametrize("way", [pickled, copy.copy, copy.deepcopy], ids=["pickle", "copy", "deepcopy"])
FIGURES: dict[str, Callable[[], wb.Figure]] = {
    "human": lambda: wb.load("human"),
    "hand": lambda: wb.load("hand"),
    "urdf": lambda: wb.load(Path(__file__).parent.parent / "examples" / "tasks" / "arm.urdf"),
    "reduced": lambda: wb.load("human").reduced(["root", "right_shoulder_flexion", "right_elbow_flexion"]),
}


@cache
def loaded(name: str) -> wb.Figure:
    return FIGURES[name]()


def same(one: Any, other: Any) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@WAYS
@pytest.mark.parametrize("name", ["urdf", "reduced"])
def test_a_figure(name: str, way: Callable[[wb.Figure], wb.Figure]) -> None:
    figure = loaded(name)
    made = way(figure)
    assert repr(made) == repr(figure)
    for field in ("joints", "groups", "chains", "frames", "segments", "collision_groups", "excluded_pairs", "notes"):
        assert getattr(made, field) == getattr(figure, field)
    assert list(made.cones) == list(figure.cones)
    assert same([made.posture(q) for q in made.postures], [figure.posture(q) for q in figure.postures])
    assert (made.visual is made.geometry) == (figure.visual is figure.geometry)
    assert same(wb.Scene(made).contacts(made.neutral, 0.2), wb.Scene(figure).contacts(figure.neutral, 0.2))


@pytest.fixture
def scene(tmp_path: Path) -> wb.Scene:
    """Return a human among one thing of each kind, with one in the hand."""
    import trimesh

    made = wb.Scene(loaded("human")).add(wb.HalfSpace(), name="floor")
    for k, shape in enumerate(
        (wb.Box((0.1, 0.2, 0.3)), wb.Sphere(0.1), wb.Capsule(0.05, 0.2), wb.Ellipsoid((0.1, 0.1, 0.2)))
    ):
        made.add(shape, name=f"thing{k}", at=(0.6, 0.4 * k - 0.6, 1.0))
    made.add(wb.Hull(np.random.default_rng(0).normal(size=(12, 3)) * 0.1), name="stone", at=(-0.5, 0.0, 1.0))
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "cube.stl")
    made.add(wb.Mesh(tmp_path / "cube.stl"), name="cube", at=(-0.5, 0.5, 1.0))
    return made.attach(wb.Capsule(0.02, 0.2), to="right_hand", name="tool", at=(0.0, 0.0, -0.1))


@WAYS
@pytest.mark.parametrize("built", [False, True])
def test_a_scene_and_its_copy_do_not_share_things(
    scene: wb.Scene, way: Callable[[wb.Scene], wb.Scene], built: bool
) -> None:
    q = scene.figure.neutral
    if built:
        before = scene.contacts(q, 1.0)
    made = way(scene)
    if not built:
        before = scene.contacts(q, 1.0)
    assert same(made.contacts(q, 1.0), before)
    assert made.excluded_pairs == scene.excluded_pairs
    made.move("thing0", at=(0.5, 0.0, 1.3))
    made.move("tool", at=(0.0, 0.0, -0.2))
    assert same(scene.contacts(q, 1.0), before)
    assert scene.objects["thing0"].placement.translation[2] == pytest.approx(1.0)
    moved = made.contacts(q, 1.0)
    assert not np.array_equal(moved.placements, before.placements)
    made.remove("stone").add(wb.Sphere(0.1), name="new", at=(2.0, 0.0, 1.0))
    assert "stone" in scene.objects
    assert "new" not in scene.objects
    assert same(scene.contacts(q, 1.0), before)
    scene.move("thing1", at=(0.5, 0.0, 1.6))
    assert made.objects["thing1"].placement.translation[2] == pytest.approx(1.0)


def everything(scene: wb.Scene) -> wb.Problem:
    return wb.Problem(
        scene,
        "standing",
        goals=[
            wb.Point("right_index_tip", (0.4, -0.2, 1.1)),
            wb.Frame("left_hand", (0.4, 0.3, 1.0)),
            wb.Orientation("head", (0.0, 0.0, 0.0, 1.0)),
            wb.Axis("head", (1, 0, 0), direction=(1, 0, 0)),
            wb.Axis("thorax", (1, 0, 0), toward=(1, 0, 1)),
            wb.CenterOfMass((0.0, 0.0, 1.0)),
            wb.Posture("t_pose", joints=["neck"]),
            wb.Relative("left_palm", "right_palm", (0.2, 0.0, 0.0)),
            wb.Posture("standing"),
        ],
        constraints=[
            wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Plane("pelvis", (0, 0, 1)), wb.Balance(),
            wb.tasks.ReachCones(), wb.Freeze("left_toe_extension"), wb.tasks.StepLimit(2.0),
        ],
        measures=[wb.Effort(), wb.tasks.Discomfort(), wb.tasks.Displacement(), wb.tasks.PotentialEnergy()],
        clearance=0.004,
        touching=[("left_hand", "thing0")],
    )  # fmt: skip


@WAYS
def test_a_problem_with_every_kind_of_term(scene: wb.Scene, way: Callable[[wb.Problem], wb.Problem]) -> None:
    problem = everything(scene)
    made = way(problem)
    assert (made.scene is scene) == (way is copy.copy)
    for q in (problem.start, scene.figure.posture("sitting")):
        assert wb.assess(made, q) == wb.assess(problem, q)
    with problem.borrow() as workspace, made.borrow() as other:
        ours, theirs = (
            one.lineariser(room, 0.01).at(problem.start, 0.1) for one, room in ((problem, workspace), (made, other))
        )
    for field in ("goal_error", "goal_jacobian", "value", "value_jacobian", "gap", "gap_jacobian", "gradient", "upper"):
        assert np.array_equal(getattr(ours, field), getattr(theirs, field))
    made.retarget([wb.Point("right_index_tip", (0.5, -0.2, 1.1))])
    assert len(problem.goals) == 9


def solved(problem: wb.Problem) -> wb.Solution:
    return wb.methods.QP(budget=0).solve(problem)


def test_a_simplified_problem_and_its_scene(scene: wb.Scene) -> None:
    whole = wb.Problem(
        scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.1))], constraints=[wb.Hold("left_foot")],
        measures=[wb.tasks.PotentialEnergy()],
    )  # fmt: skip
    small = wb.simplify(whole)
    made = pickled(small)
    assert np.array_equal(solved(made.problem).q, solved(small.problem).q)
    assert np.array_equal(made.restored(solved(made.problem)).q, solved(small.problem).q)
    part = copy.copy(small.problem.scene)
    assert len(part.geometry.collisionPairs) == len(small.problem.scene.geometry.collisionPairs)


@pytest.mark.parametrize(
    "method",
    [
        wb.methods.QP(solver="daqp", seed=3),
        wb.methods.CCD(),
        wb.methods.Newton(seed=1),
        wb.methods.Placo(),
        wb.methods.DampedLeastSquares(),
    ],
)
def test_settings_of_methods(method: Any) -> None:
    assert pickled(method) == copy.copy(method) == copy.deepcopy(method) == method


def test_a_state_is_computed_anew(scene: wb.Scene) -> None:
    state = scene.state(scene.figure.posture("sitting"))
    made = pickled(state)
    assert np.array_equal(made.jacobian, state.jacobian)
    made.update(scene.figure.neutral)
    assert not np.array_equal(made.jacobian, state.jacobian)


@WAYS
def test_an_assembly_and_its_copy_do_not_share_bodies(way: Callable[[wb.Assembly], wb.Assembly]) -> None:
    assembly = wb.Assembly().body("crank").body("bar", (0.3, 0.0, 0.0))
    assembly.revolute("world", "crank", at=(0, 0, 0), axis=(0, 0, 1))
    assembly.revolute("crank", "bar", at=(0.3, 0, 0), axis=(0, 0, 1))
    assembly.point_goal("bar", (0.2, 0.2, 0.0))
    assembly.solve()  # which prepares what is not copied
    before = assembly.placement("bar").homogeneous
    made = way(assembly)
    assert np.array_equal(made.placement("bar").homogeneous, before)
    made.point_goal("crank", (0.0, 0.0, 0.0), place=(0.0, 0.0, 0.0))
    made.body("loose")
    made.solve()
    assert assembly.bodies == ("crank", "bar")
    assert np.array_equal(assembly.placement("bar").homogeneous, before)


@pytest.mark.parametrize("way", [pickled, copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"])
@pytest.mark.parametrize("method", [wb.methods.QP(), wb.methods.Newton(), None], ids=["qp", "newton", "world"])
def test_what_belongs_to_a_run_is_neither_pickled_nor_copied(way: Callable[[Any], Any], method: Any) -> None:
    scene = wb.Scene(loaded("hand"))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.0, 0.0, 0.1))])
    if method is None:
        scene.add(wb.Sphere(0.02), name="ball", at=(0.5, 0.0, 0.1), body=wb.Body(mass=1.0))
        world = wb.World(scene, dt=0.01)
        held: list[Any] = [world, world.engine, FrameLoop(scene, scene.figure.neutral), LiveWorld(scene)]
    else:
        held = [method.tracker(problem, 0.01), wb.tracking.Drag(problem), LiveDrag(problem)]
    for thing in held:
        with pytest.raises(wb.InputError, match="cannot be pickled or copied"):
            way(thing)

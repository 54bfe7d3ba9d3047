"""A problem that is written as a task file and read again is the same problem; results likewise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State

EVERYTHING = Path(__file__).parents[1] / "data" / "tasks" / "everything.toml"


def same(first: wb.Problem, second: wb.Problem) -> None:
    np.testing.assert_allclose(first.start, second.start, atol=1e-12)
    assert first.scene.piece_names == second.scene.piece_names
    assert first.touching == second.touching
    for ours, theirs in zip(first.scene.geometry.geometryObjects, second.scene.geometry.geometryObjects, strict=True):
        np.testing.assert_allclose(ours.placement.homogeneous, theirs.placement.homogeneous, atol=1e-12)
        assert ours.geometry == theirs.geometry
    for name, thing in first.scene.objects.items():
        assert second.scene.objects[name].color == thing.color
        assert second.scene.objects[name].body == thing.body
    np.testing.assert_allclose(first.clearances, second.clearances, atol=1e-9)
    q = pin.integrate(first.scene.model, first.start, 0.1 * np.sin(np.arange(first.scene.model.nv)))
    state = State(first.scene.model).update(q)
    for mine, other in zip((*first.goals, *first.constraints), (*second.goals, *second.constraints), strict=True):
        assert type(mine) is type(other)
        values = [np.atleast_1d(t.error(state) if isinstance(t, wb.Goal) else t.value(state)) for t in (mine, other)]
        np.testing.assert_allclose(*values, atol=1e-9)
    for low, high in zip(first.bounds, second.bounds, strict=True):
        np.testing.assert_allclose(low.bounds(state, None), high.bounds(state, None))
    for ours_, theirs_ in zip(first.measures, second.measures, strict=True):
        assert ours_.weight * ours_.value(state) == pytest.approx(theirs_.weight * theirs_.value(state))


def test_everything_goes_round(tmp_path: Path) -> None:
    problem = wb.read_task(EVERYTHING).problem
    path = wb.taskfile.write_task(problem, tmp_path / "again.toml", title='a "title"')
    again = wb.read_task(path)
    assert again.title == 'a "title"'
    same(problem, again.problem)


def test_a_problem_of_a_script_goes_round(tmp_path: Path, root: Path) -> None:
    """Holds take their placement at the start; a mesh of arrays goes into a file beside the task."""
    import trimesh

    arm = root / "examples" / "tasks" / "arm.urdf"
    scene = wb.Scene(wb.load(arm))
    scene.add(wb.Mesh(trimesh.creation.icosahedron()), name="rock one", at=(0.9, 0.4, 0.2), color="tomato")
    scene.add(wb.Sphere(0.05), name="ball", at=(1.5, 0, 1), body=wb.Body(mass=0.3, velocity=(1, 0, 0)))
    q = scene.figure.posture(scene.figure.postures[0]) + 0.1
    q = scene.figure.clamp(q)
    tip = scene.figure.segments[-1]
    problem = wb.Problem(scene, q, goals=[wb.Point(tip, (0.4, 0.1, 0.6))], constraints=[wb.Plane(tip, (0, 1, 0))])
    path = wb.taskfile.write_task(problem, tmp_path / "task.toml")
    same(problem, wb.read_task(path).problem)
    assert (tmp_path / "task-rock_one.obj").exists()


@pytest.mark.parametrize(
    "asked", [{"range_of_motion": False}, {"balance": True}, {"range_of_motion": False, "balance": False}]
)
def test_what_a_person_keeps_by_default_goes_round(tmp_path: Path, asked: dict[str, bool]) -> None:
    problem = wb.Problem(wb.Scene(wb.load("human")), goals=[wb.Point("right_palm", (0.4, -0.2, 1.2))], **asked)
    again = wb.read_task(wb.taskfile.write_task(problem, tmp_path / "task.toml")).problem
    same(problem, again)
    assert [type(term) for term in again.defaults] == [type(term) for term in problem.defaults]
    assert (wb.tasks.RangeOfMotion in map(type, again.defaults)) == asked.get("range_of_motion", True)


def test_joints_of_things_go_round(tmp_path: Path) -> None:
    hinge = wb.dynamics.Hinge((0.0, -0.4, 0.0), axis=(0.0, 0.3, 0.4))
    door = wb.Body(mass=12.0, joints=[hinge], angular_velocity=(0.0, 0.0, 1.5))
    rope = wb.Body(
        density=300.0,
        joints=[wb.dynamics.BallJoint((0.0, 0.0, 0.5), to="beam"), wb.dynamics.BallJoint((0.0, 0.0, -0.5))],
    )
    scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 1.0, 0.1)), name="beam", at=(2.0, 0.0, 2.0))
    scene.add(wb.Box((0.04, 0.8, 2.0)), name="door", at=(3.0, 0.0, 1.0), body=door)
    scene.add(wb.Capsule(0.01, 0.9), name="rope", at=(2.0, 0.0, 1.4), body=rope)
    again = wb.read_task(wb.taskfile.write_task(scene, tmp_path / "door.toml")).problem.scene
    for name in ("door", "rope"):
        assert again.objects[name].body == scene.objects[name].body


def test_forces_and_strength_go_round(tmp_path: Path) -> None:
    pushed, who = [wb.Force("left_palm", (-90.0, 0.0, 5.0))], wb.motion.Strength(20, "female")
    problem = wb.Problem(
        wb.Scene(wb.load("human")),
        constraints=[wb.ergonomics.LoadedBalance(pushed), wb.ergonomics.StrengthLimit(pushed, strength=who, share=0.8)],
        measures=[wb.ergonomics.Exertion(pushed, weight=2.0)],
    )
    again = wb.read_task(wb.taskfile.write_task(problem, tmp_path / "pushed.toml")).problem
    state = problem.scene.state(problem.start)
    for mine, theirs in zip(problem.constraints, again.constraints, strict=True):
        np.testing.assert_array_equal(mine.value(state), theirs.value(state))
    assert again.measures[0].weight * again.measures[0].value(state) == 2.0 * problem.measures[0].value(state)


def test_whose_strength_it_is_goes_round(tmp_path: Path) -> None:
    scene = wb.Scene({"anna": wb.load("human", sex="female"), "ben": (wb.load("human"), (0.0, 1.0, 0.0))})
    limit = wb.ergonomics.StrengthLimit([wb.Force("ben/left_palm", (0.0, 0.0, -90.0))], person="ben")
    problem = wb.Problem(scene, constraints=[limit], measures=[wb.ergonomics.Exertion(person="anna")])
    path = wb.taskfile.write_task(problem, tmp_path / "two.toml")
    same(problem, wb.read_task(path).problem)
    path.write_text(path.read_text().replace('person = "ben"', 'person = "bne"'))
    with pytest.raises(wb.UnknownNameError, match="did you mean ben"):
        wb.read_task(path)


def test_the_field_of_a_look_goes_round_and_a_balance_without_forces(tmp_path: Path) -> None:
    look = wb.ergonomics.Look((1.0, 0.2, 0.3), view=wb.ergonomics.FieldOfView(horizontal=0.1, down=0.2))
    problem = wb.Problem(wb.Scene(wb.load("human")), constraints=[look, wb.ergonomics.LoadedBalance([])])
    again = wb.read_task(wb.taskfile.write_task(problem, tmp_path / "look.toml")).problem
    same(problem, again)
    assert again.constraints[0].view == look.view  # type: ignore[attr-defined]


def test_a_scene_alone_and_a_result(tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("human", sex="female", stature=1.6)).add(wb.HalfSpace(), name="floor")
    task = wb.read_task(wb.taskfile.write_task(scene, tmp_path / "scene.toml"))
    assert (task.problem.goals, task.problem.constraints) == ((), task.problem.defaults)
    solution = wb.solve(task.problem)
    result = wb.taskfile.read_result(wb.taskfile.write_result(task, solution, tmp_path / "result.json"))
    np.testing.assert_array_equal(result.q, solution.q)
    assert (result.status, result.message, result.method) == (solution.status, solution.message, solution.method)


def test_proportions_age_shoes_and_clothing_are_written(tmp_path: Path) -> None:
    own = {"sitting_height": 0.95, "hand_length": 0.2}
    figure = wb.load("human", percentile=75, proportions=own, age=50, shoes=0.02, clothing=0.01)
    again = wb.read_task(wb.taskfile.write_task(wb.Scene(figure), tmp_path / "scene.toml")).problem.scene.figure
    assert again.describe().person == figure.describe().person
    assert again.describe().person.age == 50.0


def test_mounted_figures_go_round(tmp_path: Path, root: Path) -> None:
    arm = wb.load(root / "examples" / "tasks" / "arm.urdf")
    tip, hand = arm.segments[-1], wb.load("hand", side="left")
    held = arm.mounted(hand, on=tip, name="grip", at=(0.0, 0.02, 0.1, 0.0, 0.6, 0.0, 0.8))
    more = held.mounted(arm, on="grip/left_palm", name="more")
    for scene in (wb.Scene(more), wb.Scene({"a": (held, (0.0, 2.0, 0.0)), "b": wb.load("avatar"), "c": more})):
        problem = wb.Problem(scene)
        path = wb.taskfile.write_task(problem, tmp_path / "again.toml")
        again = wb.read_task(path).problem
        assert again.scene.figure.joints == scene.figure.joints
        same(problem, again)


def test_what_a_task_file_cannot_say_is_named(tmp_path: Path) -> None:
    figure = wb.load("human")
    with pytest.raises(wb.InputError, match="reduced"):
        wb.taskfile.write_task(wb.Scene(figure.reduced(["right_arm"])), tmp_path / "a.toml")
    problem = wb.Problem(wb.Scene(figure), constraints=[wb.tasks.StepLimit()])
    with pytest.raises(wb.InputError, match=r"constraints\[0\] is a StepLimit"):
        wb.taskfile.write_task(problem, tmp_path / "a.toml")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def told(recwarn: Any) -> Any:
    return lambda: [str(entry.message) for entry in recwarn if entry.category is UserWarning]


def test_a_figure_that_nothing_holds_is_told_of(told: Any) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    goal = wb.Point("right_index_tip", (1.5, -0.3, 1.2))
    assert wb.solve(wb.Problem(scene, goals=[goal])).status == "solved"
    assert "nothing holds the figure: its root moved" in told()[0]


def test_a_figure_that_is_held_is_not(told: Any) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    goal = wb.Point("right_index_tip", (0.5, -0.3, 1.2))
    wb.solve(wb.Problem(scene, goals=[goal], constraints=[wb.Hold("left_foot")]))
    assert not told()


def test_what_is_mounted_with_something_on_it_is_to_be_mounted_one_after_the_other(tmp_path: Path) -> None:
    def rim() -> wb.Figure:
        return wb.figures.adjustable({"rim": wb.Torus(0.1, 0.01)}, tilt=(-0.1, 0.1))

    person, goals = wb.load("human"), [wb.Point("left_palm", (0.4, 0.2, 1.0))]
    nested = person.mounted(rim().mounted(rim(), on="rim", name="b"), on="head_top", name="a")
    with pytest.raises(wb.InputError, match=r"mounted itself.*one figure after the other"):
        wb.taskfile.write_task(wb.Problem(wb.Scene(nested), goals=goals), tmp_path / "nested.toml")
    after = person.mounted(rim(), on="head_top", name="a").mounted(rim(), on="a/rim", name="b")
    written = wb.taskfile.write_task(wb.Problem(wb.Scene(after), goals=goals), tmp_path / "after.toml")
    assert wb.read_task(written).problem.scene.figure.joints == after.joints

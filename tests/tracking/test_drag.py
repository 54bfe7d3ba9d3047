"""Dragging with every method."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.needs import each
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.methods import control


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def _problem(scene: wb.Scene) -> wb.Problem:
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", _circle(0.0))], constraints=holds)


def _circle(angle: float) -> tuple[float, float, float]:
    return 0.45, -0.25 + 0.1 * np.sin(angle), 1.05 - 0.1 * np.cos(angle)


@pytest.mark.parametrize("method", ["newton", "qp", "ccd"])
def test_a_drag_follows_and_ends_exactly(scene: wb.Scene, method: str) -> None:
    problem = _problem(scene)
    drag = wb.tracking.Drag(problem, method)
    for _ in range(12):
        drag.to(_circle(0.0))
    frames = [drag.to(_circle(0.05 * k)) for k in range(30)]
    assert max(frame.error for frame in frames) < 0.01
    last = drag.finish()
    assert last.solved
    assert last.assessment.goal_error < 1.1e-5
    assert last.assessment.constraint_violation < 1.1e-5
    assert wb.assess(problem, last.q).goal_error > 0.05  # the caller's own goal has not moved
    assert np.array_equal(drag.q, last.q)


@pytest.mark.parametrize("method", ["newton", "qp"])
def test_a_hand_is_not_dragged_through_a_plate(method: str, before_plate: Callable[..., wb.Problem]) -> None:
    """The goal goes through a plate of 6 mm in steps of 40 mm, and the hand stays on its side."""
    problem = before_plate((0.8, 0.8), 0.55, 1.2)
    scene = problem.scene
    drag = wb.tracking.Drag(problem, method)
    postures = [drag.to((0.4, -0.2, 1.2)).q for _ in range(6)]
    assert drag.to((0.4, -0.2, 1.2)).error < 2e-3
    postures += [drag.to((0.4, y, 1.2)).q for y in np.arange(-0.2, 0.2, 0.04)]
    postures.append(drag.finish().q)
    for before, after in itertools.pairwise(postures):
        assert wb.assess(problem, after).penetration < 3e-4
        hit = scene.sweep(before, after, 1e-3)
        assert hit is None
    tip = scene.state(postures[-1]).data
    frame = scene.model.frames[scene.frame_id("right_index_tip")]
    assert tip.oMi[frame.parentJoint].act(frame.placement.translation)[1] < 0.0


@pytest.mark.parametrize("method", each(["qp", "newton", "ccd"]))
def test_frames_whose_time_is_spent_are_free_and_arrive(
    scene: wb.Scene, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The goal goes into a block, then before it.

    Clocks are read ten times a frame.
    """
    problem = _problem(wb.Scene(scene.figure).add(wb.Box((0.3, 0.4, 0.2)), name="block", at=(0.5, -0.25, 0.9)))
    arms = {f"{side}_shoulder_abduction": 0.6 for side in ("left", "right")}  # dls sees no trunk, and stops at it
    start = scene.figure.with_joints(problem.start, arms)
    problem = wb.Problem(problem.scene, start, goals=problem.goals, constraints=problem.constraints[:2])
    drag = wb.tracking.Drag(problem, method, budget=0.01)
    wb.tracking.Drag(problem, method).to((0.3, -0.25, 1.0))  # compiles, which reads clocks too
    ticks = itertools.count()
    monkeypatch.setattr(control.time, "thread_time", lambda: 0.001 * next(ticks))
    inside = [drag.to((0.5, -0.25, 0.9)) for _ in range(25)]
    assert min(frame.error for frame in inside) > 0.05
    for frame in inside:
        judged = wb.assess(problem, frame.q)
        assert judged.penetration < 1e-3
        assert judged.constraint_violation < 1e-3
    # to the end, a search of the goal inside takes 7 Newton steps or 143 sweeps
    assert max(frame.iterations for frame in inside) <= {"ccd": 110, "newton": 5}.get(method, 11)
    assert any(drag.to((0.3, -0.25, 1.0)).error < 2e-3 for _ in range(60))


def test_a_frame_that_needs_more_than_its_time_gets_more(scene: wb.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clocks are read ten times in a Newton step; here two readings are a frame's time."""
    drag = wb.tracking.Drag(_problem(scene), "newton", budget=0.01)
    wb.tracking.Drag(_problem(scene), "newton").to(_circle(0.0))  # compiles, which reads clocks too
    ticks = itertools.count()
    monkeypatch.setattr(control.time, "thread_time", lambda: 0.005 * next(ticks))
    assert any(drag.to((0.3, -0.25, 1.0)).error < 2e-3 for _ in range(60))


@pytest.mark.parametrize("method", each(["qp", "newton", "ccd", "dls"]))
@pytest.mark.parametrize("turned", [False, True])
def test_a_tool_is_dragged_at_that_of_another_arm(method: str, turned: bool) -> None:
    """While it is dragged the other one goes away, so the place is one in the other's axes."""
    arm, ready = known_arm("ur5")
    scene = wb.Scene({"left": (arm, (0.0, 0.45, 0.0)), "right": (arm, (0.0, -0.45, 0.0))})
    figure, start = scene.figure, scene.figure.posture({"left": ready, "right": ready})

    def apart(q: np.ndarray) -> pin.SE3:  # type: ignore[type-arg]
        state = pin.Data(figure.model)
        pin.framesForwardKinematics(figure.model, state, q)
        left, right = (state.oMf[figure.model.getFrameId(f"{name}/tool")] for name in ("left", "right"))
        return left.actInv(right)

    before = apart(start)
    way = wb.Point("left/tool", figure.placement(start, "left/tool").translation + (0.05, 0.05, -0.05))
    relative = wb.Relative("right/tool", "left/tool", orientation=turned)
    drag = wb.tracking.Drag(wb.Problem(scene, start, goals=[way, relative]), method, goal=1, budget=0.02)
    turn = pin.exp3(np.array((0.0, 0.2, 0.1)))
    for share in np.linspace(0.1, 1.0, 10):
        target = pin.SE3(before.rotation @ turn, before.translation + share * np.array((0.02, 0.03, -0.04)))
        drag.to(target if turned else target.translation)
    end = drag.finish()
    assert end.assessment.goal_error < 1.1e-5, end
    found = apart(end.q)
    assert found.translation == pytest.approx(target.translation, abs=2e-5)
    assert not turned or found.rotation == pytest.approx(target.rotation, abs=2e-5)


def test_what_has_no_place_is_not_dragged(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[wb.CenterOfMass((0.0, 0.0, 0.9))])
    with pytest.raises(wb.InputError, match="a Point, a Frame, an Orientation or a Relative can be moved"):
        wb.tracking.Drag(problem)


def test_a_thing_goes_the_rest_of_its_way_when_the_time_is_spent_and_what_it_meets_is_named(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.08), name="ball", at=(0.7, 0.6, 0.0))
    start = np.array([0.1, 0.2, 0.2])
    tip = scene.state(start).frame(scene.frame_id("tip")).translation.copy()
    problem = wb.Problem(scene, start, goals=[wb.Point("tip", tip)])
    frames = []
    for budget in (1e-9, np.inf):
        scene.move("ball", at=(0.7, 0.6, 0.0))
        drag = wb.tracking.Drag(problem, "qp", budget=budget)
        drag.to(tip)
        scene.move("ball", at=(0.7, 0.2, 0.0), over=1.0 / 60.0)
        frames.append(drag.to(tip))
        named = max((one.depth for one in frames[-1].collisions if one.inside), default=0.0)
        assert named == pytest.approx(wb.assess(problem, frames[-1].q).penetration, abs=2e-5)
    spent, whole = frames
    assert [share for share, _ in spent.path][-1] == 1.0
    assert len(spent.path) == 3  # one program
    assert {one.second for one in spent.collisions} == {"ball"}
    assert len(whole.path) > 5
    assert not whole.collisions


def test_newton_needs_few_iterations_a_frame_and_does_not_drift(scene: wb.Scene) -> None:
    problem = _problem(scene)
    drag = wb.tracking.Drag(problem, "newton")
    drag.to(_circle(0.0))
    frames = [drag.to(_circle(0.1 * k)) for k in range(16)]
    assert np.mean([frame.iterations for frame in frames]) < 3.0
    for frame in frames[::5]:
        judged = wb.assess(problem, frame.q)
        assert judged.constraint_violation < 2e-4  # what a frame is solved to, not more from frame to frame
        assert scene.figure.within_limits(frame.q)
        assert judged.penetration < 1e-4


def test_a_frame_by_quadratic_programs_is_as_near_as_it_is_asked_for(scene: wb.Scene) -> None:
    """A finer tolerance is kept, takes more programs, and leaves the measures as good."""
    spent, measures = [], []
    for tolerance in (1e-3, 1e-5, 1e-7):
        problem = _problem(scene)
        tracker = wb.methods.QP().tracker(problem, 1.0 / 60.0)
        q, programs = problem.start, 0
        for frame in range(60):
            problem.retarget([wb.Point("right_index_tip", _circle(0.2 * max(frame - 40, 0)))])
            q, count, *_ = tracker.frame(q, tolerance)
            programs += count if frame > 40 else 0
            if frame > 40:
                assert wb.assess(problem, q).goal_error < tolerance
        spent.append(programs)
        measures.append(wb.assess(problem, q).measure)
    assert spent[0] < spent[1] <= spent[2]
    assert max(measures) < 1.06 * min(measures)  # they settle over a second, in which the goal moves on


@pytest.mark.parametrize(("method", "speed"), [("ccd", 1.5), ("newton", 1.5), ("qp", 0.6)])
def test_an_arm_gives_way_to_what_comes_into_it_and_comes_back(planar_arm, method: str, speed: float) -> None:
    """A ball is pushed 25 cm into where the forearm is, and taken away again; the goal stays where the tip was."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.08), name="ball", at=(0.7, 0.6, 0.0))
    start = np.array([0.1, 0.2, 0.2])
    tip = scene.state(start).frame(scene.frame_id("tip")).translation.copy()
    problem = wb.Problem(scene, start, goals=[wb.Point("tip", tip)])
    drag = wb.tracking.Drag(problem, method)
    down = np.arange(0.6, 0.0, -speed / 60.0)
    before, errors = drag.q, []
    for y in [*down, *down[::-1], *[0.6] * 20]:
        scene.move("ball", at=(0.7, float(y), 0.0))
        errors.append(drag.to(tip).error)
        assert wb.assess(problem, drag.q).penetration < 1e-3
        assert scene.sweep(before, drag.q, 1e-3) is None
        assert scene.figure.within_limits(drag.q)
        before = drag.q
    assert max(errors) > 0.05  # it had to give way
    assert drag.finish().assessment.goal_error < 1.1e-5

"""Contacts from starts on the wrong side of things: a driver whose feet begin under the pedals."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.methods import control
from wholebody.methods.qp.method import QP
from wholebody.tasks.contact_parts import approached
from wholebody.tasks.touch import on_its_side


def test_feet_get_onto_a_board_that_they_begin_under() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.8, 0.8, 0.02)), name="board", at=(0.0, 0.0, 0.29))
    problem = wb.Problem(scene, "standing", constraints=[wb.Stand("board")])
    solution = wb.solve(problem, wb.methods.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution
    assert scene.figure.placement(solution.q, "left_sole").translation[2] == pytest.approx(0.30, abs=1e-3)


def test_contacts_are_met_from_an_end_in_front_of_all_faces() -> None:
    """The first descents end 0.2 m away, or in front of the faces, whence feasibility alone stalls at 1 cm."""
    solution = wb.solve(problem_set("drivers").make(8, 0).problem, wb.methods.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution


def test_fingers_close_around_rungs_while_feet_are_on_others() -> None:
    """Soles alone were led in front of their rungs, with hands closed: 1,200 programs ended 2 cm off."""
    scene = wb.Scene(wb.load("human", hands="fingers"))
    for number in range(8):
        height = 0.28 * (number + 1)
        at = (0.35 + 0.25 * height, 0.0, height, 0.5**0.5, 0.0, 0.0, 0.5**0.5)
        scene.add(wb.Cylinder(0.015, 0.45), name=f"rung{number}", at=at)
    hands = [wb.Grasp(side, "rung5", kind="power") for side in ("left", "right")]
    feet = [wb.Stand(f"rung{k}", feet=[f"{side}_foot"], balance=False) for k, side in enumerate(("left", "right"))]
    problem = wb.Problem(scene, "standing", goals=hands, constraints=feet)
    solution = wb.solve(problem, wb.methods.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution
    assert solution.iterations < 500
    for side in ("left", "right"):  # the rung, at 0.77 m ahead and 1.68 m up, is in the hand
        palm = scene.figure.placement(solution.q, f"{side}_palm").translation
        assert np.hypot(palm[0] - 0.77, palm[2] - 1.68) < 0.05


def test_a_descent_that_spent_its_programs_beside_the_contact_goes_on() -> None:
    """A woman's hands were 0.05 mm from the wheel after 150 programs, and 900 others went into other starts."""
    method = wb.methods.QP(measures=False, time_limit=30.0, iterations=3)  # from before contact it takes four
    solution = wb.solve(problem_set("drivers").make(15, 0).problem, method)
    assert solution.solved, solution
    assert sum(entry.note.startswith("before contact") for entry in solution.trace) <= 60


def test_goals_out_of_reach_are_not_tried_from_all_starts() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    goal = wb.Point("right_index_tip", (0.5, -0.3, 2.6))
    feet = [wb.Stand("floor"), wb.Hold("left_foot"), wb.Hold("right_foot")]
    solution = wb.solve(wb.Problem(scene, "standing", goals=[goal], constraints=feet))
    assert solution.status == "unreachable"
    assert sum(entry.note.startswith("before contact") for entry in solution.trace) <= 3 * 40


def test_the_clock_does_not_change_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which half of the processor time that a solve may take passes at once finds what another finds.

    Toes come to rest at the edge of a pedal, where the distance has a kink: the last 0.1 mm was not gone.
    """
    problem = problem_set("drivers").make(16, 0).problem
    quick = wb.solve(problem, wb.methods.QP(measures=False))
    clock = iter([0.0])
    monkeypatch.setattr(control.time, "thread_time", lambda: next(clock, 0.9 * QP.longest))
    monkeypatch.setattr(control.time, "monotonic", lambda: 0.0)
    slow = wb.solve(problem, wb.methods.QP(measures=False))
    assert quick.solved
    assert "before contact" in quick.message
    np.testing.assert_array_equal(quick.q, slow.q)


def test_feet_get_onto_rungs_that_they_begin_under() -> None:
    """Soles that came from below touched the rungs from there; a third of a person's starts ended so."""
    scene = wb.Scene(wb.load("human"))
    for number in (1, 2):
        at = (0.3 + 0.07 * number, 0.0, 0.28 * number)
        turned = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
        scene.add(wb.Cylinder(0.016, 0.42), name=f"rung{number}", at=(*at, *turned))
    feet = [wb.Touch("left_ball", "rung1"), wb.Touch("right_ball", "rung2")]
    problem = wb.Problem(scene, "standing", goals=feet)
    with problem.borrow() as workspace:
        state = workspace.state.update(problem.start)
        for term in problem.goals:
            ahead = on_its_side(term, scene, state, 0.01).parts[0].first.fixed.translation
            way = ahead - term.parts[0].first.fixed.translation
            np.testing.assert_allclose(way, (0.0, 0.0, -0.042), atol=1e-6)  # under the sole, by a rung and 1 cm
    solution = wb.solve(problem, wb.methods.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution
    for side, number in (("left", 1), ("right", 2)):
        assert scene.figure.placement(solution.q, f"{side}_ball").translation[2] > 0.28 * number


def test_the_plane_of_a_face_of_flesh_spreads_no_more() -> None:
    """Thighs spread on seats; in front of one the place of a piece was set that its plane has not: an IndexError."""
    scene = wb.Scene({"anna": wb.load("human", percentile=20), "ben": (wb.load("human"), (0.0, -1.2, 0.0))})
    goal = wb.Sit("ben/left_thigh", pelvis="anna/pelvis", trunk="anna/thorax")
    ahead = approached(goal.resolve(scene, scene.figure.neutral), 0.01)
    assert np.isfinite(ahead.error(scene.state(scene.figure.neutral))).all()


@pytest.mark.parametrize("style", ["stoop", "free", "squat"])
def test_nobody_bends_backwards_to_a_crate(style: str) -> None:
    """Knees that stay straight lead away from a squat, and the first posture that met all bent back over the crate."""
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.4, 0.3)), name="crate", at=(0.45, 0.0, 0.16))
    grips = [wb.Grasp(side, "crate") for side in ("left", "right")]
    measures = [wb.Effort(), wb.tasks.Rhythm(style=style)]  # type: ignore[arg-type]
    solution = wb.solve(wb.Problem(scene, goals=grips, constraints=[wb.Stand("floor")], measures=measures))
    assert solution.solved, solution
    # the trunk's axis dips ahead: by more in a stoop
    assert figure.placement(solution.q, "thorax").rotation[0, 2] > (0.8 if style == "stoop" else 0.4)


def test_a_foot_on_a_step_is_ahead_of_the_other() -> None:
    """A descent without things led a man past the step, with the foot behind him on it, at twice the measure."""
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.6, 0.25)), name="step", at=(0.35, 0.0, 0.125))
    stands = [wb.Stand("floor", feet=["right_foot"]), wb.Stand("step", feet=["left_foot"], balance=False)]
    solution = wb.solve(wb.Problem(scene, constraints=stands))
    assert solution.solved, solution
    bent = figure.joint_values(solution.q)
    assert bent["left_hip_flexion"] > 0.8
    assert bent["left_knee_flexion"] > 0.8

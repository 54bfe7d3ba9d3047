"""What a problem of a person keeps without being told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.figures.state import State

LEFT, RIGHT = wb.Hold("left_foot"), wb.Hold("right_foot")


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def kinds(problem: wb.Problem) -> set[str]:
    return {type(term).__name__ for term in problem.defaults}


@pytest.mark.parametrize(
    ("constraints", "stands"),
    [
        ([LEFT, RIGHT], True),
        ([wb.Hold("left_sole", orientation=False), wb.Hold("right_heel")], True),
        ([LEFT], False),
        ([], False),
        ([LEFT, RIGHT, wb.Hold("left_palm")], False),
        ([LEFT, RIGHT, wb.Hold("pelvis")], False),
        ([LEFT, RIGHT, wb.Freeze("root")], False),
        ([LEFT, RIGHT, wb.Freeze("left_arm")], True),
        ([LEFT, RIGHT, wb.Hold("left_palm", relative_to="right_palm")], True),
        ([LEFT, wb.Hold("right_foot", (0.2, -0.1, 0.3))], False),
        ([LEFT, RIGHT, wb.Balance(margin=0.02)], False),
    ],
)
def test_who_holds_both_feet_and_nothing_else_stands(scene: wb.Scene, constraints: list[Any], stands: bool) -> None:
    problem = wb.Problem(scene, constraints=constraints)
    assert kinds(problem) == {"RangeOfMotion", "ReachCones"} | ({"Balance"} if stands else set())
    assert [type(term) for term in problem.stated] == [
        type(term) for term in constraints if not isinstance(term, wb.Freeze)
    ]


def test_defaults_are_switched_off_and_on(scene: wb.Scene) -> None:
    feet = [LEFT, RIGHT]
    assert kinds(wb.Problem(scene, constraints=feet, balance=False)) == {"RangeOfMotion", "ReachCones"}
    assert kinds(wb.Problem(scene, constraints=feet, range_of_motion=False)) == {"Balance"}
    assert kinds(wb.Problem(scene, balance=True, range_of_motion=False)) == {"Balance"}


def test_what_is_stated_takes_the_place_of_a_default(scene: wb.Scene) -> None:
    stated = [wb.tasks.RangeOfMotion(["neck"]), wb.tasks.ReachCones(["left_shoulder"])]
    assert kinds(wb.Problem(scene, constraints=stated)) == set()


@pytest.mark.parametrize("name", ["avatar", "hand"])
def test_only_a_person_has_them(name: str) -> None:
    assert kinds(wb.Problem(wb.Scene(wb.load(name)))) == set()


@pytest.mark.parametrize("method", [wb.methods.CCD(), wb.methods.DampedLeastSquares()], ids=["ccd", "dls"])
def test_methods_that_cannot_take_one_leave_it_to_the_judge(scene: wb.Scene, method: Any) -> None:
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.2))], constraints=[LEFT, RIGHT])
    assert method.accepts(problem) is None
    assert "Balance" in method.accepts(wb.Problem(scene, constraints=[wb.Balance()]))


def test_who_leans_keeps_the_centre_of_mass_away_from_the_edge_of_the_feet(scene: wb.Scene) -> None:
    """Between a tenth of the base and the fifth that people can use at most on each side (King et al. 1994)."""
    goal = wb.Point("right_index_tip", (0.45, -0.20, 0.30))
    solution = wb.solve(wb.Problem(scene, goals=[goal], constraints=[LEFT, RIGHT]))
    assert solution.status == "solved"
    balance = wb.Balance().resolve(scene, scene.figure.posture("standing"))
    inside = balance.value(State(scene.model).update(solution.q)).min()
    assert 0.1 * 0.265 < inside < 0.2 * 0.275


def test_a_reach_that_the_margin_ends_is_told_what_to_state(scene: wb.Scene) -> None:
    """1.25 m to the side, 1.2 m high, is about 20 mm too far with the margin, and not without it."""
    goals, feet = [wb.Point("right_index_tip", (0.0, -1.25, 1.2))], [wb.Hold("left_foot"), wb.Hold("right_foot")]
    kept = wb.solve(wb.Problem(scene, goals=goals, constraints=feet), wb.methods.QP(restarts=0))
    assert kept.status == "unreachable"
    assert "Balance (by default)" in kept.message
    assert "state Balance() to let the centre of mass come nearer to the feet's edges than 41 mm" in kept.message
    free = wb.solve(wb.Problem(scene, goals=goals, constraints=[*feet, wb.Balance()]))
    assert free.solved


def test_feet_in_one_line_leave_room(scene: wb.Scene) -> None:
    """The margin is a share of the polygon: nobody falls for standing on one line."""
    figure = scene.figure
    hips = {"left_hip_flexion": 0.3, "right_hip_flexion": -0.3, "left_hip_abduction": -0.1, "right_hip_abduction": -0.1}
    problem = wb.Problem(scene, start=figure.with_joints(figure.posture("standing"), hips), constraints=[LEFT, RIGHT])
    margins = [term.margin for term in problem.defaults if isinstance(term, wb.Balance)]
    assert 0.0 < margins[0] < 0.04


def test_a_balance_on_tiptoe_is_left_out_with_a_note(scene: wb.Scene) -> None:
    """The lowest corners of both feet lie on one line, so there is no polygon to stay in."""
    figure = scene.figure
    tiptoe = figure.with_joints(
        figure.posture("standing"), {"left_ankle_dorsiflexion": -0.7, "right_ankle_dorsiflexion": -0.7}
    )
    problem = wb.Problem(scene, tiptoe, goals=[wb.Point("right_palm", (0.4, -0.2, 1.1))], constraints=[LEFT, RIGHT])
    assert "Balance" not in kinds(problem)
    assert "the feet stand on a line" in problem.left_out
    assert problem.left_out in wb.solve(problem).message
    assert not wb.Problem(scene, constraints=[LEFT, RIGHT]).left_out
    for asked in ({"balance": True}, {"constraints": [LEFT, RIGHT, wb.Balance()]}):
        with pytest.raises(wb.InputError, match="line"):
            wb.Problem(scene, tiptoe, **asked)  # type: ignore[arg-type]


class Straight(wb.Goal):
    """A straight right elbow; the names of its attributes are those of other terms."""

    angular = np.array(True)

    def __init__(self, scene: wb.Scene) -> None:
        self.residual, self.place, self.base = np.zeros(1), "elbow", None
        self.joint = scene.model.joints[scene.model.getJointId("right_elbow_flexion")]

    def error(self, state: wb.State) -> Any:
        return state.q[self.joint.idx_q : self.joint.idx_q + 1]

    def jacobian(self, state: wb.State) -> Any:
        return np.eye(1, state.model.nv, self.joint.idx_v)


def test_attributes_of_an_own_goal_are_its_own(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[Straight(scene)], constraints=[LEFT, RIGHT])
    arms = [term.arms for term in problem.measures if isinstance(term, wb.tasks.Hang)]
    assert arms == [("left_upper_arm",)]
    problem.goals = [Straight(scene)]
    assert wb.solve(problem).solved

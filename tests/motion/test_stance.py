"""Feet that stand: a made-up walk whose steps are known."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.figures.state import State
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.measures import foot_sliding
from wholebody.motion.stance import held_feet, standing


@pytest.fixture(scope="module")
def avatar() -> wb.Figure:
    """Return a person with fewer joints."""
    return wb.load("avatar")


def kicking(avatar: wb.Figure) -> np.ndarray:
    """The left foot stands, swings in frames 10 to 19, and stands again; the right one stands all the time."""
    q0 = avatar.posture("standing")
    lift = np.sin(np.pi * np.clip((np.arange(30) - 9) / 11, 0.0, 1.0))
    return np.array(
        [avatar.with_joints(q0, {"left_hip_flexion": 0.8 * one, "left_knee_flexion": 1.0 * one}) for one in lift]
    )


def test_a_foot_that_swings_does_not_stand(avatar: wb.Figure) -> None:
    found = standing(avatar, kicking(avatar), 1 / 30)
    assert set(found) == {f"{side}_{point}" for side in ("left", "right") for point in ("heel", "ball", "toe_tip")}
    for point in ("heel", "ball", "toe_tip"):
        assert found[f"right_{point}"].all()
        assert found[f"left_{point}"][:8].all()
        assert found[f"left_{point}"][22:].all()
        assert not found[f"left_{point}"][11:19].any()


def test_feet_that_are_named_are_the_only_ones(avatar: wb.Figure) -> None:
    found = standing(avatar, kicking(avatar), 1 / 30, wb.motion.StanceFeet(["right_ball"]))
    assert set(found) == {"right_ball"}
    assert found["right_ball"].all()


def test_a_frozen_joint_that_moves_is_missed_by_its_turn(avatar: wb.Figure) -> None:
    q = kicking(avatar)[:1]
    terms = frame_terms(wb.Scene(avatar), q, 1 / 30, [wb.Freeze("left_knee_flexion")])
    moved = avatar.with_joints(q[0], {"left_knee_flexion": 0.2 + avatar.joint_values(q[0])["left_knee_flexion"]})
    miss = terms.worst(0, State(avatar.model).update(moved))
    assert miss.by == pytest.approx(0.2, abs=1e-12)
    assert "Freeze" in miss.name
    assert terms.worst(0, State(avatar.model).update(q[0])).by == 0.0


def test_a_foot_that_glides_slowly_does_not_stand(avatar: wb.Figure) -> None:
    """A clip of a figure has no markers that tremble: what moves on by 0.18 m/s does not rest at 0.15."""
    q = np.tile(avatar.posture("standing"), (30, 1))
    q[:, 0] += 0.18 / 30 * np.arange(30)
    assert not np.any(list(standing(avatar, q, 1 / 30).values()))


def legs_that_cross(avatar: wb.Figure) -> wb.Clip:
    """The left leg passes through the right one, on which the figure stands."""
    q0 = avatar.posture("standing")
    wave = np.sin(np.pi * np.arange(30) / 29) ** 2
    q = np.array(
        [
            avatar.clamp(avatar.with_joints(q0, {"left_hip_abduction": -0.35 * one, "left_hip_flexion": 0.3 * one}))
            for one in wave
        ]
    )
    return wb.Clip(avatar, q, 1 / 30)


def test_standing_feet_stay_where_they_were(avatar: wb.Figure) -> None:
    """They do by default; the leg that passes through the other one is moved."""
    clip = legs_that_cross(avatar)
    avoided = wb.avoid(clip)
    assert avoided.report.before.colliding
    assert avoided.report.solved, avoided.report.message
    state = State(avatar.model)
    foot = avatar.frame_id("right_foot")
    for before, after in zip(clip.q, avoided.clip.q, strict=True):
        places = [pin_frame.copy() for pin_frame in (state.update(one).frame(foot) for one in (before, after))]
        assert np.linalg.norm(places[0].translation - places[1].translation) < 1e-4


def test_feet_slide_where_they_may(avatar: wb.Figure) -> None:
    clip = legs_that_cross(avatar)
    avoided = wb.avoid(clip, hold_feet=False)
    assert avoided.report.solved
    assert foot_sliding(clip, avoided.clip) > 1e-3


def test_points_of_one_foot_hold_its_orientation_and_one_alone_does_not(avatar: wb.Figure) -> None:
    held = held_feet(avatar, ("left_heel", "left_ball", "right_ball", "right_toe_tip"))
    assert [(one.frame, one.orientation) for one in held] == [
        ("left_heel", True), ("right_ball", False), ("right_toe_tip", False)
    ]  # fmt: skip


def test_a_figure_without_feet_says_so() -> None:
    with pytest.raises(wb.InputError, match="name the feet"):
        wb.motion.StanceFeet().names(wb.load("hand"))

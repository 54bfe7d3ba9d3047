"""Hands that are held at each other and overlap there are held beside; other grips stay as they are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.grips import grip_shifts

DT = 1 / 30
GRIP = wb.Hold("left_palm", relative_to="right_palm")


def hands_together(figure: Figure, closest: float, frames: int = 17) -> wb.Clip:
    """Arms forward; the hands come together, stay for a moment, and part; `closest` is the abduction, radians."""
    wave = np.sin(np.linspace(0.0, np.pi, frames)) ** 2
    postures = []
    for share in wave:
        angles = {f"{side}_shoulder_abduction": -0.05 + share * (closest + 0.05) for side in ("left", "right")}
        postures.append(figure.with_joints(figure.posture("arms_forward"), angles))
    return wb.Clip(figure, np.array(postures), DT, "hands together")


def grips(clip: wb.Clip) -> list[pin.SE3]:
    """The left palm in the axes of the right one, by Pinocchio alone."""
    model, data, found = clip.figure.model, clip.figure.model.createData(), []
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        left, right = (data.oMf[model.getFrameId(f"{side}_palm")] for side in ("left", "right"))
        found.append(right.actInv(left))
    return found


def between_hands(clip: wb.Clip) -> np.ndarray:
    """Depth of the hands in each other in each frame, by the check of clips, metres; 0 where they are apart."""
    pairs = [each for each in wb.check(clip).contacts if each.names == "left_hand and right_hand"]
    return np.max([each.depth for each in pairs], axis=0) if pairs else np.zeros(len(clip))


def test_hands_that_are_held_too_near_part_to_the_clearance(human: Figure) -> None:
    clip = hands_together(human, -0.215, frames=7)
    found = wb.avoid(clip, method=wb.motion.Trajectory(clearance=0.003), constraints=[GRIP])
    assert found.report.solved, found.report.message
    assert found.report.beside > between_hands(clip).max() + 0.003


def test_hands_that_are_held_in_each_other_part_by_their_depth(human: Figure) -> None:
    clip = hands_together(human, -0.215)
    depth = between_hands(clip)
    assert 0.003 < depth.max() < 0.02
    found = wb.avoid(clip, method="trajectory", constraints=[GRIP])
    assert found.report.solved, found.report.message
    assert "beside" in found.report.message
    assert depth.max() < found.report.beside < 1.5 * depth.max() + 5e-4
    for kept, now in zip(grips(clip), grips(found.clip), strict=True):
        apart = kept.actInv(now)
        shaft = kept.translation / np.linalg.norm(kept.translation)
        assert np.linalg.norm(np.cross(now.translation, shaft)) < 1e-3  # it slides along what both hands hold
        assert np.linalg.norm(apart.translation) < found.report.beside + 1e-3
        assert np.linalg.norm(pin.log3(apart.rotation)) < 1e-3


def test_grips_that_do_not_overlap_stay_where_they_are(human: Figure) -> None:
    clip = hands_together(human, -0.05)
    assert not grip_shifts(wb.Scene(human), clip.q, DT, GRIP).any()
    assert wb.avoid(clip, constraints=[GRIP]).report.beside == 0.0


def test_shifts_are_smooth_and_end_before_the_clip_does(human: Figure) -> None:
    clip = hands_together(human, -0.215, frames=61)
    shifts = grip_shifts(wb.Scene(human), clip.q, DT, GRIP)
    length = np.linalg.norm(shifts, axis=1)
    assert not length[[0, -1]].any()
    assert np.abs(np.diff(shifts, n=2, axis=0)).max() < 0.25 * length.max()


def test_hands_that_pass_each_other_between_two_frames_part_there_too(human: Figure) -> None:
    """One hand goes past the other, palms to the ground; no frame is where they are nearest."""
    raised = human.model.joints[human.joint_id("left_shoulder_flexion")].idx_q
    turned = {"shoulder_abduction": -0.172, "elbow_pronation": -1.3}
    base = human.with_joints(
        human.posture("arms_forward"),
        {f"{side}_{name}": angle for side in ("left", "right") for name, angle in turned.items()},
    )
    q = np.tile(base, (6, 1))
    q[:, raised] += 0.1 * (np.arange(6) - 2.5)
    clip = wb.Clip(human, q, DT)
    before = wb.check(clip)
    assert (before.colliding, before.dips) == (0, 1)
    found = wb.avoid(clip, method="bisection", constraints=[GRIP])
    assert found.report.solved, found.report.message
    assert before.deepest_between < found.report.beside < 5e-3

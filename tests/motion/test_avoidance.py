"""Clips that collide are freed: small arms with known answers, people with arms in the trunk, and what cannot be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import wholebody as wb
from tests.freeing import freed_by
from wholebody.cli import main
from wholebody.figures.figure import Figure
from wholebody.motion.avoidance import METHODS
from wholebody.motion.avoider import AvoidProgress, MethodResult

DT = 1 / 30
BALL, RADIUS, LINK, WIDTH = np.array([0.95, 0.0]), 0.1, 0.5, 0.02


def swing(frames: int, bend: float = 0.5) -> np.ndarray:
    """A bent arm of two links that turns past the ball."""
    return np.stack([np.linspace(-1.2, 1.2, frames) - 0.5 * bend, np.full(frames, bend)], axis=1)


def arm_and_ball(planar_arm: Callable[..., Figure], frames: int) -> tuple[wb.Clip, wb.Scene]:
    figure = planar_arm((LINK, LINK), radius=WIDTH)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(RADIUS), name="ball", at=(*BALL, 0.0))
    return wb.Clip(figure, swing(frames), DT, "swing"), scene


def gap(q: np.ndarray) -> float:
    """Distance of the ball from the arm, from the geometry of two segments; negative in it."""
    elbow = LINK * np.array([np.cos(q[0]), np.sin(q[0])])
    tip = elbow + LINK * np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    least = np.inf
    for start, end in ((np.zeros(2), elbow), (elbow, tip)):
        way = end - start
        share = np.clip((BALL - start) @ way / (way @ way), 0.0, 1.0)
        least = min(least, float(np.linalg.norm(start + share * way - BALL)))
    return least - RADIUS - WIDTH


def test_an_arm_that_swings_through_a_ball_goes_around_it(planar_arm: Callable[..., Figure]) -> None:
    frames = 60
    clip, scene = arm_and_ball(planar_arm, frames)
    assert min(map(gap, clip.q)) < -0.05
    found = wb.avoid(clip, scene, method=wb.motion.Trajectory(margin=0.4))
    assert found.report.solved, found.report.message
    assert min(map(gap, found.clip.q)) > -2e-5
    fine = found.clip.resampled(DT / 10)
    assert min(map(gap, fine.q)) > -1e-4
    inside = np.flatnonzero([gap(q) < 0.0 for q in clip.q])
    kept = np.r_[0 : inside[0] - 12, inside[-1] + 13 : frames]
    np.testing.assert_array_equal(found.clip.q[kept], clip.q[kept])
    assert found.report.frames_changed <= frames - len(kept)


def test_the_trajectory_is_the_least_of_its_objective(planar_arm: Callable[..., Figure]) -> None:
    """SLSQP on the same objective, with the distances of two segments from the ball, finds nothing better."""
    figure = planar_arm((LINK, LINK), radius=WIDTH)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(RADIUS), name="ball", at=(*BALL, 0.0))
    frames = 20
    wave = np.sin(np.pi * np.arange(frames) / (frames - 1))
    q = np.stack([-1.0 + 0.56 * wave, np.full(frames, 0.7)], axis=1)  # into the ball from the side, and back
    time = 0.1
    clip, method = wb.Clip(figure, q, DT), wb.motion.Trajectory(margin=10.0, time=time)
    assert min(map(gap, q)) < -0.02

    def objective(flat: np.ndarray) -> float:
        x = flat.reshape(frames, 2)
        acceleration = np.diff(x, n=2, axis=0) * (time / DT) ** 2
        return 0.5 * float((x**2).sum() + (acceleration**2).sum())

    def slope(flat: np.ndarray) -> np.ndarray:
        acceleration = np.diff(flat.reshape(frames, 2), n=2, axis=0) * (time / DT) ** 4
        return flat + (np.diff(np.eye(frames), n=2, axis=0).T @ acceleration).ravel()

    def gaps(flat: np.ndarray) -> np.ndarray:
        return np.array([gap(posture) for posture in q + flat.reshape(frames, 2)])

    def slopes(flat: np.ndarray) -> np.ndarray:
        """Of the gaps: that of a frame depends on its own posture alone."""
        found, size = np.zeros((frames, frames, 2)), 1e-7
        for joint in range(2):
            step = np.tile(size * np.eye(2)[joint], frames)
            found[range(frames), range(frames), joint] = (gaps(flat + step) - gaps(flat - step)) / (2.0 * size)
        return found.reshape(frames, 2 * frames)

    found = (freed_by(method, clip, scene).q - q).ravel()
    assert gaps(found).min() > -1e-5
    for start in (found, np.zeros_like(found)):
        free = {"type": "ineq", "fun": gaps, "jac": slopes}
        best = minimize(objective, start, jac=slope, method="SLSQP", constraints=free, options={"maxiter": 300})
        assert gaps(best.x).min() > -1e-6
        assert objective(found) <= 1.01 * best.fun


def test_a_free_clip_stays_as_it_is(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 40)
    scene.move("ball", at=(3.0, 0.0, 0.0))
    for method in ("trajectory", "bisection"):
        found = wb.avoid(clip, scene, method=method)
        np.testing.assert_array_equal(found.clip.q, clip.q)
        assert found.report.solved
        assert (found.report.programs, found.report.frames_changed) == (0, 0)


def test_a_thin_thing_between_two_frames_is_not_passed(planar_arm: Callable[..., Figure]) -> None:
    """No frame touches the needle; the tip of the arm scrapes over it between two of them."""
    figure = planar_arm((LINK, LINK), radius=0.002)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.002), name="needle", at=(0.971, 0.0, 0.0))
    clip = wb.Clip(figure, swing(40), DT)
    found = wb.avoid(clip, scene)
    assert found.report.before.colliding == 0
    assert found.report.before.dips > 0
    assert found.report.solved, found.report.message


@pytest.mark.parametrize(
    ("method", "beyond"),
    [("trajectory", [0.2]), ("bisection", [0.2, 0.5, 0.2])],
)
def test_a_thin_thing_passed_wholly_between_two_frames_is_not_passed(
    planar_arm: Callable[..., Figure], method: str, beyond: list[float]
) -> None:
    """No frame touches the plate; the arm goes through it between two frames, and comes back through it later."""
    figure = planar_arm((LINK, LINK), radius=0.01)
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.3, 0.002, 0.3)), name="plate", at=(0.75, 0.0, 0.0))
    near = np.linspace(-0.8, -0.2, 10)
    angle = np.concatenate([near, beyond, near[::-1]])
    clip = wb.Clip(figure, np.stack([angle, np.full(len(angle), 0.3)], axis=1), DT)
    found = wb.avoid(clip, scene, method=method)
    assert (found.report.before.colliding, found.report.before.dips) == (0, 2)
    assert found.report.solved, found.report.message
    first, second = found.clip.q[:, 0], found.clip.q.sum(axis=1)
    height = LINK * np.sin(first) + (0.75 - LINK * np.cos(first)) * np.tan(second)  # of the forearm at the plate
    assert (height < -0.01).all()


def test_a_thin_thing_passed_for_good_is_not_passed(planar_arm: Callable[..., Figure]) -> None:
    """The arm goes through the plate between two frames, and never comes back."""
    figure = planar_arm((LINK, LINK), radius=0.01)
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.3, 0.002, 0.3)), name="plate", at=(0.75, 0.0, 0.0))
    angle = np.concatenate([np.linspace(-0.8, -0.2, 20), np.linspace(0.2, 0.6, 20)])
    clip = wb.Clip(figure, np.stack([angle, np.full(len(angle), 0.3)], axis=1), DT)
    found = wb.avoid(clip, scene, method="bisection")
    assert found.report.before.dips == 1
    assert found.report.solved, found.report.message
    first, second = found.clip.q[:, 0], found.clip.q.sum(axis=1)
    height = LINK * np.sin(first) + (0.75 - LINK * np.cos(first)) * np.tan(second)  # of the forearm at the plate
    assert (height < -0.01).all()


def test_what_cannot_be_freed_is_said(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 30)
    for method in ("trajectory", "bisection"):
        found = wb.avoid(clip, scene, method=method, constraints=[wb.Freeze("all")])
        assert not found.report.solved
        assert "collide" in found.report.message
        assert "ball at 0.5" in found.report.message  # who and when: the swing is in the middle of the ball then
        np.testing.assert_allclose(found.clip.q, clip.q, atol=1e-9)


def test_joint_limits_hold_where_the_original_breaks_them(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((LINK, LINK), limit=1.0)
    wave = np.sin(np.linspace(0.0, np.pi, 60))
    clip = wb.Clip(figure, np.stack([0.3 * wave, 1.2 * wave], axis=1), DT)
    found = wb.avoid(clip)
    assert found.report.solved, found.report.message
    assert np.abs(found.clip.q).max() <= 1.0 + 1e-6


def test_joints_become_no_faster_than_their_limit_or_the_original(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 20)
    limit = 1.1 * float(np.abs(np.diff(clip.q, axis=0)).max()) / DT
    found = wb.avoid(clip, scene, constraints=[wb.tasks.StepLimit(limit)])
    assert found.report.solved, found.report.message
    assert np.abs(np.diff(found.clip.q, axis=0)).max() == pytest.approx(limit * DT, abs=1e-6)  # it would be faster


def test_progress_is_told_and_ends_it(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 60)
    told: list[AvoidProgress] = []

    def stop(progress: AvoidProgress) -> bool:
        told.append(progress)
        return len(told) == 3

    found = wb.avoid(clip, scene, progress=stop)
    assert len(told) == 3
    assert all(0.0 <= one.share <= 1.0 for one in told)
    assert not found.report.solved
    assert "the caller ended it" in found.report.message


@pytest.fixture(scope="module")
def avatar() -> Figure:
    """Return a person with fewer joints."""
    return wb.load("avatar")


def arm_into_trunk(human: Figure, frames: int = 16) -> wb.Clip:
    """The right forearm sinks into the trunk, 10 cm deep, and comes out again; the left arm is clear of it."""
    q0 = human.with_joints(human.posture("standing"), {"left_shoulder_abduction": 0.4})
    wave = np.sin(np.pi * np.arange(frames) / (frames - 1)) ** 2
    turned = {"right_elbow_flexion": 1.5, "right_shoulder_rotation": 0.9, "right_shoulder_abduction": -0.1}
    values = human.joint_values(q0)
    q = [
        human.clamp(human.with_joints(q0, {name: (1 - one) * values[name] + one * end for name, end in turned.items()}))
        for one in wave
    ]
    return wb.Clip(human, np.array(q), DT, "forearm")


def test_a_two_handed_grip_is_kept(avatar: Figure) -> None:
    clip = arm_into_trunk(avatar)
    found = wb.avoid(clip, constraints=[wb.Hold("left_hand", relative_to="right_hand")])
    assert found.report.solved, found.report.message
    assert found.report.missed < 1e-4


@dataclass(frozen=True)
class Replaced:
    """A method that gives other postures, whatever is asked."""

    q: np.ndarray
    name: str = "replaced"
    said: str = ""
    clearance: float = 0.0
    dynamics: None = None

    def avoid(self, *asked: object) -> MethodResult:
        return MethodResult(self.q, message=self.said)


def test_a_method_that_lacks_a_part_of_the_protocol_is_named(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 3)

    class Nameless:
        avoid = Replaced(clip.q).avoid

    with pytest.raises(wb.InputError, match=r"method is a Nameless without name; see wholebody\.motion\.avoider"):
        wb.avoid(clip, scene, method=Nameless())  # type: ignore[arg-type]


def test_a_free_clip_is_not_told_as_one_that_collides(planar_arm: Callable[..., Figure]) -> None:
    """A method may be stricter than the judgement; what it says comes after what was found."""
    clip, scene = arm_and_ball(planar_arm, 20)
    scene.move("ball", at=(3.0, 0.0, 0.0))
    found = wb.avoid(clip, scene, method=Replaced(clip.q, said="frame 3 could not be freed"))
    assert found.report.solved
    assert found.report.message.startswith("nothing collides")
    assert found.report.message.endswith("replaced says: frame 3 could not be freed")


@pytest.mark.parametrize(
    ("term", "joints", "name"),
    [
        (wb.Hold("left_hand", relative_to="right_hand"), {"left_elbow_flexion": 0.8}, "Hold('left_hand')"),
        (wb.motion.StanceFeet(), {"left_knee_flexion": 0.4}, "Hold('left_heel')"),
    ],
)
def test_a_free_clip_that_misses_what_is_held_is_not_solved(
    avatar: Figure, term: Any, joints: dict[str, float], name: str
) -> None:
    """Nothing collides in it; one frame of many misses what is held, and the message says what and when."""
    q = np.array([avatar.with_joints(avatar.posture("standing"), {"left_elbow_flexion": 0.3})] * 12)
    other = q.copy()
    other[6] = avatar.with_joints(q[6], joints)
    clip, scene = wb.Clip(avatar, q, DT), wb.Scene(avatar)
    found = wb.avoid(clip, scene, method=Replaced(other), constraints=[term], hold_feet=False)
    assert found.report.after.free
    assert not found.report.solved
    assert found.report.missed > 1e-2
    assert f"{name} is missed by" in found.report.message
    assert "at 0.20 s" in found.report.message
    assert str(found.report).startswith("not free")
    kept = wb.avoid(clip, scene, method=Replaced(q), constraints=[term], hold_feet=False)
    assert kept.report.solved, kept.report.message
    assert kept.report.missed < 1e-9


def test_names_of_methods(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = arm_and_ball(planar_arm, 5)
    assert set(METHODS) >= {"trajectory", "bisection"}
    with pytest.raises(wb.UnknownNameError, match="trajectory"):
        wb.avoid(clip, scene, method="trajectry")
    with pytest.raises(wb.InputError, match="other joints"):
        wb.avoid(clip, wb.Scene(wb.load("hand")))


def test_the_command_frees_a_file(tmp_path: Path, human: Figure, capsys: pytest.CaptureFixture[str]) -> None:
    arm_into_trunk(human, 10).write(tmp_path / "arm.npz")
    assert main(["clip", "avoid", str(tmp_path / "arm.npz"), "--method", "bisection"]) == 0
    told = capsys.readouterr().out
    assert "nothing collides" in told
    free = wb.read_clip(tmp_path / "arm-free.npz", human)
    assert wb.check(free).free
    assert main(["clip", "avoid", str(tmp_path / "arm.npz"), "--method", "none"]) == 2
    assert main(["clip", "avoid", str(tmp_path / "arm.npz"), "--method", "bisection", "--stretch", "2"]) == 2
    assert main(["clip", "avoid", str(tmp_path / "arm.npz"), "--method", "bisection", "--dynamics"]) == 2
    told = capsys.readouterr()
    assert "does not slow" in told.err + told.out
    assert "does not take dynamics" in told.err + told.out


@pytest.mark.parametrize(
    ("options", "said"), [(["--out", "arm.fbx"], "cannot be written as .fbx"), (["--jobs", "0"], "--jobs is 0; give")]
)
def test_the_command_refuses_before_it_frees(
    options: list[str], said: str, tmp_path: Path, human: Figure, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    arm_into_trunk(human, 4).write(tmp_path / "arm.npz")
    monkeypatch.setattr("wholebody.motion.avoidance.avoid", lambda *_, **__: pytest.fail("it was freed"))
    assert main(["clip", "avoid", str(tmp_path / "arm.npz"), *options]) == 2
    assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["arm.npz"]


def test_an_answer_is_told_in_three_lines() -> None:
    human = wb.load("human")
    standing = human.posture("standing")
    inside = human.with_joints(standing, {"right_shoulder_abduction": -0.3})
    freed = wb.avoid(wb.Clip(human, [standing, inside, standing], 0.5, "an arm"), method="bisection")  # type: ignore[arg-type]
    lines = str(freed).splitlines()
    assert len(lines) == 3
    assert lines[0].startswith("an arm, free: nothing collides")
    assert "frames in collision 1 before, 0 after" in lines[1]
    assert lines[2].startswith("bisection: ")
    assert str(freed.report) == str(freed).removeprefix("an arm, ")
    assert len(repr(freed)) < 200


@pytest.mark.parametrize("method", ["trajectory"])
def test_a_person_on_tiptoe_is_freed_without_a_default_balance(avatar: Figure, method: str) -> None:
    """Both feet are held and their lowest corners lie on a line: `Balance` has no area, and is left out."""
    tiptoe = {"left_ankle_dorsiflexion": -0.7, "right_ankle_dorsiflexion": -0.7}
    share = np.sin(np.linspace(0.0, np.pi, 15))
    q = [
        avatar.with_joints(avatar.posture("standing"), {**tiptoe, "right_shoulder_abduction": -0.3 * s}) for s in share
    ]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    way = wb.motion.Bisection(frozen=()) if method == "bisection" else method  # a frozen root is balanced by nothing
    found = wb.avoid(wb.Clip(avatar, q, DT), method=way, constraints=feet, hold_feet=False)
    assert found.report.before.colliding
    assert found.report.after.free, found.report.message
    if method == "bisection":
        assert "the default Balance is left out: the feet stand on a line" in found.report.message

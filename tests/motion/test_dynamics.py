"""Clips that keep to strength: a flywheel by hand, a person who leans by finite differences, and recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.load_change import LoadChange
from wholebody.motion.stance import standing_feet
from wholebody.motion.trajectory.loads import ClipLoads, standing_frames

WHEEL = """<robot name="wheel"><link name="base"/>
<link name="wheel"><inertial><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>
<limit lower="-6" upper="6" effort="{effort}" velocity="50"/></joint></robot>"""
INERTIA = 0.5


def wheel(folder: Path, effort: float) -> wb.Clip:
    """A wheel on an upright axis that turns to and fro: its torque is its inertia times its acceleration."""
    (folder / "wheel.urdf").write_text(WHEEL.format(effort=effort))
    t = np.arange(61) / 30.0
    return wb.Clip(wb.load(folder / "wheel.urdf"), np.sin(2.0 * t)[:, None] * 1.5, 1.0 / 30.0, "wheel")


def torque(clip: wb.Clip) -> np.ndarray:
    """By second differences."""
    return INERTIA * np.diff(clip.q[:, 0], n=2) / clip.dt**2


def test_a_wheel_is_slowed_until_its_motor_is_strong_enough(tmp_path: Path) -> None:
    clip = wheel(tmp_path, 2.0)
    assert np.abs(torque(clip)).max() > 2.9
    found = wb.avoid(clip, dynamics=True, method=wb.motion.Trajectory(stretch=2.0))
    assert found.report.solved, found.report.message
    assert "slowed" in found.report.message
    slower = wb.motion.torques(found.clip).torque[2:-2, 0]
    assert np.abs(slower).max() < 2.0 * 1.03  # what resampling changes
    assert 1.15 < found.report.stretch <= 2.0
    kept = wb.avoid(clip, dynamics=True)  # without slowing it is as strong as before
    assert kept.report.solved, kept.report.message
    np.testing.assert_array_equal(kept.clip.q, clip.q)


def test_a_strong_motor_keeps_its_timing(tmp_path: Path) -> None:
    clip = wheel(tmp_path, 4.0)
    found = wb.avoid(clip, dynamics=True, method=wb.motion.Trajectory(stretch=2.0))
    assert found.report.stretch == 1.0
    np.testing.assert_array_equal(found.clip.q, clip.q)


@dataclass(frozen=True)
class Larger:
    """Makes a clip larger."""

    by: float
    name: str = "larger"
    clearance: float = 0.0
    dynamics: wb.motion.Strength | None = None

    def avoid(self, run: Run) -> MethodResult:
        return MethodResult(self.by * run.clip.q)


def test_what_is_beyond_its_bound_is_said_with_its_figures(tmp_path: Path) -> None:
    """By `wb.motion.torques` alone: the wheel needs 30 % more than before, which was more than its effort."""
    clip = wheel(tmp_path, 2.0)
    found = wb.avoid(clip, dynamics=True, method=Larger(1.3), constraints=[wb.motion.MotionBounds(None, None, None)])
    bound = np.abs(wb.motion.torques(clip).torque).max()
    assert bound > 2.0
    assert not found.report.solved
    assert f"turn needs {1.3 * bound:.4g} N m" in found.report.message
    assert f"30.0% more than its bound of {bound:.4g} N m" in found.report.message
    assert wb.avoid(clip, dynamics=True, method=Larger(1.01)).report.solved


def test_a_strength_that_the_clip_kept_is_said(tmp_path: Path) -> None:
    """The wheel needs 1.5 of what it needed, which was within its effort."""
    clip = wheel(tmp_path, 4.0)
    was = np.abs(wb.motion.torques(clip).torque).max()
    assert 0.7 * 4.0 < was < 4.0
    found = wb.avoid(clip, dynamics=True, method=Larger(1.5), constraints=[wb.motion.MotionBounds(None, None, None)])
    assert f"{1.5 * was / 4.0 - 1.0:.1%} more than its bound of 4 N m" in found.report.message
    assert f"{was:.4g} N m" in found.report.message
    assert "Trajectory(stretch=2)" in found.report.message


def test_other_methods_do_not_take_dynamics(tmp_path: Path) -> None:
    clip = wheel(tmp_path, 2.0)
    with pytest.raises(wb.InputError, match="trajectory"):
        wb.avoid(clip, dynamics=True, method="bisection")
    with pytest.raises(wb.InputError, match="dynamics"):
        wb.avoid(clip, dynamics="strong")  # type: ignore[arg-type]
    with pytest.raises(wb.InputError, match="dynamics"):
        wb.motion.Trajectory(dynamics=True)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def recorded(shared_data: Path) -> wb.Clip:
    """The first frames of a man who crouches for a jump."""
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_02_04.bvh").part(0, 26)
    return wb.retarget(motion, wb.load("human"))[:16]


def _with_a_ball(recorded: wb.Clip) -> wb.Scene:
    """A ball where the right hand passes."""
    palm = recorded.figure.placement(recorded.q[10], "right_palm").translation
    return wb.Scene(recorded.figure).add(wb.Sphere(0.03), name="ball", at=tuple(palm + (0.02, 0.0, 0.0)))


def test_a_recording_that_is_freed_stays_within_strength(recorded: wb.Clip) -> None:
    """Going round the ball changes what the joints bear and how the person leans."""
    found = wb.avoid(recorded, _with_a_ball(recorded), dynamics=True)
    assert not found.report.before.free
    assert found.report.solved, found.report.message
    loads = found.report.loads
    assert isinstance(loads, LoadChange)
    assert not loads.missed
    public = wb.motion.torques(recorded), wb.motion.torques(found.clip)  # as anybody measures them
    for told, measured in zip((loads.before, loads.after), public, strict=True):
        np.testing.assert_array_equal(told.torque, measured.torque)
        np.testing.assert_array_equal(told.outside, measured.outside)
    same = (public[0].stands == public[1].stands).all(axis=1)
    assert ((public[1].outside - public[0].outside)[same] <= 2e-3).all()
    lower, upper = loads.bounds
    assert (loads.after.torque[:, 6:] <= upper[6:] * 1.02 + 1e-6).all()
    assert (loads.after.torque[:, 6:] >= lower[6:] * 1.02 - 1e-6).all()


def test_nothing_is_asked_of_a_recording_beyond_what_it_keeps(recorded: wb.Clip) -> None:
    """It leans out of its feet and is beyond strength, so it is as far beyond its bounds as before: nowhere."""
    public = wb.motion.torques(recorded)
    assert public.outside.max() > 0.05
    assert public.largest_share > 1.2
    terms = frame_terms(wb.Scene(recorded.figure), recorded.q, recorded.dt, (), 0.0)
    asked = ClipLoads.original(recorded, standing_feet(recorded, public.feet), wb.motion.Strength(), terms)
    assert asked.worst().max() < 1e-9
    assert asked.corrected(recorded.q).of(recorded.q).worst().max() < 1e-9
    judged = LoadChange(public, public, np.arange(float(len(recorded))))
    assert not judged.beyond.any()
    assert not judged.farther.any()
    assert not judged.missed


@pytest.mark.parametrize(("inside", "told"), [(True, "was within it before"), (False, "mm before")])
def test_a_support_that_is_left_is_said(recorded: wb.Clip, inside: bool, told: str) -> None:
    """Where a frame leans 30 mm farther: by how much, when, out of which feet, and how it was before."""
    public = wb.motion.torques(recorded)
    frames = public.stands.all(axis=1) & ((public.outside == 0.0) if inside else (public.outside > 0.05))
    frame = int(np.flatnonzero(frames)[0])
    outside = public.outside.copy()
    outside[frame] += 0.03
    (said,) = LoadChange(public, replace(public, outside=outside), np.arange(float(len(recorded)))).missed
    assert f"30 mm farther outside of the feet than before at {frame * recorded.dt:.2f} s" in said
    assert f"{1e3 * outside[frame]:.3g} mm outside of the support of left_foot and right_foot" in said
    assert "too far in 1 frames" in said
    assert told in said


def test_a_foot_stands_between_two_frames_in_which_it_stands() -> None:
    feet = np.array([2, 2, 1, 0, 0, 1, 1])
    places = np.array([0.0, 0.6, 1.1, 1.9, 2.0, 2.1, 2.9, 4.2, 4.9, 5.0, 5.4, 5.6])
    found = standing_frames(places, feet)
    np.testing.assert_array_equal(found, [0, 1, 2, 2, 2, 3, 3, 4, 4, 5, 5, 6])


def test_a_clip_that_loses_its_ground_is_said() -> None:
    """Who stands and is then lifted by as much in every frame of a second lacks the whole weight in each."""
    human = wb.load("human")
    q = np.repeat(human.posture("standing")[None], 31, axis=0)
    lifted = q.copy()
    lifted[:, 2] += 0.9 * np.minimum(np.arange(31) / 30.0, 1.0)  # 0.9 m/s: faster than what bears
    change = LoadChange(*(wb.motion.torques(wb.Clip(human, each, 1.0 / 30.0)) for each in (q, lifted)), np.arange(31.0))
    assert not change.farther.any()
    assert change.unsupported == pytest.approx(np.ones(31), abs=0.02)
    (said,) = change.missed
    assert "the ground lacks 100% of the weight more than before" in said
    assert "in 31 frames" in said
    assert not LoadChange(change.before, change.before, change.times).missed

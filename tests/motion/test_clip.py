"""Clips: facts of the manifold, derivatives of known polynomials, mirror images, files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wholebody as wb
from wholebody.cli import main
from wholebody.figures.figure import Figure
from wholebody.motion.files.archive import made_with

SYMMETRIC = ("shoulder", "elbow", "wrist", "palm", "hip", "knee", "ankle", "toe_tip")


def moving(figure: Figure, frames: int, seed: int = 0, dt: float = 0.1) -> wb.Clip:
    """A clip of random small displacements, each from the frame before."""
    random = np.random.default_rng(seed)
    q = [figure.neutral]
    for _ in range(frames - 1):
        q.append(pin.integrate(figure.model, q[-1], 0.05 * random.standard_normal(figure.model.nv)))
    return wb.Clip(figure, np.array(q), dt, "walk")


def test_a_clip_keeps_a_read_only_copy(human: Figure) -> None:
    q = np.array([human.neutral] * 3)
    clip = wb.Clip(human, q, 0.1)
    q[:] = np.nan
    assert np.isfinite(clip.q).all()
    assert clip.names == human.joints
    assert len(clip) == 3
    assert clip.duration == pytest.approx(0.2)
    assert clip.times == pytest.approx([0.0, 0.1, 0.2])
    with pytest.raises(ValueError, match="read-only"):
        clip.q[0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        clip.dt = 1.0  # type: ignore[misc]


def test_quaternions_are_normalised_and_refused_where_they_are_far_off(human: Figure) -> None:
    q = np.array([human.neutral] * 2)
    q[1, 3:7] *= 1.0005
    assert np.linalg.norm(wb.Clip(human, q, 0.1).q[:, 3:7], axis=1) == pytest.approx(1.0, abs=1e-12)
    q[1, 3:7] *= 1.01
    with pytest.raises(wb.InputError, match=r"clip: frame 1, value 6 of the root belongs to a quaternion"):
        wb.Clip(human, q, 0.1)
    q[1, 3:7] = 0.0
    with pytest.raises(wb.InputError, match="frame 1, "):
        wb.Clip(human, q, 0.1)


def test_a_value_that_is_not_finite_is_named(human: Figure) -> None:
    q = np.array([human.neutral] * 4)
    column = human.model.joints[human.joint_id("left_knee_flexion")].idx_q
    q[2, column] = np.nan
    with pytest.raises(wb.InputError, match="walk: frame 2, joint left_knee_flexion is nan; 1 values"):
        wb.Clip(human, q, 0.1, "walk")


def test_between_frames_a_clip_moves_at_constant_velocity(human: Figure) -> None:
    clip = moving(human, 3)
    whole = pin.difference(human.model, clip.q[1], clip.q[2])
    part = pin.difference(human.model, clip.q[1], clip.at(0.13))
    assert part == pytest.approx(0.3 * whole, abs=1e-9)
    assert clip.at(0.1) == pytest.approx(clip.q[1], abs=0.0)
    assert clip.at(clip.duration) == pytest.approx(clip.q[2], abs=0.0)
    with pytest.raises(wb.InputError, match=r"^walk: t is 0\.3 s; give a time from 0 to 0\.2 s$"):
        clip.at(0.3)
    with pytest.raises(wb.InputError, match="t is nan; give a finite number"):
        clip.at(np.nan)


def test_a_clip_of_one_frame(human: Figure) -> None:
    clip = wb.Clip(human, [human.neutral], 0.1)  # type: ignore[arg-type]
    assert clip.duration == 0.0
    assert clip.at(0.0) == pytest.approx(human.neutral)
    assert not clip.velocities().any()
    assert not clip.accelerations().any()
    assert len(clip.resampled(0.01)) == 1


def test_resampling_to_a_multiple_and_back_gives_the_frames_again(human: Figure) -> None:
    clip = moving(human, 9)
    fine = clip.resampled(0.025)
    assert len(fine) == 33
    assert fine.q[::4] == pytest.approx(clip.q, abs=1e-12)
    assert fine.resampled(0.1).q == pytest.approx(clip.q, abs=1e-12)
    assert fine[::4].q == pytest.approx(clip.q, abs=1e-12)
    assert fine[::4].dt == pytest.approx(clip.dt)


def test_a_time_step_of_few_digits_loses_no_frame(human: Figure) -> None:
    clip = moving(human, 9)
    written = wb.Clip(human, clip.q, 0.0333333)
    assert written.resampled(1 / 30).q == pytest.approx(clip.q, abs=1e-4)
    assert len(written.resampled(0.034)) == len(clip) - 1


def test_slices_and_joins(human: Figure) -> None:
    clip = moving(human, 9)
    assert clip[2:5].q == pytest.approx(clip.q[2:5], abs=0.0)
    assert clip[:4].joined(clip[4:]).q == pytest.approx(clip.q, abs=0.0)
    assert clip[-2:].q == pytest.approx(clip.q[7:], abs=0.0)
    for wrong in (slice(5, 5), slice(7, 2), slice(None, None, -1), slice(100, 200), 3, "a", slice("a", "b")):
        with pytest.raises(wb.InputError, match="walk"):
            clip[wrong]  # type: ignore[index]
    with pytest.raises(wb.InputError, match="resample one"):
        clip.joined(clip.resampled(0.05))
    with pytest.raises(wb.InputError, match="has other joints"):
        clip.joined(wb.Clip(wb.load("hand"), [wb.load("hand").neutral], 0.1))  # type: ignore[arg-type]


def test_derivatives_of_polynomials_are_exact(human: Figure) -> None:
    dt, n = 0.04, 12
    t = np.arange(n) * dt
    joint = human.model.joints[human.joint_id("left_elbow_flexion")]
    q = np.tile(human.neutral, (n, 1))
    q[:, joint.idx_q] = 0.3 + 0.5 * t - 2.0 * t**2 + 4.0 * t**3
    clip = wb.Clip(human, q, dt)
    assert clip.accelerations()[:, joint.idx_v] == pytest.approx(-4.0 + 24.0 * t, abs=1e-9)
    q[:, joint.idx_q] = 0.3 + 0.5 * t - 2.0 * t**2
    assert wb.Clip(human, q, dt).velocities()[:, joint.idx_v] == pytest.approx(0.5 - 4.0 * t, abs=1e-9)


def test_a_root_that_turns_steadily_has_its_angular_velocity_in_its_own_axes(human: Figure) -> None:
    turning = np.array([0.0, 0.0, 0.0, 0.3, -0.2, 0.5])
    v = np.zeros(human.model.nv)
    v[:6] = turning
    clip = wb.Clip(human, [pin.integrate(human.model, human.neutral, 0.1 * k * v) for k in range(8)], 0.1)  # type: ignore[arg-type]
    assert clip.velocities()[:, :6] == pytest.approx(np.tile(turning, (8, 1)), abs=1e-9)
    assert clip.accelerations() == pytest.approx(np.zeros((8, human.model.nv)), abs=1e-9)


def test_central_differences_converge_with_the_square_of_the_step(human: Figure) -> None:
    """The body velocity of exp(a t) exp(b t) is Ad(exp(-b t)) a + b, which no difference formula knows."""
    a, b = np.array([0.2, 0.1, 0.3, 0.5, -1.0, 0.7]), np.array([0.0, -0.2, 0.1, 1.1, 0.4, -0.6])
    errors = []
    for dt in (0.02, 0.01):
        q = np.tile(human.neutral, (9, 1))
        for k in range(9):
            q[k, :7] = pin.SE3ToXYZQUAT(pin.exp6(pin.Motion(a * k * dt)) * pin.exp6(pin.Motion(b * k * dt)))
        exact = pin.exp6(pin.Motion(b * 4 * dt)).actInv(pin.Motion(a)).vector + b
        clip = wb.Clip(human, q, dt)
        rate = -pin.Motion(b).cross(pin.exp6(pin.Motion(b * 4 * dt)).actInv(pin.Motion(a))).vector
        errors.append(
            (np.abs(clip.velocities()[4, :6] - exact).max(), np.abs(clip.accelerations()[4, :6] - rate).max())
        )
    assert errors[0][0] / errors[1][0] == pytest.approx(4.0, rel=0.1)
    assert errors[0][1] / errors[1][1] == pytest.approx(4.0, rel=0.1)


def test_a_mirrored_person_has_mirrored_landmarks(human: Figure) -> None:
    clip = moving(human, 4)
    twin = clip.mirrored()
    mirror, data = np.array([1.0, -1.0, 1.0]), human.model.createData()

    def places(q: np.ndarray, side: str) -> np.ndarray:
        pin.framesForwardKinematics(human.model, data, q)
        return np.array([data.oMf[human.frame_id(f"{side}_{name}")].translation for name in SYMMETRIC])

    for q, its in zip(clip.q, twin.q, strict=True):
        assert places(its, "left") == pytest.approx(places(q, "right") * mirror, abs=1e-9)
        assert places(its, "right") == pytest.approx(places(q, "left") * mirror, abs=1e-9)
    assert twin.mirrored().q == pytest.approx(clip.q, abs=0.0)


def test_a_figure_without_two_sides_is_not_mirrored(planar_arm: Callable[..., Figure]) -> None:
    arm = planar_arm([0.3, 0.2])
    with pytest.raises(wb.InputError, match="cannot be mirrored"):
        wb.Clip(wb.load("hand"), [wb.load("hand").neutral], 0.1).mirrored()  # type: ignore[arg-type]
    bent = wb.Clip(arm, [[0.3, -0.2]], 0.1)  # type: ignore[arg-type]
    assert bent.mirrored().q == pytest.approx(-bent.q)  # an arm in a plane is its own mirror image


def test_a_written_clip_is_read_again_without_loss(human: Figure, tmp_path: Path) -> None:
    clip = moving(human, 5)
    again = wb.read_clip(clip.write(tmp_path / "walk.npz"), human)
    assert again.q == pytest.approx(clip.q, abs=1e-15)
    assert (again.dt, again.name) == (clip.dt, "walk")


def test_clips_of_another_figure_and_other_endings_are_refused(human: Figure, tmp_path: Path) -> None:
    path = moving(human, 2).write(tmp_path / "walk.npz")
    with pytest.raises(wb.UnknownNameError, match=r"walk\.npz"):
        wb.read_clip(path, wb.load("hand"))
    with pytest.raises(wb.FileFormatError, match=r"walk\.xyz: a clip cannot be written as \.xyz; give one of"):
        moving(human, 2).write(tmp_path / "walk.xyz")
    with pytest.raises(wb.FileFormatError, match="there is no such file"):
        wb.read_clip(tmp_path / "none.npz", human)
    assert [path.name for path in tmp_path.iterdir()] == ["walk.npz"]
    with np.load(path) as arrays:
        np.savez(path, **{**arrays, "wholebody_clip": np.array(2)})
    with pytest.raises(wb.FileFormatError, match=r"walk\.npz: its layout is 2, and 1 is known"):
        wb.read_clip(path, human)


@pytest.fixture(scope="module")
def written(human: Figure, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return moving(human, 3).write(tmp_path_factory.mktemp("clip") / "walk.npz").read_bytes()


@given(data=st.data())
def test_a_damaged_archive_is_one_sentence_or_a_clip(
    data: st.DataObject, written: bytes, human: Figure, tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = bytearray(written[: data.draw(st.integers(0, len(written)))])
    for _ in range(data.draw(st.integers(0, 3))):
        if content:
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    path.write_bytes(content)
    try:
        clip = wb.read_clip(path, human)
        said = f"damaged.npz holds {len(clip)} finite frames" if np.isfinite(clip.q).all() else "not finite"
    except wb.WholebodyError as error:
        said = str(error)
    assert "damaged.npz" in said
    assert "\n" not in said


def test_a_clip_is_read_on_the_figure_that_it_was_made_with(human: Figure, tmp_path: Path) -> None:
    """On legs of another length its feet would leave the ground, or be in it."""
    woman = wb.load("human", sex="female", percentile=5)
    clip = moving(woman, 3)
    archive, scene = clip.write(tmp_path / "walk.npz"), clip.write(tmp_path / "walk.glb")
    with pytest.raises(wb.FileFormatError, match=r"walk\.npz: is of another size of human: .* mm from .*female"):
        wb.read_clip(archive, human)
    again = made_with(archive)
    assert again is not None
    assert wb.read_clip(archive, again).q == pytest.approx(clip.q, abs=1e-15)
    heavier = wb.load("human", sex="female", percentile=5, clothing=0.01)  # the same joints
    assert wb.read_clip(archive, heavier).q == pytest.approx(clip.q, abs=1e-15)
    assert wb.read_clip(scene, woman).q == pytest.approx(clip.q, abs=1e-6)
    assert np.abs(wb.read_clip(scene, human).q - clip.q).max() > 0.01  # retargeted, as any other skeleton


def test_commands_take_the_figure_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = moving(wb.load("human", sex="female", percentile=5), 3).write(tmp_path / "walk.npz")
    assert main(["clip", "convert", str(path), str(tmp_path / "again.npz")]) == 0
    again = made_with(tmp_path / "again.npz")
    assert again is not None
    assert again.loaded_as == ("human", {"sex": "female", "percentile": 5})
    assert main(["clip", "info", str(path), "--sex", "male"]) == 2
    assert "another size" in capsys.readouterr().err

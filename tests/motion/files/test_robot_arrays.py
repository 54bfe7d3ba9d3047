"""What programs that train robots read of a clip: places of bodies are MuJoCo's, velocities those of the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb

mujoco = pytest.importorskip("mujoco")

ROBOT = """<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/><geom size="0.1"/>
<body name="arm" pos="0.1 0.2 0.3"><joint name="shoulder" axis="1 0 0"/><geom size="0.05"/>
<body name="hand" pos="0.3 0 0"><joint name="elbow" axis="0 1 0"/><geom size="0.05"/></body></body>
<body name="leg" pos="0 0 -0.4"><joint name="slide" type="slide" axis="0 0 1"/><geom size="0.05"/></body>
</body></worldbody></mujoco>"""


@pytest.fixture
def clip(tmp_path: Path) -> wb.Clip:
    (tmp_path / "robot.xml").write_text(ROBOT)
    robot = wb.load(tmp_path / "robot.xml")
    time = np.linspace(0.0, 1.0, 51)
    q = np.zeros((51, 10))
    q[:, 0], q[:, 2] = 0.5 * time, 1.0 + 0.1 * np.sin(time)
    q[:, 5], q[:, 6] = np.sin(2.0 * time), np.cos(2.0 * time)  # about z, 4 rad/s: w changes its sign
    q[:, 7:] = np.stack([np.sin(time), 0.4 * time, 0.1 * time], axis=1)
    return wb.Clip(robot, q, 0.02, "turn")


def test_bodies_are_where_mujoco_has_them(clip: wb.Clip, tmp_path: Path) -> None:
    arrays = np.load(clip.write(tmp_path / "turn.npz"))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    names = [model.body(k).name for k in range(1, model.nbody)]
    assert arrays["body_names"].tolist() == names
    assert arrays["joint_names"].tolist() == [model.joint(k).name for k in range(1, model.njnt)]
    assert arrays["fps"] == pytest.approx(50.0)
    for k in (0, 20, 50):
        data.qpos[:3], data.qpos[3:7] = arrays["root_pos"][k], np.roll(arrays["root_rot"][k], 1)
        data.qpos[7:] = arrays["dof_pos"][k]
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(arrays["body_pos_w"][k], data.xpos[1:], atol=1e-12)
        turns = arrays["body_quat_w"][k]
        np.testing.assert_allclose(np.abs(np.sum(turns * data.xquat[1:], axis=1)), 1.0, atol=1e-12)
    assert (np.sum(arrays["body_quat_w"][1:] * arrays["body_quat_w"][:-1], axis=2) > 0.0).all()


def test_velocities_are_those_of_the_motion(clip: wb.Clip, tmp_path: Path) -> None:
    arrays = np.load(clip.write(tmp_path / "turn.npz"))
    moved = np.gradient(arrays["body_pos_w"], 0.02, axis=0)
    np.testing.assert_allclose(arrays["body_lin_vel_w"][1:-1], moved[1:-1], atol=4e-3)
    np.testing.assert_allclose(arrays["body_ang_vel_w"][:, 0], np.tile([0.0, 0.0, 4.0], (51, 1)), atol=1e-6)
    np.testing.assert_allclose(arrays["joint_vel"][1:-1, 1:], np.tile([0.4, 0.1], (49, 1)), atol=1e-9)


def test_they_are_beside_what_is_read_back_and_not_in_files_of_people(clip: wb.Clip, tmp_path: Path) -> None:
    path = clip.write(tmp_path / "turn.npz")
    np.testing.assert_array_equal(wb.read_clip(path, clip.figure).q, clip.q)
    human = wb.load("human")
    assert "body_pos_w" not in np.load(wb.Clip(human, [human.neutral], 0.1).write(tmp_path / "p.npz"))


def test_bare_numbers_are_rows_of_root_and_joints(clip: wb.Clip, tmp_path: Path) -> None:
    path = clip.resampled(1.0 / 30.0).write(tmp_path / "turn.csv", bare=True)
    np.testing.assert_array_equal(np.loadtxt(path, delimiter=","), clip.resampled(1.0 / 30.0).q)
    with pytest.warns(UserWarning, match="30 frames a second"):
        again = wb.read_clip(path, clip.figure)
    np.testing.assert_array_equal(again.q, clip.resampled(1.0 / 30.0).q)
    with pytest.raises(wb.InputError, match=r"ending \.csv"):
        clip.write(tmp_path / "turn.npz", bare=True)
    with pytest.raises(wb.InputError, match="give True or False"):
        clip.write(path, bare="yes")  # type: ignore[arg-type]

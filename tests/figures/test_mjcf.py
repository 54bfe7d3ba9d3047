"""MJCF files: kinematics as MuJoCo has them, geoms as pieces, and sentences where Pinocchio does not follow."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<asset><mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/></asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 0.1" pos="0 0 -1"/>
  <body name="base"><geom type="box" size="0.05 0.05 0.05"/>
    <body name="upper" pos="0 0 0.1"><joint name="swing" axis="0 1 0" range="-1 1" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02"/>
      <body name="fore" pos="0 0 0.25"><joint name="roll" axis="1 0 0"/>
        <geom type="cylinder" size="0.02 0.1" pos="0 0 0.1"/>
        <geom type="ellipsoid" size="0.02 0.03 0.04" pos="0 0 0.2"/>
        <body name="hand" pos="0 0 0.25"><joint name="slide" type="slide" axis="0 0 1" range="0 0.1" limited="true"/>
          <geom type="mesh" mesh="wedge"/><geom type="sphere" size="0.03" contype="0" conaffinity="0"/>
          <site name="tip" pos="0 0 0.1"/>
</body></body></body></body></worldbody></mujoco>"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def test_bodies_joints_and_geoms_are_read(arm: Path) -> None:
    figure = wb.load(arm)
    assert (figure.name, figure.root, figure.joints) == ("arm", "fixed", ("swing", "roll", "slide"))
    kinds = {piece.name: type(piece.geometry).__name__ for piece in figure.geometry.geometryObjects}
    assert kinds.pop("base:0") == "Box"
    assert kinds == {"upper:0": "Capsule", "fore:0": "Convex", "fore:1": "Ellipsoid", "hand:0": "Convex"}
    assert figure.limits.upper == pytest.approx([1.0, 0.1])
    assert figure.notes == ("the geoms of the world are not read; add them to the scene",)
    scene = wb.Scene(figure)
    data = figure.model.createData()
    q = figure.with_joints(figure.neutral, {"swing": 0.4, "roll": -0.7, "slide": 0.06})
    pin.framesForwardKinematics(figure.model, data, q)
    target = data.oMf[figure.frame_id("tip")].translation.copy()
    assert wb.solve(wb.Problem(scene, goals=[wb.Point("tip", target)])).solved
    assert wb.load(arm, root="free").root == "free"


@pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="mujoco is not installed")
def test_kinematics_are_mujocos(arm: Path) -> None:
    import mujoco

    figure, model = wb.load(arm), mujoco.MjModel.from_xml_path(str(arm))
    values = {"swing": 0.4, "roll": -0.7, "slide": 0.06}
    theirs = mujoco.MjData(model)
    for name, value in values.items():
        theirs.joint(name).qpos = value
    mujoco.mj_forward(model, theirs)
    ours = figure.model.createData()
    pin.framesForwardKinematics(figure.model, ours, figure.with_joints(figure.neutral, values))
    assert np.array(ours.oMf[figure.frame_id("tip")].translation) == pytest.approx(theirs.site("tip").xpos, abs=1e-9)


def test_what_is_not_kept_is_told(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    equality = '<equality><joint joint1="swing" joint2="roll"/></equality></mujoco>'
    path.write_text(ARM.replace('<body name="base">', '<body name="base" pos="0 0 1">').replace("</mujoco>", equality))
    notes = " ".join(wb.load(path).notes)
    assert "1 constraints in <equality> are not kept" in notes
    assert "body 'base': its place in the world is not kept" in notes


WRONG = {
    "several joints": (
        ARM.replace('<joint name="roll"', '<joint name="x" axis="0 0 1"/><joint name="roll"'),
        "each of",
    ),
    "no bodies": ("<mujoco><worldbody/></mujoco>", "cannot read it|no bodies"),
    "a height field": (
        ARM.replace("<asset>", '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1" elevation="0 0 0 0"/>'),
        "hfields are not supported",
    ),
    "broken": (ARM[:-5], "XML is broken"),
    "another file": ("<scene/>", "<scene>, not <robot>"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_one_sentence(what: str, tmp_path: Path) -> None:
    text, words = WRONG[what]
    path = tmp_path / "robot.xml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=words) as caught:
        wb.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_options_are_checked(arm: Path) -> None:
    with pytest.raises(InputError, match="'fixed' or 'free'"):
        wb.load(arm, root="floating")
    with pytest.raises(UnknownNameError, match=r"'hnd'.*hand"):
        wb.load(arm, concavity={"hnd": 0.1})
    with pytest.raises(InputError, match="concavity of link 'hand' is 2"):
        wb.load(arm, concavity={"hand": 2})


def test_a_urdf_may_be_called_xml(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text('<robot name="r"><link name="a"/></robot>')
    assert wb.load(path).frames == ("a",)

"""SRDF files: groups, states and pairs are MoveIt's, and lines that name nothing are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError

BALL = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
LINKS = "".join(f'<link name="l{k}">{BALL}</link>' for k in range(5))
JOINTS = "".join(
    f'<joint name="j{k}" type="{"continuous" if k == 3 else "revolute"}"><parent link="l{k - 1}"/><child link="l{k}"/>'
    '<origin xyz="0.2 0 0"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>'
    for k in range(1, 5)
)
SRDF = """<robot name="r">
  <group name="arm"><chain base_link="l0" tip_link="l2"/></group>
  <group name="hand"><joint name="j4"/><link name="l3"/><joint name="gone"/></group>
  <group name="whole"><group name="arm"/><group name="hand"/></group>
  <group_state name="home" group="arm"><joint name="j1" value="0.5"/><joint name="j3" value="-0.4"/></group_state>
  <group_state name="open" group="hand"><joint name="j4" value="0.3"/></group_state>
  <group_state name="open" group="arm"><joint name="j1" value="0.1"/></group_state>
  <disable_collisions link1="l0" link2="l3" reason="Never"/>
  <disable_collisions link1="l0" link2="elsewhere" reason="Never"/>
</robot>"""


def files(folder: Path, srdf: str = SRDF) -> tuple[Path, Path]:
    (folder / "r.urdf").write_text(f'<robot name="r">{LINKS}{JOINTS}</robot>')
    (folder / "r.srdf").write_text(srdf)
    return folder / "r.urdf", folder / "r.srdf"


def test_groups_states_and_pairs_are_read(tmp_path: Path) -> None:
    urdf, srdf = files(tmp_path)
    plain, figure = wb.load(urdf), wb.load(urdf, srdf=srdf)
    assert figure.groups["arm"] == ("j1", "j2")
    assert figure.groups["hand"] == ("j3", "j4")
    assert figure.groups["whole"] == ("j1", "j2", "j3", "j4")
    values = figure.joint_values(figure.posture("home"))
    assert (values["j1"], values["j2"], values["j3"]) == pytest.approx((0.5, 0.0, -0.4))
    assert figure.joint_values(figure.posture("hand/open"))["j4"] == pytest.approx(0.3)
    reasons = {frozenset((pair.a, pair.b)): pair.reason for pair in figure.excluded_pairs}
    assert reasons[frozenset(("l0:0", "l3:0"))] == "the SRDF disables them: Never"
    assert len(figure.geometry.collisionPairs) == len(plain.geometry.collisionPairs) - 1
    assert any("'elsewhere' is not in the URDF" in note for note in figure.notes)
    assert "SRDF: group 'hand' names the joint 'gone', which is not in the URDF" in figure.notes
    more = (
        '<virtual_joint name="v" type="floating" parent_frame="w" child_link="l0"/><passive_joint name="j4"/></robot>'
    )
    noted = wb.load(urdf, srdf=files(tmp_path, SRDF.replace("</robot>", more))[1]).notes
    assert "SRDF: passive_joint, virtual_joint is not kept" in noted
    assert "SRDF: passive_joint is not kept" in wb.load(urdf, srdf=srdf, root="free").notes


def test_a_link_is_disabled_but_for_pairs_that_are_enabled(tmp_path: Path) -> None:
    more = '<disable_default_collisions link="l0"/><enable_collisions link1="l0" link2="l4"/>'
    group = '<group name="none"><group name="gone"/></group></robot>'
    urdf, srdf = files(tmp_path, SRDF.replace("</robot>", more + group))
    figure = wb.load(urdf, srdf=srdf)
    names = [piece.name for piece in figure.geometry.geometryObjects]
    tested = {frozenset((names[pair.first], names[pair.second])) for pair in figure.geometry.collisionPairs}
    assert [pair for pair in tested if "l0:0" in pair] == [frozenset(("l0:0", "l4:0"))]
    assert frozenset(("l1:0", "l3:0")) in tested
    assert "SRDF: group 'none' names 'gone', which is no other group" in figure.notes


def test_no_state_of_an_srdf_is_lost(tmp_path: Path) -> None:
    states = "".join(
        f'<group_state name="{name}" group="arm"><joint name="j1" value="{value}"/></group_state>'
        for name, value in (("neutral", 0.7), ("home", 0.2))
    )
    urdf, srdf = files(tmp_path, SRDF.replace("<disable_c", f"{states}<disable_c", 1))
    figure = wb.load(urdf, srdf=srdf)
    assert figure.joint_values(figure.posture("neutral of the file"))["j1"] == pytest.approx(0.7)
    assert figure.joint_values(figure.posture("arm/home"))["j1"] == pytest.approx(0.2)
    assert "posture 'neutral' of the file is called 'neutral of the file'" in figure.notes
    assert "SRDF: state 'arm/home' is there twice; the last one is kept" in figure.notes
    twice = SRDF.replace("<group_state", '<group name="arm"><joint name="j1"/></group><group_state', 1)
    figure = wb.load(urdf, srdf=files(tmp_path, twice)[1])
    assert figure.groups["arm"] == ("j1",)
    assert "SRDF: group 'arm' is there twice; the last one is kept" in figure.notes


def test_a_state_is_within_limits_but_where_the_file_says_otherwise(tmp_path: Path) -> None:
    urdf, srdf = files(tmp_path, SRDF.replace('"j3" value="-0.4"', '"j4" value="2.5"'))
    urdf.write_text(urdf.read_text().replace('lower="-2"', 'lower="0.05"'))
    figure = wb.load(urdf, srdf=srdf)
    values = figure.joint_values(figure.posture("home"))
    assert (values["j1"], values["j2"], values["j3"], values["j4"]) == pytest.approx((0.5, 0.05, 0.0, 2.5))
    assert [note for note in figure.notes if "limits" in note] == [
        "SRDF: state 'home' puts the joint 'j4' beyond its limits"
    ]


def test_the_place_of_a_free_root_is_that_of_pinocchio(tmp_path: Path) -> None:
    root = '<joint name="root_joint" value="0.1 0.2 0.3 0 0 0.6 0.8"/>'
    urdf, srdf = files(tmp_path, SRDF.replace('<joint name="j1" value="0.5"/>', root))
    figure = wb.load(urdf, srdf=srdf, root="free")
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    pin.loadReferenceConfigurations(model, str(srdf), False)
    assert figure.posture("home") == pytest.approx(model.referenceConfigurations["home"], abs=1e-12)
    assert wb.load(urdf, srdf=srdf).posture("home") == pytest.approx(figure.posture("home")[7:])
    srdf.write_text(srdf.read_text().replace("0.6 0.8", "0.6 0.7"))
    with pytest.raises(FileFormatError, match=r"'root_joint': .*quaternion"):
        wb.load(urdf, srdf=srdf, root="free")


def test_a_wrong_srdf_is_one_sentence(tmp_path: Path) -> None:
    urdf, srdf = files(tmp_path, SRDF.replace('value="0.5"', 'value="0,5"'))
    with pytest.raises(FileFormatError, match=r"state 'home': joint 'j1': .*'0,5'"):
        wb.load(urdf, srdf=srdf)
    srdf.write_text("<mujoco/>")
    with pytest.raises(FileFormatError, match="give a robot's SRDF"):
        wb.load(urdf, srdf=srdf)
    srdf.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="arm.xacro"/></robot>')
    with pytest.raises(FileFormatError, match=r"`xacro r\.srdf > robot\.srdf`"):
        wb.load(urdf, srdf=srdf)
    with pytest.raises(FileFormatError, match=r"gone\.srdf"):
        wb.load(urdf, srdf=tmp_path / "gone.srdf")


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
def test_a_planar_joint_moves_in_the_plane_normal_to_its_axis(axis: tuple[float, ...], tmp_path: Path) -> None:
    (tmp_path / "p.urdf").write_text(
        f'<robot name="p"><link name="a"/><link name="b">{BALL}</link><link name="c">{BALL}</link>'
        '<joint name="flat" type="planar"><parent link="a"/><child link="b"/>'
        '<origin xyz="0.1 0.2 0.3" rpy="0.3 0 0.4"/>'
        f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/></joint><joint name="j" type="revolute"><parent link="b"/>'
        '<child link="c"/><origin xyz="0 0.1 0.2"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    figure = wb.load(tmp_path / "p.urdf")
    start = figure.placement(figure.neutral, "b")
    assert start.translation == pytest.approx([0.1, 0.2, 0.3])
    hinge = start.actInv(figure.placement(figure.neutral, "c"))
    assert hinge.translation == pytest.approx([0.0, 0.1, 0.2])
    assert hinge.rotation == pytest.approx(np.eye(3))
    normal = start.rotation @ np.array(axis)
    flat = figure.model.joints[figure.joint_id("flat")]
    for x, y, angle in ((0.3, 0.0, 0.0), (0.0, -0.2, 0.0), (0.1, 0.4, 0.7)):
        q = figure.neutral.copy()
        q[flat.idx_q : flat.idx_q + 4] = x, y, np.cos(angle), np.sin(angle)
        moved = figure.placement(q, "b")
        step = moved.translation - start.translation
        assert normal @ step == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(step) == pytest.approx(np.hypot(x, y))
        assert moved.rotation @ np.array(axis) == pytest.approx(normal)


def test_a_follower_stays_within_its_own_limits(tmp_path: Path) -> None:
    limit = '<limit lower="-2" upper="2" velocity="1" effort="1"/></joint><joint name="j3"'
    own = limit.replace('lower="-2" upper="2"', 'lower="-0.4" upper="1"')
    text = JOINTS.replace(limit, f'<mimic joint="j1" multiplier="2"/>{own}')
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{LINKS}{text}</robot>')
    figure = wb.load(tmp_path / "r.urdf")
    slot = figure.model.joints[figure.joint_id("j1")].idx_q
    ends = figure.model.lowerPositionLimit[slot], figure.model.upperPositionLimit[slot]
    assert ends == pytest.approx((-0.2, 0.5))

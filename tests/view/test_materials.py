"""The colours of a robot's file in the viewer."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.view.bodies import Bodies
from wholebody.view.style import LOOK

TEXT = """<robot name="r">
  <material name="sky"><color rgba="0.1 0.2 0.9 1"/></material>
  <material name="wrong"><color rgba="300 0 0"/></material>
  <link name="a"><visual><geometry><sphere radius="0.1"/></geometry><material name="sky"/></visual>SHAPE</link>
  <link name="b"><visual><geometry><sphere radius="0.1"/></geometry><material name="own">
    <color rgba="1 0 0 0.5"/></material></visual>SHAPE</link>
  <link name="c">SHAPE</link>
  <link name="d"><visual><geometry><sphere radius="0.1"/></geometry><material name="wrong"/></visual>SHAPE</link>
  <link name="e"><visual><geometry><sphere radius="0.1"/></geometry><material name="glass">
    <color rgba="1 1 1 0"/></material></visual>SHAPE</link>
  <joint name="ab" type="continuous"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/></joint>
  <joint name="bc" type="continuous"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/></joint>
  <joint name="cd" type="continuous"><parent link="c"/><child link="d"/><origin xyz="1 0 0"/></joint>
  <joint name="de" type="continuous"><parent link="d"/><child link="e"/><origin xyz="1 0 0"/></joint>
</robot>""".replace("SHAPE", '<collision><geometry><sphere radius="0.1"/></geometry></collision>')

COLORS = {
    "a": (0.1, 0.2, 0.9, 1.0),
    "b": (1.0, 0.0, 0.0, 0.5),
    "c": LOOK.figure,
    "d": LOOK.figure,
    "e": LOOK.figure,
}


@pytest.fixture
def robot(tmp_path: Path) -> wb.Figure:
    path = tmp_path / "robot.urdf"
    path.write_text(TEXT)
    return wb.load(path)


def shown(scene: wb.Scene) -> dict[str, tuple[float, ...]]:
    bodies = Bodies(scene, (), pieces=False)
    owners = zip(scene.piece_owner, bodies.all, strict=True)
    return {owner: body.color for owner, body in owners if body.thing is None}


def test_links_have_the_colours_of_their_materials(robot: wb.Figure) -> None:
    scene = wb.Scene(robot).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(0.0, 0.0, 2.0), color="#00ff00")
    assert shown(scene) == {name: pytest.approx(color) for name, color in COLORS.items()}
    for same in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot), robot.reduced(["ab"])):
        assert shown(wb.Scene(same)) == {name: pytest.approx(color) for name, color in COLORS.items()}


def test_a_material_that_is_no_colour_is_told_and_left_out(robot: wb.Figure) -> None:
    assert sum("material 'wrong': rgba='300 0 0' is no colour" in note for note in robot.notes) == 1


def test_a_link_that_is_seen_through_is_in_the_picture(robot: wb.Figure) -> None:
    scene = wb.Scene(robot)
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, robot.neutral)
    corners = Bodies(scene, (), pieces=False).corners(data, things=False)
    assert len(corners) == 8 * 5

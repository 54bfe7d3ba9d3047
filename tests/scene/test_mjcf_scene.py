"""Scenes of MJCF files: what is around the robot, where MuJoCo has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import wholebody as wb

mujoco = pytest.importorskip("mujoco", reason="MuJoCo, which reads MJCF files, is not installed")

CELL = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1" pos="0 0 -0.2"/>
  <body name="arm" pos="0 0 0.1"><joint name="turn" axis="0 0 1"/>
    <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/></body>
  <body name="bench" pos="0.8 0 0" euler="0 0 30"><geom type="box" size="0.2 0.3 0.05"/>
    <body name="lamp" pos="0 0 0.1"><geom name="foot" size="0.02"/>
      <geom name="rod" type="cylinder" size="0.01 0.1"/></body></body>
  <body name="goal" mocap="true" pos="0 1 0"><geom type="ellipsoid" size="0.05 0.06 0.07"/></body>
  <body name="mark"><geom size="0.5" contype="0" conaffinity="0"/></body>
  <body name="mug" pos="0.7 0 0.2"><freejoint/><geom type="cylinder" size="0.04 0.05" mass="0.3"/>
    <geom type="box" size="0.01 0.01 0.02" pos="0.05 0 0" mass="0.1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "cell.xml").write_text(CELL)
    return tmp_path / "cell.xml"


def test_what_is_around_the_robot_becomes_things(path: Path) -> None:
    scene = wb.read_scene(path)
    assert scene.figure.joints == ("turn",)
    assert set(scene.objects) == {"floor", "bench", "foot", "rod", "goal", "mug"}
    assert isinstance(scene.objects["floor"].shape, wb.HalfSpace)
    mug = scene.objects["mug"].body
    assert mug is not None
    assert mug.mass == pytest.approx(0.4)


def test_a_free_thing_may_have_its_shapes_in_a_part_of_it(tmp_path: Path) -> None:
    """Gymnasium's kitchen has a kettle whose outermost body has no geom."""
    kettle = """<body name="kettle" pos="0 0 1"><freejoint/>
      <body pos="0 0.1 0"><geom size="0.05" mass="0.2" rgba="1 0 0 1"/></body></body></worldbody>"""
    path = tmp_path / "kitchen.xml"
    path.write_text(CELL.replace("</worldbody>", kettle))
    thing = wb.read_scene(path).objects["kettle"]
    assert thing.color[:3] == pytest.approx((1.0, 0.0, 0.0))
    assert np.allclose(thing.placement.translation, (0.0, 0.1, 1.0))


def test_distances_are_mujocos(path: Path) -> None:
    scene, model = wb.read_scene(path), mujoco.MjModel.from_xml_path(str(path))
    theirs, q = mujoco.MjData(model), scene.figure.with_joints(scene.figure.neutral, {"turn": 0.7})
    theirs.qpos[0] = 0.7
    mujoco.mj_forward(model, theirs)
    arm, ends = model.body_geomadr[model.body("arm").id], np.zeros(6)
    contacts = scene.contacts(q, within=10.0)
    owners = np.array(scene.piece_owner)[contacts.pair].tolist()
    ours = dict(zip(map(frozenset, owners), contacts.distance, strict=True))
    for name in ("floor", "foot", "rod"):
        expected = mujoco.mj_geomDistance(model, theirs, arm, model.geom(name).id, 10.0, ends)
        assert ours[frozenset(("arm", name))] == pytest.approx(expected, abs=2e-4), name  # a rod is a prism of 64 sides


def test_a_urdf_is_no_scene(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text('<robot name="r"><link name="a"/></robot>')
    with pytest.raises(wb.FileFormatError, match="<mujoco>"):
        wb.read_scene(tmp_path / "robot.xml")


def test_a_height_that_is_no_number_is_refused_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "terrain.xml").write_text(
        '<mujoco><asset><hfield name="h" nrow="2" ncol="3" size="1 1 1 0.1" elevation="0 0 0 0 nan 0"/></asset>'
        '<worldbody><geom type="hfield" hfield="h"/><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(wb.FileFormatError, match=r"terrain\.xml: a height field has nan in row \d, column 1"):
        wb.read_scene(tmp_path / "terrain.xml")


def test_a_height_field_is_as_high_as_mujoco_has_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    heights = rng.random((6, 9))
    heights[:3] = 0.4  # flat cells are joined
    path = tmp_path / "terrain.xml"
    path.write_text(
        '<mujoco><asset><hfield name="h" nrow="6" ncol="9" size="1 0.8 0.3 0.1" '
        f'elevation="{" ".join(map(str, heights.ravel()))}"/></asset><worldbody>'
        '<geom name="terrain" type="hfield" hfield="h" pos="0.2 0.1 0.05" euler="0 0 30"/><body name="post">'
        '<joint type="slide" axis="0 0 1"/><geom size="0.02" pos="9 0 0"/></body></worldbody></mujoco>'
    )
    scene, model = wb.read_scene(path), mujoco.MjModel.from_xml_path(str(path))
    pieces = zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True)
    hulls = [
        ConvexHull(np.array(piece.geometry.points()) @ piece.placement.rotation.T + piece.placement.translation)
        for piece, owner in pieces
        if owner == "terrain"
    ]
    assert len(hulls) == 2 + 2 * 8 * 3
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hits = 0
    for x, y in rng.uniform((-0.6, -0.5), (0.9, 0.7), (60, 2)):
        start, way = np.array([x, y, 3.0]), np.array([0.0, 0.0, -1.0])
        down = mujoco.mj_ray(model, data, start, way, None, 1, -1, np.zeros(1, np.int32))
        tops = [top for hull in hulls if (top := _top(hull.equations, x, y)) is not None]
        assert (down < 0.0) == (not tops)
        hits += bool(tops)
        assert not tops or max(tops) == pytest.approx(3.0 - down, abs=1e-9)
    assert hits > 30


def _top(planes: np.ndarray, x: float, y: float) -> float | None:
    """The height of a convex solid above a place; None beside it."""
    up, rest = planes[:, 2], planes[:, 0] * x + planes[:, 1] * y + planes[:, 3]
    upright = np.abs(up) < 1e-12
    low = max(-rest[~upright & (up < 0.0)] / up[~upright & (up < 0.0)])
    high = min(-rest[~upright & (up > 0.0)] / up[~upright & (up > 0.0)])
    return float(high) if high >= low and (rest[upright] < 1e-12).all() else None


TWO = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 0.1"/>
  <body name="left" pos="0 0.5 0.2"><geom size="0.05"/>
    <body name="l1" pos="0 0 0.1"><joint name="turn_left" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03"/></body></body>
  <body name="right" pos="0 -0.5 0.2" euler="0 0 90"><joint name="turn_right" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/></body>
  <body name="drone" pos="0 0 1"><freejoint/><geom size="0.1"/><body name="arm"><joint name="swing" axis="1 0 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body>
</worldbody>EXCLUDED</mujoco>"""


def test_several_robots_stand_where_mujoco_has_them(tmp_path: Path) -> None:
    path = tmp_path / "cell.xml"
    path.write_text(TWO.replace("EXCLUDED", ""))
    scene = wb.read_scene(path)
    assert tuple(scene.figure.bodies) == ("left/", "right/", "drone/")
    assert set(scene.figure.roots) == {"drone/root"}
    model = mujoco.MjModel.from_xml_path(str(path))
    data, q = mujoco.MjData(model), scene.figure.neutral
    for name, value in {"left/turn_left": 0.4, "right/turn_right": -0.7, "drone/swing": 0.3}.items():
        q = scene.figure.with_joints(q, {name: value})
        data.joint(name.partition("/")[2]).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    for name in ("left/l1", "right/right", "drone/drone", "drone/arm"):
        ours, theirs = scene.figure.placement(q, name), data.body(name.partition("/")[2])
        np.testing.assert_allclose(ours.translation, theirs.xpos, atol=1e-9)
        np.testing.assert_allclose(ours.rotation, theirs.xmat.reshape(3, 3), atol=1e-9)
    assert wb.read_scene(path, root="right").figure.joints == ("turn_right",)


def test_names_that_figures_have_or_cannot_have_are_given_a_number(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    file.write_text(
        """<mujoco><worldbody>
        <body name="root"><joint name="a" range="-90 90"/><geom name="g" size="0.1"/></body>
        <body name="arm/" pos="1 0 0"><joint name="b" range="-90 90"/><geom name="h" size="0.1"/></body>
        <geom name="arm" size="0.1" pos="2 0 0"/></worldbody></mujoco>"""
    )
    scene = wb.read_scene(file)
    assert (set(scene.figure.members), set(scene.objects)) == ({"root-2", "arm"}, {"arm-2"})


def test_pairs_of_robots_that_are_not_tested_are_told(tmp_path: Path) -> None:
    path = tmp_path / "cell.xml"
    path.write_text(TWO.replace("EXCLUDED", '<contact><exclude body1="l1" body2="right"/></contact>'))
    with pytest.warns(UserWarning, match="two robots that the file does not test are tested: l1 and right"):
        scene = wb.read_scene(path)
    assert list(scene.figure.members) == ["left", "right", "drone"]

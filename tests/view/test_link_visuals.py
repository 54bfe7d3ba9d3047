"""Robots are drawn by the visuals of their files, and by their pieces where there are none or on request."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import wholebody as wb
from wholebody.figures.link_pieces import FINE, MANY, mesh_parts
from wholebody.geometry.meshes import read_mesh, read_parts
from wholebody.view import style
from wholebody.view.bodies import Bodies, LinkVisuals
from wholebody.view.scene_graph import Keyframe, SceneGraph
from wholebody.view.style import LOOK

TEXT = """<robot name="r">
  <link name="a"><visual><origin xyz="0 0 0.4"/><geometry><box size="0.3 0.3 0.3"/></geometry>
    <material name="sky"><color rgba="0.1 0.2 0.9 1"/></material></visual>SHAPE</link>
  <link name="b"><visual><geometry><mesh filename="two.glb" scale="2 2 2"/></geometry></visual>SHAPE</link>
  <link name="c"><visual><geometry><mesh filename="none.stl"/></geometry></visual>SHAPE</link>
  <link name="d"><visual><geometry><mesh filename="broken.stl"/></geometry></visual>SHAPE</link>
  <link name="e">SHAPE</link>
  <joint name="ab" type="continuous"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/></joint>
  <joint name="bc" type="continuous"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/></joint>
  <joint name="cd" type="continuous"><parent link="c"/><child link="d"/><origin xyz="1 0 0"/></joint>
  <joint name="de" type="continuous"><parent link="d"/><child link="e"/><origin xyz="1 0 0"/></joint>
</robot>""".replace("SHAPE", '<collision><geometry><sphere radius="0.1"/></geometry></collision>')

RED, GREEN = (200, 10, 10, 255), (10, 200, 10, 255)


def two_boxes(path: Path) -> Path:
    """A file with a red box at the origin and a green one 0.2 m above."""
    scene = trimesh.Scene()
    for height, color in ((0.0, RED), (0.2, GREEN)):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=color))
        scene.add_geometry(
            box, node_name=f"box {height}", transform=trimesh.transformations.translation_matrix((0.0, 0.0, height))
        )
    path.write_bytes(scene.export(file_type="glb"))
    return path


@pytest.fixture
def robot(tmp_path: Path) -> wb.Figure:
    two_boxes(tmp_path / "two.glb")
    (tmp_path / "broken.stl").write_text("solid nothing")
    path = tmp_path / "robot.urdf"
    path.write_text(TEXT)
    return wb.load(path)


def drawn(figure: wb.Figure, pieces: bool = False) -> dict[str, Any]:
    """Nodes with an object below the figure."""
    graph = SceneGraph()
    Bodies(wb.Scene(figure), (), pieces).build(graph)
    return {path: node for path, node in graph.store.nodes.items() if node.object and path.startswith("/figure")}


def test_visuals_are_drawn_and_pieces_where_a_link_has_none(robot: wb.Figure) -> None:
    wanted = {"/figure/universe/visual 0", "/figure/ab/visual 1", "/figure/ab/visual 2"}
    wanted |= {"/figure/bc/c:0", "/figure/cd/d:0", "/figure/de/e:0"}  # no file, not a mesh, no visual
    assert set(drawn(robot)) == wanted
    assert all(":" in path for path in drawn(robot, pieces=True))
    for same in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot)):
        assert set(drawn(same)) == wanted
    assert LinkVisuals(robot.reduced(["ab"])).links == {"a", "b"}


def test_figures_side_by_side_are_drawn_each_as_it_is_alone(robot: wb.Figure) -> None:
    at = (0.5, -0.3, 0.2, 0.0, 0.0, 1.0, 0.0)
    scene = wb.Scene({"anna": wb.load("human"), "robot": (robot, at)})
    assert LinkVisuals(scene.figure, ("anna/",)).links == {"robot/a", "robot/b"}
    assert "anna/left_thigh" in LinkVisuals(scene.figure).links  # its flesh was said to be a mesh without a file
    bodies, graph = Bodies(scene, (), False), SceneGraph()
    bodies.build(graph)
    shown = {path for path, node in graph.store.nodes.items() if node.object and path.startswith("/figure")}
    assert all(path.startswith("/figure/anna/body") for path in shown if "anna" in path)  # her surface alone
    assert sorted(path.rsplit("|", 1)[-1] for path in shown if "|c:" in path or "|d:" in path) == ["c:0", "d:0"]
    assert any(path.endswith("universe/visual 0") for path in shown)
    base = next(one for one in scene.figure.visual.geometryObjects if one.name.startswith("robot/a"))
    expected = pin.XYZQUATToSE3(np.array(at)) * pin.SE3(np.eye(3), np.array((0.0, 0.0, 0.4)))
    np.testing.assert_allclose(base.placement.homogeneous, expected.homogeneous, atol=1e-12)


def test_parts_have_their_colours_and_places(tmp_path: Path) -> None:
    path = two_boxes(tmp_path / "two.glb")
    for height, color, (vertices, faces, own) in zip((0.0, 0.2), (RED, GREEN), read_parts(path), strict=True):
        assert own == pytest.approx(np.array(color) / 255.0, abs=1e-6)
        np.testing.assert_allclose(vertices.mean(axis=0), (0.0, 0.0, height), atol=1e-9)
        assert len(faces) == 12
    whole, _ = read_mesh(path)
    np.testing.assert_allclose([whole.min(axis=0), whole.max(axis=0)], [[-0.05] * 3, [0.05, 0.05, 0.25]], atol=1e-9)
    for _ in range(2):  # made, and kept
        mesh_parts.cache_clear()
        parts = mesh_parts(str(path), (2.0, 2.0, 2.0))
        np.testing.assert_allclose(parts[1][0].max(axis=0), (0.1, 0.1, 0.5), atol=1e-6)
        assert parts[0][2] == pytest.approx(np.array(RED) / 255.0, abs=1e-6)


def test_large_meshes_are_thinned_by_at_most_a_cell(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.05)
    path = tmp_path / "ball.stl"
    ball.export(path)
    ((vertices, faces, color),) = mesh_parts(str(path), (1.0, 1.0, 1.0))
    assert len(ball.faces) > MANY
    assert 1000 < len(faces) < 0.5 * len(ball.faces)
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.05).max() < 1e-5
    middles = np.linalg.norm(vertices[faces].mean(axis=1), axis=1)
    assert middles.min() > 0.05 - FINE
    assert color is None


def test_a_mirrored_mesh_keeps_its_outer_side(tmp_path: Path) -> None:
    path = tmp_path / "cone.stl"
    trimesh.creation.cone(0.1, 0.2).export(path)
    for scale in ((1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (-1.0, -1.0, -1.0)):
        ((vertices, faces, _),) = mesh_parts(str(path), scale)
        corners = vertices[faces]
        signed = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
        assert signed == pytest.approx(np.pi * 0.01 * 0.2 / 3.0, rel=0.02)


def test_a_link_in_contact_is_tinted(robot: wb.Figure) -> None:
    scene = wb.Scene(robot)
    bodies, graph = Bodies(scene, (), False), SceneGraph()
    bodies.build(graph)
    keyframe = Keyframe()
    bodies.pose(keyframe, scene.state(robot.neutral).data)
    assert keyframe.colors["/figure/universe/visual 0"] == pytest.approx((0.1, 0.2, 0.9, 1.0))
    bodies.paint(keyframe, scene.piece_owner.index("a"), LOOK.penetration)
    tinted = keyframe.colors["/figure/universe/visual 0"]
    assert tinted == pytest.approx(style.tinted((0.1, 0.2, 0.9, 1.0), LOOK.penetration, LOOK.paint))

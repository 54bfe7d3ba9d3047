"""glTF of postures, opened again by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

import wholebody as wb
from wholebody.cli import main
from wholebody.motion.files.gltf import triangles

UP = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""From our x forward, z up to glTF's z forward, y up."""


def test_pieces_and_things_are_where_pinocchio_says(tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.65, 0.0, 0.74), color=(0.2, 0.3, 0.8, 0.5))
    scene.add(wb.Cylinder(0.05, 0.2), name="cup", at=(0.5, 0.2, 0.87))
    scene.attach(wb.Sphere(0.03), name="ball", to="right_hand", at=(0.0, 0.0, -0.2))
    q = scene.figure.with_joints(scene.figure.posture("sitting"), {"left_elbow_flexion": 1.1, "spine1_flexion": 0.3})
    with wb.Viewer(scene) as viewer:
        viewer.show(q)
        written = viewer.save(tmp_path / "scene.glb")
    loaded = trimesh.load_scene(written)
    data, results = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, results, q)
    pieces = scene.geometry.geometryObjects
    for piece, at in zip(pieces, results.oMg, strict=True):
        matrix, mesh = loaded.graph.get(f"piece {piece.name}")
        np.testing.assert_allclose(matrix, UP @ at.homogeneous, atol=1e-6)
        assert len(loaded.geometry[mesh].vertices) >= 8
    table = next(piece.name for piece, owner in zip(pieces, scene.piece_owner, strict=True) if owner == "table")
    mesh = loaded.geometry[loaded.graph.get(f"piece {table}")[1]]
    np.testing.assert_allclose(mesh.extents, (0.6, 1.2, 0.04), atol=1e-6)
    np.testing.assert_allclose(mesh.visual.material.baseColorFactor, (51, 76, 204, 128), atol=1)
    world = loaded.bounds  # y is up: nothing is below the floor's square
    assert world[0, 1] == pytest.approx(0.0, abs=2e-3)


def test_a_motion_is_written_at_its_beginning(tmp_path: Path) -> None:
    figure = wb.load("hand")
    scene = wb.Scene(figure)
    with wb.Viewer(scene) as viewer:
        with pytest.raises(wb.InputError, match="nothing is shown"):
            viewer.save(tmp_path / "early.glb")
        viewer.play([figure.neutral, figure.neutral], 0.1)
        assert len(trimesh.load_scene(viewer.save(tmp_path / "hand.glb")).geometry) == len(
            scene.geometry.geometryObjects
        )


def test_the_command_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "human.glb"
    assert main(["show", "human", "--save", str(file)]) == 0
    assert str(file) in capsys.readouterr().out
    assert 1.6 < trimesh.load_scene(file).extents[1] < 1.9  # y is up: the stature


@pytest.mark.parametrize(
    "shape", [coal.Box(0.1, 0.2, 0.3), coal.Sphere(0.1), coal.Capsule(0.1, 0.3), coal.Ellipsoid(0.1, 0.2, 0.3)]
)
def test_what_is_drawn_has_the_size_of_what_is_tested(shape: Any) -> None:
    mesh = triangles(shape)
    shape.computeLocalAABB()
    np.testing.assert_allclose(mesh.bounds, (shape.aabb_local.min_, shape.aabb_local.max_), atol=1e-2)
    assert mesh.is_watertight


def test_what_is_written_is_read_back_in_place(tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 0.2, 0.3)), name="box", at=(1.0, 2.0, 3.0))
    with wb.Viewer(scene) as viewer:
        viewer.show(scene.figure.neutral)
        mesh = wb.Mesh(viewer.save(tmp_path / "scene.glb"))
    box = mesh.vertices[mesh.vertices[:, 2] > 2.0]
    np.testing.assert_allclose([box.min(axis=0), box.max(axis=0)], [[0.95, 1.9, 2.85], [1.05, 2.1, 3.15]], atol=1e-6)

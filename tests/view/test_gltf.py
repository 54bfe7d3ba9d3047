"""glTF of postures, opened again by trimesh."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

import wholebody as wb
from tests.flesh import settle
from wholebody.cli import main
from wholebody.figures.surface import surface_of
from wholebody.figures.surface.garments import halfway
from wholebody.geometry.gltf import GltfDocument
from wholebody.motion.files.gltf import triangles
from wholebody.motion.files.gltf_reading import Animated

UP = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""From our x forward, z up to glTF's z forward, y up."""


@pytest.mark.parametrize("posture", ["sitting", "standing"])
def test_pieces_and_things_are_where_pinocchio_says(tmp_path: Path, posture: str) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.65, 0.0, 0.74), color=(0.2, 0.3, 0.8, 0.5))
    scene.add(wb.Cylinder(0.05, 0.2), name="cup", at=(0.5, 0.2, 0.87))
    scene.attach(wb.Sphere(0.03), name="ball", to="right_hand", at=(0.0, 0.0, -0.2))
    q = scene.figure.with_joints(scene.figure.posture(posture), {"left_elbow_flexion": 1.1, "spine1_flexion": 0.3})
    with wb.Viewer(scene) as viewer:
        viewer.show(q, pieces=True)
        written = viewer.save(tmp_path / "scene.glb")
    loaded = trimesh.load_scene(written)
    data, results = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, results, q)
    settle(scene.geometry, results)
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


def bent(figure: wb.Figure, q: np.ndarray) -> np.ndarray:
    """Vertices of a figure's surface at a posture by linear blend skinning, in glTF's axes."""
    surface, data = surface_of(figure), figure.model.createData()
    assert surface is not None
    pin.framesForwardKinematics(figure.model, data, q)
    placed = []
    for bone, (joint, offset) in zip(surface.bones, surface.attached(figure, np.eye(4)), strict=True):
        placed.append(data.oMi[figure.model.getJointId(joint)].homogeneous @ offset)
        if bone.parent is not None:
            first = placed[[other.segment for other in surface.bones].index(bone.parent)]
            placed[-1] = halfway(first, placed[-1], bone)
    moved = [at @ np.linalg.inv(bone.bind) for at, bone in zip(placed, surface.bones, strict=True)]
    found = {}
    for patch in surface.patches:
        corners = np.c_[patch.vertices, np.ones(len(patch.vertices))]
        ways = np.einsum("nkij,nj->nki", np.array(moved)[patch.bones], corners)
        found.setdefault(patch.color, []).append((patch.weights[:, :, None] * ways).sum(axis=1))
    return np.concatenate([part for parts in found.values() for part in parts]) @ UP.T[:, :3]


def test_the_body_is_one_skinned_mesh_that_moves_as_the_viewer_draws_it(tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.65, 0.0, 0.74))
    scene.attach(wb.Sphere(0.03), name="ball", to="right_hand", at=(0.0, 0.0, -0.2))
    figure = scene.figure
    arm = figure.with_joints(figure.neutral, {"left_elbow_flexion": 1.4, "left_shoulder_flexion": 0.8})
    motion = wb.Clip(figure, [figure.neutral, figure.posture("sitting"), arm], 0.25, "sits")
    with wb.Viewer(scene) as viewer:
        with pytest.raises(wb.InputError, match="nothing is shown"):
            viewer.save(tmp_path / "early.glb")
        viewer.play(motion)
        scened = viewer.save(tmp_path / "scene.glb")
    for path, more in ((scened, 2), (motion.write(tmp_path / "clip.glb"), 0)):
        pygltflib = pytest.importorskip("pygltflib")
        file = pygltflib.GLTF2().load(path)
        assert (len(file.skins), len(file.meshes)) == (1, 1 + more)
        assert [node.name for node in file.nodes if node.skin is not None] == ["body human"]
        assert len(trimesh.load_scene(path).geometry) == len(file.meshes[0].primitives) + more
        document, animated = GltfDocument(path), Animated(path)
        assert animated.dt == 0.25
        for frame, q in enumerate(motion.q):
            moved = {node: tuple(part[frame : frame + 1] for part in parts) for node, parts in animated.moved.items()}
            for node, parts in moved.items():
                names = ("translation", "rotation", "scale")
                document.tree["nodes"][node] |= dict(zip(names, (part[0] for part in parts), strict=True))
            body = skinned(document)
            np.testing.assert_allclose(body, bent(figure, q), atol=2e-6)
        rested = wb.Mesh(path).vertices  # at the first frame
        assert rested[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def skinned(document: GltfDocument) -> np.ndarray:
    """Vertices of the mesh that bones bend."""
    for fields in document.tree["nodes"]:
        if "mesh" in fields and "skin" not in fields:
            del fields["mesh"]
    return np.concatenate([part[0] for part in document.meshes()])


def khronos(path: Path) -> dict[str, Any]:
    """What the validator of Khronos, the package `gltf-validator` of npm, finds; skipped where it is not installed."""
    code = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))"
        ".then(found => console.log(JSON.stringify(found.issues)))"
    )
    if shutil.which("node") is None:
        pytest.skip("there is no node")
    done = subprocess.run(["node", "-e", code, str(path)], capture_output=True, text=True, timeout=60)
    if "Cannot find module" in done.stderr:
        pytest.skip("gltf-validator is not installed: npm install gltf-validator, and NODE_PATH=node_modules")
    issues: dict[str, Any] = json.loads(done.stdout)
    return issues


@pytest.mark.parametrize("figure", ["human", "hand"])
def test_the_validator_of_khronos_finds_nothing(figure: str, tmp_path: Path) -> None:
    scene = wb.Scene(wb.load(figure)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Cylinder(0.05, 0.2), name="cup", at=(0.5, 0.2, 0.87), color=(0.2, 0.3, 0.8, 0.5))
    with wb.Viewer(scene) as viewer:
        viewer.play([scene.figure.neutral] * 3, 0.1)
        found = khronos(viewer.save(tmp_path / "scene.glb"))
    assert found["messages"] == []


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

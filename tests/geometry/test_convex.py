"""Meshes as unions of convex pieces: covered, little volume added, and honest about it."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, InputError
from wholebody.geometry import convex
from wholebody.geometry.components import split_components
from wholebody.geometry.convex import convex_pieces
from wholebody.geometry.hull import simplified_hull
from wholebody.geometry.mesh_cache import ConvexPieces
from wholebody.geometry.pieces import Piece
from wholebody.geometry.shapes import Mesh


def outside(points: Array, pieces: tuple[Piece, ...]) -> Array:
    """How far points lie outside the union of the pieces, by their planes; negative inside."""
    gaps = []
    for piece in pieces:
        hull = ConvexHull(np.asarray(piece.geometry.points()) + piece.placement.translation)
        gaps.append((points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1))
    return np.asarray(np.min(gaps, axis=0))


@pytest.fixture(scope="module")
def torus() -> tuple[trimesh.Trimesh, ConvexPieces]:
    mesh = trimesh.creation.torus(0.3, 0.1, major_sections=8, minor_sections=4)
    return mesh, convex_pieces(mesh.vertices, mesh.faces, max_vertices=24, threshold=0.1)


def test_a_torus_is_covered_and_its_hole_stays_open(torus: tuple[trimesh.Trimesh, ConvexPieces]) -> None:
    mesh, found = torus
    points, _ = trimesh.sample.sample_surface(mesh, 1000, seed=0)
    assert outside(points, found.pieces).max() < 2e-4
    assert outside(np.zeros((1, 3)), found.pieces)[0] > 0.12
    assert all(piece.geometry.num_points <= 24 for piece in found.pieces)
    total = sum(piece.volume for piece in found.pieces)
    assert found.added_volume == pytest.approx(total / mesh.volume - 1.0, abs=1e-9)
    assert 0.0 < found.added_volume < 0.3
    assert len(found.pieces) > 5
    assert not found.notes


@pytest.mark.parametrize(
    ("does", "seconds", "said"),
    [
        (
            lambda *_: os.kill(os.getpid(), signal.SIGSEGV),
            60.0,
            "CoACD cannot cut it into convex pieces; repair the mesh",
        ),
        (
            lambda *_: all(True for _ in count()),
            0.3,
            r"CoACD found no convex pieces of 96 triangles in 0.3 s of the processor; give fewer triangles, ",
        ),
    ],
    ids=["crashes", "hangs"],
)
def test_a_part_that_coacd_does_not_survive_is_an_error(does, seconds, said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convex, "MOST_SECONDS", seconds)
    monkeypatch.setattr(convex, "run_coacd", does)
    mesh = trimesh.creation.torus(0.3, 0.1, major_sections=8, minor_sections=6)
    with pytest.raises(InputError, match=f"ring, part 0: {said}"):
        convex_pieces(mesh.vertices, mesh.faces, what="ring")


def test_a_convex_part_keeps_all_its_vertices() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    found = convex_pieces(ball.vertices, ball.faces, max_vertices=8)
    (piece,) = found.pieces
    assert piece.geometry.num_points == len(ball.vertices)
    assert found.added_volume == pytest.approx(0.0, abs=1e-6)


def chair_of_boxes() -> trimesh.Trimesh:
    legs = [trimesh.creation.box((0.04, 0.04, 0.45)) for _ in range(4)]
    for leg, (x, y) in zip(legs, [(-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2), (0.2, 0.2)], strict=True):
        leg.apply_translation((x, y, 0.225))
    seat = trimesh.creation.box((0.5, 0.5, 0.04))
    seat.apply_translation((0, 0, 0.47))
    return trimesh.util.concatenate([*legs, seat])


def test_convex_parts_are_exact() -> None:
    mesh = chair_of_boxes()
    found = convex_pieces(mesh.vertices, mesh.faces)
    assert len(found.pieces) == 5
    assert sum(piece.volume for piece in found.pieces) == pytest.approx(mesh.volume, rel=1e-12)
    assert found.added_volume == pytest.approx(0.0, abs=1e-9)


def test_triangles_without_common_vertices_are_sewn_together() -> None:
    mesh = chair_of_boxes()
    soup = mesh.vertices[mesh.faces].reshape(-1, 3)
    found = convex_pieces(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(found.pieces) == 5
    assert not found.notes


def test_a_part_that_is_inside_out_is_turned() -> None:
    box = trimesh.creation.box((1, 1, 1))
    found = convex_pieces(box.vertices, box.faces[:, ::-1])
    assert len(found.pieces) == 1
    assert not found.notes
    assert found.pieces[0].volume == pytest.approx(1.0)


def test_the_air_of_a_room_belongs_to_its_walls() -> None:
    walls, air = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1.6, 1.6, 1.6))
    vertices = np.vstack([walls.vertices, air.vertices])
    faces = np.vstack([walls.faces, air.faces[:, ::-1] + len(walls.vertices)])
    (room,) = split_components(vertices, faces)
    assert room.closed
    assert room.volume == pytest.approx(8.0 - 1.6**3)
    assert len(split_components(vertices, np.vstack([walls.faces, air.faces + 8]))) == 2  # a box in a box


def test_an_inside_out_part_beside_another_is_not_its_cavity() -> None:
    box, beside = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.5, 0.5, 0.5))
    beside.apply_translation((2, 0, 0))
    faces = np.vstack([box.faces, beside.faces[:, ::-1] + len(box.vertices)])
    found = convex_pieces(np.vstack([box.vertices, beside.vertices]), faces)
    assert sorted(piece.volume for piece in found.pieces) == pytest.approx([0.125, 1.0])


def test_open_and_flat_and_tiny_parts_are_told() -> None:
    box = trimesh.creation.box((1, 1, 1))
    flat = np.array([[2.0, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]])
    tiny = np.array([[5.0, 0, 0], [5.1, 0, 0], [5.1, 1e-6, 0]])
    vertices = np.vstack([box.vertices, flat, tiny])
    faces = np.vstack([box.faces[1:], [[8, 9, 10], [8, 10, 11]], [[12, 13, 14]]])
    found = convex_pieces(vertices, faces)
    assert sorted(piece.volume for piece in found.pieces) == pytest.approx([2e-4, 1.0])
    notes = " ".join(found.notes)
    assert "not closed" in notes
    assert "thickened" in notes
    assert "left out" in notes
    assert found.added_volume == 0.0


def without(mesh: trimesh.Trimesh, gone: Callable[[Array], Array]) -> tuple[Array, Any]:
    return mesh.vertices, mesh.faces[~gone(mesh.face_normals)]


def test_a_surface_that_lacks_faces_is_closed() -> None:
    tube = trimesh.creation.annulus(0.04, 0.05, 0.5, sections=4)
    cut = convex_pieces(tube.vertices, tube.faces[1:])
    assert sum(piece.volume for piece in cut.pieces) == pytest.approx(tube.volume, rel=0.1)
    assert "1 hole closed" in cut.notes[0]
    leg = convex_pieces(*without(trimesh.creation.cylinder(0.02, 1.0), lambda normal: normal[:, 2] > 0.5))
    assert [piece.volume for piece in leg.pieces] == pytest.approx([np.pi * 4e-4], rel=0.01)
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    turned = box.faces.copy()
    turned[::3] = turned[::3, ::-1]
    assert not convex_pieces(box.vertices, turned).notes


def test_a_shell_is_what_it_shows() -> None:
    cylinder = trimesh.creation.cylinder(0.05, 1.0)
    pipe = convex_pieces(*without(cylinder, lambda normal: abs(normal[:, 2]) > 0.5))
    assert "encloses nothing" in pipe.notes[0]
    inside = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.49], [0.03, 0.0, 0.2]])
    assert outside(inside, pipe.pieces).min() > 0.01
    on_it = trimesh.sample.sample_surface(cylinder, 400, seed=0)[0]
    assert outside(on_it[np.abs(on_it[:, 2]) < 0.4999], pipe.pieces).max() < 2e-4
    bin_ = convex_pieces(*without(trimesh.creation.box((1, 1, 1)), lambda normal: normal[:, 2] > 0.5))
    assert outside(np.zeros((1, 3)), bin_.pieces).min() > 0.4


def test_nothing_solid_is_an_error() -> None:
    with pytest.raises(InputError, match="scale"):
        convex_pieces(np.array([[0, 0, 0], [1e-5, 0, 0], [0, 1e-5, 0]]), [[0, 1, 2]])


def test_pieces_are_the_callers_own() -> None:
    box = Mesh((trimesh.creation.box((1, 1, 1)).vertices, trimesh.creation.box((1, 1, 1)).faces))
    box.pieces()[0].placement.translation = np.array([9.0, 9.0, 9.0])
    assert np.abs(box.pieces()[0].placement.translation).max() < 1e-9


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(20, 200), st.integers(8, 40))
def test_a_simpler_hull_holds_all_points(seed: int, count: int, most: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * (1.0, 0.5, 0.1)
    simple = simplified_hull(points, most)
    assert len(simple) <= most
    planes = ConvexHull(simple).equations
    assert (points @ planes[:, :3].T + planes[:, 3]).max() < 1e-9


def test_files_agree_and_scale_and_turn(tmp_path: Path) -> None:
    box = trimesh.creation.box((100.0, 200.0, 300.0))
    box.apply_translation((0, 100.0, 0))
    for suffix in ("obj", "stl", "glb", "gltf"):
        path = tmp_path / f"box.{suffix}"
        if suffix == "gltf":
            for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box)).items():
                (tmp_path / name.replace("model.gltf", path.name)).write_bytes(content)
        else:
            box.export(path)
        mesh = Mesh(str(path), scale=0.001, up="y")
        (piece,) = mesh.pieces()
        corners = np.asarray(piece.geometry.points()) + piece.placement.translation
        assert np.allclose(corners.min(axis=0), [-0.05, -0.15, 0.0], atol=1e-7)
        assert np.allclose(corners.max(axis=0), [0.05, 0.15, 0.2], atol=1e-7)
        assert mesh.added_volume == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("gone.obj", None, "no such file"),
        ("a.obj", b"", "empty"),
        ("a.obj", b"hello\n", "no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "finite"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read"),
        ("a.stl", b"solid x", "no triangles"),
        ("a.glb", b"xx", "is no glTF 2"),
        ("a.gltf", b"{}", "is no glTF 2"),
        ("a.dwg", b"xx", "not among"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, name: str, content: bytes | None, reason: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileFormatError, match=reason) as error:
        Mesh(path)
    assert name in str(error.value)


def test_flat_parts_of_a_decomposition_are_thickened(
    torus: tuple[trimesh.Trimesh, ConvexPieces], monkeypatch: pytest.MonkeyPatch
) -> None:
    """CoACD cut a box with one vertex pulled far out into parts of which one was flat."""
    mesh = torus[0]
    flat = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0], [0.05, 0.05, 0.0]])
    solid = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
    monkeypatch.setattr(convex, "_coacd", lambda *_: [flat, solid])
    found = convex_pieces(mesh.vertices + 3.0, mesh.faces)  # not the torus that is kept already
    assert len(found.pieces) == 2
    assert (outside(flat, found.pieces[:1]) <= 0.0).all()
    assert any("flat" in note for note in found.notes)

"""Hulls of whole meshes: all of the mesh is in them, coal takes them, and thin ones are thickened."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.geometry.components import enclosed_volume
from wholebody.geometry.convex import HULL_VERTICES, convex_pieces, mesh_hull
from wholebody.geometry.hull import MOST_NEIGHBOURS, hull_piece
from wholebody.geometry.meshes import read_mesh
from wholebody.geometry.pieces import SMALLEST, Piece


def outside(cloud: Array, piece: Piece) -> float:
    """How far the farthest of these points is out of a piece."""
    hull = ConvexHull(np.array(piece.geometry.points()) + piece.placement.translation)
    return float((cloud @ hull.equations[:, :3].T + hull.equations[:, 3]).max())


@given(st.integers(0, 2**32 - 1), st.integers(5, 1500))
def test_a_hull_of_a_mesh_holds_it_with_few_vertices(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    cloud = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-3.0, 0.0, 3)
    faces = np.array([[k, (k + 1) % count, (k + 2) % count] for k in range(count)])
    (piece,) = mesh_hull(cloud, faces).pieces
    assert piece.geometry.num_points <= max(HULL_VERTICES)
    assert outside(cloud, piece) < 1e-9
    corners = np.array(piece.geometry.points()) + piece.placement.translation
    beyond = np.maximum(cloud.min(axis=0) - corners.min(axis=0), corners.max(axis=0) - cloud.max(axis=0))
    assert (beyond <= 1e-6 * np.ptp(cloud, axis=0)).all()  # a sole stays flat, and stands where it stood


def test_a_small_hull_is_exact_and_its_added_volume_is_told() -> None:
    bracket = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    mesh = trimesh.creation.extrude_triangulation(
        bracket, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]), height=1.0
    )
    found = mesh_hull(mesh.vertices, mesh.faces, what="mesh bracket")
    assert found.pieces[0].volume == pytest.approx(7.0)  # of the pentagon; the bracket has 5
    assert found.added_volume == pytest.approx(0.4)
    assert found.notes == ("mesh bracket: its convex hull has 40% more volume",)


def test_an_open_mesh_is_told_to_be_open() -> None:
    box = trimesh.creation.box((1, 1, 1))
    for left_out in ([0], [0, 1], [0, 1, 2, 3]):
        faces = np.delete(box.faces, left_out, axis=0)
        assert enclosed_volume(box.vertices, faces) is None
    assert "not closed" in mesh_hull(box.vertices, box.faces[2:]).notes[0]
    assert enclosed_volume(box.vertices, box.faces) == pytest.approx(1.0)
    assert enclosed_volume(box.vertices + 1e3, box.faces[:, ::-1]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],  # a plate
        [[0, 0, 0], [1, 0, 0], [2, 0, 0]],  # a needle
        [[0.3, 0.2, 0.1]] * 3,  # a point
        [[0, 0, 0], [1, 1, 0], [1, 0, 9.8e-5], [0, 1, 9.8e-5]],  # 98 micrometres
    ],
)
def test_what_is_too_thin_is_thickened_and_told(points: list[list[float]]) -> None:
    cloud = np.array(points, dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, len(cloud) - 1]])
    (piece,) = (found := mesh_hull(cloud, faces, what="mesh sheet")).pieces
    assert outside(cloud, piece) <= 0.0
    assert np.ptp(np.array(piece.geometry.points()), axis=0).min() >= 2.0 * SMALLEST - 1e-12
    assert "mesh sheet: it is thinner than 0.0001 m" in found.notes[0]


def test_a_tilted_thin_part_of_a_mesh_does_not_refuse_the_others() -> None:
    thin = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 9.9e-5]]) + 3.0
    box = trimesh.creation.box((1, 1, 1))
    sheet = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]) + len(box.vertices)
    found = convex_pieces(np.vstack([box.vertices, thin]), np.vstack([box.faces, sheet]))
    assert len(found.pieces) == 2
    assert any("thickened" in note for note in found.notes)


def test_a_cone_of_many_edges_is_taken_by_coal() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    cone = np.vstack([np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn]), [[0.0, 0.0, 1.0]]])
    assert len(turn) > MOST_NEIGHBOURS
    piece = hull_piece(cone)
    assert outside(cone, piece) < 1e-9
    assert piece.volume == pytest.approx(ConvexHull(cone).volume, rel=0.01)
    result = coal.DistanceResult()
    at, far = coal.Transform3s.Identity(), coal.Transform3s(np.eye(3), np.array([0.0, 0.0, 3.0]))
    centred = coal.Transform3s(np.eye(3), piece.placement.translation)
    distance = coal.distance(piece.geometry, centred, coal.Sphere(0.5), far, coal.DistanceRequest(), result)
    assert distance == pytest.approx(1.5, abs=0.01)
    assert at.isIdentity()
    assert wb.Hull(cone).pieces()[0].volume == pytest.approx(piece.volume)


UNITS = [("", "Z_UP", 1.0), ('<unit name="inch" meter="0.0254"/>', "Y_UP", 0.0254), ("", "Y_UP", 1.0)]


@pytest.mark.parametrize(("unit", "up", "scale"), UNITS)
def test_collada_is_read_in_metres_and_not_turned(tmp_path: Path, unit: str, up: str, scale: float) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    text = trimesh.exchange.dae.export_collada(box).decode()
    head, _, rest = text.partition("<asset>")
    _, _, tail = rest.partition("</asset>")
    asset = f"<asset><created>2020-01-01</created><modified>2020-01-01</modified>{unit}<up_axis>{up}</up_axis></asset>"
    path = tmp_path / "box.DAE"
    path.write_text(head + asset + tail)
    vertices, faces = read_mesh(path)
    assert np.ptp(vertices, axis=0) == pytest.approx([scale, 2.0 * scale, 3.0 * scale])
    assert len(faces) == 12
    if not unit:  # Pinocchio reads the same where there is no unit; with one it does not look at it
        theirs = np.array(coal.MeshLoader().load(str(path), np.ones(3)).vertices())
        assert np.sort(np.unique(theirs.round(9), axis=0), axis=0) == pytest.approx(
            np.sort(np.unique(vertices.round(9), axis=0), axis=0)
        )


def test_what_a_hull_adds_is_told_of_an_open_mesh_that_closing_makes_right() -> None:
    tube = trimesh.creation.annulus(0.08, 0.1, 0.5)
    found = mesh_hull(tube.vertices, tube.faces[1:], what="tube")
    share = trimesh.convex.convex_hull(tube).volume / tube.volume - 1.0
    assert found.added_volume == pytest.approx(share, rel=1e-3)
    assert found.notes == (
        "tube: its surface is not closed: 1 hole closed",
        f"tube: its convex hull has {share:.0%} more volume",
    )

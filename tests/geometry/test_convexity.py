"""Convex meshes are told whatever their order; what passes through itself is told too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from wholebody.base.runner import BY_THE_CLOCK
from wholebody.geometry import convex
from wholebody.geometry.components import is_convex, passes_through_itself
from wholebody.geometry.convex import convex_pieces

Arrays = tuple[np.ndarray, np.ndarray]


def solid(kind: str) -> trimesh.Trimesh:
    if kind == "box":
        return trimesh.creation.box((0.3, 0.2, 1.0))
    if kind == "ball":
        return trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    if kind == "cut box":  # triangles inside of its faces
        return trimesh.creation.box((0.3, 0.2, 1.0)).subdivide()
    return trimesh.creation.cylinder(0.2, 0.7, sections=24)


def disordered(mesh: trimesh.Trimesh, way: str, rng: np.random.Generator) -> Arrays:
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    if way == "order":
        order = rng.permutation(len(vertices))
        vertices, faces = vertices[order], rng.permutation(np.argsort(order)[faces])
        return vertices, np.array([np.roll(face, rng.integers(3)) for face in faces])
    if way == "orientation":
        turned = rng.random(len(faces)) < 0.5
        faces[turned] = faces[turned][:, ::-1]
        return vertices, faces
    if way == "twice":
        return np.vstack([vertices, vertices]), np.vstack([faces, faces[:, ::-1] + len(vertices), faces])
    if way == "soup":
        return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    noise = 2e-8 * rng.normal(size=(3 * len(faces), 3))  # of float32
    return vertices[faces].reshape(-1, 3) + noise, np.arange(3 * len(faces)).reshape(-1, 3)


@pytest.mark.parametrize("kind", ["box", "ball", "cut box", "cylinder"])
@pytest.mark.parametrize("way", ["order", "orientation", "twice", "soup", "rounded soup"])
def test_a_convex_mesh_is_one_hull_in_any_order(kind: str, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = solid(kind)
    vertices, faces = disordered(mesh, way, np.random.default_rng(0))
    monkeypatch.setattr(convex, "_coacd", None)
    found = convex_pieces(vertices, faces)
    assert len(found.pieces) == 1
    assert found.pieces[0].volume == pytest.approx(mesh.volume, rel=1e-5)
    assert found.notes == ()


def test_what_is_not_convex_or_not_covered_is_not_called_so() -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    ring = trimesh.creation.torus(0.5, 0.1, major_sections=24, minor_sections=12)
    outer, inner = trimesh.creation.icosphere(2, 1.0), trimesh.creation.icosphere(2, 0.5)
    hollow = np.vstack([outer.vertices, inner.vertices]), np.vstack([outer.faces, inner.faces + len(outer.vertices)])
    two = np.vstack([box.vertices, box.vertices + 2.0]), np.vstack([box.faces, box.faces + 8])
    assert is_convex(np.array(box.vertices), np.array(box.faces))
    assert not is_convex(np.array(box.vertices), np.array(box.faces)[:-2])  # a side is open
    assert not is_convex(np.array(box.vertices), np.vstack([box.faces[:-2], box.faces[:2]]))  # and another one twice
    for vertices, faces in ((ring.vertices, ring.faces), hollow, two):
        assert not is_convex(np.array(vertices), np.array(faces))


def test_a_mesh_that_passes_through_itself_is_told() -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    vertices, faces = np.array(box.vertices), np.array(box.faces)
    assert not passes_through_itself(vertices, faces)
    mixed = vertices[[0, 1, 2, 3, 4, 5, 7, 6]]  # two corners exchanged: triangles go across
    assert passes_through_itself(mixed, faces)
    ring = trimesh.creation.torus(0.5, 0.1, major_sections=24, minor_sections=12)
    assert not passes_through_itself(np.array(ring.vertices), np.array(ring.faces))
    both = np.vstack([vertices, 0.5 * vertices + [0.4, 0.9, 1.2]]), np.vstack([faces, faces + 8])
    assert passes_through_itself(*both)


def test_little_that_passes_through_itself_gets_little_time(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[float] = []

    class Waiting:
        def call(self, *arguments: object, seconds: float) -> list[np.ndarray]:
            asked.append(seconds / BY_THE_CLOCK)
            return [np.array(box.vertices)]

        def close(self) -> None:
            pass

    box = trimesh.creation.box((1.0, 2.0, 3.1))
    monkeypatch.setattr("wholebody.base.runner.Child", Waiting)
    monkeypatch.setenv("WHOLEBODY_CACHE", str(tmp_path))
    convex_pieces(np.array(box.vertices)[[0, 1, 2, 3, 4, 5, 7, 6]], box.faces)
    assert asked == [pytest.approx(1.0)]

"""Looking at a scene changes nothing of it that can be seen: not its pickle, its copies, its placements."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest

import wholebody as wb
from wholebody.geometry.pieces import box_corners
from wholebody.motion.retarget_targets import standing_places
from wholebody.motion.roles import Roles
from wholebody.view.viewed_scene import ViewedWorld

POINTS = np.random.default_rng(5).normal(size=(30, 3)) * 0.1
SHAPES: dict[str, wb.Shape] = {
    "box": wb.Box((0.1, 0.2, 0.3)),
    "sphere": wb.Sphere(0.1),
    "capsule": wb.Capsule(0.1, 0.3),
    "cylinder": wb.Cylinder(0.1, 0.3),
    "torus": wb.Torus(0.3, 0.05),
    "ellipsoid": wb.Ellipsoid((0.1, 0.2, 0.3)),
    "floor": wb.HalfSpace(),
    "slope": wb.HalfSpace((0.0, 1.0, 1.0), -3.0),
    "hull": wb.Hull(POINTS),
    "mesh": wb.Mesh(([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])),
}


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    made = wb.Scene(wb.load("hand"))
    for number, (name, shape) in enumerate(SHAPES.items()):
        made.add(shape, name=name, at=(2.0 + number, 0.0, 0.0))
    return made.attach(wb.Box((0.02, 0.02, 0.1)), to="right_palm", name="held", at=(0.0, 0.0, -0.2))


def every_look(seen: Any, q: Any, folder: Path, problem: wb.Problem | None = None) -> None:
    """All that draws without a browser."""
    with wb.Viewer(seen, names=True, see_through=("box",)) as viewer:
        viewer.show(q, problem=problem)
        viewer.show(q, pieces=True)
        viewer.ghosts([q])
        viewer.play([q, q], ghost=[q, q])
        viewer.save(folder / "scene.html")
        viewer.save(folder / "scene.glb")
        assert viewer.url


def unchanged(scene: wb.Scene, look: Callable[[], None]) -> None:
    """Pickles of the scene and of its figure are the same bytes afterwards, and what is read from them is equal."""
    before = pickle.dumps(scene), pickle.dumps(scene.figure.geometry)
    places = [piece.placement.homogeneous for piece in scene.geometry.geometryObjects]
    look()
    assert (pickle.dumps(scene), pickle.dumps(scene.figure.geometry)) == before
    for made in (pickle.loads(before[0]), copy.copy(scene), copy.deepcopy(scene)):
        again = [piece.placement.homogeneous for piece in made.geometry.geometryObjects]
        assert np.array_equal(again, places)
        assert made.geometry == scene.geometry
        q = scene.figure.neutral
        assert np.array_equal(made.contacts(q, 0.5).distance, scene.contacts(q, 0.5).distance)


def test_a_scene_of_all_shapes(scene: wb.Scene, tmp_path: Path) -> None:
    q = scene.figure.neutral
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.1, 0.0, 0.1))])
    distance = scene.contacts(q, 0.5).distance  # what coal caches at its first query is there already
    unchanged(scene, lambda: every_look(scene, q, tmp_path, problem))
    world = ViewedWorld(scene, ["box", "torus"])
    places = {name: scene.objects[name].placement for name in ("box", "torus")}
    unchanged(scene, lambda: every_look(world, world.configuration(q, places), tmp_path))
    assert np.array_equal(scene.contacts(q, 0.5).distance, distance)


def test_an_assembly(tmp_path: Path) -> None:
    assembly = wb.Assembly()
    assembly.body("plank", shape=wb.Box((0.1, 0.1, 0.4)), at=(0.0, 0.0, 1.0))
    assembly.add(wb.HalfSpace(), name="floor")
    before = pickle.dumps(assembly.scene.built)
    with wb.Viewer(assembly) as viewer:
        viewer.show(assembly.q)
        viewer.save(tmp_path / "scene.glb")
    assert pickle.dumps(assembly.scene.built) == before
    pickle.loads(before)


HALF = {
    "box": (0.05, 0.1, 0.15),
    "sphere": (0.1, 0.1, 0.1),
    "capsule": (0.1, 0.1, 0.25),
    "ellipsoid": (0.1, 0.2, 0.3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_the_box_around_a_shape_is_that_of_a_copy(name: str) -> None:
    for piece in SHAPES[name].pieces():
        before = pickle.dumps(piece.geometry)
        corners = box_corners(piece.geometry)
        assert pickle.dumps(piece.geometry) == before
        if isinstance(piece.geometry, coal.Convex):
            points = np.array(piece.geometry.points())
            np.testing.assert_allclose((corners[0], corners[7]), (points.min(axis=0), points.max(axis=0)))
        elif name in ("floor", "slope"):
            assert np.abs(corners).max() > 1e300
        else:
            np.testing.assert_allclose(np.abs(corners), np.broadcast_to(HALF[name], (8, 3)))


def test_the_places_of_a_figure_that_motions_are_fitted_to() -> None:
    figure = wb.load("hand")
    before = pickle.dumps(figure.geometry)
    places, _, lowest = standing_places(figure, Roles({}, {"hand": "right_palm"}, {}))
    assert pickle.dumps(figure.geometry) == before
    assert places["hand"][2] > lowest

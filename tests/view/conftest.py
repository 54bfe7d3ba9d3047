"""A small scene of its own, and one headless Chromium for all tests that need one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from wholebody.figures.description import Place
from wholebody.view import screenshot
from wholebody.view.browser import Browser, find_chromium


class Exhibit:
    """Pinocchio's sample humanoid among one piece of every kind; contacts by a plain loop over coal."""

    def __init__(self) -> None:
        """Build it."""
        self.model = pin.buildSampleModelHumanoid()
        self.geometry = pin.buildSampleGeometryModelHumanoid(self.model)
        ours = {"frame_id": self.model.getFrameId, "place_of": self.place_of}
        self.figure = SimpleNamespace(**ours, warn_of_angles=lambda q, what: False)
        self.piece_owner = [piece.name for piece in self.geometry.geometryObjects]
        self.objects: dict[str, Any] = {}
        self.revision = 0
        self.built = SimpleNamespace(known=lambda key, make: make(), moves=0)
        points = coal.StdVec_Vec3s()
        points.extend(list(np.random.default_rng(1).normal(size=(30, 3)) * 0.1))
        self.add("table", coal.Box(0.6, 0.8, 0.04), (0.9, 0.1, 0.0), color=(0.2, 0.3, 0.8, 1.0))
        self.add("egg", coal.Ellipsoid(0.1, 0.15, 0.2), (0.9, 0.4, 0.4))
        self.add("stone", coal.Convex.convexHull(points, True, None), (0.9, -0.3, 0.3))
        self.add("floor", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), (0.0, 0.0, -2.5))
        head = self.model.getJointId("head2_joint")
        self.add("hat", coal.Capsule(0.05, 0.2), (0.0, 0.0, 0.35), joint=head)

    def add(self, name: str, geometry: Any, at: Sequence[float], *, joint: int = 0, color: Any = None) -> None:
        """Add a thing, turned a little unless it is the floor."""
        turn = np.eye(3) if name == "floor" else pin.exp3(np.array([0.1, -0.2, 0.4]))
        piece = pin.GeometryObject(f"{name}:0", joint, 0, pin.SE3(turn, np.array(at, dtype=float)), geometry)
        index = self.geometry.addGeometryObject(piece)
        self.piece_owner.append(name)
        self.objects[name] = SimpleNamespace(color=color)
        for other in range(index):
            if self.geometry.geometryObjects[other].parentJoint != joint:
                self.geometry.addCollisionPair(pin.CollisionPair(other, index))
        self.revision += 1

    def place_of(self, name: str) -> Place:
        """Where a frame is fixed."""
        index = self.model.getFrameId(name)
        return Place(index, self.model.frames[index].parentJoint, self.model.frames[index].placement)

    def posture(self, seed: int) -> Any:
        """A posture near the neutral one."""
        tangent = np.random.default_rng(seed).normal(size=self.model.nv) * 0.3
        return pin.integrate(self.model, pin.neutral(self.model), tangent)

    def contacts(self, q: Any, within: float = 0.05) -> Any:
        """Every pair nearer than `within`, nearest first."""
        data, results = self.model.createData(), self.geometry.createData()
        pin.computeDistances(self.model, data, self.geometry, results, q)
        rows = sorted(
            (result.min_distance, pair.first, pair.second, result)
            for pair, result in zip(self.geometry.collisionPairs, results.distanceResults, strict=True)
            if result.min_distance < within
        )
        return SimpleNamespace(
            pair=np.array([row[1:3] for row in rows], dtype=int).reshape(-1, 2),
            distance=np.array([row[0] for row in rows]),
            normal=np.array([row[3].normal for row in rows]).reshape(-1, 3),
            point_a=np.array([row[3].getNearestPoint1() for row in rows]).reshape(-1, 3),
            point_b=np.array([row[3].getNearestPoint2() for row in rows]).reshape(-1, 3),
        )


@pytest.fixture
def exhibit() -> Exhibit:
    """Return a scene that the viewer can show."""
    return Exhibit()


def node_paths(scene: Any) -> list[str]:
    """Node of each piece in the page: /figure or /objects/<thing>, the joint, the piece."""
    pieces = zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True)
    folders = [(f"/objects/{owner}" if owner in scene.objects else "/figure", piece) for piece, owner in pieces]
    return [f"{folder}/{scene.model.names[piece.parentJoint]}/{piece.name}" for folder, piece in folders]


def piece_placements(scene: Any, q: Any) -> Any:
    """Where Pinocchio says the pieces are, (n, 4, 4), from fresh data."""
    data, results = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.forwardKinematics(scene.model, data, q)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, results)
    return np.array([placement.homogeneous for placement in results.oMg])


@pytest.fixture(scope="session")
def chromium() -> str:
    """Return the path of a Chromium; without one skip, or fail where one is required."""
    found = find_chromium()
    if found is None:
        if os.environ.get("WHOLEBODY_REQUIRE_BROWSER") == "1":
            pytest.fail("WHOLEBODY_REQUIRE_BROWSER=1, and there is no Chromium")
        pytest.skip("no Chromium here")
    return found


@pytest.fixture(scope="session")
def draw_rarely() -> Callable[..., str]:
    """Return a function: pages that a browser opens from now on have a frame each so many milliseconds, ten a second.

    Without a GPU sixty keep a core busy, and a first drawing takes half a second: the pages of a `Viewer` move what
    they show in a frame, and draw it where a test captures it. The function returns the number of the script.
    """

    def draw(browser: Browser, pause: int = 100) -> str:
        source = f"""window.requestAnimationFrame = draw => setTimeout(() => {{
          if (window.viewer) Object.assign(viewer, {{ needs_render: false, set_dirty: () => {{}} }});
          draw(performance.now());
        }}, {pause})"""
        return str(browser._call("Page.addScriptToEvaluateOnNewDocument", source=source)["identifier"])

    return draw


@pytest.fixture(scope="session")
def _browser(chromium: str, draw_rarely: Callable[..., str]) -> Iterator[Browser]:
    with screenshot.Browser() as browser:  # one that drew pictures before, if there is one
        draw_rarely(browser)
        yield browser


@pytest.fixture
def browser(_browser: Browser) -> Iterator[Browser]:
    """Return a browser; a JavaScript error in any page it opens fails the test."""
    _browser.resize((320, 240))
    yield _browser
    errors = list(_browser.errors)
    _browser.evaluate("location.href = 'about:blank'")  # a live page would find the next test's server
    assert not errors


_NODES = """(paths => paths.map(path => {
  let node = viewer.scene_tree;
  for (const name of path.split("/").filter(x => x)) node = node && node.children[name];
  if (!node) return null;
  viewer.scene.updateMatrixWorld(true);
  let seen = true;
  for (let at = node.object; at; at = at.parent) seen = seen && at.visible;
  const matrix = new MeshCat.THREE.Matrix4().copy(viewer.scene.matrixWorld).invert().multiply(node.object.matrixWorld);
  const drawn = node.children["<object>"] && node.children["<object>"].object;
  return {seen, matrix: matrix.toArray(), color: drawn && drawn.material && drawn.material.color.toArray(),
          opacity: drawn && drawn.material && drawn.material.opacity, text: drawn && drawn.userData.text};
}))"""


@pytest.fixture
def nodes(browser: Browser) -> Callable[[Sequence[str]], list[Any]]:
    """Return a function that asks the page for its nodes: where they are in the world, seen or not, colour, text."""

    def ask(paths: Sequence[str]) -> list[Any]:
        found = browser.evaluate(f"{_NODES}({json.dumps(list(paths))})")
        for path, entry in zip(paths, found, strict=True):
            if entry is not None:
                entry["matrix"] = np.array(entry["matrix"]).reshape(4, 4).T
                entry["path"] = path
        return list(found)

    return ask


@pytest.fixture
def piece_nodes(nodes: Callable[[Sequence[str]], list[Any]]) -> Callable[[Any], list[Any]]:
    """Return a function that asks the page for the nodes of all pieces of a scene."""
    return lambda scene: nodes(node_paths(scene))


@pytest.fixture
def as_pinocchio_says(piece_nodes: Callable[[Any], list[Any]]) -> Callable[[Any, Any], int]:
    """Return a function that checks that every piece in the page is where Pinocchio says it is, and counts them."""

    def check(scene: Any, q: Any) -> int:
        found = np.array([entry["matrix"] for entry in piece_nodes(scene)])
        np.testing.assert_allclose(found, piece_placements(scene, q), atol=1e-5)
        return len(found)

    return check

"""Things that are drawn together: each is where Pinocchio says, of its size and in its colour, in a real page."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from wholebody.view import Viewer, scene_graph, style
from wholebody.view.browser import Browser
from wholebody.view.style import LOOK

pytestmark = pytest.mark.browser

READ = """["together 0", "together 1"].map(name => {
  const mesh = viewer.scene_tree.find(["objects", name, "<object>"]).object;
  return [mesh.count, [...mesh.instanceMatrix.array], [...mesh.instanceColor.array]];
})"""


def test_each_is_where_it_stands_in_its_size_and_colour(
    exhibit: Any, browser: Browser, nodes: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_graph, "MANY", 4)
    for k in range(3):
        exhibit.add(f"ball {k}", coal.Sphere(0.1 + 0.1 * k), (3.0, 0.5 * k, 1.0), color=(0.2, 0.4, 0.1 * k, 1.0))
    exhibit.add("block", coal.Box(0.2, 0.4, 0.6), (4.0, 0.0, 0.0), color=(1.0, 0.0, 0.0, 1.0))
    with Viewer(exhibit) as viewer:
        viewer.show(exhibit.posture(1))
        browser.open(viewer.url)
        data = exhibit.model.createData()
        pin.forwardKinematics(exhibit.model, data, exhibit.posture(1))
        exhibit.geometry.geometryObjects[-2].placement = pin.SE3(np.eye(3), data.oMi[2].translation)  # into the figure
        viewer.show(exhibit.posture(1))
        assert viewer.sync(10.0)
        boxes, balls = browser.evaluate(READ)
    assert (boxes[0], balls[0]) == (2, 4)  # the table; the egg, which is a ball with three radii
    places = np.array(balls[1]).reshape(4, 4, 4).transpose(0, 2, 1)
    for matrix, piece in zip(places[1:], exhibit.geometry.geometryObjects.tolist()[-4:-1], strict=True):
        expected = piece.placement.homogeneous @ np.diag([*[piece.geometry.radius] * 3, 1.0])
        np.testing.assert_allclose(matrix, expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(places[0, :3, :3], axis=0), (0.1, 0.15, 0.2), atol=1e-6)
    sides = np.linalg.norm(np.array(boxes[1]).reshape(2, 4, 4)[1, :3, :3], axis=1)
    np.testing.assert_allclose(sides, (0.2, 0.4, 0.6), atol=1e-6)
    shades = np.array(balls[2]).reshape(4, 3)
    np.testing.assert_allclose(shades[1:3], [(0.2, 0.4, 0.0), (0.2, 0.4, 0.1)], atol=1e-6)
    overlapping = style.tinted((0.2, 0.4, 0.2, 1.0), LOOK.penetration, LOOK.tint)[:3]
    np.testing.assert_allclose(shades[3], overlapping, atol=1e-6)
    assert nodes(["/objects/ball 0"]) == [None]

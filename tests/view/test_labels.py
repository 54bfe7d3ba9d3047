"""Labels in a real Chromium: they hide neither hands and faces nor each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.view.browser import Browser

pytestmark = pytest.mark.browser

_BOXES = """(() => {
  viewer.render();
  const up = Math.tan(viewer.camera.fov * Math.PI / 360), found = [];
  viewer.scene.traverse(o => {
    if (!o.isSprite) return;
    const at = new MeshCat.THREE.Vector3().setFromMatrixPosition(o.matrixWorld).project(viewer.camera);
    const h = o.scale.y / up, w = o.scale.x / (up * viewer.camera.aspect);
    found.push([at.x - w * o.center.x, at.y - h * o.center.y, w, h, o.userData.text]);
  });
  return found;
})()"""
_SEEN = "(p => new MeshCat.THREE.Vector3(p[0], p[2], -p[1]).project(viewer.camera).toArray())"


def test_labels_hide_neither_the_hand_nor_each_other(browser: Browser, tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.65, 0.0, 0.74))
    arm = {"right_shoulder_flexion": 0.4, "right_elbow_flexion": 0.5}  # the hand hangs, with its tip lowest
    q = scene.figure.with_joints(scene.figure.posture("standing"), arm)
    tip, palm = (scene.figure.placement(q, name).translation for name in ("right_index_tip", "right_palm"))
    places = [(1 - share) * tip + share * palm for share in np.linspace(0.0, 1.0, 9)]
    eyes = scene.figure.placement(q, "gaze").translation
    goals = [wb.Point("right_index_tip", tip), wb.Point("gaze", eyes)]
    with wb.Viewer(scene, names=True) as viewer:
        viewer.show(q, problem=wb.Problem(scene, q, goals=goals))
        browser.open(viewer.save(tmp_path / "labels.html").as_uri())
    boxes = browser.evaluate(_BOXES)
    assert {text.split()[0] for *_, text in boxes} >= {"right_index_tip", "table"}
    for x, y, w, h, text in boxes:
        for place in [*places, eyes]:
            across, down, _ = browser.evaluate(f"{_SEEN}({np.round(place, 6).tolist()})")
            assert not (x < across < x + w and y < down < y + h), f"{text} hides the hand or the face"
    for k, (x, y, w, h, _) in enumerate(boxes):
        for a, b, c, d, _ in boxes[:k]:
            assert x + w <= a or a + c <= x or y + h <= b + 1e-9 or b + d <= y + 1e-9

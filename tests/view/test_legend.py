"""The panel of the page: its title, its status, and only the colours that occur."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.view.browser import Browser

_PANEL = """(() => {
  const box = document.getElementById("panel");
  const [title, status, ...legend] = [...box.children].map(line => line.textContent);
  const colors = [...box.querySelectorAll("i")].map(patch => patch.style.background);
  return {title, status, legend, colors, shown: box.getBoundingClientRect().width > 0};
})()"""


@pytest.mark.browser
def test_the_page_tells_what_is_shown(browser: Browser, tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("hand"))
    q = scene.figure.neutral
    tip = scene.figure.placement(q, "right_index_tip").translation
    goal = wb.Point("right_index_tip", tip + np.array([0.0, 0.0, 0.02]))
    with wb.Viewer(scene, title="A <hand>") as viewer:
        viewer.show(q, problem=wb.Problem(scene, q, goals=[goal]))
        browser.open(viewer.url)
        assert viewer.sync(10.0)
        free: Any = browser.evaluate(_PANEL)
        assert free["shown"]
        assert free["title"] == "A <hand>"
        assert free["status"].startswith("goals missed by at most 20.0 mm")
        assert free["status"].endswith("no overlap")
        assert "goal, and the way to it" in free["legend"]
        assert "overlaps" not in free["legend"]
        assert len(free["colors"]) == len(free["legend"])

        scene.add(wb.Sphere(0.03), name="ball", at=tip)
        viewer.show(q)
        assert viewer.sync(10.0)
        inside = browser.evaluate(_PANEL)
        assert "overlaps" in inside["legend"]
        assert "goal, and the way to it" not in inside["legend"]
        depth = -min(scene.contacts(q, within=0.0).distance)
        assert inside["status"].endswith(f"deepest overlap {1e3 * depth:.1f} mm")

        viewer.play([q, q, q], 0.5)
        browser.open(viewer.save(tmp_path / "motion.html").as_uri())
        assert browser.evaluate(_PANEL)["status"].startswith("3 postures, 1.00 s; at most")


@pytest.mark.browser
def test_a_notebook_shows_the_scene_in_a_frame(browser: Browser, tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("hand"))
    with wb.Viewer(scene, title="In a notebook") as viewer:
        assert "nothing is shown yet" in viewer._repr_html_()
        viewer.show(scene.figure.neutral)
        (tmp_path / "cell.html").write_text(viewer._repr_html_(), encoding="utf-8")
    framed = "document.querySelector('iframe').contentWindow"
    ready = "document.querySelector('iframe')?.contentWindow?.wholebody?.ready === true"
    browser.visit((tmp_path / "cell.html").as_uri(), ready)
    assert browser.evaluate(f"{framed}.document.querySelector('#panel b').textContent") == "In a notebook"
    assert browser.evaluate(f"{framed}.viewer.scene_tree.find(['figure', 'body']).object.children.length") > 0
    assert browser.evaluate(f"{framed}.viewer.capture_image().length") > 10_000

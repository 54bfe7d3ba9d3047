"""The panel of the page: its title, its status, and only the colours that occur."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import wholebody as wb
from wholebody.view.browser import Browser
from wholebody.view.markers import Goals

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
        assert "goal, and the line to it" in free["legend"]
        assert "overlaps" not in free["legend"]
        assert len(free["colors"]) == len(free["legend"])

        scene.add(wb.Sphere(0.03), name="ball", at=tip)
        viewer.show(q)
        assert viewer.sync(10.0)
        inside = browser.evaluate(_PANEL)
        assert "overlaps" in inside["legend"]
        assert "goal, and the line to it" not in inside["legend"]
        depth = -min(scene.contacts(q, within=0.0).distance)
        assert inside["status"].endswith(f"deepest overlap {1e3 * depth:.1f} mm")

        viewer.play([q, q, q], 0.5)
        browser.open(viewer.save(tmp_path / "motion.html").as_uri())
        assert browser.evaluate(_PANEL)["status"].startswith("3 postures, 1.00 s; at most")


def _pixels(path: Path) -> Any:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


@pytest.mark.browser
def test_a_picture_has_the_panel_in_a_corner_beside_the_figure(chromium: str, tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("hand"))
    q = scene.figure.neutral
    middle = scene.state(q).center_of_mass()
    width, height = 480, 360
    with wb.Viewer(scene, title="A hand") as viewer:
        viewer.show(q)
        for aside, column in (((0.0, 0.0, 0.0), 0), ((0.0, 0.3, -0.2), 1)):  # in the middle; at the left, at the top
            viewer.look(middle + (1.0, 0.0, 0.0) + aside, middle + aside)
            bare = _pixels(viewer.picture(tmp_path / "bare.png", (width, height), legend=False))
            told = _pixels(viewer.picture(tmp_path / "told.png", (width, height)))
            rows, columns = np.nonzero(np.abs(told - bare).max(axis=2))
            assert rows.size
            inside = told[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
            assert inside.shape[1] < 0.45 * width
            assert inside.shape[0] < 0.45 * height
            assert inside.min() < 100  # letters
            assert (columns.max() < width / 2) == (column == 0)
            hand = np.abs(bare - bare[-1, width // 2]).max(axis=2) > 60
            assert hand.any()
            assert not hand[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].any()
        small = [viewer.picture(tmp_path / f"{flag}.png", (160, 120), legend=flag) for flag in (False, True)]
        np.testing.assert_array_equal(*map(_pixels, small))  # no room for it


def test_what_is_looked_at_from_afar_does_not_make_the_figure_small() -> None:
    scene = wb.Scene(wb.load("human"))
    eyes = scene.figure.placement(scene.figure.posture("standing"), "gaze").translation
    for far, kept in ((0.4, 0.4), (6.0, 1.0)):
        looked_at = eyes + (far * 0.8, far * 0.6, 0.0)
        problem = wb.Problem(scene, "standing", goals=[wb.Axis("gaze", (1, 0, 0), toward=looked_at)])
        (place,) = Goals(scene, problem).targets(scene.state(problem.start))
        np.testing.assert_allclose(place, eyes + (kept * 0.8, kept * 0.6, 0.0), atol=1e-9)


def test_goals_are_drawn_where_they_are_resolved_without_the_warnings_of_stating_them() -> None:
    scene = wb.Scene(wb.load("human"))
    turned = (0.5, -0.2, 1.1, 1.0, 0.0, 0.0, 0.0)
    with pytest.warns(UserWarning, match="half a turn about x"):
        goals = [wb.Frame("right_palm", turned), wb.Relative("left_palm", "right_palm", turned)]
    problem = wb.Problem(scene, goals=goals)
    state = scene.state(problem.start)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        places = Goals(scene, problem).targets(state)
    palm = scene.figure.placement(problem.start, "right_palm")
    np.testing.assert_allclose(places, [turned[:3], palm.act(np.array(turned[:3]))], atol=1e-12)

"""The human among real things, as users see it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wholebody.figures import load
from wholebody.figures.surface import surface_of
from wholebody.geometry.shapes import Box, HalfSpace
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Point
from wholebody.view import Viewer, screenshot
from wholebody.view.browser import Browser
from wholebody.view.page import picture_page
from wholebody.view.screenshot import Screenshots

pytestmark = pytest.mark.browser


def test_a_picture_of_the_human(chromium: str, tmp_path: Path) -> None:
    figure = load("human")
    scene = Scene(figure).add(HalfSpace((0.0, 0.0, 1.0)), name="floor")
    with Viewer(scene) as viewer:
        viewer.show(figure.posture("standing"))
        values = np.asarray(Image.open(viewer.picture(tmp_path / "x.png", (320, 240))).convert("RGB")).astype(int)
    trunk = values[65:110, 150:170].reshape(-1, 3)
    blue = (trunk[:, 2] > trunk[:, 1] + 10) & (trunk[:, 1] > trunk[:, 0] + 10)  # the shirt
    assert blue.mean() > 0.8
    head = values[20:50, 150:170].reshape(-1, 3)
    tan = (head[:, 0] > head[:, 1] + 15) & (head[:, 1] > head[:, 2] + 10)
    assert tan.mean() > 0.2
    assert values.max() <= 255
    assert (values.min(axis=2) > 250).mean() < 0.02  # nothing is burnt out


def test_a_contact_colours_the_shoe_around_it_and_not_all_of_it(chromium: str, tmp_path: Path) -> None:
    figure = load("human")
    q = figure.posture("standing")
    sole = figure.placement(q, "left_sole").translation
    scene = Scene(figure).add(HalfSpace((0.0, 0.0, 1.0), offset=sole[2]), name="floor")
    with Viewer(scene) as viewer:
        viewer.show(q)
        viewer.look(sole + [0.6, 0.9, 0.5], sole)
        values = np.asarray(Image.open(viewer.picture(tmp_path / "x.png", (320, 240), legend=False)).convert("RGB"))
    red, _, blue = np.moveaxis(values.astype(int), -1, 0)
    painted, plain = red > blue + 30, (red > blue + 5) & (red < 75)
    assert 40 < painted.sum() < plain.sum()


def test_a_body_that_is_small_in_the_picture_is_drawn_with_fewer_triangles(browser: Browser, tmp_path: Path) -> None:
    figure = load("human")
    viewer = Viewer(Scene(figure))
    viewer.show(figure.posture("standing"))
    viewer.look((1.2, 0.0, 1.0), (0.8, 0.0, 1.0))  # a pixel there is fine in a small window too
    browser.open(viewer.save(tmp_path / "page.html").as_uri())
    count = "(viewer.render(), viewer.renderer.info.render.triangles)"
    near = browser.evaluate(count)
    small = browser.evaluate(f"viewer.camera.position.x = 12.0; {count}")
    surface = surface_of(figure)
    assert surface is not None
    fine = sum(len(patch.faces) for patch in surface.patches)
    coarse = sum(len(patch.coarse) for patch in surface.patches)
    assert near - small == fine - coarse
    assert small < 3 * coarse  # the shadow is drawn coarsely in both


def test_a_page_for_pictures_has_the_shaders_of_a_person_and_light_from_behind_asks_for_no_shadows(
    browser: Browser, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Shaders are compiled before the scene comes.

    Light from behind is no light: shadows are asked for in fewer places. The picture is the one where, as in three's
    own shaders, they are asked for everywhere.
    """
    monkeypatch.setattr(screenshot, "Browser", lambda **_: browser)
    programs = "viewer.renderer.info.programs.map(program => program.cacheKey)"
    page = picture_page()
    everywhere = page.replace("directLight.direction ) > 0.0 ?", "directLight.direction ) > -2.0 ?")
    assert everywhere != page
    figure = load("human")
    scene = Scene(figure).add(HalfSpace((0.0, 0.0, 1.0)), name="floor")
    scene.add(Box((0.4, 0.4, 0.4)), name="crate", at=(0.6, 0.0, 0.2))
    problem = Problem(scene, goals=[Point("right_index_tip", (0.4, -0.2, 1.2))])
    found = []
    for text, side in ((page, "> 0.0"), (everywhere, "> -2.0")):
        monkeypatch.setattr(screenshot, "picture_page", lambda text=text: text)
        browser.open_html(text)
        there = set(browser.evaluate(programs))
        viewer = Viewer(scene, screenshots=Screenshots())
        viewer.show(figure.posture("standing"), problem=problem)
        found.append(np.asarray(Image.open(viewer.picture(tmp_path / "person.png", (160, 120)))))
        assert set(browser.evaluate(programs)) <= there
        assert browser.evaluate(f"MeshCat.THREE.ShaderChunk.lights_fragment_begin.includes('direction ) {side} ?')")
    assert np.array_equal(*found)

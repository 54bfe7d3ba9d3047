"""Filmstrips of an assembly of loose bodies, which are drawn where they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import wholebody as wb
from wholebody.view.browser import Browser
from wholebody.view.side_by_side import GAP, write_filmstrip
from wholebody.view.viewed_scene import ViewedAssembly

RED = (0.9, 0.1, 0.1, 1.0)


def board_and_pin(x: float = 0.0) -> wb.Assembly:
    made = wb.Assembly().body("board", (x, 0.0, 0.0), shape=wb.Box((0.8, 0.3, 0.02)), color=RED)
    return made.body("pin", (0.5, 0.4, 0.2), shape=wb.Capsule(radius=0.02, length=0.3))


@pytest.mark.browser
def test_bodies_are_drawn_where_pinocchio_says(browser: Browser, as_pinocchio_says: Any, tmp_path: Path) -> None:
    shown = board_and_pin(0.3)
    with wb.Viewer(shown) as viewer:
        viewer.show(shown.q)
        browser.open(viewer.save(tmp_path / "bodies.html").as_uri())
        assert as_pinocchio_says(ViewedAssembly(shown), shown.q) == 2


@pytest.mark.browser
def test_a_strip_has_its_pictures_in_order(chromium: str, tmp_path: Path) -> None:
    postures = [board_and_pin(x).q for x in (-0.5, 0.5)]
    with wb.Viewer(board_and_pin()) as viewer:
        viewer.look(eye=(0.0, -3.0, 0.6), target=(0.0, 0.0, 0.0))
        path = write_filmstrip(viewer, postures, tmp_path / "strip.png", (120, 90))
    pixels = np.asarray(Image.open(path).convert("RGB"), dtype=int)
    assert pixels.shape == (90, 240 + GAP, 3)
    assert (pixels[:, 120 : 120 + GAP] == 255).all()
    red = pixels[..., 0] - pixels[..., 2] > 80
    first, second = (np.flatnonzero(part.any(axis=0)).mean() for part in (red[:, :120], red[:, 120 + GAP :]))
    assert first < 60 < second
    assert sorted(file.name for file in tmp_path.iterdir()) == ["strip.png"]

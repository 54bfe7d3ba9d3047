"""Rigid parts, shown where they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

import wholebody as wb
from wholebody.view.browser import Browser
from wholebody.view.filmstrip import GAP, write_filmstrip
from wholebody.view.parts import Part, Parts

RED, BLUE = (0.9, 0.1, 0.1, 1.0), (0.1, 0.1, 0.9, 1.0)


def board_and_pin() -> Parts:
    return Parts(
        {
            "board": [Part(wb.Box((0.8, 0.3, 0.02)), color=RED), Part(wb.Sphere(0.05), (0.4, 0.0, 0.0), BLUE)],
            "pin": [Part(wb.Capsule(radius=0.02, length=0.3))],
        }
    )


def test_a_posture_places_every_part() -> None:
    parts = board_and_pin()
    board = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.9), np.array((0.1, 0.2, 0.3)))
    q = parts.posture({"pin": (1.0, 0.0, 0.5), "board": board, "other": (0, 0, 0)})
    assert q.shape == (parts.model.nq,)
    data, results = parts.model.createData(), parts.geometry.createData()
    pin.updateGeometryPlacements(parts.model, data, parts.geometry, results, q)
    assert results.oMg[0].isApprox(board, 1e-12)
    np.testing.assert_allclose(results.oMg[1].translation, board.act(np.array((0.4, 0.0, 0.0))))
    np.testing.assert_allclose(results.oMg[2].translation, (1.0, 0.0, 0.5))
    assert [parts.objects[owner].color for owner in parts.piece_owner] == [RED, BLUE, None]


def test_mistakes_are_named() -> None:
    with pytest.raises(wb.InputError, match="no parts"):
        Parts({})
    with pytest.raises(wb.InputError, match="'board' has no shape"):
        Parts({"board": []})
    with pytest.raises(wb.UnknownNameError, match="pin"):
        board_and_pin().posture({"board": (0, 0, 0)})
    with pytest.raises(wb.InputError, match="at least one posture"):
        write_filmstrip(wb.Viewer(board_and_pin()), [], "strip.png")
    parts = board_and_pin()
    q = parts.posture({"board": (0, 0, 0), "pin": (0, 0, 0)})
    with pytest.raises(wb.InputError, match="2 ghosts for 1 postures; give one for each"):
        write_filmstrip(wb.Viewer(parts), [q], "strip.png", ghosts=[q, q])


@pytest.mark.browser
def test_parts_are_drawn_where_pinocchio_says(browser: Browser, as_pinocchio_says: Any, tmp_path: Path) -> None:
    parts = board_and_pin()
    with wb.Viewer(parts) as viewer:
        q = parts.posture({"board": (0.0, 0.0, 0.5, 0.0, 0.38268343, 0.0, 0.92387953), "pin": (0.5, 0.4, 0.2)})
        viewer.show(q)
        browser.open(viewer.save(tmp_path / "parts.html").as_uri())
        assert as_pinocchio_says(parts, q) == 3


@pytest.mark.browser
def test_a_strip_has_its_pictures_in_order(chromium: str, tmp_path: Path) -> None:
    parts = board_and_pin()
    left, right = ({"board": (x, 0.0, 0.0), "pin": (0.0, 0.0, -9.0)} for x in (-0.5, 0.5))
    with wb.Viewer(parts) as viewer:
        viewer.look(eye=(0.0, -3.0, 0.6), target=(0.0, 0.0, 0.0))
        path = write_filmstrip(viewer, [parts.posture(left), parts.posture(right)], tmp_path / "strip.png", (120, 90))
    pixels = np.asarray(Image.open(path).convert("RGB"), dtype=int)
    assert pixels.shape == (90, 240 + GAP, 3)
    assert (pixels[:, 120 : 120 + GAP] == 255).all()
    red = pixels[..., 0] - pixels[..., 2] > 80
    first, second = (np.flatnonzero(part.any(axis=0)).mean() for part in (red[:, :120], red[:, 120 + GAP :]))
    assert first < 60 < second
    assert sorted(file.name for file in tmp_path.iterdir()) == ["strip.png"]

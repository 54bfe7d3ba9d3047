"""The page of a live drag without a browser: every method, configured ones, and assemblies."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking.live import LiveDrag
from wholebody.view.live_page import LivePage

pytest.importorskip("viser")


def opened(drag: LiveDrag, folder: Path) -> LivePage:
    return LivePage(drag, folder / "posture.toml", 8393)


def problem() -> wb.Problem:
    return wb.Problem(wb.Scene(wb.load("avatar")), constraints=[wb.Hold("left_foot")])


@pytest.mark.parametrize("method", ["ccd", wb.methods.Newton(algebra="kkt")], ids=str)
def test_the_page_opens_with_every_method_and_changes_to_every_other(
    method: str | wb.methods.QP, tmp_path: Path
) -> None:
    drag = LiveDrag(problem(), method)
    page = opened(drag, tmp_path)
    try:
        name = method if isinstance(method, str) else method.name
        assert page._method.value == drag.chosen == name
        assert page._method.options == tuple(drag.methods)
        for other in page._method.options:
            page._method.value = other
            page._choose(SimpleNamespace())
            assert drag.chosen == other
        page._method.value = name
        page._choose(SimpleNamespace())
        assert drag.method == (method if not isinstance(method, str) else LiveDrag(problem(), method).method)
    finally:
        page.stop()


def test_an_assembly_has_a_page(tmp_path: Path) -> None:
    made = wb.Assembly().body("block", (0, 0, 1), shape=wb.Box((0.1, 0.1, 0.1)), color="red").body("lamp", (1, 0, 1))
    drag = LiveDrag(made.add(wb.HalfSpace(), name="floor"))
    page = opened(drag, tmp_path)
    try:
        drag.take("block")
        for share in np.linspace(0.0, 1.0, 10)[1:]:
            frame = page.follow(np.array((0.1 * share, 0.0, 1.0)))
        assert frame.error < 1e-3
        assert page._method.options == ("newton",)
    finally:
        page.stop()


def test_the_way_within_a_frame_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a thing moves the figure does not go straight: the thing and it are shown on the way too."""
    given = problem()
    given.scene.add(wb.Sphere(0.1), name="ball", at=(2.0, 0.0, 1.0))
    drag = LiveDrag(wb.Problem(given.scene))
    page = opened(drag, tmp_path)
    try:
        drag.take("ball")
        move, aside = drag.move, drag.q + 0.0
        aside[0] += 0.5
        ball = next(n for n, owner in enumerate(drag.scene.piece_owner) if owner == "ball")
        seen, show = [], page._place

        def noted(q: np.ndarray, at: dict) -> None:
            show(q, at)
            seen.append((q[0], page._pieces[ball].position[0]))

        monkeypatch.setattr(page, "_place", noted)
        way = ((0.0, drag.q), (0.25, aside), (1.0, drag.q))
        monkeypatch.setattr(drag, "move", lambda place: move(place)._replace(path=way))
        page.follow(np.array((1.6, 0.0, 1.0)))
        assert seen == [(aside[0], pytest.approx(1.9875)), (drag.q[0], pytest.approx(1.95))]
    finally:
        page.stop()

"""Scenes in the cells of a notebook: frames that share one player, also where the notebook is saved and opened."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import wholebody as wb
from wholebody.view import page
from wholebody.view.browser import Browser

PLAYER = "data-part=&quot;player&quot; type=&quot;application/octet-stream&quot;&gt;H4s"  # how packed data begins


class Kernel:
    """What IPython's kernel says of the cell that it runs."""

    def __init__(self) -> None:
        self.user_ns: dict[str, Any] = {"In": [""]}
        self.message: dict[str, Any] = {}

    def run(self, cell: str | None, run: str) -> None:
        self.message = {"header": {"msg_id": run}, "metadata": {"cellId": cell} if cell else {}}

    def get_parent(self) -> dict[str, Any]:
        return self.message


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    made = Kernel()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: made))
    monkeypatch.setattr(page, "_carriers", {})
    return made


@pytest.fixture
def viewers() -> Iterator[list[wb.Viewer]]:
    scene = wb.Scene(wb.load("hand"))
    with ExitStack() as open_ones:
        made = [open_ones.enter_context(wb.Viewer(scene, title=f"scene {k}")) for k in range(2)]
        assert "nothing is shown yet" in made[0]._repr_html_()
        for viewer in made:
            viewer.show(scene.figure.neutral)
        yield made


def test_the_first_cell_has_the_player_whenever_it_is_run(kernel: Kernel, viewers: list[wb.Viewer]) -> None:
    for cell, run, has in (
        ("a", "1", True), ("a", "1", False), ("b", "2", False), ("a", "3", True), ("b", "4", False)
    ):  # fmt: skip
        kernel.run(cell, run)
        assert (PLAYER in viewers[0]._repr_html_()) is has, (cell, run)
    kernel.run(None, "5")  # a cell without a name
    assert PLAYER not in viewers[0]._repr_html_()


def test_without_a_kernel_every_scene_has_the_player(viewers: list[wb.Viewer]) -> None:
    assert all(PLAYER in viewer._repr_html_() for viewer in viewers)


def test_a_second_view_of_a_person_has_no_skin_of_its_own(kernel: Kernel) -> None:
    """But again where the cell that had it shows it no more."""
    scene = wb.Scene(wb.load("human"))
    with wb.Viewer(scene) as viewer:
        viewer.show(scene.figure.neutral)
        sizes = []
        for cell, run in (("a", "1"), ("b", "2"), ("b", "3"), ("a", "4")):
            kernel.run(cell, run)
            sizes.append(len(viewer._repr_html_()))
        with wb.Viewer(wb.Scene(wb.load("hand"))) as other:
            other.show(wb.load("hand").neutral)
            kernel.run("a", "5")
            other._repr_html_()
        kernel.run("b", "6")
        sizes.append(len(viewer._repr_html_()))
    whole, second, again, first, anew = sizes
    assert max(second, again) < 100_000
    assert first == whole > 10 * second
    assert 3 * second < anew < whole  # the skin, without the player


@pytest.mark.browser
def test_a_saved_notebook_shows_all_its_scenes(
    kernel: Kernel, viewers: list[wb.Viewer], browser: Browser, tmp_path: Path
) -> None:
    frames = []
    for number, viewer in enumerate(viewers):
        kernel.run(str(number), str(number))
        frames.append(viewer._repr_html_())
    (tmp_path / "saved.html").write_text("\n".join([frames[1], frames[0]]), encoding="utf-8")
    framed = "[...document.querySelectorAll('iframe')].map(frame => frame.contentWindow)"
    browser.open((tmp_path / "saved.html").as_uri(), f"{framed}.every(one => one.wholebody?.ready === true)")
    titles = browser.evaluate(f"{framed}.map(one => one.document.querySelector('#panel b').textContent)")
    assert titles == ["scene 1", "scene 0"]
    pieces: Any = browser.evaluate(
        f"{framed}.map(one => one.viewer.scene_tree.find(['figure']).object.children.length)"
    )
    assert min(pieces) > 0
    (tmp_path / "alone.html").write_text(frames[1], encoding="utf-8")
    told = "document.querySelector('iframe')?.contentDocument?.querySelector('p')?.textContent"
    browser.open((tmp_path / "alone.html").as_uri(), f"{told} !== undefined")
    assert "first scene of this notebook" in str(browser.evaluate(told))

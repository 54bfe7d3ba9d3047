"""The page of a live drag in a real Chromium, driven by mouse events."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking.live import LiveDrag
from wholebody.view import live_page
from wholebody.view.browser import Browser
from wholebody.view.live_page import LivePage

pytestmark = pytest.mark.browser
EYE, TARGET = np.array((2.2, -1.6, 1.4)), np.array((0.0, 0.0, 0.9))
SIZE = (760, 320)  # small: without a GPU a frame of a large page takes a second


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LivePage]:
    monkeypatch.setattr(live_page, "SETTLING", 20)  # frames; a handle arrives in fewer
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.4, 0.8, 0.04)), name="table", at=(0.6, 0.3, 0.75))
    drag = LiveDrag(wb.Problem(scene, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")]))
    made = LivePage(drag, tmp_path / "posture.toml", 8377, lambda path: wb.taskfile.write_task(drag.stated(), path))
    for piece in made._pieces:  # the mouse finds handles; to draw the meshes of a person takes a core without a GPU
        piece.visible = False
    made.server.scene.configure_environment_map(None)
    yield made
    made.stop()


@pytest.fixture(autouse=True)
def drawn_more_rarely(browser: Browser, draw_rarely: Callable[[Browser, int], str]) -> Iterator[None]:
    """Pages draw twice a second: a frame of all the meshes takes a core a third of a second without a GPU."""
    script = draw_rarely(browser, 600)
    yield
    browser._call("Page.removeScriptToEvaluateOnNewDocument", identifier=script)


def until(true: Callable[[], Any], seconds: float = 150.0, pause: float = 0.05) -> Any:
    end = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(pause)
    return found


def pixel(place: Any, fov: float) -> tuple[float, float]:
    """Where a pinhole camera with z upright sees a place."""
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    away = np.asarray(place) - EYE
    scale = SIZE[1] / 2 / np.tan(fov / 2) / (away @ forward)
    return SIZE[0] / 2 + scale * (away @ right), SIZE[1] / 2 - scale * (away @ np.cross(right, forward))


def press(browser: Browser, text: str) -> None:
    script = f"[...document.querySelectorAll('button')].find(b => b.textContent.includes('{text}')).click()"
    browser.evaluate(script)


def mouse(browser: Browser, kind: str, x: float, y: float, pressed: bool = False) -> None:
    """Send a mouse event at a pixel: "mousePressed", "mouseMoved" or "mouseReleased", of the left button."""
    button, count = "left" if pressed or kind != "mouseMoved" else "none", int(kind != "mouseMoved")
    browser._call(
        "Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=int(pressed), clickCount=count
    )


def key(browser: Browser, name: str, shift: bool = False) -> None:
    """Press and release a key."""
    for kind in ("keyDown", "keyUp"):
        browser._call("Input.dispatchKeyEvent", type=kind, key=name, code=name, modifiers=8 * shift)


def arrived(drag: LiveDrag, place: Any) -> bool:
    """Whether the right palm is at a place and let go."""
    return bool(np.allclose(drag.place("right_palm"), place, atol=3e-3)) and not drag.taken


def undone(browser: Browser, drag: LiveDrag, start: Any) -> bool:
    """Whether the posture is that of the start; presses Escape if it is not."""
    if np.array_equal(drag.q, start):
        return True
    key(browser, "Escape")
    return False


def reached(browser: Browser, x: float, y: float) -> bool:
    """Move the mouse to a pixel; whether the page has drawn a handle there, of which its cursor tells."""
    for side in (3, 0):  # a mouse that stays tells nothing
        mouse(browser, "mouseMoved", x + side, y)
    return bool(browser.evaluate("[...document.querySelectorAll('canvas')].some(c => c.style.cursor === 'pointer')"))


@pytest.mark.timeout(500)
def test_mouse_drags_holds_undoes_and_saves(
    page: LivePage, browser: Browser, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    drag, start = page.drag, page.drag.q.copy()
    monkeypatch.setattr("wholebody.view.browser.TIMEOUT", 240.0)
    browser.resize(SIZE)
    page.server.initial_camera.position, page.server.initial_camera.look_at = EYE, TARGET
    browser.open(page.url, "document.readyState === 'complete'")
    client = until(lambda: list(page.server.get_clients().values()))[0]
    until(lambda: client.camera.fov)
    until(lambda: np.allclose(client.camera.position, EYE, atol=1e-3))
    before = drag.place("right_palm")
    x, y = pixel(before, client.camera.fov)
    until(lambda: reached(browser, x, y), pause=0.3)  # the page looks through all it shows at each move
    mouse(browser, "mousePressed", x, y, pressed=True)
    for share in np.linspace(0.0, 1.0, 4)[1:]:
        mouse(browser, "mouseMoved", x + 12 * share, y - 24 * share, pressed=True)
    until(lambda: drag.place("right_palm")[2] > before[2] + 0.05)
    mouse(browser, "mouseReleased", x + 12, y - 24)

    def away() -> float:  # pixels from the mouse
        across, down = pixel(drag.place("right_palm"), client.camera.fov)
        return float(np.hypot(across - x - 12, down - y + 24))

    until(lambda: away() < 6 and not drag.taken)  # it goes on to where the mouse let it go
    assert np.linalg.norm(drag.place("left_sole") - drag.place_at(start, "left_sole")) < 2e-3
    seen = pixel(drag.place("right_palm"), client.camera.fov)

    until(lambda: reached(browser, *seen), pause=0.3)
    mouse(browser, "mousePressed", *seen, pressed=True)
    mouse(browser, "mouseReleased", *seen)
    until(lambda: "right_palm" in drag.held)

    press(browser, "save")
    until((tmp_path / "posture.toml").exists)
    saved = wb.read_task(tmp_path / "posture.toml").problem
    assert len(saved.constraints) - len(saved.defaults) == 3
    press(browser, "undo")
    until(lambda: np.array_equal(drag.q, start))

    before = drag.place("right_palm")  # chosen by the last click
    for _ in range(3):
        key(browser, "ArrowDown", shift=True)
    there = before + (0.03 * 2.2 / np.hypot(1.6, 2.2), -0.03 * 1.6 / np.hypot(1.6, 2.2), 0.0)
    until(partial(arrived, drag, there))
    # presses that come late, from a busy browser, are drags of their own, each with an Escape
    until(lambda: undone(browser, drag, start), pause=0.5)
    assert np.allclose(client.camera.position, EYE, atol=1e-3)  # arrow keys do not turn the camera
    assert not browser.errors

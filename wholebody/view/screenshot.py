"""Pictures of the drawing by one headless browser: its page stays open, and gets only what changed since the last."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from wholebody.base.checks import listed, shown, whole
from wholebody.base.errors import InputError, MissingPackageError
from wholebody.view import commands
from wholebody.view.browser import Browser
from wholebody.view.page import picture_page
from wholebody.view.server import Command, Op, Store, bundle
from wholebody.view.style import LOOK


def check_size(size: Any) -> tuple[int, int]:
    """Width and height of a picture, pixels; raises InputError for what is not two whole numbers in range."""
    given = listed(size, "size", "(960, 720), pixels")
    if len(given) != 2:
        raise InputError(f"size is {shown(size)}; give width and height, pixels")
    most = 8192  # pixels: limit of software renderers
    return whole(given[0], "the width of size", 16, most), whole(given[1], "the height of size", 16, most)


def changes(before: Store, wanted: Sequence[Command]) -> list[Command] | None:
    """The commands that a page with `before` lacks; None where nodes go or bodies change: it is built anew."""
    after = Store()
    for command in wanted:
        after.apply(command)
    for path, node in before.nodes.items():
        now = after.nodes.get(path)
        if now is None or not node.properties.keys() <= now.properties.keys():
            return None
        body = path.startswith((LOOK.figure_node, LOOK.ghost_node))
        if (node.object is not None and (now.object is None or (body and now.object != node.object))) or (
            node.transform is not None and now.transform is None
        ):
            return None
    found = [commands.stop_animation()] if before.animation not in (None, after.animation) else []
    remade = {command.path for command in wanted if command.op == Op.OBJECT and not before.has(command)}
    for command in wanted:
        if command.op == Op.ANIMATION:
            if command.payload != before.animation:
                found.append(command)
        elif command.op == Op.CAMERA or command.path in remade or not before.has(command):
            found.append(command)
    return found


class Screenshots:
    """A headless browser that takes pictures; one can serve several viewers."""

    def __init__(self) -> None:
        self._browser: Browser | None = None
        self._shown: Store | None = None

    def start(self) -> None:
        """Start the browser, if there is a Chromium, without waiting for it."""
        with suppress(MissingPackageError):
            self._started()

    def picture(self, wanted: Sequence[Command], size: Any, *, legend: bool = False) -> bytes:
        """PNG of what commands draw in an empty page, of this width and height; with the panel if wanted."""
        return self._draw(wanted, size).capture(legend=legend)

    def pictures(self, wanted: Sequence[Command], size: Any, times: Iterable[float]) -> Iterator[bytes]:
        """PNGs at these times of a motion, seconds; raises like `picture`, before the first."""
        browser = self._draw(wanted, size)
        return (browser.capture(f"wholebody.seek({time!r})") for time in times)

    def close(self) -> None:
        """End the browser. Calling it again does nothing."""
        if self._browser is not None:
            self._browser.close()
        self._browser = self._shown = None

    def __enter__(self) -> Screenshots:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _started(self) -> Browser:
        if self._browser is None:
            self._browser, self._shown = Browser(page=picture_page()), Store()
        return self._browser

    def _draw(self, wanted: Sequence[Command], size: Any) -> Browser:
        """Bring the page to what the commands draw."""
        width, height = check_size(size)
        browser, before = self._started(), self._shown
        browser.resize((width, height))
        self._shown = None  # until all is drawn: after an error the next picture is drawn whole
        lacking = None if before is None else changes(before, wanted)
        if lacking is None or before is None:
            browser.open_html(picture_page())
            before, lacking = Store(), list(wanted)
        data = base64.b64encode(bundle([command.payload for command in lacking])).decode("ascii")
        browser.evaluate(f"wholebody.resize({width}, {height}); wholebody.take(wholebody.bytes('{data}')); 0")
        for command in lacking:
            before.apply(command)
        self._shown = before
        return browser

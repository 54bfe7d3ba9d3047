"""Pictures of pages by one headless browser, which is started when it is first needed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from wholebody.checks import listed, shown, whole
from wholebody.errors import InputError
from wholebody.view.browser import Browser

LARGEST = 8192  # pixels: limit of software renderers


def check_size(size: Any) -> tuple[int, int]:
    """Width and height of a picture, pixels.

    Raises:
        InputError: not two whole numbers, or out of range.
    """
    given = listed(size, "size", "(960, 720), pixels")
    if len(given) != 2:
        raise InputError(f"size is {shown(size)}; give width and height, pixels")
    return whole(given[0], "the width of size", 16, LARGEST), whole(given[1], "the height of size", 16, LARGEST)


class Screenshots:
    """A headless browser that takes pictures of pages."""

    def __init__(self) -> None:
        """Prepare; the first picture starts the browser."""
        self._browser: Browser | None = None

    def picture(self, page: str, size: Any) -> bytes:
        """PNG of a page (HTML) of this width and height.

        Raises:
            InputError: the size is out of range.
            MissingPackageError: there is no Chromium.
        """
        return self._open(page, size).capture()

    def pictures(self, page: str, size: Any, times: Iterable[float]) -> Iterator[bytes]:
        """PNGs of a page at these times of its motion, seconds; raises like `picture`, before the first."""
        browser = self._open(page, size)
        return (browser.capture(f"wholebody.seek({time!r})") for time in times)

    def close(self) -> None:
        """End the browser. Calling it again does nothing."""
        if self._browser is not None:
            self._browser.close()
        self._browser = None

    def _open(self, page: str, size: Any) -> Browser:
        width, height = check_size(size)
        if self._browser is None:
            self._browser = Browser()
        self._browser.resize((width, height))
        self._browser.open_html(page)
        return self._browser

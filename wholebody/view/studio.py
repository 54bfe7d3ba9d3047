"""Pages turned into pictures by one headless browser, started when it is first needed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from wholebody.errors import InputError
from wholebody.view.browser import Browser

LARGEST = 8192  # pixels: no software renderer goes beyond


class Studio:
    """A headless browser and what it is used for here."""

    def __init__(self) -> None:
        """Start nothing yet."""
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
        """End the browser. Doing it again does nothing."""
        if self._browser is not None:
            self._browser.close()
        self._browser = None

    def _open(self, page: str, size: Any) -> Browser:
        if np.shape(size) != (2,) or not all(isinstance(n, (int, np.integer)) and 16 <= n <= LARGEST for n in size):
            raise InputError(f"size is width and height, whole numbers from 16 to {LARGEST} pixels, not {size}")
        if self._browser is None:
            self._browser = Browser()
        self._browser.resize((int(size[0]), int(size[1])))
        self._browser.open_html(page)
        return self._browser

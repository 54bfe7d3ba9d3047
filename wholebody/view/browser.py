"""A headless Chromium, controlled by its DevTools protocol over two pipes, without a port; it ends with us."""

from __future__ import annotations

import atexit
import base64
import fcntl
import json
import os
import select
import shutil
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from wholebody.base.errors import MissingPackageError, WholebodyError
from wholebody.base.files import Scratch

_FLAGS = (
    "--no-sandbox",  # a container has no sandbox; the only page is our own, and it has no network
    *("--headless", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--disable-quic"),
    *("--no-first-run", "--no-default-browser-check", "--disable-extensions", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--disable-features=Translate,OptimizationHints,MediaRouter"),
    *("--hide-scrollbars", "--mute-audio", "--force-device-scale-factor=1", "--force-color-profile=srgb"),
    *("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--remote-debugging-pipe"),
)
_READY = "window.wholebody !== undefined && window.wholebody.ready"


TIMEOUT = 60.0  # s: longest wait for any answer


class BrowserError(WholebodyError):
    """The headless browser failed to carry out a command."""


def find_chromium() -> str | None:
    """Path of a Chromium or Chrome: that of WHOLEBODY_CHROMIUM, otherwise the first on the PATH; None without any."""
    named = os.environ.get("WHOLEBODY_CHROMIUM")
    if named:
        return shutil.which(named)
    # the shell draws the same, and starts in half of the time
    names = ("chromium-headless-shell", "chrome-headless-shell", "chromium", "chromium-browser", "google-chrome")
    return next((path for name in (*names, "google-chrome-stable", "chrome") if (path := shutil.which(name))), None)


class Browser:
    """One headless Chromium with one page.

    It starts at once, and is waited for at the first call of a method, which raises BrowserError if it did not start.

    Attributes:
        errors: JavaScript errors of the page since it was opened.
        requests: addresses that the page requested since it was opened.
    """

    def __init__(self, size: tuple[int, int] = (960, 720), page: str = "") -> None:
        """Start Chromium with a page of a width and height, pixels, that opens the HTML of a `Viewer`; "" for none.

        MissingPackageError without Chromium, BrowserError where it cannot be started.
        """
        executable = find_chromium()
        if executable is None:
            raise MissingPackageError(
                "pictures and movies need Chromium, and none was found; run: apt-get install chromium-headless-shell "
                "(or name one in WHOLEBODY_CHROMIUM); save() writes HTML without a browser"
            )
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._size, self._opens = size, bool(page)
        self._number = 0
        self._partial = b""
        self._session: str | None = None
        self._answers: dict[int, dict[str, Any]] = {}
        self._loaded = False
        self._pid: int | None = None
        self._scratch = Scratch()
        self._folder = self._scratch.path
        self._path = executable
        self._start(self._written(page) if page else "about:blank")
        atexit.register(self.close)

    def _start(self, url: str) -> None:
        """Start Chromium with the reading end of one pipe as descriptor 3, the writing end of another as 4."""
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        # other numbers than 3 and 4, so that no dup2 overwrites the other
        high_in, high_out = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (theirs_in, theirs_out))
        actions = [
            (os.POSIX_SPAWN_OPEN, fd, os.devnull, flag, 0)
            for fd, flag in ((0, os.O_RDONLY), (1, os.O_WRONLY), (2, os.O_WRONLY))
        ]
        actions += [(os.POSIX_SPAWN_DUP2, high_in, 3), (os.POSIX_SPAWN_DUP2, high_out, 4)]  # type: ignore[list-item]
        command = [self._path, *_FLAGS, f"--user-data-dir={self._folder / 'profile'}", url]
        try:
            self._pid = os.posix_spawn(self._path, command, os.environ, file_actions=actions, setpgroup=0)
        except OSError as error:
            raise BrowserError(f"{self._path} could not be started: {error}") from None
        finally:
            for descriptor in (theirs_in, theirs_out, high_in, high_out):
                os.close(descriptor)

    def _attach(self) -> None:
        """Wait for the page that Chromium opened when it started, and listen to it."""
        pages: list[Any] = []
        end = time.monotonic() + TIMEOUT
        while not pages and time.monotonic() < end:
            found = self._ask("Target.getTargets", None)["targetInfos"]
            pages = [target["targetId"] for target in found if target["type"] == "page"]
            time.sleep(0.0 if pages else 0.01)
        if not pages:
            raise BrowserError(f"the browser opened no page within {TIMEOUT:g} s")
        self._session = self._ask("Target.attachToTarget", None, targetId=pages[0], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network"):
            self._call(f"{domain}.enable")
        self._call("Page.bringToFront")
        self.resize(self._size)
        if self._opens:
            self.until(_READY)

    def resize(self, size: tuple[int, int]) -> None:
        """Change the width and height of the page, pixels."""
        self._call(
            "Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False
        )

    def open(self, url: str, ready: str = _READY) -> None:
        """Open an address, and wait until a JavaScript expression is true: that a `Viewer`'s page has drawn all."""
        self.errors.clear()
        self.requests.clear()
        self._loaded = False
        if error := self._call("Page.navigate", url=url).get("errorText"):
            raise BrowserError(f"the browser could not open {url}: {error}")
        end = time.monotonic() + TIMEOUT
        while not self._loaded:
            self._receive(end)
        self.until(ready)

    def open_html(self, page: str) -> None:
        """Open a page of a `Viewer` from its HTML, as a file without network."""
        self.open(self._written(page))

    def _written(self, page: str) -> str:
        path = self._folder / "page.html"
        path.write_text(page, encoding="utf-8")
        return path.as_uri()

    def until(self, condition: str) -> None:
        """Wait until a JavaScript expression is true; raises BrowserError for a page that has an error or is slow."""
        end = time.monotonic() + TIMEOUT
        while not self.evaluate(condition):
            if self.errors:
                raise BrowserError(f"the page failed: {self.errors[0]}")
            if time.monotonic() > end:
                raise BrowserError(f"the page did not reach `{condition}` within {TIMEOUT:g} s")
            time.sleep(0.02)

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression in the page; promises are awaited. Raises BrowserError where it throws."""
        return self._begin(expression)()

    def _begin(self, expression: str) -> Callable[[], Any]:
        """Let the page find the value of a JavaScript expression; the function that is returned waits for it."""
        if self._session is None:
            self._attach()
        number = self._send(
            "Runtime.evaluate", self._session, expression=expression, returnByValue=True, awaitPromise=True
        )

        def value() -> Any:
            answer = self._answer("Runtime.evaluate", number)
            if "exceptionDetails" in answer:
                raise BrowserError(f"the page failed: {_message(answer['exceptionDetails'])}")
            return answer["result"].get("value")

        return value

    def capture(self, first: str = "0") -> bytes:
        """PNG of the drawing without controls and panel, after JavaScript that comes first."""
        return self.capturing(first)()

    def capturing(self, first: str = "0", *, legend: bool = False) -> Callable[[], bytes]:
        """Begin to `capture`, with the panel in a corner or not, and return the function that waits for the PNG."""
        if self.errors:
            raise BrowserError(f"the page failed: {self.errors[0]}")
        data = self._begin(f"{first}; wholebody.capture({json.dumps(legend)})")
        return lambda: base64.b64decode(data().partition(",")[2])

    def close(self) -> None:
        """End Chromium and remove its temporary files. Calling it again does nothing."""
        if self._pid is None:
            return
        atexit.unregister(self.close)
        pid, self._pid = self._pid, None
        os.set_blocking(self._out, False)
        with suppress(OSError):
            os.write(self._out, b'{"id": 0, "method": "Browser.close"}\0')
        os.close(self._out)  # Chromium ends when its pipe does too, but a forked process may still hold the pipe
        os.close(self._in)
        if not _ended(pid, 3.0):
            os.killpg(pid, signal.SIGKILL)
            _ended(pid, 3.0)
        end = time.monotonic() + 3.0
        self._scratch.close()
        while self._folder.exists() and time.monotonic() < end:  # its last processes may still write there
            time.sleep(0.01)
            self._scratch.close()

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- the protocol: JSON messages, each ended by a zero byte

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        if self._session is None:
            self._attach()
        return self._ask(method, self._session, **params)

    def _ask(self, method: str, session: str | None, **params: Any) -> dict[str, Any]:
        return self._answer(method, self._send(method, session, **params))

    def _send(self, method: str, session: str | None, **params: Any) -> int:
        """Send a message; its number."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if session is not None:
            message["sessionId"] = session
        rest = memoryview(json.dumps(message).encode() + b"\0")
        try:
            while rest:
                rest = rest[os.write(self._out, rest) :]
        except OSError:
            raise self._gone() from None
        return self._number

    def _answer(self, method: str, number: int) -> dict[str, Any]:
        end = time.monotonic() + TIMEOUT
        while number not in self._answers:
            self._receive(end)
        answer = self._answers.pop(number)
        if "error" in answer:
            raise BrowserError(f"the browser refused {method}: {answer['error'].get('message')}")
        result: dict[str, Any] = answer["result"]
        return result

    def _gone(self) -> BrowserError:
        if self._session is not None:
            return BrowserError("the browser has ended; make a new one")
        return BrowserError(
            f"the browser did not start; try it by hand: {self._path} --headless --dump-dom about:blank"
        )

    def _receive(self, end: float) -> None:
        if not select.select([self._in], [], [], max(end - time.monotonic(), 0.0))[0]:
            raise BrowserError(f"the browser did not answer within {TIMEOUT:g} s")
        chunk = os.read(self._in, 1 << 20)
        if not chunk:
            raise self._gone()
        *whole, self._partial = (self._partial + chunk).split(b"\0")
        for text in whole:
            message = json.loads(text)
            params = message.get("params", {})
            if "id" in message:
                self._answers[message["id"]] = message
            elif message["method"] == "Runtime.exceptionThrown":
                self.errors.append(_message(params["exceptionDetails"]))
            elif message["method"] == "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            elif message["method"] == "Page.loadEventFired":
                self._loaded = True


def _message(details: dict[str, Any]) -> str:
    text = details.get("exception", {}).get("description") or details.get("text", "unknown error")
    return str(text).splitlines()[0]


def _ended(pid: int, timeout: float) -> bool:
    """Wait for a child process; False if it still runs after `timeout` seconds."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        try:
            if os.waitpid(pid, os.WNOHANG)[0] == pid:
                return True
        except ChildProcessError:
            return True
        time.sleep(0.01)
    return False

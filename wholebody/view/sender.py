"""Starts the server process and sends it drawing commands, many at a time, without waiting for answers."""

from __future__ import annotations

import atexit
import importlib.util
import json
import math
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from typing import Any

from wholebody.base import checks
from wholebody.base.errors import InputError, MissingPackageError, WholebodyError
from wholebody.view import server
from wholebody.view.server import Command, Op


def seconds(timeout: object) -> float:
    """Seconds to wait, which may be infinite; raises InputError where they are negative or no number."""
    if isinstance(timeout, float) and math.isinf(timeout) and timeout > 0.0:
        return timeout
    return checks.number(timeout, "timeout", 0.0, 1e9, "s, or math.inf")


class ViewerClosedError(WholebodyError):
    """The viewer's server process has ended, so nothing can be shown live any more."""


class Sender:
    """The program's side of a server process at `url`; commands go through a pipe, so nobody else can send any."""

    def __init__(self, page: str, host: str = "127.0.0.1", port: int = 0) -> None:
        """Serve the HTML of a page at a name or address of this machine; port 0 is the first free one."""
        if importlib.util.find_spec("tornado") is None:
            raise MissingPackageError("showing a scene live needs the package tornado; run: pip install tornado")
        self._lock = threading.Lock()
        self._lines: list[dict[str, Any]] = []
        self._partial = b""
        self._syncs = 0
        self.tabs = 0
        start, starting = "import runpy, sys; runpy.run_path(sys.argv.pop(1), run_name='__main__')", 20.0  # s
        self._process = subprocess.Popen(
            [sys.executable, "-c", start, server.__file__, str(os.getpid()), host, str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            start_new_session=True,  # Ctrl-C in the terminal reaches only the program; the server ends with it
        )
        atexit.register(self.close)
        try:
            answer = self._read(("url", "refused"), starting)
            if answer is not None and "refused" in answer:
                raise InputError(
                    f"the page cannot be served at {host}, port {port or 'any'} ({answer['refused']}); give another"
                )
            if answer is None:
                raise ViewerClosedError("the viewer's server did not start; run `wholebody doctor`")
            self.url = str(answer["url"])
            self._write(Command(Op.PAGE, payload=page.encode()).pack())
            self._read(("ready",), starting)
        except BaseException:
            self.close()
            raise

    def send(self, commands: Iterable[Command]) -> None:
        """Send commands to the server in one write; open tabs carry them out together."""
        self._write(b"".join(command.pack() for command in commands) + Command(Op.PUSH).pack())

    def wait(self, timeout: float) -> bool:
        """Wait until a tab shows the page; False if none did within `timeout` seconds."""
        return self._until(lambda: self.tabs > 0, timeout)

    def wait_until_closed(self, timeout: float, grace: float = 2.0) -> bool:
        """Wait until no tab has shown the page for `grace` seconds; False if one still did after `timeout` seconds."""
        end = time.monotonic() + timeout
        while self._until(lambda: self.tabs == 0, end - time.monotonic()):
            if not self._until(lambda: self.tabs > 0, min(grace, max(end - time.monotonic(), 0.0))):
                return True
        return False

    def sync(self, timeout: float) -> bool:
        """Wait until every open tab has carried out all commands; False if not within `timeout` seconds."""
        self._syncs += 1
        number = self._syncs
        self._write(Command(Op.PUSH).pack() + Command(Op.SYNC, key=str(number)).pack())
        return self._read(("sync",), timeout, number) is not None

    def close(self) -> None:
        """End the server process. Calling it again does nothing."""
        atexit.unregister(self.close)
        process = self._process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None and not pipe.closed:
                pipe.close()
        try:
            process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _write(self, data: bytes) -> None:
        pipe = self._process.stdin
        rest = memoryview(data)
        with self._lock:
            try:
                while rest and pipe is not None:
                    rest = rest[os.write(pipe.fileno(), rest) :]
            except (OSError, ValueError):
                raise ViewerClosedError("the viewer was closed or its server has ended; make a new wb.Viewer") from None

    def _until(self, true: Any, timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not true():
            if self._read(("tabs",), end - time.monotonic()) is None:
                return bool(true())
        return True

    def _read(self, keys: tuple[str, ...], timeout: float, value: Any = None) -> dict[str, Any] | None:
        """Next line of the server with one of the keys (and value); None after `timeout` seconds, or if it ended."""
        end = time.monotonic() + timeout
        while True:
            for number, line in enumerate(self._lines):
                if any(key in line and value in (None, line[key]) for key in keys):
                    return self._lines.pop(number)
            if not self._receive(end - time.monotonic()):
                return None

    def _receive(self, timeout: float) -> bool:
        pipe = self._process.stdout
        try:
            if pipe is None or not select.select([pipe], [], [], None if timeout == math.inf else max(timeout, 0.0))[0]:
                return False
            chunk = os.read(pipe.fileno(), 65536)
        except (OSError, ValueError):
            raise ViewerClosedError("the viewer was closed or its server has ended; make a new wb.Viewer") from None
        if not chunk:
            return False
        *whole, self._partial = (self._partial + chunk).split(b"\n")
        for text in whole:
            line = json.loads(text)
            self.tabs = line.get("tabs", self.tabs) if "sync" not in line else self.tabs
            self._lines.append(line)
        return True

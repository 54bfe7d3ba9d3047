"""The live page's server: on this machine only, never in the way, never left behind. No browser needed."""

from __future__ import annotations

import http.client
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from wholebody.view import Viewer
from wholebody.view.sender import ViewerClosedError


def listening(port: int) -> list[str]:
    """Addresses, as in /proc/net/tcp, that are listened on at a port."""
    found = []
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        if Path(table).exists():
            rows = [line.split() for line in Path(table).read_text().splitlines()[1:]]
            found += [row[1] for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")]
    return found


def status(url: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=60) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def handshake(url: str, origin: str) -> int:
    """Answer to a page of this origin that opens the socket."""
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=60)
    try:
        connection.request(
            "GET", "/socket", headers={**upgrade, "Sec-WebSocket-Key": "A" * 22 + "==", "Origin": origin}
        )
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's table of sockets")
def test_it_listens_on_the_loopback_address_only(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        port = int(viewer.url.rstrip("/").rpartition(":")[2])
        assert listening(port) == [f"0100007F:{port:04X}"]


def test_it_refuses_foreign_names_and_origins(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        assert status(viewer.url) == 200
        assert status(viewer.url, Host="evil.example") == 403
        assert [handshake(viewer.url, origin) for origin in (viewer.url.rstrip("/"), "http://evil.example")] == [
            101,
            403,
        ]
        assert status(viewer.url + "../page.py") == 404


def test_waiting_without_a_browser_ends_and_leaves_the_viewer_working(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        viewer.show(exhibit.posture(0))
        assert not viewer.wait(0.2)
        viewer.show(exhibit.posture(1))
        assert viewer.sync(10.0)
        assert viewer.wait_until_closed(10.0)


def test_two_viewers_have_two_addresses(exhibit: Any) -> None:
    with Viewer(exhibit) as first, Viewer(exhibit) as second:
        assert first.url != second.url


def test_closing_ends_the_server_and_can_be_repeated(exhibit: Any, tmp_path: Path) -> None:
    viewer = Viewer(exhibit)
    viewer.show(exhibit.posture(0))
    url = viewer.url
    viewer.close()
    viewer.close()
    with pytest.raises(urllib.error.URLError):
        status(url)
    viewer.show(exhibit.posture(1))
    assert viewer.save(tmp_path / "scene.html").stat().st_size > 500_000


def test_a_server_that_has_died_is_reported(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        viewer.show(exhibit.posture(0))
        assert viewer.url
        assert viewer._sender is not None
        viewer._sender._process.kill()
        viewer._sender._process.wait()
        with pytest.raises(ViewerClosedError, match="make a new"):
            viewer.show(exhibit.posture(1))


ORPHAN = """
import os, sys, time
from wholebody.view.page import live_page
from wholebody.view.sender import Sender
sender = Sender(live_page())
child = os.fork()  # holds the pipe to the server open, as a worker process would
if child == 0:
    time.sleep(300)
    os._exit(0)
print(sender._process.pid, child, flush=True)
time.sleep(300)
"""


def gone(pid: int, within: float = 60.0) -> bool:
    """Whether a process ends in time; one that is dead but not yet waited for counts as ended."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        try:
            os.kill(pid, 0)
            if re.search(r"^State:\s+Z", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE):
                return True
        except (ProcessLookupError, FileNotFoundError):
            return True
        time.sleep(0.05)
    return False


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads Linux's table of processes")
def test_the_server_ends_when_its_parent_is_killed() -> None:
    program = subprocess.Popen([sys.executable, "-c", ORPHAN], stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout is not None
        server, child = (int(word) for word in program.stdout.readline().split())
        program.kill()
        program.wait()
        try:
            assert gone(server)
        finally:
            os.kill(child, signal.SIGKILL)
    finally:
        program.kill()
        program.wait()
        if program.stdout is not None:
            program.stdout.close()

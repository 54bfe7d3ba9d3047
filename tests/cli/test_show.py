"""`wholebody show`: it waits for a browser, at the address that was asked for, and leaves nothing behind."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from wholebody.cli import main
from wholebody.view import Viewer, screenshot
from wholebody.view.browser import find_chromium

GRACE = 0.5  # s: how long a tab may be away while it loads again


def free_port() -> int:
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])


def showing(*arguments: str) -> tuple[subprocess.Popen[str], str]:
    """A process that shows a hand, and the address it says; no browser of the desktop is opened."""
    code = (
        "import sys; from wholebody.cli import main; from wholebody.view.server import Server; "
        f"Server.wait_until_closed.__defaults__ = ({GRACE},); sys.exit(main(sys.argv[1:]))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, "show", "hand", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "BROWSER": "true %s"},
    )
    assert process.stdout is not None
    found = re.search(r"http://\S+/", process.stdout.readline())
    assert found, process.communicate()
    return process, found[0]


def status(url: str, host: str | None = None) -> int:
    request = urllib.request.Request(url, headers={} if host is None else {"Host": host})
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


@pytest.fixture(scope="module", autouse=True)
def waiting() -> Iterator[tuple[subprocess.Popen[str], str, int, float]]:
    """Begin to show while the other tests of this file run; yield the process, its address, the port and when."""
    port = free_port()
    process, url = showing("--host", "0.0.0.0", "--port", str(port))
    yield process, url, port, time.monotonic()
    process.kill()
    process.communicate()


def test_every_address_of_this_machine_can_be_served_and_no_foreign_name(
    waiting: tuple[subprocess.Popen[str], str, int, float],
) -> None:
    url = waiting[1]
    assert status(url) == 200
    assert status(url, "192.168.7.7:7000") == 200
    assert status(url, socket.gethostname()) == 200
    assert status(url, "evil.example") == 403


def test_ctrl_c_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Viewer, "open", lambda viewer: viewer)
    monkeypatch.setattr(Viewer, "wait", lambda viewer, timeout: signal.raise_signal(signal.SIGINT))
    assert main(["show", "hand"]) == 130


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--port", "70000"], "port is 70000; give a whole number between 0 and 65535"),
        (["--port", "-1"], "port is -1"),
        (["--host", "192.0.2.1"], "cannot be served at 192.0.2.1"),
        (["--host", "no such host"], "cannot be served at no such host"),
        (["--host", "x" * 500], "host is 'xxx"),
        (["--save", "a.html", "--port", "7777"], "leave them out beside --save"),
    ],
)
def test_an_address_that_cannot_be_served_is_named(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", "hand", *arguments]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1


def test_a_port_that_is_taken_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["show", "hand", "--port", str(port)]) == 2
    assert f"port {port} (" in capsys.readouterr().err


def test_the_package_is_a_command_too() -> None:
    done = subprocess.run([sys.executable, "-m", "wholebody", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("wholebody ")


def test_a_file_keeps_the_size_of_its_own_person(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tall = tmp_path / "tall.glb"
    assert main(["show", str(tmp_path / "task.toml"), "--sex", "female", "--save", str(tall)]) == 2
    assert "leave out --sex" in capsys.readouterr().err


@pytest.mark.browser
def test_it_waits_for_the_first_tab_however_late_and_ends_with_the_last(
    waiting: tuple[subprocess.Popen[str], str, int, float],
) -> None:
    if find_chromium() is None:
        (pytest.fail if os.environ.get("WHOLEBODY_REQUIRE_BROWSER") else pytest.skip)("there is no Chromium")
    process, url, port, began = waiting
    assert url == f"http://127.0.0.1:{port}/"
    time.sleep(max(0.0, began + 2.0 * GRACE - time.monotonic()))
    assert process.poll() is None
    with screenshot.Browser() as browser:
        browser.open(url)
        assert browser.evaluate("document.title") == "hand"
        assert process.poll() is None
    process.communicate(timeout=30)
    assert process.returncode == 0

"""The live page's server: on this machine only, never in the way, never left behind. No browser needed."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import wholebody
from wholebody.view import Viewer
from wholebody.view.viser_server import viser_server


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


UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "A" * 22 + "==",
}


def answer(url: str, *headers: tuple[str, str]) -> int:
    """Status of the answer to a request with just these headers; a name may be there twice, or not at all."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.netloc, timeout=60)
    try:
        connection.putrequest("GET", parts.path, skip_host=True)
        for name, value in headers:
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.fixture(params=["the viewer's", "the live drag's"])
def served(request: pytest.FixtureRequest, exhibit: Any) -> Iterator[tuple[str, str]]:
    """Return the address of a page of ours, and that of its socket: one for each server of the package."""
    if request.param == "the viewer's":
        with Viewer(exhibit) as viewer:
            yield viewer.url, viewer.url + "socket"
    else:
        pytest.importorskip("viser")
        server = viser_server(8391, "a page")
        url = f"http://127.0.0.1:{server.get_port()}/"
        yield url, url
        server.stop()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's table of sockets")
def test_it_listens_on_the_loopback_address_only(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        port = int(viewer.url.rstrip("/").rpartition(":")[2])
        assert listening(port) == [f"0100007F:{port:04X}"]


def test_pages_and_sockets_refuse_foreign_names_and_origins(served: tuple[str, str]) -> None:
    netloc = urlsplit(served[0]).netloc
    port = netloc.partition(":")[2]
    local, evil = f"localhost:{port}", f"evil.example:{port}"
    for url, extra, good in ((served[0], {}, 200), (served[1], UPGRADE, 101)):
        more = tuple(extra.items())
        for host in (netloc, local, netloc.upper(), f"[::1]:{port}"):
            assert answer(url, ("Host", host), *more) == good
            assert answer(url, ("Host", host), ("Origin", f"http://{host}"), *more) == good
        foreign = (evil, "evil.example", f"127.0.0.1.{evil}", f"8.8.8.8:{port}", f"[::2]:{port}", f"x@{evil}", "")
        for host in foreign:
            assert answer(url, ("Host", host), *more) in (400, 403), host
            assert answer(url, ("Host", host), ("Origin", f"http://{host}"), *more) in (400, 403), host
        origins = (
            f"http://{evil}",
            "http://evil.example",
            "null",
            f"http://{netloc}.evil.example",
            "http://127.0.0.1:1",
        )
        for origin in (*origins, f"http://{local}"):
            assert answer(url, ("Host", netloc), ("Origin", origin), *more) == 403, origin
        assert answer(url, *more) in (400, 403)
        assert answer(url, ("Host", netloc), ("Host", evil), *more) in (400, 403)
        twice = (("Origin", f"http://{netloc}"), ("Origin", f"http://{evil}"))
        assert answer(url, ("Host", netloc), *twice, *more) in (400, 403)
    assert status(served[0] + "../page.py") == 404


def test_no_other_module_serves_anything() -> None:
    """So the guard of these two servers is that of every page."""
    serving = re.compile(
        r"\b(bind_sockets|create_server|start_server|ViserServer|HTTPServer|TCPServer|websockets?\.\S*serve|"
        r"MeshcatVisualizer|meshcat\.Visualizer|\.bind\(\(|http\.server|socketserver)\b"
    )
    package = Path(wholebody.__file__).parent
    found = {path.name for path in package.rglob("*.py") if serving.search(path.read_text(encoding="utf-8"))}
    assert found == {"server.py", "viser_server.py", "live_page.py"}  # live_page.py names the type of its server


def test_a_page_says_nothing_of_what_it_refuses(exhibit: Any, caplog: pytest.LogCaptureFixture) -> None:
    """Warnings of a logger without handlers end on the program's standard error."""
    with Viewer(exhibit) as viewer:
        assert status(viewer.url, Host="evil.example") == 403
        assert status(viewer.url + "nothing") == 404
    assert caplog.records == []


def test_a_page_on_ipv6_answers(exhibit: Any) -> None:
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind(("::1", 0))
    except OSError:
        pytest.skip("this machine has no IPv6")
    with Viewer(exhibit, host="::1") as viewer:
        assert status(viewer.url) == 200
        assert status(viewer.url, Host="evil.example") == 403


def test_a_page_for_other_machines_answers_addresses_and_its_own_name(exhibit: Any) -> None:
    with Viewer(exhibit, host="0.0.0.0") as viewer:
        for host in ("192.0.2.7", "[2001:db8::1]:80", socket.gethostname()):
            assert answer(viewer.url, ("Host", host)) == 200
        assert answer(viewer.url, ("Host", "evil.example")) == 403


def test_the_live_drags_server_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    server = viser_server(8391, "a page")
    url = f"http://127.0.0.1:{server.get_port()}/"
    wanted = {**UPGRADE, "Host": urlsplit(url).netloc, "Sec-WebSocket-Protocol": "viser-v0.0.0"}  # of another version
    assert answer(url, *wanted.items()) == 101
    server.stop()
    assert capfd.readouterr() == ("", "")


def test_waiting_without_a_browser_ends_and_leaves_the_viewer_working(exhibit: Any) -> None:
    with Viewer(exhibit) as viewer:
        viewer.show(exhibit.posture(0))
        assert not viewer.wait(0.2)
        viewer.show(exhibit.posture(1))
        assert viewer.sync(10.0)


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
    assert viewer.save(tmp_path / "scene.html").stat().st_size > 200_000


def test_closing_ends_the_server_while_a_forked_process_holds_its_socket(exhibit: Any) -> None:
    """Such as those of `multiprocessing`."""
    viewer = Viewer(exhibit)
    url = viewer.url
    forked = os.fork()
    if forked == 0:
        time.sleep(60)
        os._exit(0)
    try:
        viewer.close()
        with pytest.raises(urllib.error.URLError, match="refused"):
            status(url)
    finally:
        os.kill(forked, signal.SIGKILL)
        os.waitpid(forked, 0)


def test_closing_in_a_forked_process_leaves_the_page_to_its_parent(exhibit: Any) -> None:
    """A forked process that ends by `sys.exit` closes its copies of all viewers."""
    with Viewer(exhibit) as viewer:
        url = viewer.url
        forked = os.fork()
        if forked == 0:
            code = 1
            try:
                viewer.close()
                code = 0
            finally:
                os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(forked, 0)[1]) == 0
        assert status(url) == 200
        assert viewer.sync(10.0)

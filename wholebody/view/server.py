"""The live page: a thread serves it, and sends every drawing command to the browser tabs that show it.

It listens on one address, 127.0.0.1 by default, and takes commands from this process alone.
"""

from __future__ import annotations

import atexit
import importlib.util
import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple

from wholebody.base.errors import InputError, MissingPackageError
from wholebody.base.fields import Range

LOCAL = ("127.0.0.1", "localhost", "::1")


class Op:
    """Kinds of commands; STOP is a key of an ANIMATION."""

    OBJECT, TRANSFORM, PROPERTY, DELETE, CAMERA, ANIMATION = b"o", b"t", b"p", b"d", b"c", b"a"
    STOP = "stop"


class Command(NamedTuple):
    """A message to the page: kind, node, key, and msgpack bytes; an ANIMATION with key STOP is sent and not stored."""

    op: bytes
    path: str = ""
    key: str = ""
    payload: bytes = b""


class _Node:
    __slots__ = ("object", "properties", "transform")

    def __init__(self) -> None:
        self.object: bytes | None = None
        self.properties: dict[str, bytes] = {}
        self.transform: bytes | None = None


class Store:
    """The commands that show the present picture in a new page: the last value of everything, without history."""

    def __init__(self) -> None:
        self.nodes: dict[str, _Node] = {}
        self.camera: bytes | None = None
        self.animation: bytes | None = None

    def apply(self, command: Command) -> None:
        """Apply a command to the picture."""
        op, path, key, payload = command
        if op == Op.TRANSFORM:
            self._node(path).transform = payload
        elif op == Op.PROPERTY:
            self._node(path).properties[key] = payload
        elif op == Op.OBJECT:
            node = self._node(path)
            node.object = payload
            node.properties.clear()
            self.nodes.pop(f"{path}/<object>", None)
        elif op == Op.DELETE:
            for name in [name for name in self.nodes if name == path or name.startswith(path + "/")]:
                del self.nodes[name]
        elif op == Op.CAMERA:
            self.camera = payload
        elif op == Op.ANIMATION:
            self.animation = None if key == Op.STOP else payload

    def _node(self, path: str) -> _Node:
        node = self.nodes.get(path)
        if node is None:
            node = self.nodes[path] = _Node()
        return node

    def has(self, command: Command) -> bool:
        """Whether the command would change nothing."""
        node = self.nodes.get(command.path)
        if node is None:
            return False
        if command.op == Op.TRANSFORM:
            return node.transform == command.payload
        if command.op == Op.PROPERTY:
            return node.properties.get(command.key) == command.payload
        return command.op == Op.OBJECT and node.object == command.payload

    def commands(self) -> list[Command]:
        """Commands that build the picture in an empty page; the animation last, when all its nodes exist."""
        commands: list[Command] = []
        for path, node in self.nodes.items():
            if node.object is not None:
                commands.append(Command(Op.OBJECT, path, "", node.object))
            commands.extend(Command(Op.PROPERTY, path, key, payload) for key, payload in node.properties.items())
            if node.transform is not None:
                commands.append(Command(Op.TRANSFORM, path, "", node.transform))
        if self.camera is not None:
            commands.append(Command(Op.CAMERA, "", "", self.camera))
        if self.animation is not None:
            commands.append(Command(Op.ANIMATION, "", "", self.animation))
        return commands


def bundle(payloads: list[bytes]) -> bytes:
    """One message for the page: every payload after its length, four bytes, little-endian."""
    return b"".join(part for payload in payloads for part in (struct.pack("<I", len(payload)), payload))


class Queue:
    """The pending commands of one tab. A new transform or property replaces the pending one, so no tab lags."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self._place: dict[tuple[bytes, str, str], int] = {}

    def put(self, command: Command) -> None:
        """Add a command."""
        slot = (command.op, command.path, command.key)
        if command.op in (Op.TRANSFORM, Op.PROPERTY):
            if slot in self._place:
                self.waiting[self._place[slot]] = command.payload
                return
            self._place[slot] = len(self.waiting)
        else:
            self._place.clear()
        self.waiting.append(command.payload)

    def take(self) -> list[bytes]:
        """Return all pending commands, in order, and empty the queue."""
        taken, self.waiting = self.waiting, []
        self._place.clear()
        return taken


class Guard:
    """Which requests a server of ours answers: to this machine's name, from our own pages."""

    # another name reached this machine by DNS rebinding; another origin is somebody else's page in the user's browser

    def __init__(self, host: str) -> None:
        names = {*LOCAL, host.lower()}
        if host not in LOCAL:
            names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
        self._names, self._addresses = frozenset(names), host not in LOCAL

    def accepts(self, host: str | None, origin: str | None) -> bool:
        """Whether to answer a request with these headers `Host` and `Origin`; None where it has none, or several."""
        named = r"(\[(?P<address>[0-9a-f:.]+)\]|(?P<name>[^\[\]:/@\s]+))(:\d+)?"
        read = re.fullmatch(named, host.lower()) if host is not None else None
        if read is None:
            return False
        name = read["address"] or read["name"]
        if name not in self._names and not (self._addresses and is_address(name)):
            return False
        return origin is None or origin.lower().partition("://")[2] == read[0]


def is_address(name: str) -> bool:
    """Whether a name is an IP address, for which DNS rebinding is impossible."""
    import ipaddress

    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def seconds(timeout: object) -> float:
    """Seconds to wait, which may be infinite; raises InputError where they are negative or no number."""
    return min(Range(0.0, 1e9, "s", endless=True)(timeout, "timeout"), threading.TIMEOUT_MAX)


def _bound(host: str, port: int) -> Any:
    """Sockets that listen at a name or address of this machine; an InputError if it cannot be."""
    from tornado.netutil import bind_sockets

    candidates = [port] if port else [*range(7000, 7100), 0]
    for candidate in candidates:
        try:
            return bind_sockets(candidate, host)
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or str(error)
    raise InputError(f"the page cannot be served at {host}, port {port or 'any'} ({why}); give another")


class Server:
    """The thread that serves a page, its picture and the open tabs; only the thread touches them."""

    def __init__(self, page: str, host: str = "127.0.0.1", port: int = 0) -> None:
        """Serve the HTML of a page at a name or address of this machine; port 0 is the first free one from 7000."""
        if importlib.util.find_spec("tornado") is None:
            raise MissingPackageError("showing a scene live needs the package tornado; run: pip install tornado")
        self.page, self.store, self.tabs = page, Store(), set[Any]()
        self._asked: list[threading.Event] = []  # by those who wait until the tabs have drawn everything
        self._changed = threading.Condition()  # notified when a tab opens or closes
        sockets = _bound(host, port)
        shown = LOCAL[0] if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host  # everywhere
        self.url = f"http://{shown}:{sockets[0].getsockname()[1]}/"
        import asyncio

        self._loop = asyncio.new_event_loop()
        self._stopped = asyncio.Event()
        serving = self._serve(sockets, host)
        self._thread = threading.Thread(
            target=self._loop.run_until_complete, args=(serving,), name="wholebody page", daemon=True
        )
        self._thread.start()
        atexit.register(self.close)

    def send(self, commands: Iterable[Command]) -> None:
        """Send commands; open tabs carry them out together."""
        self._loop.call_soon_threadsafe(self._take, list(commands))

    def wait(self, timeout: float) -> bool:
        """Wait until a tab shows the page; False if none did within `timeout` seconds."""
        return self._until(lambda: bool(self.tabs), timeout)

    def wait_until_closed(self, timeout: float) -> bool:
        """Wait until no tab has shown the page for two seconds; False if one still did after `timeout` seconds."""
        end = time.monotonic() + timeout
        while self._until(lambda: not self.tabs, end - time.monotonic()):
            if not self.wait(min(2.0, end - time.monotonic())):
                return True
        return False

    def sync(self, timeout: float) -> bool:
        """Wait until every open tab has carried out all commands; False if not within `timeout` seconds."""
        done = threading.Event()
        self._loop.call_soon_threadsafe(self.settle, done)
        return done.wait(timeout)

    def close(self) -> None:
        """End the thread. Calling it again, or in a forked process, does nothing."""
        atexit.unregister(self.close)
        if self._thread.is_alive():  # a forked process has no thread, and the loop's sockets are its parent's
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join()
            self._loop.close()

    def _until(self, true: Callable[[], bool], timeout: float) -> bool:
        with self._changed:
            return self._changed.wait_for(true, max(timeout, 0.0))

    # ---- in the thread

    async def _serve(self, sockets: Any, host: str) -> None:
        import asyncio

        from tornado.httpserver import HTTPServer

        server = HTTPServer(self._application(host))
        server.add_sockets(sockets)
        await self._stopped.wait()
        for one in sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)  # a forked process may hold it too
        server.stop()
        for tab in [*self.tabs]:
            tab.close()
        end = time.monotonic() + 1.0  # s: for which tabs are waited for
        while self.tabs and time.monotonic() < end:
            await asyncio.sleep(0.01)
        await server.close_all_connections()

    def _take(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self.store.apply(command)
            for tab in self.tabs:
                tab.queue.put(command)
        for tab in self.tabs:
            tab.send_waiting()

    def settle(self, *asked: threading.Event) -> None:
        """Answer those who wait, and who ask now, if every tab has drawn everything."""
        self._asked += asked
        if all(tab.idle for tab in self.tabs):
            for done in self._asked:
                done.set()
            self._asked.clear()

    def changed(self) -> None:
        """Tell those who wait for tabs, one of which has opened or closed."""
        with self._changed:
            self._changed.notify_all()

    def _application(self, host: str) -> Any:
        """The web side: the page at /, its socket at /socket, nothing else."""
        from tornado.web import Application, HTTPError, RequestHandler
        from tornado.websocket import WebSocketHandler

        guard, hub = Guard(host), self

        class Guarded(RequestHandler):  # type: ignore[misc]
            """Refuses requests that are not of our own pages."""

            def prepare(self) -> None:
                headers = self.request.headers
                if not guard.accepts(headers.get("Host"), headers.get("Origin")):
                    raise HTTPError(403)

        class Page(Guarded):
            def get(self) -> None:
                self.set_header("Cache-Control", "no-store")
                self.write(hub.page)

        class Tab(Guarded, WebSocketHandler):  # type: ignore[misc]
            """One open page. It acknowledges each message, and gets the next only then."""

            def open(self, *args: str, **kwargs: str) -> None:
                self.set_nodelay(True)
                self.queue = Queue()
                self.queue.waiting = [command.payload for command in hub.store.commands()]
                hub.tabs.add(self)
                hub.changed()
                self.send()  # also an empty message: it tells the page that it is up to date

            def send(self) -> None:
                self.idle = False
                self.write_message(bundle(self.queue.take()), binary=True)

            def send_waiting(self) -> None:
                if self.idle and self.queue.waiting:
                    self.send()

            def on_message(self, message: str | bytes) -> None:
                self.idle = True
                self.send_waiting()
                hub.settle()

            def on_close(self) -> None:
                hub.tabs.discard(self)
                hub.changed()
                hub.settle()

        # the program's own standard error has no place for requests that are refused
        return Application([("/", Page), ("/socket", Tab)], log_function=lambda handler: None)

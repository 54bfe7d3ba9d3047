"""The process that serves the page and sends every drawing command to the browser tabs that show it.

It runs apart from the program that draws, so that a long computation never freezes the page. It is started as a script
and imports the standard library and tornado alone. It reads commands from its standard input, so no other process can
send any, and writes messages to its standard output, one JSON object a line. It listens on one address, 127.0.0.1 by
default, and ends when its input ends or its parent has ended.
"""

from __future__ import annotations

import json
import os
import re
import struct
import sys
from os import _exit
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import asyncio

HEADER = struct.Struct("<cHHI")
LOCAL = ("127.0.0.1", "localhost", "::1")


class Op:
    """Kinds of commands: to the page, and PUSH, SYNC and PAGE to the server; STOP is a key of an ANIMATION."""

    OBJECT, TRANSFORM, PROPERTY, DELETE, CAMERA, ANIMATION = b"o", b"t", b"p", b"d", b"c", b"a"
    PUSH, SYNC, PAGE = b"e", b"s", b"h"
    STOP = "stop"


class Command(NamedTuple):
    """One message: its kind, node and key, and the bytes for the page (msgpack).

    An ANIMATION with the key STOP is sent to open pages and not stored; PUSH, SYNC and PAGE are commands to the server.
    """

    op: bytes
    path: str = ""
    key: str = ""
    payload: bytes = b""

    def pack(self) -> bytes:
        """Return the serialised message: a header with the lengths, then the parts."""
        path, key = self.path.encode(), self.key.encode()
        return HEADER.pack(self.op, len(path), len(key), len(self.payload)) + path + key + self.payload


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


def tell(**what: Any) -> None:
    """Write one line to the parent."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


class Hub:
    """The picture, the page and the open tabs."""

    def __init__(self) -> None:
        self.store = Store()
        self.page = ""
        self.tabs: set[Any] = set()
        self.syncs: list[int] = []

    async def listen(self, reader: asyncio.StreamReader) -> None:
        """Read commands until the input ends."""
        import asyncio

        while True:
            try:
                op, path, key, size = HEADER.unpack(await reader.readexactly(HEADER.size))
                node = (await reader.readexactly(path)).decode()
                name = (await reader.readexactly(key)).decode()
                self.take(Command(op, node, name, await reader.readexactly(size)))
            except asyncio.IncompleteReadError:
                return

    def take(self, command: Command) -> None:
        """Carry out one command."""
        if command.op == Op.PAGE:
            self.page = command.payload.decode()
            tell(ready=True)
        elif command.op == Op.SYNC:
            self.syncs.append(int(command.key))
            self.settle()
        elif command.op == Op.PUSH:
            for tab in self.tabs:
                tab.send_waiting()
        else:
            self.store.apply(command)
            for tab in self.tabs:
                tab.queue.put(command)

    def settle(self) -> None:
        """Answer the pending Op.SYNC commands if every tab has drawn everything."""
        if self.syncs and all(tab.idle for tab in self.tabs):
            for number in self.syncs:
                tell(sync=number, tabs=len(self.tabs))
            self.syncs.clear()


class Guard:
    """Which requests a server of ours answers: those that call this machine by its name, from our own pages.

    A request of any other name reached this machine by DNS rebinding. One with another origin is of a page of somebody
    else that runs in the user's browser.
    """

    def __init__(self, host: str) -> None:
        import socket

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


def make_application(hub: Hub, host: str) -> Any:
    """The web side: the page at /, its socket at /socket, nothing else."""
    from tornado.web import Application, HTTPError, RequestHandler
    from tornado.websocket import WebSocketHandler

    guard = Guard(host)

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
            tell(tabs=len(hub.tabs))
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
            tell(tabs=len(hub.tabs))
            hub.settle()

    return Application([("/", Page), ("/socket", Tab)])


async def serve(parent: int, host: str, port: int) -> None:
    """Serve until the input ends or the parent has ended; port 0 takes the first free one."""
    import asyncio
    import logging

    from tornado.httpserver import HTTPServer
    from tornado.netutil import bind_sockets

    logging.getLogger("tornado").setLevel(logging.CRITICAL)
    hub = Hub()
    candidates = [port] if port else [*range(7000, 7100), 0]
    for candidate in candidates:
        try:
            sockets = bind_sockets(candidate, host)
            break
        except (OSError, UnicodeError) as error:
            if candidate == candidates[-1]:
                tell(refused=getattr(error, "strerror", None) or str(error))
                return
    server = HTTPServer(make_application(hub, host))
    server.add_sockets(sockets)
    shown = LOCAL[0] if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host  # everywhere
    tell(url=f"http://{shown}:{sockets[0].getsockname()[1]}/")

    reader = asyncio.StreamReader(limit=2**20)
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin.buffer)
    listening = asyncio.ensure_future(hub.listen(reader))
    while not listening.done() and os.getppid() == parent:
        await asyncio.wait([listening], timeout=0.5)  # s: poll of the parent


if __name__ == "__main__":
    from asyncio import run
    from contextlib import suppress

    with suppress(KeyboardInterrupt, BrokenPipeError):
        run(serve(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
    _exit(0)

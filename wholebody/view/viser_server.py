"""A viser server that answers its own pages alone, as the server of the Meshcat pages does, and prints nothing."""

from __future__ import annotations

import threading
from http import HTTPStatus
from types import SimpleNamespace
from typing import Any

from wholebody.base.checks import whole
from wholebody.base.errors import MissingPackageError
from wholebody.view.server import Guard

_STARTING = threading.Lock()


def viser_server(port: int, label: str) -> Any:
    """A running viser.ViserServer on 127.0.0.1 at the port, or the next free one; `label` is its page's title."""
    # viser hands no check to websockets: what it calls to serve is replaced while it starts, or there is no server
    whole(port, "the port of the page", 0, 65535)
    try:
        import rich
        import viser
        from viser.infra import _infra
    except ImportError:
        raise MissingPackageError(
            "dragging in a browser needs viser, which is not installed; run: pip install 'wholebody[drag]'"
        ) from None
    guarded: list[str] = []

    def serve(handler: Any, host: str, *arguments: Any, process_request: Any, **options: Any) -> Any:
        import websockets.asyncio.server

        rich.get_console().begin_capture()  # of this thread, which is viser's own: what it prints goes with it
        guarded.append(host)
        checked = _checked(Guard(host), process_request)
        return websockets.asyncio.server.serve(handler, host, *arguments, process_request=checked, **options)

    with _STARTING:
        libraries = getattr(_infra, "websockets", None)
        _infra.websockets = SimpleNamespace(
            asyncio=SimpleNamespace(server=SimpleNamespace(serve=serve)),
            exceptions=getattr(libraries, "exceptions", None),
            datastructures=getattr(libraries, "datastructures", None),
        )
        try:
            with rich.get_console().capture():  # viser prints where its page is
                server = viser.ViserServer(host="127.0.0.1", port=port, label=label, verbose=False)
        finally:
            _infra.websockets = libraries
    if not guarded:
        server.stop()
        raise MissingPackageError(
            f"viser {viser.__version__} cannot be told which requests to refuse; run: pip install 'wholebody[drag]'"
        )
    return server


def _checked(guard: Guard, answer: Any) -> Any:
    """The function that answers a request before it becomes a page or a socket, with the guard before it."""

    def process_request(connection: Any, request: Any) -> Any:
        one = {name: request.headers.get_all(name) for name in ("Host", "Origin")}
        host, origin = (values[0] if len(values) == 1 else None for values in one.values())
        if len(one["Origin"]) > 1 or not guard.accepts(host, origin):
            return connection.respond(HTTPStatus.FORBIDDEN, "not a page of this machine\n")
        return answer(connection, request)

    return process_request

"""Places of handles from a tracker elsewhere: datagrams (UDP) of JSON, such as {"head_top": [0.1, 0.0, 1.7]}."""

from __future__ import annotations

import json
import socket
from collections.abc import Collection

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import shown, whole
from wholebody.base.errors import InputError


class Receiver:
    """Listens at a port of this machine.

    Attributes:
        port: where datagrams arrive.
        refused: number of datagrams that were not understood, or not all of them.
        note: what was wrong with the last of these; "" if there was none.
    """

    def __init__(self, port: int, handles: Collection[str]) -> None:
        """Listen for places of some handles at a port; 0 for any that is free."""
        whole(port, "the port of handles", 0, 65535)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError as error:
            self._socket.close()
            raise InputError(f"port {port} cannot be listened at ({error}); give another, such as 9870") from None
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self._handles, self.refused, self.note = frozenset(handles), 0, ""

    def latest(self) -> dict[str, Array]:
        """The last place (3,) [m] of every handle that has arrived since the last call."""
        found: dict[str, Array] = {}
        for _ in range(1000):  # datagrams at once
            try:
                data = self._socket.recv(65536)  # bytes of a datagram
            except BlockingIOError:
                break
            found |= self._read(data)
        return found

    def close(self) -> None:
        """Listen no longer."""
        self._socket.close()

    def _read(self, data: bytes) -> dict[str, Array]:
        """The places of one datagram that are understood: a tracker may have lost one of its handles."""
        try:
            given = json.loads(data)
        except (ValueError, RecursionError):
            given = None
        found, wrong = dict[str, Array](), ""
        if not isinstance(given, dict):
            wrong = 'is no JSON object; send {"head_top": [0.1, 0.0, 1.7]}'
            given = {}
        for name, place in given.items():
            if name not in self._handles:
                wrong = f"names {shown(name)}; send {', '.join(sorted(self._handles))}"
            elif not _is_place(place):
                wrong = f"gives {name} the place {shown(place)}; send three finite numbers, metres"
            else:
                found[name] = np.array(place, dtype=float)
        if wrong:
            self.refused, self.note = self.refused + 1, f"a datagram {wrong}"
        return found


def _is_place(value: object) -> bool:
    if not isinstance(value, list) or len(value) != 3:
        return False
    real = all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in value)
    return real and all(abs(one) < 1e4 for one in value)  # m; not of NaN

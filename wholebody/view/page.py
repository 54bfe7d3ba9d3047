"""The page that shows the scene: live over a socket, or one self-contained file that opens without a network."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import re
import sys
from collections.abc import Iterable
from functools import cache, lru_cache
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import Any

from wholebody.base.errors import MissingPackageError
from wholebody.view.commands import contact_paint
from wholebody.view.server import Command, bundle


def live_page(title: str = "wholebody") -> str:
    """HTML of a page that connects to its server."""
    return _page(title, _script(_meshcat_script()) + _script(_file("page.js")))


def static_page(commands: list[Command], title: str = "wholebody") -> str:
    """HTML of a page that contains its scene, compressed, and makes no network requests."""
    return _page(title, player() + _data("scene", _bundled(commands)) + _script(_file("unpack.js")))


_carriers: dict[str, tuple[str, str]] = {}
"""For each shared part: the notebook cell whose output has it, and the run of that cell."""


def notebook_frame(commands: list[Command], title: str = "wholebody") -> str:
    """HTML of a frame with a scene's page for a notebook's cell; the first cell has the player, and equal parts."""
    cell = _cell()
    for name, carrier in [*_carriers.items()]:
        if cell is not None and carrier[0] == cell[0] and carrier != cell:  # what an earlier run of this cell had
            del _carriers[name]
    parts = [player() if _is_first(cell, "player") else _data("player")]
    # bytes of commands that scenes of a notebook share
    for large, some in groupby(commands, lambda command: len(command.payload) > 2_000):
        content = _bundled(some)
        name = sha256(content).hexdigest()[:16] if large else f"scene {len(parts)}"
        parts.append(_data(name, content if not large or _is_first(cell, name) else None))
    page = html.escape(_page(title, "".join(parts) + _script(_file("unpack.js"))), quote=True)
    return f'<iframe srcdoc="{page}" style="width: 100%; height: 480px; border: 0"></iframe>'


def _is_first(cell: tuple[str, str] | None, name: str) -> bool:
    """Whether a part is in no output of the notebook yet, so that this cell has it from now on."""
    return cell is None or (name not in _carriers and _carriers.setdefault(name, cell) == cell)


def _cell() -> tuple[str, str] | None:
    """The present cell of a notebook and its run, None where no kernel runs it. A cell without a name is its code."""
    shell: Any = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if not hasattr(shell, "get_parent"):
        return None
    message, code = shell.get_parent(), shell.user_ns.get("In", [""])[-1]
    return message.get("metadata", {}).get("cellId", code), message.get("header", {}).get("msg_id", code)


@lru_cache(maxsize=1)
def player() -> str:
    """The part that all static pages have in common. A page with many scenes has it once, and puts it into each."""
    return _data("player", f"{_meshcat_script()}\0{_file('page.js')}".encode())


def picture_page() -> str:
    """HTML of an empty page for `Screenshots`: it gets its commands from outside, and draws only when asked to."""
    still = html.escape(json.dumps(contact_paint()), quote=True)
    return _page("wholebody", _script(_meshcat_script()) + _script(_file("page.js")), f' data-still="{still}"')


def _page(title: str, parts: str, still: str = "") -> str:
    given = {"title": html.escape(title), "still": still, "parts": parts}
    return re.sub("@(title|still|parts)@", lambda found: given[found[1]], _file("page.html"))


def _script(text: str) -> str:
    return f"<script>{text}</script>\n"


def _bundled(commands: Iterable[Command]) -> bytes:
    return bundle([command.payload for command in commands])


def _data(name: str, content: bytes | None = None) -> str:
    """A part of a page; without content it is taken from another scene of the notebook."""
    packed = "" if content is None else base64.b64encode(gzip.compress(content, mtime=0)).decode("ascii")
    return f'<script data-part="{name}" type="application/octet-stream">{packed}</script>\n'


@cache
def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _meshcat_script() -> str:
    """Meshcat's viewer with three.js, found without importing meshcat (which would import IPython)."""
    found = importlib.util.find_spec("meshcat")
    folder = Path(found.origin).parent if found is not None and found.origin else None
    script = folder / "viewer" / "dist" / "main.min.js" if folder is not None else None
    if script is None or not script.is_file():
        raise MissingPackageError("looking at a scene needs the package meshcat; run: pip install meshcat==0.3.2")
    return script.read_text(encoding="utf-8")

"""The page that shows the scene: live over a socket, or one self-contained file that opens without a network."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import sys
from collections.abc import Iterable
from functools import lru_cache
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import Any

from wholebody.base.errors import MissingPackageError
from wholebody.view.server import Command, bundle

_TEMPLATE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
body {{ margin: 0; background: #dfe3e7; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#bar {{ display: none; position: fixed; left: 50%; bottom: 18px; transform: translateX(-50%); gap: 12px;
  align-items: center; width: min(640px, 90vw); box-sizing: border-box; padding: 8px 14px; border-radius: 10px;
  background: rgba(255,255,255,.85); font: 13px "Helvetica Neue", Arial, sans-serif; color: #333a42; }}
#bar button {{ width: 32px; height: 28px; border: 0; border-radius: 6px; background: #4f6f94; color: #fff; }}
#bar input {{ flex: 1; }}
#panel {{ display: none; position: fixed; left: 14px; top: 14px; max-width: 40vw; padding: 8px 12px;
  border-radius: 10px; pointer-events: none; background: rgba(255,255,255,.8); color: #333a42;
  font: 13px "Helvetica Neue", Arial, sans-serif; }}
#panel b, #panel span {{ display: block; }}
#panel i {{ display: inline-block; width: 10px; height: 10px; margin-right: 7px; border-radius: 3px; }}
</style>
</head>
<body>
<div id="meshcat-pane"{still}></div>
<div id="panel"></div>
<div id="bar">
<button title="play or pause"></button><input type="range" min="0" max="1000" value="0"><span></span>
</div>
{parts}</body>
</html>
"""


LARGE = 2_000  # bytes of a command that scenes of a notebook share

_UNPACK = """
(async function () {
  async function unpacked(packed) {
    packed = Uint8Array.from(atob(packed), c => c.charCodeAt(0));
    return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  }
  const around = (() => { try { parent.document; return parent; } catch { return window; } })();
  const known = around.wholebodyParts ??= {};
  async function part(script) { // of this page, or of a scene before it in the notebook around it
    const name = script.dataset.part, wait = document.createElement("p");
    known[name] = script.textContent || known[name];
    for (let tries = 0; !known[name]; tries++) {
      wait.textContent = "A part is in the first scene of this notebook: scroll to it, or run the cells again.";
      if (tries === 10) document.body.prepend(wait);
      await new Promise(done => setTimeout(done, 200));
    }
    wait.remove();
    return unpacked(known[name]);
  }
  const [player, ...scene] = document.querySelectorAll("script[data-part]");
  window.picture = new Uint8Array(await new Blob(await Promise.all(scene.map(part))).arrayBuffer());
  for (const text of new TextDecoder().decode(await part(player)).split("\\0")) {
    const script = document.createElement("script");
    script.textContent = text;
    document.body.append(script);
  }
})();
"""


def live_page(title: str = "wholebody") -> str:
    """HTML of a page that connects to its server."""
    return _page(title, _script(_meshcat_script()) + _script(_page_script()))


def static_page(commands: list[Command], title: str = "wholebody") -> str:
    """HTML of a page that contains its scene, compressed, and makes no network requests."""
    return _page(title, player() + _data("scene", _bundled(commands)) + _script(_UNPACK))


_carriers: dict[str, tuple[str, str]] = {}
"""For each shared part: the notebook cell whose output has it, and the run of that cell."""


def notebook_frame(commands: list[Command], title: str = "wholebody") -> str:
    """HTML of a frame with the page of a scene, for the output of a notebook's cell.

    The first cell that shows a scene has the player, whenever it is run; the frames of the others take it from there.
    They do so with large, equal parts, such as a person's skin.
    """
    cell = _cell()
    for name, carrier in [*_carriers.items()]:
        if cell is not None and carrier[0] == cell[0] and carrier != cell:  # what an earlier run of this cell had
            del _carriers[name]
    parts = [player() if _is_first(cell, "player") else _data("player")]
    for large, some in groupby(commands, lambda command: len(command.payload) > LARGE):
        content = _bundled(some)
        name = sha256(content).hexdigest()[:16] if large else f"scene {len(parts)}"
        parts.append(_data(name, content if not large or _is_first(cell, name) else None))
    page = html.escape(_page(title, "".join(parts) + _script(_UNPACK)), quote=True)
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
    return _data("player", f"{_meshcat_script()}\0{_page_script()}".encode())


def picture_page() -> str:
    """HTML of an empty page for `Screenshots`: it gets its commands from outside, and draws only when asked to."""
    return _page("wholebody", _script(_meshcat_script()) + _script(_page_script()), " data-still")


def _page(title: str, parts: str, still: str = "") -> str:
    return _TEMPLATE.format(title=html.escape(title), still=still, parts=parts)


def _script(text: str) -> str:
    return f"<script>{text}</script>\n"


def _bundled(commands: Iterable[Command]) -> bytes:
    return bundle([command.payload for command in commands])


def _data(name: str, content: bytes | None = None) -> str:
    """A part of a page; without content it is taken from another scene of the notebook."""
    packed = "" if content is None else base64.b64encode(gzip.compress(content, mtime=0)).decode("ascii")
    return f'<script data-part="{name}" type="application/octet-stream">{packed}</script>\n'


def _page_script() -> str:
    return Path(__file__).with_name("page.js").read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _meshcat_script() -> str:
    """Meshcat's viewer with three.js, found without importing meshcat (which would import IPython)."""
    found = importlib.util.find_spec("meshcat")
    folder = Path(found.origin).parent if found is not None and found.origin else None
    script = folder / "viewer" / "dist" / "main.min.js" if folder is not None else None
    if script is None or not script.is_file():
        raise MissingPackageError("looking at a scene needs the package meshcat; run: pip install meshcat==0.3.2")
    return script.read_text(encoding="utf-8")

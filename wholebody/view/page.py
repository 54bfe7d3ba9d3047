"""The page that shows the scene: live over a socket, or one self-contained file that opens without a network."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
from functools import lru_cache
from pathlib import Path

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
{picture}
<script>{meshcat}</script>
<script>{page}</script>
</body>
</html>
"""


_PACKED = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title></head><body>
<script id="page" type="application/octet-stream">{page}</script>
<script>
(async function () {{
  const bytes = Uint8Array.from(atob(document.getElementById("page").textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const text = await new Response(stream).text();
  document.open();
  document.write(text);
  document.close();
}})();
</script></body></html>
"""


def live_page(title: str = "wholebody") -> str:
    """HTML of a page that connects to its server."""
    return _page(title, "")


def static_page(commands: list[Command], title: str = "wholebody") -> str:
    """HTML of a page that contains its scene, drawn by these commands in order, and makes no network requests.

    The page is compressed, to half of its size, and unpacks itself.
    """
    data = base64.b64encode(bundle([command.payload for command in commands])).decode("ascii")
    page = _page(title, f'<script id="picture" type="application/octet-stream">{data}</script>')
    packed = base64.b64encode(gzip.compress(page.encode(), mtime=0)).decode("ascii")
    return _PACKED.format(title=html.escape(title), page=packed)


def picture_page() -> str:
    """HTML of an empty page for `Screenshots`: it gets its commands from outside, and draws only when asked to."""
    return _page("wholebody", '<script id="picture" type="application/octet-stream"></script>', " data-still")


def _page(title: str, picture: str, still: str = "") -> str:
    script = (Path(__file__).with_name("page.js")).read_text(encoding="utf-8")
    return _TEMPLATE.format(
        title=html.escape(title), still=still, picture=picture, meshcat=_meshcat_script(), page=script
    )


@lru_cache(maxsize=1)
def _meshcat_script() -> str:
    """Meshcat's viewer with three.js, found without importing meshcat (which would import IPython)."""
    found = importlib.util.find_spec("meshcat")
    folder = Path(found.origin).parent if found is not None and found.origin else None
    script = folder / "viewer" / "dist" / "main.min.js" if folder is not None else None
    if script is None or not script.is_file():
        raise MissingPackageError("looking at a scene needs the package meshcat; run: pip install meshcat==0.3.2")
    return script.read_text(encoding="utf-8")

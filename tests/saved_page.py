"""The scene within a saved page, which is compressed and unpacks itself in a browser."""

from __future__ import annotations

import base64
import gzip
import re
from pathlib import Path


def unpacked(path: str | Path) -> str:
    """The commands that draw the scene, among them names as they are."""
    packed = re.search(r'<script data-part="scene"[^>]*>(.*?)</script>', Path(path).read_text(encoding="utf-8"))
    assert packed
    return gzip.decompress(base64.b64decode(packed[1])).decode("latin-1")

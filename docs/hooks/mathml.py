"""Formulas as MathML, which browsers draw by themselves: no script and no font has to be fetched."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">(?P<text>.*?)</(?P=tag)>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Replace every formula of a page."""
    return _FORMULA.sub(_mathml, content)


def _mathml(found: re.Match[str]) -> str:
    text = html.unescape(found["text"]).strip()
    display = "block" if found["tag"] == "div" else "inline"
    return str(convert(text[2:-2].strip(), display=display))

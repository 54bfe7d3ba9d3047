"""Formulas as MathML, which browsers draw by themselves: no script and no font has to be fetched.

Attributes that one line of a docstring describes, "x, y, z: places", stand beside each other, where mkdocstrings takes
the names after the first for a type.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">(?P<text>.*?)</(?P=tag)>', re.DOTALL)
_SEVERAL = re.compile(r",</span></code></b>\s*\(<code>\((.*?)\)</code>\)", re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Replace every formula of a page, and put names that are described together beside each other."""
    return _FORMULA.sub(_mathml, _SEVERAL.sub(r"</span>, \1</code></b>", content))


def _mathml(found: re.Match[str]) -> str:
    text = html.unescape(found["text"]).strip()
    display = "block" if found["tag"] == "div" else "inline"
    return str(convert(text[2:-2].strip(), display=display))

"""Colours, sizes and distances of the viewer."""

from __future__ import annotations

import colorsys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from wholebody.base.files import packaged_toml

Color = tuple[float, float, float, float]


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


LOOK: Any = SimpleNamespace(
    **{name: _tuples(value) for name, value in packaged_toml(Path(__file__).with_name("style.toml")).items()}
)
"""What `style.toml` says, as attributes."""


def object_color(number: int) -> Color:
    """Colour of the thing with this number: the palette, then the palette in three darker shades, then anew."""
    red, green, blue, alpha = LOOK.objects[number % len(LOOK.objects)]
    shade = 0.78 ** (number // len(LOOK.objects) % 4)
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    return (*colorsys.hls_to_rgb(hue, max(lightness * shade, 0.15), saturation), alpha)


def tinted(color: Color, towards: Color, amount: float) -> Color:
    """Mix of two colours; the first one's opacity stays."""
    mixed = [(1 - amount) * a + amount * b for a, b in zip(color[:3], towards[:3], strict=True)]
    return (mixed[0], mixed[1], mixed[2], color[3])


def with_opacity(color: Color, opacity: float) -> Color:
    """The same colour with another opacity."""
    return (*color[:3], opacity)

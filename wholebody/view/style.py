"""Colours, sizes and distances of the viewer."""

from __future__ import annotations

import colorsys

Color = tuple[float, float, float, float]

FIGURE: Color = (0.87, 0.72, 0.58, 1.0)
GHOST: Color = (0.45, 0.60, 0.80, 0.28)
FLOOR: Color = (0.80, 0.79, 0.77, 1.0)
CONTACT: Color = (0.98, 0.66, 0.20, 1.0)
PENETRATION: Color = (0.86, 0.16, 0.18, 1.0)

OBJECTS: tuple[Color, ...] = (
    (0.49, 0.61, 0.76, 1.0),
    (0.56, 0.69, 0.55, 1.0),
    (0.71, 0.56, 0.69, 1.0),
    (0.79, 0.66, 0.36, 1.0),
    (0.44, 0.69, 0.68, 1.0),
    (0.64, 0.66, 0.70, 1.0),
    (0.62, 0.56, 0.49, 1.0),
    (0.53, 0.53, 0.74, 1.0),
)
"""Muted colours of different hues, none near the two colours of state."""

SHADES = 4
"""How often the colours are used before they begin anew, each time darker."""

SEE_THROUGH = 0.22
"""Opacity of transparent things."""

TINT = 0.45
"""Share of the colour of state in the colour of a thing (not of the figure), which stays recognisable."""

PAINT = 0.45
"""Share of the colour of state in the colour of a body's surface, so that clothes stay recognisable."""

NORMAL = (0.13, 0.36, 0.60)
WITNESS = (0.10, 0.22, 0.38)
DEPTH = (0.34, 0.00, 0.14)
TARGET = (0.10, 0.62, 0.33)
BLOCKER = (0.47, 0.15, 0.64)
AXES = ((0.85, 0.22, 0.20), (0.22, 0.65, 0.28), (0.20, 0.40, 0.85))
LABEL = "#2b3138"
GOAL_LABEL = "#0d6b38"
DEPTH_LABEL = "#a30023"
BLOCKER_LABEL = "#6a1b9a"

NORMAL_LENGTH = 0.09  # m
WIDEST_ARROW = 0.12  # m: an arrow up to this long keeps its proportions, a longer one keeps this one's width
WITNESS_RADIUS = 0.006  # m
BLOCKER_RADIUS = 0.014  # m
TARGET_RADIUS = 0.016  # m
LINE_RADIUS = 0.0025  # m
AXES_LENGTH = 0.10  # m
SHORTEST_DEPTH = 0.05  # m: shallower penetration vectors are drawn this long, otherwise they would be invisible
LABEL_SIZE = 0.018  # of the distance from the camera: about 22 pixels of 720

PLATE = (6.0, 6.0, 0.04)  # m: size of the plate that represents a half-space

FIGURE_NODE, OBJECT_NODE, GHOST_NODE = "/figure", "/objects", "/ghosts"
CONTACT_NODE, GOAL_NODE, NAME_NODE, BLOCKER_NODE = "/contacts", "/goals", "/names", "/in the way"
FRAME_NODE = "/frames"
"""Folders of the page's scene tree: each can be switched off in its controls."""

FIELD_OF_VIEW = 32.0  # degrees, vertical
DIRECTION = (1.0, -0.72, 0.42)
"""From the figure towards the camera: from its front right, a little above."""
MARGIN = 1.08


def object_color(number: int) -> Color:
    """Colour of the thing with this number: the palette, then the palette in darker shades, then from the beginning."""
    red, green, blue, alpha = OBJECTS[number % len(OBJECTS)]
    shade = 0.78 ** (number // len(OBJECTS) % SHADES)
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    return (*colorsys.hls_to_rgb(hue, max(lightness * shade, 0.15), saturation), alpha)


def tinted(color: Color, towards: Color, amount: float) -> Color:
    """Mix of two colours; the first one's opacity stays."""
    mixed = [(1 - amount) * a + amount * b for a, b in zip(color[:3], towards[:3], strict=True)]
    return (mixed[0], mixed[1], mixed[2], color[3])


def with_opacity(color: Color, opacity: float) -> Color:
    """The same colour with another opacity."""
    return (*color[:3], opacity)

"""Colours, sizes and distances of the viewer."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

Color = tuple[float, float, float, float]
Mark = tuple[float, float, float]


@dataclass(frozen=True)
class Style:
    """Colours (red, green, blue, opacity), sizes (m) and distances of what the viewer draws."""

    figure: Color = (0.87, 0.72, 0.58, 1.0)
    ghost: Color = (0.45, 0.60, 0.80, 0.28)
    contact: Color = (0.98, 0.66, 0.20, 1.0)
    penetration: Color = (0.86, 0.16, 0.18, 1.0)
    floor: Color = (0.80, 0.79, 0.77, 1.0)
    objects: tuple[Color, ...] = (  # muted, of different hues, none near the two colours of state
        (0.49, 0.61, 0.76, 1.0),
        (0.56, 0.69, 0.55, 1.0),
        (0.71, 0.56, 0.69, 1.0),
        (0.79, 0.66, 0.36, 1.0),
        (0.44, 0.69, 0.68, 1.0),
        (0.64, 0.66, 0.70, 1.0),
        (0.62, 0.56, 0.49, 1.0),
        (0.53, 0.53, 0.74, 1.0),
    )
    see_through: float = 0.22  # opacity of transparent things
    tint: float = 0.45  # share of the colour of state in the colour of a thing, which stays recognisable
    paint: float = 0.45  # share of the colour of state in the colour of a body's surface: clothes stay recognisable

    normal: Mark = (0.13, 0.36, 0.60)
    witness: Mark = (0.10, 0.22, 0.38)
    depth: Mark = (0.34, 0.00, 0.14)
    global_depth: Mark = (0.86, 0.05, 0.58)
    target: Mark = (0.10, 0.62, 0.33)
    blocker: Mark = (0.47, 0.15, 0.64)
    axes: tuple[Mark, Mark, Mark] = ((0.85, 0.22, 0.20), (0.22, 0.65, 0.28), (0.20, 0.40, 0.85))
    label: str = "#2b3138"
    goal_label: str = "#0d6b38"
    depth_label: str = "#a30023"
    blocker_label: str = "#6a1b9a"
    global_depth_label: str = "#a3005f"

    normal_length: float = 0.09
    widest_arrow: float = 0.12  # an arrow up to this long keeps its proportions, a longer one keeps this one's width
    witness_radius: float = 0.006
    blocker_radius: float = 0.014
    target_radius: float = 0.016
    line_radius: float = 0.0025
    axes_length: float = 0.10
    shortest_depth: float = 0.05  # shallower penetration vectors are drawn this long; they would be invisible
    label_size: float = 0.018  # of the distance from the camera: about 22 pixels of 720
    plate: tuple[float, float, float] = (6.0, 6.0, 0.04)  # represents a half-space

    figure_node: str = "/figure"  # folders of the page's scene tree: each can be switched off in its controls
    object_node: str = "/objects"
    ghost_node: str = "/ghosts"
    contact_node: str = "/contacts"
    goal_node: str = "/goals"
    name_node: str = "/names"
    blocker_node: str = "/in the way"
    frame_node: str = "/frames"

    field_of_view: float = 32.0  # degrees, vertical
    direction: tuple[float, float, float] = (1.0, -0.72, 0.42)  # towards the camera: front right, a little above
    margin: float = 1.08  # distance of the camera, of the least at which everything is in the picture


LOOK = Style()


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

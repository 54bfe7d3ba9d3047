"""Scenes for the frame loop, in which the tracked posture penetrates walls, tables and the figure itself.

After the experiments of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual
environments" (table 2, figures 2, 5, 7 and 8), without their balls.
"""

from __future__ import annotations

from pathlib import Path

from wholebody.figures.figure import Figure
from wholebody.figures.joined import one_figure
from wholebody.scene.scene import Scene
from wholebody.tracking.scripts import SceneFile

_FILE = SceneFile(Path(__file__).with_name("scenes.toml"))

SCENES = _FILE.scenes
"""Descriptions of the scenes, by name; each lasts 600 frames or more."""

build_scene = _FILE.build


def gallery(figure: Figure) -> Scene:
    """A scene with a figure in a gallery: a west room (x from -5 to 0), an east room (0 to 5), and a door between them.

    Walls, a door with a lintel, a niche in the east room, tables, a bench, pedestals, and sculptures on them: a torus,
    a sphere, an egg, an obelisk and a column. All of them are fixed.
    """
    return _FILE.furnish(Scene(one_figure(figure, "gallery: figure")), "gallery")

"""Scenes in which things move by themselves: balls, boxes and dominoes that a hand or an avatar meets.

After the experiments of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual
environments" (section 6): a ball flicked off a table by a finger, and rooms with things to push.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import posture, whole
from wholebody.base.errors import InputError
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import FRAME
from wholebody.tracking.scenes import InteractionScene, SceneFile
from wholebody.tracking.tracks import MOST_FRAMES, Track

_FILE = SceneFile(Path(__file__).with_name("scenes.toml"))

WORLD_SCENES = _FILE.scenes
"""Descriptions of the scenes, by name."""

build_world_scene = _FILE.build


def standing_scene(name: str, scene: Scene, q: Array, *, frames: int, dt: float = FRAME) -> InteractionScene:
    """A scene of one's own, in which the figure keeps the posture q (nq,) for a number of frames."""
    frames = whole(frames, "frames", 1, MOST_FRAMES)
    if not any(thing.body is not None for thing in scene.objects.values()):
        raise InputError(f"{name}: nothing moves by itself; give an object a density or a mass")
    track = Track.of(scene.figure, np.tile(posture(q, scene.model.nq), (frames, 1)), dt, name)
    return InteractionScene(name, "things move around a figure that stands", scene, track)

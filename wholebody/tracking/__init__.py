"""Tracking: dragged goals, goals along a path, and figures that follow a tracker frame by frame among things."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.tracking.dragging import Dragged, DragJudgement, drag_along, judge_drag
    from wholebody.tracking.frame import Frame
    from wholebody.tracking.inner_paths import resampled
    from wholebody.tracking.loop import FrameLoop, follow
    from wholebody.tracking.paths import circle, read_path, spread
    from wholebody.tracking.recording import Judgement, Recording, judge
    from wholebody.tracking.scenes import SCENES, InteractionScene, build_scene, gallery
    from wholebody.tracking.track_files import read_track, write_track
    from wholebody.tracking.tracks import Track, posed

__all__ = [
    "SCENES",
    "DragJudgement",
    "Dragged",
    "Frame",
    "FrameLoop",
    "InteractionScene",
    "Judgement",
    "Recording",
    "Track",
    "build_scene",
    "circle",
    "drag_along",
    "follow",
    "gallery",
    "judge",
    "judge_drag",
    "posed",
    "read_path",
    "read_track",
    "resampled",
    "spread",
    "write_track",
]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.tracking.dragging": "Dragged DragJudgement drag_along judge_drag",
        "wholebody.tracking.frame": "Frame",
        "wholebody.tracking.inner_paths": "resampled",
        "wholebody.tracking.loop": "FrameLoop follow",
        "wholebody.tracking.paths": "circle read_path spread",
        "wholebody.tracking.recording": "Judgement Recording judge",
        "wholebody.tracking.scenes": "SCENES InteractionScene build_scene gallery",
        "wholebody.tracking.track_files": "read_track write_track",
        "wholebody.tracking.tracks": "Track posed",
    },
)

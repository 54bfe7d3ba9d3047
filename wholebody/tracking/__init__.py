"""Tracking: dragged goals, goals along a path, and figures that follow a tracker frame by frame among things."""

from wholebody.tracking.dragging import Dragged, DragJudgement, drag_along, judge_drag
from wholebody.tracking.frame import Frame
from wholebody.tracking.loop import FrameLoop, follow
from wholebody.tracking.paths import circle, read_path, spread
from wholebody.tracking.recording import Judgement, Recording, judge
from wholebody.tracking.rooms import gallery
from wholebody.tracking.scenes import SCENES, InteractionScene, build_scene
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
    "spread",
    "write_track",
]

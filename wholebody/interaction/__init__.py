"""Interaction: a figure that follows a tracker frame by frame among things, in contact and without penetration."""

from wholebody.interaction.dragging import Dragged, DragJudgement, drag_along, judge_drag
from wholebody.interaction.judging import Judgement, judge
from wholebody.interaction.loop import FrameLoop, follow
from wholebody.interaction.paths import circle, read_path, spread
from wholebody.interaction.recording import Frame, Recording
from wholebody.interaction.rooms import gallery
from wholebody.interaction.scenes import SCENES, InteractionScene, build_scene
from wholebody.interaction.track_files import read_track, write_track
from wholebody.interaction.tracks import Track, posed

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

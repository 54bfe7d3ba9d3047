"""Figures: people, avatars, hands and robots."""

from wholebody.figures.adjustable import adjustable
from wholebody.figures.denavit_hartenberg import DenavitHartenberg, denavit_hartenberg
from wholebody.figures.description import Chain, JointCone, Limits
from wholebody.figures.figure import Figure
from wholebody.figures.hand import finger_angles
from wholebody.figures.loading import join, load
from wholebody.figures.motion_ranges import ReachCone
from wholebody.figures.packaged_urdf import urdf_path

__all__ = [
    "Chain",
    "DenavitHartenberg",
    "Figure",
    "JointCone",
    "Limits",
    "ReachCone",
    "adjustable",
    "denavit_hartenberg",
    "finger_angles",
    "join",
    "load",
    "urdf_path",
]

"""What a body is: people, avatars, hands and robots as figures."""

from wholebody.figures.figure import Chain, Figure, JointCone, Limits
from wholebody.figures.loading import load
from wholebody.figures.reach_cones import ReachCone
from wholebody.figures.shipped import urdf_path

__all__ = ["Chain", "Figure", "JointCone", "Limits", "ReachCone", "load", "urdf_path"]

"""Motion: clips, their files, and what is done with whole clips."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.motion.batch import BatchProgress, avoid_many, read_many
    from wholebody.motion.batch_table import AvoidedCase
    from wholebody.motion.bisection.method import Bisection
    from wholebody.motion.checking import ClipCheck
    from wholebody.motion.clip_torques import Torques, torques
    from wholebody.motion.judging import AvoidanceReport, Avoided
    from wholebody.motion.measures import MotionBounds
    from wholebody.motion.per_frame import PerFrame
    from wholebody.motion.reading import read_skeleton
    from wholebody.motion.retargeting import bone_errors
    from wholebody.motion.skeleton import SkeletonMotion
    from wholebody.motion.stance import StanceFeet
    from wholebody.motion.standing_ground import Ground, ground
    from wholebody.motion.strength import Strength
    from wholebody.motion.trajectory.method import Trajectory
    from wholebody.motion.worn_equipment import Equipment, equipment

__all__ = [
    "AvoidanceReport",
    "Avoided",
    "AvoidedCase",
    "BatchProgress",
    "Bisection",
    "ClipCheck",
    "Equipment",
    "Ground",
    "MotionBounds",
    "PerFrame",
    "SkeletonMotion",
    "StanceFeet",
    "Strength",
    "Torques",
    "Trajectory",
    "avoid_many",
    "bone_errors",
    "equipment",
    "ground",
    "read_many",
    "read_skeleton",
    "torques",
]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.motion.judging": "AvoidanceReport Avoided",
        "wholebody.motion.batch": "BatchProgress avoid_many read_many",
        "wholebody.motion.batch_table": "AvoidedCase",
        "wholebody.motion.bisection.method": "Bisection",
        "wholebody.motion.checking": "ClipCheck",
        "wholebody.motion.clip_torques": "Torques torques",
        "wholebody.motion.standing_ground": "Ground ground",
        "wholebody.motion.measures": "MotionBounds",
        "wholebody.motion.per_frame": "PerFrame",
        "wholebody.motion.reading": "read_skeleton",
        "wholebody.motion.retargeting": "bone_errors",
        "wholebody.motion.skeleton": "SkeletonMotion",
        "wholebody.motion.stance": "StanceFeet",
        "wholebody.motion.strength": "Strength",
        "wholebody.motion.trajectory.method": "Trajectory",
        "wholebody.motion.worn_equipment": "Equipment equipment",
    },
)

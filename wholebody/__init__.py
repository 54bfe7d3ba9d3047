"""Pose people, avatars, hands and robots among objects, in contact and without penetration.

The public names are loaded when they are first used, so that ``import wholebody`` is fast::

    import wholebody as wb

    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.6, 0.0, 0.72))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.55, -0.25, 0.95))])
    solution = wb.solve(problem, method="qp")
"""

from __future__ import annotations

from wholebody.base.interrupts import end_quietly

end_quietly()  # before anything that takes time

from importlib import import_module  # noqa: E402
from typing import TYPE_CHECKING  # noqa: E402

from wholebody.base.errors import (  # noqa: E402
    FileFormatError,
    InputError,
    MissingPackageError,
    UnknownNameError,
    WholebodyError,
)
from wholebody.version import __version__  # noqa: E402

if TYPE_CHECKING:
    from wholebody.assessment.posture import Assessment, assess
    from wholebody.dynamics.coupling import Spring
    from wholebody.dynamics.world import World
    from wholebody.ergonomics.angles import BodyAngles, body_angles
    from wholebody.ergonomics.assessment import Ergonomics, ergonomics_of
    from wholebody.ergonomics.lifting import Lift, lift_between
    from wholebody.ergonomics.owas import Owas, owas
    from wholebody.ergonomics.reba import Reba, RebaParts, reba
    from wholebody.ergonomics.rula import Rula, RulaParts, rula
    from wholebody.ergonomics.static_torques import StaticTorques, static_torques
    from wholebody.ergonomics.vision import FieldOfView, Sight, sight
    from wholebody.ergonomics.work import Work
    from wholebody.figures import Figure, load
    from wholebody.figures.human.fingers import finger_angles
    from wholebody.geometry.shapes import (
        Box,
        Capsule,
        Cylinder,
        Ellipsoid,
        HalfSpace,
        Hull,
        Mesh,
        Shape,
        Sphere,
        Torus,
    )
    from wholebody.methods.ccd.method import CCD
    from wholebody.methods.damped_least_squares import DampedLeastSquares
    from wholebody.methods.newton.assembly import Assembly
    from wholebody.methods.newton.assembly_constraint import AssemblyConstraint
    from wholebody.methods.newton.assembly_solution import AssemblySolution
    from wholebody.methods.newton.method import Newton
    from wholebody.methods.placo.method import Placo
    from wholebody.methods.qp.method import QP
    from wholebody.methods.simplification.simplify import simplify
    from wholebody.methods.solve import solve
    from wholebody.motion.avoidance import AvoidanceReport, Avoided, avoid
    from wholebody.motion.batch import BatchProgress, avoid_many, read_many
    from wholebody.motion.batch_table import AvoidedCase
    from wholebody.motion.bisection.method import Bisection
    from wholebody.motion.checking import ClipCheck, check
    from wholebody.motion.clip import Clip
    from wholebody.motion.equipment import Equipment
    from wholebody.motion.fade import Fade
    from wholebody.motion.motion_bounds import MotionBounds
    from wholebody.motion.per_frame import PerFrame
    from wholebody.motion.reading import read_clip, read_skeleton
    from wholebody.motion.ready_equipment import equipment
    from wholebody.motion.retargeting import retarget
    from wholebody.motion.skeleton import SkeletonMotion
    from wholebody.motion.stance import StanceFeet
    from wholebody.motion.strength import Strength
    from wholebody.motion.torques import Torques, torques
    from wholebody.motion.trajectory.method import Trajectory
    from wholebody.problem import Problem
    from wholebody.scene.matter.body import Body
    from wholebody.scene.matter.joints import BallJoint, Hinge
    from wholebody.scene.matter.materials import Material
    from wholebody.scene.scene import Scene
    from wholebody.solution import Solution
    from wholebody.studies.accommodation import Accommodation, accommodation, people
    from wholebody.studies.many import SolveProgress, solve_many
    from wholebody.studies.reach_map import reach_map
    from wholebody.studies.reach_result import ReachMap
    from wholebody.studies.records import Records, SolveRecord
    from wholebody.studies.study import study
    from wholebody.taskfile import Result, Task, read_result, read_task, write_result, write_task
    from wholebody.tasks import (
        Axis,
        Balance,
        Bound,
        CenterOfMass,
        Constraint,
        Discomfort,
        Displacement,
        Effort,
        Frame,
        Freeze,
        Goal,
        Grasp,
        Hold,
        Lean,
        Measure,
        Orientation,
        Plane,
        Point,
        Posture,
        PotentialEnergy,
        RangeOfMotion,
        ReachCones,
        Relative,
        Rhythm,
        RotationEffort,
        Sit,
        Stand,
        StepLimit,
        Touch,
    )
    from wholebody.terms.derivatives import DerivativeCheck, check_derivatives
    from wholebody.tracking.drag import Drag
    from wholebody.tracking.path_following import follow_path
    from wholebody.view import Viewer

__all__ = [
    "CCD",
    "QP",
    "Accommodation",
    "Assembly",
    "AssemblyConstraint",
    "AssemblySolution",
    "Assessment",
    "AvoidanceReport",
    "Avoided",
    "AvoidedCase",
    "Axis",
    "Balance",
    "BallJoint",
    "BatchProgress",
    "Bisection",
    "Body",
    "BodyAngles",
    "Bound",
    "Box",
    "Capsule",
    "CenterOfMass",
    "Clip",
    "ClipCheck",
    "Constraint",
    "Cylinder",
    "DampedLeastSquares",
    "DerivativeCheck",
    "Discomfort",
    "Displacement",
    "Drag",
    "Effort",
    "Ellipsoid",
    "Equipment",
    "Ergonomics",
    "Fade",
    "FieldOfView",
    "Figure",
    "FileFormatError",
    "Frame",
    "Freeze",
    "Goal",
    "Grasp",
    "HalfSpace",
    "Hinge",
    "Hold",
    "Hull",
    "InputError",
    "Lean",
    "Lift",
    "Material",
    "Measure",
    "Mesh",
    "MissingPackageError",
    "MotionBounds",
    "Newton",
    "Orientation",
    "Owas",
    "PerFrame",
    "Placo",
    "Plane",
    "Point",
    "Posture",
    "PotentialEnergy",
    "Problem",
    "RangeOfMotion",
    "ReachCones",
    "ReachMap",
    "Reba",
    "RebaParts",
    "Records",
    "Relative",
    "Result",
    "Rhythm",
    "RotationEffort",
    "Rula",
    "RulaParts",
    "Scene",
    "Shape",
    "Sight",
    "Sit",
    "SkeletonMotion",
    "Solution",
    "SolveProgress",
    "SolveRecord",
    "Sphere",
    "Spring",
    "StanceFeet",
    "Stand",
    "StaticTorques",
    "StepLimit",
    "Strength",
    "Task",
    "Torques",
    "Torus",
    "Touch",
    "Trajectory",
    "UnknownNameError",
    "Viewer",
    "WholebodyError",
    "Work",
    "World",
    "__version__",
    "accommodation",
    "assess",
    "avoid",
    "avoid_many",
    "body_angles",
    "check",
    "check_derivatives",
    "equipment",
    "ergonomics_of",
    "finger_angles",
    "follow_path",
    "lift_between",
    "load",
    "owas",
    "people",
    "reach_map",
    "read_clip",
    "read_many",
    "read_result",
    "read_skeleton",
    "read_task",
    "reba",
    "retarget",
    "rula",
    "sight",
    "simplify",
    "solve",
    "solve_many",
    "static_torques",
    "study",
    "torques",
    "write_result",
    "write_task",
]

_MODULES = {
    "wholebody.assessment.posture": "Assessment assess",
    "wholebody.terms.derivatives": "DerivativeCheck check_derivatives",
    "wholebody.figures": "Figure load",
    "wholebody.figures.human.fingers": "finger_angles",
    "wholebody.geometry.shapes": "Box Capsule Cylinder Ellipsoid HalfSpace Hull Mesh Shape Sphere Torus",
    "wholebody.dynamics.coupling": "Spring",
    "wholebody.dynamics.world": "World",
    "wholebody.ergonomics.angles": "BodyAngles body_angles",
    "wholebody.ergonomics.assessment": "Ergonomics ergonomics_of",
    "wholebody.ergonomics.lifting": "Lift lift_between",
    "wholebody.ergonomics.owas": "Owas owas",
    "wholebody.ergonomics.reba": "Reba RebaParts reba",
    "wholebody.ergonomics.rula": "Rula RulaParts rula",
    "wholebody.ergonomics.static_torques": "StaticTorques static_torques",
    "wholebody.ergonomics.vision": "FieldOfView Sight sight",
    "wholebody.ergonomics.work": "Work",
    "wholebody.scene.matter.body": "Body",
    "wholebody.scene.matter.joints": "BallJoint Hinge",
    "wholebody.scene.matter.materials": "Material",
    "wholebody.methods.ccd.method": "CCD",
    "wholebody.methods.damped_least_squares": "DampedLeastSquares",
    "wholebody.tracking.drag": "Drag",
    "wholebody.methods.newton.assembly": "Assembly",
    "wholebody.methods.newton.assembly_constraint": "AssemblyConstraint",
    "wholebody.methods.newton.assembly_solution": "AssemblySolution",
    "wholebody.methods.newton.method": "Newton",
    "wholebody.methods.placo.method": "Placo",
    "wholebody.tracking.path_following": "follow_path",
    "wholebody.methods.qp.method": "QP",
    "wholebody.methods.solve": "solve",
    "wholebody.motion.avoidance": "AvoidanceReport Avoided avoid",
    "wholebody.motion.batch": "BatchProgress avoid_many read_many",
    "wholebody.motion.batch_table": "AvoidedCase",
    "wholebody.motion.checking": "ClipCheck check",
    "wholebody.motion.bisection.method": "Bisection",
    "wholebody.motion.clip": "Clip",
    "wholebody.motion.equipment": "Equipment",
    "wholebody.motion.ready_equipment": "equipment",
    "wholebody.motion.reading": "read_clip read_skeleton",
    "wholebody.motion.retargeting": "retarget",
    "wholebody.motion.skeleton": "SkeletonMotion",
    "wholebody.motion.fade": "Fade",
    "wholebody.motion.per_frame": "PerFrame",
    "wholebody.motion.strength": "Strength",
    "wholebody.motion.torques": "Torques torques",
    "wholebody.motion.motion_bounds": "MotionBounds",
    "wholebody.motion.stance": "StanceFeet",
    "wholebody.motion.trajectory.method": "Trajectory",
    "wholebody.problem": "Problem",
    "wholebody.scene.scene": "Scene",
    "wholebody.methods.simplification.simplify": "simplify",
    "wholebody.solution": "Solution",
    "wholebody.studies.accommodation": "Accommodation accommodation people",
    "wholebody.studies.many": "SolveProgress solve_many",
    "wholebody.studies.records": "Records SolveRecord",
    "wholebody.studies.reach_map": "reach_map",
    "wholebody.studies.reach_result": "ReachMap",
    "wholebody.studies.study": "study",
    "wholebody.taskfile": "Result Task read_result read_task write_result write_task",
    "wholebody.tasks": "Axis Balance Bound CenterOfMass Constraint Discomfort Displacement Effort Frame Freeze Goal "
    "Hold Measure Orientation Plane Point Posture PotentialEnergy RangeOfMotion ReachCones Relative Rhythm "
    "RotationEffort StepLimit Grasp Lean Sit Stand Touch",
    "wholebody.view": "Viewer",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}


def __getattr__(name: str) -> object:
    """Load a public name on its first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'wholebody' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

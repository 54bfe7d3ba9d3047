"""Pose people, avatars, hands and robots among objects, in contact and without penetration.

The public names are loaded when they are first used, so that ``import wholebody`` is fast::

    import wholebody as wb

    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.9, 0.0, 0.72))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.55, -0.25, 0.95))])
    solution = wb.solve(problem, method="qp")

What fewer programs need stands in `wb.dynamics`, `wb.ergonomics`, `wb.figures`, `wb.methods`, `wb.motion`,
`wb.planning`, `wb.studies` and `wb.taskfile`.
"""

from __future__ import annotations

from wholebody.base.imports import end_quietly, exported

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
    from wholebody import dynamics, ergonomics, figures, methods, motion, planning, studies, taskfile
    from wholebody.assessment.posture import Assessment, assess
    from wholebody.dynamics.actuated import Actuated
    from wholebody.dynamics.world import World
    from wholebody.figures import Figure, load
    from wholebody.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Mesh, Shape, Sphere, Torus
    from wholebody.methods.base import Method, Tracker
    from wholebody.methods.newton.assembly import Assembly
    from wholebody.methods.newton.method import Newton
    from wholebody.methods.qp.method import QP
    from wholebody.methods.simplification.simplify import simplify
    from wholebody.methods.solve import solve
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.checking import check
    from wholebody.motion.clip import Clip
    from wholebody.motion.reading import read_clip
    from wholebody.motion.retargeting import retarget
    from wholebody.planning import plan, solutions
    from wholebody.problem import Problem
    from wholebody.scene.matter.body import Body
    from wholebody.scene.mjcf_scene import read_scene
    from wholebody.scene.scene import Scene
    from wholebody.solution import Solution
    from wholebody.studies.accommodation import accommodation
    from wholebody.studies.many import solve_many
    from wholebody.studies.populations import boundary, people
    from wholebody.studies.reach_map import reach_map
    from wholebody.studies.study import study
    from wholebody.taskfile import read_task
    from wholebody.tasks import (
        Axis,
        Balance,
        Bound,
        CenterOfMass,
        Constraint,
        Discomfort,
        Displacement,
        Effort,
        Force,
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
        Soft,
        Stance,
        Stand,
        StepLimit,
        Touch,
    )
    from wholebody.terms.derivatives import check_derivatives
    from wholebody.tracking.drag import Drag
    from wholebody.tracking.path_following import follow_path
    from wholebody.view import Viewer

__all__ = [
    "QP",
    "Actuated",
    "Assembly",
    "Assessment",
    "Axis",
    "Balance",
    "Body",
    "Bound",
    "Box",
    "Capsule",
    "CenterOfMass",
    "Clip",
    "Constraint",
    "Cylinder",
    "Discomfort",
    "Displacement",
    "Drag",
    "Effort",
    "Ellipsoid",
    "Figure",
    "FileFormatError",
    "Force",
    "Frame",
    "Freeze",
    "Goal",
    "Grasp",
    "HalfSpace",
    "Hold",
    "Hull",
    "InputError",
    "Lean",
    "Measure",
    "Mesh",
    "Method",
    "MissingPackageError",
    "Newton",
    "Orientation",
    "Plane",
    "Point",
    "Posture",
    "PotentialEnergy",
    "Problem",
    "RangeOfMotion",
    "ReachCones",
    "Relative",
    "Rhythm",
    "RotationEffort",
    "Scene",
    "Shape",
    "Sit",
    "Soft",
    "Solution",
    "Sphere",
    "Stance",
    "Stand",
    "StepLimit",
    "Torus",
    "Touch",
    "Tracker",
    "UnknownNameError",
    "Viewer",
    "WholebodyError",
    "World",
    "__version__",
    "accommodation",
    "assess",
    "avoid",
    "boundary",
    "check",
    "check_derivatives",
    "dynamics",
    "ergonomics",
    "figures",
    "follow_path",
    "load",
    "methods",
    "motion",
    "people",
    "plan",
    "planning",
    "reach_map",
    "read_clip",
    "read_scene",
    "read_task",
    "retarget",
    "simplify",
    "solutions",
    "solve",
    "solve_many",
    "studies",
    "study",
    "taskfile",
]

_ROOMS = ("dynamics", "ergonomics", "figures", "methods", "motion", "planning", "studies", "taskfile")
_MODULES = {
    "wholebody.assessment.posture": "Assessment assess",
    "wholebody.dynamics.actuated": "Actuated",
    "wholebody.dynamics.world": "World",
    "wholebody.figures": "Figure load",
    "wholebody.geometry.shapes": "Box Capsule Cylinder Ellipsoid HalfSpace Hull Mesh Shape Sphere Torus",
    "wholebody.methods.base": "Method Tracker",
    "wholebody.methods.newton.assembly": "Assembly",
    "wholebody.methods.newton.method": "Newton",
    "wholebody.methods.qp.method": "QP",
    "wholebody.methods.simplification.simplify": "simplify",
    "wholebody.methods.solve": "solve",
    "wholebody.motion.avoidance": "avoid",
    "wholebody.motion.checking": "check",
    "wholebody.motion.clip": "Clip",
    "wholebody.motion.reading": "read_clip",
    "wholebody.motion.retargeting": "retarget",
    "wholebody.planning": "plan solutions",
    "wholebody.problem": "Problem",
    "wholebody.scene.matter.body": "Body",
    "wholebody.scene.mjcf_scene": "read_scene",
    "wholebody.scene.scene": "Scene",
    "wholebody.solution": "Solution",
    "wholebody.studies.accommodation": "accommodation",
    "wholebody.studies.populations": "boundary people",
    "wholebody.studies.many": "solve_many",
    "wholebody.studies.reach_map": "reach_map",
    "wholebody.studies.study": "study",
    "wholebody.taskfile": "read_task",
    "wholebody.tasks": "Axis Balance Bound CenterOfMass Constraint Discomfort Displacement Effort Force Frame Freeze "
    "Goal Hold Measure Orientation Plane Point Posture PotentialEnergy RangeOfMotion ReachCones Relative Rhythm "
    "RotationEffort StepLimit Grasp Lean Sit Soft Stance Stand Touch",
    "wholebody.terms.derivatives": "check_derivatives",
    "wholebody.tracking.drag": "Drag",
    "wholebody.tracking.path_following": "follow_path",
    "wholebody.view": "Viewer",
}
_load, _ = exported(__name__, _MODULES)


def __getattr__(name: str) -> object:
    """Load a public name, or a room that has more of them, on its first use."""
    return import_module(f"{__name__}.{name}") if name in _ROOMS else _load(name)


def __dir__() -> list[str]:
    return sorted(__all__)

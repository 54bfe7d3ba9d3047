"""Goals, constraints, bounds and measures, one small class each."""

from wholebody.tasks.axis import Axis
from wholebody.tasks.balance import Balance
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term
from wholebody.tasks.bounds import Freeze, StepLimit
from wholebody.tasks.discomfort import Discomfort
from wholebody.tasks.distance import Displacement, Effort, RotationEffort
from wholebody.tasks.forces import Force
from wholebody.tasks.frame import Frame, Hold, Orientation, Relative
from wholebody.tasks.grasp import Grasp
from wholebody.tasks.point import CenterOfMass, Plane, Point
from wholebody.tasks.posture import Posture
from wholebody.tasks.potential_energy import PotentialEnergy
from wholebody.tasks.range_of_motion import RangeOfMotion, ReachCones
from wholebody.tasks.rhythm import Rhythm
from wholebody.tasks.sit import Sit
from wholebody.tasks.soft import Soft
from wholebody.tasks.stand import Stance, Stand
from wholebody.tasks.touch import Lean, Touch

__all__ = [
    "Axis",
    "Balance",
    "Bound",
    "CenterOfMass",
    "Constraint",
    "Discomfort",
    "Displacement",
    "Effort",
    "Force",
    "Frame",
    "Freeze",
    "Goal",
    "Grasp",
    "Hold",
    "Lean",
    "Measure",
    "Orientation",
    "Plane",
    "Point",
    "Posture",
    "PotentialEnergy",
    "RangeOfMotion",
    "ReachCones",
    "Relative",
    "Rhythm",
    "RotationEffort",
    "Sit",
    "Soft",
    "Stance",
    "Stand",
    "StepLimit",
    "Term",
    "Touch",
]

"""What can be asked of a posture: goals, constraints, bounds and measures, one small class each."""

from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term
from wholebody.tasks.effort import Effort
from wholebody.tasks.frame import Frame, Orientation
from wholebody.tasks.hold import Hold
from wholebody.tasks.point import Point
from wholebody.tasks.relative import Relative

__all__ = [
    "Bound",
    "Constraint",
    "Effort",
    "Frame",
    "Goal",
    "Hold",
    "Measure",
    "Orientation",
    "Point",
    "Relative",
    "Term",
]

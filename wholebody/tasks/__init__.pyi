from wholebody.tasks.axis import Axis as Axis
from wholebody.tasks.balance import Balance as Balance
from wholebody.tasks.base import (
    Bound as Bound,
    Constraint as Constraint,
    Goal as Goal,
    Measure as Measure,
    Term as Term,
)
from wholebody.tasks.bounds import Freeze as Freeze, StepLimit as StepLimit
from wholebody.tasks.discomfort import Discomfort as Discomfort, PotentialEnergy as PotentialEnergy
from wholebody.tasks.distance import (
    Displacement as Displacement,
    Effort as Effort,
    RotationEffort as RotationEffort,
    Soft as Soft,
)
from wholebody.tasks.forces import Force as Force
from wholebody.tasks.frame import Frame as Frame, Hold as Hold, Orientation as Orientation, Relative as Relative
from wholebody.tasks.grasp import Grasp as Grasp
from wholebody.tasks.point import CenterOfMass as CenterOfMass, Plane as Plane, Point as Point
from wholebody.tasks.posture import Posture as Posture
from wholebody.tasks.range_of_motion import RangeOfMotion as RangeOfMotion, ReachCones as ReachCones
from wholebody.tasks.rhythm import Rhythm as Rhythm
from wholebody.tasks.sit import SeatCenterline as SeatCenterline, Sit as Sit
from wholebody.tasks.stand import Hang as Hang, LevelHead as LevelHead, Stance as Stance, Stand as Stand
from wholebody.tasks.touch import Lean as Lean, Touch as Touch

from wholebody import (
    dynamics as dynamics,
    ergonomics as ergonomics,
    figures as figures,
    methods as methods,
    motion as motion,
    planning as planning,
    studies as studies,
    taskfile as taskfile,
    tasks as tasks,
    tracking as tracking,
)
from wholebody.assessment.posture import Assessment as Assessment, assess as assess
from wholebody.base.errors import (
    FileFormatError as FileFormatError,
    InputError as InputError,
    MissingPackageError as MissingPackageError,
    UnknownNameError as UnknownNameError,
    WholebodyError as WholebodyError,
)
from wholebody.dynamics.coupling import Actuated as Actuated
from wholebody.dynamics.world import World as World
from wholebody.figures import Figure as Figure, load as load
from wholebody.geometry.shapes import (
    Box as Box,
    Capsule as Capsule,
    Cylinder as Cylinder,
    Ellipsoid as Ellipsoid,
    HalfSpace as HalfSpace,
    Hull as Hull,
    Mesh as Mesh,
    Shape as Shape,
    Sphere as Sphere,
    Torus as Torus,
)
from wholebody.methods.base import Method as Method, Tracker as Tracker
from wholebody.methods.newton.assembly import Assembly as Assembly
from wholebody.methods.simplification import simplify as simplify
from wholebody.methods.solve import solve as solve
from wholebody.motion.avoidance import avoid as avoid
from wholebody.motion.checking import check as check
from wholebody.motion.clip import Clip as Clip
from wholebody.motion.reading import read_clip as read_clip
from wholebody.motion.retargeting import retarget as retarget
from wholebody.planning import plan as plan, solutions as solutions
from wholebody.problem import Problem as Problem
from wholebody.scene.matter.body import Body as Body
from wholebody.scene.mjcf_scene import read_scene as read_scene
from wholebody.scene.scene import Scene as Scene
from wholebody.solution import Solution as Solution
from wholebody.studies.accommodation import accommodation as accommodation
from wholebody.studies.many import solve_many as solve_many
from wholebody.studies.populations import boundary as boundary, people as people
from wholebody.studies.reach_map import reach_map as reach_map
from wholebody.studies.study import study as study
from wholebody.taskfile import read_task as read_task
from wholebody.tasks import (
    Axis as Axis,
    Balance as Balance,
    CenterOfMass as CenterOfMass,
    Constraint as Constraint,
    Effort as Effort,
    Force as Force,
    Frame as Frame,
    Freeze as Freeze,
    Goal as Goal,
    Grasp as Grasp,
    Hold as Hold,
    Measure as Measure,
    Orientation as Orientation,
    Plane as Plane,
    Point as Point,
    Posture as Posture,
    Relative as Relative,
    Sit as Sit,
    Soft as Soft,
    Stand as Stand,
    Touch as Touch,
)
from wholebody.terms.derivatives import check_derivatives as check_derivatives
from wholebody.version import __version__ as __version__
from wholebody.view import Viewer as Viewer

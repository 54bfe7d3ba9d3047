"""Goals, constraints, measures and methods that a task file can name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from wholebody import methods, tasks
from wholebody.methods.inputs import BUDGET, CCD_TOLERANCE, DAMPING, ITERATIONS, RESTARTS, SEED, TOLERANCE, Range
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import DIRECTION, FRAME, PLACEMENT, POSITION, QUATERNION, WEIGHT, Number
from wholebody.taskfile.tables import Form, Key


def _number(allowed: Range) -> Number:
    """The range of a method's setting."""
    return Number(allowed.low, allowed.high, whole=allowed.whole)


def _weight(unit: str) -> Key:
    return Key("weight", WEIGHT, f"factor on its square [{unit}]; 1 if left out")


_THING = kinds.Text()
_MOVES = Key("frame", FRAME, "the frame that moves", True)
_TURNS = Key("frame", FRAME, "the frame that turns", True)
_HELD = Key("frame", FRAME, "the frame that is held", True)
_ORIENTATION = Key("orientation", kinds.Flag(), "false leaves the frame free to turn; true if left out")
_MARGIN = Key("margin", Number(0.0, 0.5, "m"), "distance from the edges of the polygon; 0 if left out")
_TOLERANCE = Key("tolerance", _number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out")
_ITERATIONS = Key("iterations", _number(ITERATIONS), "most iterations")
_TIME_LIMIT = Key("time_limit", Number(1e-9, 1e9, "s"), "limit of time; then the best posture so far is the answer")

CONTACTS = {
    "touch": Form(
        "Bring a surface of the figure to that of a thing; they may slide along each other.",
        (
            Key("part", _THING, "a segment, a piece, or a frame whose origin touches", True),
            Key("thing", _THING, "a thing, a piece such as chair:2, or another segment", True),
            _weight("1/m^2"),
        ),
        tasks.Touch,
    ),
    "lean": Form(
        "Lean a segment on a thing; a side of it faces the thing.",
        (
            Key("on", _THING, "the thing", True),
            Key("part", kinds.SEGMENT, "the segment; thorax if left out"),
            Key("side", DIRECTION, "in the segment's axes, towards the thing; backwards if left out"),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Lean,
    ),
    "sit": Form(
        "Sit on a thing, with the back at another.",
        (
            Key("on", _THING, "the seat: a thing or a piece of one", True),
            Key("back", _THING, "what the trunk touches; none if left out"),
            Key("pelvis", kinds.SEGMENT, "the segment that sits; pelvis if left out"),
            Key("trunk", kinds.SEGMENT, "the uppermost segment that may touch the back; thorax if left out"),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Sit,
    ),
    "grasp": Form(
        "Take hold of a thing with a hand.",
        (
            Key("hand", kinds.Choice(("left", "right")), "the hand", True),
            Key("thing", _THING, "what is taken", True),
            Key(
                "kind",
                kinds.Choice(("palm", "power", "pinch", "fingertips")),
                "on a face, around a bar, by two tips or all",
            ),
            Key("side", DIRECTION, "where the face looks that a palm takes; to the hand's side if left out"),
            Key(
                "opposed",
                Number(0.0, math.pi, "rad"),
                "most that two sides are off from opposite; 45 degrees if left out",
            ),
            Key(
                "along", Number(-1.0, 1.0, ""), "place along the thing, from its one end to the other; free if left out"
            ),
            Key("approach", kinds.Choice(("overhand", "underhand", "side")), "where the palm looks; free if left out"),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Grasp,
    ),
}
"""Contacts; each is a goal and a constraint, by the table in which it stands."""

GOALS = {
    "point": Form(
        "Move a point of a frame to a position.",
        (
            _MOVES,
            Key("target", POSITION, "the position, in the world", True),
            Key("offset", POSITION, "the point in the frame's axes; its origin if left out"),
            _weight("1/m^2"),
        ),
        tasks.Point,
    ),
    "frame": Form(
        "Move a frame to a position and an orientation.",
        (
            _MOVES,
            Key("target", PLACEMENT, "the placement, in the world", True),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Frame,
    ),
    "orientation": Form(
        "Turn a frame to an orientation; its position is free.",
        (
            _TURNS,
            Key("target", QUATERNION, "the orientation, in the world", True),
            _weight("1/rad^2"),
        ),
        tasks.Orientation,
    ),
    "axis": Form(
        "Turn an axis of a frame into a direction, or towards a point, such as a gaze or a palm.",
        (
            _TURNS,
            Key("axis", DIRECTION, "in the frame's axes", True),
            Key("direction", DIRECTION, "in the world; this or toward"),
            Key("toward", POSITION, "a point in the world; this or direction"),
            _weight("1/rad^2"),
        ),
        tasks.Axis,
    ),
    "center_of_mass": Form(
        "Move the centre of mass to a position, or above one.",
        (
            Key("target", POSITION, "the position, in the world", True),
            Key("axes", kinds.Choice(("xyz", "xy")), "xy leaves the height free; xyz if left out"),
            _weight("1/m^2"),
        ),
        tasks.CenterOfMass,
    ),
    "relative": Form(
        "Move a frame to a placement relative to another frame, such as two hands on one box.",
        (
            _MOVES,
            Key("to", FRAME, "the frame that it is placed relative to", True),
            Key("placement", PLACEMENT, "in the axes of `to`; as at the start if left out"),
            _ORIENTATION,
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Relative,
    ),
    "posture": Form(
        "Move joints to their values in a posture of the figure.",
        (
            Key("target", kinds.POSTURE, "the posture", True),
            Key("joints", kinds.Several(kinds.GROUP), "the joints that the goal moves; all and the root if left out"),
            _weight("1/rad^2, 1/m^2"),
        ),
        tasks.Posture,
    ),
    **CONTACTS,
}

CONSTRAINTS = {
    "hold": Form(
        "Keep a frame at a placement, in the world or relative to another frame.",
        (
            _HELD,
            Key("at", PLACEMENT, "its placement; as at the start if left out"),
            _ORIENTATION,
            Key("relative_to", FRAME, "the frame that `at` is relative to; the world if left out"),
        ),
        tasks.Hold,
    ),
    "plane": Form(
        "Keep a frame in a plane, or on one side of it.",
        (
            _HELD,
            Key("normal", DIRECTION, "of the plane, in the world", True),
            Key("point", POSITION, "in the plane; the frame's position at the start if left out"),
            Key("side", kinds.Choice(("on", "above")), "above lets it move along the normal; on if left out"),
        ),
        tasks.Plane,
    ),
    "balance": Form(
        "Keep the centre of mass above the support polygon of the feet at the start; hold the feet as well.",
        (
            Key("feet", kinds.Several(kinds.SEGMENT), "segments that stand on the ground; both feet if left out"),
            _MARGIN,
        ),
        tasks.Balance,
    ),
    "freeze": Form(
        "Keep joints as they are at the start.",
        (Key("joints", kinds.Several(kinds.GROUP), 'joints and groups; "root" is the placement of the figure', True),),
        lambda joints: tasks.Freeze(*joints),
    ),
    "reach_cones": Form(
        "Keep limbs within the directions that shoulders and hips allow.",
        (Key("names", kinds.Several(kinds.CONE), "which cones; all if left out"),),
        tasks.ReachCones,
    ),
    "range_of_motion": Form(
        "Keep two-joint muscles, upper arms and neck within their ranges.",
        (Key("names", kinds.Several(kinds.RANGE), "which ranges; all if left out"),),
        tasks.RangeOfMotion,
    ),
    "stand": Form(
        "Stand with flat soles on a thing; the feet may slide, and the centre of mass stays over them.",
        (
            Key("on", _THING, "what the figure stands on", True),
            Key("feet", kinds.Several(kinds.SEGMENT), "segments whose soles stand; both feet if left out"),
            Key("balance", kinds.Flag(), "false for who also sits, leans or holds on; true if left out"),
            _MARGIN,
        ),
        tasks.Stand,
    ),
    **{name: replace(form, keys=form.keys[:-1]) for name, form in CONTACTS.items()},  # a constraint has no weight
}

MEASURES = {
    "effort": Form("Displacement from the start, weighted by joint.", (_weight("1/rad^2"),), tasks.Effort),
    "rotation_effort": Form(
        "Displacement from the start, a ball joint's by its rotation vector.",
        (_weight("1/rad^2"),),
        tasks.RotationEffort,
    ),
    "discomfort": Form(
        "Distance of joints from neutral, and nearness to their limits.", (_weight("no unit"),), tasks.Discomfort
    ),
    "displacement": Form("Displacement from the neutral posture.", (_weight("1/rad^2"),), tasks.Displacement),
    "rhythm": Form(
        "How clavicles follow the arms, and the lumbar spine the pelvis.", (_weight("no unit"),), tasks.Rhythm
    ),
    "potential_energy": Form("Lifting and lowering of segments.", (_weight("1/J^2"),), tasks.PotentialEnergy),
}


def _later(name: str) -> Callable[..., Any]:
    """A method by its name in `wb.methods`, imported only when it is made."""
    return lambda **settings: getattr(methods, name)(**settings)


METHODS = {
    "qp": Form(
        "Sequential quadratic programming.",
        (
            Key("solver", kinds.Text(), 'QP solver: "osqp" if left out, "active_set", or one `wholebody doctor` lists'),
            Key("hot_start", kinds.Flag(), "whether the last active set is tried before the solver; true if left out"),
            _TOLERANCE,
            Key("iterations", _number(ITERATIONS), "most iterations of one descent"),
            Key("budget", _number(BUDGET), "quadratic programs for further descents; 1000 if left out"),
            Key("restarts", _number(RESTARTS), "most further descents"),
            Key(
                "restarts_for_measure",
                _number(RESTARTS),
                "descents for lower measures once goals are met; 0 if left out",
            ),
            Key("seed", _number(SEED), "of the starts of further descents"),
            Key("measures", kinds.Flag(), "whether to minimise the measures; false is faster, true if left out"),
            _TIME_LIMIT,
        ),
        _later("QP"),
    ),
    "ccd": Form(
        "Cyclic coordinate descent: points, frames and orientations, without measures.",
        (
            Key("tolerance", _number(CCD_TOLERANCE), "metres and radians to which goals are met; 1e-4 if left out"),
            Key("iterations", _number(ITERATIONS), "most sweeps from one start"),
            Key("restarts", _number(RESTARTS), "most further starts"),
            Key("seed", _number(SEED), "of those starts"),
            _TIME_LIMIT,
        ),
        _later("CCD"),
    ),
    "newton": Form(
        "Sparse Newton in full coordinates; least effort.",
        (
            _TOLERANCE,
            _ITERATIONS,
            Key("algebra", kinds.Text(), '"auto" (if left out), "normal", "llt", "kkt", "schur", "dense" or "svd"'),
            Key(
                "inequalities",
                kinds.Choice(("slack", "barrier")),
                "treatment of limits and contacts; slack if left out",
            ),
            _TIME_LIMIT,
        ),
        _later("Newton"),
    ),
    "placo": Form(
        "placo's differential inverse kinematics, iterated; to compare with.",
        (
            _TOLERANCE,
            _ITERATIONS,
            _TIME_LIMIT,
        ),
        _later("Placo"),
    ),
    "dls": Form(
        "Damped least squares, the textbook baseline; it ignores contacts.",
        (
            _TOLERANCE,
            _ITERATIONS,
            Key("damping", _number(DAMPING), "remaining damping when the goals are met; 1e-3 if left out"),
            _TIME_LIMIT,
        ),
        _later("DampedLeastSquares"),
    ),
}

"""Goals, constraints, measures and methods that a task file can name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import wholebody
from wholebody import tasks
from wholebody.methods.inputs import BUDGET, CCD_TOLERANCE, DAMPING, ITERATIONS, RESTARTS, SEED, TOLERANCE, Range
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import DIRECTION, FRAME, PLACEMENT, POSITION, QUATERNION, WEIGHT, Number
from wholebody.taskfile.tables import Form, Key


def _number(allowed: Range) -> Number:
    """The range of a method's setting."""
    return Number(allowed.low, allowed.high, whole=allowed.whole)


def _weight(unit: str) -> Key:
    return Key("weight", WEIGHT, f"factor on its square [{unit}]; 1 if left out")


GOALS = {
    "point": Form(
        "Bring a point of a frame to a place.",
        (
            Key("frame", FRAME, "what moves", True),
            Key("target", POSITION, "where to, in the world", True),
            Key("offset", POSITION, "the point in the frame's axes; its origin if left out"),
            _weight("1/m^2"),
        ),
        tasks.Point,
    ),
    "frame": Form(
        "Bring a frame to a place and an orientation.",
        (
            Key("frame", FRAME, "what moves", True),
            Key("target", PLACEMENT, "in the world", True),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Frame,
    ),
    "orientation": Form(
        "Turn a frame; its place is free.",
        (Key("frame", FRAME, "what turns", True), Key("target", QUATERNION, "in the world", True), _weight("1/rad^2")),
        tasks.Orientation,
    ),
    "axis": Form(
        "Turn an axis of a frame into a direction, or towards a place: a gaze, a palm.",
        (
            Key("frame", FRAME, "what turns", True),
            Key("axis", DIRECTION, "in the frame's axes", True),
            Key("direction", DIRECTION, "in the world; this or toward"),
            Key("toward", POSITION, "a place in the world; this or direction"),
            _weight("1/rad^2"),
        ),
        tasks.Axis,
    ),
    "center_of_mass": Form(
        "Bring the centre of mass to a place, or above one.",
        (
            Key("target", POSITION, "in the world", True),
            Key("axes", kinds.Choice(("xyz", "xy")), "xy leaves the height free; xyz if left out"),
            _weight("1/m^2"),
        ),
        tasks.CenterOfMass,
    ),
    "relative": Form(
        "Bring a frame to a place relative to another: two hands on one box.",
        (
            Key("frame", FRAME, "what moves", True),
            Key("to", FRAME, "what it is placed relative to", True),
            Key("placement", PLACEMENT, "in the axes of that; as at the start if left out"),
            Key("orientation", kinds.Flag(), "false leaves it free to turn; true if left out"),
            _weight("1/m^2, 1/rad^2"),
        ),
        tasks.Relative,
    ),
    "posture": Form(
        "Come to a posture of the figure, or near it.",
        (
            Key("target", kinds.POSTURE, "which", True),
            Key("joints", kinds.Several(kinds.GROUP), "that take part; all and the root if left out"),
            _weight("1/rad^2, 1/m^2"),
        ),
        tasks.Posture,
    ),
}

CONSTRAINTS = {
    "hold": Form(
        "Keep a frame at a place, in the world or relative to another frame.",
        (
            Key("frame", FRAME, "what is kept", True),
            Key("at", PLACEMENT, "where; as at the start if left out"),
            Key("orientation", kinds.Flag(), "false leaves it free to turn; true if left out"),
            Key("relative_to", FRAME, "what it keeps its place to; the world if left out"),
        ),
        tasks.Hold,
    ),
    "plane": Form(
        "Keep a frame in a plane, or on one side of it.",
        (
            Key("frame", FRAME, "what is kept", True),
            Key("normal", DIRECTION, "of the plane, in the world", True),
            Key("point", POSITION, "in the plane; where the frame starts if left out"),
            Key("side", kinds.Choice(("on", "above")), "above lets it leave along the normal; on if left out"),
        ),
        tasks.Plane,
    ),
    "balance": Form(
        "Keep the centre of mass over the feet, as they stand at the start; hold the feet as well.",
        (
            Key("feet", kinds.Several(kinds.SEGMENT), "segments that stand; both feet if left out"),
            Key("margin", Number(0.0, 0.5, "m"), "from the edge; 0 if left out"),
        ),
        tasks.Balance,
    ),
    "freeze": Form(
        "Keep joints as they are at the start.",
        (Key("joints", kinds.Several(kinds.GROUP), 'joints and groups; "root" is the place of the figure', True),),
        lambda joints: tasks.Freeze(*joints),
    ),
    "reach_cones": Form(
        "Keep limbs within the directions that shoulders and hips allow.",
        (Key("names", kinds.Several(kinds.CONE), "which cones; all if left out"),),
        tasks.ReachCones,
    ),
}

MEASURES = {
    "effort": Form("Displacement from the start, by the effort it takes.", (_weight("1/rad^2"),), tasks.Effort),
    "discomfort": Form("Nearness of joints to their limits.", (_weight("no unit"),), tasks.Discomfort),
    "displacement": Form("Displacement from the neutral posture.", (_weight("1/rad^2"),), tasks.Displacement),
    "potential_energy": Form("Lifting and lowering of segments.", (_weight("1/J^2"),), tasks.PotentialEnergy),
}


def _later(name: str) -> Callable[..., Any]:
    """A method by its public name, imported when one is made: nobody waits for the others."""
    return lambda **settings: getattr(wholebody, name)(**settings)


METHODS = {
    "qp": Form(
        "Sequential quadratic programming.",
        (
            Key("solver", kinds.Text(), 'QP solver: "osqp" if left out, "active_set", or one `wholebody doctor` lists'),
            Key("hot_start", kinds.Flag(), "whether the last active set is tried before the solver; true if left out"),
            Key("tolerance", _number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out"),
            Key("iterations", _number(ITERATIONS), "of one descent"),
            Key("budget", _number(BUDGET), "programs for further tries; 1000 if left out"),
            Key("restarts", _number(RESTARTS), "most of those tries"),
            Key("seed", _number(SEED), "of those tries"),
            Key("measures", kinds.Flag(), "whether the measures are to be least; false is faster, true if left out"),
            Key("time_limit", Number(1e-9, 1e9, "s"), "after which the best posture so far is the answer"),
        ),
        _later("QP"),
    ),
    "ccd": Form(
        "Cyclic coordinate descent: points, frames and orientations, without measures.",
        (
            Key("tolerance", _number(CCD_TOLERANCE), "metres and radians to which goals are met; 1e-4 if left out"),
            Key("iterations", _number(ITERATIONS), "sweeps from one start"),
            Key("restarts", _number(RESTARTS), "most further starts"),
            Key("seed", _number(SEED), "of those starts"),
            Key("time_limit", Number(1e-9, 1e9, "s"), "after which the best posture so far is the answer"),
        ),
        _later("CCD"),
    ),
    "newton": Form(
        "Sparse Newton in full coordinates; least effort.",
        (
            Key("tolerance", _number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out"),
            Key("iterations", _number(ITERATIONS), "most of them"),
            Key("algebra", kinds.Text(), '"auto" (if left out), "normal", "llt", "kkt", "schur", "dense" or "svd"'),
            Key(
                "inequalities",
                kinds.Choice(("slack", "barrier")),
                "how limits and contacts are dealt with; slack if left out",
            ),
            Key("time_limit", Number(1e-9, 1e9, "s"), "after which the best posture so far is the answer"),
        ),
        _later("Newton"),
    ),
    "placo": Form(
        "placo's differential inverse kinematics, iterated; to compare with.",
        (
            Key("tolerance", _number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out"),
            Key("iterations", _number(ITERATIONS), "most of them"),
            Key("time_limit", Number(1e-9, 1e9, "s"), "after which the best posture so far is the answer"),
        ),
        _later("Placo"),
    ),
    "dls": Form(
        "Damped least squares, the textbook baseline: it sees no contacts.",
        (
            Key("tolerance", _number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out"),
            Key("iterations", _number(ITERATIONS), "most of them"),
            Key("damping", _number(DAMPING), "left when the goals are met; 1e-3 if left out"),
            Key("time_limit", Number(1e-9, 1e9, "s"), "after which the best posture so far is the answer"),
        ),
        _later("DampedLeastSquares"),
    ),
}

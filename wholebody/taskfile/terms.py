"""Goals, constraints, measures and methods that a task file can name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields, replace
from typing import Any

from wholebody import methods, tasks
from wholebody.methods.inputs import BUDGET, CCD_TOLERANCE, DAMPING, ITERATIONS, RESTARTS, SEED, TIME_LIMIT, TOLERANCE
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import FRAME, Form, Key, Kind, Number, kind_of


def _form(made: type, says: str, **keys: str | tuple[Kind, str]) -> Form:
    """A form whose keys are fields of the class that it makes; those without a default are required."""
    needed = {field.name for field in fields(made) if field.default is field.default_factory is MISSING}
    found = []
    for name, said in keys.items():
        kind, meaning = said if isinstance(said, tuple) else (kind_of(made, name), said)
        found.append(Key(name, kind, meaning, name in needed))
    return Form(says, tuple(found), made)


def _weight(unit: str) -> str:
    return f"factor on its square [{unit}]; 1 if left out"


_MOVES, _TURNS, _HELD = ((FRAME, f"the frame that {what}") for what in ("moves", "turns", "is held"))
_ORIENTATION = "false leaves the frame free to turn; true if left out"
_MARGIN = "distance from the edges of the polygon; 0 if left out"
_TOLERANCE = Key("tolerance", Number(TOLERANCE), "metres and radians to which goals are met; 1e-5 if left out")
_ITERATIONS = Key("iterations", Number(ITERATIONS), "most iterations")
_TIME_LIMIT = Key("time_limit", Number(TIME_LIMIT), "limit of time; then the best posture so far is the answer")

CONTACTS = {
    "touch": _form(
        tasks.Touch,
        "Bring a surface of the figure to that of a thing; they may slide along each other.",
        part="a segment, a piece, or a frame whose origin touches",
        thing="a thing, a piece such as chair:2, or another segment",
        weight=_weight("1/m^2"),
    ),
    "lean": _form(
        tasks.Lean,
        "Lean a segment on a thing; a side of it faces the thing.",
        on="the thing",
        part=(kinds.SEGMENT, "the segment; thorax if left out"),
        side="in the segment's axes, towards the thing; backwards if left out",
        weight=_weight("1/m^2, 1/rad^2"),
    ),
    "sit": _form(
        tasks.Sit,
        "Sit on a thing, with the back at another.",
        on="the seat: a thing or a piece of one",
        back="what the trunk touches; none if left out",
        pelvis=(kinds.SEGMENT, "the segment that sits; pelvis if left out"),
        trunk=(kinds.SEGMENT, "the uppermost segment that may touch the back; thorax if left out"),
        weight=_weight("1/m^2, 1/rad^2"),
    ),
    "grasp": _form(
        tasks.Grasp,
        "Take hold of a thing with a hand.",
        hand=(kinds.Choice(("left", "right")), "the hand"),
        thing="what is taken",
        kind="on a face, around a bar, by two tips or all",
        side="where the face looks that a palm takes; to the hand's side if left out",
        opposed="most that two sides are off from opposite; 45 degrees if left out",
        along="place along the thing, from its one end to the other; free if left out",
        approach="where the palm looks; free if left out",
        weight=_weight("1/m^2, 1/rad^2"),
    ),
}
"""Contacts; each is a goal and a constraint, by the table in which it stands."""

GOALS = {
    "point": _form(
        tasks.Point,
        "Move a point of a frame to a position.",
        frame=_MOVES,
        target="the position, in the world",
        offset="the point in the frame's axes; its origin if left out",
        weight=_weight("1/m^2"),
    ),
    "frame": _form(
        tasks.Frame,
        "Move a frame to a position and an orientation.",
        frame=_MOVES,
        target="the placement, in the world",
        weight=_weight("1/m^2, 1/rad^2"),
    ),
    "orientation": _form(
        tasks.Orientation,
        "Turn a frame to an orientation; its position is free.",
        frame=_TURNS,
        target="the orientation, in the world",
        weight=_weight("1/rad^2"),
    ),
    "axis": _form(
        tasks.Axis,
        "Turn an axis of a frame into a direction, or towards a point, such as a gaze or a palm.",
        frame=_TURNS,
        axis="in the frame's axes",
        direction="in the world; this or toward",
        toward="a point in the world; this or direction",
        weight=_weight("1/rad^2"),
    ),
    "center_of_mass": _form(
        tasks.CenterOfMass,
        "Move the centre of mass to a position, or above one.",
        target="the position, in the world",
        axes="xy leaves the height free; xyz if left out",
        weight=_weight("1/m^2"),
    ),
    "relative": _form(
        tasks.Relative,
        "Move a frame to a placement relative to another frame, such as two hands on one box.",
        frame=_MOVES,
        to=(FRAME, "the frame that it is placed relative to"),
        placement="in the axes of `to`; as at the start if left out",
        orientation=_ORIENTATION,
        weight=_weight("1/m^2, 1/rad^2"),
    ),
    "posture": _form(
        tasks.Posture,
        "Move joints to their values in a posture of the figure.",
        target=(kinds.POSTURE, "the posture"),
        joints=(kinds.Several(kinds.GROUP), "the joints that the goal moves; all and the root if left out"),
        weight=_weight("1/rad^2, 1/m^2"),
    ),
    **CONTACTS,
}

CONSTRAINTS = {
    "hold": _form(
        tasks.Hold,
        "Keep a frame at a placement, in the world or relative to another frame.",
        frame=_HELD,
        at="its placement; as at the start if left out",
        orientation=_ORIENTATION,
        relative_to=(FRAME, "the frame that `at` is relative to; the world if left out"),
    ),
    "plane": _form(
        tasks.Plane,
        "Keep a frame in a plane, or on one side of it.",
        frame=_HELD,
        normal="of the plane, in the world",
        point="in the plane; the frame's position at the start if left out",
        side="above lets it move along the normal; on if left out",
    ),
    "balance": _form(
        tasks.Balance,
        "Keep the centre of mass above the support polygon of the feet at the start; hold the feet as well.",
        feet=(kinds.Several(kinds.SEGMENT), "segments that stand on the ground; both feet if left out"),
        margin=_MARGIN,
    ),
    "freeze": Form(
        "Keep joints as they are at the start.",
        (Key("joints", kinds.Several(kinds.GROUP), 'joints and groups; "root" is the placement of the figure', True),),
        lambda joints: tasks.Freeze(*joints),
    ),
    "reach_cones": _form(
        tasks.ReachCones,
        "Keep limbs within the directions that shoulders and hips allow.",
        names=(kinds.Several(kinds.CONE), "which cones; all if left out"),
    ),
    "range_of_motion": _form(
        tasks.RangeOfMotion,
        "Keep two-joint muscles, upper arms and neck within their ranges.",
        names=(kinds.Several(kinds.RANGE), "which ranges; all if left out"),
    ),
    "stand": _form(
        tasks.Stand,
        "Stand with flat soles on a thing; the feet may slide, and the centre of mass stays over them.",
        on="what the figure stands on",
        feet=(kinds.Several(kinds.SEGMENT), "segments whose soles stand; both feet if left out"),
        balance="false for who also sits, leans or holds on; true if left out",
        margin=_MARGIN,
    ),
    **{name: replace(form, keys=form.keys[:-1]) for name, form in CONTACTS.items()},  # a constraint has no weight
}

MEASURES = {
    "effort": _form(tasks.Effort, "Displacement from the start, weighted by joint.", weight=_weight("1/rad^2")),
    "rotation_effort": _form(
        tasks.RotationEffort,
        "Displacement from the start, a ball joint's by its rotation vector.",
        weight=_weight("1/rad^2"),
    ),
    "discomfort": _form(
        tasks.Discomfort, "Distance of joints from neutral, and nearness to their limits.", weight=_weight("no unit")
    ),
    "displacement": _form(tasks.Displacement, "Displacement from the neutral posture.", weight=_weight("1/rad^2")),
    "rhythm": _form(
        tasks.Rhythm, "How clavicles follow the arms, and the lumbar spine the pelvis.", weight=_weight("no unit")
    ),
    "potential_energy": _form(tasks.PotentialEnergy, "Lifting and lowering of segments.", weight=_weight("1/J^2")),
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
            Key("iterations", Number(ITERATIONS), "most iterations of one descent"),
            Key("budget", Number(BUDGET), "quadratic programs for further descents; 1000 if left out"),
            Key("restarts", Number(RESTARTS), "most further descents"),
            Key(
                "restarts_for_measure",
                Number(RESTARTS),
                "descents for lower measures once goals are met; 0 if left out",
            ),
            Key("seed", Number(SEED), "of the starts of further descents"),
            Key("measures", kinds.Flag(), "whether to minimise the measures; false is faster, true if left out"),
            _TIME_LIMIT,
        ),
        _later("QP"),
    ),
    "ccd": Form(
        "Cyclic coordinate descent: points, frames and orientations, without measures.",
        (
            Key("tolerance", Number(CCD_TOLERANCE), "metres and radians to which goals are met; 1e-4 if left out"),
            Key("iterations", Number(ITERATIONS), "most sweeps from one start"),
            Key("restarts", Number(RESTARTS), "most further starts"),
            Key("seed", Number(SEED), "of those starts"),
            _TIME_LIMIT,
        ),
        _later("CCD"),
    ),
    "newton": Form(
        "Sparse Newton in full coordinates; least effort.",
        (
            _TOLERANCE,
            _ITERATIONS,
            Key("algebra", kinds.Text(), '"auto" (if left out), "normal", "kkt" or "schur"'),
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
        (_TOLERANCE, _ITERATIONS, _TIME_LIMIT),
        _later("Placo"),
    ),
    "dls": Form(
        "Damped least squares, the textbook baseline; it ignores contacts.",
        (
            _TOLERANCE,
            _ITERATIONS,
            Key("damping", Number(DAMPING), "remaining damping when the goals are met; 1e-3 if left out"),
            _TIME_LIMIT,
        ),
        _later("DampedLeastSquares"),
    ),
}

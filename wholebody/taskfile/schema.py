"""All tables and keys of a task file, which reader and writer use; docs/taskfile.md says what they mean."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, replace
from typing import Any

from wholebody import ergonomics, methods, tasks
from wholebody.base.fields import Range, Vector
from wholebody.figures.adjustable import ADJUSTABLE
from wholebody.figures.anthropometry import AGE, CLOTHING, MASS, PERCENTILE, SHOES, STATURE
from wholebody.figures.link_pieces import CONCAVITY
from wholebody.geometry import shapes
from wholebody.geometry.pieces import SMALLEST
from wholebody.motion.strength import Strength
from wholebody.problem import CLEARANCE
from wholebody.scene.matter.body import BallJoint, Body, Hinge
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import (
    DIRECTION,
    FRAME,
    GROUP,
    PLACEMENT,
    POSITION,
    SEGMENT,
    Choice,
    Flag,
    Form,
    Key,
    Kind,
    Number,
    Numbers,
    Part,
    Several,
    Table,
    Text,
    kind_of,
)
from wholebody.tasks.forces import MOST_FORCE

_SIZE = Range(SMALLEST, POSITION.vector.each.high, "m")  # of a thing in reach; a larger one is in other units
_LENGTH, _LENGTHS = Number(_SIZE), Numbers(Vector(3, _SIZE))


def _keys(**given: Kind) -> tuple[Key, ...]:
    """Keys that may be left out."""
    return tuple(Key(name, kind) for name, kind in given.items())


def _needed(**given: Kind) -> tuple[Key, ...]:
    return tuple(Key(name, kind, True) for name, kind in given.items())


_PERSON = _keys(
    sex=Choice(("male", "female")), stature=Number(STATURE), mass=Number(MASS), percentile=Number(PERCENTILE)
)
_OWN = _keys(proportions=kinds.PROPORTIONS, age=Number(AGE), shoes=Number(SHOES), clothing=Number(CLOTHING))
_DETAIL = _keys(detail=Choice(("spheres", "capsules", "hulls")))

SHAPES = {
    "box": Form(_needed(size=_LENGTHS), shapes.Box),
    "sphere": Form(_needed(radius=_LENGTH), shapes.Sphere),
    "capsule": Form(_needed(radius=_LENGTH, length=_LENGTH), shapes.Capsule),
    "cylinder": Form(_needed(radius=_LENGTH, length=_LENGTH), shapes.Cylinder),
    "torus": Form(_needed(radius=_LENGTH, tube=_LENGTH), shapes.Torus),
    "ellipsoid": Form(_needed(semi_axes=_LENGTHS), shapes.Ellipsoid),
    "halfspace": Form(_keys(normal=DIRECTION, offset=Number(POSITION.vector.each)), shapes.HalfSpace),
    "hull": Form(_needed(points=Several(POSITION, 4)), shapes.Hull),
    "mesh": Form(
        (
            *_needed(path=Text()),
            *(Key(name, kind_of(shapes.Mesh, name)) for name in ("scale", "up", "max_vertices", "threshold")),
        )
    ),
}


def _part_form(form: Form) -> Form:
    """A shape as a part of what is adjustable: its name, the shape and where it is."""
    make: Any = form.make
    keys = (*_needed(name=Text()), *form.keys, *_keys(at=PLACEMENT))
    return Form(keys, lambda name, at=(0.0, 0.0, 0.0), **size: (name, (make(**size), at)))


PARTS = Several(
    Part(
        "part",
        'name = "rim", shape = "torus", radius = 0.18, tube = 0.015',
        {name: _part_form(form) for name, form in SHAPES.items() if name not in ("halfspace", "mesh")},
        "shape",
    )
)
_SPAN, _TURN = (
    Numbers(Vector(2, each), "[least, greatest]") for each in (POSITION.vector.each, Range(-math.pi, math.pi, "rad"))
)

FIGURES = {
    "human": Form((*_PERSON, *_OWN, *_DETAIL, *_keys(hands=Choice(("rigid", "fingers"))))),
    "avatar": Form((*_PERSON, *_OWN, *_DETAIL)),
    "hand": Form((*_keys(side=Choice(("left", "right"))), *_PERSON)),
    ADJUSTABLE: Form((*_needed(parts=PARTS), *_keys(slide=_SPAN, height=_SPAN, tilt=_TURN))),
    "urdf": Form(
        (
            *_needed(path=Text()),
            *_keys(root=Choice(("fixed", "free")), package_dirs=Several(Text()), concavity=Number(CONCAVITY)),
        )
    ),
}


def _form(made: type, names: str, /, **given: Kind) -> Form:
    """A form whose keys are fields of the class that it makes; those without a default are required."""
    needed = {field.name for field in fields(made) if field.default is field.default_factory is MISSING}
    keys = (Key(name, given.get(name) or kind_of(made, name), name in needed) for name in names.split())
    return Form(tuple(keys), made)


CONTACTS = {
    "touch": _form(tasks.Touch, "part thing weight"),
    "lean": _form(tasks.Lean, "on part side weight", part=SEGMENT),
    "sit": _form(tasks.Sit, "on back pelvis trunk erect weight", pelvis=SEGMENT, trunk=SEGMENT),
    "grasp": _form(tasks.Grasp, "hand thing kind side opposed along approach weight"),
}
"""Contacts; each is a goal and a constraint, by the table in which it stands."""

GOALS = {
    "point": _form(tasks.Point, "frame target offset weight", frame=FRAME),
    "frame": _form(tasks.Frame, "frame target weight", frame=FRAME),
    "orientation": _form(tasks.Orientation, "frame target weight", frame=FRAME),
    "axis": _form(tasks.Axis, "frame axis direction toward weight", frame=FRAME),
    "center_of_mass": _form(tasks.CenterOfMass, "target axes weight figure", figure=kinds.MEMBER),
    "relative": _form(tasks.Relative, "frame to placement orientation weight", frame=FRAME, to=FRAME),
    "posture": _form(tasks.Posture, "target joints weight", target=kinds.POSTURE, joints=Several(GROUP)),
    **CONTACTS,
}

SOFT = kind_of(tasks.Soft, "weight")
"""What `soft` of a goal takes: the weight of the measure that the goal becomes."""

_NEWTONS = Numbers(Vector(3, Range(-MOST_FORCE, MOST_FORCE, "N")), "[x, y, z]")
_FORCE = _form(tasks.Force, "frame force", frame=FRAME, force=_NEWTONS)
FORCES = Several(Part("force", 'frame = "right_palm", force = [0.0, 0.0, -98.0]', {"": _FORCE}), 0)
_STRENGTH = _form(Strength, "percentile sex age", sex=Choice(("male", "female")))
STRENGTH = Part("strength", 'percentile = 50, sex = "male", age = 40', {"": _STRENGTH})
_STRENGTHS: dict[str, Kind] = {"forces": FORCES, "strength": STRENGTH, "person": kinds.MEMBER}
_FIELD = _form(ergonomics.FieldOfView, "horizontal up down declination")
VIEW = Part(
    "field of view", "horizontal = 0.26, up = 0.26, down = 0.26, declination = 0.26", {"": _FIELD}, note=", rad"
)

CONSTRAINTS = {
    "hold": _form(tasks.Hold, "frame at orientation relative_to", frame=FRAME, relative_to=FRAME),
    "plane": _form(tasks.Plane, "frame normal point side", frame=FRAME),
    "balance": _form(tasks.Balance, "feet margin", feet=Several(SEGMENT)),
    "freeze": Form(_needed(joints=Several(GROUP)), lambda joints: tasks.Freeze(*joints)),
    "reach_cones": _form(tasks.ReachCones, "names", names=Several(kinds.CONE)),
    "range_of_motion": _form(tasks.RangeOfMotion, "names", names=Several(kinds.RANGE)),
    "stand": _form(tasks.Stand, "on feet balance margin knees", feet=Several(SEGMENT), knees=Several(SEGMENT)),
    "loaded_balance": _form(ergonomics.LoadedBalance, "forces feet margin", forces=FORCES, feet=Several(SEGMENT)),
    "strength_limit": _form(
        ergonomics.StrengthLimit, "forces strength standing person share compression", **_STRENGTHS
    ),
    "look": _form(ergonomics.Look, "at view eyes", view=VIEW, eyes=FRAME),
    **{name: replace(form, keys=form.keys[:-1]) for name, form in CONTACTS.items()},  # a constraint has no weight
}

MEASURES = {
    "effort": _form(tasks.Effort, "weight"),
    "rotation_effort": _form(tasks.RotationEffort, "weight"),
    "discomfort": _form(tasks.Discomfort, "weight"),
    "displacement": _form(tasks.Displacement, "weight"),
    "rhythm": _form(tasks.Rhythm, "weight style"),
    "hang": _form(tasks.Hang, "arms weight", arms=Several(SEGMENT)),
    "stance": _form(tasks.Stance, "feet weight", feet=Several(SEGMENT)),
    "exertion": _form(ergonomics.Exertion, "forces strength standing person weight", **_STRENGTHS),
    "potential_energy": _form(tasks.PotentialEnergy, "weight"),
}


class _MethodForms(Mapping[str, Form]):
    """Forms of the methods: every setting is a key; a class is imported where its form is asked for."""

    def __getitem__(self, name: str) -> Form:
        made = getattr(methods, methods.METHODS[name])
        return _form(made, " ".join(field.name for field in fields(made)), solver=Text(), algebra=Text())

    def __iter__(self) -> Iterator[str]:
        return iter(methods.METHODS)

    def __len__(self) -> int:
        return len(methods.METHODS)


_THING = _keys(at=PLACEMENT, color=kinds.Color())
JOINT_OF_A_THING = Part(
    "joint",
    'type = "hinge" or "ball", at = [x, y, z], axis = [x, y, z], to = "thing"',
    {
        "hinge": Form(_keys(at=POSITION, axis=DIRECTION, to=Text()), Hinge),
        "ball": Form(_keys(at=POSITION, to=Text()), BallJoint),
    },
    "type",
    "; at is a point in the thing's axes, m; axis is that of a hinge, z if left out; without to the world holds it",
)
_BODY = _keys(
    density=kind_of(Body, "density"),
    mass=kind_of(Body, "mass"),
    material=Choice(("wood", "human", "metal")),
    velocity=kind_of(Body, "velocity"),
    angular_velocity=kind_of(Body, "angular_velocity"),
    joints=Several(JOINT_OF_A_THING),
)

TOP = _keys(
    title=Text(),
    clearance=Number(CLEARANCE),
    touching=Several(Several(Text(), 2), example='[["right_hand", "table"]]'),
    range_of_motion=Flag(),
    balance=Flag(),
)

TABLES = {
    "figure": Table(
        _keys(joints=Several(GROUP), called=Text(), at=PLACEMENT, on=Text()),
        either=True,
        chooser="name",
        implied=(("path", "urdf"),),
        forms=FIGURES,
    ),
    "start": Table(_keys(posture=kinds.POSTURE, joints=kinds.JOINT_VALUES, root=PLACEMENT, roots=kinds.ROOT_PLACES)),
    "object": Table((*_needed(name=Text()), *_THING, *_BODY), True, "shape", forms=SHAPES),
    "attach": Table(
        (*_needed(name=Text(), to=FRAME), *_keys(rests_on=Several(Text())), *_THING), True, "shape", forms=SHAPES
    ),
    "goal": Table((Key("soft", SOFT),), True, "type", forms=GOALS),
    "constraint": Table((), True, "type", forms=CONSTRAINTS),
    "measure": Table((), True, "type", forms=MEASURES),
    "view": Table(_keys(eye=POSITION, target=POSITION, see_through=Several(Text()))),
    "method": Table((), chooser="name", forms=_MethodForms()),
}

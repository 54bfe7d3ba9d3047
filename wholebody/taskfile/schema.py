"""All tables and keys of a task file, which reader and writer use; docs/taskfile.md says what they mean."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, replace
from typing import Any

from wholebody import ergonomics, methods, tasks
from wholebody.base.fields import Range, Vector
from wholebody.figures.adjustable import ADJUSTABLE
from wholebody.figures.anthropometry import AGE, CLOTHING, MASS, PERCENTILE, SHOES, STATURE
from wholebody.figures.link_pieces import CONCAVITY
from wholebody.figures.strength import Strength
from wholebody.geometry import shapes
from wholebody.geometry.pieces import SMALLEST
from wholebody.problem import CLEARANCE
from wholebody.scene.matter.body import BallJoint, Body, Hinge
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import (
    DIRECTION,
    FLAG,
    FRAME,
    GROUP,
    LINE,
    PLACEMENT,
    POSITION,
    SEGMENT,
    TEXT,
    Form,
    Key,
    Kind,
    Numbers,
    Part,
    Several,
    Table,
    choice,
    kind_of,
    number,
)
from wholebody.tasks.forces import MOST_FORCE

_SIZE = Range(SMALLEST, POSITION.vector.each.high, "m")  # of a thing in reach; a larger one is in other units
_LENGTH, _LENGTHS = number(_SIZE), Numbers(Vector(3, _SIZE))


def _keys(**given: Kind) -> tuple[Key, ...]:
    """Keys that may be left out."""
    return tuple(Key(name, kind) for name, kind in given.items())


def _needed(**given: Kind) -> tuple[Key, ...]:
    return tuple(Key(name, kind, True) for name, kind in given.items())


_PERSON = _keys(
    sex=choice(("male", "female")), stature=number(STATURE), mass=number(MASS), percentile=number(PERCENTILE)
)
_OWN = _keys(proportions=kinds.PROPORTIONS, age=number(AGE), shoes=number(SHOES), clothing=number(CLOTHING))
_DETAIL = _keys(detail=choice(("spheres", "capsules", "hulls")))

SHAPES = {
    "box": Form(_needed(size=_LENGTHS), shapes.Box),
    "sphere": Form(_needed(radius=_LENGTH), shapes.Sphere),
    "capsule": Form(_needed(radius=_LENGTH, length=_LENGTH), shapes.Capsule),
    "cylinder": Form(_needed(radius=_LENGTH, length=_LENGTH), shapes.Cylinder),
    "torus": Form(_needed(radius=_LENGTH, tube=_LENGTH), shapes.Torus),
    "ellipsoid": Form(_needed(semi_axes=_LENGTHS), shapes.Ellipsoid),
    "halfspace": Form(_keys(normal=DIRECTION, offset=number(POSITION.vector.each)), shapes.HalfSpace),
    "hull": Form(_needed(points=Several(POSITION, 4)), shapes.Hull),
    "mesh": Form(
        (
            *_needed(path=TEXT),
            *(Key(name, kind_of(shapes.Mesh, name)) for name in ("scale", "up", "max_vertices", "threshold")),
        )
    ),
}


def _part_form(form: Form) -> Form:
    """A shape as a part of what is adjustable: its name, the shape and where it is."""
    make: Any = form.make
    keys = (*_needed(name=TEXT), *form.keys, *_keys(at=PLACEMENT))
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
    "human": Form((*_PERSON, *_OWN, *_DETAIL, *_keys(hands=choice(("rigid", "fingers"))))),
    "avatar": Form((*_PERSON, *_OWN, *_DETAIL)),
    "hand": Form((*_keys(side=choice(("left", "right"))), *_PERSON)),
    ADJUSTABLE: Form((*_needed(parts=PARTS), *_keys(slide=_SPAN, height=_SPAN, tilt=_TURN))),
    "urdf": Form(
        (
            *_needed(path=TEXT),
            *_keys(root=choice(("fixed", "free")), package_dirs=Several(TEXT), concavity=number(CONCAVITY)),
        )
    ),
}


_NEWTONS = Numbers(Vector(3, Range(-MOST_FORCE, MOST_FORCE, "N")), "[x, y, z]")
_KINDS: dict[str, Kind] = {
    **dict.fromkeys(("frame", "to", "relative_to", "eyes"), FRAME),
    **dict.fromkeys(("pelvis", "trunk"), SEGMENT),
    **dict.fromkeys(("feet", "knees", "arms"), Several(SEGMENT)),
    **dict.fromkeys(("figure", "person"), kinds.MEMBER),
    **dict.fromkeys(("solver", "algebra"), TEXT),
    "joints": Several(GROUP),
    "force": _NEWTONS,
    "sex": choice(("male", "female")),
}
"""Kinds of fields by their names, where their annotations do not say them."""


def _form(made: type, **given: Kind) -> Form:
    """A form whose keys are fields of the class that it makes; those without a default are required."""
    known = _KINDS | given
    keys = (
        Key(
            each.name, known.get(each.name) or kind_of(made, each.name), each.default is each.default_factory is MISSING
        )
        for each in fields(made)
        if each.init
    )
    return Form(tuple(keys), made)


def _forms(*made: type, **given: Kind) -> dict[str, Form]:
    """Forms of classes by their names as files have them: `ReachCones` is "reach_cones"."""
    return {re.sub(r"(?<!^)(?=[A-Z])", "_", one.__name__).lower(): _form(one, **given) for one in made}


EITHER = {
    **_forms(tasks.Orientation, tasks.Axis, tasks.CenterOfMass, tasks.Touch, tasks.Sit, tasks.Grasp),
    **_forms(tasks.Lean, part=SEGMENT),
}
"""What is a goal or a constraint by the table in which it stands."""

GOALS = {
    **_forms(tasks.Point, tasks.Frame, tasks.Relative),
    **_forms(tasks.Posture, target=kinds.POSTURE),
    **EITHER,
}

SOFT = kind_of(tasks.Soft, "weight")  # what `soft` of a goal takes: the weight of the measure that the goal becomes

FORCES = Several(Part("force", 'frame = "right_palm", force = [0.0, 0.0, -98.0]', {"": _form(tasks.Force)}), 0)
STRENGTH = Part("strength", 'percentile = 50, sex = "male", age = 40', {"": _form(Strength)})
VIEW = Part(
    "field of view", "horizontal = 0.26, up = 0.26, down = 0.26, declination = 0.26",
    {"": _form(ergonomics.FieldOfView)}, note=", rad",
)  # fmt: skip

CONSTRAINTS = {
    **_forms(tasks.Hold, tasks.Plane, tasks.Balance, tasks.Stand),
    "freeze": Form(_needed(joints=Several(GROUP)), lambda joints: tasks.Freeze(*joints)),
    **_forms(tasks.ReachCones, names=Several(kinds.CONE)),
    **_forms(tasks.RangeOfMotion, names=Several(kinds.RANGE)),
    **_forms(ergonomics.LoadedBalance, ergonomics.StrengthLimit, forces=FORCES, strength=STRENGTH),
    **_forms(ergonomics.Look, view=VIEW),
    **{  # a constraint has no weight
        name: replace(form, keys=tuple(key for key in form.keys if key.name != "weight"))
        for name, form in EITHER.items()
    },
}

MEASURES = {
    **_forms(
        tasks.Effort,
        tasks.RotationEffort,
        tasks.Discomfort,
        tasks.Displacement,
        tasks.Rhythm,
        tasks.Hang,
        tasks.LevelHead,
    ),
    **_forms(tasks.Stance, tasks.SeatCenterline, tasks.PotentialEnergy),
    **_forms(ergonomics.Exertion, forces=FORCES, strength=STRENGTH),
}


class _MethodForms(Mapping[str, Form]):
    """Forms of the methods: every setting is a key; a class is imported where its form is asked for."""

    def __getitem__(self, name: str) -> Form:
        return _form(getattr(methods, methods.METHODS[name]))

    def __iter__(self) -> Iterator[str]:
        return iter(methods.METHODS)

    def __len__(self) -> int:
        return len(methods.METHODS)


_THING = _keys(at=PLACEMENT, color=kinds.COLOR)
JOINT_OF_A_THING = Part(
    "joint",
    'type = "hinge" or "ball", at = [x, y, z], axis = [x, y, z], to = "thing"',
    {
        "hinge": Form(_keys(at=POSITION, axis=DIRECTION, to=TEXT), Hinge),
        "ball": Form(_keys(at=POSITION, to=TEXT), BallJoint),
    },
    "type",
    "; at is a point in the thing's axes, m; axis is that of a hinge, z if left out; without to the world holds it",
)
_BODY = _keys(
    density=kind_of(Body, "density"),
    mass=kind_of(Body, "mass"),
    material=choice(("wood", "human", "metal")),
    velocity=kind_of(Body, "velocity"),
    angular_velocity=kind_of(Body, "angular_velocity"),
    joints=Several(JOINT_OF_A_THING),
)

TOP = _keys(
    title=LINE,
    clearance=number(CLEARANCE),
    touching=Several(Several(TEXT, 2), example='[["right_hand", "table"]]'),
    range_of_motion=FLAG,
    balance=FLAG,
)

TABLES = {
    "figure": Table(
        _keys(joints=Several(GROUP), called=TEXT, at=PLACEMENT, on=TEXT),
        either=True,
        chooser="name",
        implied=(("path", "urdf"),),
        forms=FIGURES,
    ),
    "start": Table(_keys(posture=kinds.POSTURE, joints=kinds.JOINT_VALUES, root=PLACEMENT, roots=kinds.ROOT_PLACES)),
    "object": Table((*_needed(name=TEXT), *_THING, *_BODY), True, "shape", forms=SHAPES),
    "attach": Table(
        (*_needed(name=TEXT, to=FRAME), *_keys(rests_on=Several(TEXT)), *_THING), True, "shape", forms=SHAPES
    ),
    "goal": Table((Key("soft", SOFT),), True, "type", forms=GOALS),
    "constraint": Table((), True, "type", forms=CONSTRAINTS),
    "measure": Table((), True, "type", forms=MEASURES),
    "view": Table(_keys(eye=POSITION, target=POSITION, see_through=Several(TEXT))),
    "method": Table((), chooser="name", forms=_MethodForms()),
}

"""Figures and things that a task file can name."""

from __future__ import annotations

from wholebody.base.fields import Range, Vector
from wholebody.figures.anthropometry import AGE, MASS, PERCENTILE, STATURE
from wholebody.figures.link_pieces import CONCAVITY
from wholebody.geometry import shapes
from wholebody.geometry.pieces import SMALLEST
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import DIRECTION, POSITION, Number, Numbers, kind_of
from wholebody.taskfile.tables import Form, Key

_SIZE = Range(SMALLEST, POSITION.vector.each.high, "m")  # of a thing in reach; a larger one is in other units
_LENGTH, _LENGTHS = Number(_SIZE), Numbers(Vector(3, _SIZE))
_STATURE = Key("stature", Number(STATURE), "the median of the sex if left out")
_MASS = Key("mass", Number(MASS), "the usual mass for sex and stature if left out")
_SEX = Key("sex", kinds.Choice(("male", "female")), "male if left out")
_DETAIL = Key("detail", kinds.Choice(("spheres", "capsules", "hulls")), "of its geometry; capsules if left out")
_PERCENTILE = Key("percentile", Number(PERCENTILE), "of the sex in ANSUR II, for stature and mass if left out")
_HANDS = Key("hands", kinds.Choice(("rigid", "fingers")), "one segment each, or fingers; rigid if left out")
_BODY = (_SEX, _STATURE, _MASS, _PERCENTILE)
_OWN = (
    Key("proportions", kinds.PROPORTIONS, "dimensions of ANSUR II that are met; the others follow"),
    Key("age", Number(AGE), "from 45 on some ranges of motion are smaller"),
)

FIGURES = {
    "human": Form("A person with 55 degrees of freedom.", (*_BODY, *_OWN, _DETAIL, _HANDS)),
    "avatar": Form("A person with a stiff torso: arms, legs and neck.", (*_BODY, *_OWN, _DETAIL)),
    "hand": Form("One hand.", (Key("side", kinds.Choice(("left", "right")), "right if left out"), *_BODY)),
    "urdf": Form(
        "Any URDF or MJCF, with its own collision geometry.",
        (
            Key("path", kinds.Text(), "the file, relative to the task file", True),
            Key("root", kinds.Choice(("fixed", "free")), "as in the file if left out, otherwise fixed"),
            Key("package_dirs", kinds.Several(kinds.Text()), "folders for package:// names, relative to the task file"),
            Key("concavity", Number(CONCAVITY), "of the pieces of meshes, relative to their size; hulls if left out"),
        ),
    ),
}

SHAPES = {
    "box": Form("A cuboid, centred.", (Key("size", _LENGTHS, "full lengths", True),), shapes.Box),
    "sphere": Form("A ball.", (Key("radius", _LENGTH, "of the ball", True),), shapes.Sphere),
    "capsule": Form(
        "All points within a radius of a segment along z, centred.",
        (Key("radius", _LENGTH, "around the segment", True), Key("length", _LENGTH, "of the segment", True)),
        shapes.Capsule,
    ),
    "cylinder": Form(
        "A cylinder along z, centred.",
        (Key("radius", _LENGTH, "of the cylinder", True), Key("length", _LENGTH, "along z", True)),
        shapes.Cylinder,
    ),
    "torus": Form(
        "A ring about z, centred, such as a steering wheel.",
        (
            Key("radius", _LENGTH, "from the centre to the middle of the tube", True),
            Key("tube", _LENGTH, "radius of the tube; less than the radius", True),
        ),
        shapes.Torus,
    ),
    "ellipsoid": Form("An ellipsoid, centred.", (Key("semi_axes", _LENGTHS, "half lengths", True),), shapes.Ellipsoid),
    "halfspace": Form(
        "The half-space below a plane, such as the ground.",
        (
            Key("normal", DIRECTION, "out of the solid; up if left out"),
            Key("offset", Number(POSITION.vector.each), "of the plane along the normal; 0 if left out"),
        ),
        shapes.HalfSpace,
    ),
    "hull": Form("The convex hull of points.", (Key("points", kinds.Several(POSITION, 4), "in m", True),), shapes.Hull),
    "mesh": Form(
        "A triangle mesh (OBJ, STL, glTF, COLLADA), split into convex pieces.",
        (
            Key("path", kinds.Text(), "relative to the task file", True),
            Key("scale", kind_of(shapes.Mesh, "scale"), "metres to one unit of the file; 1 if left out"),
            Key("up", kind_of(shapes.Mesh, "up"), "axis of the file that points up; z if left out"),
            Key(
                "max_vertices",
                kind_of(shapes.Mesh, "max_vertices"),
                "of a piece if the mesh is not convex; 32 if left out",
            ),
            Key(
                "threshold",
                kind_of(shapes.Mesh, "threshold"),
                "concavity of a piece, relative to its size; 0.05 if left out",
            ),
        ),
    ),
}

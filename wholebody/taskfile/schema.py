"""All tables and keys of a task file. The reader, the writer and the documentation use them."""

from __future__ import annotations

from wholebody.base.fields import Range, Vector
from wholebody.figures.anthropometry import AGE, MASS, PERCENTILE, STATURE
from wholebody.figures.link_pieces import CONCAVITY
from wholebody.geometry import shapes
from wholebody.geometry.pieces import SMALLEST
from wholebody.problem import CLEARANCE
from wholebody.scene.matter.body import Body
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import DIRECTION, FRAME, PLACEMENT, POSITION, Form, Key, Number, Numbers, Table, kind_of
from wholebody.taskfile.terms import CONSTRAINTS, GOALS, MEASURES, METHODS

_SIZE = Range(SMALLEST, POSITION.vector.each.high, "m")  # of a thing in reach; a larger one is in other units
_LENGTH, _LENGTHS = Number(_SIZE), Numbers(Vector(3, _SIZE))
_STATURE = Key("stature", Number(STATURE), "the median of the sex if left out")
_MASS = Key("mass", Number(MASS), "the usual mass for sex and stature if left out")
_SEX = Key("sex", kinds.Choice(("male", "female")), "male if left out")
_DETAIL = Key("detail", kinds.Choice(("spheres", "capsules", "hulls")), "of its geometry; capsules if left out")
_PERCENTILE = Key("percentile", Number(PERCENTILE), "of the sex in ANSUR II, for stature and mass if left out")
_HANDS = Key("hands", kinds.Choice(("rigid", "fingers")), "one segment each, or fingers; rigid if left out")
_PERSON = (_SEX, _STATURE, _MASS, _PERCENTILE)
_OWN = (
    Key("proportions", kinds.PROPORTIONS, "dimensions of ANSUR II that are met; the others follow"),
    Key("age", Number(AGE), "from 45 on some ranges of motion are smaller"),
)

FIGURES = {
    "human": Form("A person with 55 degrees of freedom.", (*_PERSON, *_OWN, _DETAIL, _HANDS)),
    "avatar": Form("A person with a stiff torso: arms, legs and neck.", (*_PERSON, *_OWN, _DETAIL)),
    "hand": Form("One hand.", (Key("side", kinds.Choice(("left", "right")), "right if left out"), *_PERSON)),
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

_THING = (
    Key("at", PLACEMENT, "its placement; the origin if left out"),
    Key("color", kinds.Color(), "of the thing; chosen by the viewer if left out"),
)

_BODY = (
    Key("density", kind_of(Body, "density"), "of a thing that moves by itself, in `wholebody world`"),
    Key("mass", kind_of(Body, "mass"), "in place of a density"),
    Key("material", kinds.Choice(("wood", "human", "metal")), "for impacts and friction; wood if left out"),
    Key("velocity", kind_of(Body, "velocity"), "of a thing that moves by itself; 0 if left out"),
    Key("angular_velocity", kind_of(Body, "angular_velocity"), "of it, along the world's axes; 0 if left out"),
    Key("joints", kinds.ThingJoints(), "that hold a thing that moves by itself; free if left out"),
)

TOP = (
    Key("title", kinds.Text(), "one line of description"),
    Key("clearance", Number(CLEARANCE), "least distance between any two pieces; 0 if left out"),
    Key(
        "touching",
        kinds.Several(kinds.Several(kinds.Text(), 2), example='[["right_hand", "table"]]'),
        "pairs of segments or objects whose clearance is 0",
    ),
    Key("range_of_motion", kinds.Flag(), "whether a person keeps ranges of motion, cones and rhythm; true if left out"),
    Key("balance", kinds.Flag(), "whether the centre of mass stays above the feet; if left out, where a person stands"),
)

TABLES = {
    "figure": Table(
        "The figure that is posed.",
        (Key("joints", kinds.Several(kinds.GROUP), "joints and groups that may move; all if left out"),),
        chooser="name",
        implied=(("path", "urdf"),),
        forms=FIGURES,
    ),
    "start": Table(
        "The start posture; the figure's first posture if left out.",
        (
            Key("posture", kinds.POSTURE, "one of the figure's postures"),
            Key("joints", kinds.Joints(), "values of joints that differ from that posture"),
            Key("root", PLACEMENT, "placement of a free root; as in the posture if left out"),
        ),
    ),
    "object": Table(
        "A thing around the figure.",
        (Key("name", kinds.Text(), "of the thing", True), *_THING, *_BODY),
        True,
        "shape",
        forms=SHAPES,
    ),
    "attach": Table(
        "A thing that the figure carries.",
        (
            Key("name", kinds.Text(), "of the thing", True),
            Key("to", FRAME, "the frame that carries it", True),
            Key("rests_on", kinds.Several(kinds.Text()), "more segments and carried things that it may touch"),
            *_THING,
        ),
        True,
        "shape",
        forms=SHAPES,
    ),
    "goal": Table("A goal, which is met if possible.", (), True, "type", forms=GOALS),
    "constraint": Table(
        "A constraint, in addition to joint limits and non-penetration.", (), True, "type", forms=CONSTRAINTS
    ),
    "measure": Table("A measure to minimise; effort if the file has none.", (), True, "type", forms=MEASURES),
    "view": Table(
        "The camera of the picture; chosen automatically if left out.",
        (
            Key("eye", POSITION, "position of the camera; with target"),
            Key("target", POSITION, "the point in the middle of the picture; with eye"),
            Key("see_through", kinds.Several(kinds.Text()), "things to draw transparent"),
        ),
    ),
    "method": Table("The method that finds the posture.", (), chooser="name", forms=METHODS),
}

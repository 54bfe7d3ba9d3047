"""All tables and keys of a task file. The reader and the documentation both use them."""

from __future__ import annotations

from wholebody.problem import CLEARANCE
from wholebody.scene.matter.body import Body
from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import FRAME, PLACEMENT, POSITION, Number, kind_of
from wholebody.taskfile.tables import Key, Table
from wholebody.taskfile.terms import CONSTRAINTS, GOALS, MEASURES, METHODS
from wholebody.taskfile.things import FIGURES, SHAPES

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

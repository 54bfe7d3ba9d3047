"""Everything that a task file can say. Reader and documentation both follow it."""

from __future__ import annotations

from wholebody.taskfile import kinds
from wholebody.taskfile.kinds import FRAME, PLACEMENT, POSITION, Number
from wholebody.taskfile.tables import Key, Table
from wholebody.taskfile.terms import CONSTRAINTS, GOALS, MEASURES, METHODS
from wholebody.taskfile.things import FIGURES, SHAPES

_THING = (
    Key("at", PLACEMENT, "where it is; the origin if left out"),
    Key("color", kinds.Several(Number(0.0, 1.0), 3), "red, green, blue and, if given, alpha"),
)

TOP = (
    Key("title", kinds.Text(), "one line for people"),
    Key("clearance", Number(0.0, 0.5, "m"), "least distance between any two pieces; 0 if left out"),
    Key(
        "touching",
        kinds.Several(kinds.Several(kinds.Text(), 2), example='[["right_hand", "table"]]'),
        "pairs of segments or objects that may come nearer than the clearance, to touching",
    ),
)

TABLES = {
    "figure": Table(
        "Who is posed.",
        (Key("joints", kinds.Several(kinds.GROUP), "joints and groups that take part; all if left out"),),
        chooser="name",
        implied=(("path", "urdf"),),
        forms=FIGURES,
    ),
    "start": Table(
        "Where it begins; the figure's first posture if left out.",
        (
            Key("posture", kinds.POSTURE, "one of the figure's postures"),
            Key("joints", kinds.Joints(), "joints that differ from it"),
            Key("root", PLACEMENT, "where a free root is, if not as in the posture"),
        ),
    ),
    "object": Table(
        "A thing that stands around.",
        (Key("name", kinds.Text(), "of the thing", True), *_THING),
        True,
        "shape",
        forms=SHAPES,
    ),
    "attach": Table(
        "A thing that the figure carries.",
        (Key("name", kinds.Text(), "of the thing", True), Key("to", FRAME, "what carries it", True), *_THING),
        True,
        "shape",
        forms=SHAPES,
    ),
    "goal": Table("What to reach, if it can be.", (), True, "type", forms=GOALS),
    "constraint": Table("What must hold beside limits and non-penetration.", (), True, "type", forms=CONSTRAINTS),
    "measure": Table("What to keep small; effort if there is none.", (), True, "type", forms=MEASURES),
    "view": Table(
        "How the picture is taken; the camera finds its own place if left out.",
        (
            Key("eye", POSITION, "where the camera is; with target"),
            Key("target", POSITION, "what is in the middle of the picture; with eye"),
            Key("see_through", kinds.Several(kinds.Text()), "things that would hide the figure"),
        ),
    ),
    "method": Table("How the posture is found.", (), chooser="name", forms=METHODS),
}

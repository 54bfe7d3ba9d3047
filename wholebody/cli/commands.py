"""The commands of `wholebody`: their words and options; what runs one is imported when it runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.base.files import is_file
from wholebody.cli import bench, clip
from wholebody.cli.arguments import JOBS, JOINED, OF_WORK, add_person, scene_options
from wholebody.cli.command import Command, Group, command, flag, later, option, path, real, text, whole
from wholebody.cli.command import later_with_pictures as drawing
from wholebody.methods import METHODS


def _path_or_live(parser: argparse.ArgumentParser) -> None:
    either = parser.add_mutually_exclusive_group(required=True)
    either.add_argument("--path", metavar="FILE|circle|line", help="path of the goal")
    either.add_argument("--live", action="store_true", help="drag handles with the mouse in a browser (needs viser)")


COMMANDS: tuple[Command | Group, ...] = (
    command(
        "pose",
        "find a posture for a task file",
        """\
Find a posture for a task file, print how good it is, and write into a folder:

  result.json   the posture, joints by name (rad), and its assessment
  scene.html    the scene, for any browser, without a network
  scene.png     a picture of it (needs Chromium; not with --json or --no-picture)

docs/taskfile.md lists everything that a task file can contain.""",
        path("task", "TASK.toml", "the task file"),
        text("--method", "NAME", f"method, in place of the file's: {', '.join(METHODS)}"),
        path("--out", "DIR", "folder to write to (default: out/NAME-OF-TASK)"),
        flag("--json", "print the result as JSON instead of tables; no picture"),
        flag("--no-picture", "do not draw scene.png, which takes seconds"),
        epilog="""\
examples:
  wholebody pose shelf.toml
  wholebody pose shelf.toml --method qp --out results/shelf
  wholebody pose shelf.toml --json | jq .joints""",
    )(drawing("pose.run", lambda given: not (given.no_picture or given.json) and is_file(given.task))),
    command(
        "show",
        "show a figure, a task or a result",
        """\
Show in a browser. The command waits for the first tab, and ends when the last one is closed, or with Ctrl-C:

  a figure   human, avatar, hand, or the path of a URDF
  a task     the start of a task file, with its goals
  a result   result.json, written by `wholebody pose`""",
        text("what", "FIGURE|TASK|RESULT", "what to show"),
        add_person,
        text("--posture", "NAME", "name of a posture of the figure"),
        flag("--pieces", "draw the pieces that contacts are measured with"),
        path("--save", "FILE", "write FILE.html, FILE.png or FILE.glb (glTF); open no browser"),
        whole("--port", "N", "port of the live page (default: a free one from 7000)", default=0),
        text(
            "--host",
            "ADDRESS",
            "address of the live page (default: 127.0.0.1; 0.0.0.0 allows access from other machines)",
            default="127.0.0.1",
        ),
        epilog="""\
examples:
  wholebody show human --posture sitting
  wholebody show human --sex female --stature 1.55
  wholebody show human --pieces                    # what contacts are measured with, instead of the body's surface
  wholebody show out/shelf/result.json
  wholebody show shelf.toml --port 7777            # on another machine: ssh -L 7777:localhost:7777 HOST, then this
  wholebody show shelf.toml --save shelf.png""",
    )(drawing("show.run", lambda given: given.save is not None and given.save.suffix.lower() == ".png")),
    command(
        "figure",
        "describe a figure, or write a person as a URDF",
        """\
List the joints with their limits, the frames for goals, groups and postures of a figure:
human, avatar, hand, or the path of a URDF. With --out, write a person as a URDF instead.""",
        text("name", "FIGURE", "human, avatar, hand, or the path of a URDF"),
        add_person,
        path("--out", "FILE.urdf", "write a person's URDF to this file"),
        epilog="""\
examples:
  wholebody figure human --sex female --stature 1.62 --mass 60
  wholebody figure human --sex female --stature 1.62 --mass 60 --out small-woman.urdf
  wholebody figure human --sex female --percentile 5 --age 60
  wholebody figure human --stature 1.80 --proportion sitting_height=0.96
  wholebody figure human --hands fingers --out with-fingers.urdf
  wholebody figure robot.urdf""",
    )(later("figure.run")),
    command(
        "demo",
        "pose a packaged task",
        """\
Pose a packaged task (by default a person who reaches between the boards of a shelf), and print where the pictures are.
You can copy and change the task file.""",
        text("name", "NAME", "which task (default: shelf)", nargs="?", default="shelf"),
        flag("--list", "list the tasks"),
        path("--out", "DIR", "folder (default: demo)", default=Path("demo")),
    )(drawing("pose.demo", lambda given: not given.list)),
    command(
        "gallery",
        "run the example scripts, and show them on one page",
        """\
Run the packaged example scripts, and write one page that opens without a network. It has the picture of each, its
description, what it printed, its code, and its scene to turn. All of them take some minutes.""",
        text("names", "NAME", "which scripts (default: all)", nargs="*"),
        path("--out", "PAGE", "page (default: gallery.html)", default=Path("gallery.html")),
    )(later("pose.gallery")),
    command(
        "interact",
        "follow a tracker frame by frame through a gallery without penetration",
        """\
Run a scene: a scripted tracker moves a hand or an avatar into walls, tables and itself, and the shown figure follows as
far as contact allows. Print a table of times and remaining overlap, assessed independently. Write the numbers of every
frame (CSV), a chart of the frame times (PNG, SVG) and the animation with the tracked posture as a ghost (HTML, opens
without a network).""",
        *scene_options("name of the scene, or all", "qp, ccd or all (default: qp)", "out/interact"),
        epilog="""\
examples:
  wholebody interact --list
  wholebody interact two_arms
  wholebody interact all --out out/interact
exit code: 1 if a frame overlaps by more than the tolerance, passes through something, or leaves a joint limit""",
    )(later("interact.run")),
    command(
        "drag",
        "drag a goal of a task along a path, frame by frame",
        """\
Drag a goal of a task file (its first point or frame, or the one that --goal names) along a path at a constant speed; a
frame keeps its orientation, and the places of a relative goal are in the axes of its frame "to". The figure follows
frame by frame and at the end meets the goal to 1e-5 m. Print a table of times and remaining errors, assessed
independently in every frame and between frames. Write into a folder the table (Markdown), the numbers of every frame
(CSV), a chart of the frame times (PNG, SVG) and the animation (HTML, opens without a network).

paths:
  line      from the start of the dragged frame to --to, or to the goal's target
  circle    from the start to a circle of radius --size around the goal's target, normal to --normal
  FILE      from the start through the points of a text file: x y z in metres, one point a line""",
        path("task", "TASK.toml", "the task file"),
        _path_or_live,
        text("--method", "NAME", f"{', '.join(METHODS)} (default: qp)", default="qp"),
        whole("--port", "N", "of the live page (default: 8080)", default=8080),
        whole("--goal", "N", "which goal, from 0 (default: first with a place)"),
        whole("--frames", "N", "number of frames (default: 0.5 m/s)"),
        real("--size", "M", "radius of a circle, m (default: 0.1)", default=0.1),
        real(
            "--normal",
            ("X", "Y", "Z"),
            "normal of a circle's plane (default: 1 0 0, which faces the figure)",
            nargs=3,
            default=(1.0, 0.0, 0.0),
        ),
        real("--to", ("X", "Y", "Z"), "end of a line, m", nargs=3),
        path("--out", "DIR", "folder to write to (default: out/drag/NAME-OF-TASK)"),
        epilog="""\
--live opens a page instead: drag the handles on hands, feet, pelvis, head and things with the mouse, click one to
hold it; "undo" goes back, "save" writes the posture as a task file into the folder.

examples:
  wholebody drag shelf.toml --live
  wholebody drag sit_on_chair.toml --path line --method newton
  wholebody drag look_and_touch_overhead.toml --path circle --normal 0 0 1 --method qp
  wholebody drag sit_on_chair.toml --path sit_on_chair.csv --frames 300 --out out/chair
exit code: 1 if the end is not met, or if the overlap in a frame or between two exceeds 1 mm, or a limit is violated""",
    )(later("drag.run")),
    command(
        "world",
        "let a hand or an avatar meet balls, boxes and dominoes that move by themselves",
        """\
Run a scene: a scripted tracker moves a hand or an avatar, and the things that it meets fall, roll, slide and bounce.
With a task file the figure stands as the file starts. Print a table of frame times, impacts and overlap. Write the
numbers of every frame (CSV), a chart of the energy and the frame times (PNG, SVG) and the animation (HTML, opens
without a network).""",
        *scene_options(
            "name of the scene, or all; or a task file whose objects have a density or a mass",
            "qp or ccd (default: qp)",
            "out/world",
        ),
        text("--give-way", "WHO", "figure or both: who takes an overlap (default: figure)", default="figure"),
        flag("--picture", "draw five moments too, by a headless Chromium"),
        flag("--live", "open a page instead: drag handles and things with the mouse, and throw them (needs viser)"),
        whole("--port", "N", "of the live page (default: 8080)"),
        whole("--udp", "N", "port at which places of handles arrive for the live page"),
        epilog="""\
--live runs the scene in a browser without its script: the figure follows its handles, a thing that is let go flies on.
Datagrams to the port of --udp move handles too: {"head_top": [0.1, 0.0, 1.7], "right_palm": [0.4, -0.2, 1.1]}, metres.

examples:
  wholebody world --list
  wholebody world flick
  wholebody world my_task.toml --frames 300
  wholebody world room --live --udp 9870
  wholebody world all --out out/world
exit code: 1 if pieces were deeper in each other than 0.1 mm after a frame, or a collision could not be avoided""",
    )(later("world.run")),
    clip.group,
    command(
        "study",
        "solve one task for many people, targets and layouts",
        """\
Solve the task of a study file for each person, with each target, in each layout, and write into a folder:

  cases.csv         one row a case
  records.jsonl     the same with the postures; an interrupted run continues from it""",
        path("study", "FILE.toml", "the study file"),
        path("--out", "DIR", "folder to write to (default: out/NAME-OF-FILE)"),
        *JOBS,
        epilog="""\
a study file:
  task = "shelf.toml"                     # relative to the study file

  [[person]]
  name = "small woman"
  sex = "female"
  stature = 1.53

  [[target]]                              # of the task's first goal of type point or frame
  name = "upper board"
  at = [0.45, -0.20, 1.45]

  [[layout]]
  name = "nearer"
  move = { shelf = [0.55, 0.0, 0.0] }     # things of the task

examples:
  wholebody study shelf-study.toml --jobs 2
  wholebody study shelf-study.toml --out results/study""",
    )(later("study.run_study")),
    command(
        "reach",
        "map the places that a hand or another frame can reach",
        """\
Find which places of a grid a frame of a task file's figure reaches, under all conditions of the task file except its
goals, and write into a folder:

  reach.png    heat maps of all heights, seen from above
  reach.html   the same with a slider, for any browser
  reach.npz    all arrays: verdicts, distances left, postures
  reach.vtk    verdicts and distances, for ParaView and the like""",
        path("task", "TASK.toml", "the task file: figure, things, constraints"),
        text("--frame", "NAME", "the frame that reaches", required=True),
        text("--low", JOINED, "least corner of the grid, metres", required=True),
        text("--high", JOINED, "greatest corner", required=True),
        text("--step", "M", "metres between places, or X,Y,Z (default: 0.1)", default="0.1"),
        *JOBS,
        path("--out", "DIR", "folder to write to (default: out/NAME-OF-TASK)"),
        epilog="""\
examples:
  wholebody reach seat.toml --frame right_index_tip --low 0,-0.8,0.4 --high 1.0,0.4,1.6 --step 0.1
  wholebody reach seat.toml --frame left_palm --low 0.2,-0.5,0.9 --high 0.9,0.5,0.9 --step 0.05 --jobs 2""",
    )(later("study.run_reach")),
    command(
        "assess",
        "judge a posture, and score its ergonomics",
        """\
Judge the posture of a result.json that `wholebody pose` wrote: goals, overlaps, limits, constraints. With --ergonomics
print RULA, REBA, OWAS and the torques against published strength too; --json prints all of it.""",
        path("result", "RESULT.json", "the result"),
        flag("--ergonomics", "score the ergonomics of a person"),
        real("--load", "KG", "mass in both hands (default: 0)"),
        text("--coupling", "WORD", "grip: good (default), fair, poor, unacceptable"),
        *(
            option(f"--{name.replace('_', '-')}", action="store_const", const=True, help=says)
            for name, says in OF_WORK.items()
        ),
        option(
            "--seated",
            choices=("yes", "no"),
            help="whether the person sits (default: decided by what is below, or the posture)",
        ),
        text("--sex", "SEX", "of the strength: male or female (default: the person's)"),
        real("--percentile", "P", "of the strength, 5 to 95 (default: 50)"),
        flag("--json", "print JSON instead of tables"),
        epilog="""\
examples:
  wholebody assess out/shelf/result.json --ergonomics
  wholebody assess out/shelf/result.json --ergonomics --load 6 --repeated --json
exit code: 1 if the posture violates a limit, a constraint or a clearance by more than 0.1 mm or mrad""",
    )(later("assess.run")),
    bench.group,
    command(
        "doctor",
        "check this installation: versions, methods, QP solvers, tools",
        """\
Print the versions of all packages, use every method and QP solver once, and name wrong combinations of versions and
wrong search paths with their repairs. Print the folder and size of the cache of mesh pieces. The exit code is 1 if
something is wrong; an absent optional package is no fault.""",
        flag("--clear-cache", "empty the cache of mesh pieces, and end"),
    )(later("doctor.doctor")),
)

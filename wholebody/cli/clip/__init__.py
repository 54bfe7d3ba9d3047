"""The command group `wholebody clip`: the words and options of its commands."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import JOBS, add_person
from wholebody.cli.command import Group, Option, command, flag, later, option, path, real, text, whole


def _figure(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("figure")
    group.add_argument(
        "--figure", default="human", metavar="FIGURE", help="human (default), avatar, hand, or the path of a URDF"
    )
    add_person(group)
    group.add_argument(
        "--root", choices=("fixed", "free"), help="of a robot: whether it goes about (default: as its file says)"
    )


SCENE = path("--scene", "TASK.toml", "task file with the figures and their things")

ONE_MOTION: tuple[Option, ...] = (path("file", "FILE", "the motion"), _figure, SCENE)
"""The file of a motion, and the figure or the scene that it moves."""

MOTIONS: tuple[Option, ...] = (path("files", "FILE", "the motions", nargs="+"), _figure)

WORN = "what the body wears: a ready name such as pack, names joined by +, or a mesh that is put on its back"
EQUIPMENT = text("--equipment", "WHAT", f"{WORN}; repeated, each in turn", action="append", default=[])

PAGE = path("--html", "FILE", "write curves over time and a film beside the recording")

BARE = flag("--bare", "CSV without names and times, as tools that train robots take it")

group = Group(
    "clip",
    "describe, convert and play motions",
    "Clips are postures of a figure at a fixed time step, read from files of motion capture and of wholebody.",
    (
        command(
            "info",
            "what a file of motion holds",
            """\
Say what a file of motion holds: figure, frames, time step, duration, and of the joints that move most their range and
greatest speed.""",
            *ONE_MOTION,
        )(later("clip.files.info")),
        command(
            "convert",
            "write a motion in another format",
            """\
Write a motion in another format: .npz (without loss), .bvh, .csv, .txt (joint profile) or .glb (glTF animation).
A skeleton that is not the figure's own is retargeted.""",
            *ONE_MOTION,
            path("out", "OUT", "the file to write"),
            real("--dt", "S", "seconds from frame to frame (default: as it is)"),
            BARE,
            flag("--mirror", "exchange left and right"),
            epilog="""\
examples:
  wholebody clip convert walk.npz walk.glb
  wholebody clip convert walk.npz slow.bvh --dt 0.04 --mirror""",
        )(later("clip.files.convert")),
        command(
            "retarget",
            "skeletons' motions for a figure",
            """\
Turn the motion of a skeleton (BVH, glTF, AMASS) into a clip of a figure of any proportions. Limbs keep the recorded
directions, within joint limits, speed limits and reach cones. Points that rest are held on the ground, and frames
that overlap themselves or the floor are told. A table has the errors of bones; `wholebody clip check` tests the motion
between frames. A robot's .npz has the arrays that mjlab, BeyondMimic and GMR name. Several files are written into a
folder; those that it holds are not made again.""",
            *MOTIONS,
            text("--to", "FIGURE", "another name of --figure; a robot goes about freely"),
            path("--out", "OUT", ".npz, .bvh, .csv, .txt or .glb; of several motions a folder"),
            real("--rate", "HZ", "frames a second that are written (default: as recorded)"),
            BARE,
            path("--names", "FILE.toml", "which bone is which part"),
            option(
                "--ground",
                choices=("auto", "none"),
                default="auto",
                help="find where feet rest, or follow the skeleton alone",
            ),
            SCENE,
            text(
                "--track",
                "THING=FILE",
                "where a thing of the scene is in each frame: a line of x y z, or x y z qx qy qz qw; "
                "repeated for others",
                action="append",
                default=[],
            ),
            text("--unit", "UNIT", "of lengths, such as centimetres (default: recognised)"),
            option("--up", choices=("y", "z"), help="the axis that points up (default: recognised)"),
            PAGE,
            *JOBS,
            epilog="""\
examples:
  wholebody clip retarget walk.bvh --out walk.npz --sex female --stature 1.62
  wholebody clip retarget walk.bvh --to g1.urdf --ground auto --out walk.npz
  wholebody clip retarget walk.bvh --to g1.urdf --rate 50 --bare --out walk.csv --html walk.html
  wholebody clip retarget lift.bvh --scene room.toml --track box=box.csv --out lift.npz
  wholebody clip retarget walk.bvh run.bvh jump.bvh --out clips --jobs 4""",
        )(later("clip.files.retarget_motions")),
        command(
            "play",
            "show a motion",
            """\
Show a motion. Without --out a page opens in the browser and plays it; with --out it is written as a page that opens
without a network (.html), as glTF (.glb), a movie (.mp4, .gif) or a strip of pictures (.png). A second motion is its
ghost. With --equipment the body is shown with what it wears, with --scene the figures among their things.""",
            *ONE_MOTION,
            path("--ghost", "FILE", "another motion of the figure, shown transparent"),
            path(
                "--beside",
                "FILE",
                "what it was made from, beside it: the recorded skeleton as bones, and the figure that follows it",
            ),
            text("--equipment", "WHAT", WORN, default="nothing"),
            path("--out", "OUT", ".html, .glb, .mp4, .gif or .png"),
            whole("--pictures", "N", "of a strip (default: 8)", default=8),
            epilog="""\
examples:
  wholebody clip play walk.bvh
  wholebody clip play free.npz --ghost walk.npz --out before-after.html
  wholebody clip play walk-free.npz --ghost walk.bvh --equipment pack
  wholebody clip play walk-free.npz --beside walk.bvh --equipment pack --out film.mp4
  wholebody clip play carried.npz --scene two-people.toml""",
        )(later("clip.play.run")),
        command(
            "check",
            "what overlaps in motions, when and how deep",
            """\
Check a motion: every pair of pieces that can touch, in every frame and in the motion from each frame to the next one;
joint limits, joint speeds, feet that slide while they stand, jerk. Overlaps of the figure with itself, with what it
carries and with the things around it are told apart. Several motions, or pieces of equipment, give a line each.""",
            *MOTIONS,
            EQUIPMENT,
            *JOBS,
            SCENE,
            real("--depth", "MM", "deepest overlap that is no contact (default: 0.1)"),
            flag("--json", "print everything as JSON instead of tables"),
            path("--html", "FILE", "write a timeline to look at; opens without a network"),
            epilog="""\
examples:
  wholebody clip check walk.bvh
  wholebody clip check walk.bvh --equipment pack --html walk.html
  wholebody clip check walk.npz --scene room.toml
  wholebody clip check walk.npz --json > walk.json
  wholebody clip check *.bvh --equipment pack --equipment vest_plate --jobs 4
exit code: 1 if something overlaps by more than the depth, or a joint is beyond its limit""",
        )(later("clip.check.run")),
        command(
            "avoid",
            "free motions of collisions",
            """\
Free motions of collisions of the body with itself, with its equipment and with things. All pairs in all frames and
sweeps between them judge the answer, independently of the method; the exit code is 1 if a collision remains.

Several motions, pieces of equipment or methods are a batch: each motion with each equipment by each method, written
into a folder with a table (cases.csv, cases.jsonl). Cases that the folder holds are not done again, so an interrupted
batch continues.""",
            *MOTIONS,
            text("--method", "NAME", "how (default: trajectory); repeated, each in turn", action="append", default=[]),
            EQUIPMENT,
            SCENE,
            flag("--dynamics", "keep torques within the strength of a median person, and the balance within the feet"),
            real(
                "--stretch",
                "FACTOR",
                "slow the motion by up to this factor where joints are too fast or, with --dynamics, too weak",
            ),
            path(
                "--out",
                "OUT",
                "the file to write (default: <name>-free.npz, beside FILE); of a batch a folder (default: freed)",
            ),
            PAGE,
            *JOBS,
            epilog="""\
examples:
  wholebody clip avoid walk.bvh --equipment pack
  wholebody clip avoid walk.bvh --equipment pack --html walk.html
  wholebody clip avoid walk.bvh run.bvh --equipment pack --equipment vest_plate+pouches --jobs 4 --out freed""",
        )(later("clip.avoid.run")),
    ),
)

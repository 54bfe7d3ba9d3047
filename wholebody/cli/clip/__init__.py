"""The command group `wholebody clip`."""

from __future__ import annotations

from wholebody.cli.clip import avoid, check, play
from wholebody.cli.clip.files import convert, info, retarget_motions
from wholebody.cli.command import Group

run = Group(
    "clip",
    "describe, convert and play motions",
    "Clips are postures of a figure at a fixed time step, read from files of motion capture and of wholebody.",
    (info, convert, retarget_motions, play.run, check.run, avoid.run),
)

"""The command group `wholebody clip`, one file a command."""

from __future__ import annotations

from wholebody.cli.clip import avoid, check, convert, info, play, retarget
from wholebody.cli.command import Group

run = Group(
    "clip",
    "describe, convert and play motions",
    "Clips are postures of a figure at a fixed time step, read from files of motion capture and of wholebody.",
    tuple(each.run for each in (info, convert, retarget, play, check, avoid)),
)

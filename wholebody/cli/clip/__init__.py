"""The command group `wholebody clip`, one file a command."""

from __future__ import annotations

from wholebody.cli.arguments import Commands
from wholebody.cli.clip import avoid, check, convert, info, play, retarget

HELP = "describe, convert and play motions"
DESCRIPTION = """\
Clips are postures of a figure at a fixed time step, read from files of motion capture and of wholebody."""


def add_to(commands: Commands) -> None:
    """Add the command `clip` with its own commands."""
    parser = commands.add_parser("clip", help=HELP, description=DESCRIPTION)
    kinds = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in (info, convert, retarget, play, check, avoid):
        command.add_to(kinds)

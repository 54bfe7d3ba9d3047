"""The entry point of `wholebody`: it runs a subcommand and prints errors as one sentence."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOWrapper, UnsupportedOperation
from typing import Any

from wholebody.base.errors import WholebodyError
from wholebody.cli.arguments import Parser
from wholebody.cli.commands import COMMANDS
from wholebody.version import __version__

DESCRIPTION = """\
Pose people, avatars, hands and robots among objects, in contact and without penetration.

A task file (TOML) names a figure, the things around it and the goals; `wholebody pose` finds a posture that meets the
goals and penetrates nothing, assesses it independently, and draws it. Begin with: wholebody demo"""

EXIT_CODES = """\
exit codes:
  0  done
  1  done, but the result is negative: a goal out of reach, a faulty installation
  2  the command, a task or another file is wrong; the message says what, where, and how to correct it"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    shape = argparse.RawDescriptionHelpFormatter
    top = Parser(prog="wholebody", description=DESCRIPTION, epilog=EXIT_CODES, formatter_class=shape)
    top.add_argument("--version", action="version", version=f"wholebody {__version__}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_to(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, by default the process's: the exit code, see `EXIT_CODES`; 130 after Ctrl-C."""
    try:
        if not _ready():
            return 2
        try:
            return _run(sys.argv[1:] if argv is None else list(argv))
        finally:
            sys.stdout.flush()  # what cannot be written is reported here, and not at the end of the process
    except WholebodyError as error:
        _say(str(error))
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output, such as head, has closed the pipe
        _discard_output()
        return 0
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        _say(f"the output cannot be written: {error.strerror or error}{where}")
        _discard_output()
        return 2


def _run(given: list[str]) -> int:
    arguments = parser().parse_args(given)
    _tell_progress()
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        return int(arguments.run(arguments))


def _show_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
) -> None:
    """Say a warning of the library as a sentence, without its place in Python; others as Python does."""
    _say(str(message) if category is UserWarning else warnings.formatwarning(message, category, filename, lineno, line))


def _ready() -> bool:
    """Have whatever is printed be written, in escapes where the encoding lacks a letter; whether there is a stdout."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 (for the rest of the process)
    if sys.stdout is None:
        _say("stdout is closed, so nothing can be printed; send it to a file or to /dev/null")
        return False
    with suppress(UnsupportedOperation):  # a stdout of somebody else has no file
        os.write(sys.stdout.fileno(), b"")  # tells whether it can be written, before anything is computed
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    return True


def _say(message: str) -> None:
    with suppress(OSError):
        print(f"wholebody: {message}", file=sys.stderr, flush=True)


def _discard_output() -> None:
    """Remaining output goes nowhere: Python would try again, and tell, when the process ends."""
    with suppress(OSError, ValueError):  # a stdout of somebody else has no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _tell_progress() -> None:
    """Report long steps, such as the decomposition of a mesh, to stderr; the library itself only logs them."""
    logger = logging.getLogger("wholebody")
    if not any(isinstance(handler, logging.StreamHandler) for handler in logger.handlers):
        logger.addHandler(logging.StreamHandler())
    logger.setLevel(logging.INFO)

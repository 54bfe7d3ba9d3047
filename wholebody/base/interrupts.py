"""Ctrl-C while the command `wholebody` is imported ends it without a traceback, as the system ends any other.

Libraries that are half imported make other errors of a KeyboardInterrupt, or print it.
"""

from __future__ import annotations

import signal
import sys


def end_quietly() -> None:
    """From here on Ctrl-C ends the process at once, if it is that of the command; a handler of somebody else stays."""
    if _is_command(sys.orig_argv) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def raise_again() -> None:
    """From here on Ctrl-C raises a KeyboardInterrupt, as Python has it, if `end_quietly` changed that."""
    if _is_command(sys.orig_argv) and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_command(words: list[str]) -> bool:
    """Whether a process was started by ``wholebody`` or ``python -m wholebody``, with these words."""
    rest = iter(words[1:])
    for word in rest:
        if word == "-m":
            return next(rest, "") == "wholebody"
        if word in ("-X", "-W"):
            next(rest, "")
        elif not word.startswith("-"):
            return word.replace("\\", "/").rpartition("/")[2] in ("wholebody", "wholebody.exe", "wholebody-script.py")
    return False

"""Errors that users see: each is one sentence that says what is wrong, where, and how to correct it."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

SHOWN = 80
"""Largest number of characters of a name in a message."""


def one_line(text: str, most: int = SHOWN) -> str:
    """A text as messages quote it: without line ends and unprintable characters, and no longer than `most`."""
    plain = text if text.isprintable() else text.encode("unicode_escape", "backslashreplace").decode()
    return plain if len(plain) <= most else f"{plain[: most - 3]}..."


class WholebodyError(Exception):
    """Base of every error that wholebody raises deliberately."""


class InputError(WholebodyError, ValueError):
    """A value that cannot be used: wrong type, shape, sign or range, NaN, or an impossible combination."""


class UnknownNameError(WholebodyError, KeyError):
    """An unknown name; the message lists the nearest known names."""

    def __init__(self, kind: str, name: str, known: Iterable[str], where: str = "") -> None:
        """Build the sentence.

        Args:
            kind: the kind of object, singular: "frame", "joint", "object".
            name: the unknown name.
            known: all known names.
            where: the place, such as "goal 2" or "task.toml, key goals[1].frame".
        """
        known = sorted(set(known))
        near = get_close_matches(str(name)[:SHOWN], known, n=4, cutoff=0.4) or known[:6]
        hint = f"did you mean {', '.join(map(one_line, near))}?" if near else "there are none."
        place = f"{where}: " if where else ""
        self.kind, self.name, self.known = kind, name, tuple(known)
        called = repr(name) if len(name) <= SHOWN else f"{name[:SHOWN]!r}..."
        super().__init__(f"{place}no {kind} is called {called}; {hint}")

    def __str__(self) -> str:
        """Return the sentence (KeyError would show its repr)."""
        return str(self.args[0])


class FileFormatError(WholebodyError, ValueError):
    """A file that cannot be read, with its name and the place in it."""


class MissingPackageError(WholebodyError, ImportError):
    """An optional package that the call needs, with the command that installs it."""

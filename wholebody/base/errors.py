"""Errors that users see: each is one sentence that says what is wrong, where, and how to correct it."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from difflib import SequenceMatcher
from typing import Any

SHOWN = 80  # characters of a name in a message

OFFERED = 4  # names that a message offers; of a few more, all, if none is similar

SIMILAR, ALIKE = 0.4, 0.6
"""Least similarity, 0 to 1, of a name that is offered, and of one beside which the dissimilar ones are left out."""

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|[0-9]+|[^\W_]")


def one_line(text: str, most: int = SHOWN) -> str:
    """A text as messages quote it: without line ends and unprintable characters, and no longer than `most`."""
    plain = text if text.isprintable() else text.encode("unicode_escape", "backslashreplace").decode()
    return plain if len(plain) <= most else f"{plain[: most - 3]}..."


def millimetres(length: float) -> str:
    """A length [m] in millimetres to three digits, as "1960 mm"."""
    return f"{float(f'{1e3 * length:.3g}'):g} mm"


def either(options: Iterable[str], word: str = "or") -> str:
    """Several options in words: "a", "a or b", "a, b or c"; with another word in place of "or"."""
    *others, last = options
    return f"{', '.join(others)} {word} {last}" if others else last


def suggestion(name: str, known: Collection[str]) -> str:
    """The end of a sentence about an unknown name: the names that are like it, or some of all if none is."""
    near = nearest_names(name, known)
    if not near:
        return "there are none."
    if _likeness(name, near[0]) >= SIMILAR:
        return f"did you mean {', '.join(map(one_line, near))}?"
    more = f" and {len(known) - len(near)} more" if len(known) > len(near) else ""
    return f"known: {', '.join(map(one_line, near))}{more}."


def nearest_names(name: str, known: Collection[str]) -> list[str]:
    """The known names most similar to a name, the best first; of at most six all, if none is alike."""
    # case and the order of words do not matter, and l and r are sides: `LeftHand` and `l_hand` are near `left_hand`
    scores = {one: _likeness(name, one) for one in known}
    order = sorted(scores, key=lambda one: (-scores[one], one))
    if len(order) <= OFFERED + 2 and (not order or scores[order[0]] < ALIKE):
        return order
    return [one for one in order[:OFFERED] if scores[one] >= SIMILAR] or order[: OFFERED + 2]


def _likeness(given: str, known: str) -> float:
    pairs = zip(_spellings(given[:SHOWN]), _spellings(known[:SHOWN]), strict=True)
    return max(SequenceMatcher(None, theirs, mine).ratio() for mine, theirs in pairs)


def _spellings(name: str) -> tuple[str, str]:
    """A name in lower case, and its words in the order of the alphabet."""
    words = [word.lower() for word in _WORD.findall(name)]
    return name.lower(), " ".join(sorted({"l": "left", "r": "right"}.get(word, word) for word in words))


class WholebodyError(Exception):
    """Base of every error that wholebody raises deliberately.

    Examples:
        >>> try:
        ...     wb.solve(problem, method="qpp")
        ... except wb.WholebodyError as error:
        ...     print(type(error).__name__)
        UnknownNameError
    """


class InputError(WholebodyError, ValueError):
    """A value that cannot be used: wrong type, shape, sign or range, NaN, or an impossible combination.

    Examples:
        >>> wb.Box((1.0, -1.0, 1.0))
        Traceback (most recent call last):
        wholebody.base.errors.InputError: ...
    """


class TermError(InputError):
    """A goal, constraint, bound or measure of one's own answers what cannot be used.

    Attributes:
        term: the term; None in another process.
        name: of the term, in words.
        reason: what is wrong with its answer, and how to correct it.
    """

    def __init__(self, term: object, name: str, reason: str) -> None:
        self.term, self.name, self.reason = term, name, reason
        super().__init__(f"{name}: {reason}")

    def __reduce__(self) -> tuple[Any, ...]:  # a term need not go into another process
        return type(self), (None, self.name, self.reason)


class UndefinedTermError(TermError):
    """A term of one's own has a value or derivative that is not finite at a posture; it may be at others.

    Attributes:
        q: (nq,) the posture; None where it is not known, as in another process.
    """

    WHERE = "at a posture"
    q: Any = None

    def at_posture(self, which: str) -> str:
        """The sentence, with which posture it is, such as "of iteration 3"."""
        return str(self).replace(self.WHERE, f"{self.WHERE} {which}", 1)


class UnknownNameError(WholebodyError, KeyError):
    """An unknown name; the message lists the nearest known names.

    Examples:
        >>> wb.load("humann")
        Traceback (most recent call last):
        wholebody.base.errors.UnknownNameError: ...human...
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], where: str = "") -> None:
        """Build the sentence of a kind of object and all known names; `where` is a place, such as "goal 2"."""
        known = sorted(set(known))
        place = f"{where}: " if where else ""
        self.kind, self.name, self.known, self.where = kind, name, tuple(known), where
        called = repr(name) if len(name) <= SHOWN else f"{name[:SHOWN]!r}..."
        super().__init__(f"{place}no {kind} is called {called}; {suggestion(str(name), known)}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.kind, self.name, self.known, self.where)

    def __str__(self) -> str:  # KeyError would show its repr
        return str(self.args[0])


class FileFormatError(WholebodyError, ValueError):
    """A file that cannot be read, with its name and the place in it.

    Examples:
        >>> wb.read_clip("missing.bvh", human)
        Traceback (most recent call last):
        wholebody.base.errors.FileFormatError: motion missing.bvh: there is no such file in ...
    """


class MissingPackageError(WholebodyError, ImportError):
    """An optional package that the call needs, with the command that installs it.

    Examples:
        >>> issubclass(wb.MissingPackageError, wb.WholebodyError)
        True
    """

"""Progress of long work: a function of the caller, or a line that counts in terminals and notebooks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from wholebody.base import checks


def reporter(value: Callable[..., Any] | bool | None, what: str) -> Callable[..., Any] | None:
    """The function to call with the number done and of all: a given one, a line on the error output, or None."""
    return checks.function({True: _Line(), False: None}[value] if isinstance(value, bool) else value, what)


class _Line:
    """A line that is written anew from its beginning, at most ten times a second."""

    def __init__(self) -> None:
        self._began, self._told = time.perf_counter(), 0.0

    def __call__(self, *given: Any) -> None:
        done, total = (given[0] if isinstance(given[0], tuple) else given)[:2]
        now = time.perf_counter()
        if done < total and now - self._told < 0.1:
            return
        self._told, spent = now, now - self._began
        rest = f", {spent / done * (total - done):.0f} s to go" if 0 < done < total else ""
        bar, end = "#" * int(20 * done / max(total, 1)), "\n" if done >= total else ""
        if sys.stderr is not None:
            sys.stderr.write(f"\r{bar:.<20} {done} of {total}, {spent:.0f} s{rest}   {end}")
            sys.stderr.flush()

"""Loops that numba compiles: what is compiled is kept, the first compilation is told, and what it takes is counted.

``python -m wholebody.compiled`` compiles all of them, so that no solve does.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeVar

LOOPS = (
    "wholebody.geometry.contact_rows",
    "wholebody.geometry.continuous.moved_pairs",
    "wholebody.methods.newton.linear_algebra.gram",
    "wholebody.methods.qp.active_set",
    "wholebody.methods.qp.solvers.osqp_solver",
)
"""Modules with compiled loops; each has a function `compiled_kernel`, which makes them ready."""

F = TypeVar("F", bound=Callable[..., Any])

_compiling = {"depth": 0, "since": 0.0, "seconds": 0.0}


def compiled(**options: Any) -> Callable[[F], F]:
    """Let numba compile a function at its first call, and keep the result.

    numba keeps it beside the file, or in the user's cache folder where that cannot be written to; NUMBA_CACHE_DIR names
    another folder. Where no folder can be written to, every process compiles anew.

    Args:
        options: what `numba.njit` takes.
    """
    from numba import njit

    _watch()

    def decorate(function: F) -> F:
        try:
            loop: F = njit(function, cache=True, **options)
        except RuntimeError:  # numba: cannot cache function, no locator available
            loop = njit(function, **options)
        return loop

    return decorate


def compile_all() -> None:
    """Compile all loops, or read them back where that was done before."""
    for name in LOOPS:
        import_module(name).compiled_kernel()


def compile_seconds() -> float:
    """Processor time that compiling has taken so far, in whatever solve it happened; no solve is charged for it."""
    return _compiling["seconds"]


@lru_cache(maxsize=1)
def _watch() -> None:
    """Tell of the first function that numba compiles, and count what compiling takes."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        told = False

        def on_start(self, event: Any) -> None:
            if _compiling["depth"] == 0:
                _compiling["since"] = time.thread_time()
            _compiling["depth"] += 1
            if not self.told and event.data["dispatcher"].__module__.startswith("wholebody."):
                self.told = True
                logging.getLogger(__name__).info("compiling the inner loops: half a minute, once on a machine")

        def on_end(self, event: Any) -> None:
            _compiling["depth"] -= 1
            if _compiling["depth"] == 0:
                _compiling["seconds"] += time.thread_time() - _compiling["since"]

    event.register("numba:compile", Listener())


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    compile_all()

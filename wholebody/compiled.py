"""Compilation by numba: compiled code is cached, the first compilation is logged, and its time is counted.

``python -m wholebody.compiled`` compiles all loops, so that no solve has to.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeVar

LOOPS = (
    "wholebody.dynamics.loops",
    "wholebody.geometry.contact_rows",
    "wholebody.geometry.continuous.moved_pairs",
    "wholebody.geometry.continuous.swept_depth",
    "wholebody.geometry.proximity",
    "wholebody.linearisation",
    "wholebody.methods.ccd.limbs",
    "wholebody.methods.newton.linear_algebra.normal_equations",
    "wholebody.methods.qp.active_set",
    "wholebody.methods.qp.curved_reach",
    "wholebody.methods.qp.escaping",
    "wholebody.methods.qp.solvers.osqp_solver",
    "wholebody.methods.qp.solvers.split_form",
    "wholebody.methods.qp.step_program",
    "wholebody.methods.qp.subproblem",
    "wholebody.methods.qp.turning",
)
"""Modules with compiled loops; each has a function `compiled_kernel`, which compiles or loads them."""

F = TypeVar("F", bound=Callable[..., Any])

_compiling = {"depth": 0, "since": 0.0, "seconds": 0.0}


def compiled(**options: Any) -> Callable[[F], F]:
    """Let numba compile a function at its first call, and cache the result.

    The cache is beside the file, or in the user's cache folder if that is not writable; NUMBA_CACHE_DIR names another
    folder. If no folder is writable, every process compiles anew.

    Args:
        options: what `numba.njit` takes, such as error_model and fastmath.
    """
    loop_type = _loop_type()
    _watch()

    def decorate(function: F) -> F:
        loop: F = loop_type(function, targetoptions={"nopython": True, "boundscheck": None, **options})
        with suppress(RuntimeError):  # numba: cannot cache function, no locator available
            loop.enable_caching()  # type: ignore[attr-defined]
        return loop

    return decorate


def compile_all() -> None:
    """Compile all loops, or load them from the cache."""
    for name in LOOPS:
        import_module(name).compiled_kernel()


def compile_seconds() -> float:
    """Processor time of all compilation so far, seconds; time limits of solves do not count it."""
    return _compiling["seconds"]


@lru_cache(maxsize=1)
def _loop_type() -> Any:
    """A compiled function of numba, read back from what is kept without all that compiling needs.

    numba loads its tables of types and functions first, which takes 0.4 of 0.5 s. What compiles loads them by itself.
    """
    from numba.core.caching import FunctionCache
    from numba.core.registry import CPUDispatcher
    from numba.core.runtime import rtsys

    class Kept(FunctionCache):  # type: ignore[misc]
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            rtsys.initialize(target_context)
            return self._load_overload(sig, target_context)

    class Loop(CPUDispatcher):  # type: ignore[misc]
        def enable_caching(self) -> None:
            self._cache = Kept(self.py_func)

    return Loop


@lru_cache(maxsize=1)
def _watch() -> None:
    """Log the first compilation, and count the time of all."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        told = False

        def on_start(self, event: Any) -> None:
            if _compiling["depth"] == 0:
                _compiling["since"] = time.thread_time()
            _compiling["depth"] += 1
            if not self.told and event.data["dispatcher"].__module__.startswith("wholebody."):
                self.told = True
                logging.getLogger(__name__).info("compiling the inner loops: a minute or two, once on a machine")

        def on_end(self, event: Any) -> None:
            _compiling["depth"] -= 1
            if _compiling["depth"] == 0:
                _compiling["seconds"] += time.thread_time() - _compiling["since"]

    event.register("numba:compile", Listener())


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    compile_all()

"""Compilation by numba, cached, logged and timed; ``python -m wholebody.base.compiled`` compiles all loops."""

from __future__ import annotations

import atexit
import gc
import hashlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from importlib import import_module
from itertools import zip_longest
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, TypeVar

from wholebody.base.call_types import known_call_type

TOGETHER = (
    ("wholebody.terms.linearisation", "wholebody.terms.seldom_kernel", "wholebody.methods.qp.plain_chain"),
    (
        "wholebody.methods.qp.active_set",
        "wholebody.methods.qp.step_program",
        "wholebody.methods.qp.subproblem",
    ),
    ("wholebody.dynamics.step_program",),
    (
        "wholebody.geometry.contact_rows",
        "wholebody.geometry.proximity",
        "wholebody.geometry.continuous.kept_apart",
        "wholebody.geometry.continuous.moved_pairs",
        "wholebody.geometry.continuous.swept_depth",
        "wholebody.dynamics.impulse_kernel",
        "wholebody.methods.ccd.limbs",
        "wholebody.methods.ccd.sweep",
        "wholebody.methods.ccd.guard_kernel",
        "wholebody.methods.newton.linear_algebra",
        "wholebody.motion.trajectory.banded_kernel",
        "wholebody.planning.projection_kernel",
    ),
    (
        "wholebody.methods.qp.tracking",
        "wholebody.methods.qp.turning",
    ),
)
"""Modules with compiled loops, in groups that call no loops of each other, those first that take longest to compile.

Each module has a function `compiled_kernel`, which compiles or loads its loops.
"""

BESIDE = {
    "wholebody.methods.qp.subproblem": "wholebody.methods.qp.subproblem_kernel",
    "wholebody.terms.linearisation": "wholebody.terms.kernel",
}
"""Modules of `TOGETHER` that a first solve needs last, half of all that it compiles, and where their loops are."""

SHARED = "wholebody.geometry.contact_rows"
"""A module whose loops those call last: this process compiles them early, and the other one finds them."""

LOOPS = tuple(name for names in TOGETHER for name in names)

PRECOMPILED = Path(__file__).with_name("precompiled")
"""Folder of a wheel with loops that the maker's numba and Python compiled for the processor `BASELINE`."""

BASELINE = ("x86-64-v3", "")  # LLVM's name of a processor with AVX2, and no more features than it has

BASELINE_FEATURES = frozenset(("+avx", "+avx2", "+bmi", "+bmi2", "+f16c", "+fma", "+lzcnt", "+movbe"))
"""What a processor must have to run code for `BASELINE`."""

F = TypeVar("F", bound=Callable[..., Any])

_compiling = {"depth": 0, "collects": True, "alone": False, "shared": False}
_since, _seconds = {"thread_time": 0.0, "monotonic": 0.0}, {"thread_time": 0.0, "monotonic": 0.0}
_beside: list[subprocess.Popen[bytes]] = []


def compiled(*, inner: bool = False, **options: Any) -> Callable[[F], F]:
    """Let numba compile a function at its first call, with the options of `numba.njit`, and cache the result.

    The cache is beside the file, or in the user's cache folder if that is not writable; NUMBA_CACHE_DIR names another
    folder. If no folder is writable, every process compiles anew. A function that only compiled functions call,
    `inner`, is compiled sooner, and calling it from Python raises a TypeError.
    """
    loop_type = _inner_type() if inner else _loop_type()
    _watch()

    def decorate(function: F) -> F:
        target = {
            "nopython": True,
            "boundscheck": None,
            "no_cfunc_wrapper": True,
            "no_cpython_wrapper": inner,
            **options,
        }
        loop: F = loop_type(function, targetoptions=target)
        if inner and function.__name__.startswith("_"):
            return loop  # kept as a part of its callers, which are in the same module
        with suppress(RuntimeError):  # numba: cannot cache function, no locator available
            loop.enable_caching()  # type: ignore[attr-defined]
        return loop

    return decorate


def with_loops(name: str) -> Callable[[Callable[[Any], None]], Callable[[], Any]]:
    """Of a function that calls a module's loops with small arguments: its first call compiles or reads them."""

    def decorate(call: Callable[[Any], None]) -> Callable[[], Any]:
        @lru_cache(maxsize=1)
        def module() -> Any:
            found = import_module(name)
            call(found)
            return found

        return module

    return decorate


def compile_all(names: Sequence[str] = LOOPS) -> None:
    """Compile all loops of these modules, or load them from the cache."""
    for name in names:
        import_module(name).compiled_kernel()


def compile_in_processes(processes: int, groups: Sequence[Sequence[str]] = TOGETHER) -> None:
    """Compile groups of modules in parallel processes unless they are cached; this process compiles the others."""
    if processes > 1:
        from concurrent.futures import ProcessPoolExecutor
        from concurrent.futures.process import BrokenProcessPool
        from multiprocessing import get_context

        logging.getLogger(__name__).info("compiling the inner loops in %d processes, unless they are kept", processes)
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
            tasks = []
            with suppress(BrokenProcessPool):
                tasks += [pool.submit(compile_all, names) for names in groups]
        groups = [names for names, task in zip_longest(groups, tasks) if task is None or task.exception() is not None]
    for names in groups:
        compile_all(names)


def compile_beside() -> None:
    """Let another process compile what is needed last, unless there is one core or this process is itself another's."""
    if _compiling["alone"] or usable_cores() < 2 or parent_process() is not None:
        return
    with suppress(OSError):  # no process may be started here
        nothing = subprocess.DEVNULL
        child = subprocess.Popen(
            [sys.executable, "-m", __name__, *BESIDE], stdin=nothing, stdout=nothing, stderr=nothing
        )
        _beside.append(child)
        atexit.register(child.kill)


def compile_alone() -> None:
    """Start no process beside this one, whose work it is to compile."""
    _compiling["alone"] = True


def precompile() -> None:
    """Compile all loops for `BASELINE` and write them to `PRECOMPILED`, for a wheel."""
    with tempfile.TemporaryDirectory() as kept:
        target = {"NUMBA_CPU_NAME": BASELINE[0], "NUMBA_CPU_FEATURES": BASELINE[1], "NUMBA_CACHE_DIR": kept}
        command = [sys.executable, "-m", __name__]
        for more in ([], ["--collect"]):
            subprocess.run([*command, *more], env={**os.environ, **target}, check=True)


def collect_precompiled() -> None:
    """Write what Python calls of the loops in the cache to `PRECOMPILED`."""
    shutil.rmtree(PRECOMPILED, ignore_errors=True)
    PRECOMPILED.mkdir()
    compile_all()
    modules = [module for name, module in sys.modules.items() if name.startswith("wholebody.")]
    loops = {loop for module in modules for loop in vars(module).values() if isinstance(loop, _loop_type())}
    for loop in loops:
        loop.copy_kept()


def usable_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compile_seconds(clock: str = "thread_time") -> float:
    """Time of all compilation so far by a clock, "thread_time" or "monotonic"; times of solves are without it."""
    return _seconds[clock]


@lru_cache(maxsize=1)
def _cache_type() -> Any:
    """What is kept of a compiled function, beside its module or in a wheel; what cannot be read counts as nothing."""
    from numba.core.caching import FunctionCache, IndexDataCacheFile
    from numba.core.runtime import rtsys

    class Kept(FunctionCache):  # type: ignore[misc]
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            rtsys.initialize(target_context)
            try:
                found = self._load_overload(sig, target_context)
                return self._load_precompiled(sig, target_context) if found is None else found
            except Exception as error:  # cut short or unreadable, pickle raises anything: as if nothing were kept
                logging.getLogger(__name__).info("%s: what was kept of it cannot be read (%s)", self._name, error)
                with suppress(OSError):
                    self.flush()
                return None

        def holds(self, sig: Any, target_context: Any) -> bool:
            """Whether it is kept; while there is no file, this takes a thousandth of the time of trying to read it."""
            index = Path(self.cache_path, f"{self._impl.filename_base}.nbi")
            return index.is_file() and self.load_overload(sig, target_context) is not None

        def save_overload(self, sig: Any, data: Any) -> None:
            with suppress(Exception):  # a folder that is full or read-only: the next process compiles anew
                self._save_overload(sig, data)

        def _load_precompiled(self, sig: Any, target_context: Any) -> Any:
            """What a wheel has of it, if the source is the same and this processor can run it."""
            if not PRECOMPILED.is_dir():
                return None
            sig, (system, _, features), code = self._index_key(sig, target_context.codegen())
            if not set(features.split(",")) >= BASELINE_FEATURES:
                return None
            data = self._precompiled().load((sig, (system, *BASELINE), code))
            return None if data is None else self._impl.rebuild(target_context, data)

        def _precompiled(self) -> Any:
            """Its file in `PRECOMPILED`, valid for the same text of the module; times of files differ."""
            name = f"{self._py_func.__module__}.{self._impl.filename_base}"
            text = Path(self._py_func.__code__.co_filename).read_bytes()
            return IndexDataCacheFile(str(PRECOMPILED), name, hashlib.sha256(text).digest())

        def copy(self, sig: Any, codegen: Any) -> None:
            """Copy what is kept of one signature to `PRECOMPILED`."""
            key = self._index_key(sig, codegen)
            self._precompiled().save(key, self._cache_file.load(key))

    return Kept


@lru_cache(maxsize=1)
def _loop_type() -> Any:
    """A compiled function of numba, read back from what is kept without all that compiling needs (0.4 of 0.5 s)."""
    from numba.core import event
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import CPUDispatcher, cpu_target
    from numba.core.runtime.context import NRTContext
    from numba.core.types.functions import BaseFunction
    from numba.core.types.misc import unliteral

    def counted(nrt: Any, builder: Any, kind: Any, value: Any) -> Any:
        """What numba counts the references of in a value. Its own code also reads the six other parts of each array."""
        models = cpu_target.target_context.data_model_manager
        model = models[kind]
        found = [(kind, model.get_nrt_meminfo(builder, value))] if model.has_nrt_meminfo() else []
        for inner, part in model.traverse(builder):
            if models[inner].contains_nrt_meminfo():
                found += counted(nrt, builder, inner, part(value))
        return found

    class Library(JITCodeLibrary):  # type: ignore[misc]
        @classmethod
        def read(cls, codegen: Any, kept: Any) -> Any:
            return cls._unserialize(codegen, kept)

    class Loop(CPUDispatcher):  # type: ignore[misc]
        code_type = Library

        def enable_caching(self) -> None:
            self._cache = _cache_type()(self.py_func)

        def copy_kept(self) -> None:
            for sig in self.overloads:
                self._cache.copy(sig, self.targetctx.codegen())

        def compile(self, sig: Any) -> Any:
            if _beside and self.__module__ in BESIDE.values() and isinstance(self._cache, _cache_type()):
                # another process compiles it; reading its cache is faster than compiling it here too
                with event.trigger_event("numba:compile", data={"dispatcher": self}):
                    while _beside[0].poll() is None and not self._cache.holds(sig, self.targetctx):
                        time.sleep(0.05)
            with global_compiler_lock:
                codegen = self.targetctx.codegen()
                outer = codegen.create_library, codegen.unserialize_library, NRTContext.get_meminfos
                looked_up = BaseFunction.get_call_type
                codegen.create_library = partial(self.code_type, codegen)
                codegen.unserialize_library = partial(self.code_type.read, codegen)
                NRTContext.get_meminfos = counted
                BaseFunction.get_call_type = known_call_type()  # type: ignore[method-assign]
                try:
                    return super().compile(sig)
                finally:
                    codegen.create_library, codegen.unserialize_library, NRTContext.get_meminfos = outer
                    BaseFunction.get_call_type = looked_up  # type: ignore[method-assign]

        def get_call_template(self, args: Any, kws: Any) -> Any:
            args = tuple(unliteral(kind) for kind in args)
            return super().get_call_template(args, {name: unliteral(kind) for name, kind in kws.items()})

    return Loop


@lru_cache(maxsize=1)
def _inner_type() -> Any:
    """A compiled function that Python cannot call; its code is optimised in its callers alone."""

    class Unlinked(_loop_type().code_type):  # type: ignore[misc]
        """Code for LLVM to put into that of callers."""

        codegen = property(lambda self: self)

        def set_env(self, name: str, env: Any) -> None:
            """There is no code whose environment this could be."""

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            return 0

        def serialize_using_object_code(self) -> Any:
            return self.serialize_using_bitcode()

        def _optimize_functions(self, module: Any) -> None:
            module.data_layout = str(self._codegen.target_data)

        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            self._finalized = True

    class Inner(_loop_type()):  # type: ignore[misc]
        code_type = Unlinked

        def __call__(self, *args: Any, **named: Any) -> Any:
            raise TypeError(f"{self.py_func.__name__} is compiled for calls from compiled functions only")

    return Inner


@lru_cache(maxsize=1)
def _watch() -> None:
    """Log the first compilation, count the time of all, and let none be stopped by the garbage collector."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        reported = False

        def on_start(self, event: Any) -> None:
            if _compiling["depth"] == 0:
                _since.update((clock, getattr(time, clock)()) for clock in _since)
                _compiling["collects"] = gc.isenabled()
                gc.disable()  # numba makes millions of objects that stay: to look through them is an eighth of the time
            _compiling["depth"] += 1
            if not self.reported and event.data["dispatcher"].__module__.startswith("wholebody."):
                self.reported = True
                logging.getLogger(__name__).info("compiling the inner loops: up to a minute, once on a machine")
                compile_beside()

        def on_end(self, event: Any) -> None:
            _compiling["depth"] -= 1
            if _compiling["depth"] == 0:
                _seconds.update((clock, _seconds[clock] + getattr(time, clock)() - _since[clock]) for clock in _since)
                if _compiling["collects"]:
                    gc.enable()
                if _beside and not _compiling["shared"]:
                    _compiling["shared"] = True
                    with suppress(ImportError):  # this module may be used without the others
                        import_module(SHARED).compiled_kernel()

    event.register("numba:compile", Listener())


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    shared = import_module("wholebody.base.compiled")  # which the loops know; this module is another one
    shared.compile_alone()
    if sys.argv[1:] == ["--precompile"]:
        shared.precompile()
    elif sys.argv[1:] == ["--collect"]:
        shared.collect_precompiled()
    elif sys.argv[1:]:
        shared.compile_all(sys.argv[1:])
    else:
        shared.compile_in_processes(min(usable_cores(), len(TOGETHER)))

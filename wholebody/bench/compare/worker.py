"""The parent's side of the process in which methods run: it is started anew whenever a method brought it down."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import IO, Any

import wholebody
from wholebody.bench.compare.messages import Build, Draw, Solve, Warm, receive, send
from wholebody.errors import WholebodyError

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Set to 1 in the process, so that methods are compared on one core each."""

ORPHANED = 1.0  # s: how often a process looks whether its parent is still there
FULL = 2e9  # bytes: a process that holds more is started anew; placo's robots stay in memory (some 6 MB each) for ever

_local = threading.local()


class EndedError(WholebodyError):
    """The process in which a method ran has ended.

    Attributes:
        overtime: whether because the method took too long.
    """

    def __init__(self, message: str, overtime: bool) -> None:
        """Keep why."""
        super().__init__(message)
        self.overtime = overtime


class Worker:
    """One process for one case at a time."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._built: Build | None = None
        self._hopeless: set[str] = set()  # methods that ended the process while they were warmed up

    def build(self, request: Build) -> str | None:
        """Build a case, in a new process where this one holds more memory than `FULL`; return what went wrong, if any.

        Raises:
            EndedError: the process has ended over it.
        """
        if self._process is not None and _memory(self._process.pid) > FULL:
            self.close()
        self._built = request
        answer: str | None = self._ask(request)
        return answer

    def warm(self, request: Warm) -> None:
        """Let a method import and compile what it needs. What goes wrong over it will do so again in its solve."""
        if request.entrant.name in self._hopeless:
            return
        self._rebuild()
        try:
            self._ask(request)
        except EndedError:
            self._hopeless.add(request.entrant.name)

    def solve(self, request: Solve) -> Any:
        """Solve the case that was built last.

        Raises:
            EndedError: the process has ended over it; the next call starts another.
        """
        self._rebuild()
        return self._ask(request)

    def draw(self, request: Draw) -> str:
        """Draw two answers to the case that was built last; return a page.

        Raises:
            EndedError: the process has ended over it.
        """
        page: str = self._ask(request)
        return page

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout, self._errors):
                if stream is not None:
                    stream.close()
        self._process = self._errors = None

    def _rebuild(self) -> None:
        if self._process is None and self._built is not None:
            self._ask(self._built)

    def _ask(self, request: Build | Warm | Solve | Draw) -> Any:
        process = self._process or self._start()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            send(process.stdin, dumps(request))
            answer = receive(process.stdout)
        except BrokenPipeError:
            answer = None
        if answer is None:
            raise self._ended(process)
        return pickle.loads(answer)

    def _start(self) -> subprocess.Popen[bytes]:
        home = str(Path(wholebody.__file__).parents[1])
        paths = os.pathsep.join(path for path in (home, os.environ.get("PYTHONPATH", "")) if path)
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "wholebody.bench.compare.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=os.environ | {"PYTHONPATH": paths} | dict.fromkeys(THREADS, "1"),
        )
        return self._process

    def _ended(self, process: subprocess.Popen[bytes]) -> EndedError:
        code = process.wait()
        said = ""
        if self._errors is not None:
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", errors="replace").strip().splitlines()
            said = f": {lines[-1].strip()[:200]}" if lines else ""
        self.close()
        if code == -signal.SIGALRM:
            return EndedError("ended because it took too long", overtime=True)
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return EndedError(f"the process ended with {how}{said}", overtime=False)


def _memory(process: int) -> float:
    """Return the bytes of memory that a process holds; 0 where the system does not say."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def own_worker() -> Worker:
    """The worker of this thread; it lives as long as the thread's process."""
    if not hasattr(_local, "worker"):
        _local.worker = Worker()
        if multiprocessing.current_process().name.startswith("LokyProcess"):
            threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    worker: Worker = _local.worker
    return worker


def _end_with(parent: int) -> None:
    """End this process, and with it its worker, when its parent was killed; joblib's would wait for minutes."""
    while os.getppid() == parent:
        time.sleep(ORPHANED)
    os._exit(1)


def dumps(value: Any) -> bytes:
    """Pickle, what is not importable by its code."""
    import cloudpickle

    pickled: bytes = cloudpickle.dumps(value)
    return pickled

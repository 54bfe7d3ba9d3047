"""Jobs in child processes: a job that crashes, hangs or fills the memory ends only its own process.

An alarm of the system, which compiled code cannot block, ends the process at a job's deadline, which the job may move
(`allow`); it may send notes before its answer (`tell`). A process ends by itself when its parent has ended.
"""

from __future__ import annotations

import os
import pickle
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from os import _exit
from pathlib import Path
from typing import IO, Any, NamedTuple

from wholebody.base.errors import WholebodyError

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Environment of a process whose libraries compute on one core."""

FULL = 2e9  # bytes: a process that holds more should be replaced; placo never frees a robot (some 6 MB)
BY_THE_CLOCK = 10.0  # a deadline by the clock in units of that of the processor: others use the machine too

_START = (
    "import sys; sys.path[:] = [{root!r}, *filter(None, {path!r})]; from wholebody.base.runner import serve; "
    "sys.path[:] = {path!r} + [{root!r}]; serve({descriptor}, {parent})"
)
"""The code of a new interpreter: it imports our package first, and then searches where its parent does."""

_parent: Connection | None = None  # in a process that serves jobs: the connection to the parent


class EndedError(WholebodyError):
    """The process of a job has ended before its answer.

    Attributes:
        overtime: whether the deadline ended it.
        code: its exit code; the negative number of the signal that ended it.
        said: the last line that it wrote; "" if it wrote none.
    """

    def __init__(self, code: int, said: str = "") -> None:
        self.overtime, self.code, self.said = -code in (signal.SIGALRM, signal.SIGPROF), code, said
        message = "it took too long" if self.overtime else f"the process ended with {self.how}"
        super().__init__(message + (f": {said}" if said and not self.overtime else ""))

    @property
    def how(self) -> str:
        """The exit code or the signal, in words."""
        return signal.Signals(-self.code).name if self.code < 0 else f"exit code {self.code}"


class Job(NamedTuple):
    """A job for a child process."""

    name: Any  # any value by which the caller identifies the job; it is not sent to the process
    function: Callable[..., Any]  # called in the process with the arguments
    arguments: tuple[Any, ...]  # of the function
    seconds: float  # time to the deadline, unless the job moves it; 0 for none


class Outcome(NamedTuple):
    """A job's outcome: notes that it sent, and what the function returned or, where its process ended, the `error`."""

    job: Job
    notes: tuple[Any, ...]
    answer: Any
    error: EndedError | None


class Started(NamedTuple):
    """A process that reads jobs, the connection over which it gets them and answers, and what it writes."""

    process: subprocess.Popen[bytes]
    connection: Connection
    output: IO[bytes]


class Child:
    """A child process that does one job at a time; a new one replaces it when it has ended."""

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[bytes] | None = None
        self._output: IO[bytes] | None = None
        self._connection: Connection | None = None
        self.job: Job | None = None  # that it does; None if it is idle
        self._notes: list[Any] = []

    @property
    def process(self) -> int | None:
        """Id of the process; None if none runs."""
        return None if self._process is None else self._process.pid

    @property
    def connection(self) -> Connection:
        """The connection that becomes readable when a job sent something; see `multiprocessing.connection.wait`."""
        assert self._connection is not None
        return self._connection

    def call(self, function: Callable[..., Any], *arguments: Any, seconds: float) -> Any:
        """Do a job, and wait for its answer; an `EndedError` if the process ended: the next call starts another."""
        self.begin(Job(None, function, arguments, seconds))
        while (outcome := self.listen()) is None:
            pass
        if outcome.error is not None:
            raise outcome.error
        return outcome.answer

    def begin(self, job: Job) -> None:
        """Send a job; `listen` returns its outcome."""
        self.job, self._notes = job, []
        if self._process is None:
            self._process, self._connection, self._output = start_process(os.environ | self._environment)
        try:
            self.connection.send((job.seconds, packed((job.function, job.arguments))))
        except (BrokenPipeError, ConnectionResetError):
            return  # the process ended after its last job: `listen` reports it

    def listen(self) -> Outcome | None:
        """Wait for the next message of a job: its outcome, or None after a note."""
        assert self.job is not None
        try:
            last, value = self.connection.recv()
        except (EOFError, ConnectionResetError):
            job, error = self.job, self._ended()
            return Outcome(job, tuple(self._notes), None, error)
        if not last:
            self._notes.append(value)
            return None
        job, self.job = self.job, None
        return Outcome(job, tuple(self._notes), value, None)

    def close_if_full(self) -> None:
        """End an idle process that holds more memory than `FULL`; the next job starts another."""
        if self._process is not None and _memory(self._process.pid) > FULL:
            self.close()

    def close(self) -> None:
        """Kill the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        for stream in (self._connection, self._output):
            if stream is not None:
                stream.close()
        self._process = self._output = self._connection = self.job = None

    def _ended(self) -> EndedError:
        assert self._process is not None
        assert self._output is not None
        code = self._process.wait()
        self._output.seek(0)
        lines = self._output.read().decode("utf-8", errors="replace").strip().splitlines()
        said = lines[-1].strip()[:200] if lines else ""  # most characters kept of the last line that a process wrote
        self.close()
        return EndedError(code, said)


def start_process(environment: Mapping[str, str]) -> Started:
    """Start an interpreter that reads jobs, with these variables and no others; it ignores Ctrl-C."""
    import wholebody

    ours, theirs = socket.socketpair()
    root, path = str(Path(wholebody.__file__).parents[1]), [str(folder) for folder in sys.path]
    output = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
    with theirs, interrupt_ignored():
        process = subprocess.Popen(
            [sys.executable, "-c", _START.format(root=root, path=path, descriptor=theirs.fileno(), parent=os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            pass_fds=[theirs.fileno()],
            env=environment,
        )
    return Started(process, Connection(ours.detach()), output)


@contextmanager
def interrupt_ignored() -> Iterator[None]:
    """Ignore Ctrl-C meanwhile: processes that begin now ignore it for good. Only the main thread hears Ctrl-C."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if handler is None else handler)


def run_jobs(next_job: Callable[[], Job | None], children: Sequence[Child]) -> Iterator[Outcome]:
    """Run jobs, each in one of the children, and yield outcomes as they end; `next_job` returns None for none."""
    free, busy = list(children), list[Child]()
    try:
        while True:
            while free and (job := next_job()) is not None:
                busy.append(free.pop())
                busy[-1].begin(job)
            if not busy:
                return
            ready = wait([child.connection for child in busy])
            for child in [child for child in busy if child.connection in ready]:
                outcome = child.listen()
                if outcome is not None:
                    busy.remove(child)
                    free.append(child)
                    yield outcome
    finally:
        for child in busy:
            child.close()


def allow(seconds: float, processor: float = 0.0) -> None:
    """Move the deadline of the running job to so many seconds from now, by the clock and the processor; 0 for none."""
    if _parent is not None:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        signal.setitimer(signal.ITIMER_PROF, processor)


def allow_processor(seconds: float) -> None:
    """Move the deadline to so many seconds of the processor's, by the clock `BY_THE_CLOCK` times as many."""
    allow(BY_THE_CLOCK * seconds, seconds)


def processor_time() -> float:
    """Processor's time of this process, seconds; `time.process_time` ticks by 4 ms while a deadline runs."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def tell(note: Any) -> None:
    """Send a note from the running job to its parent; does nothing outside a job."""
    if _parent is not None:
        _parent.send((False, note))


def end_with(parent: int) -> None:
    """End this process when its parent, a process id, has ended or had ended before this call."""
    threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)  # s: how often a process looks whether its parent is still there
    _exit(1)


def serve(descriptor: int, parent: int) -> None:
    """Do jobs until the parent, a process id, has ended; the main loop of a process of `Child`."""
    global _parent
    _parent = Connection(descriptor)
    for alarm in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(alarm, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)
    try:
        while True:
            seconds, sent = _parent.recv()
            allow(seconds)
            function, arguments = pickle.loads(sent)
            answer = function(*arguments)
            allow(0.0)
            _parent.send((True, answer))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _memory(process: int | None) -> float:
    """Return the bytes of memory that a process holds; 0 if the system does not report it."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def packed(value: Any) -> bytes:
    """Pickle by cloudpickle, which includes code that is not importable."""
    import cloudpickle

    made: bytes = cloudpickle.dumps(value)
    return made

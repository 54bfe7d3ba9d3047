"""Many jobs in parallel: in child processes, which are kept from call to call, or on a dask cluster."""

from __future__ import annotations

import atexit
import multiprocessing
import os
import shutil
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from multiprocessing.connection import wait
from typing import Any, NamedTuple, TypedDict, TypeVar

from wholebody.base import checks
from wholebody.base.arrays import with_values
from wholebody.base.errors import InputError, MissingPackageError, WholebodyError, one_line
from wholebody.base.runner import ONE_THREAD, Child, EndedError, Job, Outcome, end_with, interrupt_ignored, run_jobs
from wholebody.version import __version__

T = TypeVar("T")

_Sent = tuple[int, Callable[..., Any], tuple[Any, ...], float]
"""A job as it is sent: its number, its function with the arguments, and its seconds."""


def run_batch(work: Iterable[Job], jobs: int = 1, cluster: str | None = None) -> Iterator[Outcome]:
    """Request jobs one by one, run them in parallel, and yield their outcomes as they end.

    `cluster` is the address of a dask scheduler, else processes of this machine, which compute on one core each.
    Closing the iterator ends running jobs. MissingPackageError without dask, WholebodyError without an answer.
    """
    asked = iter(work)
    if cluster is None:
        with _children(jobs) as found:
            for child in found:
                if child.job is not None:  # it still gets ready for other work
                    child.close()
                child.close_if_full()
            yield from run_jobs(lambda: next(asked, None), found)
        return
    begun: dict[int, Job] = {}

    def sent() -> Iterator[_Sent]:
        for number, job in enumerate(asked):
            begun[number] = job
            yield number, job.function, job.arguments, job.seconds

    for number, answer, ended in spread(_in_own_child, sent(), jobs, cluster):
        yield Outcome(begun.pop(number), (), answer, None if ended is None else EndedError(*ended))


def shared(
    items: Sequence[T], jobs: int, here: Callable[[T], Any], there: Callable[[list[T], bool], Job]
) -> Iterator[tuple[T, Any, EndedError | None]]:
    """Do work in this process, `here` an item, and in `jobs - 1` others by jobs of `there`; answers or errors."""
    # `there` gives None where the process lacks something, and is asked again with True
    left, alone = deque(items), deque[T]()  # items whose process ended are done again, one by one
    with _children(min(jobs, len(items)) - 1) as others:
        for child in others:
            child.close_if_full()
            if child.process is None:
                child.begin(with_values(there([left[0]], True), name=_ready))
        while left or alone or any(map(_works, others)):
            for child in others:
                if child.job is None and (alone or left):
                    # its share of the remaining items: it waits for the next while this process is busy with an item
                    count = max(1, min(64, len(left) // jobs))
                    chunk = [alone.popleft()] if alone else [left.popleft() for _ in range(count)]
                    child.begin(there(chunk, False))
            if left:
                item = left.popleft()
                yield item, here(item), None
            if not others:
                continue
            busy = {child.connection: child for child in others if child.job is not None}
            for connection in wait(busy, 0.0 if left or not any(map(_works, others)) else None):
                child = busy[connection]  # type: ignore[index]
                outcome = child.listen()
                if outcome is None or outcome.job.name is _ready:
                    continue
                chunk = outcome.job.name
                if outcome.error is not None and len(chunk) > 1:
                    alone.extend(chunk)
                elif outcome.error is not None:
                    yield chunk[0], None, outcome.error
                elif outcome.answer is None:
                    child.begin(there(chunk, True))
                else:
                    yield from ((item, answer, None) for item, answer in zip(chunk, outcome.answer, strict=True))


_ready = object()  # name of a job by which a process gets ready

_idle: dict[int, list[Child]] = {}
"""Processes that are kept for the next call, by the id of the process that began them: a fork has its own."""

_own: dict[tuple[int, int], Child] = {}
"""The child process of each thread, by the ids of the process and of the thread that began it."""


def _works(child: Child) -> bool:
    """Whether a process does a job that is waited for."""
    return child.job is not None and child.job.name is not _ready


@contextmanager
def _children(count: int) -> Iterator[list[Child]]:
    """Processes, kept ones first; those that are busy with work at the end are ended."""
    idle, found = _idle.setdefault(os.getpid(), []), list[Child]()
    for _ in range(count):
        try:
            found.append(idle.pop())
        except IndexError:
            found.append(Child(ONE_THREAD))
    try:
        yield found
    finally:
        for child in found:
            if _works(child):
                child.close()
        idle.extend(found)


def spread(
    function: Callable[[Any], Any], arguments: Iterable[Any], jobs: int, cluster: str | None = None
) -> Iterator[Any]:
    """Call a function with each argument in `jobs` processes, or threads of a cluster; answers come as they end."""
    import joblib

    try:
        with ExitStack() as stack:
            if cluster is not None:
                stack.enter_context(_client(cluster))
                stack.enter_context(joblib.parallel_config(backend="dask"))
            parallel = joblib.Parallel(
                n_jobs=jobs, return_as="generator_unordered", batch_size=1, pre_dispatch=jobs + 1
            )  # fmt: skip
            with interrupt_ignored():
                answers = parallel(joblib.delayed(function)(argument) for argument in arguments)
            try:
                yield from answers
            finally:
                answers.close()
    finally:
        own_child().close()  # which does the jobs where there is one at a time


def own_child() -> Child:
    """The child process of this thread; it lives as long as this process, or until `close_children`."""
    key = os.getpid(), threading.get_ident()
    if key not in _own:
        _own[key] = Child(ONE_THREAD)
        parent, name = multiprocessing.parent_process(), multiprocessing.current_process().name
        if parent is not None and name.startswith("LokyProcess"):
            end_with(int(parent.pid or 0))  # joblib's process would wait for minutes
    return _own[key]


@atexit.register
def close_children() -> None:
    """End the processes that this process keeps for the next call."""
    for child in [*_idle.get(os.getpid(), []), *(one for key, one in _own.items() if key[0] == os.getpid())]:
        child.close()


def _in_own_child(sent: _Sent) -> tuple[int, Any, tuple[int, str] | None]:
    """Do a job; its number, its answer, and the exit code and the last line of a process that ended over it."""
    number, function, arguments, seconds = sent
    child = own_child()
    child.close_if_full()
    try:
        return number, child.call(function, *arguments, seconds=seconds), None
    except EndedError as error:
        return number, None, (error.code, error.said)


def fingerprint(*asked: Any) -> str:
    """Fingerprint of a request; InputError if it cannot be sent to another process."""
    import joblib

    try:
        return str(joblib.hash((*asked, __version__)))
    except Exception as error:  # whatever an object of the user's own raises
        raise InputError(f"what is given cannot be sent to another process ({one_line(str(error))})") from None


def threads(cluster: str) -> int:
    """How many jobs a cluster does at a time; raises as `run_batch`, also where the cluster has no workers."""
    with _client(cluster) as client:
        found = sum(client.nthreads().values())
    if not found:
        raise WholebodyError(f"the dask scheduler at {cluster} has no workers; start some: dask worker {cluster}")
    return int(found)


def _client(address: str) -> AbstractContextManager[Any]:
    try:
        from distributed import Client
    except ImportError:
        raise MissingPackageError("--cluster needs dask; install it with: pip install 'wholebody[cluster]'") from None

    class Closed(Client):  # type: ignore[misc]
        """A client that closes itself where it cannot start: else it would block the start of the next one."""

        def start(self, **options: Any) -> None:
            try:
                super().start(**options)
            except BaseException:
                self.close()
                raise

    connect: Callable[..., AbstractContextManager[Any]] = Closed
    try:
        return connect(address, timeout=10.0)  # s: for which a scheduler is waited for
    except (OSError, TypeError, ValueError) as error:
        raise WholebodyError(f"no dask scheduler answers at {address} ({error}); start one: dask scheduler") from None


class JobOptions(TypedDict, total=False):
    """How the jobs of a call are run, as its keyword arguments; `Jobs.checked` checks them."""

    jobs: int
    cluster: str | None
    progress: Callable[..., Any] | bool | None


class Jobs(NamedTuple):
    """How many jobs at a time, on which cluster, and what is called with how many are done."""

    jobs: int
    cluster: str | None
    tell: Callable[..., Any] | None

    @classmethod
    def checked(cls, what: str, jobs: object = 1, cluster: object = None, progress: Any = None) -> Jobs:
        """Check the keyword arguments of a function `what`."""
        return cls(
            checks.whole(jobs, f"{what}: jobs", 1, 4096),
            None if cluster is None else checks.text(cluster, f"{what}: cluster"),
            reporter(progress, f"{what}: progress"),
        )


def reporter(value: Callable[..., Any] | bool | None, what: str) -> Callable[..., Any] | None:
    """The function to call with the numbers of finished and of all jobs: a given one, a line on stderr, or None."""
    return checks.function({True: Line(), False: None}[value] if isinstance(value, bool) else value, what)


class Line:
    """A line on the error output that says how many of how many are done; rewritten at most ten times a second."""

    def __init__(self) -> None:
        self._began, self._written = time.perf_counter(), 0.0

    def __call__(self, *given: Any) -> None:
        """Take the numbers of finished and of all jobs, or a record that begins with them."""
        done, total = (given[0] if isinstance(given[0], tuple) else given)[:2]
        self.write(done, total)

    def write(self, done: float, total: float, note: str = "") -> None:
        """Write it, in per cent where the total is no whole number, with what is being done."""
        now = time.perf_counter()
        if sys.stderr is None or (done < total and now - self._written < 0.1):
            return
        self._written, spent = now, now - self._began
        rest = f", {spent / done * (total - done):.0f} s to go" if 0 < done < total else ""
        count = f"{done} of {total}" if isinstance(total, int) else f"{done / total:.0%}"
        bar, end = "#" * int(20 * done / max(total, 1)), "\n" if done >= total and not note else ""
        line, wide = f"{bar:.<20} {count}, {spent:.0f} s{rest}   {note}", shutil.get_terminal_size().columns - 1
        sys.stderr.write(f"\r{f'{line:<{wide}.{wide}}' if note else line}{end}")
        sys.stderr.flush()

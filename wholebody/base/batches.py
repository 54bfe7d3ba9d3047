"""Many jobs beside each other, on this machine or on a dask cluster, through joblib; each in a child process.

A job that crashes ends only its own process. `runner.run_jobs` is for jobs that follow from the outcomes of others, or
whose processes are forked; it stays on this machine.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import Any

from wholebody.base.errors import MissingPackageError, WholebodyError
from wholebody.base.runner import ONE_THREAD, Child, EndedError, Job, Outcome, end_with

_local = threading.local()

_Sent = tuple[int, Callable[..., Any], tuple[Any, ...], float]
"""A job as it is sent: its number, its function with the arguments, and its seconds."""


def run_batch(work: Iterable[Job], jobs: int = 1, cluster: str | None = None) -> Iterator[Outcome]:
    """Do jobs beside each other, and give their outcomes as they end. A job is asked for when it can begin.

    The libraries of a process compute on one core. Closing the iterator, as an exception does, ends all processes.

    Args:
        work: asked for one by one. A deadline of 0 seconds is none; functions need not be importable.
        jobs: how many at a time.
        cluster: address of a dask scheduler; processes of this machine where None.

    Raises:
        MissingPackageError: dask is not installed.
        WholebodyError: the cluster does not answer.
    """
    begun: dict[int, Job] = {}

    def sent() -> Iterator[_Sent]:
        for number, job in enumerate(work):
            begun[number] = job
            yield number, job.function, job.arguments, job.seconds

    for number, answer, ended in spread(_in_own_child, sent(), jobs, cluster):
        yield Outcome(begun.pop(number), (), answer, None if ended is None else EndedError(*ended))


def spread(
    function: Callable[[Any], Any], arguments: Iterable[Any], jobs: int, cluster: str | None = None
) -> Iterator[Any]:
    """Call a function with each argument in as many processes, or threads of a cluster, as there are jobs at a time.

    Its answers are given as they come. See `run_batch` for the arguments and the errors.
    """
    import joblib

    try:
        with ExitStack() as stack:
            if cluster is not None:
                stack.enter_context(_client(cluster))
                stack.enter_context(joblib.parallel_config(backend="dask"))
            parallel = joblib.Parallel(
                n_jobs=jobs, return_as="generator_unordered", batch_size=1, pre_dispatch=jobs + 1
            )  # fmt: skip
            with _interrupt_ignored():
                answers = parallel(joblib.delayed(function)(argument) for argument in arguments)
            try:
                yield from answers
            finally:
                answers.close()
    finally:
        close_own_child()  # which does the jobs where there is one at a time


@contextmanager
def _interrupt_ignored() -> Iterator[None]:
    """Ignore Ctrl-C meanwhile: processes that begin now ignore it for good, and print no traceback; we end them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if handler is None else handler)


def own_child() -> Child:
    """The child process of this thread; it lives as long as this process, or until `close_own_child`."""
    if not hasattr(_local, "child"):
        _local.child = Child(ONE_THREAD)
        parent = multiprocessing.parent_process()
        if parent is not None and multiprocessing.current_process().name.startswith("LokyProcess"):
            end_with(int(parent.pid or 0))  # joblib's process would wait for minutes
    child: Child = _local.child
    return child


def close_own_child() -> None:
    """End the child process of this thread, if there is one."""
    if hasattr(_local, "child"):
        _local.child.close()


def _in_own_child(sent: _Sent) -> tuple[int, Any, tuple[int, str] | None]:
    """Do a job; its number, its answer, and the exit code and the last line of a process that ended over it."""
    number, function, arguments, seconds = sent
    child = own_child()
    child.close_if_full()
    try:
        return number, child.call(function, *arguments, seconds=seconds), None
    except EndedError as error:
        return number, None, (error.code, error.said)


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
    try:
        connect: Callable[..., AbstractContextManager[Any]] = Client
        # s: for which a scheduler is waited for
        client = connect(address, timeout=10.0)
    except (OSError, ValueError) as error:
        raise WholebodyError(f"no dask scheduler answers at {address} ({error}); start one: dask scheduler") from None
    return client

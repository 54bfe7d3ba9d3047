"""The attack: cases one after the other in processes that are started anew when a case brings them down."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from wholebody.bench.attack.case import Case, Verdict, Written
from wholebody.bench.attack.child import serve

DEADLINE = 60.0  # s: a case that takes longer, twice, hangs
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Set to 1 in the processes: CPU time of one thread is what a call takes on an idle machine."""


@dataclass(frozen=True)
class Ended:
    """A case that has come to its end.

    Attributes:
        case: which.
        written: its files; None where it could not even be written.
        verdict: what came of it.
    """

    case: Case
    written: Written | None
    verdict: Verdict


def attack(
    number_of: Iterator[Case], jobs: int, going: Callable[[], bool], deadline: float = DEADLINE
) -> Iterator[Ended]:
    """Run cases, and return them as they end.

    Args:
        number_of: the cases.
        jobs: processes at a time.
        going: asked before each case; no more are begun once it says no.
        deadline: seconds for a case.
    """
    children = [_Child(deadline) for _ in range(jobs)]
    try:
        for child in children:
            child.begin(number_of, going)
        while busy := [child for child in children if child.case is not None]:
            for ear in wait([child.ear for child in busy]):
                child = next(child for child in busy if child.ear is ear)
                ended = child.listen()
                if ended is not None:
                    child.begin(number_of, going)
                    yield ended
    finally:
        for child in children:
            child.end()


class _Child:
    """A process that runs cases."""

    def __init__(self, deadline: float) -> None:
        self._deadline = deadline
        self.case: Case | None = None
        self._written: Written | None = None
        self._again = self._hung = False
        self._start()

    def _start(self) -> None:
        context: Any = multiprocessing.get_context("spawn")
        self.ear: Connection
        self.ear, theirs = context.Pipe()
        before = {name: os.environ.get(name) for name in THREADS}
        os.environ.update(dict.fromkeys(THREADS, "1"))
        try:
            self._process = context.Process(target=serve, args=(theirs, self._deadline), daemon=True)
            self._process.start()
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
        theirs.close()

    def begin(self, cases: Iterator[Case], going: Callable[[], bool]) -> None:
        """Begin the next case, if there is to be one."""
        self.case = next(cases, None) if going() else None
        self._again = False
        self._send()

    def _send(self) -> None:
        self._written = None
        if self.case is not None:
            self.ear.send(self.case)

    def listen(self) -> Ended | None:
        """The case's end, if that is what was heard."""
        assert self.case is not None
        try:
            heard = self.ear.recv()
        except (EOFError, ConnectionResetError):
            ended = Ended(self.case, self._written, self._died())
            self._start()
            if self._hung and not self._again:  # a machine that stood still is no fault of the case
                self._again = True
                self._send()
                return None
            return ended
        if isinstance(heard, Written):
            self._written = heard
            return None
        return Ended(self.case, self._written, heard)

    def _died(self) -> Verdict:
        self._process.join()
        code = self._process.exitcode or 0
        self._hung = code == -signal.SIGALRM
        self.ear.close()
        when = "the case" if self._written else "the writing of the case"
        if self._hung:
            return Verdict("wrong", f"hangs: {when} had not ended after {self._deadline:g} s", self._deadline)
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return Verdict("wrong", f"the process died over {when}: {how}")

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self.ear.close()


def for_seconds(seconds: float) -> Callable[[], bool]:
    """Return a function that says whether the time, which begins when it is asked first, has not run out."""
    ends: list[float] = []

    def going() -> bool:
        if not ends:
            ends.append(time.monotonic() + seconds)
        return time.monotonic() < ends[0]

    return going

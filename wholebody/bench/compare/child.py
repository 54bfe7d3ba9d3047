"""The process in which methods run: a solve that takes too long ends it, wherever in compiled code it may be.

It reads requests from its standard input and answers on what was its standard output; what methods print goes to the
standard error. An alarm of the system, which nothing in the process can hold up, bounds every solve. When its parent is
gone it ends by itself.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
from dataclasses import replace
from typing import Any

from wholebody.bench.compare.messages import Build, Draw, Solve, Warm, receive, send
from wholebody.bench.compare.record import DEFAULT
from wholebody.bench.entrants.base import Entrant

BUILDING = 120.0  # s: to build a case and what belongs to its scene; compiling once included
FRAME_CAP = 0.1  # s: most for a frame, on the average, where goals move; slower than that nobody drags
GLIMPSE = 3  # frames of a moving case that a method sees before it is timed


def main() -> None:
    """Serve until the parent is gone."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    served = _Served()
    while (message := receive(requests)) is not None:
        try:
            answer = served.answer(pickle.loads(message))
            send(answers, pickle.dumps(answer))
        except BrokenPipeError:
            return


class _Served:
    """The case at hand, and which methods have run in this process."""

    def __init__(self) -> None:
        self._ready: Any = None
        self._warm: set[tuple[str, bool]] = set()

    def answer(self, request: Build | Warm | Solve | Draw) -> Any:
        from wholebody.bench.compare.solving import ready, sentence, solve

        if isinstance(request, Build):
            self._ready = None
            gc.collect()
            try:
                with _Alarm(BUILDING):
                    self._ready = ready(*request)
            except Exception as error:
                return f"{type(error).__name__}: {sentence(error)}"
            return None
        if isinstance(request, Draw):
            from wholebody.bench.compare.scenes import page

            with _Alarm(2.0 * request.cap):
                return page(request.good, request.bad, self._ready)
        if isinstance(request, Warm):
            self._warm_up(request.entrant, request.cap)
            return None
        entrant, level, cap = request
        self._warm_up(entrant, cap)
        with _Alarm(max(cap, FRAME_CAP * len(self._ready.case.frames))):
            return solve(entrant, level, self._ready)

    def _warm_up(self, entrant: Entrant, cap: float) -> None:
        """Let a method import and compile what it needs, before it is timed for the first time in this process."""
        from wholebody.bench.compare.solving import solve

        case = self._ready.case
        key = (entrant.name, bool(case.frames))
        if key in self._warm:
            return
        self._warm.add(key)
        short = replace(self._ready, case=replace(case, frames=case.frames[:GLIMPSE]))
        with _Alarm(cap):
            solve(entrant, DEFAULT, short)


class _Alarm:
    """Ends the process after some seconds, unless left before."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def __enter__(self) -> None:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, self._seconds)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


if __name__ == "__main__":
    main()

"""Early end of a solve: by a time limit, the caller's progress function, or Ctrl-C."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

import numpy as np

from wholebody.assessment.posture import Assessment
from wholebody.base.checks import a
from wholebody.base.compiled import compile_seconds
from wholebody.base.errors import InputError, UndefinedTermError, millimetres
from wholebody.solution import TraceEntry

LONGEST = 4.0
"""Default time limit of a solve, seconds of processor time. Few solves come near it, and the load of the machine does
not change their answers."""


class _Budget(threading.local):
    """The processor's time that this thread has for a frame, see `within_budget`."""

    seconds, until = np.inf, np.inf

    @property
    def spent(self) -> float:
        """The share of it that has passed; 0 without a bound."""
        if self.seconds == np.inf:
            return 0.0
        return 1.0 - self.left / self.seconds

    @property
    def left(self) -> float:
        """Seconds of it that are left; infinite without a bound."""
        return self.until - _now("thread_time")

    @property
    def over(self) -> bool:
        """Whether all of it has passed."""
        return self.spent > 1.0


BUDGET = _Budget()


def _now(clock: str) -> float:
    """What a clock of `time` shows, without compiling."""
    shown: float = getattr(time, clock)() - compile_seconds(clock)
    return shown


@contextmanager
def within_budget(seconds: float) -> Iterator[None]:
    """Inside it searches of this thread end after so many seconds of the processor, with the best posture so far."""
    before = BUDGET.seconds, BUDGET.until
    BUDGET.seconds, BUDGET.until = seconds, _now("thread_time") + seconds
    try:
        yield
    finally:
        BUDGET.seconds, BUDGET.until = before


def budget_for_sweep() -> Callable[[], bool]:
    """Whether a sweep that begins now has had its share of this thread's budget."""
    # A search ends within one budget or little more; sweeps have another two, a late one half of one at least.
    until = max(3.0, BUDGET.spent + 0.5)
    return lambda: BUDGET.spent > until


Progress = Callable[[TraceEntry], Any]
"""Called after every iteration with its entry of the trace; if it returns True, the solve ends."""


class Control:
    """Decides when one solve ends early; methods call it once an iteration.

    A context manager: inside it, in the main thread, a first Ctrl-C ends the solve, which then answers with the best
    posture so far. A second one raises KeyboardInterrupt as usual.

    Attributes:
        reason: why the solve was ended, for its message; empty before.
        undefined: why the last step that was taken back led to a posture where a term of one's own is not finite; None
            where there was none.
        undefined_at: the iteration of that step.
    """

    def __init__(
        self, time_limit: float | None = None, progress: Progress | None = None, longest: float = LONGEST
    ) -> None:
        """Start the clock: seconds on it, None for `longest` of the processor's time, infinity for no limit."""
        if progress is not None and not callable(progress):
            raise InputError(f"progress is {a(type(progress))}; give a function of one trace entry")
        self.reason = ""
        self.undefined: UndefinedTermError | None = None
        self.undefined_at, self._told = 0, 0
        self._time_limit, self._progress, self._longest = time_limit, progress, longest
        self._began, self._began_at = _now("thread_time"), _now("monotonic")
        self._handler: Any = None
        self._entered = False

    @property
    def over(self) -> bool:
        """Whether the solve has to end now. From the first time this is asked on, Ctrl-C ends it."""
        if self._entered:
            self._listen()
        # the clock is read at a fraction of the cost of a thread's processor time
        may_be = self._time_limit is not None or self.seconds > self._longest
        if not self.reason and may_be and self._passed > 1.0:
            limit, kind = (self._longest, " of processor time") if self._time_limit is None else (self._time_limit, "")
            self.reason = f"the time limit of {limit:g} s{kind} ended it"
        return bool(self.reason) or BUDGET.over

    @property
    def seconds(self) -> float:
        """Time on the clock since it began, without compiling."""
        return _now("monotonic") - self._began_at

    @property
    def spent(self) -> float:
        """Share of the time limit, or of a budget, that has passed."""
        return max(self._passed, BUDGET.spent)

    @property
    def _passed(self) -> float:
        if self._time_limit is None:
            return (_now("thread_time") - self._began) / self._longest
        return self.seconds / self._time_limit

    def message(self, judgement: Assessment) -> str:
        """Why the solve was ended, and the remaining errors; empty if it was not ended."""
        if not self.reason:
            return ""
        broken = max(judgement.clearance_violation, judgement.constraint_violation, judgement.limit_violation)
        also = f", and constraints are violated by {broken:.3g} m or rad" if broken > 1e-4 else ""
        return f"{self.reason}: {errors_left(judgement)}{also}"

    def step_back(self, error: UndefinedTermError) -> None:
        """Note that a step was taken back: a term of one's own is not finite where it leads."""
        self.undefined, self.undefined_at = error, self._told + 1

    def tell(self, entry: TraceEntry) -> None:
        """Report an iteration to the caller."""
        self._told += 1
        if self._progress is not None and self._progress(entry) is True and not self.reason:
            self.reason = "progress ended it"

    def __enter__(self) -> Control:
        """Begin; without progress Ctrl-C is heard from the first question on, since most solves of arms end before."""
        self._entered = True
        if self._progress is not None:
            self._listen()
        return self

    def _listen(self) -> None:
        """Install the handler of Ctrl-C, if Ctrl-C would raise KeyboardInterrupt."""
        self._entered = False
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._handler = signal.signal(signal.SIGINT, self._interrupt)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the handler of Ctrl-C."""
        self._entered = False
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
            self._handler = None

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self.reason:
            signal.default_int_handler(number, frame)
        self.reason = "Ctrl-C ended it"


def errors_left(judgement: Assessment) -> str:
    """What is left of the goals' errors, in words."""
    return f"{millimetres(judgement.goal_error)} and {np.degrees(judgement.goal_angle):.3g} degrees are left"


@contextmanager
def ctrl_c_ends_all() -> Iterator[None]:
    """Inside it Ctrl-C raises KeyboardInterrupt at once: in work of many solves it would end one of them alone."""
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)

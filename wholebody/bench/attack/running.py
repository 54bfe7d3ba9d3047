"""The attack: cases one after the other in processes that are started anew when a case brings them down."""

from __future__ import annotations

import ctypes
import os
import resource
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from wholebody.base.errors import UnknownNameError, WholebodyError
from wholebody.base.files import Scratch
from wholebody.base.runner import ONE_THREAD, Child, EndedError, Job, allow, allow_processor, run_jobs, tell
from wholebody.bench.attack import arguments, contacts, files, frames, own_terms, solves, streams, sweeps, worlds
from wholebody.bench.attack.case import KINDS, SCRIPT, Case, Verdict, Written

DEADLINE = 60.0  # s of the processor: a case that takes longer, twice, hangs
WRITING = 300.0  # s: to write a case
WARMING = 1800.0  # s: to compile everything on a machine that has other things to do
MEMORY = 4 << 30  # bytes: a file that asks for more is no reason to bring the machine down


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


def attack(cases: Iterator[Case], jobs: int, going: Callable[[], bool], deadline: float = DEADLINE) -> Iterator[Ended]:
    """Run cases, `jobs` at a time, and return them as they end; no more are begun once `going` says no.

    The libraries of a process have one thread, whose CPU time is what a call takes on an idle machine. A case that
    takes longer than the deadline, seconds of the processor, or ten times that by the clock, is run once more before it
    counts as one that hangs.
    """
    again: deque[Case] = deque()
    repeated: set[Case] = set()

    def next_job() -> Job | None:
        case = again.popleft() if again else next(cases, None) if going() else None
        return None if case is None else Job(case, _attacked, (case, deadline), WARMING)

    for outcome in run_jobs(next_job, [Child(ONE_THREAD) for _ in range(jobs)]):
        case = outcome.job.name
        written = outcome.notes[0] if outcome.notes else None
        error = outcome.error
        if error is None:
            yield Ended(case, written, outcome.answer)
        elif error.overtime and case not in repeated:  # a machine that stood still is no fault of the case
            repeated.add(case)
            again.append(case)
        else:
            yield Ended(case, written, _died(error, written, deadline))


def _died(error: EndedError, written: Written | None, deadline: float) -> Verdict:
    when = "the case" if written else "the writing of the case"
    if error.overtime:
        return Verdict("wrong", f"hangs: {when} had not ended after {deadline:g} s of the processor", deadline)
    return Verdict("wrong", f"the process died over {when}: {error.how}")


def _attacked(case: Case, deadline: float) -> Verdict:
    """Write a case, tell it, and run it, in a process of its own."""
    _prepare()
    allow(WRITING)
    try:
        prepared = write(case)
    except WholebodyError as error:
        return Verdict("refused", str(error)[:300])
    except Exception as error:
        return Verdict("wrong", f"while it was written: {_said(error)}")
    tell(prepared)
    allow_processor(deadline)
    return run(prepared)


WRITERS = {
    "argument": arguments.written,
    "file": files.written,
    "solve": solves.written,
    "stream": streams.written,
    "sweep": sweeps.written,
    "own term": own_terms.written,
    "pairs": worlds.written_pairs,
    "sleeper": worlds.written_sleeper,
    "weights": frames.written_mixed,
    "put": frames.written_put,
    "contact": contacts.written,
}


def write(case: Case) -> Written:
    """Write a case out, from its seed and number and from nothing else.

    Raises:
        UnknownNameError: there is no such kind.
    """
    if case.kind not in WRITERS:
        raise UnknownNameError("kind of case", case.kind, KINDS)
    return WRITERS[case.kind](case.rng())


def run(prepared: Written) -> Verdict:
    """Run a case in a folder of its own, and return its verdict: "wrong" for an error that is none of ours.

    "wrong" too where anything but the verdict reaches standard output, whoever writes it.
    """
    with Scratch() as folder, _printed(folder) as said:
        verdict = _outcome(prepared, folder)
    lines = [line for line in said if line != str(verdict)]
    if lines and verdict.outcome != "wrong":
        return Verdict("wrong", f"prints {len(lines)} lines, the first {lines[0][:200]!r}", verdict.seconds)
    return verdict


def _outcome(prepared: Written, folder: Path) -> Verdict:
    put(prepared, folder)
    began = time.process_time()
    known: dict[str, object] = {"__name__": "__main__", "__file__": str(folder / SCRIPT)}
    try:
        exec(compile(prepared.script, SCRIPT, "exec"), known)
    except WholebodyError as error:
        return Verdict("refused", str(error)[:300], time.process_time() - began)
    except Exception as error:
        return Verdict("wrong", _said(error), time.process_time() - began)
    verdict = known["verdict"]
    assert isinstance(verdict, Verdict)
    return verdict


@contextmanager
def _printed(folder: Path) -> Iterator[list[str]]:
    """The lines that this process writes to standard output meanwhile, those of compiled libraries included."""
    lines: list[str] = []
    sys.stdout.flush()
    kept = os.dup(1)
    with (folder / ".printed").open("w+b") as file:
        os.dup2(file.fileno(), 1)
        try:
            yield lines
        finally:
            sys.stdout.flush()
            ctypes.CDLL(None).fflush(None)
            os.dup2(kept, 1)
            os.close(kept)
            file.seek(0)
            lines += file.read().decode("utf-8", "replace").splitlines()


def put(prepared: Written, folder: Path) -> None:
    """Write a case's files into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SCRIPT).write_text(prepared.script, encoding="utf-8")
    for name, contents in prepared.files.items():
        (folder / name).write_bytes(contents)


def _said(error: Exception) -> str:
    """The error with the place in the package that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if f"{os.sep}wholebody{os.sep}" in frame.filename] or list(frames)
    place = f"{Path(ours[-1].filename).name}, {ours[-1].name}" if ours else "unknown place"
    words = str(error).strip().splitlines()
    return f"{type(error).__name__} in {place}: {words[0][:200] if words else ''}"


@cache
def _prepare() -> None:
    """Bound the memory of this process; compile and import what cases need, so that none is timed with it."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    import wholebody as wb
    from wholebody.methods import installed_methods

    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point(scene.figure.frames[0], (0.3, 0.0, 1.0))])
    for method in installed_methods():
        wb.solve(problem, method=method)
    scene.sweep(problem.start, scene.figure.neutral)


def for_seconds(seconds: float) -> Callable[[], bool]:
    """Return a function that says whether the time, which begins when it is asked first, has not run out."""
    ends: list[float] = []

    def going() -> bool:
        if not ends:
            ends.append(time.monotonic() + seconds)
        return time.monotonic() < ends[0]

    return going

"""The process in which cases run: it writes a case, says so, runs it, and says what came of it.

An alarm of the system, which nothing in the process can hold up, ends it where a case takes too long; so it ends too
when its parent is gone.
"""

from __future__ import annotations

import os
import resource
import signal
import time
import traceback
from multiprocessing.connection import Connection
from pathlib import Path

from wholebody.bench.attack.case import SCRIPT, Verdict, Written
from wholebody.bench.attack.writing import write
from wholebody.errors import WholebodyError
from wholebody.files import Scratch

WRITING = 300.0  # s: to write a case
WARMING = 1800.0  # s: to compile everything on a machine that has other things to do
MEMORY = 4 << 30  # bytes: a file that asks for more is no reason to bring the machine down


def serve(ear: Connection, deadline: float) -> None:
    """Run cases until the parent has no more.

    Args:
        ear: cases come in, `Written` and then `Verdict` go out.
        deadline: seconds for a case.
    """
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, WARMING)
    _warm()
    try:
        while True:
            case = ear.recv()
            signal.setitimer(signal.ITIMER_REAL, WRITING)
            try:
                prepared = write(case)
            except WholebodyError as error:
                ear.send(Verdict("refused", str(error)[:300]))
                continue
            except Exception as error:
                ear.send(Verdict("wrong", f"while it was written: {_said(error)}"))
                continue
            ear.send(prepared)
            signal.setitimer(signal.ITIMER_REAL, deadline)
            verdict = run(prepared)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            ear.send(verdict)
    except (EOFError, BrokenPipeError):
        return


def run(prepared: Written) -> Verdict:
    """Run a case in a folder of its own, and return its verdict: "wrong" for an error that is none of ours."""
    with Scratch() as folder:
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


def _warm() -> None:
    """Compile and import what cases need, so that none is timed with it."""
    import wholebody as wb
    from wholebody.methods import installed_methods

    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point(scene.figure.frames[0], (0.3, 0.0, 1.0))])
    for method in installed_methods():
        wb.solve(problem, method=method)
    scene.sweep(problem.start, scene.figure.neutral)

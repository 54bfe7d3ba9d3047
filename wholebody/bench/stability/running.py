"""Runs cases by methods, each cell in a process of its own: what hangs or crashes costs one cell and a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from wholebody.bench.entrants.base import Entrant
from wholebody.bench.stability.answering import NOTHING, Answer, ask
from wholebody.bench.stability.case import HardCase
from wholebody.bench.stability.judging import Judged, judge

CAP = 20.0  # s: a method that has not answered by then, or has not made its next frame, hangs
FRAME_DONE = "a frame is done"
JUDGING = 120.0  # s: a judgement of many frames, all pairs of each


@dataclass(frozen=True)
class Cell:
    """One method's answer to one case, and what it measures."""

    case: HardCase
    method: str
    answer: Answer
    judged: Judged


def run(cases: Sequence[HardCase], entrants: Sequence[Entrant], jobs: int = 1, cap: float = CAP) -> Iterator[Cell]:
    """Every case by every method, as they end.

    Args:
        cases: what is asked.
        entrants: who is asked.
        jobs: processes at a time.
        cap: seconds for an answer, or for a frame of one.
    """
    # forked: what was imported and compiled is there, and nothing has to be pickled on the way
    _warm()
    context = multiprocessing.get_context("fork")
    left = [(case, entrant) for case in cases for entrant in entrants][::-1]
    running: list[_Running] = []
    try:
        while left or running:
            while left and len(running) < jobs:
                running.append(_Running(context, *left.pop(), cap))
            wait([each.ear for each in running], timeout=0.1)
            for each in tuple(running):
                cell = each.look()
                if cell is not None:
                    running.remove(each)
                    yield cell
    finally:
        for each in running:
            each.end()


def _warm() -> None:
    """Import and compile in this process what most cells need, so that no cell is timed with it."""
    from wholebody.bench.stability.streams import ThinPlate
    from wholebody.methods.qp.method import QP

    question = ThinPlate().question()
    judged = QP().solve(question.problem)
    question.problem.scene.sweep(question.problem.start, judged.q)


class _Running:
    """A cell at work."""

    def __init__(self, context: Any, case: HardCase, entrant: Entrant, cap: float) -> None:
        self._case, self._entrant, self._cap = case, entrant, cap
        self.ear, mouth = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(case, entrant, mouth), daemon=True)
        self._process.start()
        mouth.close()
        self._deadline = time.monotonic() + cap
        self._answer: Answer | None = None

    def look(self) -> Cell | None:
        """The cell, if it has come to an end."""
        try:
            if self.ear.poll():
                heard = self.ear.recv()
                if isinstance(heard, Judged):
                    return self._cell(heard)
                if isinstance(heard, Answer):
                    self._answer = heard
                self._deadline = time.monotonic() + (self._cap if heard == FRAME_DONE else JUDGING)
        except EOFError:
            self._process.join()
            return self._cell(Judged(), self._ended(self._process.exitcode))
        if time.monotonic() > self._deadline:
            return self._cell(Judged(), f"hangs: no answer in {self._cap:g} s")
        return None

    def end(self) -> None:
        """Stop the process, whatever it does."""
        self._process.kill()
        self._process.join()
        self.ear.close()

    def _cell(self, judged: Judged, failure: str = "") -> Cell:
        self.end()
        answer = self._answer
        if answer is None or failure:
            answer = Answer(NOTHING, failure=failure)
        return Cell(self._case, self._entrant.name, answer, judged)

    def _ended(self, code: int | None) -> str:
        if self._answer is not None:
            return "its answer cannot be judged"
        if code is not None and code < 0:
            return f"crashes: {signal.Signals(-code).name}"
        return f"ends its process with code {code}"


def _work(case: HardCase, entrant: Entrant, mouth: Connection) -> None:
    """Ask, send the answer, then judge it: the clock for the method stops with the answer."""
    answer = ask(case, entrant, lambda: mouth.send(FRAME_DONE))
    mouth.send(answer)
    mouth.send(judge(case, answer))
    mouth.close()
    os._exit(0)  # nothing of the parent's is to be closed twice

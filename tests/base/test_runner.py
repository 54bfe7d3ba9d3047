"""Jobs in processes of their own: answers, notes, deadlines, deaths, and processes that are replaced."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from operator import add
from pathlib import Path

import pytest

from wholebody.base import runner
from wholebody.base.runner import (
    ONE_THREAD,
    Child,
    EndedError,
    Job,
    allow,
    allow_processor,
    processor_time,
    run_jobs,
    tell,
)

FROM_SCRATCH = True


@pytest.fixture
def child() -> Iterator[Child]:
    made = Child({"WORD": "heard"})
    yield made
    made.close()


def test_an_answer_comes_back_and_the_next_job_is_done(child: Child) -> None:
    assert child.call(add, 1, 2, seconds=60.0) == 3
    assert child.call(os.getenv, "WORD", seconds=60.0) == "heard"
    assert child.call(os.getpid, seconds=60.0) != os.getpid()


def test_a_deadline_ends_the_process_and_the_next_job_has_another(child: Child) -> None:
    with pytest.raises(EndedError, match="it took too long") as caught:
        child.call(time.sleep, 60.0, seconds=0.5)
    assert caught.value.overtime
    assert child.call(add, 1, 2, seconds=60.0) == 3


def test_a_death_is_told_with_its_signal_or_code(child: Child) -> None:
    with pytest.raises(EndedError, match="the process ended with exit code 3") as caught:
        child.call(os._exit, 3, seconds=60.0)
    assert (caught.value.overtime, caught.value.code) == (False, 3)
    with pytest.raises(EndedError, match="SIGKILL"):
        child.call(signal.raise_signal, signal.SIGKILL, seconds=60.0)


def test_the_last_words_of_an_error_are_kept() -> None:
    child = Child()
    with pytest.raises(EndedError, match="the process ended with exit code 1: ValueError: invalid literal"):
        child.call(int, "x", seconds=60.0)


def step_by_step() -> str:
    for number in range(3):
        tell(number)
        allow(0.4)
        time.sleep(0.2)
    allow(60.0)
    return "done"


def test_jobs_run_beside_each_other_with_notes_and_a_deadline_that_moves() -> None:
    jobs = iter(
        [Job("steps", step_by_step, (), 30.0), Job("hangs", time.sleep, (60.0,), 0.5), Job("adds", add, (1, 2), 9.0)]
    )
    found = {outcome.job.name: outcome for outcome in run_jobs(lambda: next(jobs, None), [Child(), Child()])}
    assert found["steps"].notes == (0, 1, 2)
    assert (found["steps"].answer, found["adds"].answer) == ("done", 3)
    error = found["hangs"].error
    assert error is not None
    assert error.overtime


def work(seconds: float) -> str:
    allow(60.0, 0.3)
    began = time.process_time()
    while time.process_time() - began < seconds:
        pass
    return "done"


def wait_long() -> str:
    allow(60.0, 0.3)
    time.sleep(0.5)
    return "done"


def test_a_deadline_may_be_of_the_processors_time(child: Child) -> None:
    assert child.call(wait_long, seconds=60.0) == "done"
    with pytest.raises(EndedError, match="it took too long") as caught:
        child.call(work, 30.0, seconds=60.0)
    assert caught.value.overtime
    assert child.call(work, 0.01, seconds=60.0) == "done"


def test_outside_of_a_job_there_is_nobody_to_tell() -> None:
    alarm, _ = signal.getitimer(signal.ITIMER_REAL)  # of the tests themselves, if any
    tell("nothing")
    allow(1e6)
    assert signal.getitimer(signal.ITIMER_REAL)[0] <= alarm


def test_a_process_whose_parent_ended_while_it_began_ends_too() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    code = f"import time; from wholebody.base.runner import end_with; end_with({gone.pid}); time.sleep(60.0)"
    assert subprocess.run([sys.executable, "-c", code], timeout=50.0, check=False).returncode == 1


def test_the_folders_of_the_package_hide_no_other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wholebody.py").write_text("raise RuntimeError")
    (tmp_path / "json.py").write_text("raise RuntimeError")
    monkeypatch.chdir(tmp_path)
    child = Child(ONE_THREAD)
    try:
        path = child.call(getattr, sys, "path", seconds=60.0)
        assert path[-1] == str(Path(runner.__file__).parents[2])
        assert "" not in path
        assert child.call(os.getenv, "OMP_NUM_THREADS", seconds=60.0) == "1"
    finally:
        child.close()


def test_a_process_finds_the_modules_that_its_parent_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "module_of_a_script.py").write_text("def twice(x): return 2 * x")
    monkeypatch.syspath_prepend(tmp_path)
    child = Child()
    try:
        assert child.call(importlib.import_module("module_of_a_script").twice, 3, seconds=60.0) == 6
    finally:
        child.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says in /proc what a process holds")
@pytest.mark.parametrize(("full", "processes"), [(1e12, 1), (1e6, 3)])
def test_a_process_that_is_full_is_replaced_before_its_next_job(
    monkeypatch: pytest.MonkeyPatch, full: float, processes: int
) -> None:
    monkeypatch.setattr(runner, "FULL", full)
    child = Child()
    try:
        seen = set()
        for _ in range(3):
            child.close_if_full()
            seen.add(child.call(os.getpid, seconds=60.0))
    finally:
        child.close()
    assert len(seen) == processes


def processor_ticks() -> list[float]:
    """Processor's time of half a millisecond of work, ten times, with a deadline of the processor's time."""
    allow_processor(30.0)
    found = []
    for _ in range(10):
        before, end = processor_time(), time.thread_time() + 5e-4
        while time.thread_time() < end:
            pass
        found.append(processor_time() - before)
    return found


def test_the_processors_time_goes_by_no_ticks(child: Child) -> None:
    for seconds in child.call(processor_ticks, seconds=60.0):
        assert 4e-4 < seconds < 5e-3, "of half a millisecond"

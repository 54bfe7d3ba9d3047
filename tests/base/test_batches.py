"""Jobs beside each other: every outcome comes back to its job, and nothing is left running."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from wholebody.base.batches import run_batch
from wholebody.base.runner import Job


def squared(x: int) -> int:
    return x * x


def dies(x: int) -> int:
    if x == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_answer_belongs_to_its_job(jobs: int) -> None:
    found = {each.job.name: each.answer for each in run_batch((Job(k, squared, (k,), 60.0) for k in range(7)), jobs)}
    assert found == {k: k * k for k in range(7)}


def test_a_process_that_is_killed_or_late_costs_one_job() -> None:
    work = [Job(k, dies, (k,), 60.0) for k in range(3)]
    work += [Job("late", time.sleep, (30.0,), 0.2), Job("no deadline", squared, (3,), 0.0)]
    found = {each.job.name: each for each in run_batch(iter(work), 2)}
    assert "SIGKILL" in str(found[1].error)
    assert [found[k].answer for k in (0, 2)] == [0, 2]
    assert found["late"].error is not None
    assert found["late"].error.overtime
    assert found["no deadline"].answer == 9


def test_jobs_are_asked_for_when_they_can_begin() -> None:
    asked: list[int] = []

    def work() -> Iterator[Job]:
        for k in range(50):
            asked.append(k)
            yield Job(k, squared, (k,), 60.0)

    outcomes = run_batch(work(), 1)
    next(outcomes)
    assert len(asked) < 10
    outcomes.close()  # type: ignore[attr-defined]


SCRIPT = """
import os, pathlib, sys, time
from wholebody.base.batches import run_batch
from wholebody.base.runner import Job

FROM_SCRATCH = True
def works(folder, k):
    (pathlib.Path(folder) / f"{os.getpid()}.pid").write_text("")
    time.sleep(60.0)
for _ in run_batch((Job(k, works, (sys.argv[1], k), 0.0) for k in range(4)), int(sys.argv[2])):
    pass
"""


@pytest.mark.parametrize(("how", "jobs"), [(signal.SIGINT, 2), (signal.SIGKILL, 1)])
def test_no_process_is_left_when_a_run_is_ended(how: signal.Signals, jobs: int, tmp_path: Path) -> None:
    """SIGKILL leaves no time to end them: they see that their parent is gone."""
    command = [sys.executable, "-c", SCRIPT, str(tmp_path), str(jobs)]
    run = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    wait_until(lambda: len(list(tmp_path.glob("*.pid"))) == jobs)
    run.send_signal(how)
    assert run.wait(30.0) in (130, -signal.SIGINT, -signal.SIGKILL, 1)
    workers = [int(path.stem) for path in tmp_path.glob("*.pid")]
    wait_until(lambda: not any(Path(f"/proc/{worker}/stat").exists() for worker in workers))


def status(_: int) -> str:
    return Path("/proc/self/status").read_text()


def test_processes_leave_ctrl_c_to_the_one_who_began_them() -> None:
    """A terminal sends it to all of them; one that has hardly begun would print a traceback."""
    for outcome in run_batch((Job(k, status, (k,), 60.0) for k in range(3)), 2):
        (ignored,) = (line.split()[1] for line in str(outcome.answer).splitlines() if line.startswith("SigIgn"))
        assert int(ignored, 16) & 1 << (signal.SIGINT - 1)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def wait_until(holds: object) -> None:
    assert callable(holds)
    ends = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < ends
        time.sleep(0.1)

"""The process in which methods run is started anew where a method leaves it without memory."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest

from wholebody.bench.compare.messages import Build, Solve
from wholebody.bench.compare.record import DEFAULT
from wholebody.bench.compare.worker import Worker


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says in /proc what a process holds")
@pytest.mark.parametrize(("full", "processes"), [(1e12, 1), (1e6, 3)])
def test_a_process_that_is_full_is_started_anew_between_cases(
    fakes: ModuleType, monkeypatch: pytest.MonkeyPatch, full: float, processes: int
) -> None:
    monkeypatch.setattr("wholebody.bench.compare.worker.FULL", full)
    worker, seen = Worker(), set()
    try:
        for number in range(3):
            assert worker.build(Build(fakes.SET, number, 0)) is None
            record = worker.solve(Solve(fakes.entrant("solves"), DEFAULT, 10.0))
            assert record.success(1e-3)
            assert worker._process is not None
            seen.add(worker._process.pid)
    finally:
        worker.close()
    assert len(seen) == processes

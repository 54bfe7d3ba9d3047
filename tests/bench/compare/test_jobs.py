"""One case for all methods: what it cost each of them."""

from __future__ import annotations

from types import ModuleType

import pytest

from wholebody.batches import close_own_child
from wholebody.bench.compare.jobs import Task, work

FROM_SCRATCH = True


def test_what_a_method_compiles_is_not_taken_for_what_its_solves_cost(
    fakes: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or it would be given a handful of problems."""
    monkeypatch.setenv("FAKES_SLEEP", "0.4")
    solves = tuple((fakes.adapter(does), ()) for does in ("compiles", "sleeps", "dies"))
    try:
        chunk = work(Task(fakes.SET, 0, 0, solves, cap=10.0, most=1.0))
    finally:
        close_own_child()
    assert not chunk.fault
    assert chunk.spent["sleeps"] >= 0.4
    assert chunk.spent["compiles"] < 1.5  # which it takes to compile
    assert chunk.cold["compiles"] >= 1.5  # the first time in its process
    assert 0.0 < chunk.kernel < 5.0
    assert [record.outcome for record in chunk.records] == ["answered", "answered", "failed"]


def test_a_busy_machine_ends_no_solve(fakes: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits by the clock for longer than a solve may compute has an answer all the same."""
    monkeypatch.setenv("FAKES_SLEEP", "3.0")
    solves = ((fakes.adapter("sleeps"), ()),)
    try:
        (record,) = work(Task(fakes.SET, 0, 0, solves, cap=2.0, most=1.0)).records
    finally:
        close_own_child()
    assert record.outcome == "answered"
    assert record.seconds >= 3.0

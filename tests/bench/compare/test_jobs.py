"""One case for all methods: what it cost each of them."""

from __future__ import annotations

from types import ModuleType

from wholebody.batches import close_own_child
from wholebody.bench.compare.jobs import Task, work


def test_what_a_method_compiles_is_not_taken_for_what_its_solves_cost(fakes: ModuleType) -> None:
    """Or it would be given a handful of problems."""
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

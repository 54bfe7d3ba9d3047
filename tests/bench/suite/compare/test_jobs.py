"""One case for all methods: what it cost each of them."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import pytest

from wholebody.bench.suite.compare.results import Chunk
from wholebody.bench.suite.compare.solving import Task, work

WAITS = 0.3  # s: of each solve of the method that sleeps
CAP = 0.2  # s of the processor: more than a solve computes, and less than it waits


@pytest.fixture(scope="module")
def chunks(fakes: ModuleType) -> Iterator[tuple[Chunk, Chunk]]:
    """Return two chunks of one process: methods that compile and sleep, and with a cap below what one sleeps."""
    solves = {does: (fakes.adapter(does), ()) for does in ("compiles", "sleeps")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FAKES_SLEEP", str(WAITS))
        yield (
            work(Task(fakes.SET, 0, 0, tuple(solves.values()), cap=10.0, most=1.0)),
            work(Task(fakes.SET, 0, 0, (solves["sleeps"],), cap=CAP, most=1.0)),
        )


def test_what_a_method_compiles_is_not_taken_for_what_its_solves_cost(
    chunks: tuple[Chunk, Chunk], fakes: ModuleType
) -> None:
    """Or it would be given a handful of problems."""
    chunk, _ = chunks
    assert not chunk.fault
    assert chunk.spent["sleeps"] >= WAITS
    assert chunk.spent["compiles"] < fakes.COMPILING
    assert chunk.cold["compiles"] >= fakes.COMPILING  # the first time in its process
    assert 0.0 < chunk.kernel < 5.0
    assert [record.outcome for record in chunk.records] == ["answered", "answered"]


def test_a_busy_machine_ends_no_solve(chunks: tuple[Chunk, Chunk]) -> None:
    """What waits by the clock for longer than a solve may compute has an answer all the same."""
    (record,) = chunks[1].records
    assert record.outcome == "answered"
    assert record.seconds >= WAITS > CAP

"""The file of a comparison: its chunks come back with their records in them."""

from __future__ import annotations

from math import inf
from pathlib import Path

from wholebody.bench.suite.compare.results import ANSWERED, FAILED, Chunk, Record, Store

SETTINGS = {"seed": 0, "sets": ["a"], "levels": {"x": [[0.1, None], [0.01, 3]]}}


def chunk(number: int) -> Chunk:
    good = Record("a", number, "x", 1e-4, 0, ANSWERED, "solved", seconds=0.1, goal_error=1e-7 / 3.0, best=2.0)
    bad = Record("a", number, "y", 1e-4, 0, FAILED, said='of "all"\tthings, ä')
    return Chunk("a", number, (good, bad), {"x": 0.25}, {"x": 1.5}, 0.5)


def test_what_was_written_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    store = Store(tmp_path, SETTINGS)
    for number in (1, 0):
        store.add(chunk(number).key, chunk(number))
    again = Store(tmp_path, SETTINGS)
    assert again.chunks == [chunk(1), chunk(0)]
    assert again.chunks[0].records[1].goal_error == inf
    assert [record.number for record in again.records] == [0, 0, 1, 1]

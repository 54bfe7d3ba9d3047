"""The file of a run: what was written comes back, and a line that was cut off is cut off for good."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from wholebody.base.errors import FileFormatError, InputError
from wholebody.bench.suite.compare.results import ANSWERED, FAILED, NAME, Chunk, Record, Store

SETTINGS = {"seed": 0, "sets": ["a"], "levels": {"x": [[0.1, None], [0.01, 3]]}}


def chunk(number: int) -> Chunk:
    good = Record("a", number, "x", 1e-4, 0, ANSWERED, "solved", seconds=0.1, goal_error=1e-7 / 3.0, best=2.0)
    bad = Record("a", number, "y", 1e-4, 0, FAILED, said='of "all"\tthings, ä')
    return Chunk("a", number, (good, bad), {"x": 0.25}, {"x": 1.5}, 0.5)


def test_what_was_written_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    store = Store(tmp_path, SETTINGS)
    for number in (1, 0):
        store.add(chunk(number))
    again = Store(tmp_path, SETTINGS)
    assert again.chunks == [chunk(1), chunk(0)]
    assert again.chunks[0].records[1].goal_error == inf
    assert [record.number for record in again.records] == [0, 0, 1, 1]


@pytest.mark.parametrize("cut", [1, 17, 200])
def test_a_line_that_was_cut_off_is_lost_and_nothing_else(tmp_path: Path, cut: int) -> None:
    store = Store(tmp_path, SETTINGS)
    store.add(chunk(0))
    store.add(chunk(1))
    path = tmp_path / NAME
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    resumed = Store(tmp_path, SETTINGS)
    assert resumed.chunks == [chunk(0)]
    resumed.add(chunk(1))
    assert path.read_bytes() == whole


def test_other_settings_are_one_clear_error(tmp_path: Path) -> None:
    Store(tmp_path, SETTINGS)
    with pytest.raises(InputError, match=r"holds a run with seed = 0, and 5 is asked for; give another --out"):
        Store(tmp_path, SETTINGS | {"seed": 5})


@pytest.mark.parametrize("text", ["no JSON\n", '{"seed": 0}\n{"set": "a"}\n', '{"seed": 0'])
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / NAME).write_text(text)
    with pytest.raises(FileFormatError, match=NAME):
        Store(tmp_path, {"seed": 0})

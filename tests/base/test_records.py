"""Records of a run in a file: what was written comes back, whatever happens to the run that writes."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import asdict, dataclass
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.records import RecordFile, source_digest

SETTINGS = {"seed": 0, "sets": ("a",), "levels": {"x": [[0.1, None], [0.01, 3]]}, "most": nan}


@dataclass(frozen=True)
class Solve:
    """A record with a posture and one within another."""

    said: str
    error: float = 1e-7 / 3.0
    q: Any = None


def made(plain: dict[str, Any]) -> Solve:
    return Solve(**plain)


def opened(folder: Path, settings: dict[str, Any] = SETTINGS) -> RecordFile[Solve]:
    return RecordFile(folder / "run" / "solves.jsonl", "solves of a test", made, settings)


def test_what_was_written_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    run = opened(tmp_path)
    run.add("b", Solve("first"))
    run.add("a", Solve('of "all"\tthings,\r\n\u2028 ä', inf, np.array([0.1, -0.0])))
    run.add("b", Solve("again", nan))
    found = opened(tmp_path).kept
    assert list(found) == ["b", "a"]
    assert str(found["b"]) == str(Solve("again", nan))
    assert asdict(found["a"]) == {"said": 'of "all"\tthings,\r\n\u2028 ä', "error": inf, "q": [0.1, -0.0]}
    assert str(found["a"].q[1]) == "-0.0"


def test_a_text_is_a_record_too(tmp_path: Path) -> None:
    RecordFile(tmp_path / "x.jsonl", "texts", str).add("key", "text")
    assert RecordFile(tmp_path / "x.jsonl", "texts", str).kept == {"key": "text"}


def test_cut_off_at_any_byte_whole_records_stay_and_the_run_goes_on(tmp_path: Path) -> None:
    run = opened(tmp_path)
    ends = [run.path.stat().st_size]
    for number in range(2):
        run.add(str(number), Solve(f"number {number}"))
        ends.append(run.path.stat().st_size)
    whole = run.path.read_bytes()
    for size in range(len(whole)):
        run.path.write_bytes(whole[:size])
        resumed = opened(tmp_path)
        assert len(resumed.kept) == sum(size >= end for end in ends[1:])
        for number in range(len(resumed.kept), 2):
            resumed.add(str(number), Solve(f"number {number}"))
        assert run.path.read_bytes() == whole


def write_some(folder: Path, first: int) -> None:
    run = opened(folder)
    for number in range(first, first + 100):
        run.add(str(number), Solve(f"number {number}"))


def test_two_writers_lose_nothing_and_see_each_other(tmp_path: Path) -> None:
    here = opened(tmp_path)
    there = multiprocessing.get_context("fork").Process(target=write_some, args=(tmp_path, 100))
    there.start()
    write_some(tmp_path, 0)
    there.join()
    here.add("200", Solve("number 200"))
    assert here.kept == {str(number): Solve(f"number {number}") for number in map(int, here.kept)}
    assert {int(key) for key in here.kept} == set(range(201)) == {int(key) for key in opened(tmp_path).kept}


def test_what_another_writer_left_half_when_it_was_killed_is_removed(tmp_path: Path) -> None:
    run = opened(tmp_path)
    with run.path.open("ab") as file:
        file.write(b'["half", {"said": "of a rec')
    run.add("whole", Solve("of a record"))
    assert run.kept == opened(tmp_path).kept == {"whole": Solve("of a record")}


def test_a_file_that_was_taken_away_is_begun_anew(tmp_path: Path) -> None:
    run = opened(tmp_path)
    run.add("first", Solve("of a record"))
    run.path.unlink()
    run.add("second", Solve("of a record"))
    assert list(opened(tmp_path).kept) == ["second"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 5}, "holds a run with seed = 0, and 5 is asked for; give another folder"),
        ({"most": 1.0}, "holds a run with most = nan, and 1.0 is asked for"),
        ({"cap": 2.0}, "holds a run with cap = None, and 2.0 is asked for"),
    ],
)
def test_other_settings_are_one_clear_error(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    opened(tmp_path).add("a", Solve("of a record"))
    with pytest.raises(InputError, match=said):
        opened(tmp_path, SETTINGS | change)
    fewer = {name: value for name, value in SETTINGS.items() if name not in change}
    if len(fewer) < len(SETTINGS):
        with pytest.raises(InputError, match="None is asked for"):
            opened(tmp_path, fewer)
    assert len(opened(tmp_path).kept) == 1


def test_a_run_of_other_code_is_not_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened(tmp_path).add("a", Solve("of a record"))
    monkeypatch.setattr("wholebody.base.records.source_digest", lambda: "another")
    with pytest.raises(InputError, match=r"holds a run with code = .*, and another is asked for"):
        opened(tmp_path)


HEAD = {"content": "solves of a test", "version": "1.0", "code": source_digest()}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no JSON\n", "its first line is not the head"),
        ("no JSON, and no line", "its first line is not the head"),
        ('{"seed": 0}\n', "holds no solves of a test"),
        ("[1, 2]\n", "holds no solves of a test"),
        (json.dumps(HEAD | {"version": "2.0"}) + "\n", r"its version is 2\.0, not 1\.0"),
        (json.dumps(HEAD | {"content": "cases"}) + "\n", "its content is cases"),
        (json.dumps(HEAD) + '\n{"said": "a"}\n', "holds no solves of a test"),
        (json.dumps(HEAD) + '\n["a", {"unsaid": "a"}]\n', "a line is no record"),
        (json.dumps(HEAD) + "\n" + 10000 * "[" + "\n", "holds no solves of a test"),
        ("\udcff\n", "holds no solves of a test"),
    ],
)
def test_another_file_is_refused_and_stays_as_it_is(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "run" / "solves.jsonl"
    path.parent.mkdir()
    path.write_text(text, errors="surrogateescape")
    before = path.read_bytes()
    with pytest.raises(FileFormatError, match=said):
        opened(tmp_path, {})
    assert path.read_bytes() == before


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "run" / "solves.jsonl").mkdir(parents=True)
    with pytest.raises(InputError, match="is no file"):
        opened(tmp_path)


def test_a_finished_run_is_read_where_nothing_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = opened(tmp_path)
    kept.add("a", Solve("a"))
    path = kept.path
    path.write_bytes(path.read_bytes() + b'["b", {"sa')  # cut off
    before = path.read_bytes()
    monkeypatch.setattr("os.access", lambda *_: False)  # nothing keeps root from writing
    found = opened(tmp_path)
    assert found.kept == {"a": Solve("a")}
    with pytest.raises(InputError, match="cannot be written"):
        found.add("b", Solve("b"))
    assert path.read_bytes() == before

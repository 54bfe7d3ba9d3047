"""Cases depend on their seed and number alone; whatever a case does, the attack goes on and can be repeated."""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import UnknownNameError
from wholebody.bench.attack import running
from wholebody.bench.attack.inputs import mutated
from wholebody.bench.attack.judging import KINDS, PATTERN, Case, Verdict, kind_of
from wholebody.bench.attack.running import attack, keep, report, row

FACTS = {"wholebody": "0"}


def scripted(rng: np.random.Generator, folder: Path) -> Verdict:
    """What a case may do: `attack` gives it the number of the case, in place of a generator."""
    number: Any = rng
    (folder / "note.txt").write_text("beside it")
    while number == 1:
        pass
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        raise ZeroDivisionError("by nothing")
    if number == 4:
        wb.Sphere(-1.0)
    if number == 6:
        time.sleep(0.7)  # as where others have the processor
    return Verdict("right", "as it should be")


def words(case: Case, folder: Path) -> tuple[Any, ...]:
    """What a case comes to, without its time, and the files that it has written."""
    verdict = running.run(case, folder)
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".printed"}
    return verdict.outcome, verdict.words.replace(str(folder), ""), verdict.status, files


DEAR = ("stream", "sleeper", "sweep", "solve", "contact")  # seconds a case; an attack of a minute runs these too


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in DEAR])
def test_a_case_depends_on_its_seed_and_number_alone(kind: str, tmp_path: Path) -> None:
    """What a case draws is in the files that it writes and in its words."""
    folders = [tmp_path / name for name in ("first", "again")]
    for folder in folders:
        folder.mkdir()
    first, again = (words(Case(3, 6, kind), folder) for folder in folders)
    assert first == again
    assert first[0] != "wrong"


def test_every_kind_has_its_turn_and_files_are_twice_the_solves(tmp_path: Path) -> None:
    kinds = [kind_of(number) for number in range(3 * len(PATTERN))]
    assert set(kinds) == set(KINDS)
    assert kinds.count("file") >= 1.5 * kinds.count("solve")
    with pytest.raises(UnknownNameError, match="solve"):
        running.run(Case(0, 0, "solv"), tmp_path)


def test_mutations_change_text_and_keep_to_their_seed() -> None:
    text = b"size = [0.1, 0.2, 0.3]\nname = 'box'\n"
    found = [mutated(text, np.random.default_rng(seed)) for seed in range(200)]
    assert sum(each != text for each in found) > 180
    assert found[7] == mutated(text, np.random.default_rng(7))


attacked = running._attacked


def by_script(case: Case, deadline: float) -> Verdict:
    """In a child, run `scripted` in place of a real case."""
    running.CASES["solve"], running._prepare = scripted, lambda: None
    Case.rng = lambda case: case.number  # type: ignore[assignment,method-assign,return-value]
    return attacked(case, deadline)


@pytest.fixture
def in_place_of_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "_attacked", by_script)


@pytest.mark.usefixtures("in_place_of_cases")
def test_the_attack_goes_on_after_hangs_crashes_and_errors() -> None:
    cases = (Case(0, number, "solve") for number in range(7))
    found = {case.number: verdict for case, verdict in attack(cases, 2, lambda: True, deadline=0.4)}
    outcomes = {number: verdict.outcome for number, verdict in found.items()}
    assert outcomes == {0: "right", 1: "wrong", 2: "wrong", 3: "wrong", 4: "refused", 5: "right", 6: "right"}
    assert "hangs" in found[1].words
    assert "SIGKILL" in found[2].words
    assert "ZeroDivisionError" in found[3].words
    assert "Sphere: radius" in found[4].words


@pytest.mark.usefixtures("in_place_of_cases")
def test_no_case_is_begun_when_the_time_is_over() -> None:
    asked = iter([True, True, False])
    short = (Case(0, number, "solve") for number in (0, 5, 0))
    assert [case.number for case, _ in attack(short, 1, lambda: next(asked), deadline=30.0)] == [0, 5]


def test_a_failure_is_repeated_by_its_script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = Case(3, 2, "file")
    keep(case, Verdict("wrong", "something"), tmp_path)
    place = tmp_path / case.name
    assert (place / "found.txt").read_text() == "something\n"
    runpy.run_path(str(place / "repeat.py"), run_name="__main__")
    assert capsys.readouterr().out.startswith("Verdict(")
    assert len(list(place.iterdir())) > 2


def test_counts_times_and_intervals_are_reported() -> None:
    rows = [row(Case(0, k, "solve"), Verdict("right", "", 0.01 * (k + 1), "solved")) for k in range(100)]
    rows += [row(Case(0, 100, "solve"), Verdict("wrong", "a false claim", 6.0, "solved"))]
    rows += [row(Case(0, k, "file"), Verdict("refused", "", 0.0, "")) for k in range(10)]
    text = report(rows, FACTS)
    assert "| 101 | 100 | 0 | 0 | 1 |" in text
    assert "| solves that end | solved | 101 | 510 | 960 | 6000 |" in text
    assert "more than 5 s: 1." in text


def test_what_was_never_wrong_may_be_so_in_the_next_case() -> None:
    rows = [row(Case(0, k, "file"), Verdict("right", "", 0.0, "")) for k in range(200)]
    text = report(rows, FACTS)
    assert "| file | 200 | 200 | 0 | 0 | 0 | 1.88 |" in text  # Wilson's interval for 200 of 200, as published


@pytest.mark.parametrize("said", [lambda: os.write(1, b"a line\n"), lambda: ctypes.CDLL(None).puts(b"a line")])
def test_what_prints_is_wrong(
    said: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(running.CASES, "solve", lambda *_: Verdict("right", f"{said() or 0} written"))
    wrong = running.run(Case(0, 0, "solve"), tmp_path)
    assert (wrong.outcome, wrong.words) == ("wrong", "prints 1 lines, the first 'a line'")
    assert "a line" not in capfd.readouterr().out

"""Cases depend on their seed and number alone; whatever a case does, the attack goes on and can be repeated."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from wholebody.base.errors import UnknownNameError
from wholebody.base.runner import Child
from wholebody.bench.attack import running
from wholebody.bench.attack.case import KINDS, PATTERN, SCRIPT, Case, Verdict, Written, kind_of
from wholebody.bench.attack.mutations import mutated
from wholebody.bench.attack.report import Row, keep, percentiles, report
from wholebody.bench.attack.running import Ended, attack, write

RIGHT = 'from wholebody.bench.attack.case import Verdict\nverdict = Verdict("right", "as it should be")\n'
SCRIPTS = {
    0: RIGHT,
    1: "while True:\n    pass\n",
    2: "import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n",
    3: "raise ZeroDivisionError('by nothing')\n",
    4: "import wholebody as wb\nwb.Sphere(-1.0)\n",
    5: RIGHT,
    6: f"import time\ntime.sleep(0.7)\n{RIGHT}",  # as where others have the processor
}
FACTS = {"wholebody": "0"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_case_depends_on_its_seed_and_number_alone(kind: str) -> None:
    first = [write(Case(3, number, kind)) for number in (0, 1)]
    again = [write(Case(3, number, kind)) for number in (1, 0)][::-1]
    assert first == again
    assert len({each.script + repr(each.files) for each in first}) == 2
    assert write(Case(4, 0, kind)) != first[0]


def test_every_kind_has_its_turn_and_files_are_twice_the_solves() -> None:
    kinds = [kind_of(number) for number in range(3 * len(PATTERN))]
    assert set(kinds) == set(KINDS)
    assert kinds.count("file") >= 1.5 * kinds.count("solve")
    with pytest.raises(UnknownNameError, match="solve"):
        write(Case(0, 0, "solv"))


def test_mutations_change_text_and_keep_to_their_seed() -> None:
    text = b"size = [0.1, 0.2, 0.3]\nname = 'box'\n"
    found = [mutated(text, np.random.default_rng(seed)) for seed in range(200)]
    assert sum(each != text for each in found) > 180
    assert found[7] == mutated(text, np.random.default_rng(7))


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let children run what `SCRIPTS` says in place of real cases; forked, they have this from their parent."""
    monkeypatch.setattr(running, "Child", lambda environment: Child(environment, forked=True))
    monkeypatch.setattr(running, "write", lambda case: Written(SCRIPTS[case.number], {"note.txt": b"beside it"}))
    monkeypatch.setattr(running, "_prepare", lambda: None)


def cases() -> Iterator[Case]:
    return (Case(0, number, "solve") for number in SCRIPTS)


@pytest.mark.usefixtures("scripted")
def test_the_attack_goes_on_after_hangs_crashes_and_errors() -> None:
    found = {ended.case.number: ended for ended in attack(cases(), 2, lambda: True, deadline=0.4)}
    outcomes = {number: ended.verdict.outcome for number, ended in found.items()}
    assert outcomes == {0: "right", 1: "wrong", 2: "wrong", 3: "wrong", 4: "refused", 5: "right", 6: "right"}
    assert "hangs" in found[1].verdict.words
    assert "SIGKILL" in found[2].verdict.words
    assert "ZeroDivisionError" in found[3].verdict.words
    assert "Sphere: radius" in found[4].verdict.words
    assert found[2].written == Written(SCRIPTS[2], {"note.txt": b"beside it"})


@pytest.mark.usefixtures("scripted")
def test_no_case_is_begun_when_the_time_is_over() -> None:
    asked = iter([True, True, False])
    short = (Case(0, number, "solve") for number in (0, 5, 0))
    assert [ended.case.number for ended in attack(short, 1, lambda: next(asked), deadline=30.0)] == [0, 5]


def test_a_failure_is_repeated_by_its_script(tmp_path: Path) -> None:
    case = Case(3, 2, "argument")
    keep(Ended(case, write(case), Verdict("wrong", "something")), tmp_path)
    place = tmp_path / case.name
    assert (place / "found.txt").read_text() == "something\n"
    assert (place / "robot.urdf").is_file()
    done = subprocess.run([sys.executable, str(place / SCRIPT)], capture_output=True, text=True, check=False)
    assert "Verdict(" in done.stdout or "Error" in done.stderr


def test_a_case_that_cannot_be_written_is_repeated_too(tmp_path: Path) -> None:
    case = Case(1, 5, "sweep")
    keep(Ended(case, None, Verdict("wrong", "something")), tmp_path)
    script = (tmp_path / case.name / SCRIPT).read_text()
    assert "write(Case(1, 5, 'sweep'))" in script
    compile(script, SCRIPT, "exec")


def test_counts_times_and_intervals_are_reported() -> None:
    rows = [Row("solve", 0, k, "right", "solved", 0.01 * (k + 1), "") for k in range(100)]
    rows += [Row("solve", 0, 100, "wrong", "solved", 6.0, "a false claim")]
    rows += [Row("file", 0, k, "refused", "", 0.0, "") for k in range(10)]
    count, middle, high, most = percentiles(rows)
    assert (count, middle, most) == (101, pytest.approx(0.51), 6.0)
    assert 0.9 < high < 1.0
    text = report(rows, FACTS)
    assert "| 101 | 100 | 0 | 0 | **1** |" in text
    assert "more than 5 s: **1**" in text


def test_what_was_never_wrong_may_be_so_in_the_next_case() -> None:
    rows = [Row("file", 0, k, "right", "", 0.0, "") for k in range(200)]
    assert "| 200 | 200 | 0 | 0 | 0 | 1.9 % |" in report(rows, FACTS)  # Wilson's interval for 200 of 200, as published


@pytest.mark.parametrize("said", ["os.write(1, b'a line\\n')", "ctypes.CDLL(None).puts(b'a line')"])
def test_what_prints_is_wrong(said: str, capfd: pytest.CaptureFixture[str]) -> None:
    script = "import ctypes, os\nfrom wholebody.bench.attack.case import Verdict\n"
    script += "{said}\nverdict = Verdict('right', 'all')\nprint(verdict)\n"
    assert running.run(Written(script.format(said="pass"))).outcome == "right"
    wrong = running.run(Written(script.format(said=said)))
    assert (wrong.outcome, wrong.words) == ("wrong", "prints 1 lines, the first 'a line'")
    assert "a line" not in capfd.readouterr().out

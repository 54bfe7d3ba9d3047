"""Counts beside locked ones: what is told, and what is worse."""

from __future__ import annotations

import pytest

import tests.audits.regress.selection as selected
from tests.audits.__main__ import main
from tests.audits.regress.comparison import LOCKED, MARGINS, compared, read, write
from tests.audits.regress.selection import Run, selection
from wholebody.base.errors import FileFormatError

BEFORE = {"solve a": {"status": "solved", "iterations": 100, "pairs": 10}}


def told(counts, name="solve a", before=None):
    return [(one.worse, one.sentence) for one in compared(before or BEFORE, [Run(name, counts, 0.0)])]


def test_counts_within_their_margins_are_not_told():
    for iterations, pairs in ((100, 10), (110, 40), (90, 0), (95, 25)):
        assert told({"status": "solved", "iterations": iterations, "pairs": pairs}) == []


def test_a_count_above_its_margin_is_worse_and_one_below_it_is_told():
    ((worse, sentence),) = told({"status": "solved", "iterations": 111, "pairs": 10})
    assert worse
    assert sentence == "solve a: iterations: 111 in place of 100, more by 11 where 10 is allowed"
    ((worse, sentence),) = told({"status": "solved", "iterations": 89, "pairs": 10})
    assert not worse
    assert "fewer by 11" in sentence
    ((worse, sentence),) = told({"status": "solved", "iterations": 100, "pairs": 41})
    assert worse
    assert sentence == "solve a: pairs that coal was asked for: 41 in place of 10, more by 31 where 30 is allowed"


@pytest.mark.parametrize(
    ("before", "now", "worse"),
    [
        ("solved", "unreachable", True),
        ("unreachable", "stalled", True),
        ("unreachable", "infeasible", True),
        ("stalled", "solved", False),
        ("solved", "wonderful", True),
    ],
)
def test_a_status_is_worse_by_its_rank(before, now, worse):
    (found,) = told({"status": now}, before={"solve a": {"status": before}})
    assert found == (worse, f"solve a: its status is {now!r}, which was {before!r}")


def test_what_is_new_is_told_and_what_is_gone_is_worse():
    (new, gone) = told({"status": "solved"}, name="solve b")
    assert (new[0], gone[0]) == (False, True)
    assert "solve b: is not locked yet" in new[1]
    assert "solve a: is locked but was not counted" in gone[1]
    (found,) = told({"status": "solved", "rows": 3})
    assert found == (False, "solve a: rows is 3 and not locked yet; lock it with --update")


def test_locked_counts_are_read_back(tmp_path):
    path = tmp_path / "locked.json"
    write([Run(name, counts, 1.0) for name, counts in BEFORE.items()], path)
    assert read(path) == BEFORE


@pytest.mark.parametrize("text", ["", "[1]", '{"a": 3}', '{"a": {"b": 1.5}}', '{"a": {"b": null}}'])
def test_another_file_is_refused(tmp_path, text):
    path = tmp_path / "locked.json"
    path.write_text(text)
    with pytest.raises(FileFormatError, match="write it anew with --update"):
        read(path)


def test_the_locked_file_is_of_the_selection_and_all_its_counts_have_margins():
    locked = read(LOCKED)
    assert list(locked) == [name for name, _ in selection()]
    assert {name for counts in locked.values() for name in counts} == {"status", *MARGINS}


def test_the_command_ends_with_1_where_something_is_worse(tmp_path, monkeypatch, capsys):
    path = tmp_path / "locked.json"
    now = {"status": "solved", "iterations": 100}
    monkeypatch.setattr(selected, "runs", lambda: iter([Run("solve a", dict(now), 0.01)]))
    command = ["regress", "--locked", str(path)]
    assert main([*command, "--update"]) == 0
    assert read(path) == {"solve a": now}
    assert main(command) == 0
    assert "all counts are within their margins" in capsys.readouterr().out
    now["iterations"] = 120
    assert main(command) == 1
    assert "worse: solve a: iterations: 120 in place of 100" in capsys.readouterr().out
    now["iterations"] = 50
    assert main(command) == 0
    assert "differs: solve a: iterations: 50" in capsys.readouterr().out
    assert main([*command, "--update"]) == 0
    assert main(["regress", "--locked", str(tmp_path / "absent.json")]) == 2

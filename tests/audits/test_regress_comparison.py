"""Counts beside locked ones: what is told, and what is worse."""

from __future__ import annotations

import pytest

import tests.audits.regress.selection as selected
from tests.audits.__main__ import main
from tests.audits.regress.comparison import LOCKED, MARGINS, compared, read
from tests.audits.regress.selection import Run, selection
from wholebody.base.errors import FileFormatError

BEFORE = {"solve a": {"status": "solved", "iterations": 100, "pairs": 10}}


def worse(counts, name="solve a", before=None):
    """Of each count that is told, whether it is worse."""
    return [one.worse for one in compared(before or BEFORE, [Run(name, counts, 0.0)])]


@pytest.mark.parametrize(
    ("iterations", "pairs", "found"),
    [(100, 10, []), (110, 40, []), (90, 0, []), (111, 10, [True]), (100, 41, [True]), (89, 10, [False])],
)
def test_a_count_above_its_margin_is_worse_and_one_below_it_is_told(iterations, pairs, found):
    assert worse({"status": "solved", "iterations": iterations, "pairs": pairs}) == found


@pytest.mark.parametrize(
    ("before", "now", "found"),
    [("solved", "unreachable", True), ("unreachable", "infeasible", True), ("stalled", "solved", False),
     ("solved", "wonderful", True)],
)  # fmt: skip
def test_a_status_is_worse_by_its_rank(before, now, found):
    assert worse({"status": now}, before={"solve a": {"status": before}}) == [found]


def test_what_is_new_is_told_and_what_is_gone_is_worse():
    assert worse({"status": "solved"}, name="solve b") == [False, True]
    assert worse({"status": "solved", "rows": 3}) == [False]


@pytest.mark.parametrize("text", ["", "[1]", '{"a": 3}', '{"a": {"b": null}}'])
def test_another_file_is_refused(tmp_path, text):
    path = tmp_path / "locked.json"
    path.write_text(text)
    with pytest.raises(FileFormatError, match="--update"):
        read(path)


def test_the_locked_file_is_of_the_selection_and_all_its_counts_have_margins():
    locked = read(LOCKED)
    assert list(locked) == [name for name, _ in selection()]
    assert {name for counts in locked.values() for name in counts} == {"status", *MARGINS}


def test_the_command_ends_with_1_where_something_is_worse(tmp_path, monkeypatch):
    path, now = tmp_path / "locked.json", {"status": "solved", "iterations": 100}
    monkeypatch.setattr(selected, "runs", lambda: iter([Run("solve a", dict(now), 0.01)]))
    command = ["regress", "--locked", str(path)]
    assert main([*command, "--update"]) == 0
    assert read(path) == {"solve a": now}
    for iterations, code in ((100, 0), (120, 1), (50, 0)):
        now["iterations"] = iterations
        assert main(command) == code
    assert main(["regress", "--locked", str(tmp_path / "absent.json")]) == 2

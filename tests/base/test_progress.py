"""Work that is asked for progress tells it in one line, which is renewed."""

from __future__ import annotations

import pytest

import wholebody as wb


def test_a_line_counts_what_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    hand = wb.Scene(wb.load("hand"))
    problems = [wb.Problem(hand, goals=[wb.Point("right_index_tip", (0.05, 0.0, 0.1))]) for _ in range(3)]
    wb.solve_many(problems, progress=True)
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told.startswith("\r....................")
    assert " 3 of 3, " in told.rsplit("\r", 1)[-1]
    wb.solve_many(problems, progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(wb.InputError, match="progress"):
        wb.solve_many(problems, progress=3)  # type: ignore[arg-type]

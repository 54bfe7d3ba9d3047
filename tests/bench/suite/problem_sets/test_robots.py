"""The set of public robot descriptions, where WHOLEBODY_ROBOTS names their folder."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.registry import SETS, problem_set


@pytest.mark.parametrize("number", [0, 1, 15])
def test_a_problem_has_a_free_witness_and_a_free_start_that_is_no_answer(number: int) -> None:
    if not os.environ.get("WHOLEBODY_ROBOTS"):
        pytest.skip("no robot descriptions here; WHOLEBODY_ROBOTS names their folder")
    case = problem_set("robots").make(number, 0)
    witness, start = wb.assess(case.problem, case.witness), wb.assess(case.problem, case.problem.start)
    assert witness.met(1e-9)
    assert witness.holds(1e-9)
    assert start.holds(1e-9)
    assert not start.met(1e-3)
    if number == 0:
        assert np.array_equal(case.witness, problem_set("robots").make(number, 0).witness)
    assert isinstance(case.problem.goals[0], wb.Frame if number >= 12 else wb.Point)


def test_without_the_files_a_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for value in ("", str(tmp_path)):
        monkeypatch.setenv("WHOLEBODY_ROBOTS", value)
        with pytest.raises(InputError, match="example-robot-data"):
            robots.folder()
    assert "robots" not in SETS
    assert len(set(robots.of_robots.files)) == 12

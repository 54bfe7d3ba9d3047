"""What is the tool's time and what is the adapter's is told apart."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.compare.results import DEFAULT
from wholebody.bench.suite.compare.solving import Ready, solve
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.methods.differential import Stopwatch


def test_a_stopwatch_counts_what_is_within_it(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimpleNamespace(perf_counter=iter((1.0, 3.0, 10.0, 14.0)).__next__)
    monkeypatch.setattr("wholebody.methods.differential.time", clock)
    watch = Stopwatch()
    for _ in range(2):
        with watch:
            pass
    assert watch.seconds == 6.0


@pytest.mark.parametrize("name", ["placo", "pink", "mink", "placo/starts", "qp"])
def test_the_tool_has_a_part_of_the_time_and_our_own_methods_have_no_tool(name: str, root: Path) -> None:
    pytest.importorskip(name.partition("/")[0] if name != "qp" else "numpy")
    figure = wb.load(root / "tests/data/arm/arm.urdf")
    problem = wb.Problem(wb.Scene(figure), goals=[wb.Point(figure.model.names[-1], (0.2, 0.2, 0.5))])
    (adapter,) = adapters([name])
    record, _ = solve(adapter, DEFAULT, Ready(Case("free", 0, problem, np.zeros(figure.model.nq)), 1.0))
    assert record.answered, record.said
    if name == "qp":
        assert record.tool_seconds == 0.0
    else:
        assert 0.0 < record.tool_seconds < record.seconds

"""What every case must be, and what our default method makes of some."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.assessment.posture import assess
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.stability.asking import ask, judge
from wholebody.bench.suite.stability.catalogue import HardCase, Nonsense, Posed, Stream, cases, names, quick
from wholebody.bench.suite.stability.verdict import decide

FAST = (
    "straight-arm", "out-by-1-mm", "conflict", "start-30-cm-inside", "cancelling-normals", "narrow-passage",
    "weight-1e-12", "not-a-number", "goal-jumps-1-m", "wrong-active-set", "moving-obstacle",
)  # fmt: skip


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_every_case_is_told_and_can_be_asked(case: HardCase) -> None:
    for text in (case.title, case.why, case.acceptable):
        assert text == text.strip() != ""
    assert case.acceptable.endswith(".")
    assert case.accepts(case.expected, 0.0)
    assert not case.accepts("wrong", 0.0)
    question = case.question()
    if isinstance(question, (Posed, Stream)):
        start = question.problem.scene.figure.clamp(question.problem.start)
        inside = assess(question.problem, start).penetration
        depth = {"start-1-mm-inside": 1e-3, "start-5-cm-inside": 0.05, "start-30-cm-inside": 0.3}
        depth |= {"cancelling-normals": 0.015, "coincident-centres": 0.1}
        assert inside == pytest.approx(depth.get(case.name, 0.0), abs=2e-6)


def test_names_are_unique_and_unknown_ones_are_refused() -> None:
    assert len(set(names())) == len(names())
    assert set(quick()) < set(names())
    with pytest.raises(UnknownNameError, match="straight-arm"):
        cases(["straight"])


def test_every_nonsense_is_refused_by_what_states_problems() -> None:
    qp = adapters(["qp/osqp"])[0]
    question = cases(["not-a-number"])[0].question()
    assert isinstance(question, Nonsense)
    for attempt in question.attempts.values():
        with pytest.raises(InputError):
            attempt(qp)


def test_best_answers_that_are_known_are_possible() -> None:
    """Postures found by hand: no method is asked."""
    postures = {
        "out-by-1-mm": (-0.7, 0.0, 0.0),
        "out-by-1-m": (-0.7, 0.0, 0.0),
        "cancelling-normals": (-0.12, 0.0, 0.5),
        "coincident-centres": (0.0, 0.1, 0.5),
        "edge-on-edge": (0.02, 0.01, 0.3 + 0.2 * np.sqrt(2.0)),
    }
    for name, q in postures.items():
        case = cases([name])[0]
        question = case.question()
        assert isinstance(question, Posed)
        found = assess(question.problem, np.array(q))
        assert case.best is not None
        assert found.goal_error == pytest.approx(case.best, abs=1e-9)
        assert max(found.penetration, found.limit_violation) < 2e-6


@pytest.mark.parametrize("name", FAST)
def test_qp_is_never_wrong(name: str) -> None:
    (qp,), (case,) = adapters(["qp/osqp"]), cases([name])
    answer = ask(case, qp)
    assert decide(case, answer, judge(case, answer)).kind != "wrong"

"""Every installed entrant solves a free reach of an arm, and says what it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.entrants import Entrant, entrants, missing, names, set_up
from wholebody.errors import MissingPackageError, UnknownNameError

INSTALLED = entrants()


by_name = pytest.mark.parametrize("entrant", INSTALLED, ids=lambda entrant: entrant.name)


@pytest.fixture(scope="module")
def reach(root: Path) -> wb.Problem:
    """Return a reach of a robot arm that a known posture makes possible."""
    figure = wb.load(root / "tests/data/arm/arm.urdf")
    witness = figure.clamp(pin.integrate(figure.model, figure.neutral, np.full(figure.model.nv, 0.4)))
    state = wb.Scene(figure).state(witness)
    tip = figure.model.names[-1]
    there = pin.SE3(state.frame(figure.frame_id(tip)))
    return wb.Problem(wb.Scene(figure), goals=[wb.Point(tip, there.translation, offset=(0.0, 0.0, 0.1))])


@by_name
def test_it_states_what_it_is_and_its_budgets_are_usable(entrant: Entrant) -> None:
    assert entrant.name in names()
    assert entrant.setup.endswith(".")
    assert all(sentence and not sentence.endswith(".") for sentence in entrant.differences)
    tolerances = [tolerance for tolerance, iterations in entrant.loose if iterations is None]
    assert tolerances == sorted(tolerances, reverse=True)
    for budget in entrant.loose:
        assert entrant.make(*budget) is not entrant.make(*budget)


@by_name
def test_it_solves_a_free_reach_of_an_arm(entrant: Entrant, reach: wb.Problem) -> None:
    method = entrant.make(1e-4, None)
    set_up(method, reach)
    solution = method.solve(reach)
    judged = wb.assess(reach, solution.q)
    assert solution.status == "solved", solution.message
    assert judged.met(1.1e-4)
    assert judged.holds(1.1e-4)
    assert solution.assessment.goal_error == pytest.approx(judged.goal_error, abs=1e-12)


def test_unknown_and_missing_entrants_are_named() -> None:
    with pytest.raises(UnknownNameError, match="qp/osqp"):
        entrants(["qp/osqq"])
    assert [entrant.name for entrant in entrants(["ccd", "qp/daqp"])] == ["ccd", "qp/daqp"]
    assert {entrant.name for entrant in INSTALLED} | set(missing()) == set(names())
    for name, command in missing().items():
        assert command.startswith("pip install")
        with pytest.raises(MissingPackageError, match="pip install"):
            entrants([name])

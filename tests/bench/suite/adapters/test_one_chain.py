"""Solvers of one chain as methods: they solve chains, and refuse by name what they cannot express."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.registry import adapters, installed
from wholebody.bench.suite.problem_sets import robots

NAMES = [name for name in ("optik", "tracik", "eaik") if installed(name)]
pytestmark = pytest.mark.skipif(not NAMES, reason="no solver of one chain is installed")


@pytest.mark.parametrize("kind", robots.of_arm.kinds)
@pytest.mark.parametrize("name", NAMES)
def test_it_places_the_tool_of_an_arm(name: str, kind: str) -> None:
    if name == "eaik" and kind == "seven axes":
        return
    rng = np.random.default_rng(4)
    figure, start = robots.arm(kind, rng)
    witness = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
    target = figure.placement(witness, "tool")
    problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Frame("tool", target)])
    (adapter,) = adapters([name])
    q = adapter.make(1e-6, None).solve(problem).q
    assert figure.within_limits(q)
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    there = data.oMf[figure.frame_id("tool")]
    assert np.linalg.norm(pin.log6(there.actInv(pin.SE3(target))).vector) <= 2e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_place_out_of_reach_is_not_called_solved(name: str) -> None:
    figure, start = robots.arm("industrial", np.random.default_rng(1))
    problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Frame("tool", (5, 0, 0))])
    (adapter,) = adapters([name])
    solution = adapter.make(1e-4, None).solve(problem)
    assert not solution.solved
    assert solution.assessment.goal_error > 3.0


@pytest.mark.parametrize("name", NAMES)
def test_what_it_cannot_express_is_refused_and_named(root: Path, name: str) -> None:
    (adapter,) = adapters([name])
    optik = adapter.make(1e-4, None)
    human = wb.Scene(wb.load("human"))
    point = wb.Problem(human, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))])
    assert "Point" in str(optik.accepts(point))
    free = wb.Problem(human, goals=[wb.Frame("right_palm", (0.4, -0.2, 1.0))], range_of_motion=False)
    with pytest.raises(InputError, match="free root"):
        optik.solve(free)

"""The random reaches are possible: their witnesses are judged as any answer is."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.measure.reaches import reach, solve_reach
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE
from wholebody.bench.suite.problem_sets.reaching import THINGS
from wholebody.bench.suite.problem_sets.things import KINDS


@pytest.mark.parametrize("seed", range(4))
def test_the_witness_reaches_the_target_and_violates_nothing(seed: int) -> None:
    made = reach(seed)
    judged = wb.assess(made.problem, made.witness)
    assert judged.met(1e-9)
    assert judged.holds(1e-9)
    assert judged.constraint_violation < 1e-12
    assert made.problem.scene.figure.within_limits(made.witness)


def test_the_witness_and_the_start_are_clear_of_all_objects() -> None:
    made = reach(1)
    scene, floor = made.problem.scene, "floor"
    owners = scene.piece_owner
    for q in (made.witness, made.problem.start):
        near = scene.contacts(q, within=CLEARANCE)
        pairs = {frozenset((owners[a], owners[b])) for a, b in near.pair}
        assert all(floor in pair for pair in pairs), pairs
    assert len(scene.objects) == THINGS + 1
    assert {name.split()[0] for name in scene.objects} == {*KINDS, floor}


def test_a_seed_makes_one_reach_and_another_seed_another() -> None:
    first, again, other = reach(3), reach(3), reach(4)
    assert (first.witness == again.witness).all()
    for name, thing in first.problem.scene.objects.items():
        assert again.problem.scene.objects[name].placement == thing.placement
    assert not np.allclose(first.witness, other.witness)


def test_a_row_is_what_the_assessment_says() -> None:
    row = solve_reach(0, "qp")
    assert row.status == "solved"
    assert row.how in ("directly", "by feasibility first", "from another start")
    assert row.goal_error < 2e-5
    assert row.penetration < 1e-4
    assert row.limit_violation < 1e-9
    assert row.measure > 0.0

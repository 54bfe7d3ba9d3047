"""Descents of chains to contacts: planes against distances, ends against descents of the whole problem."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.methods.control import Control
from wholebody.methods.qp import chain_goals_kernel
from wholebody.methods.qp.at_contacts import MARGIN, AtContacts
from wholebody.methods.qp.chain import from_seeds
from wholebody.methods.qp.chain_problem import Asked, chains_of, distance_of, goal_entries, how_far
from wholebody.methods.qp.settings import Settings


def asked_of(problem: wb.Problem, chain, workspace) -> AtContacts:
    asked = Asked.by(problem, chain, goal_entries(problem), distance_of(problem, chain))
    most = float(problem.clearances.max())
    return AtContacts(
        chain, asked.goals, asked.at, asked.nearest, problem.clearances, most, workspace, how_far(Settings(), 1, True)
    )


def test_planes_are_distances_and_their_rates():
    """Beyond its plane each pair keeps its clearance; the rows are central differences of coal's distances."""
    figure, start = robots.known_arm("panda")
    rng, away = np.random.default_rng(4), list[float]()
    scene = wb.Scene(figure).add(wb.Sphere(0.2), name="ball", at=(0.5, 0.1, 0.6))
    problem = wb.Problem(scene, start, goals=[wb.Point("tool", (0.5, 0.2, 0.4))], clearance=0.004)
    with chains_of(problem).borrow() as chains, problem.borrow() as workspace:
        chain = chains.carrying(goal_entries(problem))
        contacts = asked_of(problem, chain, workspace)
        for _ in range(30):
            q = rng.uniform(figure.limits.lower, figure.limits.upper)
            near = workspace.near(q, 0.05)
            gaps = near.distance - problem.clearances[near.number]
            planes = contacts._planes(near, gaps)
            goals = contacts._beyond([planes])
            room = chain.room(len(goals.one_sided))
            chain_goals_kernel.evaluate(chain.chain, goals, room, q)
            chain_goals_kernel.evaluate_others(chain.chain, goals, room)
            chain_goals_kernel.rows_of_others(chain.chain, goals, room)
            value, rows = room.value[3:].copy(), room.jacobian[3:].copy()
            np.testing.assert_allclose(np.sort(value), np.sort(gaps)[: len(value)] - MARGIN, atol=1e-9)

            def gap(at: Array, which: int) -> float:
                there = workspace.near(at, 0.2)
                return float(there.distance[there.number == which][0])

            order = np.argsort(gaps, kind="stable")[: len(value)]
            for row, pair in zip(rows, near.number[order].tolist(), strict=True):
                if gap(q, pair) > 0.0:
                    slope = [(gap(q + d, pair) - gap(q - d, pair)) / 1e-3 for d in 5e-4 * np.eye(7)]
                    away.append(float(np.abs(row - slope).max()))
    assert len(away) > 10
    # Coal stops within 1e-6 m, and where two capsules are nearly parallel other points become the nearest.
    assert np.quantile(away, 0.8) < 3e-3


def test_ends_at_contacts_are_free_minima():
    """A descent of the whole problem from such an end gains nothing, and a solve ends no higher."""
    rng, count = np.random.default_rng(8), 0
    for number in (2, 4, 6, 7) * 12:
        problem, _ = robots.into("shelf", number, rng)
        with problem.borrow() as workspace:
            met = from_seeds(problem, workspace, Settings(), Control())
        if met is None or met.through is None or not met.complete:
            continue
        count += 1
        judged = wb.assess(problem, met.q)
        assert judged.met(1e-6)
        assert judged.holds(0.0)
        assert wb.solve(problem).assessment.measure <= judged.measure + 1e-12
        again = next(wb.methods.QP().minima(problem, [met.q]))
        assert judged.measure <= 1.002 * again.assessment.measure
        if count == 4:
            break
    assert count == 4


@pytest.mark.parametrize("fails", [True, False])
def test_what_is_led_to_no_contact_stays_known(monkeypatch, fails):
    """Where ends of much less effort are led nowhere, the whole problem is descended from too."""
    rng, least, count = np.random.default_rng(8), AtContacts.least, 0
    monkeypatch.setattr(AtContacts, "least", lambda *args: None if fails else least(*args))
    for number in (2, 4, 6, 7) * 6:
        problem, _ = robots.into("shelf", number, rng)
        with problem.borrow() as workspace:
            met = from_seeds(problem, workspace, Settings(), Control())
            if met is not None and met.through is not None:
                at = problem.start
                far = [
                    float(one.value(workspace.state.update(q)))
                    for one in problem.measures
                    for q in (met.through, met.q)
                ]
                count += 1
                if fails and not np.array_equal(met.q, at):
                    assert met.complete == (far[0] >= 0.9 * far[1])
    assert count > 2


def test_free_postures_are_led_to_less_effort():
    """Where what takes least effort is blocked, no descent from twenty other starts ends much lower than a solve."""
    case = problem_set("arms_among_things").make(148, 5501)
    problem, limits = case.problem, case.problem.scene.figure.limits
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    starts = np.random.default_rng(1).uniform(lower, upper, (20, 7))
    ends = [end.assessment for end in wb.methods.QP().minima(problem, starts) if end.status == "solved"]
    assert len(ends) > 5
    assert wb.solve(problem).assessment.measure <= 1.01 * min(judged.measure for judged in ends)

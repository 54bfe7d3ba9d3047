"""Descents of chains to contacts: planes against distances, ends against descents of the whole problem."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import robots
from wholebody.methods.control import Control
from wholebody.methods.qp import chain_goals_kernel
from wholebody.methods.qp.at_contacts import MARGIN, AtContacts
from wholebody.methods.qp.chain import Descents, from_seeds
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
    rng, compared = np.random.default_rng(4), 0
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
            for step in (chain_goals_kernel.evaluate, chain_goals_kernel.evaluate_others):
                step(chain.chain, goals, room, q)
            chain_goals_kernel.rows_of_others(chain.chain, goals, room)
            value, rows = room.value[3:].copy(), room.jacobian[3:].copy()
            np.testing.assert_allclose(np.sort(value), np.sort(gaps)[: len(value)] - MARGIN, atol=1e-9)

            def gap(at: Array, which: int) -> float:
                there = workspace.near(at, 0.2)
                return float(there.distance[there.number == which][0])

            order = np.argsort(gaps, kind="stable")[: len(value)]
            for row, pair in zip(rows, near.number[order].tolist(), strict=True):
                if gap(q, pair) > 0.0:
                    slope = [(gap(q + d, pair) - gap(q - d, pair)) / 2e-4 for d in 1e-4 * np.eye(7)]
                    np.testing.assert_allclose(row, slope, atol=2e-3)  # capsules are smooth; coal stops within 1e-6 m
                    compared += 1
    assert compared > 10


@pytest.mark.parametrize("kind", ["table", "shelf"])
def test_ends_at_contacts_are_free_minima(kind):
    """A descent of the whole problem from such an end gains nothing, and no other one from 6 random starts much."""
    rng, count = np.random.default_rng(8), 0
    for number in (2, 4, 6, 7) * 6:
        problem, _ = robots.into(kind, number, rng)
        with problem.borrow() as workspace:
            met = from_seeds(problem, workspace, Settings(), Control())
        if met is None or met.through is None or not met.complete:
            continue
        count += 1
        judged = wb.assess(problem, met.q)
        assert judged.met(1e-6)
        assert judged.holds(0.0)
        assert wb.solve(problem).assessment.measure <= judged.measure + 1e-12
        again = next(wb.methods.QP().minima(problem.with_measures(problem.measures) if False else problem, [met.q]))
        assert judged.measure <= 1.002 * again.assessment.measure
        if count == 3:
            break
    assert count == 3


def test_what_failed_stays_known(monkeypatch):
    """Where an end of much less effort is led to no contact, the whole problem is descended from too."""
    problem, _ = robots.into("shelf", 2, np.random.default_rng(8))
    monkeypatch.setattr(AtContacts, "least", lambda *_: None)
    with problem.borrow() as workspace:
        met = from_seeds(problem, workspace, Settings(), Control())
    assert met is None or not met.complete or met.through is None
    assert hasattr(Descents, "run")

"""Steps that turn: none ends inside of a plate that is thinner than what their turning was once allowed to hide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.methods.qp.settings import TRACKING
from wholebody.methods.qp.turning import Turning

THIN = 2e-4  # m
DT = 0.01
INSIDE = 1e-5  # m: most that a step may end inside
ON_ITS_WAY = 1e-4  # m: most that it may be inside on its way, half of which a sweep with this tolerance may report
SHAPES = {"capsule": (wb.Capsule(0.02, 0.2), (0.0, 0.0, 0.1)), "box": (wb.Box((0.06, 0.08, 0.2)), (0.03, 0.02, 0.1))}


def over_the_edge(figure: wb.Figure, offset: tuple[float, ...], seed: int) -> wb.Problem:
    """A point of a free body is asked to the other side of a plate, just within its edge; clearance 0."""
    rng = np.random.default_rng(seed)
    turned = pin.exp3(2.0 * rng.normal(size=3))
    along, across, normal = turned.T
    scene = wb.Scene(figure).add(wb.Box((0.4, 0.4, THIN)), name="plate", at=pin.SE3(turned, np.zeros(3)))
    start = np.zeros(7)
    start[:3] = along * rng.uniform(0.1, 0.5) + normal * rng.choice([-1, 1]) * rng.uniform(0.12, 0.3)
    start[:3] += across * rng.uniform(-0.2, 0.2)
    start[3:] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    goal = along * rng.uniform(0.15, 0.21) - normal * np.sign(start[:3] @ normal) * rng.uniform(0.0, 0.05)
    goal += across * rng.uniform(-0.2, 0.2)
    return wb.Problem(scene, start=start, goals=[wb.Point("body0", goal, offset=np.array(offset))], clearance=0.0)


def beside_a_plate(figure: wb.Figure, seed: int) -> wb.Problem:
    """The tip of an arm is asked past the edge of a plate, whose edge is on its way; clearance 0."""
    rng = np.random.default_rng(seed)
    start = np.array([0.3, -1.2, -0.5]) + 0.3 * rng.normal(size=3)
    scene = wb.Scene(figure)
    tip = scene.state(start).frame(scene.frame_id("tip")).translation.copy()
    towards = rng.normal(size=3)
    towards[2] = 0.0
    towards /= np.linalg.norm(towards)
    edge = tip + towards * rng.uniform(0.06, 0.3)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    turned = pin.utils.rotate("z", angle)
    middle = edge + rng.choice([-0.15, 0.15]) * turned[:, 1]
    scene.add(wb.Box((THIN, 0.3, 0.6)), name="plate", at=pin.SE3(turned, middle))
    goal = edge + rng.uniform(0.0, 0.2) * towards + rng.normal(size=3) * [0.03, 0.03, 0.0]
    return wb.Problem(scene, start=start, goals=[wb.Point("tip", goal)], clearance=0.0)


def followed(problem: wb.Problem, least_distance: Any, steps: int) -> tuple[float, list[int]]:
    """Least distance at the end of any step, metres, and numbers of the steps that pass through something."""
    scene, q, tracker = problem.scene, problem.start, wb.methods.QP().tracker(problem, DT)
    sweep, ends, through = Sweep(scene.model, scene.geometry), [], []
    for number in range(steps):
        step = tracker.step(q)
        ends.append(least_distance(scene, step.q))
        if sweep.first_contact(q, step.q, tolerance=ON_ITS_WAY) is not None:
            through.append(number)
        q = step.q
    return min(ends), through


@pytest.mark.parametrize(
    ("shape", "seed"), [*(("capsule", k) for k in (9, 17, 40)), *(("box", k) for k in (8, 16, 23))]
)
def test_no_step_dips_into_the_edge_of_a_thin_plate(free_bodies, least_distance, shape, seed):
    """By 0.12 to 0.24 mm before turning was bounded for each pair by itself."""
    body, offset = SHAPES[shape]
    nearest, through = followed(over_the_edge(free_bodies(body), offset, seed), least_distance, 55)
    assert -INSIDE < nearest < 1e-3  # it comes to the plate, or nothing is tested
    assert through == []


def test_no_arm_dips_into_the_edge_of_a_thin_plate(planar_arm, least_distance):
    """By 0.11 to 1.8 mm before."""
    seed = 45
    nearest, through = followed(beside_a_plate(planar_arm((0.4, 0.4, 0.3)), seed), least_distance, 30)
    assert -INSIDE < nearest < 1e-3
    assert through == []


def test_what_turns_far_from_everything_is_not_looked_at(free_bodies, monkeypatch):
    """One body rests on a plate; another one, metres away, turns fast."""
    scene = wb.Scene(free_bodies(wb.Sphere(0.05), wb.Capsule(0.05, 0.4)))
    scene.add(wb.Box((0.4, 0.4, 0.02)), name="plate")
    start = scene.figure.neutral
    start[:3], start[7:10] = (0.0, 0.0, 0.06001), (5.0, 0.0, 0.0)
    still = [wb.Point("body0", start[:3]), wb.Point("body1", start[7:10])]
    problem = wb.Problem(scene, start=start, goals=[*still, wb.Axis("body1", (0, 0, 1.0), direction=(0, 0, 1.0))])
    tracker, q = wb.methods.QP().tracker(problem, DT), problem.start
    q = tracker.step(q).q
    looked, near = [], tracker.workspace.near
    monkeypatch.setattr(tracker.workspace, "near", lambda *room: looked.append(room) or near(*room))
    for k in range(1, 20):
        direction = (np.sin(0.1 * k), 0.0, np.cos(0.1 * k))
        problem.retarget([*still, wb.Axis("body1", (0, 0, 1.0), direction=direction)])
        step = tracker.step(q)
        assert np.linalg.norm(step.displacement[9:]) > 0.03
        q = step.q
    assert looked == []


def test_the_bound_holds_for_random_displacements(planar_arm, least_distance):
    """A capsule of an arm and a box: where the bound says so, a pair ends no nearer than its rows say."""
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3))).add(wb.Box((0.3, THIN, 0.6)), name="plate", at=(0.9, 0.25, 0.0))
    problem = wb.Problem(scene, start=np.array([0.1, 0.2, 0.1]), clearance=TRACKING.unseen)  # all of it may go unseen
    tracker, rng, trusted = wb.methods.QP().tracker(problem, DT), np.random.default_rng(0), 0
    workspace, lineariser = tracker.workspace, problem.lineariser(tracker.workspace, DT)
    program = tracker._program  # the rows that the bound is about
    turning = Turning(workspace)
    for _ in range(200):
        q = problem.start + 0.1 * rng.normal(size=3)
        if least_distance(scene, q) < 0.0:
            continue
        at = lineariser.packed(q, 0.5)
        program.solve(at, True)
        rows, x = program.rows, 0.05 * rng.normal(size=3)
        foreseen = float((rows.elastic @ x - rows.elastic_violation).min())
        if turning.linearisation_error(at, rows, x) == 0.0:
            trusted += 1
            assert least_distance(scene, q + x) > min(foreseen, 0.0)
    assert trusted > 20

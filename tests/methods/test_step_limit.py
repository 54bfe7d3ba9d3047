"""No step of any tracker exceeds any limit, whether the goal jumps or a thing moves meanwhile."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits.throws import DT, SHAPES, Throw
from wholebody.methods import installed_methods
from wholebody.methods.solve import as_method, method_for_motions
from wholebody.tracking.loop import FrameLoop

ROUNDING = 1.0 + 1e-9


def excess(problem: wb.Problem, q0: np.ndarray, q1: np.ndarray) -> float:
    """Largest share of a bound that the way from q0 to q1 takes."""
    (bound,) = (term for term in problem.bounds if isinstance(term, wb.tasks.StepLimit))
    most = bound.bounds(problem.scene.state(q0), DT)[1]
    return float((np.abs(pin.difference(problem.scene.model, q0, q1)) / most).max())


@pytest.mark.parametrize("method", installed_methods())
def test_whole_solves_are_shortened_to_the_limit(method: str) -> None:
    scene = wb.Scene(wb.load("avatar"))
    limits = wb.tasks.StepLimit(2.0, joints={"right_elbow_flexion": 1.0}, root_velocity=0.5, root_turn=0.7)
    asked = wb.Problem(
        scene, "standing", goals=[wb.Point("right_index_tip", (0.5, -0.3, 1.2))], constraints=[limits], balance=False
    )
    for make in (as_method, method_for_motions):
        tracker = make(method).tracker(asked, DT)
        for one in (tracker.step, tracker.frame):
            q = asked.start
            for _ in range(2):
                following = one(q).q
                assert 0.01 < excess(asked, q, following) <= ROUNDING
                q = following


def test_the_root_keeps_its_limits_where_it_gives_way_to_a_thing() -> None:
    limits = wb.tasks.StepLimit(12.0, root_velocity=4.0, root_turn=6.0)
    turned = 0
    throw = Throw(np.random.default_rng(2), SHAPES["board"], 2.5, 3.0)  # other throws exceed nothing
    start = throw.scene.figure.posture("standing")
    tip = throw.scene.state(start).frame(throw.scene.frame_id("right_index_tip")).translation.copy()
    goals = [wb.Point("right_index_tip", tip)]
    asked = wb.Problem(throw.scene, start, goals=goals, constraints=[limits], clearance=0.001)
    tracker, q = wb.methods.QP().tracker(asked, DT), asked.start
    for _ in range(throw.frames):
        throw.next()
        step = tracker.step(q)
        assert excess(asked, q, step.q) <= ROUNDING
        assert step.displacement == pytest.approx(pin.difference(throw.scene.model, q, step.q))
        turned += len(step.path) > 2 and np.abs(step.displacement[3:6]).max() > 0.01
        q = step.q
    assert turned > 3


def test_the_root_of_a_shown_figure_keeps_its_speed_in_frames_of_several_steps() -> None:
    figure = wb.load("hand", side="right")
    scene = wb.Scene(figure).add(wb.Box((1.0, 1.0, 0.05)), name="table", at=(0.0, 0.0, -0.3))
    rest, rng = figure.posture("open"), np.random.default_rng(0)
    loop, most = FrameLoop(scene, rest, dt=DT), np.full(scene.model.nv, 8.0 * DT)  # rad/s
    most[:3] = 3.0 * DT  # m/s
    for _ in range(20):
        far = np.concatenate([rng.uniform(-1.0, 1.0, 3) * (0.5, 0.5, 0.2), rng.uniform(-2.0, 2.0, 3)])
        tracked = pin.integrate(scene.model, rest, np.concatenate([far, np.zeros(scene.model.nv - 6)]))
        before = loop.shown
        loop.frame(tracked)
        assert (np.abs(pin.difference(scene.model, before, loop.shown)) <= most * ROUNDING).all()

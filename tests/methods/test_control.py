"""What ends a solve before it has finished, with every method: time, the caller, Ctrl-C."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest
from numba.core import event

import wholebody as wb
from tests.needs import each
from wholebody.bench.suite.stability.bodies import spatial_arm
from wholebody.methods.control import Control

METHODS = {
    "qp": wb.methods.QP,
    "ccd": wb.methods.CCD,
    "newton": wb.methods.Newton,
    "placo": wb.methods.Placo,
    "dls": wb.methods.DampedLeastSquares,
}


@pytest.fixture(autouse=True)
def listening():
    """Ctrl-C as in a terminal; what starts the tests in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def reach():
    """A hand asked for a place two metres away: every method works on it as long as it may."""
    scene = wb.Scene(wb.load("avatar"))
    return wb.Problem(scene, goals=[wb.Point("right_index_tip", (2.0, -1.0, 1.5))], measures=[])


@pytest.mark.parametrize("name", each(METHODS))
def test_a_time_limit_ends_a_solve_with_the_best_so_far(reach, name):
    whole = METHODS[name]().solve(reach)
    answer = METHODS[name](time_limit=1e-6).solve(reach)
    assert answer.status == "stalled"
    assert "time limit of 1e-06 s" in answer.message
    assert answer.iterations <= max(whole.iterations // 4, 2)
    assert np.isfinite(answer.q).all()
    assert reach.scene.figure.within_limits(answer.q)


@pytest.mark.parametrize("name", each(METHODS))
def test_progress_sees_every_iteration_and_may_end_the_solve(reach, name):
    seen = []

    def progress(entry):
        seen.append(entry.goal_error)
        return len(seen) == 3

    answer = wb.solve(reach, METHODS[name](), progress=progress)
    assert answer.status == "stalled"
    assert "progress ended it" in answer.message
    assert 3 <= len(seen) <= 5
    assert seen[-1] <= seen[0]


@pytest.mark.parametrize("name", each(METHODS))
def test_ctrl_c_answers_with_the_best_so_far(reach, name):
    calls = []

    def progress(entry):
        calls.append(entry)
        if len(calls) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    answer = wb.solve(reach, METHODS[name](), progress=progress)
    assert answer.status == "stalled"
    assert "Ctrl-C ended it" in answer.message
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("target", [(0.3, 0.2, 0.5), (9.0, 9.0, 9.0)])
def test_ctrl_c_answers_while_an_arm_goes_to_its_goals_as_if_nothing_were_in_its_way(target):
    arm, told = spatial_arm(), []

    def progress(entry):
        told.append(entry.note)
        os.kill(os.getpid(), signal.SIGINT)

    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", target)])
    answer = wb.solve(problem, progress=progress)
    assert told == ["seed"]
    assert "Ctrl-C ended it" in answer.message
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_is_a_keyboard_interrupt(reach):
    def progress(entry):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        wb.solve(reach, progress=progress)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_leave_ctrl_c_alone():
    handlers = []

    def run():
        with Control():
            handlers.append(signal.getsignal(signal.SIGINT))

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert handlers == [before]


@pytest.mark.parametrize("name", METHODS)
def test_a_time_limit_is_seconds_above_zero(name):
    for value in (0.0, -1.0, float("nan"), "1", True):
        with pytest.raises(wb.InputError, match="time_limit"):
            METHODS[name](time_limit=value)


def test_progress_is_a_function(reach):
    with pytest.raises(wb.InputError, match="progress"):
        wb.solve(reach, progress=3)


def test_a_solve_that_is_let_alone_is_the_same(reach):
    one, other = wb.methods.QP(time_limit=1000.0).solve(reach), wb.methods.QP().solve(reach)
    assert np.array_equal(one.q, other.q)


def test_compiling_is_no_time_of_a_solve(reach):
    """Neither of its seconds nor of its limit: every iteration compiles for longer than the limit."""
    compiled = []

    def progress(entry):
        with event.trigger_event("numba:compile", data={"dispatcher": progress}):
            began = time.monotonic()
            time.sleep(0.02)
            compiled.append(time.monotonic() - began)

    began = time.monotonic()
    answer = wb.methods.QP(time_limit=1000.0).solve(reach, progress)
    assert compiled
    assert answer.seconds <= time.monotonic() - began - sum(compiled)


def test_processor_time_is_not_asked_for_before_so_much_time_went_by(monkeypatch):
    """It costs a call of the system at every iteration."""
    asked = []
    control = Control()
    monkeypatch.setattr(time, "thread_time", lambda: asked.append(1) or 0.0)
    assert not any(control.over for _ in range(100))
    assert not asked

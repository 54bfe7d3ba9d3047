"""The spring between tracker and figure: against a fine integration and closed forms, for any mass at 60 Hz."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import wholebody as wb
from wholebody.dynamics.coupling import Coupling, Spring

DT = 1.0 / 60.0


@pytest.mark.parametrize("mass", [1e-9, 1e-4, 0.1, 0.399999, 0.4, 0.400001, 2.0, 75.0, 1e6])
def test_the_transition_is_the_exponential_of_the_system(mass: float) -> None:
    spring = Spring(mass=mass)
    matrix = np.array([[0.0, 1.0], [-1000.0 / mass, -40.0 / mass]])
    for time in (1e-4, DT, 0.3):
        if mass >= 1e-4:
            assert spring.transition(time) == pytest.approx(expm(matrix * time), rel=1e-6, abs=1e-9)
        assert np.abs(np.linalg.eigvals(spring.transition(time))).max() <= 1.0 + 1e-12


def test_two_half_frames_are_one_frame() -> None:
    for mass in (0.01, 0.4, 75.0):
        spring = Spring(mass=mass)
        half = spring.transition(0.5 * DT)
        assert half @ half == pytest.approx(spring.transition(DT), abs=1e-12)


@pytest.mark.parametrize("mass", [1e-9, 1e-3, 0.4, 5.0, 1e4])
def test_energy_never_grows_at_60_hertz(mass: float) -> None:
    spring, state = Spring(mass=mass), np.array([0.3, 2.0])
    energy = np.inf
    for _ in range(600):
        state = spring.transition(DT) @ state
        now = 0.5 * mass * state[1] ** 2 + 0.5 * 1000.0 * state[0] ** 2
        assert now <= energy * (1.0 + 1e-12)
        energy = now
    assert mass > 100.0 or energy < 1e-9


def test_a_jump_is_followed_as_the_equation_says() -> None:
    """One joint jumps by 0.5 rad: the tracked posture goes there within a frame, and stays."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    spring = Spring(mass=1.0)
    coupling = Coupling(model, np.zeros(1), spring)

    def motion(t: float, y: np.ndarray) -> list[float]:
        target, speed = (0.5 * t / DT, 0.5 / DT) if t < DT else (0.5, 0.0)
        return [y[1], -1000.0 * (y[0] - target) - 40.0 * (y[1] - speed)]

    first = solve_ivp(motion, (0.0, DT), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    later = solve_ivp(motion, (DT, 10 * DT), first.y[:, -1], rtol=1e-10, atol=1e-12, t_eval=np.arange(2, 10.5) * DT)
    expected = [first.y[0, -1], *later.y[0]]
    shown = []
    for _ in range(10):
        q = coupling.toward(np.array([0.5]), DT)
        coupling.stopped(q, q, DT)
        shown.append(q[0])
    assert shown == pytest.approx(expected, abs=1e-6)


def test_a_steady_motion_is_followed_without_lag_and_a_blocked_one_pushes_on() -> None:
    figure = wb.load("human")
    q = figure.posture("standing")
    coupling = Coupling(figure.model, q)
    velocity = np.zeros(figure.model.nv)
    velocity[0], velocity[10] = 1.3, 0.5
    tracked = q
    for _ in range(120):
        tracked = pin.integrate(figure.model, tracked, velocity * DT)
        wanted = coupling.toward(tracked, DT)
        coupling.stopped(wanted, wanted, DT)
    assert pin.difference(figure.model, tracked, wanted) == pytest.approx(0.0, abs=1e-9)
    # held where it is, it wants to go a bounded way in each frame: no energy gathers
    ways = []
    for _ in range(60):
        held = wanted
        wanted_next = coupling.toward(tracked, DT)
        coupling.stopped(held, wanted_next, DT)
        ways.append(np.abs(pin.difference(figure.model, held, wanted_next)).max())
    assert max(ways[5:]) < 1e-9
    ahead = pin.integrate(figure.model, tracked, 0.1 * velocity)
    ways = []
    for _ in range(60):
        wanted_next = coupling.toward(ahead, DT)
        coupling.stopped(held, wanted_next, DT)
        ways.append(np.abs(pin.difference(figure.model, held, wanted_next)).max())
    assert ways[-1] == pytest.approx(ways[5], rel=1e-6)
    assert 0.0 < ways[-1] < 0.13

"""Impulses of a figure's contacts against answers found by other means."""

from itertools import product

import numpy as np
import pytest

from wholebody.dynamics.impulse_kernel import impulses


@pytest.mark.parametrize("seed", range(8))
def test_impulses_without_friction_are_those_of_the_set_of_points_that_bear(seed: int) -> None:
    rng, count, freedoms = np.random.default_rng(seed), 6, 9
    jacobian = rng.normal(size=(3 * count, freedoms))
    root = rng.normal(size=(freedoms, freedoms))
    inverse, speed, target = root @ root.T + np.eye(freedoms), rng.normal(size=3 * count), rng.normal(size=count)
    impulse, change = impulses(jacobian, inverse, speed, np.zeros(count), target)
    normals = jacobian[::3]
    mobility, missing = normals @ inverse @ normals.T, target - speed[::3]
    answers = []
    for bears in map(np.array, product((False, True), repeat=count)):  # brute force: one set alone fits all signs
        held = np.zeros(count)
        held[bears] = np.linalg.solve(mobility[np.ix_(bears, bears)], missing[bears])
        if held.min() >= 0.0 and (mobility @ held - missing).min() > -1e-9:
            answers.append(held)
    assert len(answers) == 1
    assert impulse[:, 0] == pytest.approx(answers[0], abs=1e-5)
    assert impulse[:, 1:] == pytest.approx(0.0, abs=0.0)
    assert change == pytest.approx(inverse @ jacobian.T @ impulse.ravel(), abs=1e-9)


@pytest.mark.parametrize(("pull", "sticks"), [(0.29, True), (0.31, False)])
def test_a_block_sticks_within_its_cone_of_friction_and_slides_beyond(pull: float, sticks: bool) -> None:
    mass, friction, down = 2.0, 0.3, 1.5  # kg, m/s
    speed = np.array([-down, pull * down, 0.0])
    impulse, change = impulses(np.eye(3), np.eye(3) / mass, speed, np.array([friction]), np.zeros(1))
    assert impulse[0, 0] == pytest.approx(mass * down)
    along = pull * down if sticks else friction * down
    assert impulse[0, 1:] == pytest.approx([-mass * along, 0.0], abs=1e-9)
    assert speed + change == pytest.approx([0.0, pull * down - along, 0.0], abs=1e-9)

"""Rows of nodes, and the carrying over to deviations: finite differences of what they derive."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.trajectory.deviations import Chart
from wholebody.motion.trajectory.loads import ClipLoads, WindowLoads
from wholebody.motion.trajectory.nodes import Node, NodeEvaluator, Rows
from wholebody.tasks import Hold, Plane
from wholebody.tasks.base import Constraint, Goal

STEP = 1e-6
SMALL = 2e-4  # rad, m: the ground can give what such a motion of a person who stands needs


def wandering(figure: Figure, frames: int, size: float = 0.15, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    q = [np.array(figure.posture(figure.postures[0]))]
    for _ in range(frames - 1):
        q.append(pin.integrate(figure.model, q[-1], size * random.normal(size=figure.model.nv)))
    return np.array(q)


def test_a_deviation_is_what_integrates_to_the_posture(human: Figure) -> None:
    q = wandering(human, 3)
    chart = Chart(human.model, q)
    x = 0.4 * np.random.default_rng(1).normal(size=(3, human.model.nv))
    np.testing.assert_allclose(chart.deviation(1, chart.posture(1, x[1])), x[1], atol=1e-12)
    np.testing.assert_array_equal(chart.postures(0.0 * x), [chart.posture(k, 0.0 * x[k]) for k in range(3)])


def test_carried_rows_are_derivatives_with_respect_to_the_deviation(human: Figure) -> None:
    model, q = human.model, wandering(human, 2)
    chart, random = Chart(model, q), np.random.default_rng(2)
    x, row = 0.3 * random.normal(size=model.nv), random.normal(size=(1, model.nv))
    here = chart.posture(1, x)
    carried = chart.carried(1, x, row)[0]
    for dof in range(model.nv):
        ends = [chart.posture(1, x + sign * STEP * np.eye(model.nv)[dof]) for sign in (1, -1)]
        change = pin.difference(model, here, ends[0]) - pin.difference(model, here, ends[1])
        assert carried[dof] == pytest.approx(row[0] @ change / (2 * STEP), abs=1e-6)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_the_posture_between_two_moves_as_its_derivatives_say(human: Figure, share: float) -> None:
    model, (before, after) = human.model, wandering(human, 2, 0.3)
    chart = Chart(model, np.array([before, after]))
    q, first, second = chart.between(before, after, share)
    np.testing.assert_allclose(q, pin.interpolate(model, before, after, share), atol=1e-12)
    for dof in range(model.nv):
        step = STEP * np.eye(model.nv)[dof]
        for matrix, moved in (
            (first, [(pin.integrate(model, before, sign * step), after) for sign in (1, -1)]),
            (second, [(before, pin.integrate(model, after, sign * step)) for sign in (1, -1)]),
        ):
            ends = [pin.interpolate(model, *pair, share) for pair in moved]
            change = (pin.difference(model, q, ends[0]) - pin.difference(model, q, ends[1])) / (2 * STEP)
            np.testing.assert_allclose(matrix[:, dof], change, atol=1e-6)


def looking(figure: Figure, scene: wb.Scene, q: np.ndarray, terms: tuple[Constraint | Goal, ...] = ()) -> NodeEvaluator:
    resolved = [tuple(term.resolve(scene, posture) for term in terms) for posture in q]
    return NodeEvaluator(scene.workspace(), Chart(figure.model, q), resolved, 0.01)


def differences(of: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Central differences (k, n, nv) of values (k,) of deviations (n, nv)."""
    found = np.empty((len(of(x)), *x.shape))
    for place in np.ndindex(*x.shape):
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[place] += sign * STEP
            ends.append(of(moved))
        found[(slice(None), *place)] = (ends[0] - ends[1]) / (2 * STEP)
    return found


@pytest.mark.parametrize("node", [Node(1), Node(0, 0.5), Node(1, 0.3)])
def test_gaps_change_as_their_rows_say(planar_arm: Callable[..., Figure], node: Node) -> None:
    """Witness rows are exact derivatives of distances between round pieces."""
    figure = planar_arm((0.5, 0.4, 0.3))
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.8, 0.2, 0.0))
    q = np.array([[0.0, 0.4, 0.2], [0.2, 0.6, 0.3], [0.3, 0.5, 0.1]])
    look, x = looking(figure, scene, q), 0.05 * np.random.default_rng(3).normal(size=q.shape)
    rows = look.at(node, x, 0.5)
    contacts = int(rows.group.max()) + 1
    assert contacts >= 2
    found = differences(lambda moved: look.at(node, moved, 0.5).gap[:contacts], x)
    expected = np.zeros_like(found)
    for offset, part in enumerate(rows.parts):
        expected[:, node.frame + offset] = part[:contacts]
    np.testing.assert_allclose(expected, found, atol=1e-6)


def test_held_terms_change_as_their_rows_say(human: Figure) -> None:
    terms = (
        Hold("left_hand", relative_to="right_hand"),
        Hold("left_foot"),
        Plane("right_elbow", (0.0, 0.0, 1.0), point=(0.0, 0.0, 0.2), side="above"),
    )
    q = wandering(human, 2, 0.05)
    scene = wb.Scene(human)
    look, x = looking(human, scene, q, terms), 0.1 * np.random.default_rng(4).normal(size=(2, human.model.nv))
    rows = look.at(Node(1), x, 0.0)

    def values(one: Rows) -> np.ndarray:
        return np.concatenate([one.equal, one.gap[-1:]])

    found = differences(lambda moved: values(look.at(Node(1), moved, 0.0)), x)
    assert not found[:, 0].any()
    np.testing.assert_allclose(np.vstack([rows.equal_rows, rows.parts[0][-1:]]), found[:, 1], atol=2e-6)
    still = look.at(Node(1), 0.0 * x, 0.0)
    np.testing.assert_allclose(still.equal, 0.0, atol=1e-9)  # each frame keeps what its own original posture has


@pytest.mark.parametrize("node", [Node.of_loads(0), Node.of_loads(1), Node.of_loads(2)])
def test_loads_change_as_their_rows_say(human: Figure, node: Node) -> None:
    """Of a person who bends deep on both feet; the frames around the window do not deviate.

    So deep the centre of mass is behind the feet. What the ground cannot give makes its least squares change a little
    with the centre of mass, which rows leave out.
    """
    random, frames = np.random.default_rng(5), 7
    bent = {"hip_flexion": 1.6, "knee_flexion": 1.5, "ankle_dorsiflexion": 0.4}
    deep = human.with_joints(
        human.posture("standing"),
        {f"{side}_{name}": angle for name, angle in bent.items() for side in ("left", "right")},
    )
    q = np.array([pin.integrate(human.model, deep, SMALL * random.normal(size=human.model.nv)) for _ in range(frames)])
    stands = {"left_foot": np.ones(frames, dtype=bool), "right_foot": np.ones(frames, dtype=bool)}
    clip = wb.Clip(human, q, 0.1)
    loads = ClipLoads.original(
        clip, stands, wb.motion.Strength(5.0, "female"), frame_terms(wb.Scene(human), q, 0.1, ())
    )
    look = NodeEvaluator(
        wb.Scene(human).workspace(), Chart(human.model, q[2:5]), [()] * 3, 0.0, WindowLoads(loads, 2, 3)
    )
    x = SMALL * random.normal(size=(3, human.model.nv))
    rows = look.at(node, x, 0.0)
    assert len(rows.gap) >= 3
    assert node.soft

    def gaps(moved: np.ndarray) -> np.ndarray:
        found = look.at(node, moved, 0.0).gap
        assert len(found) == len(rows.gap)
        return found

    expected = np.zeros((len(rows.gap), *x.shape))
    for offset, part in enumerate(rows.parts):
        expected[:, node.frame + offset] = part
    dofs = [0, 2, 4, 7, human.model.joints[human.joint_id("left_knee_flexion")].idx_v, human.model.nv - 1]
    for frame in range(3):
        for dof in dofs:
            ends = []
            for sign in (1.0, -1.0):
                moved = x.copy()
                moved[frame, dof] += sign * STEP
                ends.append(gaps(moved))
            slope = (ends[0] - ends[1]) / (2 * STEP)
            np.testing.assert_allclose(expected[:, frame, dof], slope, atol=0.02 * np.abs(expected).max())

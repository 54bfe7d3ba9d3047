"""embodik as an method: its model is ours, it solves arms among things, and it refuses by name what it cannot take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.problem_sets import robots

pytest.importorskip("embodik")

CUBE = 0.05 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def _among_all_shapes() -> wb.Problem:
    """An arm among a thing of every shape that its file can have, turned, and a slope below."""
    figure, start = robots.arm("seven axes", np.random.default_rng(2))
    turn = pin.rpy.rpyToMatrix(0.3, -0.4, 0.9)
    scene = wb.Scene(figure).add(wb.HalfSpace((0.1, -0.2, 1.0), -0.1), name="slope")
    scene.add(wb.Box((0.1, 0.2, 0.3)), name="box", at=pin.SE3(turn, np.array([0.6, 0.4, 0.2])))
    scene.add(wb.Sphere(0.1), name="ball", at=(0.5, -0.5, 0.6))
    scene.add(wb.Capsule(0.05, 0.3), name="rod", at=pin.SE3(turn, np.array([-0.6, 0.2, 0.5])))
    scene.add(wb.Hull(CUBE), name="cube", at=pin.SE3(turn, np.array([-0.5, -0.4, 0.3])))
    return wb.Problem(scene, start, goals=[wb.Point("tool", (0.4, 0.0, 0.5), offset=(0.0, 0.1, 0.0))], clearance=0.002)


def test_its_distances_are_ours_for_every_pair() -> None:
    from wholebody.bench.suite.adapters.embodik import _EmbodikStepper
    from wholebody.bench.suite.adapters.urdf import piece_name

    problem = _among_all_shapes()
    stepper = _EmbodikStepper(problem)
    stepper.begin(0.0)
    model, geometry = problem.scene.model, problem.scene.geometry
    data, found = model.createData(), geometry.createData()
    rng = np.random.default_rng(5)
    for _ in range(5):
        q = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        assert stepper._ours(stepper._theirs(q)) == pytest.approx(q)
        pin.computeDistances(model, data, geometry, found, q)
        ours = {
            frozenset((f"{piece_name(pair.first)}_0", f"{piece_name(pair.second)}_0")): result.min_distance
            for pair, result in zip(geometry.collisionPairs, found.distanceResults, strict=True)
        }
        theirs = stepper._solver.evaluate_collision_pair_distances(stepper._theirs(q))
        assert len(theirs) > 30
        for pair in theirs:
            expected = ours[frozenset((pair.geometry_a, pair.geometry_b))]
            if expected > 0.0:
                assert pair.distance == pytest.approx(expected, abs=1e-5)
            assert pair.minimum_distance >= problem.clearance


@pytest.mark.parametrize("kind", robots.of_arm.kinds)
@pytest.mark.parametrize("turned", [False, True])
def test_it_brings_the_tool_of_an_arm_to_a_place(kind: str, turned: bool) -> None:
    rng = np.random.default_rng(6)
    figure, start = robots.arm(kind, rng)
    witness = figure.clamp(start + rng.uniform(-0.5, 0.5, figure.model.nv))
    place = figure.placement(witness, "tool")
    goal: Any = wb.Frame("tool", place) if turned else wb.Point("tool", pin.SE3(place).translation)
    problem = wb.Problem(wb.Scene(figure), start, goals=[goal])
    (adapter,) = adapters(["embodik"])
    solution = adapter.make(1e-5, None).solve(problem)
    assert solution.solved, solution.message
    assert figure.within_limits(solution.q)
    judged = wb.assess(problem, solution.q)
    assert judged.met(1.1e-5)
    assert judged.holds(1.1e-5)


def test_it_keeps_clear_of_a_box_in_the_way(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.2))).add(wb.Box((0.1, 0.1, 0.3)), name="box", at=(0.62, 0.25, 0.0))
    problem = wb.Problem(scene, np.array([-0.6, 0.3, 0.2]), goals=[wb.Point("tip", (0.55, 0.6, 0.0))], clearance=0.005)
    (adapter,) = adapters(["embodik"])
    solution = adapter.make(1e-4, None).solve(problem)
    judged = wb.assess(problem, solution.q)
    assert judged.penetration == 0.0
    assert solution.solved == (judged.met(1.1e-4) and judged.holds(1.1e-4))


def test_a_frozen_joint_stays(planar_arm: Callable[..., wb.Figure]) -> None:
    figure = planar_arm((0.4, 0.3, 0.2))
    start, first = np.array([0.3, 0.4, 0.4]), figure.joints[0]
    problem = wb.Problem(
        wb.Scene(figure), start, goals=[wb.Point("tip", (0.5, 0.5, 0.0))], constraints=[wb.Freeze(first)]
    )
    (adapter,) = adapters(["embodik"])
    q = adapter.make(1e-4, None).solve(problem).q
    assert q[0] == pytest.approx(0.3, abs=1e-9)
    assert np.abs(q[1:] - start[1:]).max() > 0.05


def test_what_it_cannot_express_is_refused_and_named() -> None:
    (adapter,) = adapters(["embodik"])
    embodik = adapter.make(1e-4, None)
    free = wb.Problem(wb.Scene(wb.load("human")), goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))])
    with pytest.raises(InputError, match="free root"):
        embodik.solve(free)
    figure, _ = robots.arm("industrial", np.random.default_rng(1))
    scene, goal = wb.Scene(figure), wb.Point("tool", (0.4, 0.0, 0.5))
    held = wb.Problem(scene, goals=[goal], constraints=[wb.Hold("tool")])
    assert "Hold" in str(embodik.accepts(held))
    assert "Axis" in str(embodik.accepts(wb.Problem(scene, goals=[wb.Axis("tool", (0, 0, 1), direction=(0, 0, 1))])))
    egg = wb.Scene(figure).add(wb.Ellipsoid((0.1, 0.2, 0.3)), name="egg", at=(0.9, 0.0, 0.9))
    with pytest.raises(InputError, match=r"egg.*Ellipsoid"):
        embodik.solve(wb.Problem(egg, goals=[goal]))

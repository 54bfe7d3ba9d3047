"""drake's InverseKinematics as an method: it solves whole problems, and refuses by name what it cannot express."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.registry import adapters

pytest.importorskip("pydrake")


def test_its_plant_has_our_postures_and_placements() -> None:
    from wholebody.bench.suite.adapters.drake import _Plant

    figure = wb.load("human")
    problem = wb.Problem(wb.Scene(figure), goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))])
    plant = _Plant(problem)
    q = pin.integrate(figure.model, figure.neutral, np.random.default_rng(3).uniform(-0.5, 0.5, figure.model.nv))
    there = plant.ours(plant.theirs(q))
    assert pin.difference(figure.model, q, there) == pytest.approx(np.zeros(figure.model.nv), abs=1e-12)
    plant.plant.SetPositions(plant.context, plant.theirs(q))
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, q)
    for index in range(1, figure.model.njoints):
        pose = plant.plant.EvalBodyPoseInWorld(plant.context, plant.bodies[index])
        assert pose.GetAsMatrix4() == pytest.approx(data.oMi[index].homogeneous, abs=1e-12)


def test_it_reaches_round_a_box_with_an_orientation(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.2))).add(wb.Box((0.1, 0.4, 0.3)), name="box", at=(0.55, 0.0, 0.0))
    witness = np.array([1.2, -1.0, 1.2])
    place = scene.state(witness).frame(scene.frame_id("tip"))
    problem = wb.Problem(scene, np.array([-1.4, 0.3, 0.2]), goals=[wb.Frame("tip", pin.SE3(place))], clearance=0.01)
    (adapter,) = adapters(["drake"])
    solution = adapter.make(1e-4, None).solve(problem)
    assert solution.solved, solution.message
    judged = wb.assess(problem, solution.q)
    assert judged.met(1e-4)
    assert judged.holds(1e-4)


def test_what_it_cannot_express_is_refused_and_named(root: Path) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(
        scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()],
    )  # fmt: skip
    (adapter,) = adapters(["drake"])
    with pytest.raises(InputError, match="Balance"):
        adapter.make(1e-4, None).solve(problem)
    assert "Balance" in str(adapter.make(1e-4, None).accepts(problem))

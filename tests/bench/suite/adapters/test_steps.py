"""Every installed tool makes the first steps of the reach within limits, from the posture and model that we mean."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.bench.following import followed
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.bench.measure.track import SETTING, Track, judge, track
from wholebody.bench.suite.adapters.own import MovingPoint
from wholebody.bench.suite.adapters.registry import chosen_tools, make_tool, tool_differences
from wholebody.bench.suite.adapters.urdf import Frames, mjcf, own_frame
from wholebody.geometry.flesh import is_flesh

LIMIT = {"pink": 1e-4}
"""Radians by which a tool may exceed a limit here: pink leaves DAQP at its own tolerance."""


@pytest.mark.parametrize("name", chosen_tools())
def test_two_steps_keep_limits_and_feet(name: str, short_contact: Track) -> None:
    two = replace(short_contact, targets=short_contact.targets[[2, 4]])
    tool, verdict = followed(name, two)
    assert verdict.limit_violation <= LIMIT.get(name, 1e-9)
    assert verdict.fastest_joint <= 1.0 + 1e-6
    assert verdict.foot_drift < 1e-3
    assert verdict.least_distance.min() > 0.0
    standing = judge(two, np.tile(two.start, (2, 1)))
    assert verdict.error[-1] < 0.6 * standing.error[-1], "it did not move towards the target"
    tool.reset(two.start)
    assert np.allclose(tool.posture(), two.start, atol=1e-12)


@pytest.mark.parametrize("name", [name for name in chosen_tools() if "/" not in name])
def test_a_far_target_is_approached_no_faster_than_joints_may(name: str, short_free: Track) -> None:
    one = replace(short_free, targets=short_free.targets[[-1]])
    tool = make_tool(name, one)
    tool.step(one.targets[0])
    fastest = judge(one, tool.posture()[None]).fastest_joint
    assert 0.05 < fastest <= 1.0 + 1e-6


def test_the_moving_goal_has_the_derivative_that_differences_have(short_free: Track) -> None:
    scene = short_free.scene
    goal = MovingPoint(short_free.tip, np.array([0.3, 0.1, 0.9])).resolve(scene, short_free.start)
    rng = np.random.default_rng(1)
    q = pin.integrate(scene.model, short_free.start, 0.3 * rng.normal(size=scene.model.nv))
    way = rng.normal(size=scene.model.nv)
    ahead, behind = (
        goal.error(scene.state(pin.integrate(scene.model, q, sign * 1e-6 * way))).copy() for sign in (1, -1)
    )
    state = scene.state(q)
    assert np.allclose(state.wrench_jacobian(goal.jacobian(state)) @ way, (ahead - behind) / 2e-6, atol=1e-7)
    goal.target[:] = state.frame(scene.frame_id(short_free.tip)).translation
    assert np.allclose(goal.error(state), 0.0)


def test_our_step_keeps_the_speed_of_the_root_too(short_contact: Track) -> None:
    tool = make_tool("wholebody", short_contact)
    postures = []
    for target in short_contact.targets[:12]:
        tool.step(target)
        postures.append(tool.posture())
    verdict = judge(replace(short_contact, targets=short_contact.targets[:12]), np.array(postures))
    assert verdict.fastest_root <= 1.0 + 1e-9
    assert 0.0 <= tool.remarks()["exact"] <= 1.0


def test_a_goal_that_is_replaced_leads_where_one_that_moves_does(short_contact: Track) -> None:
    tools = [make_tool(name, short_contact) for name in ("wholebody", "wholebody/retarget")]
    for target in short_contact.targets[:12]:
        for tool in tools:
            tool.step(target)
        assert np.allclose(*(tool.posture() for tool in tools), atol=1e-12)


@pytest.mark.parametrize(("name", "most"), [("contact", 0.62)])
def test_our_steps_jolt_joints_about_as_little_as_the_best_peers(name: str, most: float) -> None:
    """In rad/s^2; pink has 0.2654 and 0.551 from arms at 0.3 rad."""
    _, verdict = followed("wholebody", track(name, 200))
    assert verdict.acceleration < most
    assert verdict.foot_drift < 2e-6
    assert verdict.error[-1] < 1e-6
    assert verdict.least_distance.min() > 0.9999 * SETTING.clearance


def test_unknown_and_missing_tools_are_named() -> None:
    with pytest.raises(UnknownNameError, match="placo"):
        chosen_tools(["plako"])
    assert all(tool_differences(name) for name in ("placo", "placo/pruned", "pink", "mink"))
    for name, extra in (("mink", "compare"), ("placo", "placo")):
        if find_spec(name) is None:
            with pytest.raises(MissingPackageError, match=extra):
                chosen_tools([name])


def test_mujoco_has_the_same_human(short_free: Track) -> None:
    """Places of all frames, joint limits and distances of pairs in random postures, by another engine."""
    mujoco = pytest.importorskip("mujoco")
    scene, figure = short_free.scene, short_free.scene.figure
    frames = ("right_index_tip", "left_foot", "head_top")
    model = mujoco.MjModel.from_xml_string(mjcf(scene, {name: own_frame(figure, name) for name in frames}))
    data = mujoco.MjData(model)
    for name in figure.joints:
        index = figure.model.joints[figure.joint_id(name)].idx_q
        ours = figure.model.lowerPositionLimit[index], figure.model.upperPositionLimit[index]
        assert np.allclose(model.joint(name).range, ours)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = figure.clamp(pin.integrate(figure.model, short_free.start, 0.4 * rng.normal(size=figure.model.nv)))
        data.qpos[:3], data.qpos[3], data.qpos[4:7] = q[:3], q[6], q[3:6]
        for name in figure.joints:
            data.qpos[model.joint(name).qposadr[0]] = q[figure.model.joints[figure.joint_id(name)].idx_q]
        mujoco.mj_forward(model, data)
        state = scene.state(q)
        for name in frames:
            assert np.allclose(data.site(name).xpos, state.frame(figure.frame_id(name)).translation, atol=1e-9)
        near = scene.contacts(q, within=0.05)
        # flesh, which spreads as hips bend, is rigid there
        flesh = [number for number, piece in enumerate(scene.geometry.geometryObjects) if is_flesh(piece)]
        apart = (near.distance > 1e-3) & ~np.isin(near.pair, flesh).any(axis=1)
        names = scene.piece_names
        for (first, second), distance in zip(near.pair[apart], near.distance[apart], strict=True):
            theirs = mujoco.mj_geomDistance(
                model, data, model.geom(names[first]).id, model.geom(names[second]).id, 0.1, None
            )
            assert theirs == pytest.approx(distance, abs=2e-5)


def test_a_point_that_a_tool_is_given_by_name_is_where_it_is_in_our_model(short_free: Track) -> None:
    scene, figure, start = short_free.scene, short_free.scene.figure, short_free.start
    frames, offset = Frames(), np.array((0.01, -0.02, 0.03))
    goal = wb.Point("right_index_tip", (0.3, 0.1, 0.9)).resolve(scene, start)
    joint, place = frames[frames.named(scene.model, goal.place, offset)]
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, start)
    there = figure.placement(start, "right_index_tip").act(offset)
    assert np.allclose(data.oMi[joint].act(place.translation), there, atol=1e-12)
    assert len({*frames, frames.named(scene.model, goal.place)}) == 2, "another point has another name"


def test_mjcf_refuses_what_it_does_not_know() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Ellipsoid((0.1, 0.2, 0.3)), name="egg")
    with pytest.raises(InputError, match="egg"):
        mjcf(scene)


def test_mujoco_has_the_same_arm_and_floor(root: Path) -> None:
    """A joint that turns for ever, limits and a half-space that leans, by another engine."""
    mujoco = pytest.importorskip("mujoco")
    figure = wb.load(root / "tests/data/arm/arm.urdf")
    lean = pin.SE3(pin.utils.rotate("x", 0.4), np.array([0.0, 0.0, -0.6]))
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor", at=lean)
    tip = figure.model.names[-1]
    model = mujoco.MjModel.from_xml_string(mjcf(scene, {tip: own_frame(figure, tip)}))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(2)
    for _ in range(4):
        q = figure.clamp(pin.integrate(figure.model, figure.neutral, rng.normal(size=figure.model.nv)))
        for name, value in figure.joint_values(q).items():
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_forward(model, data)
        place = scene.state(q).frame(figure.frame_id(tip)).translation
        assert np.allclose(data.site(tip).xpos, place, atol=1e-9)
        near = scene.contacts(q, within=5.0)
        names = scene.piece_names
        for (first, second), distance in zip(near.pair, near.distance, strict=True):
            if "floor:0" in (names[first], names[second]) and distance > 1e-3:
                theirs = mujoco.mj_geomDistance(
                    model, data, model.geom(names[first]).id, model.geom(names[second]).id, 6.0, None
                )
                assert theirs == pytest.approx(distance, abs=1e-5)

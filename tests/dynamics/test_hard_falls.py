"""Hard falls of figures that yield: joints keep to their limits, no energy is gained, and a frame's work is bounded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.coupling import Points


def falling(name: str, seed: int, boxes: bool, stiffness: float = 0.0) -> wb.World:
    """A figure in the air, turned at random, above a floor and loose boxes; its root is free."""
    figure, rng = wb.load(name), np.random.default_rng(seed)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for k, (x, y) in enumerate(((-0.3, 0.0), (0.35, 0.05), (0.0, 0.4), (0.0, -0.4)) if boxes else ()):
        scene.add(wb.Box((0.25, 0.3, 0.15)), name=f"box {k}", at=(x, y, 0.0751), body=wb.Body(mass=5.0))
    start, turn = figure.posture("standing").copy(), rng.normal(size=4)
    start[:2], start[2], start[3:7] = 0.0, rng.uniform(1.0, 1.5), turn / np.linalg.norm(turn)
    springs = (dict.fromkeys(figure.joints, stiffness), dict.fromkeys(figure.joints, 0.05 * stiffness))
    return wb.World(scene, start, spring=wb.Actuated(figure, *springs))


@pytest.mark.parametrize(("seed", "boxes"), [(1, False), (9, False), (2, True)])
def test_joints_that_contacts_turn_fast_stop_at_their_limits(seed: int, boxes: bool) -> None:
    """They were at 13, 0.9 and 0.05 rad beyond: limits that a step's own impulses reached were not in its program."""
    world = falling("human", seed, boxes)
    model, energies, most, deepest = world.scene.model, [world.energy], 0.0, 0.0
    single = [joint.idx_q for joint in model.joints[1:] if joint.nq == joint.nv == 1]
    low, high = model.lowerPositionLimit[single], model.upperPositionLimit[single]
    for _ in range(60):
        frame = world.step()
        q, deepest = frame.q[single], max(deepest, frame.deepest)
        most = max(most, (low - q).max(), (q - high).max())
        energies.append(world.energy)
    assert most < 0.011  # rad; 0.2 where a program that is not solved may leave more
    assert deepest < 1e-4  # m; 0.5 mm where a step took a fifth of an overlap away, and gaps were linear in it
    assert np.diff(energies).max() < 1e-6
    assert energies[0] - energies[-1] > 200.0  # it has landed


def test_a_box_that_limbs_squeeze_does_not_make_a_frame_endless() -> None:
    """A forearm and the trunk hold a box: a frame took 35 steps, most of 28 steps of the engine."""
    world, steps = falling("avatar", 3, True, stiffness=60.0), 0
    for _ in range(75):
        frame = world.step()
        assert frame.engine is not None
        steps = max(steps, frame.engine.steps)
    assert steps < 200  # 644


def test_many_impacts_of_a_frame_are_taken_together() -> None:
    world, ends = falling("avatar", 4, True), 0
    for _ in range(70):
        world.step()
        assert world._articulated is not None
        ends = max(ends, len(world._articulated.ends))
    assert ends < 11  # 16 where each of them ended a step; each step is a program of all contacts


@pytest.mark.parametrize("speed", [5.0, 30.0, 60.0])
def test_no_step_turns_a_limb_so_far_that_it_ends_in_what_it_meets(
    tmp_path: Path, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gaps are linear in a step: of a rod of 1 m that turns by 0.15 rad they are off by 0.15**2 / 2 = 11 mm at most."""
    path = tmp_path / "rod.urdf"
    path.write_text(
        """<robot name="rod"><link name="base"/><link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
        <inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.04 0.04"/></geometry></collision></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
        </robot>"""
    )
    rod = wb.load(path)
    limp = wb.Actuated(rod, stiffness=0.0, damping=0.0)
    moving = Articulated(wb.Scene(rod), rod.neutral, limp, None, gravity=np.zeros(3))
    moving.velocity[:] = speed
    attempt, attempts = moving._attempt, list[float]()

    def counted(most: float, *rest: Any) -> Any:
        attempts.append(most)
        return attempt(most, *rest)

    monkeypatch.setattr(moving, "_attempt", counted)
    moving.advance(rod.neutral, 1.0 / 60.0, {}, {})
    assert speed * np.diff([0.0, *moving.ends]).max() < 0.15 + 1e-9
    assert len(moving.ends) < 12
    assert len(attempts) <= len(moving.ends) + 2  # a step begins as long as the last one was: 16 for 9 steps before
    assert moving.velocity == pytest.approx(speed)


def test_ways_end_within_the_tolerance_of_limits_however_often_they_lead_out() -> None:
    figure = wb.load("hand")
    model, q = figure.model, figure.neutral.copy()
    joint = model.joints[model.njoints - 1]
    single, way = np.array([[joint.idx_q, joint.idx_v]]), np.zeros(model.nv)
    for side in (-1.0, 1.0):
        q[joint.idx_q], way[joint.idx_v] = 0.0, side * 0.3  # rad
        for _ in range(300):
            points = Points.room(0, model.nv, [], None).with_limits(model, single, q, np.full(model.nv, np.inf))
            q[joint.idx_q] += points.share(way) * way[joint.idx_v]
        limit = model.upperPositionLimit if side > 0.0 else model.lowerPositionLimit
        assert 0.01 - 1e-9 < side * (q[joint.idx_q] - limit[joint.idx_q]) < 0.02
    q[joint.idx_q] += 0.5  # placed beyond, it may come back
    points = Points.room(0, model.nv, [], None).with_limits(model, single, q, np.full(model.nv, np.inf))
    assert points.share(-way) == 1.0
    assert points.share(way) < 1e-9


@pytest.mark.parametrize("shots", [0, 12])  # that hit the body a little before, and are taken together
def test_what_passes_by_a_head_is_not_hit_by_the_plane_at_its_nearest_place(shots: int) -> None:
    figure = wb.load("avatar")
    q, speed = figure.posture("standing"), 40.0
    top, pelvis = (figure.placement(q, name).translation for name in ("head_top", "pelvis"))
    scene = wb.Scene(figure)
    for k in range(shots):
        at = pelvis + (0.35 + 0.03 * k, 0.05 * (-1) ** k, 0.03 * (k % 4))
        scene.add(wb.Sphere(0.01), name=f"shot {k}", at=at, body=wb.Body(mass=0.02, velocity=(-speed, 0.0, 0.0)))
    at = top + (0.96, 0.0, 0.022)  # it passes 2 mm above, and falls as the figure does
    scene.add(wb.Sphere(0.02), name="ball", at=at, body=wb.Body(mass=0.1, velocity=(-speed, 0.0, 0.0)))
    world = wb.World(scene, q, spring=wb.Actuated(figure, dict.fromkeys(figure.joints, 200.0)))
    for _ in range(3):
        world.step()
    assert world.engine is not None
    assert world.engine.twist("ball")[:3] == pytest.approx((-speed, 0.0, -9.81 * world.time), abs=0.05)  # 11 m/s off


def test_a_frame_ends_at_its_end_where_a_limb_turned_fast_before(hand: wb.Figure) -> None:
    """It is divided into steps of the engine, which may be longer than it: its last step was."""
    moving = Articulated(wb.Scene(hand), hand.neutral, wb.Actuated(hand), None)
    moving._turning = 200.0  # rad/s, until something stopped it
    moving.advance(hand.neutral, 1e-3, {}, {})
    assert moving.ends[-1] == pytest.approx(1e-3)  # it was four times as long

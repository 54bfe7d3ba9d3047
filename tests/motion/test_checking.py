"""The check of a clip: against coal on all pairs of finely divided clips, and against motions worked out by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.motion.clip_contacts import contact, contact_as_dict
from wholebody.motion.worn_equipment import equipment


def at(*places: float) -> Array:
    """Postures (n, 7) of one free body on the x axis."""
    return np.array([[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for x in places])


def ball(free_bodies: Callable[..., Any], *places: float, dt: float = 0.1) -> wb.Clip:
    return wb.Clip(free_bodies(wb.Sphere(0.1)), at(*places), dt)


def swing(figure: wb.Figure, frames: int, seed: int, size: float) -> wb.Clip:
    rng = np.random.default_rng(seed)
    phase, sizes = rng.uniform(0.0, 6.0, figure.model.nv), rng.uniform(0.0, size, figure.model.nv)
    sizes[:6] *= 0.1
    base = figure.posture("standing")
    return wb.Clip(
        figure,
        [figure.clamp(pin.integrate(figure.model, base, sizes * np.sin(phase + 0.1 * k))) for k in range(frames)],  # type: ignore[arg-type]
        1 / 30,
        "swing",
    )


def owner_depths(scene: wb.Scene) -> Callable[[Array], dict[tuple[str, str], float]]:
    """A function: posture -> depth of all pairs of owners that overlap there, by coal on every pair of pieces."""
    data, results, owners = scene.model.createData(), pin.GeometryData(scene.geometry), scene.piece_owner
    names = [(owners[pair.first], owners[pair.second]) for pair in scene.geometry.collisionPairs]
    for request in results.distanceRequests:
        request.enable_cached_gjk_guess = False  # else an answer begins where the one before ended

    def depths(q: Array) -> dict[tuple[str, str], float]:
        pin.computeDistances(scene.model, data, scene.geometry, results, q)
        found = dict[tuple[str, str], float]()
        for number, result in enumerate(results.distanceResults):
            distance = result.min_distance
            if distance < 0.0:
                found[names[number]] = max(found.get(names[number], 0.0), -distance)
        return found

    return depths


def test_a_ball_that_rolls_into_a_wall_and_back(free_bodies: Callable[..., Any]) -> None:
    clip = ball(free_bodies, 0.0, 0.3, 0.42, 0.45, 0.45, 0.3, 0.41, 0.0)
    scene = wb.Scene(clip.figure)
    scene.add(wb.Box((0.2, 1.0, 1.0)), name="wall", at=(0.6, 0.0, 0.0))  # its face is at x = 0.5
    told: list[int] = []
    found = wb.check(clip, scene, progress=told.append)
    assert np.allclose(found.depth, [0.0, 0.0, 0.02, 0.05, 0.05, 0.0, 0.01, 0.0], atol=1e-6)
    assert found.between == pytest.approx([0.0, 0.02, 0.05, 0.05, 0.05, 0.01, 0.01], rel=0.06, abs=1e-6)
    (only,) = found.contacts
    assert (only.first, only.second, only.kind) == ("body0", "wall", "thing")
    assert (only.frames, only.gaps, only.start) == (4, 6, 1)  # it touches on the way to frame 2
    assert only.deepest == pytest.approx(0.05, abs=1e-6)
    assert (only.deepest_frame, only.deepest_between) == (3, False)
    assert only.longest == (1, 5)
    assert (found.colliding, found.dips, found.free) == (4, 0, False)
    assert told[-1] == 8


def test_a_dip_between_two_free_frames(free_bodies: Callable[..., Any]) -> None:
    clip = ball(free_bodies, -1.0, 1.3)
    scene = wb.Scene(clip.figure)
    scene.add(wb.Box((0.001, 1.0, 1.0)), name="plate")
    found = wb.check(clip, scene)
    assert (found.colliding, found.dips, found.deepest) == (0, 1, 0.0)
    assert 0.1005 - 1e-6 <= found.deepest_between <= 0.106
    (only,) = found.contacts
    assert (only.frames, only.gaps, only.start, only.deepest_between, only.longest) == (0, 1, 0, True, (0, 1))


def test_a_person_against_coal_on_finely_divided_frames() -> None:
    clip = swing(wb.load("human"), 24, 3, 0.35)
    scene = wb.Scene(clip.figure)
    scene.attach(wb.Box((0.2, 0.3, 0.25)), to="thorax", name="pack", at=(-0.25, 0.0, 0.1))
    scene.add(wb.Box((0.4, 0.4, 0.4)), name="table", at=(0.45, -0.2, 0.8))
    found = wb.check(clip, scene)
    kinds = {contact.kind for contact in found.contacts}
    assert kinds >= {"self", "thing"}
    depth = {(each.first, each.second): each for each in found.contacts}
    seen, depths = set(), owner_depths(scene)
    for k, q in enumerate(clip.q):
        true = depths(q)
        assert found.depth[k] == pytest.approx(max(true.values(), default=0.0), abs=3e-6)
        for names, deep in true.items():
            if deep > found.tolerance:
                assert depth[names].depth[k] == pytest.approx(deep, abs=3e-6)
                seen.add(names)
    for k in range(len(clip) - 1):
        for t in np.linspace(0.0, 1.0, 9):
            for names, deep in depths(pin.interpolate(scene.model, clip.q[k], clip.q[k + 1], t)).items():
                if deep > found.tolerance:
                    assert depth[names].between[k] >= deep - 3e-6
                    seen.add(names)
    assert seen == set(depth)


def test_equipment_is_told_apart_and_left_out_where_it_rests() -> None:
    figure = wb.load("human")
    q = figure.posture("standing")
    bent = figure.with_joints(q, {"right_elbow_flexion": 1.2})
    scene = wb.Scene(figure)
    scene.attach(wb.Sphere(0.12), to="thorax", name="pouch", at=(0.2, -0.1, -0.05))
    found = wb.check(wb.Clip(figure, [q, bent], 0.1), scene)  # type: ignore[arg-type]
    for each in found.contacts:
        assert "pouch" not in (each.first, each.second) or each.kind == "equipment"
    assert all({"pouch", segment} != {each.first, each.second} for each in found.contacts for segment in ("thorax",))


def test_pairs_of_the_definition_are_left_out() -> None:
    figure = wb.load("human")
    clip = wb.Clip(figure, [figure.posture("standing"), figure.posture("a_pose")], 0.5)  # type: ignore[arg-type]
    assert wb.check(clip).free  # neighbouring segments overlap always


def test_one_frame(free_bodies: Callable[..., Any]) -> None:
    clip = ball(free_bodies, 0.42)
    scene = wb.Scene(clip.figure)
    scene.add(wb.HalfSpace((-1.0, 0.0, 0.0)), name="wall", at=(0.5, 0.0, 0.0))
    found = wb.check(clip, scene)
    assert found.between.shape == (0,)
    assert found.deepest == pytest.approx(0.02)
    assert (found.deepest_between, found.mean_jerk, found.dips) == (0.0, 0.0, 0)
    json.dumps(found.as_dict(), allow_nan=False)


def test_limits_and_speeds(planar_arm: Callable[..., Any]) -> None:
    """Limits of the arm are 3 rad, and 10 rad/s."""
    figure = planar_arm([0.5, 0.5])
    q = np.array([[0.0, 0.0], [0.2, 0.0], [0.4, -3.1], [0.4, -3.25], [0.4, -3.2]])
    found = wb.check(wb.Clip(figure, q, 0.1))
    (limit,), (speed,) = found.limits, found.speeds
    assert (limit.joint, limit.frames, limit.frame) == ("turn1", 3, 3)
    assert (limit.value, limit.limit) == (pytest.approx(-3.25), pytest.approx(-3.0))
    assert (speed.joint, speed.frames, speed.frame) == ("turn1", 1, 1)
    assert (speed.value, speed.limit) == (pytest.approx(31.0), pytest.approx(10.0))


def test_jerk_is_that_of_a_cubic(planar_arm: Callable[..., Any]) -> None:
    times = 0.02 * np.arange(30)
    q = np.column_stack([0.5 * times**3, np.zeros(30)])
    found = wb.check(wb.Clip(planar_arm([0.5, 0.5]), q, 0.02))
    assert found.mean_jerk == pytest.approx(3.0 / np.sqrt(2.0))  # 3 rad/s^3 at one of two joints


def test_a_scene_of_another_figure_is_refused(free_bodies: Callable[..., Any], planar_arm: Callable[..., Any]) -> None:
    with pytest.raises(wb.InputError, match=r"has other joints .* make the scene with clip.figure"):
        wb.check(ball(free_bodies, 0.0, 1.0), wb.Scene(planar_arm([0.5, 0.5])))


def test_ctrl_c_ends_a_check(free_bodies: Callable[..., Any]) -> None:
    def stop(done: int) -> None:
        raise KeyboardInterrupt

    clip = ball(free_bodies, *np.zeros(40))
    with pytest.raises(KeyboardInterrupt):
        wb.check(clip, progress=stop)
    assert wb.check(clip).free


def test_times_of_a_contact() -> None:
    depth = np.array([0.0, 0.0, 0.3, 0.2, 0.0, 0.0, 0.1])
    between = np.array([0.0, 0.3, 0.3, 0.2, 0.5, 0.1])
    found = contact("a", "b", "self", depth, between, 0.05)
    assert (found.frames, found.gaps, found.start, found.longest) == (3, 5, 1, (1, 4))
    assert (found.deepest, found.deepest_frame, found.deepest_between) == (0.5, 4, True)
    assert contact_as_dict(found, 0.1)["longest"]["seconds"] == pytest.approx(0.3)


def test_a_recorded_jump_with_a_ring_at_the_waist(shared_data: Path) -> None:
    """Pairs by pairs, frames and a fourth of each motion between them; hulls, boxes and capsules."""
    figure = wb.load("human")
    clip = wb.read_clip(shared_data / "mocap" / "cmu_02_03.bvh", figure).resampled(1 / 8)
    scene = wb.Scene(figure)
    for worn in equipment("torus", figure):
        worn.attach(scene)
    found = wb.check(clip, scene)
    said = {(each.first, each.second): each for each in found.contacts}
    seen, missed, depths = set(), 0.0, owner_depths(scene)
    for k in range(len(clip) - 1):
        for t in np.linspace(0.0, 1.0, 5)[:-1]:
            q = pin.interpolate(scene.model, clip.q[k], clip.q[k + 1], t)
            for names, deep in depths(q).items():
                if deep <= found.tolerance:
                    continue
                seen.add(names)
                missed = max(missed, deep - said[names].between[k])
                if t == 0.0:
                    assert said[names].depth[k] == pytest.approx(deep, abs=3e-6)
    assert missed < 3e-6
    assert len(seen) > 5


def test_a_check_is_told_in_three_lines() -> None:
    human = wb.load("human")
    standing = human.posture("standing")
    inside = human.with_joints(standing, {"right_shoulder_abduction": -0.3})
    found = wb.check(wb.Clip(human, [standing, inside, standing], 0.5, "an arm"))  # type: ignore[arg-type]
    lines = str(found).splitlines()
    assert len(lines) == 3
    assert (
        lines[0]
        == f"an arm, 3 frames: {len(found.contacts)} pairs collide in 1 frames, and 0 times between free frames"
    )
    assert f"{1e3 * found.deepest:.2f} mm" in lines[1]
    assert "at 0.50 s" in lines[1]
    assert len(repr(found)) < 200
    assert "nothing overlaps" in str(wb.check(wb.Clip(human, [standing], 0.5)))  # type: ignore[arg-type]

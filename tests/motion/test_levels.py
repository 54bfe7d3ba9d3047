"""Levels of the ground and feet that stand on them: made-up recordings whose heights are known."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_ground import DT, flat, walker
from tests.motion.test_retargeting import angles, person, places
from wholebody.motion import retargeting
from wholebody.motion.footholds import RestLimits, slow
from wholebody.motion.held_points import held_points
from wholebody.motion.holds import LAID, Holds
from wholebody.motion.roles import matched
from wholebody.motion.standing_ground import Foothold, Ground
from wholebody.motion.thing_contacts import own_rests


def test_feet_stand_on_every_level_wherever_most_time_is_spent() -> None:
    """A foot on a box for most of the time: the height of toes below ankles is that of one foot, not of two levels."""
    motion, _ = walker(flat, 4.0)
    at = np.repeat(motion.positions[:1], len(motion), axis=0)
    count, names = len(motion), motion.names
    for side, first in (("left", 0.75), ("right", 0.65)):  # seconds at which each foot goes up
        for joint, late in (("ankle", 0.0), ("foot", 0.15)):
            times = np.clip((np.arange(count) * DT - first - late) / 0.3, 0.0, 1.0)
            at[:, names.index(f"{side}_{joint}"), 2] += 0.4 * times + 0.25 * np.sin(np.pi * times)
        at[:, names.index(f"{side}_knee"), 2] += 0.4
    found = wb.motion.ground(dataclasses.replace(motion, positions=at))
    assert found.levels == pytest.approx((0.0, 0.4), abs=5e-3)
    for each in found.footholds:
        assert each.height == pytest.approx(0.4 if each.first * DT > 0.6 else 0.0, abs=5e-3)


def test_the_floor_is_where_most_rests_are_though_some_are_lower(human: wb.Figure) -> None:
    """A walk whose toes press in by 3.5 and by 7 cm in two of their stands: whoever stands stands on the floor."""
    motion, stands = walker(flat, 4.0)
    at, toes = np.array(motion.positions), motion.names.index("left_foot")
    first = np.flatnonzero(np.diff(stands["left"].astype(int)) == 1)[:2] + 1
    for begin, by in zip(first, (0.035, 0.07), strict=True):
        at[begin : begin + 5, toes, 2] -= by
    found = wb.motion.ground(pressed := dataclasses.replace(motion, positions=at))
    assert found.levels == (0.0,)
    assert max(each.height for each in found.footholds) == 0.0
    heel = places(wb.retarget(pressed, human), "right_heel")[stands["right"], 2]
    assert np.median(heel) < 2e-3


@pytest.mark.parametrize(("seconds", "rests"), [(0.2, False), (1.0, True)])
def test_a_foot_that_turns_high_in_the_air_does_not_rest(seconds: float, rests: bool) -> None:
    """A kick to 0.7 m, and a foot that is set on something as high while the other one bears."""
    motion, _ = walker(flat, 3.0)
    at, times = np.repeat(motion.positions[:1], len(motion), axis=0), np.arange(len(motion)) * DT
    end = 1.0 + seconds
    up = np.interp(times, [0.5, 0.9, 1.0, end, end + 0.1, end + 0.5], [0.0, 0.78, 0.7, 0.7, 0.78, 0.0])
    at[:, [motion.names.index(f"left_{part}") for part in ("knee", "ankle", "foot")], 2] += up[:, None]
    found = wb.motion.ground(dataclasses.replace(motion, positions=at))
    assert any(each.height > 0.5 for each in found.footholds) == rests


def test_a_sole_comes_to_be_held_at_its_height_while_it_turns_to_the_ground(human: wb.Figure) -> None:
    """A foot that turns by a degree a frame, from toes down to flat: no frame pulls it down much more.

    On the tips of its toes it is drawn down as hands are that bear.
    """
    motion, _ = walker(flat, 91 * DT)
    roles = matched(motion, human, None)
    every, rest = np.ones(91, dtype=bool), Foothold("left_toe", 0, 91, np.zeros(3), 0.0)
    ground = Ground((rest,), {"left_toe": every}, {"left_toe": 0.0}, (0.0,), 0.0, False, DT)
    points = held_points(human, roles, ground)
    held, paths = Holds(points, ground, 1.0, DT, None), {}
    data, foot = human.model.createData(), human.model.getJointId("left_ankle_inversion")
    pin.forwardKinematics(human.model, data, human.posture("standing"))
    for frame in range(91):
        turn = pin.SE3(pin.utils.rotate("y", np.radians(90.0 - frame)), np.zeros(3)) * data.oMi[foot].inverse()
        paths[frame] = np.array([turn.act(data.oMi[point.joint].act(point.place)) for point in points])
    pulls = np.array([held.goals(frame, paths, np.zeros(3), again=True)[1][:, 2].max() for frame in range(91)])
    assert 0.0 < pulls[0] == LAID < 0.01 * pulls[-1]
    assert np.diff(pulls).max() < 0.1 * pulls[-1]


def test_a_hand_that_rests_above_the_ground_keeps_its_height(human: wb.Figure) -> None:
    """10 cm above it, as on what nobody told of, a hand that would sway up and down is held at its mean."""
    motion, _ = walker(flat, 30 * DT)
    rest = Foothold("left_wrist", 0, 30, np.array([0.0, 0.0, 0.1]), 0.0)
    ground = Ground((rest,), {"left_wrist": np.ones(30, dtype=bool)}, {"left_toe": 0.0}, (0.0,), 0.0, False, DT)
    points = held_points(human, matched(motion, human, None), ground)
    paths = {k: np.array([[0.3, 0.2, 0.1 + 0.02 * np.sin(k)]]) for k in range(30)}
    held = Holds(points, ground, 1.0, DT, None)
    for k in range(1, 29):
        goals, weights = held.goals(k, paths, np.zeros(3), again=True)
        assert goals[0] == pytest.approx([0.3, 0.2, np.mean([paths[j][0, 2] for j in range(6)])])
        assert weights[0, 2] == LAID


def test_a_foot_that_trembles_rests_and_one_that_hangs_does_not() -> None:
    motion, stands = walker(flat, 2.0)
    at = np.array(motion.positions)
    wave = 0.007 * np.sin(2.0 * np.pi * 7.0 * DT * np.arange(len(at)))  # of 7 Hz and up to 0.3 m/s
    at[:, :, 1] += wave[:, None]
    found = wb.motion.ground(dataclasses.replace(motion, positions=at))
    assert min((found.rests[f"{side}_toe"] == mask).mean() for side, mask in stands.items()) > 0.85
    held = np.array(walker(flat, 2.0, raised=0.25)[0].positions)
    toes = motion.names.index("right_foot")
    held[20:, toes, 2] -= 0.1  # toes hang
    held[20:30, 5:9, 2] += np.linspace(0.02, 0.0, 10)[:, None]  # and it came down a little
    hangs = wb.motion.ground(dataclasses.replace(motion, positions=held))
    assert not hangs.rests["right_ankle"][20:].any()
    assert not hangs.rests["right_toe"][20:].any()


def test_a_foot_that_is_set_down_beside_where_it_was_rests_at_two_places() -> None:
    frames = np.arange(90)
    at = np.zeros((90, 3))
    at[:, 1] = 0.004 * np.sin(2.0 * np.pi * 7.0 * DT * frames)  # trembles with up to 0.18 m/s
    assert slow(at, DT, RestLimits()).all()
    at[:, 0] = 0.035 * np.clip((frames - 45) * DT / 0.2, 0.0, 1.0)
    found = slow(at, DT, RestLimits())
    assert not found[45:52].all()
    assert found[:42].all()
    assert found[55:].all()


@pytest.mark.parametrize(("noise", "rests"), [(0.0, False), (0.002, True)])
def test_a_rest_of_a_noisy_recording_may_drift(noise: float, rests: bool) -> None:
    """A foot stands for 0.3 s and goes on at 0.24 m/s, in a recording at 120 Hz; the noise is that of markers."""
    times = np.arange(66) / 120.0
    at = noise * np.random.default_rng(0).standard_normal((66, 3))
    at[:, 0] += 0.24 * np.clip(times - 0.3, 0.0, None)
    found = slow(at, 1.0 / 120.0, RestLimits())
    assert found[6:30].all()
    assert found[44:60].all() == rests
    assert rests or not found[44:].any()


def test_feet_that_hang_over_an_edge_are_not_drawn_to_the_floor(human: wb.Figure) -> None:
    """Feet rest at the height of a box that the scene does not have there: they stay where they are."""
    low = person(20, 1.1)
    known = wb.motion.ground(low)
    high = dataclasses.replace(low, positions=low.positions + [0.0, 0.0, 0.6])
    held = tuple(one._replace(height=0.6, place=one.place + [0.0, 0.0, 0.6]) for one in known.footholds)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    clip = wb.retarget(high, human, scene, ground=dataclasses.replace(known, footholds=held, levels=(0.6,)))
    assert places(clip, "left_heel")[:, 2].min() > 0.5


def test_what_is_far_above_all_that_the_scene_has_below_it_does_not_rest(human: wb.Figure) -> None:
    """A foot is set on something 0.3 m high for a second; it rests where a box of that height is, and else hangs."""
    motion, _ = walker(flat, 3.0)
    at, names, frames = np.repeat(motion.positions[:1], 90, axis=0), motion.names, np.arange(90)
    up = np.interp(frames, [20, 30, 60, 70], [0.0, 1.0, 1.0, 0.0])
    for joint in ("left_ankle", "left_foot", "left_knee"):
        at[:, names.index(joint), 2] += 0.3 * up + 0.25 * np.sin(np.pi * up)
    raised, foot = dataclasses.replace(motion, positions=at), at[45, names.index("left_ankle")]
    floor = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    assert wb.motion.ground(raised).rests["left_ankle"][35:55].all()
    assert not wb.motion.ground(raised, scene=floor).rests["left_ankle"][25:65].any()
    assert wb.motion.ground(raised, scene=floor).rests["right_ankle"].all()
    floor.add(wb.Box((0.5, 0.2, 0.3)), name="box", at=(foot[0], foot[1], 0.15))
    found = wb.motion.ground(raised, scene=floor)
    assert found.rests["left_ankle"][35:55].all()
    assert found.levels == (0.0, 0.3)


def test_who_stands_on_a_box_all_the_time_stands_on_it_in_the_scene(human: wb.Figure) -> None:
    low = person(20, 1.1)
    high = dataclasses.replace(low, positions=low.positions + [0.0, 0.0, 0.5])
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor").add(wb.Box((2.0, 2.0, 0.5)), name="box", at=(0, 0, 0.25))
    clip = wb.retarget(high, human, scene)
    assert np.abs(places(clip, "left_heel")[:, 2] - 0.5).max() < 3e-3
    assert wb.check(clip, scene).deepest < 1e-3


def test_a_skeleton_whose_axes_do_not_turn_with_its_feet_keeps_their_directions(human: wb.Figure) -> None:
    """Places alone, as of markers: a person turns round by 180 degrees, and the axes of its joints stay."""
    count = 50
    still = dataclasses.replace(person(count, 1.1), dt=0.1)  # so slow that feet rest
    turns = np.array([pin.utils.rotate("z", np.pi * k / count) for k in range(count)])
    places_ = np.einsum("nij,nkj->nki", turns, still.positions)
    lengths = np.linalg.norm(still.offsets, axis=1)[:, None] * [1.0, 0.0, 0.0]
    motion = dataclasses.replace(
        still, positions=places_, offsets=lengths, rotations=np.tile(np.eye(3), (count, len(still.names), 1, 1))
    )
    clip = wb.retarget(motion, human)
    ankle, toe = (motion.names.index(f"left_{part}") for part in ("ankle", "foot"))
    ours = places(clip, "left_toe_tip") - places(clip, "left_heel")
    flat_ones = [way * [1.0, 1.0, 0.0] for way in (ours, motion.positions[:, toe] - motion.positions[:, ankle])]
    assert np.median(angles(*flat_ones)) < 10.0


@pytest.mark.parametrize(("time", "count"), [(0.2, 0), (0.4, 1)])
def test_hands_that_pass_each_other_do_not_touch(time: float, count: int) -> None:
    motion = person(40)
    at = np.array(motion.positions)
    wrists = [motion.names.index(f"{side}_wrist") for side in ("left", "right")]
    at[:, wrists] = [[0.5, 0.5, 1.2], [0.5, -0.5, 1.2]]
    near = slice(15, 15 + round(time / motion.dt))
    at[near, wrists[0]] = [0.5, 0.0, 1.2]
    at[near, wrists[1]] = [0.5, 0.06, 1.2]
    joints = {f"{side}_wrist": f"{side}_wrist" for side in ("left", "right")}
    found = own_rests(dataclasses.replace(motion, positions=at), joints, dict.fromkeys(joints, 1.0), ())
    assert len(found) == count


def test_a_motion_through_a_panel_between_two_free_frames_is_told(human: wb.Figure) -> None:
    motion = person(12)
    moved = motion.positions + 0.9 * np.arange(12)[:, None, None] * [1.0, 0.0, 0.0]  # 0.9 m a frame
    scene = wb.Scene(human).add(wb.Box((0.01, 3.0, 4.0)), name="panel", at=(0.9 * 6.5, 0.0, 1.0))
    with pytest.warns(UserWarning, match=r"panel by \d+ mm after frame 6"):
        clip = wb.retarget(dataclasses.replace(motion, positions=moved), human, scene, ground=None)
    check = wb.check(clip, scene)
    assert check.colliding == 0
    assert check.between[6] > 0.05


def test_a_skeleton_of_places_alone_faces_where_its_hips_do(human: wb.Figure) -> None:
    """Its axes stay as they are in a rest posture that stands, while the person turns round by 180 degrees."""
    count = 30
    still = dataclasses.replace(person(count, 1.1), dt=0.1)
    turns = np.array([pin.utils.rotate("z", np.pi * k / count) for k in range(count)])
    clip = wb.retarget(dataclasses.replace(still, positions=np.einsum("nij,nkj->nki", turns, still.positions)), human)
    left = [places(clip, f"{side}_hip") for side in ("right", "left")]
    away = angles(left[1] - left[0], turns[:, :, 1])
    assert away.max() < 15.0
    chest = np.array([human.placement(q, "thorax").rotation for q in clip.q])  # turns with the hips, not against them
    assert angles(chest[:, :, 1], turns[:, :, 1]).max() < 15.0


def test_a_clip_that_is_stuck_is_sought_again_with_feet_that_lag_more(
    human: wb.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion, _ = walker(flat, 1.0)
    usual, measured, calls = wb.retarget(motion, human), retargeting._depths, list[float]()

    def depths(*given: Any) -> np.ndarray:
        calls.append(0.0)
        return measured(*given) + (0.01 if len(calls) == 1 else 0.0)  # as if the first one overlapped by 10 mm

    with monkeypatch.context() as patched:
        patched.setattr(retargeting, "_depths", depths)
        again = wb.retarget(motion, human)
    monkeypatch.setattr(retargeting, "LAG", retargeting.AGAIN)
    assert len(calls) == 2
    assert np.array_equal(again.q, wb.retarget(motion, human).q)
    assert not np.array_equal(again.q, usual.q)

"""Hands that rest on what is carried, on things that stand and in other hands stay there in a freed clip."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.resting_hands import RestingHands, resting_hands

ARM = Path(__file__).parents[2] / "examples" / "tasks" / "arm.urdf"
DT = 1 / 30
LET_GO = RestingHands([])


def placed(figure: Figure, q: np.ndarray, name: str) -> pin.SE3:
    """A frame in the world, by Pinocchio alone."""
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return data.oMf[figure.model.getFrameId(name)].copy()


def lifted(figure: Figure, frames: int = 13, by: float = 0.3) -> wb.Clip:
    """Both arms forward, and slowly up."""
    start, q = figure.posture("arms_forward"), []
    for share in np.linspace(-0.5, 0.5, frames):
        bent = {f"{side}_elbow_flexion": 0.6 for side in ("left", "right")}
        bent |= {f"{side}_shoulder_flexion": 1.0 + by * share for side in ("left", "right")}
        q.append(figure.with_joints(start, bent))
    return wb.Clip(figure, np.array(q), DT, "lifted")


def with_box(figure: Figure, clip: wb.Clip, rests: Sequence[str]) -> wb.Scene:
    """A box in the left hand that reaches to the right one, and a ball in the way of the right forearm."""
    left, right = (placed(figure, clip.q[0], f"{side}_palm") for side in ("left", "right"))
    middle = 0.5 * (left.translation + right.translation)
    scene, wide = wb.Scene(figure), float(np.linalg.norm(left.translation - right.translation)) - 0.03
    at = left.inverse() * pin.SE3(np.eye(3), middle)
    scene.attach(wb.Box((0.1, wide, 0.1)), to="left_palm", name="box", at=at, rests_on=rests)
    elbow = placed(figure, clip.q[len(clip) // 2], "right_forearm").translation
    return scene.add(wb.Sphere(0.04), name="ball", at=elbow + (0.05, -0.07, 0.0))


def apart(clip: wb.Clip, now: wb.Clip, name: str, base: str | None) -> float:
    """How far a frame is from where it was in the axes of another one in any frame, metres."""
    ways = []
    for each in (clip, now):
        seen = [placed(each.figure, q, name) for q in each.q]
        bases = [placed(each.figure, q, base) if base else pin.SE3.Identity() for q in each.q]
        ways.append(np.array([one.actInv(two).translation for one, two in zip(bases, seen, strict=True)]))
    return float(np.linalg.norm(ways[0] - ways[1], axis=1).max())


@pytest.mark.parametrize("rests", [["right_hand"], []], ids=["said", "near"])
def test_both_hands_stay_on_a_box_that_one_carries(human: Figure, rests: list[str]) -> None:
    clip = lifted(human)
    scene = with_box(human, clip, rests)
    assert wb.check(clip, scene).colliding
    found = wb.avoid(clip, scene)
    assert found.report.solved, found.report.message
    assert apart(clip, found.clip, "right_palm", "left_palm") < 1e-3
    if not rests:
        loose = wb.avoid(clip, scene, constraints=[LET_GO])
        assert apart(clip, loose.clip, "right_palm", "left_palm") > 5e-3


def test_a_hand_stays_on_a_rail_while_the_arm_gives_way(human: Figure) -> None:
    clip = lifted(human, by=0.0)
    palm, elbow = (placed(human, clip.q[0], f"right_{part}").translation for part in ("palm", "forearm"))
    low = min(contact_height(human, clip.q[0]) - 0.002, palm[2])
    scene = wb.Scene(human).add(wb.Box((0.04, 0.3, 0.04)), name="rail", at=(palm[0], palm[1], low - 0.02))
    scene.add(wb.Sphere(0.04), name="ball", at=elbow + (0.05, -0.07, 0.0))
    assert wb.check(clip, scene).colliding
    found = wb.avoid(clip, scene)
    assert found.report.solved, found.report.message
    assert apart(clip, found.clip, "right_palm", None) < 1e-3
    loose = wb.avoid(clip, scene, constraints=[LET_GO])
    assert apart(clip, loose.clip, "right_palm", None) > 5e-3


def contact_height(figure: Figure, q: np.ndarray) -> float:
    """Height of the lowest point of the right hand, by Coal's distance to a plane far below, metres."""
    data, far = figure.model.createData(), coal.Transform3s(np.eye(3), np.array((0.0, 0.0, -1.0)))
    pin.forwardKinematics(figure.model, data, q)
    joint = figure.model.frames[figure.model.getFrameId("right_palm")].parentJoint
    plane, gaps = coal.Halfspace(np.array((0.0, 0.0, 1.0)), 0.0), list[float]()
    for piece in figure.geometry.geometryObjects:
        if piece.parentJoint == joint:
            at = data.oMi[joint] * piece.placement
            here = coal.Transform3s(at.rotation, at.translation)
            gaps.append(coal.distance(plane, far, piece.geometry, here, coal.DistanceRequest(), coal.DistanceResult()))
    return min(gaps) - 1.0


def beside(q: np.ndarray, reach: float) -> np.ndarray:
    """The postures of two people of whom the second one stands to the right of the first one."""
    both = np.concatenate([q, q])
    both[len(q) + 1] -= reach
    return both


def between(scene: wb.Scene, q: np.ndarray, reach: float) -> float:
    """Distance of the first one's right hand and the second one's left hand, by Coal, metres."""
    figure, placings = scene.figure, []
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, beside(q, reach))
    for name in ("ann/right_palm", "ben/left_palm"):
        joint = figure.model.frames[figure.model.getFrameId(name)].parentJoint
        found = [each for each in figure.geometry.geometryObjects if each.parentJoint == joint]
        ats = [data.oMi[joint] * each.placement for each in found]
        placings.append(
            [
                (each.geometry, coal.Transform3s(at.rotation, at.translation))
                for each, at in zip(found, ats, strict=True)
            ]
        )
    request, result = coal.DistanceRequest(), coal.DistanceResult
    return min(coal.distance(*one, *two, request, result()) for one in placings[0] for two in placings[1])


def held(scene: wb.Scene, q: np.ndarray) -> tuple[list[set[tuple[str, str | None]]], str]:
    found, sunk = resting_hands(scene, q, DT, RestingHands().names(scene))
    return [{(hold.frame, hold.relative_to) for hold in each} for each in found], sunk


def test_hands_of_two_people_who_hold_each_other_are_found_while_they_do(human: Figure) -> None:
    """Two people side by side; the second one steps away after half of the clip."""
    q = human.posture("standing")
    right = placed(human, q, "right_palm").translation
    scene = wb.Scene({"ann": human, "ben": human})
    reach = 2.0 * abs(right[1]) + 0.2  # m
    for _ in range(4):  # to 2 mm between the hands; the one is the mirror image of the other
        reach -= between(scene, q, reach) - 0.002
    frames = [beside(q, reach + away) for away in [0.0] * 12 + np.linspace(0.02, 0.4, 12).tolist()]
    found, sunk = held(scene, np.array(frames))
    assert all(each == {("ann/right_palm", "ben/left_palm")} for each in found[:10])
    assert not any(found[14:])
    assert not sunk


def test_a_hand_that_goes_past_a_thing_is_not_held(human: Figure) -> None:
    clip = lifted(human, by=2.0)
    at = placed(human, clip.q[6], "right_palm").translation + (0.04, 0.0, 0.0)
    found, sunk = held(wb.Scene(human).add(wb.Sphere(0.02), name="knob", at=at), clip.q)
    assert not any(found)
    assert not sunk


def test_a_hand_that_rests_inside_a_thing_is_told_before_and_in_the_report(human: Figure) -> None:
    clip = lifted(human, by=0.0)
    palm, low = placed(human, clip.q[0], "right_palm").translation, contact_height(human, clip.q[0])
    scene = wb.Scene(human).add(wb.Box((0.4, 0.4, 0.04)), name="table", at=(palm[0], palm[1], low - 0.02 + 0.004))
    said = "right_palm rests up to 4 mm inside table, and is not held there"
    assert held(scene, clip.q) == ([set()] * len(clip), said)
    with pytest.warns(UserWarning, match=said):
        wb.avoid(clip, scene, progress=lambda _: True)


def test_a_bar_keeps_its_place_in_the_second_of_two_arms() -> None:
    """Said to rest on the palms and fingers of both grippers, of which one carries it."""
    arm = wb.load(ARM)
    scene = wb.Scene({"left": arm, "right": (arm, (1.1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    hands = [f"{side}/{part}" for side in ("left", "right") for part in ("palm", "left_finger", "right_finger")]
    scene.attach(wb.Capsule(0.015, 0.36), to="left/grip", name="bar", rests_on=hands)
    scene.add(wb.Sphere(0.05), name="post", at=placed(scene.figure, scene.figure.neutral, "left/upper_arm").translation)
    q = np.repeat(scene.figure.neutral[None], 5, axis=0)
    found, _ = held(scene, q)
    assert found == [{("right/palm", "left/grip")}] * 5
    hold = resting_hands(scene, q, DT, RestingHands().names(scene))[0][0][0]
    assert hold.orientation
    mine = frame_terms(scene, q, DT, [RestingHands(), wb.Hold("right/grip", relative_to="left/grip")])
    assert not any(mine.hands)  # a hand that is held by a given term is left to it


@pytest.mark.parametrize("worn", ["pack", "pouches"])
def test_what_equipment_rests_on_is_no_hand(human: Figure, worn: str) -> None:
    scene = wb.Scene(human)
    for piece in wb.motion.equipment(worn, human):
        piece.attach(scene)
    assert RestingHands().names(scene) == ("left_palm", "right_palm")

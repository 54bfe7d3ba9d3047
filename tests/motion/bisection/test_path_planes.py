"""Planes that follow a path: eqs. 3.2 and 3.3 of the thesis, evaluated on their own."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.motion.bisection.prediction import path_planes


@pytest.fixture(scope="module")
def person() -> Figure:
    return wb.load("human")


@pytest.fixture(scope="module")
def swing(person: Figure) -> Array:
    angles = np.linspace(-0.5, 0.6, 12)
    return np.array([person.with_joints(person.neutral, {"left_shoulder_flexion": a}) for a in angles.tolist()])


def place(figure: Figure, q: Array, frame: str) -> Array:
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return np.array(data.oMf[figure.frame_id(frame)].translation)


@pytest.mark.parametrize("frame", [0, 5, 11])
def test_the_plane_goes_through_the_joint_normal_to_its_way(person: Figure, swing: Array, frame: int) -> None:
    (plane,) = path_planes(person, swing, frame, ["left_elbow"], State(person.model))
    here, there = (frame, frame + 1) if frame < 11 else (10, 11)
    way = place(person, swing[there], "left_elbow") - place(person, swing[here], "left_elbow")
    resolved = plane.resolve(wb.Scene(person), swing[0])
    assert np.allclose(resolved.resolved_normal, way / np.linalg.norm(way))
    state = State(person.model).update(swing[frame])
    assert resolved.value(state)[0] == pytest.approx(0.0, abs=1e-12)
    # Eq. 3.3 for a joint elsewhere: the distance is the length of the offset times the cosine of its angle to n.
    other = person.with_joints(swing[frame], {"left_shoulder_abduction": 0.9, "left_shoulder_flexion": 0.3})
    offset = place(person, other, "left_elbow") - place(person, swing[frame], "left_elbow")
    cosine = offset @ way / np.linalg.norm(offset) / np.linalg.norm(way)
    assert resolved.value(State(person.model).update(other))[0] ** 2 == pytest.approx(offset @ offset * cosine**2)


def test_planes_of_wrists_follow_wrists(person: Figure, swing: Array) -> None:
    planes = path_planes(person, swing, 4, ["left_wrist", "left_elbow"], State(person.model))
    assert [plane.frame for plane in planes] == ["left_wrist", "left_elbow"]
    for plane in planes:
        assert np.allclose(plane.point, place(person, swing[4], plane.frame))  # type: ignore[arg-type]


def test_planes_change_with_the_curves(person: Figure, swing: Array) -> None:
    q = swing.copy()
    before = path_planes(person, q, 4, ["left_elbow"], State(person.model))[0]
    q[5] = person.with_joints(q[5], {"left_shoulder_abduction": 0.7})
    after = path_planes(person, q, 4, ["left_elbow"], State(person.model))[0]
    assert not np.allclose(before.normal, after.normal)


def test_a_joint_that_stands_has_no_plane(person: Figure, swing: Array) -> None:
    assert path_planes(person, swing, 4, ["right_elbow"], State(person.model)) == []
    assert path_planes(person, swing[:1], 0, ["left_elbow"], State(person.model)) == []

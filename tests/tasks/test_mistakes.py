"""Bad input is refused in one sentence that says where and how to mend it."""

from __future__ import annotations

import warnings
from typing import Any

import pytest

from wholebody import InputError, tasks
from wholebody.base.errors import UnknownNameError

NAN = float("nan")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tasks.Point("tip", (550.0, -250.0, 950.0)), r"Point\('tip'\): target is 1126 m away; .* millimetres"),
        (lambda: tasks.Point("tip", (0.0, NAN, 0.0)), r"Point\('tip'\): target is .*nan.*; give finite numbers"),
        (lambda: tasks.Point("tip", (0.0, 1.0)), r"Point\(.tip.\): target has shape \(2,\); give 3 numbers"),
        (lambda: tasks.Point("tip", (True, 0.0, 1.0)), r"target is \(True, 0.0, 1.0\), of which one is no number"),
        (lambda: tasks.Point("tip", (0, 0, 0), weight=-1), "weight is -1; give a positive number"),
        (lambda: tasks.Frame("tip", (0, 0, 0, 0, 0, 0, 2)), r"Frame\('tip'\): target.*quaternion"),
        (lambda: tasks.Orientation("tip", (0, 0, 0, 0.5)), "quaternion"),
        (lambda: tasks.Axis("tip", (1, 0, 0)), "either a direction or a place"),
        (lambda: tasks.Axis("tip", (0, 0, 0), direction=(0, 0, 1)), "axis is .* has no direction"),
        (lambda: tasks.CenterOfMass((0, 0, 0), axes="z"), "axes is 'z'"),
        (lambda: tasks.Plane("tip", (0, 0, 1), side="below"), "side is 'below'; give 'on' or 'above'"),
        (lambda: tasks.Effort(0.0), "Effort: weight is 0"),
        (lambda: tasks.Displacement(NAN), "Displacement: weight is nan"),
    ],
)
def test_values_are_checked_when_a_term_is_written(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_other_mistakes_are_found_when_the_figure_is_known(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    with pytest.raises(UnknownNameError, match="Posture: no posture is called 'standin'; did you mean standing"):
        tasks.Posture("standin").resolve(humanoid, q)
    with pytest.raises(InputError, match=r"Posture: target has shape \(34,\); give 35 numbers"):
        tasks.Posture(q[1:]).resolve(humanoid, q)
    with pytest.raises(InputError, match="quaternion that is not of unit length"):
        tasks.Posture(2.0 * q).resolve(humanoid, q)
    with pytest.raises(InputError, match="Relative: 'tip' cannot move relative to 'larm_effector_body'"):
        tasks.Relative("tip", "larm_effector_body").resolve(humanoid, q)
    with pytest.raises(InputError, match="has no reach cones"):
        tasks.ReachCones().resolve(humanoid, q)
    humanoid.figure.cones = {"left_shoulder": None}
    with pytest.raises(UnknownNameError, match="ReachCones: no reach cone is called 'left_sholder'"):
        tasks.ReachCones(("left_sholder",)).resolve(humanoid, q)


def test_what_is_hardly_meant_is_told() -> None:
    with pytest.warns(
        UserWarning, match=r"target: the quaternion \(1, 0, 0, 0\) is half a turn about x; .* x, y, z, w"
    ):
        tasks.Orientation("tip", (1.0, 0.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="quaternions are x, y, z, w"):
        tasks.Frame("tip", (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="target is 98.7 m away; .* centimetres") as said:
        tasks.Point("tip", (55.0, -20.0, 79.5))
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tasks.Frame("tip", (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))

"""`wb.check_derivatives`: right terms agree, and a wrong one is named by row, joint and sign."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State, Wrench


class Height(wb.Constraint):
    """Height of the pelvis, with a derivative that may be wrong."""

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = factor

    def value(self, state: State) -> np.ndarray:
        return np.array([state.frame(state.model.getFrameId("pelvis")).translation[2]])

    def jacobian(self, state: State) -> Wrench:
        place = state.frame(state.model.getFrameId("pelvis")).translation
        up = np.array([0.0, 0.0, 1.0])
        joint = state.model.frames[state.model.getFrameId("pelvis")].parentJoint
        return Wrench(self.factor * np.concatenate([up, np.cross(place, up)])[None], joint)


class Bending(wb.Measure):
    """A joint's angle, squared; the derivative may have another shape or be no number."""

    def __init__(self, fault: str = "") -> None:
        self.fault = fault

    def value(self, state: State) -> float:
        return float(state.q[20] ** 2)

    def gradient(self, state: State) -> np.ndarray:
        gradient = np.zeros(state.model.nv + (self.fault == "shape"))
        gradient[19] = np.nan if self.fault == "nan" else 2.0 * state.q[20]
        return gradient

    def curvature(self, state: State) -> np.ndarray:
        return np.full(state.model.nv, 1e-3)


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


@pytest.mark.parametrize(
    "term",
    [
        wb.Point("right_index_tip", (0.4, 0.0, 1.0)),
        wb.Axis("gaze", (1.0, 0.0, 0.0), toward=(0.7, 0.0, 1.2)),
        wb.CenterOfMass((0.0, 0.0, 1.0)),
        wb.Hold("left_foot"),
        wb.Balance(),
        wb.tasks.Discomfort(),
        wb.tasks.PotentialEnergy(),
        Height(),
        Bending(),
    ],
    ids=lambda term: type(term).__name__,
)
def test_right_derivatives_agree(scene: wb.Scene, term: wb.Goal) -> None:
    check = wb.check_derivatives(term, scene)
    assert check
    assert check.agrees
    assert check.error < 1e-5 * (1.0 + abs(check.measured)) or check.error < 1e-4
    assert "agrees" in str(check)


def test_a_wrong_sign_is_named_with_row_and_joint(scene: wb.Scene) -> None:
    check = wb.check_derivatives(Height(-1.0), scene)
    assert not check
    assert (check.row, check.joint) == (0, "root")
    assert check.given == pytest.approx(-check.measured, abs=1e-6)
    assert "the sign is wrong" in str(check)
    assert "root" in str(check)
    # the posture where it is: there the entry is what finite differences of another library's kinematics say
    model, data = scene.model, scene.model.createData()
    heights = []
    for step in (1e-6, -1e-6):
        move = np.zeros(model.nv)
        # the root's linear part is the only one with an entry of 1
        move[int(np.argmax([abs(v) for v in _root_rows(scene, check.q)]))] = step
        pin.framesForwardKinematics(model, data, pin.integrate(model, check.q, move))
        heights.append(data.oMf[model.getFrameId("pelvis")].translation[2])
    assert check.measured == pytest.approx((heights[0] - heights[1]) / 2e-6, abs=1e-6)


def _root_rows(scene: wb.Scene, q: np.ndarray) -> np.ndarray:
    data = scene.model.createData()
    frame = scene.model.getFrameId("pelvis")
    return np.array(pin.computeFrameJacobian(scene.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[2, :6])


def test_a_wrong_size_is_no_wrong_sign(scene: wb.Scene) -> None:
    check = wb.check_derivatives(Height(0.5), scene)
    assert not check
    assert "the sign is wrong" not in str(check)


def test_a_derivative_of_another_shape_or_of_no_numbers_is_refused(scene: wb.Scene) -> None:
    with pytest.raises(wb.InputError, match="shape"):
        wb.check_derivatives(Bending("shape"), scene)
    with pytest.raises(wb.InputError, match="not finite"):
        wb.check_derivatives(Bending("nan"), scene)

"""A scene around Pinocchio's sample humanoid, with only what terms ask of a scene."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from wholebody.base.errors import UnknownNameError
from wholebody.figures.description import Place
from wholebody.figures.state import State


class StandInFigure:
    """The part of a figure that terms use."""

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        self.root, self.roots, self.bodies = "free", {"root": 1}, {"": range(1, model.njoints)}
        self.neutral = pin.neutral(model)
        weights = np.linspace(0.5, 2.0, model.nv)
        weights[:6] = 0.0
        self.effort_weights = weights
        self.neutral_weights = weights[::-1].copy()
        self.neutral_weights[:6] = 0.0
        self.groups = {"left_arm": tuple(n for n in model.names if n.startswith("larm"))}
        idx_v = np.arange(6, model.nv)
        self.limits = SimpleNamespace(
            idx_q=idx_v + 1, idx_v=idx_v, lower=np.full(idx_v.size, -1.6), upper=np.full(idx_v.size, 2.1)
        )
        self.cones: dict[str, Any] = {}
        self.postures = ("standing",)

    def warn_of_angles(self, q: Any, what: str) -> bool:
        return False

    def posed(self, q: Any) -> Any:
        return nullcontext(State(self.model).update(q))

    def place_of(self, name: str) -> Place:
        frame = self.model.frames[self.frame_id(name)]
        return Place(self.frame_id(name), int(frame.parentJoint), pin.SE3(frame.placement))

    def frame_id(self, name: str) -> int:
        if not self.model.existFrame(name):
            raise UnknownNameError("frame", name, [frame.name for frame in self.model.frames])
        return int(self.model.getFrameId(name))

    def placement(self, q: Any, name: str) -> Any:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, q)
        return pin.updateFramePlacement(self.model, data, self.frame_id(name)).copy()

    def posture(self, name: str) -> Any:
        if name != "standing":
            raise UnknownNameError("posture", name, ["standing"])
        return self.neutral.copy()

    def dofs(self, names: Any) -> Any:
        indices: list[int] = []
        for name in names:
            if name == "root":
                indices += range(6)
                continue
            for joint_name in self.groups.get(name, (name,)):
                if not self.model.existJointName(joint_name):
                    raise UnknownNameError("joint or group", name, list(self.model.names))
                joint = self.model.joints[self.model.getJointId(joint_name)]
                indices += range(joint.idx_v, joint.idx_v + joint.nv)
        return np.array(sorted(set(indices)), dtype=np.intp)

    def tangent_bounds(self, q: Any) -> tuple[Any, Any]:
        low, high = np.full(self.model.nv, -np.inf), np.full(self.model.nv, np.inf)
        low[self.limits.idx_v] = self.limits.lower - q[self.limits.idx_q]
        high[self.limits.idx_v] = self.limits.upper - q[self.limits.idx_q]
        return low, high


@pytest.fixture
def humanoid() -> Any:
    """A scene of Pinocchio's humanoid with box feet, free-flyer root."""
    model = pin.buildSampleModelHumanoid()
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    geometry = pin.GeometryModel()
    box = coal.Box(0.24, 0.1, 0.04)
    for side in ("l", "r"):
        joint = model.getJointId(f"{side}leg_wrist2_joint")
        frame = model.addFrame(pin.Frame(f"{side}foot", joint, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        sole = pin.SE3(np.eye(3), data.oMi[joint].translation + np.array([0.05, 0.0, -0.06]))
        placement = data.oMi[joint].actInv(sole)
        geometry.addGeometryObject(pin.GeometryObject(f"{side}foot", joint, frame, placement, box))
    tip = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 1.1), np.array([0.02, 0.01, -0.2]))
    model.addFrame(pin.Frame("tip", model.getJointId("larm_wrist2_joint"), 0, tip, pin.FrameType.OP_FRAME))
    figure = StandInFigure(model)
    built = SimpleNamespace(moves=0, known=lambda key, make: make())
    owner = tuple(piece.name for piece in geometry.geometryObjects)
    return SimpleNamespace(figure=figure, model=model, geometry=geometry, built=built, piece_owner=owner)


@pytest.fixture
def random_posture() -> Any:
    """A function that draws postures far from neutral, root included."""

    def draw(model: pin.Model, rng: np.random.Generator, spread: float = 1.0) -> Any:
        return pin.integrate(model, pin.neutral(model), spread * rng.normal(size=model.nv))

    return draw

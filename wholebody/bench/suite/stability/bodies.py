"""Simple figures for hard cases: arms in a plane, an arm in space, and tools that slide and turn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.figures.description import Articulated, Description
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Shape


class Builder:
    """Builds a figure joint by joint."""

    def __init__(self, name: str) -> None:
        self.name, self.model, self.geometry = name, pin.Model(), pin.GeometryModel()
        self._segments: list[str] = []
        self._frames: list[str] = []

    def joint(
        self, kind: str, name: str, *, parent: int = 0, at: Any = (0.0, 0.0, 0.0), limits: Sequence[float] | None = None
    ) -> int:
        """Add a joint, "rx" turns about x, "px" slides along it, and the segment that it carries; return its index."""
        most = 2.9 if kind[0] == "r" else 2.0  # rad, m: limit of a joint if nothing else is said
        low, high = (-most, most) if limits is None else limits
        bounds = [np.array([value]) for value in (100.0, 10.0, low, high)]
        place = pin.SE3(np.eye(3), np.array(at, dtype=float))
        index = int(self.model.addJoint(parent, getattr(pin, f"JointModel{kind.upper()}")(), place, name, *bounds))
        self.model.appendBodyToJoint(index, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        self.model.addFrame(pin.Frame(f"{name}_link", index, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        self._segments.append(f"{name}_link")
        return index

    def piece(self, joint: int, geometry: Any, place: pin.SE3) -> None:
        """Give the segment of a joint a convex piece of coal's."""
        segment = f"{self.model.names[joint]}_link"
        name = f"{segment}:{sum(piece.parentJoint == joint for piece in self.geometry.geometryObjects)}"
        made = pin.GeometryObject(name, joint, self.model.getFrameId(segment), place, geometry)
        made.meshColor[:] = (0.62, 0.66, 0.70, 1.0)
        self.geometry.addGeometryObject(made)

    def shape(self, joint: int, shape: Shape, at: pin.SE3 | None = None) -> None:
        """Give the segment of a joint a shape, centred at `at` in the joint's axes."""
        base = pin.SE3.Identity() if at is None else at
        for part in shape.pieces():
            self.piece(joint, part.geometry, base * part.placement)

    def rod(self, joint: int, end: Any, radius: float) -> None:
        """Give the segment of a joint a capsule from the joint to `end` (3,)."""
        way = np.array(end, dtype=float)
        length = float(np.linalg.norm(way))
        turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), way / length).matrix()
        self.piece(joint, coal.Capsule(radius, length), pin.SE3(turn, way / 2.0))

    def frame(self, joint: int, name: str, at: Any) -> None:
        """Name a place of a segment."""
        place = pin.SE3(np.eye(3), np.array(at, dtype=float))
        parent = self.model.getFrameId(f"{self.model.names[joint]}_link")
        self.model.addFrame(pin.Frame(name, joint, parent, place, pin.FrameType.OP_FRAME))
        self._frames.append(name)

    def figure(self, *, pairs: bool = True) -> Figure:
        """The figure; pieces of segments that are not neighbours can touch unless `pairs` is false."""
        joints = [piece.parentJoint for piece in self.geometry.geometryObjects]
        for second in range(len(joints) if pairs else 0):
            for first in range(second):
                a, b = joints[first], joints[second]
                if a != b and self.model.parents[b] != a and self.model.parents[a] != b:
                    self.geometry.addCollisionPair(pin.CollisionPair(first, second))
        names = tuple(self.model.names)[1:]
        description = Description(
            groups={"all": names},
            chains={},
            frames=(*self._frames, *self._segments),
            segments=tuple(self._segments),
            postures={"neutral": _neutral},
        )
        return Figure(self.name, self.model, self.geometry, "own", description)


def _neutral(figure: Articulated) -> Any:
    return figure.clamp(pin.neutral(figure.model))


def planar_arm(
    lengths: Iterable[float], radius: float = 0.03, *, limits: Sequence[float] | None = None, base: Any = (0, 0, 0)
) -> Figure:
    """An arm in the plane of x and z, along x at zero; joints "turn1", ..., frame "tip"."""
    builder = Builder("planar arm")
    joint, at = 0, base
    for number, length in enumerate(lengths, start=1):
        joint = builder.joint("ry", f"turn{number}", parent=joint, at=at, limits=limits)
        at = (length, 0.0, 0.0)
        builder.rod(joint, at, radius)
    builder.frame(joint, "tip", at)
    return builder.figure()


def spatial_arm() -> Figure:
    """An arm of six joints that stands upright at zero: base, shoulder, elbow and three of a wrist; frame "tip"."""
    builder, joint, at = Builder("arm of six joints"), 0, 0.15
    for kind, name, length, share in (
        ("rz", "base", 0.15, 1.5), ("ry", "shoulder", 0.4, 1.0), ("ry", "elbow", 0.2, 1.0),
        ("rz", "roll", 0.15, 0.8), ("ry", "pitch", 0.1, 0.7), ("rz", "hand", 0.08, 0.6),
    ):  # fmt: skip
        joint = builder.joint(kind, name, parent=joint, at=(0.0, 0.0, at))
        builder.rod(joint, (0.0, 0.0, length), share * 0.04)  # m: radius of an arm in space
        at = 0.2 if name == "base" else length  # the shoulder is a little above the end of the base
    builder.frame(joint, "tip", (0.0, 0.0, at))
    return builder.figure()


def sliding_tool(*pieces: tuple[Shape, pin.SE3]) -> Figure:
    """A tool that slides along x, y and z; frame "tool" at its middle."""
    builder = Builder("sliding tool")
    joint = 0
    for kind in ("px", "py", "pz"):
        joint = builder.joint(kind, f"slide_{kind[1]}", parent=joint)
    for shape, place in pieces:
        builder.shape(joint, shape, place)
    builder.frame(joint, "tool", (0.0, 0.0, 0.0))
    return builder.figure()


def human_arm(*, clavicle: bool = True) -> Figure:
    """A person of whom only the right arm moves, with or without its clavicle; frame "right_index_tip"."""
    from wholebody.figures.loading import load

    figure = load("human")
    joints = figure.groups["right_arm"]
    return figure.reduced([name for name in joints if clavicle or "clavicle" not in name])


def star() -> Figure:
    """A hub that slides and turns, with twelve arms of two joints; frames "tip1" to "tip12"."""
    builder = Builder("star of twelve arms")
    slide = builder.joint("px", "slide_x")
    slide = builder.joint("pz", "slide_z", parent=slide)
    hub = builder.joint("ry", "hub", parent=slide)
    for k in range(12):
        angle = 2.0 * np.pi * k / 12
        rim = 0.15 * np.array([np.cos(angle), 0.0, -np.sin(angle)])
        upper = builder.joint("ry", f"upper{k + 1}", parent=hub, at=rim)
        builder.model.jointPlacements[upper] = pin.SE3(pin.utils.rotate("y", angle), rim)
        builder.rod(upper, (0.2, 0.0, 0.0), 0.01)
        lower = builder.joint("ry", f"lower{k + 1}", parent=upper, at=(0.2, 0.0, 0.0))
        builder.rod(lower, (0.2, 0.0, 0.0), 0.01)
        builder.frame(lower, f"tip{k + 1}", (0.2, 0.0, 0.0))
    return builder.figure(pairs=False)

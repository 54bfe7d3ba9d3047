"""Figures at random: people, avatars, hands, packaged robots, and small ones that are made up."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.case import chosen
from wholebody.bench.attack.judging import Pairs
from wholebody.figures.packaged_urdf import task_paths, urdf_path


@dataclass(frozen=True)
class Body:
    """A figure.

    Attributes:
        figure: loaded.
        size: metres by which things about it are measured.
        people: whether it is a person or an avatar, who stands.
    """

    figure: wb.Figure
    size: float
    people: bool = False

    @property
    def standing(self) -> Array:
        """Its first posture (nq,), within its limits."""
        return self.figure.clamp(self.figure.posture(self.figure.postures[0]))

    @property
    def frames(self) -> list[str]:
        """Frames that goals can name."""
        return list(dict.fromkeys((*self.figure.frames, *self.figure.segments)))

    def near(self, q: Array, share: float, rng: np.random.Generator, free: list[int] | None = None) -> Array:
        """Return a posture (nq,) within the limits, off from q by a share of what joints can do.

        Args:
            q: (nq,).
            share: 0 to 1.
            rng: of the posture.
            free: places in the tangent that may differ; all but a free root's if left out.
        """
        model, limits = self.figure.model, self.figure.limits
        way = rng.uniform(-share * np.pi, share * np.pi, model.nv)
        reach = limits.upper - limits.lower
        way[limits.idx_v] = rng.uniform(limits.lower, limits.upper) - q[limits.idx_q]
        way[limits.idx_v] = share * np.where(np.isfinite(reach), way[limits.idx_v], 0.0)
        root = 6 if self.figure.root == "free" else 0
        kept = np.ones(model.nv, dtype=bool)
        kept[list(range(root, model.nv)) if free is None else free] = False
        way[kept] = 0.0
        return self.figure.clamp(pin.integrate(model, q, way))

    def clear(self, q: Array, share: float, rng: np.random.Generator, room: float) -> Array | None:
        """Return a posture as `near` does that has some room, metres, between its own pairs; None if none was found."""
        alone = Pairs(wb.Scene(self.figure))
        for _ in range(30):
            found = self.near(q, share, rng)
            if alone.distances(found).min(initial=np.inf) > room:
                return found
        return None


def body(rng: np.random.Generator, folder: Path) -> Body:
    """Return a figure; the file of a robot that is made up is written into a folder."""
    kind = rng.choice(["human", "avatar", "hand", "packaged", "robot"], p=[0.27, 0.1, 0.17, 0.11, 0.35])
    if kind == "robot":
        return _robot(rng, folder / "robot.urdf")
    if kind == "hand":
        return Body(wb.load("hand", side=chosen(rng, ("left", "right"))), 0.15)
    if kind == "packaged":
        name = chosen(rng, ("human", "avatar", "hand", "arm"))
        if name == "arm":
            return Body(wb.load(task_paths()["shelf"].with_name("arm.urdf")), 0.9)
        root = chosen(rng, ("free", "fixed"))
        return Body(wb.load(urdf_path(name), root=root), 0.15 if name == "hand" else 1.7)
    detail = chosen(rng, ("spheres", "capsules", "hulls"))
    sex, stature = chosen(rng, ("male", "female")), float(np.round(rng.uniform(1.5, 1.95), 3))
    stature = 1.75 if detail == "hulls" else stature  # hulls of a size are made once
    return Body(wb.load(str(kind), sex=sex, stature=stature, detail=detail), 1.7, people=True)


def _robot(rng: np.random.Generator, path: Path) -> Body:
    """A small robot that is made up: links from a millimetre to some thirty metres."""
    size = chosen(rng, (0.005, 0.02, 0.1, 1.0, 1.0, 1.0, 10.0, 60.0))
    path.write_text(_urdf(rng, size), encoding="utf-8")
    return Body(wb.load(path, root="free" if rng.random() < 0.15 else "fixed"), size)


def _urdf(rng: np.random.Generator, scale: float) -> str:
    """Return a robot whose links are about 0.3 times the scale long, metres."""
    count = 1 if rng.random() < 0.3 else int(rng.integers(2, 9))
    parts = [_link("link0", rng, scale, 0.0)]
    lengths = [0.0]
    for number in range(1, count + 1):
        parent = int(rng.integers(0, number)) if rng.random() < 0.2 else number - 1
        length = float(scale * rng.uniform(0.1, 0.5))
        parts.append(_joint(number, parent, lengths[parent], rng, scale))
        parts.append(_link(f"link{number}", rng, scale, length))
        lengths.append(length)
    parts.append(
        f'  <link name="tip"/>\n  <joint name="fixed_tip" type="fixed"><parent link="link{count}"/><child link="tip"/>'
        f'<origin xyz="0 0 {lengths[-1]!r}"/></joint>'
    )
    return "\n".join(['<?xml version="1.0"?>', '<robot name="attacked">', *parts, "</robot>\n"])


def _joint(number: int, parent: int, length: float, rng: np.random.Generator, scale: float) -> str:
    kind = chosen(rng, ("revolute", "revolute", "revolute", "prismatic", "continuous"))
    axis = np.eye(3)[int(rng.integers(3))] if rng.random() < 0.7 else rng.normal(size=3)
    axis = axis / np.linalg.norm(axis)
    turn = rng.uniform(-1.0, 1.0, 3) if rng.random() < 0.3 else np.zeros(3)
    reach = scale * 0.5 if kind == "prismatic" else 2.9
    low, high = -reach * float(rng.uniform(0.1, 1.0)), reach * float(rng.uniform(0.1, 1.0))
    if rng.random() < 0.1:
        low = high * 0.5  # zero is out of the limits
    ends = "" if kind == "continuous" else f'lower="{low!r}" upper="{high!r}" '
    return (
        f'  <joint name="joint{number}" type="{kind}"><parent link="link{parent}"/><child link="link{number}"/>'
        f'<origin xyz="0 0 {length!r}" rpy="{_numbers(turn)}"/><axis xyz="{_numbers(axis)}"/>'
        f'<limit {ends}effort="10" velocity="3"/></joint>'
    )


def _link(name: str, rng: np.random.Generator, scale: float, length: float) -> str:
    mass = float(min(scale**3 * 100.0 + 1e-6, 1e5))
    inertia = float(mass * scale**2 / 100.0 + 1e-12)
    inertial = (
        f'<inertial><origin xyz="0 0 {length / 2!r}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    if rng.random() < 0.1:
        return f'  <link name="{name}">{inertial}</link>'
    width = float(scale * rng.uniform(0.02, 0.06))
    long = max(length, 2.0 * width)
    shapes = {
        "box": f'<box size="{width!r} {1.5 * width!r} {0.9 * long!r}"/>',
        "sphere": f'<sphere radius="{width!r}"/>',
        "cylinder": f'<cylinder radius="{width!r}" length="{0.9 * long!r}"/>',
        "capsule": f'<capsule radius="{0.7 * width!r}" length="{0.7 * long!r}"/>',
    }
    shape = chosen(rng, list(shapes.values()))
    return (
        f'  <link name="{name}">{inertial}<collision><origin xyz="0 0 {length / 2!r}"/>'
        f"<geometry>{shape}</geometry></collision></link>"
    )


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)

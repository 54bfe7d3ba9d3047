"""Figures at random: people, avatars, hands, packaged robots, and small ones that are made up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.judging import Pairs

SCALES = (0.005, 0.02, 0.1, 1.0, 1.0, 1.0, 10.0, 60.0)
"""Sizes of robots that are made up, metres: links from a millimetre to some thirty metres."""
DETAILS = ("spheres", "capsules", "hulls")
SHAPES = ("box", "sphere", "cylinder", "capsule")
JOINTS = ("revolute", "revolute", "revolute", "prismatic", "continuous")
ONE = 0.3  # share of robots of one joint
BRANCH = 0.2  # share of links that do not follow the last one
BARE = 0.1  # share of links without a shape
MOST = 8  # joints
HEAVIEST = 1e5  # kg: heavier links are taken for a slip of units
TRIES = 30  # postures that are tried for one in which nothing overlaps


@dataclass(frozen=True)
class Body:
    """A figure, and the words that load it.

    Attributes:
        figure: loaded.
        call: Python that loads it.
        size: metres by which things about it are measured.
        people: whether it is a person or an avatar, who stands.
        files: what the call reads, by names beside the script.
    """

    figure: wb.Figure
    call: str
    size: float
    people: bool = False
    files: Mapping[str, bytes] = field(default_factory=dict)

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
        for _ in range(TRIES):
            found = self.near(q, share, rng)
            if alone.distances(found).min(initial=np.inf) > room:
                return found
        return None


def body(rng: np.random.Generator) -> Body:
    """Return a figure."""
    kind = rng.choice(["human", "avatar", "hand", "packaged", "robot"], p=[0.27, 0.1, 0.17, 0.11, 0.35])
    if kind == "robot":
        return robot(rng)
    if kind == "hand":
        side = ("left", "right")[int(rng.integers(2))]
        return _called(f"wb.load('hand', side={side!r})", 0.15)
    if kind == "packaged":
        name = ("human", "avatar", "hand", "arm")[int(rng.integers(4))]
        if name == "arm":
            return _called("wb.load(task_paths()['shelf'].with_name('arm.urdf'))", 0.9)
        root = ("free", "fixed")[int(rng.integers(2))]
        return _called(f"wb.load(urdf_path({name!r}), root={root!r})", 0.15 if name == "hand" else 1.7)
    detail = DETAILS[int(rng.integers(len(DETAILS)))]
    sex, stature = ("male", "female")[int(rng.integers(2))], float(np.round(rng.uniform(1.5, 1.95), 3))
    stature = 1.75 if detail == "hulls" else stature  # hulls of a size are made once
    return _called(f"wb.load({str(kind)!r}, sex={sex!r}, stature={stature!r}, detail={detail!r})", 1.7, people=True)


def robot(rng: np.random.Generator, scale: float | None = None) -> Body:
    """Return a small robot that is made up."""
    size = SCALES[int(rng.integers(len(SCALES)))] if scale is None else scale
    text = _urdf(rng, size).encode()
    root = "free" if rng.random() < 0.15 else "fixed"
    return _called(f"wb.load(HERE / 'robot.urdf', root={root!r})", size, files={"robot.urdf": text})


def _called(call: str, size: float, people: bool = False, files: Mapping[str, bytes] | None = None) -> Body:
    from wholebody.base.files import Scratch
    from wholebody.figures.packaged_urdf import task_paths, urdf_path

    with Scratch() as folder:
        for name, text in (files or {}).items():
            (folder / name).write_bytes(text)
        known = {"wb": wb, "HERE": folder, "task_paths": task_paths, "urdf_path": urdf_path}
        figure = eval(call, known)
    return Body(figure, call, size, people, files or {})


def _urdf(rng: np.random.Generator, scale: float) -> str:
    """Return a robot whose links are about 0.3 times the scale long, metres."""
    count = 1 if rng.random() < ONE else int(rng.integers(2, MOST + 1))
    parts = [_link("link0", rng, scale, 0.0)]
    lengths = [0.0]
    for number in range(1, count + 1):
        parent = int(rng.integers(0, number)) if rng.random() < BRANCH else number - 1
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
    kind = JOINTS[int(rng.integers(len(JOINTS)))]
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
    mass = float(min(scale**3 * 100.0 + 1e-6, HEAVIEST))
    inertia = float(mass * scale**2 / 100.0 + 1e-12)
    inertial = (
        f'<inertial><origin xyz="0 0 {length / 2!r}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    if rng.random() < BARE:
        return f'  <link name="{name}">{inertial}</link>'
    width = float(scale * rng.uniform(0.02, 0.06))
    long = max(length, 2.0 * width)
    kind = SHAPES[int(rng.integers(len(SHAPES)))]
    shape = {
        "box": f'<box size="{width!r} {1.5 * width!r} {0.9 * long!r}"/>',
        "sphere": f'<sphere radius="{width!r}"/>',
        "cylinder": f'<cylinder radius="{width!r}" length="{0.9 * long!r}"/>',
        "capsule": f'<capsule radius="{0.7 * width!r}" length="{0.7 * long!r}"/>',
    }[kind]
    return (
        f'  <link name="{name}">{inertial}<collision><origin xyz="0 0 {length / 2!r}"/>'
        f"<geometry>{shape}</geometry></collision></link>"
    )


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)

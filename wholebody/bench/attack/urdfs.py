"""Small robots at random, as URDF: one joint or several, turning or sliding, branching or not, of any scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHAPES = ("box", "sphere", "cylinder", "capsule")
JOINTS = ("revolute", "revolute", "revolute", "prismatic", "continuous")
ONE = 0.3  # share of robots of one joint
BRANCH = 0.2  # share of links that do not follow the last one
BARE = 0.1  # share of links without a shape
MOST = 8  # joints

HEAVIEST = 1e5  # kg: heavier links are taken for a slip of units


def robot(rng: np.random.Generator, scale: float) -> str:
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
    limit = "" if kind == "continuous" else f'<limit lower="{low!r}" upper="{high!r}" effort="10" velocity="3"/>'
    if kind == "continuous":
        limit = '<limit effort="10" velocity="3"/>'
    return (
        f'  <joint name="joint{number}" type="{kind}"><parent link="link{parent}"/><child link="link{number}"/>'
        f'<origin xyz="0 0 {length!r}" rpy="{_numbers(turn)}"/><axis xyz="{_numbers(axis)}"/>{limit}</joint>'
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


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)

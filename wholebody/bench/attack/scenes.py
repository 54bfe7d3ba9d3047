"""Figures and things at random: people, robots that are made up, and every shape, clear of a figure or inside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.judging import CORPUS, Pairs, chosen
from wholebody.bench.suite.problem_sets.things import Occupied, turned
from wholebody.bench.tables import render
from wholebody.figures.packaged_urdf import task_paths, urdf_path
from wholebody.figures.urdf.joints import exact


@dataclass(frozen=True)
class Body:
    """A figure, metres by which things about it are measured, and whether it is a person or an avatar, who stands."""

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
        """Return a posture (nq,) within the limits, off from q by a share of what joints (places `free`) can do."""
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
    links, joints, lengths = [_link("link0", rng, scale, 0.0)], list[dict[str, str]](), [0.0]
    for number in range(1, count + 1):
        parent = int(rng.integers(0, number)) if rng.random() < 0.2 else number - 1
        lengths.append(float(scale * rng.uniform(0.1, 0.5)))
        joints.append(_joint(number, parent, lengths[parent], rng, scale))
        links.append(_link(f"link{number}", rng, scale, lengths[number]))
    links.append({"name": "tip"})
    tip = {"name": "fixed_tip", "kind": "fixed", "parent": f"link{count}", "child": "tip", "at": f"0 0 {lengths[-1]!r}"}
    return render("robot.urdf", name="attacked", links=links, joints=[*joints, tip])


def _joint(number: int, parent: int, length: float, rng: np.random.Generator, scale: float) -> dict[str, str]:
    kind = chosen(rng, ("revolute", "revolute", "revolute", "prismatic", "continuous"))
    axis = np.eye(3)[int(rng.integers(3))] if rng.random() < 0.7 else rng.normal(size=3)
    axis = axis / np.linalg.norm(axis)
    turn = rng.uniform(-1.0, 1.0, 3) if rng.random() < 0.3 else np.zeros(3)
    reach = scale * 0.5 if kind == "prismatic" else 2.9
    low, high = -reach * float(rng.uniform(0.1, 1.0)), reach * float(rng.uniform(0.1, 1.0))
    if rng.random() < 0.1:
        low = high * 0.5  # zero is out of the limits
    ends = "" if kind == "continuous" else f'lower="{low!r}" upper="{high!r}" '
    joint = {"name": f"joint{number}", "kind": kind, "parent": f"link{parent}", "child": f"link{number}"}
    joint |= {"at": f"0 0 {length!r}", "rpy": exact(turn), "axis": exact(axis)}
    return joint | {"limit": f'{ends}effort="10" velocity="3"'}


def _link(name: str, rng: np.random.Generator, scale: float, length: float) -> dict[str, str]:
    mass = float(min(scale**3 * 100.0 + 1e-6, 1e5))
    link = {"name": name, "middle": f"0 0 {length / 2!r}", "mass": repr(mass)}
    link["spin"] = repr(float(mass * scale**2 / 100.0 + 1e-12))
    if rng.random() < 0.1:
        return link
    width = float(scale * rng.uniform(0.02, 0.06))
    long = max(length, 2.0 * width)
    shapes = (
        f'<box size="{width!r} {1.5 * width!r} {0.9 * long!r}"/>',
        f'<sphere radius="{width!r}"/>',
        f'<cylinder radius="{width!r}" length="{0.9 * long!r}"/>',
        f'<capsule radius="{0.7 * width!r}" length="{0.7 * long!r}"/>',
    )
    return link | {"shape": chosen(rng, shapes)}


@dataclass(frozen=True)
class Thing:
    """A shape, and where it stands (7,)."""

    shape: wb.Shape
    at: tuple[float, ...]

    @property
    def placement(self) -> pin.SE3:
        """Where it stands."""
        return pin.SE3(pin.Quaternion(np.array(self.at[3:])).matrix(), np.array(self.at[:3]))


def shape(rng: np.random.Generator, size: float) -> wb.Shape:
    """A shape of about a size, metres."""
    shares = {"box": 0.25, "sphere": 0.15, "capsule": 0.15, "ellipsoid": 0.1, "hull": 0.12, "plate": 0.12}
    shares |= {"halfspace": 0.1, "mesh": 0.01}
    kind = str(rng.choice(list(shares), p=list(shares.values())))
    scale = size * float(np.exp(rng.uniform(np.log(0.02), np.log(0.6))))

    def length(low: float, high: float) -> float:
        return float(np.clip(scale * rng.uniform(low, high), 2e-4, 300.0))

    if kind == "box":
        return wb.Box((length(0.2, 1.0), length(0.2, 1.0), length(0.2, 1.0)))
    if kind == "plate":
        return wb.Box((length(0.5, 3.0), length(0.5, 3.0), max(2e-4, 1e-3 * size)))
    if kind == "sphere":
        return wb.Sphere(length(0.2, 0.7))
    if kind == "capsule":
        return wb.Capsule(length(0.1, 0.4), length(0.3, 1.5))
    if kind == "ellipsoid":
        return wb.Ellipsoid((length(0.2, 0.8), length(0.2, 0.8), length(0.2, 0.8)))
    if kind == "halfspace":
        normal = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[int(rng.integers(3))]
        return wb.HalfSpace((float(normal[0]), float(normal[1]), float(normal[2])))
    if kind == "hull":
        return wb.Hull(rng.normal(size=(int(rng.integers(8, 40)), 3)) * [length(0.2, 0.5) for _ in range(3)])
    return wb.Mesh(CORPUS / "corner.obj", scale=length(0.4, 1.0))  # an angle of two walls: it is not convex


def somewhere(rng: np.random.Generator, placed: Occupied, size: float) -> pin.SE3:
    """A place about a figure."""
    middle, spread = _extent(placed)
    reach = 1.3 * spread + 0.5 * size
    return pin.SE3(pin.Quaternion(turned(rng)).matrix(), middle + rng.uniform(-reach, reach, 3))


def _extent(placed: Occupied) -> tuple[Array, float]:
    """Middle (3,) of a figure's pieces in its postures, and how far the farthest is from there, metres."""
    middle = placed.centres.mean(axis=0) if len(placed.centres) else np.zeros(3)
    return middle, float(np.linalg.norm(placed.centres - middle, axis=1).max(initial=0.0))


def clear(rng: np.random.Generator, placed: Occupied, size: float, room: float, postures: list[int]) -> Thing | None:
    """Return a thing that leaves some room, metres, around a figure in some of its postures; None if none was found."""
    for _ in range(20):
        made = shape(rng, size)
        at = somewhere(rng, placed, size)
        if all(placed.distance(made, at, posture) > room for posture in postures):
            return Thing(made, xyzquat(at))
    return None


def inside(rng: np.random.Generator, placed: Occupied, size: float, depth: float) -> Thing | None:
    """Return a thing that is in the figure's first posture by a depth, metres; None where its shape does not let it."""
    made = shape(rng, size)
    if not placed.places:
        return None
    start = placed.places[int(rng.integers(placed.count))]
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    turn = pin.Quaternion(turned(rng)).matrix()
    near, far = 0.0, 4.0 * (_extent(placed)[1] + size)

    def at(way: float) -> pin.SE3:
        return pin.SE3(turn, start.translation + way * direction)

    if placed.distance(made, at(near), 0) > -depth or placed.distance(made, at(far), 0) < -depth:
        return None
    for _ in range(60):
        middle = 0.5 * (near + far)
        if placed.distance(made, at(middle), 0) < -depth:
            near = middle
        else:
            far = middle
    place = at(near)
    if np.abs(place.translation).max() > 60.0:
        return None
    return Thing(made, xyzquat(place))


def xyzquat(at: pin.SE3) -> tuple[float, ...]:
    """Return a placement as seven numbers."""
    return tuple(float(x) for x in pin.SE3ToXYZQUAT(at))

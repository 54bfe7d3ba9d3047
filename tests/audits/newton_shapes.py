"""Assemblies of any size to measure sparse Newton on."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from wholebody.methods.newton.assembly import Assembly

LINK = 0.2  # m
ALONG_Y = (0.0, 1.0, 0.0)
DISPLACEMENT = (0.03, -0.03, 0.02)  # m: of the end of a chain, as far as takes three systems at the paper's size


def chain(count: int, bend: float = 0.1) -> Assembly:
    """A bent chain of revolute joints about y and z in turn, the first one spherical on the world."""
    import pinocchio as pin

    made, place = Assembly(), pin.SE3.Identity()
    for k in range(count):
        made.body(f"b{k}", place, size=0.5 * LINK)
        base, axis = (f"b{k - 1}", place.rotation @ np.eye(3)[1 + k % 2]) if k else ("world", None)
        if axis is None:
            made.spherical(base, f"b{k}", at=place.translation)
        else:
            made.revolute(base, f"b{k}", at=place.translation, axis=axis)
        turn = pin.utils.rotate("y" if k % 2 else "z", bend)
        place = place * pin.SE3(np.eye(3), np.array((LINK, 0.0, 0.0))) * pin.SE3(turn, np.zeros(3))
    return made


def pulled_chain(count: int) -> Assembly:
    """A chain whose end is to move by `DISPLACEMENT`."""
    made, last, tip = chain(count), f"b{count - 1}", np.array((LINK, 0.0, 0.0))
    made.point_goal(last, made.placement(last).act(tip) + np.array(DISPLACEMENT), place=tip)
    return made


def tree(count: int) -> Assembly:
    """A binary tree of revolute joints."""
    made = Assembly()
    for k in range(count):
        parent = (k - 1) // 2
        depth = int(np.log2(k + 1))
        place = (LINK * depth, LINK * (k + 1 - 2**depth), 0.0)
        made.body(f"b{k}", place, size=0.5 * LINK)
        if k:
            made.revolute(f"b{parent}", f"b{k}", at=place, axis=np.eye(3)[1 + k % 2])
        else:
            made.spherical("world", "b0", at=place)
    return made


def ring(count: int) -> Assembly:
    """A closed ring of spherical joints."""
    made, radius = Assembly(), LINK * count / (2.0 * np.pi)
    angles = 2.0 * np.pi * np.arange(count) / count
    corners = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    for k in range(count):
        made.body(f"b{k}", corners[k], size=0.5 * LINK)
    for k in range(count):
        made.spherical(f"b{k - 1}" if k else f"b{count - 1}", f"b{k}", at=corners[k])
    return made


def star(count: int) -> Assembly:
    """A hub with arms on revolute joints."""
    made = Assembly().body("hub", size=LINK)
    for k in range(1, count):
        angle = 2.0 * np.pi * k / (count - 1)
        place = (LINK * np.cos(angle), LINK * np.sin(angle), 0.0)
        made.body(f"b{k}", place, size=0.5 * LINK)
        made.revolute("hub", f"b{k}", at=place, axis=(0, 0, 1))
    made.fixed("world", "hub")
    return made


def four_bar() -> Assembly:
    """A crank of 0.3, a coupler of 0.9 and a rocker of 0.7 on a ground of 1 m, closed."""
    made = _crank_and_coupler().body("rocker", (1, 0, 0))
    made.revolute("coupler", "rocker", at_first=(0.9, 0, 0), at_second=(0, 0, 0.7), axis=ALONG_Y, axis_second=ALONG_Y)
    made.revolute("world", "rocker", at=(1, 0, 0), axis=ALONG_Y)
    made.solve(tolerance=1e-10)
    return made


def three_bar() -> Assembly:
    """The same without the joint that closes it."""
    made = _crank_and_coupler().body("rocker", (0.9, 0, 0.3))
    made.revolute("coupler", "rocker", at=(0.9, 0, 0.3), axis=ALONG_Y)
    return made


def _crank_and_coupler() -> Assembly:
    made = Assembly().body("crank", (0, 0, 0)).body("coupler", (0, 0, 0.3))
    made.revolute("world", "crank", at=(0, 0, 0), axis=ALONG_Y)
    made.revolute("crank", "coupler", at=(0, 0, 0.3), axis=ALONG_Y)
    return made


SHAPES: dict[str, Callable[[int], Assembly]] = {"chain": chain, "tree": tree, "ring": ring, "star": star}


def median_us(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call [us]; one before is not counted."""
    call()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return 1e6 * float(np.median(times))

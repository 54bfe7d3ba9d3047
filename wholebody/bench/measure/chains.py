"""Chains of any number of joints among any number of things: one size grows and the rest stays."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch
from wholebody.bench.suite.problem_sets.things import Occupied

LENGTH = 2.0  # m: of the whole chain, however many joints it has
HALF = 0.025  # m: half the breadth of its segments
BEND = 6.0  # rad: of all joints together, each way
REACH = 2.4  # m: things stand within this of the base, as densely however many there are
DENSITY = 10.0 / REACH**3  # things per cubic metre within reach, to begin with; more go farther out
ROOM = 0.01  # m: left free around the start and the witness
TIP = "tip"
TRIES = 400  # witnesses, and places of one thing


def chain(joints: int, pieces: int, segments: int | None = None) -> wb.Figure:
    """A chain that lies along x, its joints about z and y in turn.

    Args:
        joints: how many.
        pieces: boxes of each segment that has any.
        segments: how many of the links have pieces, evenly spread; all where None.

    Raises:
        InputError: no joints, or more segments than links.
    """
    if joints < 1 or not 1 <= (segments or joints) <= joints:
        raise InputError(f"a chain of {joints} joints cannot have {segments} segments; give 1 to {joints}")
    solid = {round(k) for k in np.linspace(0, joints - 1, segments or joints)}
    ends = [*sorted(solid), joints]
    long = {first: (last - first) * LENGTH / joints for first, last in pairwise(ends)}
    parts = ['<link name="base"/>']
    for k in range(joints):
        at = f'<origin xyz="{LENGTH / joints if k else 0.0:.9f} 0 0"/>'
        axis = "0 0 1" if k % 2 == 0 else "0 1 0"
        limit = min(BEND / joints, 2.5)
        parts.append(
            f'<joint name="joint{k}" type="revolute"><parent link="{f"link{k - 1}" if k else "base"}"/>'
            f'<child link="link{k}"/>{at}<axis xyz="{axis}"/>'
            f'<limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
        )
        parts.append(f'<link name="link{k}">{_boxes(long[k], pieces) if k in solid else ""}</link>')
    parts.append(
        f'<link name="{TIP}"/><joint name="end" type="fixed"><parent link="link{joints - 1}"/><child link="{TIP}"/>'
        f'<origin xyz="{LENGTH / joints:.9f} 0 0"/></joint>'
    )
    with Scratch() as folder:
        path = folder / "chain.urdf"
        path.write_text(f'<robot name="chain">{"".join(parts)}</robot>', encoding="utf-8")
        return wb.load(path)


def _boxes(length: float, count: int) -> str:
    """A row of boxes that ends short of both joints."""
    free = max(length - 4.0 * HALF, 0.1 * length)
    each = free / count
    start = 0.5 * (length - free)
    return "".join(
        f'<collision><origin xyz="{start + (k + 0.5) * each:.9f} 0 0"/>'
        f'<geometry><box size="{each:.9f} {2.0 * HALF} {2.0 * HALF}"/></geometry></collision>'
        for k in range(count)
    )


def task(figure: wb.Figure, things: int, seed: int) -> tuple[wb.Scene, Array]:
    """A scene in which the chain reaches among things, not built yet, and where its tip is asked to go.

    Raises:
        InputError: no free posture was found.
    """
    rng = np.random.default_rng([seed, figure.model.nq, things])
    witness = _free_posture(figure, rng)
    occupied = Occupied(figure, (figure.neutral, witness))
    scene = wb.Scene(figure)
    spread = max(REACH, (things / DENSITY) ** (1.0 / 3.0))
    for number in range(things):
        size = tuple(rng.uniform(0.03, 0.12, 3))
        shape = wb.Box((float(size[0]), float(size[1]), float(size[2])))
        for _ in range(TRIES):
            x, y, z = (float(value) for value in rng.uniform(-spread, spread, 3))
            if occupied.clear_of(shape, (x, y, z), ROOM):
                scene.add(shape, name=f"thing {number}", at=(x, y, z))
                break
    return scene, figure.placement(witness, TIP).translation


def _free_posture(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """A smoothly bent posture, so that a long chain goes somewhere, in which it does not touch itself."""
    alone, model = wb.Scene(figure), figure.model
    place = np.linspace(0.0, np.pi, model.nq)
    most = model.upperPositionLimit
    for _ in range(TRIES):
        waves = rng.uniform(-1.0, 1.0, (2, 3)) @ np.array([np.cos(k * place) for k in (0, 1, 2)])
        q = most * np.where(np.arange(model.nq) % 2 == 0, waves[0], waves[1]).clip(-1.0, 1.0) * 0.6
        if alone.contacts(q, within=ROOM).distance.min(initial=1.0) >= ROOM:
            return np.asarray(q)
    raise InputError(f"none of {TRIES} postures of the chain is free; give another seed")

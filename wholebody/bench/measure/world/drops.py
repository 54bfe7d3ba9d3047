"""Things that are dropped, slid and stacked: each case is the same in every engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array

DENSITY = 700.0  # kg/m3
GRAVITY = 9.81  # m/s2
RESTITUTION, FRICTION = 0.3, 0.3  # wood on wood, table 1 of Schmidl and Lin


@dataclass(frozen=True)
class Drop:
    """Boxes and balls above a floor at z = 0.

    Attributes:
        name: of the case.
        sizes: full lengths (3,) of a box, or the radius (1,) of a ball.
        places: (n, 3) of the centres at the start, metres.
        velocity: (3,) of all at the start, m/s.
        frame: seconds.
        seconds: how long it lasts.
    """

    name: str
    sizes: tuple[tuple[float, ...], ...]
    places: Array
    velocity: tuple[float, float, float]
    frame: float
    seconds: float

    @property
    def masses(self) -> Array:
        """(n,) kg."""
        volumes = [size[0] ** 3 * 4.0 / 3.0 * np.pi if len(size) == 1 else np.prod(size) for size in self.sizes]
        return DENSITY * np.array(volumes)

    @property
    def inertias(self) -> Array:
        """(n, 3) about the centres, kg m2."""
        found = np.zeros((len(self.sizes), 3))
        for k, (size, mass) in enumerate(zip(self.sizes, self.masses, strict=True)):
            square = np.array(size) ** 2
            found[k] = 0.4 * mass * square[0] if len(size) == 1 else mass / 12.0 * (square.sum() - square)
        return found

    def shapes(self) -> list[wb.Shape]:
        """The shape of each thing."""
        return [wb.Sphere(size[0]) if len(size) == 1 else wb.Box((size[0], size[1], size[2])) for size in self.sizes]


def drops() -> tuple[Drop, ...]:
    """All cases."""
    return (ball(), slide(), stack(10), grid("27 balls", 3), grid("216 balls", 6), pile(20, 1 / 60), pile(100, 1 / 30))


def ball() -> Drop:
    """A ball that falls from a metre and bounces."""
    return Drop("ball", ((0.05,),), np.array([[0.0, 0.0, 1.0]]), (0.0, 0.0, 0.0), 1 / 60, 3.0)


def slide() -> Drop:
    """A box that slides until friction has stopped it."""
    return Drop("slide", ((0.2, 0.2, 0.1),), np.array([[0.0, 0.0, 0.0501]]), (2.0, 0.0, 0.0), 1 / 60, 1.5)


def stack(count: int) -> Drop:
    """Boxes upon each other."""
    places = np.array([[0.0, 0.0, 0.1 + 0.2001 * k + 1e-4] for k in range(count)])
    return Drop(f"stack of {count}", ((0.2, 0.2, 0.2),) * count, places, (0.0, 0.0, 0.0), 1 / 60, 4.0)


def grid(name: str, side: int) -> Drop:
    """A cube of balls that falls apart (SimBenchmark's "666" for six on a side)."""
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = 0.12 * cells + (0.0, 0.0, 0.2) + 0.002 * cells[:, 2:] * (0.5, 1.0, 0.0)
    return Drop(name, ((0.05,),) * len(cells), places, (0.0, 0.0, 0.0), 1 / 60, 2.0)


def pile(count: int, frame: float) -> Drop:
    """Boxes that fall into a heap."""
    rng = np.random.default_rng(0)
    cells = np.array([(k % 4, k // 4 % 4, k // 16) for k in range(count)])
    places = 0.3 * cells + (0.0, 0.0, 0.2)
    places[:, :2] += 0.05 * rng.random((count, 2))
    return Drop(f"heap of {count} boxes", ((0.2, 0.15, 0.1),) * count, places, (0.0, 0.0, 0.0), frame, 3.0)

"""Figures and problems to make smaller."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure


def _cluttered(figure: Figure, seed: int, count: int, within: float) -> wb.Scene:
    """A figure among small boxes and balls, none of which it touches where it stands."""
    rng = np.random.default_rng(seed)
    scene = wb.Scene(figure)
    while len(scene.objects) < count:
        at = rng.uniform(-within, within, 3)
        at[2] = abs(at[2])
        shape = wb.Box(tuple(rng.uniform(0.03, 0.12, 3))) if rng.random() < 0.5 else wb.Sphere(rng.uniform(0.02, 0.06))
        name = f"thing {len(scene.objects)}"
        scene.add(shape, name=name, at=at)
        if any(
            name in (scene.piece_owner[a], scene.piece_owner[b]) for a, b in scene.contacts(figure.neutral, 0.02).pair
        ):
            scene.remove(name)
    return scene


@pytest.fixture(scope="session")
def cluttered() -> Callable[..., wb.Scene]:
    return _cluttered


@pytest.fixture(scope="session")
def arm(root: Path) -> Figure:
    return wb.load(root / "tests" / "data" / "arm" / "arm.urdf")

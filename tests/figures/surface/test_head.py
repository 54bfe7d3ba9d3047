"""The face: eyes as open as those of people, in lids that begin without an edge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wholebody.figures.anthropometry import Dimensions, make_person
from wholebody.figures.surface.head_shape import head_shape

STEP = 1e-3


def slopes(field: Any, points: Any) -> Any:
    """Unit gradients (n, 3) of a field by central differences."""
    found = [(field(points + move) - field(points - move)) for move in 2e-4 * np.eye(3)]
    return np.transpose(found) / np.linalg.norm(found, axis=0)[:, None]


@pytest.mark.parametrize("sex", ["female", "male"])
def test_eyes_are_as_open_as_peoples_and_lids_have_no_edge(sex: str) -> None:
    size = Dimensions(make_person(sex))
    shape = head_shape(size)
    middle = np.array([size.eye_x, 0.032, size.eye_z])
    # rays from the front, of which the first solid is seen
    y, z = np.meshgrid(np.arange(-0.021, 0.0211, STEP), np.arange(-0.021, 0.0211, STEP), indexing="ij")
    x = middle[0] + np.arange(0.012, -0.02, -STEP)
    rays = np.empty((*y.shape, len(x), 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = x, (middle[1] + y)[..., None], (middle[2] + z)[..., None]
    first = {}
    for name in ("skin", "front", "eyes"):
        inside = getattr(shape, name)(rays.reshape(-1, 3)).reshape(rays.shape[:3]) < 0.0
        first[name] = np.where(inside.any(axis=2), inside.argmax(axis=2), len(x))
    seen = first["eyes"] < np.minimum(first["skin"], first["front"])
    # Farkas 1994 (recalled): eyes are 28 to 34 mm long, with the corners beside the eyeball, and 8.5 to 13 mm high
    wide, high = (STEP * float(np.ptp(np.nonzero(seen)[axis]) + 1) for axis in (0, 1))
    assert 0.022 < wide < 0.034
    assert 0.0065 < high < 0.013
    # where lids and skin meet, they are one surface: lids of their own stand on it at 65 degrees
    border = (np.abs(first["skin"] - first["front"]) <= 1) & (first["skin"] < len(x)) & ~seen
    points = rays[border, first["skin"][border]]
    assert len(points) > 50
    cosine = (slopes(shape.skin, points) * slopes(shape.front, points)).sum(axis=1)
    assert np.degrees(np.arccos(np.median(cosine))) < 20.0

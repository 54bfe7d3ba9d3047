"""Height fields of MJCF files as convex prisms below the triangles that MuJoCo tests, joined where they are flat."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError
from wholebody.figures.mjcf.compiled import Compiled

FLAT = 1e-9  # m: a cell whose four corners are nearer than this to one plane is one prism


def height_field(compiled: Compiled, geom: int) -> list[Array]:
    """Corners (n, 3) of the convex prisms of a geom's height field, in the geom's frame.

    A cell has two triangles, whose common edge goes from its first corner to the opposite one. Cells side by side whose
    tops are in one plane are one prism.
    """
    model, field = compiled.model, int(compiled.model.geom_dataid[geom])
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, below = (float(value) for value in model.hfield_size[field])
    first = int(model.hfield_adr[field])
    heights = top * np.array(model.hfield_data[first : first + rows * columns], dtype=float).reshape(rows, columns)
    if not np.isfinite(heights).all():
        row, column = np.argwhere(~np.isfinite(heights))[0]
        raise FileFormatError(
            f"{compiled.path}: a height field has {heights[row, column]} in row {row}, column {column}; give finite "
            "heights"
        )
    x, y = np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows)
    grid = np.stack([*np.meshgrid(x, y), heights], axis=2)
    bend = heights[:-1, :-1] - heights[:-1, 1:] - heights[1:, :-1] + heights[1:, 1:]
    found = []
    for row in range(rows - 1):
        slopes = np.stack([np.diff(heights[row]), heights[row + 1, :-1] - heights[row, :-1]], axis=1)
        planes = [tuple(np.round(slope, 12)) for slope in slopes]
        for column in np.flatnonzero(np.abs(bend[row]) >= FLAT):
            planes[column] = ("bent", int(column))
        for plane, cells in groupby(range(columns - 1), planes.__getitem__):
            run = list(cells)
            (a, b), (c, d) = grid[row : row + 2, [run[0], run[-1] + 1]]
            tops = [(a, d, c), (a, b, d)] if plane[0] == "bent" else [(a, b, c, d)]
            found += [_prism(np.array(top), below) for top in tops]
    return found


def _prism(top: Array, below: float) -> Array:
    bottom = np.array(top)
    bottom[:, 2] = -below
    return np.concatenate([top, bottom])

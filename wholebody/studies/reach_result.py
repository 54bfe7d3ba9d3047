"""A reach map: what is known of each place of a grid, its volume, and its files."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.charts import Shown, png
from wholebody.base.files import checked_target, write
from wholebody.problem import Problem

NOT_TRIED, REACHED, MISSED, EXCLUDED, BEYOND, INSIDE = range(6)
VERDICTS = ("not tried", "reached", "missed", "excluded", "beyond", "inside")  # Words of the codes of a verdict


@dataclass(frozen=True, eq=False, repr=False)
class ReachMap(Shown):
    """Which places of a grid a point of a frame reaches.

    Attributes:
        problem: what was asked at every place.
        frame: the frame that reaches.
        x, y, z: (nx,), (ny,), (nz,) the places along each axis, metres.
        verdict: (nx, ny, nz) codes, whose words `VERDICTS` has: reached with a posture; missed by searches; excluded,
            because another place is missed by more than its distance; beyond the lengths of the limbs; inside of a
            thing; not tried.
        left: (nx, ny, nz) distance to the nearest posture that was found, metres: 0 where reached, a lower bound where
            not searched.
        measure: (nx, ny, nz) weighted sum of the measures where reached, 0 elsewhere.
        q: (nx, ny, nz, nq) the posture of a reached place, the nearest of a missed one, the start elsewhere.
        solves: how many solves it took.
        from_neighbours: how many reached places were missed at first, and then reached from a neighbour's.

    Raises:
        InputError: of its files: another ending, or it cannot be written.

    Examples:
        >>> found = wb.reach_map(problem, "right_index_tip", (0.4, -0.3, 1.0), (0.4, -0.3, 1.0), 0.1)
        >>> bool(found.left.max() == 0.0)
        True
    """

    problem: Problem = field(repr=False)
    frame: str
    x: Array
    y: Array
    z: Array
    verdict: np.ndarray[tuple[int, ...], np.dtype[np.int8]]
    left: Array
    measure: Array
    q: Array
    solves: int
    from_neighbours: int = 0

    @property
    def inside(self) -> Mask:
        """(nx, ny, nz) which places lie inside of a thing."""
        return np.asarray(self.verdict == INSIDE)

    @property
    def reached(self) -> Mask:
        """(nx, ny, nz) whether a place is reached."""
        return np.asarray(self.verdict == REACHED)

    @property
    def share(self) -> float:
        """Share of the places that are reached."""
        return float(self.reached.mean())

    @property
    def volume(self) -> float:
        """Part of the grid's volume that is reached, m^3; of a plane the area, m^2; of a line the length, m.

        By the trapezoidal rule: a place at an end of an axis stands for half a step.
        """
        steps = [np.gradient(axis) if len(axis) > 1 else np.ones(1) for axis in (self.x, self.y, self.z)]
        for step in steps:
            step[[0, -1]] *= 0.5 if len(step) > 1 else 1.0
        return float(np.einsum("ijk,i,j,k", self.reached, *steps))

    def counts(self) -> dict[str, int]:
        """How many places have each verdict."""
        found = {word: int((self.verdict == code).sum()) for code, word in enumerate(VERDICTS)}
        return {word: count for word, count in found.items() if count}

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {word}" for word, count in self.counts().items())
        span = ", ".join(
            f"{name} {axis[0]:.2f} to {axis[-1]:.2f} m"
            for name, axis in zip("xyz", (self.x, self.y, self.z), strict=True)
        )
        again = f", {self.from_neighbours} reached only from a neighbour" if self.from_neighbours else ""
        head = f"ReachMap of {self.frame!r}: {self.verdict.size} places, {self.solves} solves"
        return f"{head}\n  {counts}{again}\n  {span}\n  {self.share:.1%} of the places, {self.extent}"

    @property
    def extent(self) -> str:
        """`volume` with its unit."""
        axes = sum(size > 1 for size in self.verdict.shape)
        return f"{self.volume:.3g} {('', 'm', 'm^2', 'm^3')[axes]}" if axes else "one place"

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write all arrays into an npz file; returns the path."""
        file = checked_target(path, "save: path", "a reach map", (".npz",))
        stream = io.BytesIO()
        np.savez_compressed(
            stream, frame=self.frame, x=self.x, y=self.y, z=self.z, verdict=self.verdict, verdicts=np.array(VERDICTS),
            left=self.left, measure=self.measure, q=self.q,
        )  # fmt: skip
        return write(file, stream.getvalue())

    def to_vtk(self, path: str | os.PathLike[str]) -> Path:
        """Write verdict, left and measure as a legacy VTK file of structured points; returns the path."""
        file = checked_target(path, "to_vtk: path", "a grid", (".vtk",))
        shape, origin = self.verdict.shape, (self.x[0], self.y[0], self.z[0])
        spacing = [float(axis[1] - axis[0]) if len(axis) > 1 else 1.0 for axis in (self.x, self.y, self.z)]
        lines = [
            "# vtk DataFile Version 3.0",
            f"reach of {self.frame}: " + ", ".join(f"{code} {word}" for code, word in enumerate(VERDICTS)),
            "ASCII",
            "DATASET STRUCTURED_POINTS",
            "DIMENSIONS " + " ".join(map(str, shape)),
            "ORIGIN " + " ".join(f"{value:.9g}" for value in origin),
            "SPACING " + " ".join(f"{value:.9g}" for value in spacing),
            f"POINT_DATA {self.verdict.size}",
        ]
        for name, values in (("verdict", self.verdict), ("left", self.left), ("measure", self.measure)):
            kind = "int" if name == "verdict" else "float"
            lines += [f"SCALARS {name} {kind} 1", "LOOKUP_TABLE default"]
            lines += [f"{value:.9g}" for value in values.flatten(order="F").tolist()]
        return write(file, "\n".join(lines) + "\n")

    def plot(self) -> Any:
        """Draw heat maps of all heights, a matplotlib figure."""
        from wholebody.studies.pictures import slices_chart

        return slices_chart(self)

    def picture(self, path: str | os.PathLike[str]) -> Path:
        """Write `plot` into a PNG file; returns the path."""
        return write(checked_target(path, "picture: path", "a picture", (".png",)), png(self.plot()))

    def html(self, path: str | os.PathLike[str]) -> Path:
        """Write a page with a slider over the heights, for any browser, without a network; returns the path."""
        from wholebody.studies.pictures import write_page

        return write_page(self, checked_target(path, "html: path", "a page", (".htm", ".html")))

"""A reach map: what is known of each place of a grid, its volume, and its files."""

from __future__ import annotations

import base64
import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.charts import Shown, new_chart, plain, png
from wholebody.base.files import checked_target, templates, write
from wholebody.problem import Problem

INCHES = 2.4  # width of one height
MEANING = "above 0: reached, 1 with the least measure\nbelow 0: metres short; gray: inside, or against other goals"

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
            thing, or in contradiction to the other goals; not tried.
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
        """(nx, ny, nz) which places lie inside of a thing, or contradict the other goals."""
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
        """Draw heat maps of all heights seen from above, beside each other, a matplotlib figure."""
        # heights in one picture; of more, some are left out evenly
        shown = np.unique(np.linspace(0, len(self.z) - 1, min(len(self.z), 24)).round().astype(int)).tolist()
        rows = -(-len(shown) // 6)  # columns
        columns = -(-len(shown) // rows)
        deep, wide = (float(np.ptp(places)) + 0.1 for places in (self.x, self.y))
        high = INCHES * min(max(deep / wide, 0.4), 2.5) + 0.75  # inches of one height for its title and its axis
        chart, axes = new_chart(rows, columns, (INCHES * columns + 1.6, max(high * rows + 0.5, 3.0)))
        values = self._heat()
        image: Any = None
        for axis in axes.flat[len(shown) :]:
            axis.set_axis_off()
        for axis, k in zip(axes.flat, shown, strict=False):
            image = self._slice(axis, values, k)
        bar = chart.colorbar(image, ax=list(axes.flat), shrink=0.8)
        bar.set_label(MEANING, fontsize="x-small")
        bar.ax.tick_params(labelsize="x-small")
        reached = f"{self.share:.0%} of {self.verdict.size} places reached, seen from above"
        chart.suptitle(f"{plain(self.frame)}\n{reached}", fontsize="medium")
        return chart

    def picture(self, path: str | os.PathLike[str]) -> Path:
        """Write `plot` into a PNG file; returns the path."""
        return write(checked_target(path, "picture: path", "a picture", (".png",)), png(self.plot()))

    def html(self, path: str | os.PathLike[str]) -> Path:
        """Write a page with a slider over the heights, for any browser, without a network; returns the path."""
        file = checked_target(path, "html: path", "a page", (".htm", ".html"))
        values, images = self._heat(), []
        for k, height in enumerate(self.z.tolist()):
            chart, axes = new_chart(1, 1, (6.4, 5.2))
            image = self._slice(axes[0, 0], values, k)
            chart.colorbar(image, ax=axes[0, 0]).set_label(MEANING, fontsize="small")
            images.append((height, base64.b64encode(png(chart)).decode()))
        facts = {**self.counts(), "solves": self.solves, "reached": self.extent}
        first = int(np.argmax(self.reached.sum(axis=(0, 1))))
        page = templates(Path(__file__).parent).get_template("reach.html.jinja")
        return write(file, page.render(title=f"Reach of {self.frame}", facts=facts, first=first, images=images))

    def _heat(self) -> Array:
        """(nx, ny, nz) minus the remaining distance, metres; where reached, 1 for the least measure to 0."""
        values: Array = -np.asarray(self.left, dtype=float)
        reached = self.reached
        if reached.any():
            measures = self.measure[reached]
            span = float(np.ptp(measures))
            values[reached] = (measures.max() - measures) / span if span > 0.0 else 1.0
        return values

    def _slice(self, axis: Any, values: Array, k: int) -> Any:
        """Draw one height: reached places green, the others by their residual, places inside of things gray."""
        from matplotlib.colors import LinearSegmentedColormap

        colors = LinearSegmentedColormap.from_list(
            "reach", [(0.0, "#7f0000"), (0.25, "#d7301f"), (0.4999, "#fdd0a2"), (0.5, "#c7e9c0"), (1.0, "#00441b")]
        )
        half = [0.5 * float(places[1] - places[0]) if len(places) > 1 else 0.05 for places in (self.x, self.y)]
        extent = (self.y[0] - half[1], self.y[-1] + half[1], self.x[0] - half[0], self.x[-1] + half[0])
        image = axis.imshow(
            values[:, :, k], origin="lower", extent=extent, cmap=colors, vmin=-1.0, vmax=1.0, interpolation="nearest"
        )
        gray = np.zeros((*values.shape[:2], 4))
        gray[self.inside[:, :, k]] = (0.35, 0.35, 0.38, 1.0)
        axis.imshow(gray, origin="lower", extent=extent, interpolation="nearest")
        axis.invert_xaxis()
        axis.set_title(f"z = {self.z[k]:.2f} m", fontsize="small")
        axis.set_xlabel("y, left [m]", fontsize="x-small")
        axis.set_ylabel("x, forward [m]", fontsize="x-small")
        axis.tick_params(labelsize="x-small")
        axis.locator_params(nbins=5)
        return image

"""One look for all charts: a tool has the same colour everywhere, and the same data give the same file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

COLORS = {
    "wholebody/osqp": "#0072b2",
    "wholebody/daqp": "#56b4e9",
    "placo": "#d55e00",
    "mink": "#009e73",
    "pink": "#cc79a7",
    "qp/osqp": "#0072b2",
    "qp/daqp": "#56b4e9",
    "qp/quadprog": "#332288",
    "qp/proxqp": "#44aaaa",
    "qp/piqp": "#8888dd",
    "newton/slack": "#e69f00",
    "newton/barrier": "#996515",
    "newton/kkt": "#f0d03c",
    "ccd": "#000000",
    "dls": "#888888",
}
"""Okabe and Ito's colours, which people with any colour vision tell apart; a family's others are shades of its own."""

MARKERS = {
    "qp/osqp": "o",
    "qp/daqp": "s",
    "qp/quadprog": "D",
    "qp/proxqp": "p",
    "qp/piqp": "h",
    "newton/slack": "^",
    "newton/barrier": "v",
    "newton/kkt": "<",
    "ccd": "X",
    "dls": "x",
    "placo": "P",
    "pink": "*",
    "mink": ">",
}
"""Markers of the methods, so that charts are read without colours too."""

OTHER_COLOR, OTHER_MARKER = "#bbbbbb", "."


def color(name: str) -> str:
    """The colour of a tool or method; grey for a QP solver that only this machine has."""
    return COLORS.get(name, OTHER_COLOR)


def marker(name: str) -> str:
    """The marker of a method; a dot for one that has none."""
    return MARKERS.get(name, OTHER_MARKER)


_SETTINGS = {
    "svg.hashsalt": "wholebody",  # names inside the file do not depend on chance
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "figure.facecolor": "white",
}
PNG_DPI = 150


def figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    """Return an empty figure, inches, and its axes (rows, columns)."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    matplotlib.rcParams.update(_SETTINGS)
    chart, axes = pyplot.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    return chart, axes


def save(chart: Any, path: Path) -> tuple[Path, Path]:
    """Write a chart as SVG and PNG beside each other; return both paths (the suffix of `path` is replaced)."""
    from matplotlib import pyplot

    path.parent.mkdir(parents=True, exist_ok=True)
    svg, png = path.with_suffix(".svg"), path.with_suffix(".png")
    chart.savefig(svg, metadata={"Date": None})
    chart.savefig(png, dpi=PNG_DPI, metadata={"Software": None})
    pyplot.close(chart)
    return svg, png

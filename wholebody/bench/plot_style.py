"""One look for all charts: a tool has the same colour everywhere, and the same data give the same file."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

COLORS = {
    "wholebody": "#0072b2",
    "wholebody/active_set": "#004166",
    "wholebody/osqp": "#4b6a9b",
    "wholebody/daqp": "#56b4e9",
    "wholebody/quadprog": "#7f9fc4",
    "wholebody/proxqp": "#9fb8d0",
    "wholebody/piqp": "#b3c6e0",
    "placo": "#d55e00",
    "placo/pruned": "#e8a06a",
    "mink": "#009e73",
    "pink": "#cc79a7",
}
"""Of the tools that make a step: Okabe and Ito's colours, which people with any colour vision tell apart; our own with
other settings are further blues."""


class Look(NamedTuple):
    """Colour and marker of a method; the principal ones are drawn wide and with their spread."""

    color: str
    marker: str
    principal: bool


_LOOKS = {
    "qp": Look(COLORS["wholebody"], "o", True),
    "qp/active_set": Look(COLORS["wholebody/active_set"], ".", False),
    "qp/osqp": Look(COLORS["wholebody/osqp"], "o", True),
    "qp/daqp": Look(COLORS["wholebody/daqp"], ".", False),
    "qp/quadprog": Look(COLORS["wholebody/quadprog"], ".", False),
    "qp/proxqp": Look(COLORS["wholebody/proxqp"], ".", False),
    "qp/piqp": Look(COLORS["wholebody/piqp"], ".", False),
    "newton/slack": Look("#e69f00", "s", True),
    "newton/barrier": Look("#a06a00", "D", True),
    "newton/kkt": Look("#f3cf7a", "s", False),
    "ccd": Look("#000000", "v", True),
    "dls": Look("#8c8c8c", "X", True),
    "placo": Look(COLORS["placo"], "P", True),
    "mink": Look(COLORS["mink"], "h", True),
    "pink": Look(COLORS["pink"], "*", True),
}
_SOLVERS = ("#35507a", "#5f86b3", "#8aa0c0")
"""Shades for the QP method with further solvers: one family, seen at a glance."""
_OTHERS = ("#882255", "#117733", "#999933", "#661100", "#aa4499", "#44aa99")


def look(adapter: str) -> Look:
    """Return how a method looks; one that is not known here has a look of its own by its name."""
    if adapter in _LOOKS:
        return _LOOKS[adapter]
    number = sha256(adapter.encode()).digest()[0]
    if adapter.startswith("qp/"):
        return Look(_SOLVERS[number % len(_SOLVERS)], ".", False)
    return Look(_OTHERS[number % len(_OTHERS)], "p", True)


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


def plain_log(axis: Any) -> None:
    """Make the x axis logarithmic, with 1, 2, 5, 10, ... written out."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_locator(NullLocator())

"""One style for all charts: a tool has the same colour everywhere, and the same data give the same file."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.base.charts import new_chart
from wholebody.base.files import packaged_toml
from wholebody.bench.statistics import Interval

MOST = 6  # methods in a chart


class Style(NamedTuple):
    """Colour and marker of a method."""

    color: str
    marker: str


STYLE = packaged_toml(Path(__file__).with_name("plot_style.toml"))
"""Matplotlib's settings, the colours and markers of methods, and further colours."""


def method_style(name: str) -> Style:
    """Return the style of a method, or of a tool, whose qp is called wholebody; others have one by their name."""
    method = "newton/slack" if name == "newton" else name.replace("wholebody", "qp")
    number = sha256(method.encode()).digest()[0]
    shades = STYLE["others"]["qp" if method.startswith("qp/") else "all"]
    return Style(*STYLE["methods"].get(method, (shades[number % len(shades)], "p")))


def figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    """Return an empty figure, inches, and its axes (rows, columns)."""
    from matplotlib import rc_context

    with rc_context(STYLE["settings"]):
        return new_chart(rows, columns, size)


def save(chart: Any, path: Path) -> tuple[Path, Path]:
    """Write a chart as SVG and PNG beside each other; return both paths. It is laid out once for both."""
    from matplotlib import rc_context

    path.parent.mkdir(parents=True, exist_ok=True)
    svg, png = path.with_suffix(".svg"), path.with_suffix(".png")
    with rc_context(STYLE["settings"]):
        chart.get_layout_engine().execute(chart)
        chart.set_layout_engine("none")
        chart.savefig(svg, metadata={"Date": None})
        chart.savefig(png, metadata={"Software": None})
    return svg, png


def band(panel: Any, y: float, found: Interval, style: Style) -> Any:
    """A figure as a marker on its interval, a band at a height; returns the marker, for a legend."""
    panel.plot([found.low, found.high], [y, y], color=style.color, linewidth=5.0, alpha=0.3, solid_capstyle="butt")
    (line,) = panel.plot([found.value], [y], color=style.color, marker=style.marker, linestyle="")
    return line


def legend_below(chart: Any, drawn: Mapping[str, Any]) -> None:
    """Put a legend of lines by name below a chart."""
    if drawn:
        names, lines = list(drawn), list(drawn.values())
        chart.legend(lines, names, loc="outside lower center", ncols=min(len(names), 6), frameon=False, fontsize=9)


def shares_and_times(
    rows: Mapping[str, Mapping[str, tuple[Interval, Interval]]], styles: Mapping[str, Style], note: str, heading: str,
    path: Path,
) -> tuple[Path, Path]:  # fmt: skip
    """A row a set: what each method solves [%] and its mean time [ms], with intervals; `note`: how failures count."""
    chart, axes = figure(1, 2, (11.0, 0.9 + 0.85 * len(rows)))
    left, right = axes[0]
    drawn: dict[str, Any] = {}
    for place, shown in enumerate(rows.values()):
        for number, (name, style) in enumerate(styles.items()):
            y = place + 0.75 * ((number + 0.5) / len(styles) - 0.5)
            for panel, found in zip((left, right), shown.get(name, ()), strict=False):
                if isfinite(found.value):
                    drawn[name] = band(panel, y, found, style)
    for panel, titles in ((left, list(rows)), (right, [""] * len(rows))):
        for place in range(1, len(rows), 2):
            panel.axhspan(place - 0.5, place + 0.5, color="#f3f5f7", zorder=0)
        panel.set_yticks(range(len(rows)), titles)
        panel.set_ylim(len(rows) - 0.5, -0.5)
        panel.grid(axis="y", visible=False)
    left.set(xlabel="solved [%]", xlim=(-2.0, 102.0))
    plain_log(right)
    right.set(xlabel=f"mean time of a solve or frame, {note} [ms]")
    chart.suptitle(heading, x=0.01, ha="left", fontsize=13)
    legend_below(chart, {name: drawn[name] for name in styles if name in drawn})
    return save(chart, path)


def plain_log(axis: Any) -> None:
    """Make the x axis logarithmic, with 1, 2, 5, 10, ... written out; over many decades 1, 10, 100, ... alone."""
    from matplotlib.ticker import LogLocator, NullLocator

    class Plain(LogLocator):
        def tick_values(self, vmin: float, vmax: float) -> Any:
            if not vmin > 0.0:
                return ()  # an axis without data
            wide = vmax > 10.0**2.6 * vmin  # beyond, the labels of 2 and 5 would overlap their neighbours
            self.set_params(subs=(1.0,) if wide else (1.0, 2.0, 5.0))
            return super().tick_values(vmin, vmax)

    axis.set_xscale("log")
    axis.xaxis.set_major_locator(Plain())
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_locator(NullLocator())

"""Charts without pyplot, which keeps state of its own, and objects that notebooks show with their chart."""

from __future__ import annotations

import html
import io
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from wholebody.base.errors import InputError


def new_chart(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    """Return an empty matplotlib figure, inches, and its axes (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    chart = Figure(figsize=size, dpi=120, layout="constrained")
    FigureCanvasAgg(chart)
    return chart, chart.subplots(rows, columns, squeeze=False)


def plain(text: str) -> str:
    """A text as a chart shows it, whose dollar signs begin no formula."""
    return text.replace("$", r"\$")


def png(chart: Any) -> bytes:
    """A chart as the bytes of a PNG file, the same for the same chart."""
    stream = io.BytesIO()
    chart.canvas.print_png(stream, metadata={"Software": None})  # `savefig` would draw twice, for the layout
    return stream.getvalue()


def svg(chart: Any) -> str:
    """A chart as an SVG element."""
    stream = io.StringIO()
    chart.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]


def listing(heading: str, rows: Mapping[str, Iterable[str]]) -> str:
    """A heading, and a table of named lists of words, HTML."""
    lines = (
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(', '.join(each))}</td></tr>" for name, each in rows.items()
    )
    return f"<table><caption>{html.escape(heading)}</caption>{''.join(lines)}</table>"


class Shown:
    """What a notebook shows as its `repr` and its chart, which `plot` draws, a matplotlib figure."""

    plot: Callable[[], Any]

    def _repr_html_(self) -> str:
        try:
            chart = svg(self.plot())
        except InputError:  # there is too much for a chart
            chart = ""
        return f"<pre style='white-space: pre-wrap'>{html.escape(repr(self))}</pre>{chart}"

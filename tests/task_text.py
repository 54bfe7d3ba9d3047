"""Parts of task files as text."""

from __future__ import annotations


def table(head: str, /, **values: object) -> str:
    """A table of a task file, with an empty line before and after it; texts in quotes, all else as Python writes it."""
    lines = (f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}" for key, value in values.items())
    return "\n".join(["", head, *lines, ""])


def figure(name: str, **values: object) -> str:
    """The figure's table."""
    return table("[figure]", name=name, **values)


def box(name: str, size: list[float], at: list[float]) -> str:
    """A box that stands in the scene."""
    return table("[[object]]", name=name, shape="box", size=size, at=at)


def point(frame: str, target: list[float]) -> str:
    """A goal: a frame at a place."""
    return table("[[goal]]", type="point", frame=frame, target=target)


def hold(frame: str) -> str:
    """A constraint: a frame as at the start."""
    return table("[[constraint]]", type="hold", frame=frame)

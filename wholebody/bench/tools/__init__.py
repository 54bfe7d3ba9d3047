"""The tools that make the same reach: ours with two QP solvers, placo, pink and mink, by their documented classes."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from wholebody.bench.tools.base import Tool
from wholebody.bench.track import Track
from wholebody.errors import MissingPackageError, UnknownNameError

NEEDS = {
    "wholebody/osqp": ("osqp",),
    "wholebody/daqp": ("daqp",),
    "placo": ("placo",),
    "pink": ("pink", "daqp"),
    "mink": ("mink", "mujoco", "daqp"),
}
"""Name of every tool -> the modules it needs."""


def installed_tools() -> tuple[str, ...]:
    """Names of the tools whose packages are installed."""
    return tuple(name for name, modules in NEEDS.items() if all(find_spec(module) for module in modules))


def chosen_tools(names: Iterable[str] | None) -> tuple[str, ...]:
    """Check names of tools; all installed ones where None.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    if names is None:
        return installed_tools()
    chosen = tuple(names)
    for name in chosen:
        if name not in NEEDS:
            raise UnknownNameError("tool", name, NEEDS)
        if name not in installed_tools():
            extra = "placo" if name == "placo" else "compare"
            raise MissingPackageError(f"{name} is not installed; install it with: pip install 'wholebody[{extra}]'")
    return chosen


def make_tool(name: str, track: Track) -> Tool:
    """Set a tool up for a reach.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    kind = tool_class(name)
    tool: Tool = kind(track, name.partition("/")[2]) if "/" in name else kind(track)
    return tool


def tool_class(name: str) -> Any:
    """The class of a tool; the others' packages are not imported for it.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    (name,) = chosen_tools([name])
    family = name.partition("/")[0]
    return getattr(import_module(f"wholebody.bench.tools.{family}_tool"), f"{family.capitalize()}Tool")


def differences(name: str) -> tuple[str, ...]:
    """What a tool cannot express of the task, or does otherwise; one sentence each.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    stated: tuple[str, ...] = tool_class(name).differences
    return stated

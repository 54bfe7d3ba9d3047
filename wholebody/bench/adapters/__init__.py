"""The methods and tools that are set beside each other: one file a tool, which solves and follows a reach by steps."""

from wholebody.bench.adapters.base import Adapter, Budget, Tool
from wholebody.bench.adapters.registry import (
    ALL,
    STEPPING,
    adapters,
    chosen_tools,
    differences,
    installed,
    installed_tools,
    make_tool,
    missing,
    names,
)

__all__ = [
    "ALL",
    "STEPPING",
    "Adapter",
    "Budget",
    "Tool",
    "adapters",
    "chosen_tools",
    "differences",
    "installed",
    "installed_tools",
    "make_tool",
    "missing",
    "names",
]

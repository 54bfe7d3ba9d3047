"""A tool that follows a reach, step by step."""

from __future__ import annotations

import numpy as np

from wholebody.bench.measure.track import Track, Verdict, judge
from wholebody.bench.suite.adapters.base import Tool
from wholebody.bench.suite.adapters.registry import make_tool


def followed(name: str, reach: Track) -> tuple[Tool, Verdict]:
    """Let a tool begin where the reach does and follow it to its end; the tool, and the verdict on its postures."""
    tool = make_tool(name, reach)
    assert np.allclose(tool.posture(), reach.start, atol=1e-12)
    postures = []
    for target in reach.targets:
        tool.step(target)
        postures.append(tool.posture())
    assert tool.failures == 0
    return tool, judge(reach, np.array(postures))

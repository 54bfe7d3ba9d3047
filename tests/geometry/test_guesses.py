"""What coal remembers in a process does not depend on what the process did before."""

from __future__ import annotations

import subprocess
import sys

ASKED = """
import coal
import numpy as np
{first}
box, ground, place = coal.Box(0.2, 0.1, 0.0728), coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), coal.Transform3s()
place.setTranslation(np.array([0.0, 0.0, 0.0364]))
print(coal.distance(box, place, ground, coal.Transform3s(), coal.DistanceRequest(), coal.DistanceResult()))
"""


def rested(first: str) -> float:
    """Distance of a box that rests on the ground, asked first of all in a process of its own."""
    done = subprocess.run([sys.executable, "-c", ASKED.format(first=first)], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_boxes_are_as_large_as_they_say() -> None:
    assert rested("import wholebody.geometry") == 0.0


def test_coal_alone_would_inflate_them() -> None:
    """Where this fails, coal has been mended, and `settle_boxes` can go."""
    assert rested("") < -1e-12

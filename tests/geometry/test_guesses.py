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
place.setTranslation(np.array([0.7, 0.0, 0.0]))
cube, here = coal.Box(1.0, 1.0, 1.0), coal.Transform3s()
print(coal.distance(cube, here, box, place, coal.DistanceRequest(), coal.DistanceResult()))
"""


def asked(first: str) -> tuple[float, float]:
    """Distances of a box on the ground, and of two boxes 10 cm apart, asked first of all in a process of its own."""
    done = subprocess.run([sys.executable, "-c", ASKED.format(first=first)], capture_output=True, text=True, check=True)
    ground, boxes = map(float, done.stdout.split())
    return ground, boxes


def test_boxes_are_as_large_as_they_say() -> None:
    ground, boxes = asked("import wholebody.geometry")
    assert ground == 0.0
    assert abs(boxes - 0.1) < 1e-15


def test_coal_alone_would_inflate_them() -> None:
    """Where this fails, coal has been mended, and `fix_box_inflation` can go."""
    ground, boxes = asked("")
    assert ground < -1e-12
    assert boxes < 0.1 - 1e-11

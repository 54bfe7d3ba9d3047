"""A driver: back at the backrest, both hands at the wheel, soles on sloped pedals, eyes on the road."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import DARK, LEATHER, command_line, picture, report

import wholebody as wb


def turned(degrees: float) -> tuple[float, float, float, float]:
    """A turn about y as a quaternion x, y, z, w."""
    return 0.0, float(np.sin(np.radians(degrees) / 2)), 0.0, float(np.cos(np.radians(degrees) / 2))


def build() -> wb.Problem:
    """State the problem."""
    car = wb.Scene(wb.load("human", sex="female", percentile=50))
    car.add(wb.Box((0.50, 0.52, 0.08)), name="seat", at=(-0.30, 0.0, 0.26), color=LEATHER)
    car.add(wb.Box((0.08, 0.52, 0.60)), name="backrest", at=(-0.60, 0.0, 0.60, *turned(-12.0)), color=LEATHER)
    car.add(wb.Box((0.35, 0.60, 0.02)), name="pedals", at=(0.45, 0.0, 0.13, *turned(-25.0)), color=DARK)
    car.add(wb.Torus(0.18, 0.015), name="wheel", at=(0.05, 0.0, 0.75, *turned(-65.0)), color=DARK)
    return wb.Problem(
        car,
        "sitting",
        goals=[
            wb.Sit(on="seat", back="backrest"),
            wb.Grasp("left", "wheel", kind="power"),
            wb.Grasp("right", "wheel", kind="power"),
            wb.Axis("gaze", (1, 0, 0), direction=(1, 0, -0.1), weight=0.1),
        ],
        constraints=[wb.Stand(on="pedals", balance=False)],  # the seat carries her
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("A driver", problem, solution)
    if pictures:
        picture("driver", problem, solution, out, eye=(1.6, -2.2, 1.5), target=(-0.1, 0.0, 0.55))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)

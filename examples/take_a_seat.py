"""Sit down on a chair with the back at its backrest and the soles on the floor: three contacts, one line each."""

from __future__ import annotations

from pathlib import Path

from presenting import OAK, command_line, picture, report

import wholebody as wb

HIGH = 0.38  # m: of the seat


def build(figure: wb.Figure | None = None, high: float = HIGH) -> wb.Problem:
    """State the problem, of a woman if nobody is given; tasks/take_a_seat.toml states the same.

    With the back at the backrest and flat soles, a seat is no higher than the hollow of the knee: short legs get a
    lower chair.
    """
    figure = figure or wb.load("human", sex="female", stature=1.65)
    if (person := figure.describe().person) is not None:
        high = min(high, dict(person.dimensions)["popliteal_height"] + person.shoes)
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.44, 0.48, 0.04)), name="seat", at=(-0.35, 0.0, high - 0.02), color=OAK)
    scene.add(wb.Box((0.03, 0.48, 0.36)), name="backrest", at=(-0.56, 0.0, high + 0.42), color=OAK)
    return wb.Problem(
        scene,
        goals=[wb.Sit(on="seat", back="backrest")],
        constraints=[wb.Stand(on="floor", balance=False)],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Take a seat", problem, solution)
    if pictures:
        picture("take_a_seat", problem, solution, out, eye=(1.6, -2.6, 1.2), target=(-0.2, 0.0, 0.6))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)

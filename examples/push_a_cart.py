"""Push a heavy cart: a woman leans into its handle, so that the ground presses under her feet and no joint is too weak.

The cart resists with 260 N. The same posture is searched with the balance of somebody who pushes nothing, to compare.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import CARDBOARD, DARK, STEEL, command_line, picture, report

import wholebody as wb

PUSH = 260.0  # N: of both hands, forward
HANDLE = (0.62, 0.0, 1.00)  # m: its middle
STEP = (0.15, -0.18)  # m: of the left and of the right foot, forward
STRENGTH = wb.motion.Strength(25, sex="female")
FORCES = [wb.Force(f"{side}_palm", (-0.5 * PUSH, 0.0, 0.0)) for side in ("left", "right")]  # the cart pushes back


def build(pushing: bool = True) -> wb.Problem:
    """State the problem: with the cart's resistance, or as if it rolled by itself."""
    woman = wb.load("human", sex="female", percentile=50)
    scene = wb.Scene(woman).add(wb.HalfSpace(), name="floor")
    x, _, height = HANDLE
    lying = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # the handle's axis is y
    scene.add(wb.Cylinder(0.016, 0.70), name="handle", at=(*HANDLE, *lying), color=DARK)
    for side, y in (("left", 0.33), ("right", -0.33)):
        scene.add(
            wb.Box((0.03, 0.03, height - 0.16)), name=f"{side} post", at=(x + 0.05, y, 0.5 * height + 0.08), color=STEEL
        )
    scene.add(wb.Box((0.95, 0.70, 0.05)), name="platform", at=(x + 0.52, 0.0, 0.20), color=STEEL)
    scene.add(wb.Box((0.70, 0.60, 0.62)), name="load", at=(x + 0.58, 0.0, 0.54), color=CARDBOARD)
    for k, (along, y) in enumerate(((0.18, 0.28), (0.18, -0.28), (0.86, 0.28), (0.86, -0.28))):
        scene.add(wb.Cylinder(0.085, 0.04), name=f"wheel {k}", at=(x + along, y, 0.087, *lying), color=DARK)
    start = in_step(woman)
    carried = [
        wb.ergonomics.LoadedBalance(FORCES),
        wb.ergonomics.StrengthLimit(FORCES, strength=STRENGTH, compression=3400.0),
    ]
    return wb.Problem(
        scene,
        start,
        goals=[wb.Grasp("left", "handle", kind="power"), wb.Grasp("right", "handle", kind="power")],
        constraints=[
            wb.Hold("left_foot"),
            wb.Hold("right_foot"),
            *(carried if pushing else [wb.Balance()]),
        ],
    )


def in_step(woman: wb.Figure) -> np.ndarray:
    """(nq,) standing with the left foot a step before the right one."""
    standing, goals = woman.posture("standing"), []
    for side, forward in zip(("left", "right"), STEP, strict=True):
        sole = woman.placement(standing, f"{side}_sole").copy()
        sole.translation += (forward, 0.0, 0.0)
        goals.append(wb.Frame(f"{side}_sole", sole))
    return wb.solve(wb.Problem(wb.Scene(woman), standing, goals=goals)).q


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Solution, wb.Solution]:
    """Solve with and without the resistance, report and draw."""
    answers = []
    for title, pushing in (("Push the cart", True), ("Hold its handle", False)):
        problem = build(pushing)
        solution = wb.solve(problem)
        answers.append(solution)
        report(title, problem, solution)
        compression = wb.ergonomics.back_compression(problem.scene.figure, solution.q, FORCES)
        print(f"  the disc L5/S1 bears {compression:.0f} N while the hands push with {PUSH:.0f} N")
        if pictures and pushing:
            picture("push_a_cart", problem, solution, out, eye=(1.9, -3.4, 1.7), target=(0.5, 0.0, 0.75))
    return answers[0], answers[1]


if __name__ == "__main__":
    command_line(main, __doc__)

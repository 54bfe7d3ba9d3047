"""Take a box between both palms and lift it from a table: once to take it, once to lift it."""

from __future__ import annotations

from pathlib import Path

from presenting import CARDBOARD, OAK, command_line, picture, report

import wholebody as wb

BOX = wb.Box((0.30, 0.32, 0.24))
ON_TABLE = (0.45, 0.0, 0.86)  # m: its middle
LIFTED = (0.42, 0.0, 1.15)  # m


def build(figure: wb.Figure | None = None) -> wb.Problem:
    """State the first problem, of a man if nobody is given: both palms on the sides of the box."""
    scene = wb.Scene(figure or wb.load("human", sex="male", stature=1.78))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.60, 1.2, 0.04)), name="table", at=(0.62, 0.0, 0.72), color=OAK)
    scene.add(BOX, name="box", at=ON_TABLE, color=CARDBOARD)
    return wb.Problem(
        scene,
        goals=[
            *(wb.Grasp(side, "box", kind="palm") for side in ("left", "right")),
            # In the middle of the sides: palms that may be at its edges lift it otherwise from person to person.
            *(wb.Point(f"{side}_palm", (0.45, y, 0.86)) for side, y in (("left", 0.16), ("right", -0.16))),
            # Hands turn with the box: fingers that hang as it is taken have wrists at their end as it is lifted.
            *(wb.Axis(f"{side}_palm", (1, 0, 0), direction=(1, 0, 0), weight=0.1) for side in ("left", "right")),
        ],
        constraints=[wb.Stand(on="floor")],
    )


def lift(taken: wb.Solution, problem: wb.Problem) -> tuple[wb.Problem, wb.Solution]:
    """The box goes with the left palm, the right palm keeps to it, and the box is to be higher."""
    scene, figure = problem.scene, problem.scene.figure
    in_hand = figure.placement(taken.q, "left_palm").inverse() * scene.objects["box"].placement
    scene.remove("box").attach(BOX, to="left_palm", name="box", at=in_hand, rests_on=["right_hand"], color=CARDBOARD)
    higher = wb.Problem(
        scene,
        taken.q,
        goals=[
            wb.Point("left_palm", LIFTED, offset=in_hand.translation),
            wb.Axis("left_palm", in_hand.rotation[:, 2], direction=(0, 0, 1)),
        ],
        constraints=[wb.Hold("right_palm", relative_to="left_palm"), wb.Stand(on="floor")],
    )
    return higher, wb.solve(higher)


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Solution, wb.Solution]:
    """Take, lift, report and draw."""
    problem = build()
    taken = wb.solve(problem)
    report("Take the box", problem, taken)
    if pictures:
        picture("take_a_box", problem, taken, out, eye=(2.6, -3.1, 1.8), target=(0.3, 0.0, 0.95))
    higher, lifted = lift(taken, problem)
    report("Lift it", higher, lifted)
    if pictures:
        picture("lift_a_box", higher, lifted, out, eye=(2.6, -3.1, 1.8), target=(0.3, 0.0, 0.95))
    return taken, lifted


if __name__ == "__main__":
    command_line(main, __doc__)

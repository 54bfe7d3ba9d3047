"""Assemble a shelf: loose parts are dragged to their places past each other, and attached point to surface there."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import OAK, STEEL, command_line, play

import wholebody as wb
from wholebody.base.arrays import Array

DEPTH, WIDTH, HEIGHT, THICK = 0.30, 0.80, 1.00, 0.02  # m: of the shelf, outside, and of its boards
BOARD = (DEPTH, WIDTH - 2.0 * THICK, THICK)
SIDE = (DEPTH, THICK, HEIGHT)
LEVELS = {"lowest board": 0.08, "low board": 0.36, "high board": 0.64, "top board": 0.90}  # m: undersides
X, Y, Z = np.eye(3)

LOOSE = {
    "left side": (0.0, 0.5 * (WIDTH - THICK), 0.5 * HEIGHT),  # this part is in place already
    "right side": (0.25, -0.95, 0.48, *pin.Quaternion(pin.rpy.rpyToMatrix(0.5, 0.25, 0.5)).coeffs()),
    "lowest board": (0.75, 0.35, 0.06, *pin.Quaternion(pin.rpy.rpyToMatrix(0.12, 0.0, 0.5)).coeffs()),
    "low board": (0.95, -0.25, 0.12, *pin.Quaternion(pin.rpy.rpyToMatrix(-0.1, 0.15, -0.6)).coeffs()),
    "high board": (0.70, -0.50, 0.35, *pin.Quaternion(pin.rpy.rpyToMatrix(0.6, 0.3, 0.3)).coeffs()),
    "top board": (0.55, 0.85, 0.40, *pin.Quaternion(pin.rpy.rpyToMatrix(-0.7, 0.2, -0.4)).coeffs()),
}
"""Placements of the loose parts, metres and quaternions."""


WAYS = {
    **dict.fromkeys(LEVELS, ((0.5, -0.02, 0.0), (0.0, -0.02, 0.0))),
    "right side": ((0.0, -0.30, 0.0),),
}
"""Where each part passes before it is in place, from there, metres: boards come from the front."""

FRAMES = 25  # of a drag from one such place to the next


def in_place(name: str) -> pin.SE3:
    """Where a part belongs."""
    if name in LEVELS:
        return pin.SE3(np.eye(3), np.array((0.0, 0.0, LEVELS[name] + 0.5 * THICK)))
    side = 0.5 if name == "left side" else -0.5
    return pin.SE3(np.eye(3), np.array((0.0, side * (WIDTH - THICK), 0.5 * HEIGHT)))


def build() -> wb.Assembly:
    """All parts on a floor, loose except the left side."""
    assembly = wb.Assembly()
    for name, place in LOOSE.items():
        board = name in LEVELS
        assembly.body(name, place, shape=wb.Box(BOARD if board else SIDE), color=OAK if board else STEEL)
    assembly.add(wb.HalfSpace(), name="floor")
    return assembly.fixed("world", "left side")


def attach_board(assembly: wb.Assembly, name: str) -> None:
    """One end of a board on the left side, its underside on the pegs there, its back flush with the side's."""
    x, y, z = 0.5 * np.array(BOARD)
    inside, back, pegs = -0.5 * THICK, -0.5 * DEPTH, LEVELS[name] - 0.5 * HEIGHT  # in the side's frame
    for corner in ((x, y, z), (-x, y, z), (x, y, -z)):
        assembly.on_plane(name, corner, normal=Y, through=inside * Y, of="left side")
    for corner in ((x, y, -z), (-x, y, -z)):
        assembly.on_plane(name, corner, normal=Z, through=pegs * Z, of="left side")
    assembly.on_plane(name, (-x, y, -z), normal=X, through=back * X, of="left side")


def attach_right_side(assembly: wb.Assembly) -> None:
    """Its inside on the ends of two boards, its foot on the floor, its back flush with a board's."""
    x, y, z = 0.5 * np.array(SIDE)
    for corner in ((x, y, -z), (-x, y, -z), (x, y, z)):
        assembly.on_plane("right side", corner, normal=Y, through=-0.5 * BOARD[1] * Y, of="lowest board")
    for corner in ((x, -y, -z), (-x, -y, -z)):
        assembly.on_plane("right side", corner, normal=Z, through=np.zeros(3))
    assembly.on_plane("right side", (-x, y, -z), normal=X, through=-0.5 * DEPTH * X, of="lowest board")


def drag(assembly: wb.Assembly, name: str) -> list[Array]:
    """Drag a part to its place; the states of all parts, frame by frame."""
    states, there = [assembly.q], in_place(name)
    dragged = wb.tracking.Drag(assembly.drop_goals().frame_goal(name, there))
    for offset in (*WAYS[name], (0.0, 0.0, 0.0)):
        begin, end = assembly.placement(name), pin.SE3(there.rotation, there.translation + np.array(offset))
        for share in np.linspace(0.0, 1.0, FRAMES + 1)[1:]:
            turn = begin.rotation @ pin.exp3(share * pin.log3(begin.rotation.T @ end.rotation))
            along = begin.translation + share * (end.translation - begin.translation)
            states.append(dragged.to(pin.SE3(turn, along)).q)
    assembly.drop_goals()
    return states


def assemble(assembly: wb.Assembly) -> tuple[list[dict[str, pin.SE3]], list[Array]]:
    """Drag and attach part by part.

    Returns:
        The placements of all parts before the first and after each, and the states of the whole motion.

    Raises:
        WholebodyError: a part cannot be attached.
    """
    stages = [{name: assembly.placement(name) for name in assembly.bodies}]
    motion = [assembly.q]
    for name in (*LEVELS, "right side"):
        motion += drag(assembly, name)[1:]
        if name in LEVELS:
            attach_board(assembly, name)
        else:
            attach_right_side(assembly)
        solution = assembly.solve(tolerance=1e-6)
        motion.append(solution.q)
        others = [other for other in LOOSE if other != name]
        moved = max(
            float(np.linalg.norm(solution.placements[other].translation - stages[-1][other].translation))
            for other in others
        )
        print(
            f"  {name:12} {solution.status}, deepest overlap {solution.penetration:.1e} m, others moved {moved:.1e} m"
        )
        if solution.status != "solved":
            raise wb.WholebodyError(f"{name}: {solution.message}")
        stages.append(solution.placements)
        assembly.fixed("world", name)
    return stages, motion


def passes_through(scene: wb.Scene, motion: list[Array]) -> int:
    """Number of ways from one state to the next on which parts are deeper in each other than 0.5 mm, swept."""
    ways = [(a, b) for a, b in pairwise(motion) if not np.array_equal(a, b)]
    return sum(scene.sweep(a, b, tolerance=5e-4) is not None for a, b in ways)


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[list[dict[str, pin.SE3]], list[Array]]:
    """Assemble, report and draw."""
    print("A shelf of six parts:")
    stages, motion = assemble(build())
    passed = passes_through(build().scene, motion)
    print(f"  parts pass through each other or the floor in {passed} of {len(motion)} steps")
    if pictures:
        draw(motion, out)
    return stages, motion


def draw(motion: list[Array], out: Path) -> None:
    """Write assemble_shelf.html, which plays the motion, and assemble_shelf.png: three stages."""
    chosen = [motion[0], motion[5 * len(motion) // 12], motion[-1]]
    play(
        "assemble_shelf",
        build(),
        motion,
        chosen,
        out,
        eye=(3.4, -2.1, 1.8),
        target=(0.35, -0.13, 0.4),
        size=(560, 480),
        dt=1 / 30,
    )


if __name__ == "__main__":
    command_line(main, __doc__)

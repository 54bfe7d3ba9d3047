"""Assemble a shelf: loose parts are attached point to surface, one after the other, while others do not move."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import OAK, STEEL, command_line

import wholebody as wb
from wholebody.view.filmstrip import write_filmstrip
from wholebody.view.parts import Part, Parts

DEPTH, WIDTH, HEIGHT, THICK = 0.30, 0.80, 1.00, 0.02  # m: of the shelf, outside, and of its boards
BOARD = (DEPTH, WIDTH - 2.0 * THICK, THICK)
SIDE = (DEPTH, THICK, HEIGHT)
LEVELS = {"lowest board": 0.08, "low board": 0.36, "high board": 0.64, "top board": 0.90}  # m: undersides
X, Y, Z = np.eye(3)

LOOSE = {
    "left side": (0.0, 0.5 * (WIDTH - THICK), 0.5 * HEIGHT),  # this part is in place already
    "right side": (0.25, -0.95, 0.46, *pin.Quaternion(pin.rpy.rpyToMatrix(0.5, 0.25, 0.5)).coeffs()),
    "lowest board": (0.75, 0.35, 0.06, *pin.Quaternion(pin.rpy.rpyToMatrix(0.12, 0.0, 0.5)).coeffs()),
    "low board": (0.95, -0.25, 0.09, *pin.Quaternion(pin.rpy.rpyToMatrix(-0.1, 0.15, -0.6)).coeffs()),
    "high board": (0.70, -0.50, 0.35, *pin.Quaternion(pin.rpy.rpyToMatrix(0.6, 0.3, 0.3)).coeffs()),
    "top board": (0.55, 0.85, 0.40, *pin.Quaternion(pin.rpy.rpyToMatrix(-0.7, 0.2, -0.4)).coeffs()),
}
"""Placements of the loose parts, metres and quaternions."""


def build() -> wb.Assembly:
    """All parts, loose except the left side."""
    assembly = wb.Assembly()
    for name, place in LOOSE.items():
        assembly.body(name, place, size=0.5)
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


def assemble(assembly: wb.Assembly) -> list[dict[str, pin.SE3]]:
    """Attach part by part; returns the placements of all parts before the first and after each.

    Raises:
        WholebodyError: a part cannot be attached.
    """
    stages = [{name: assembly.placement(name) for name in assembly.bodies}]
    for name in (*LEVELS, "right side"):
        if name in LEVELS:
            attach_board(assembly, name)
        else:
            attach_right_side(assembly)
        solution = assembly.solve(tolerance=1e-9)
        others = [other for other in LOOSE if other != name]
        moved = max(
            float(np.linalg.norm(solution.placements[other].translation - stages[-1][other].translation))
            for other in others
        )
        print(f"  {name:12} {solution.status} in {solution.iterations:2} iterations, others moved {moved:.1e} m")
        if solution.status != "solved":
            raise wb.WholebodyError(f"{name}: {solution.message}")
        stages.append(solution.placements)
        assembly.fixed("world", name)
    return stages


def main(out: Path = Path("pictures"), pictures: bool = True) -> list[dict[str, pin.SE3]]:
    """Assemble, report and draw."""
    print("A shelf of six parts:")
    stages = assemble(build())
    if pictures:
        draw(stages, out)
    return stages


def draw(stages: list[dict[str, pin.SE3]], out: Path) -> None:
    """Write assemble_shelf.html, which plays the parts one after the other, and assemble_shelf.png: three stages."""
    out.mkdir(parents=True, exist_ok=True)
    parts = Parts(
        {
            name: [Part(wb.Box(BOARD if name in LEVELS else SIDE), color=OAK if name in LEVELS else STEEL)]
            for name in LOOSE
        }
    )
    postures = [parts.posture(stage) for stage in stages]
    motion = [
        pin.interpolate(parts.model, first, last, 0.5 - 0.5 * np.cos(np.pi * share))
        for first, last in pairwise(postures)
        for share in np.linspace(0.0, 1.0, 30)
    ]
    with wb.Viewer(parts, title="assemble_shelf") as viewer:
        viewer.look(eye=(3.4, -2.1, 1.8), target=(0.35, -0.13, 0.4))
        viewer.play(motion, dt=1 / 30)
        print(f"  {viewer.save(out / 'assemble_shelf.html')}")
        chosen = [postures[0], postures[2], postures[-1]]
        try:
            print(f"  {write_filmstrip(viewer, chosen, out / 'assemble_shelf.png', (560, 480))}")
        except wb.MissingPackageError as error:
            print(f"  no picture: {error}")


if __name__ == "__main__":
    command_line(main, __doc__)

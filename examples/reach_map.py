"""Where the right hand of somebody seated at a desk reaches: a map over the desk, with a monitor in the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from presenting import DARK, OAK, command_line, picture

import wholebody as wb


def build() -> wb.Problem:
    """State what holds at every place."""
    figure = wb.load("human", sex="female", stature=1.65)
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.70, 1.40, 0.03)), name="desk", at=(0.62, 0.0, 0.74), color=OAK)
    scene.add(wb.Box((0.03, 0.50, 0.32)), name="monitor", at=(0.72, 0.0, 0.98), color=DARK)
    scene.add(wb.Box((0.40, 0.42, 0.04)), name="seat", at=(0.02, 0.0, 0.374), color=DARK)  # she sits 0.394 m high
    return wb.Problem(
        scene,
        "sitting",
        constraints=[wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot")],
        clearance=0.005,
    )


def draw(found: wb.studies.ReachMap, out: Path) -> None:
    """Draw her at the farthest place that she reaches; balls are green where she reaches, red where she does not.

    Where the body is in this posture there are none.
    """

    def at(place: Any) -> tuple[float, float, float]:
        return float(found.x[place[0]]), float(found.y[place[1]]), float(found.z[place[2]])

    scene = build().scene
    farthest = max(map(at, np.argwhere(found.reached)))
    reaching = wb.solve(
        wb.Problem(scene, "sitting", goals=[wb.Point("right_index_tip", farthest)], constraints=[wb.Hold("pelvis")])
    )
    for place in np.argwhere(~found.inside):
        reached = found.reached[tuple(place)]
        ball, color = wb.Sphere(0.014 if reached else 0.008), "seagreen" if reached else "indianred"
        scene.add(ball, name=f"place {place}", at=at(place), color=color)
    near = scene.contacts(reaching.q, within=0.02).pair
    for name in {scene.piece_owner[piece] for pair in near for piece in pair}:
        if name.startswith("place"):
            scene.remove(name)
    shown = wb.Problem(scene, "sitting")  # with the balls
    picture("reach_map", shown, reaching, out, eye=(-1.0, -2.4, 2.1), target=(0.4, -0.1, 0.95))
    print(f"  {found.html(out / 'reach_map_heights.html')}")


def main(out: Path = Path("pictures"), pictures: bool = True, step: float = 0.15) -> wb.studies.ReachMap:
    """Search, report and draw."""
    found = wb.reach_map(build(), "right_index_tip", (0.15, -0.75, 0.80), (0.90, 0.45, 1.25), step)
    print(found)
    print(f"  {found.share:.0%} of the places are reached, {found.volume:.2f} m^3")
    if pictures:
        draw(found, out)
    return found


if __name__ == "__main__":
    command_line(main, __doc__)

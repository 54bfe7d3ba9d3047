"""Where the right hand of somebody seated at a desk reaches: a map over the desk, with a monitor in the way."""

from __future__ import annotations

from pathlib import Path

from presenting import DARK, OAK, command_line

import wholebody as wb


def build() -> wb.Problem:
    """State what holds at every place."""
    figure = wb.load("human", sex="female", stature=1.65)
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.70, 1.40, 0.03)), name="desk", at=(0.62, 0.0, 0.74), color=OAK)
    scene.add(wb.Box((0.03, 0.50, 0.32)), name="monitor", at=(0.72, 0.0, 0.98), color=DARK)
    return wb.Problem(
        scene,
        "sitting",
        constraints=[wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot")],
        clearance=0.005,
    )


def main(out: Path = Path("pictures"), pictures: bool = True, step: float = 0.15) -> wb.studies.ReachMap:
    """Search, report and draw."""
    found = wb.reach_map(build(), "right_index_tip", (0.15, -0.75, 0.80), (0.90, 0.45, 1.25), step)
    print(found)
    print(f"  {found.share:.0%} of the places are reached, {found.volume:.2f} m^3")
    if pictures:
        out.mkdir(parents=True, exist_ok=True)
        for file in (found.picture(out / "reach_map.png"), found.html(out / "reach_map.html")):
            print(f"  wrote {file}")
    return found


if __name__ == "__main__":
    command_line(main, __doc__)

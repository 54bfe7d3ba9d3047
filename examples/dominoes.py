"""A finger pushes the first of twelve dominoes; each of them knocks over the next."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import LIGHT, OAK, STEEL, command_line

import wholebody as wb
from wholebody.view.side_by_side import write_filmstrip
from wholebody.view.viewed_scene import ViewedWorld

COUNT = 12
STEP = 0.032  # m: from one to the next
SIZE = (0.008, 0.026, 0.052)  # m


def build() -> tuple[wb.World, list[np.ndarray]]:
    """The row on a table, and the tracker's way of the hand."""
    hand = wb.load("hand")
    scene = wb.Scene(hand)
    scene.add(wb.Box((0.8, 0.4, 0.02)), name="table", at=(0.30, 0.0, -0.01), color=OAK)
    for k in range(COUNT):
        place = (0.08 + STEP * k, 0.0, 0.5 * SIZE[2] + 1e-4)
        color = LIGHT if k % 2 else STEEL
        scene.add(wb.Box(SIZE), name=f"domino {k}", at=place, color=color, body=wb.Body(density=700.0))
    start = hand.neutral.copy()
    tip = hand.placement(start, "right_index_tip").translation
    start[:3] += np.array([0.04, 0.0, 0.042]) - tip
    way = [start + np.r_[0.06 * np.clip((k - 10) / 40, 0.0, 1.0), np.zeros(len(start) - 1)] for k in range(150)]
    return wb.World(scene, start, dt=1.0 / 60.0), way


def main(out: Path = Path("pictures"), pictures: bool = True) -> int:
    """Run, report and draw; return how many fell."""
    world, way = build()
    frames = [world.step(q) for q in way]
    up = [frames[-1].placements[f"domino {k}"].rotation[2, 2] for k in range(COUNT)]
    fallen = sum(abs(each) < 0.8 for each in up)
    deepest = max(frame.deepest for frame in frames)
    print(f"Dominoes: {fallen} of {COUNT} fell in {len(frames) / 60:.1f} s; deepest overlap {1e3 * deepest:.3f} mm")
    if pictures:
        viewed = ViewedWorld(world.scene, frames[-1].placements)
        motion = [viewed.configuration(frame.q, frame.placements) for frame in frames]
        out.mkdir(parents=True, exist_ok=True)
        with wb.Viewer(viewed, contact_distance=0.0, title="Dominoes") as viewer:
            viewer.look(eye=(-0.16, -0.50, 0.33), target=(0.15, 0.0, 0.02))
            viewer.play(motion, 1.0 / 60.0)
            print(f"  {viewer.save(out / 'dominoes.html')}")
            try:
                print(f"  {write_filmstrip(viewer, [motion[k] for k in (20, 45, 60, 140)], out / 'dominoes.png')}")
            except wb.MissingPackageError as error:
                print(f"  no picture: {error}")
    return fallen


if __name__ == "__main__":
    command_line(main, __doc__)

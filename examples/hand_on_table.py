"""Move a tracked hand through a table: the shown hand slides along it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import OAK, command_line, film, report_frames

import wholebody as wb
from wholebody.tracking import Recording, follow

TOP = 0.75  # m: height of the table
FRAMES = 150
DT = 1 / 60  # s


def build() -> tuple[wb.Scene, wb.Clip]:
    """A hand over a table, and a tracker that goes 4 cm below its top while the glove bends the fingers."""
    hand = wb.load("hand", side="right")
    scene = wb.Scene(hand)
    scene.add(wb.Box((0.9, 0.6, 0.03)), name="table", at=(0.0, 0.0, TOP - 0.015), color=OAK)
    rest = hand.posture("open")
    share = np.linspace(0.0, 1.0, FRAMES)
    height = TOP + rest[2] + 0.10 - 0.14 * np.sin(np.pi * share) ** 2  # of the wrist
    roots = [(-0.3 + 0.4 * s, 0.0, z, *rest[3:7]) for s, z in zip(share, height, strict=True)]
    bend = 0.4 * (1.0 - np.cos(4.0 * np.pi * share)) / 2.0
    angles = {f"right_{finger}_pip_flexion": bend for finger in ("index", "middle", "ring", "little")}
    return scene, wb.motion.posed(hand, roots=roots, angles=angles, posture="open", dt=DT, name="hand")


def main(out: Path = Path("pictures"), pictures: bool = True) -> Recording:
    """Follow, report and draw."""
    scene, track = build()
    recording = follow(scene, track, rigid=True)
    report_frames("A hand on a table", scene, recording)
    if pictures:
        film(
            "hand_on_table", scene, recording, FRAMES // 2, out,
            eye=(-0.35, -0.75, 1.0), target=(-0.05, 0.0, TOP), see_through=["table"],
        )  # fmt: skip
    return recording


if __name__ == "__main__":
    command_line(main, __doc__)

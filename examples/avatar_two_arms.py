"""Walk an avatar into a wall, both arms ahead: it bends its arms and spreads its hands, and does not penetrate."""

from __future__ import annotations

import math
from pathlib import Path

from presenting import command_line, film, report_frames

import wholebody as wb
from wholebody.tracking import Recording, follow
from wholebody.tracking.scenes import script

WALL = 1.2  # m: distance of the wall in front of the avatar's start
REACHING = {"shoulder_flexion": 85.0, "elbow_flexion": 12.0, "shoulder_abduction": 10.0, "wrist_flexion": -35.0}


def build() -> tuple[wb.Scene, wb.Clip]:
    """An avatar in front of a wall, and a tracker that moves its hands 10 cm into it and back."""
    avatar = wb.load("avatar")
    scene = wb.Scene(avatar)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.1, 3.0, 2.5)), name="wall", at=(WALL + 0.05, 0.0, 1.25))
    both = {f"{side}_{name}": math.radians(angle) for name, angle in REACHING.items() for side in ("left", "right")}
    standing = avatar.posture("standing")
    before, inside = avatar.with_joints(standing, both), avatar.with_joints(standing, both)
    before[0], inside[0] = 0.2, 0.72
    keys = [
        (0.0, standing),
        (0.8, before),
        (0.8, inside),
        (0.6, inside),
        (0.6, before),
        (0.8, standing),
        (0.4, standing),
    ]
    return scene, script(avatar, keys, name="avatar")


def main(out: Path = Path("pictures"), pictures: bool = True) -> Recording:
    """Follow, report and draw."""
    scene, track = build()
    recording = follow(scene, track)
    report_frames("Two arms into a wall", scene, recording)
    if pictures:
        film(
            "avatar_two_arms", scene, recording, 110, out,
            eye=(-0.3, -2.5, 2.0), target=(0.8, 0.0, 1.1), see_through=["wall"],
        )  # fmt: skip
    return recording


if __name__ == "__main__":
    command_line(main, __doc__)

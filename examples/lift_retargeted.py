"""A tall man squats and lifts a crate between his palms; his recording is retargeted to a small woman.

The recording is made here and written as BVH; the crate's track is known too. Her feet stay on the floor and her hands
at the crate, which she lifts less high.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import CARDBOARD, command_line

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.view.side_by_side import beside

CRATE = (0.30, 0.24, 0.20)  # m: along the forearms, between the palms, high
FRAMES, RATE = 60, 30.0  # Hz


def record(path: Path) -> Array:
    """Write the BVH of a man of 1.85 m with the crate; returns where that is in each frame, (n, 7)."""
    man = wb.load("human", sex="male", stature=1.85)
    scene = wb.Scene(man).add(wb.HalfSpace(), name="floor")
    state, postures, track = scene.state(man.neutral), [], []
    for turn in (2.0 * np.pi * np.arange(FRAMES) / (FRAMES - 1)).tolist():
        deep, high = 0.6 * (0.5 - 0.5 * np.cos(2.0 * turn)), 0.7 - 0.3 * np.cos(turn)
        angles = {"shoulder_flexion": high, "elbow_flexion": 0.9, "hip_flexion": deep, "knee_flexion": 2.0 * deep}
        angles |= {"ankle_dorsiflexion": deep, "shoulder_abduction": -0.05}
        named = {f"{side}_{joint}": angle for joint, angle in angles.items() for side in ("left", "right")}
        postures.append(man.grounded(man.with_joints(man.posture("standing"), named), scene))
        state.update(postures[-1])
        palms = [state.frame(man.frame_id(f"{side}_palm")).translation for side in ("left", "right")]
        track.append(
            pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("y", 0.5 * np.pi - high - 0.9), 0.5 * (palms[0] + palms[1])))
        )
    wb.Clip(man, np.array(postures), 1.0 / RATE, "a lift").write(path)
    return np.array(track)


def build(track: Array) -> wb.Scene:
    """The woman, the floor, and the crate where it is in the first frame."""
    scene = wb.Scene(wb.load("human", sex="female", stature=1.55)).add(wb.HalfSpace(), name="floor")
    return scene.add(wb.Box(CRATE), name="crate", at=track[0], color=CARDBOARD)


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Clip:
    """Record, retarget, report and draw."""
    with tempfile.TemporaryDirectory() as folder:
        track = record(Path(folder) / "lift.bvh")
        motion = wb.motion.read_skeleton(Path(folder) / "lift.bvh")
    scene = build(track)
    clip = wb.retarget(motion, scene.figure, scene, things={"crate": track})
    found = wb.check(clip, scene)
    print(f"{motion.name}, retargeted: {len(clip)} frames, {'free' if found.free else 'not free'}")
    print(f"  feet slide by {1e3 * max(each.distance for each in found.sliding):.2f} mm at most")
    his, hers = (np.ptp(each[:, 2]) for each in (track, clip.things["crate"]))
    print(f"  the crate is lifted by {100 * hers:.0f} cm, in the recording by {100 * his:.0f} cm")
    if pictures:
        out.mkdir(parents=True, exist_ok=True)
        with beside(motion, {"retargeted": clip}, scene, "Lift retargeted") as viewer:
            print(f"  {viewer.save(out / 'lift_retargeted.html')}")
            try:
                print(f"  {viewer.picture(out / 'lift_retargeted.png')}")
            except wb.MissingPackageError as error:
                print(f"  no picture: {error}")
    return clip


if __name__ == "__main__":
    command_line(main, __doc__)

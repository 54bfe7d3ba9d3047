"""A pack on a walk: a clip is freed by bisection, and the joint curves and postures before and after are drawn.

The walk is a recording (BVH) where one is given or found, and arms that swing otherwise.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Chart

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.motion.judging import Avoided
from wholebody.view.side_by_side import write_filmstrip

RECORDING = "mocap/cmu_35_01.bvh"
FRAMES = 6  # postures in a film strip
CURVES = 4  # joints in the chart: those that change most


def main(
    out: Path = Path("pictures"),
    pictures: bool = True,
    clip: Path | None = None,
    worn: str = "pack",
    method: str = "bisection",
) -> Avoided:
    """Free the clip, print a report, and write a chart and film strips."""
    figure = wb.load("human")
    walk = read(figure, clip)
    scene = wb.Scene(figure)
    for piece in wb.motion.equipment(worn, figure):
        piece.attach(scene)
    freed = wb.avoid(walk, scene, method=method)
    report = freed.report
    print(f"{walk.name} with {worn}: {len(walk)} frames of {walk.dt:.4f} s, by {report.method}")
    for name, found in (("before", report.before), ("after", report.after)):
        print(f"  {name}: {found.colliding} frames collide, {1e3 * found.deepest:.1f} mm at most; {found.dips} dips")
    print(
        f"  {report.frames_changed} frames changed, {report.posture_solves} postures predicted, {report.seconds:.1f} s"
    )
    print(f"  {report.message}")
    if pictures:
        out.mkdir(parents=True, exist_ok=True)
        film(scene, walk, freed.clip, out)
        print(f"  {chart(walk, freed.clip, worn, out / 'free_a_clip_curves.png')}")
    return freed


def read(figure: wb.Figure, path: Path | None) -> wb.Clip:
    """The clip at a path, or the recording, or arms that swing where it is missing; at 30 frames a second at most."""
    root = Path(os.environ.get("WHOLEBODY_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    found = root / RECORDING if path is None else path
    if path is None and not found.is_file():
        print("  no recording here; arms swing instead")
        return swing(figure)
    clip = wb.read_clip(found, figure)
    return clip.resampled(1 / 30) if clip.dt < 1 / 31 else clip


def swing(figure: wb.Figure) -> wb.Clip:
    """Arms swing as in a walk, for two seconds."""
    q = []
    for turn in (2.0 * np.pi * np.arange(61) / 40.0).tolist():
        flexion = {f"{side}_shoulder_flexion": sign * 0.6 * np.sin(turn) for side, sign in (("left", 1), ("right", -1))}
        q.append(figure.with_joints(figure.neutral, flexion))
    return wb.Clip(figure, np.array(q), 1 / 30, "swing")


def chart(before: wb.Clip, after: wb.Clip, worn: str, path: Path) -> Path:
    """Write the curves of the joints that change most, before and after."""
    away = np.abs(after.q - before.q)[:, -len(before.names) :].max(axis=0)
    most = np.argsort(-away)[:CURVES].tolist()
    drawn = Chart(figsize=(8.0, 6.0), layout="constrained")
    for axes, joint in zip(np.atleast_1d(drawn.subplots(len(most), sharex=True)), most, strict=True):
        column = joint - len(before.names)
        axes.plot(before.times, np.degrees(before.q[:, column]), color="0.6", label="before")
        axes.plot(after.times, np.degrees(after.q[:, column]), color="C0", label="after")
        axes.set_ylabel(before.names[joint].replace("_", " ") + " [°]", fontsize=7)
    drawn.axes[0].legend(loc="upper right", fontsize=8)
    drawn.axes[0].set_title(f"{before.name} with {worn}", fontsize=10)
    drawn.axes[-1].set_xlabel("time [s]")
    drawn.savefig(path, dpi=110)
    return path


def film(scene: wb.Scene, before: wb.Clip, after: wb.Clip, out: Path) -> None:
    """Write a page that plays the freed clip with the original as a ghost, and a film strip of both."""
    frames = most_changed(before.q, after.q)
    root = after.q[frames, :3]
    with wb.Viewer(scene, title="Free a clip") as viewer:
        away = _facing(after.q[frames[0]]) @ np.array([1.6, 3.0, 0.8])
        middle = (float(root[0, 0]), float(root[0, 1]), 0.9)
        viewer.look(eye=tuple(np.add(middle, away).tolist()), target=middle)
        viewer.play(after, ghost=before.q)
        print(f"  {viewer.save(out / 'free_a_clip.html')}")
        viewer.ghosts([])
        try:
            for name, clip in (("before", before), ("after", after)):
                in_place = clip.q[frames].copy()
                in_place[:, :2] += root[0, :2] - root[:, :2]
                print(f"  {write_filmstrip(viewer, list(in_place), out / f'free_a_clip_{name}.png', (300, 480))}")
        except wb.MissingPackageError as error:
            print(f"  no pictures: {error}")


def _facing(q: Array) -> Array:
    """Rotation about z to where the root faces."""
    x, y, z, w = q[3:7]
    turn = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def most_changed(before: Array, after: Array) -> list[int]:
    """Frames spread over the clip: of each part the one that changed most."""
    away = np.abs(after - before).max(axis=1)
    parts = np.array_split(np.arange(len(before)), min(FRAMES, len(before)))
    return [int(part[np.argmax(away[part])]) for part in parts]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("pictures"), help="folder for the pictures (./pictures)")
    parser.add_argument("--no-pictures", action="store_true", help="only solve and report")
    parser.add_argument("--clip", type=Path, help="a BVH or clip file")
    parser.add_argument("--equipment", default="pack", help="side_sphere, pouches, vest_plate, pack or torus")
    parser.add_argument("--method", default="bisection", help="bisection, trajectory or frames")
    options = parser.parse_args()
    main(options.out, not options.no_pictures, options.clip, options.equipment, options.method)

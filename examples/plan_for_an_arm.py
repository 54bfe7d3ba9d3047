"""An arm moves from one bay of a shelf into the next: free of collision at any time, as fast as its joints allow."""

from __future__ import annotations

from pathlib import Path

from presenting import LIGHT, OAK, STEEL, command_line, play

import wholebody as wb

ARM = Path(__file__).parent / "tasks" / "arm.urdf"


def build() -> tuple[wb.Scene, wb.Solution, wb.Solution]:
    """The shelf, and the postures in both bays."""
    scene = wb.Scene(wb.load(ARM))
    scene.add(wb.Box((1.6, 1.6, 0.04)), name="bench", at=(0.0, 0.0, -0.03), color=OAK)
    for name, y in (("left side", 0.36), ("middle", 0.0), ("right side", -0.36)):
        scene.add(wb.Box((0.30, 0.02, 0.70)), name=name, at=(0.62, y, 0.34), color=STEEL)
    scene.add(wb.Box((0.30, 0.74, 0.02)), name="top", at=(0.62, 0.0, 0.70), color=STEEL)
    ends: list[wb.Solution] = []
    for y in (0.18, -0.18):
        goals = [wb.Point("grip", (0.62, y, 0.30)), wb.Axis("grip", (0, 0, 1), direction=(1, 0, 0))]
        start = ends[0].q if ends else None
        ends.append(wb.solve(wb.Problem(scene, start, goals=goals, clearance=0.005)))
    scene.add(wb.Sphere(0.02), name="target", at=(0.80, -0.18, 0.30), color=LIGHT)
    return scene, ends[0], ends[1]


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.planning.Plan:
    """Solve both ends, plan, report and draw."""
    scene, first, last = build()
    found = wb.plan(scene, first.q, last.q)
    print(f"From bay to bay: {found.message}")
    check = wb.check(found.clip, scene)
    print(f"  {len(found.clip)} frames, {found.clip.duration:.2f} s, {found.seconds:.2f} s to plan")
    print(f"  deepest overlap at any time {1e3 * check.deepest_between:.3f} mm")
    if pictures:
        q = found.clip.q
        chosen = [q[round(k * (len(q) - 1) / 3)] for k in range(4)]
        play("plan_for_an_arm", scene, found.clip, chosen, out, eye=(-1.25, -2.05, 1.7), target=(0.38, -0.05, 0.3))
    return found


if __name__ == "__main__":
    command_line(main, __doc__)

"""Drag a standing person down onto a chair by the pelvis, with the feet held: by newton and by qp.

The challenge of Choi and Cremer, "Geometrically-aware interactive object manipulation" (1999), figure 1. During the
motion the pelvis is dragged into the seat; contact stops it, and no posture of the motion penetrates anything.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import OAK, command_line, play

import wholebody as wb
from wholebody.tracking import Dragged, drag_along, judge_drag, read_path, spread

SEAT = 0.4262  # m: its top; buttocks touch it when the hips are as high as the knees
SEATED = (-0.41, 0.0, 0.49065)  # m: of the pelvis, a tenth of a millimetre over the seat
PATH = Path(__file__).parent / "tasks" / "sit_on_chair.csv"
FRAMES = 240
STAGES = (0.0, 0.3, 0.55, 0.8, 1.0)  # of the motion, in the picture


def build() -> wb.Problem:
    """State the problem; tasks/sit_on_chair.toml states the same."""
    person = wb.load("human", sex="male", stature=1.75, mass=78.0)
    scene = wb.Scene(person)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.44, 0.48, 0.04)), name="seat", at=(-0.35, 0.0, SEAT - 0.02), color=OAK)
    scene.add(wb.Box((0.03, 0.48, 0.36)), name="backrest", at=(-0.5525, 0.0, 0.82), color=OAK)
    for side, y in (("left", 0.22), ("right", -0.22)):
        scene.add(wb.Box((0.03, 0.04, 1.0)), name=f"{side} post", at=(-0.5825, y, 0.5), color=OAK)
    for side, y in (("left", 0.22), ("right", -0.22)):
        scene.add(wb.Box((0.04, 0.04, 0.386)), name=f"{side} leg", at=(-0.15, y, 0.193), color=OAK)
    bent = {"hip_flexion": 0.1, "knee_flexion": 0.2, "ankle_dorsiflexion": 0.1}  # rad: the knees are unlocked
    start = person.with_joints(
        person.posture("standing"),
        {f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in bent.items()},
    )
    start[2] = 0.895725  # m: as much lower as the knees are bent
    return wb.Problem(
        scene,
        start,
        goals=[wb.Frame("pelvis", SEATED)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        balance=False,  # the chair carries the person in the end
    )


def report(problem: wb.Problem, dragged: Dragged) -> None:
    """Print the assessment of the motion, in every posture and between them."""
    judged, end = judge_drag(problem, dragged), dragged.q[-1]
    contacts, owner = problem.scene.contacts(end, within=0.03), problem.scene.piece_owner
    touching: dict[str, float] = {}
    for pair, distance in zip(contacts.pair, contacts.distance, strict=True):
        touching.setdefault(" and ".join(owner[piece] for piece in pair), 1e3 * distance)
    milliseconds = 1e3 * dragged.seconds
    print(f"{dragged.method}: {len(dragged)} frames, {milliseconds.mean():.1f} ms a frame, {dragged.end.status}")
    print(f"  the pelvis ends {1e3 * dragged.end.assessment.goal_error:.1e} mm from its place")
    print(f"  deepest penetration {1e3 * judged.depth.max():.4f} mm in any posture")
    print(f"  between two postures nothing gets deeper by more than {1e3 * judged.between.max():g} mm")
    print(f"  the feet move by {1e3 * judged.constraint_violation.max():.3f} mm at most")
    for pair in ("pelvis and seat", "thorax and backrest"):
        print(f"  {pair}: {touching[pair]:.2f} mm apart" if pair in touching else f"  {pair}: apart")


def main(out: Path = Path("pictures"), pictures: bool = True) -> dict[str, Dragged]:
    """Drag by both methods, report and draw."""
    problem = build()
    corners = np.vstack([problem.start[:3], read_path(PATH)])
    places = spread(corners, FRAMES)
    drags = {method: drag_along(problem, places, method) for method in ("newton", "qp")}
    for dragged in drags.values():
        report(problem, dragged)
    if pictures:
        draw(problem.scene, drags, out)
    return drags


def draw(scene: wb.Scene, drags: dict[str, Dragged], out: Path) -> None:
    """Write a filmstrip and a page that plays the motion, for each method."""
    for method, dragged in drags.items():
        stages = [dragged.q[round(share * (len(dragged.q) - 1))] for share in STAGES]
        name = f"sit_on_chair_{method}"
        play(name, scene, dragged, stages, out, eye=(1.6, -3.2, 1.35), target=(-0.2, 0.0, 0.82))


if __name__ == "__main__":
    command_line(main, __doc__)

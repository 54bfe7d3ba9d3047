"""Functions that the examples share: a short report, a picture, a page, and the options of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import wholebody as wb
from wholebody.tracking import Recording, judge
from wholebody.view.side_by_side import write_filmstrip

Place = tuple[float, float, float]
Color = tuple[float, float, float, float]

OAK: Color = (0.60, 0.48, 0.36, 1.0)
STEEL: Color = (0.58, 0.64, 0.70, 1.0)
CARDBOARD: Color = (0.72, 0.55, 0.34, 1.0)
DARK: Color = (0.25, 0.28, 0.32, 1.0)
LEATHER: Color = (0.35, 0.24, 0.18, 1.0)
LIGHT: Color = (0.98, 0.93, 0.70, 1.0)


def report(title: str, problem: wb.Problem, solution: wb.Solution) -> None:
    """Print the result of a problem: status, errors, least distance and time, from `wb.assess`."""
    judged = wb.assess(problem, solution.q)
    print(f"{title}: {solution.status} in {solution.seconds:.2f} s, {solution.iterations} iterations")
    print(f"  {solution.message}")
    for goal, error in zip(problem.goals, judged.goal_errors, strict=True):
        print(f"  {name_of(goal):<40} off by {error:.1e} m or rad")
    held = max(judged.limit_violation, judged.constraint_violation, judged.clearance_violation)
    print(f"  limits, constraints and clearances hold to {held:.1e}, deepest penetration {judged.penetration:.1e} m")
    print(f"  nearest: {nearest(problem.scene, solution)}")


def nearest(scene: wb.Scene, solution: wb.Solution, within: float = 0.03, count: int = 4) -> str:
    """The nearest pairs, in one line; pairs with the floor are left out."""
    contacts, owner = scene.contacts(solution.q, within), scene.piece_owner
    found: dict[tuple[str, str], float] = {}
    for (first, second), distance in zip(contacts.pair, contacts.distance, strict=True):
        names = owner[first], owner[second]
        if "floor" not in names:
            found.setdefault(names, distance)
    listed = [f"{a} and {b} {1e3 * distance:.1f} mm" for (a, b), distance in list(found.items())[:count]]
    return ", ".join(listed) or f"nothing within {1e3 * within:.0f} mm"


def name_of(goal: wb.Goal) -> str:
    """Kind of a goal and the frame it moves."""
    return f"{type(goal).__name__} {getattr(goal, 'frame', '')}".strip()


def picture(
    name: str,
    problem: wb.Problem,
    solution: wb.Solution,
    out: Path,
    *,
    eye: Place,
    target: Place,
    see_through: Collection[str] = (),
) -> None:
    """Write NAME.html, and NAME.png where there is a Chromium to draw it.

    Args:
        name: of the two files.
        problem: its scene and goals are shown.
        solution: its posture is shown.
        out: folder, made if it does not exist.
        eye: position of the camera, metres.
        target: the middle of the picture, metres.
        see_through: things to draw transparent.
    """
    out.mkdir(parents=True, exist_ok=True)
    with wb.Viewer(problem.scene, see_through=see_through, title=name.replace("_", " ").capitalize()) as viewer:
        viewer.show(solution.q, problem=problem)
        viewer.look(eye=eye, target=target)
        print(f"  {viewer.save(out / f'{name}.html')}")
        try:
            print(f"  {viewer.picture(out / f'{name}.png')}")
        except wb.MissingPackageError as error:
            print(f"  no picture: {error}")


def report_frames(title: str, scene: wb.Scene, recording: Recording) -> None:
    """Print the assessment of a tracked motion, from `wholebody.tracking.judge`."""
    judged = judge(scene, recording)
    inside = int((judged.tracked_depth > 1e-5).sum())
    milliseconds = 1e3 * recording.seconds
    print(f"{title}: {len(recording)} frames in {recording.seconds.sum():.2f} s, {milliseconds.mean():.1f} ms a frame")
    print(f"  tracked: inside of something in {inside} frames, up to {1e3 * judged.tracked_depth.max():.0f} mm deep")
    print(
        f"  shown: deepest penetration {judged.depth.max():.1e} m, {len(judged.passed)} frames pass through something"
    )
    for end, frames in judged.returns:
        print(f"  contact ends at frame {end}: back at the tracked posture {frames} frames later")
    for note in filter(None, recording.notes):
        print(f"  {note}")


def film(
    name: str,
    scene: wb.Scene,
    recording: Recording,
    frame: int,
    out: Path,
    *,
    eye: Place,
    target: Place,
    see_through: Collection[str] = (),
) -> None:
    """Write NAME.html, which plays the motion with the tracked posture as a ghost, and NAME.png of one frame."""
    out.mkdir(parents=True, exist_ok=True)
    with wb.Viewer(scene, see_through=see_through, title=name.replace("_", " ").capitalize()) as viewer:
        viewer.look(eye=eye, target=target)
        viewer.play(recording, ghost=recording.tracked)
        print(f"  {viewer.save(out / f'{name}.html')}")
        viewer.ghosts([recording.tracked[frame]])
        viewer.show(recording.q[frame])
        try:
            print(f"  {viewer.picture(out / f'{name}.png')}")
        except wb.MissingPackageError as error:
            print(f"  no picture: {error}")


def play(
    name: str,
    shown: wb.Scene | wb.Assembly,
    motion: Any,
    chosen: Sequence[Any],
    out: Path,
    *,
    eye: Place,
    target: Place,
    size: tuple[int, int] | None = None,
    dt: float | None = None,
) -> None:
    """Write NAME.html, which plays a motion, and NAME.png, a strip of chosen postures or states.

    Args:
        name: of the two files.
        shown: what moves.
        motion: postures or states, with their time step `dt`, or a recording, which has one.
        chosen: postures or states of the strip.
        out: folder, made if it does not exist.
        eye: position of the camera, metres.
        target: the middle of the picture, metres.
        size: of each picture of the strip, pixels; None for the usual one.
        dt: seconds from one to the next.
    """
    out.mkdir(parents=True, exist_ok=True)
    with wb.Viewer(shown, title=name.replace("_", " ").capitalize()) as viewer:
        viewer.look(eye=eye, target=target)
        viewer.play(motion, **({} if dt is None else {"dt": dt}))
        print(f"  {viewer.save(out / f'{name}.html')}")
        try:
            print(f"  {write_filmstrip(viewer, chosen, out / f'{name}.png', *(() if size is None else (size,)))}")
        except wb.MissingPackageError as error:
            print(f"  no picture: {error}")


def command_line(main: Callable[..., Any], about: str | None) -> None:
    """Run an example with the options --out and --no-pictures."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--out", type=Path, default=Path("pictures"), help="folder for the pictures (./pictures)")
    parser.add_argument("--no-pictures", action="store_true", help="only solve and report")
    options = parser.parse_args()
    main(out=options.out, pictures=not options.no_pictures)

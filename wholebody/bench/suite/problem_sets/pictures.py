"""Pictures of one case of every set: `python -m wholebody.bench.suite.problem_sets.pictures FOLDER`.

The start is drawn as a ghost, the witness solid. The page docs/problem-sets.md shows them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

from wholebody.bench.suite.problem_sets.registry import SETS, problem_set
from wholebody.view import Viewer

SEED = 0
GHOSTS = 6  # of a moving case
SIZE = (600, 500)  # pixels


class Shot(NamedTuple):
    """Which case of a set shows it best, and from where.

    Attributes:
        number: of the case.
        eye: place of the camera, metres.
        target: middle of the picture, metres.
        see_through: beginnings of names of things that would hide what matters.
    """

    number: int
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    see_through: tuple[str, ...] = ()


SHOTS = {
    "free_reach": Shot(0, (2.9, -2.2, 1.6), (0.1, 0.0, 0.95)),
    "free_reach_several": Shot(2, (2.9, -2.2, 1.6), (0.1, 0.0, 0.95)),
    "clutter": Shot(2, (3.6, -3.0, 2.2), (0.2, 0.0, 1.0)),
    "self_contact": Shot(5, (2.2, 0.5, 1.9), (0.1, 0.0, 1.2)),
    "balance": Shot(0, (2.9, -2.6, 1.4), (0.1, 0.0, 0.8)),
    "closed_loop": Shot(0, (2.6, -1.8, 1.6), (0.2, 0.0, 1.0)),
    "passage": Shot(0, (2.2, -0.6, 1.8), (0.2, 0.1, 1.1), ("board",)),
    "drag": Shot(0, (3.2, -2.6, 1.8), (0.1, 0.0, 1.0)),
    "robot_arm": Shot(0, (2.6, -0.6, 1.5), (0.0, 0.0, 0.6)),
}


def draw(name: str, path: Path) -> Path:
    """Write the picture of a set.

    Raises:
        MissingPackageError: there is no Chromium.
    """
    shot = SHOTS[name]
    case = problem_set(name).make(shot.number, SEED)
    posture, ghosts = case.witness, [case.problem.start]
    if case.frames:
        postures = case.path
        posture, ghosts = postures[-1], list(postures[:: len(postures) // GHOSTS][:GHOSTS])
        case.problem.retarget(case.frames[-1])
    hidden = [thing for thing in case.problem.scene.objects if thing.startswith(shot.see_through or ("-",))]
    with Viewer(case.problem.scene, see_through=hidden, title=name) as viewer:
        viewer.show(posture, problem=case.problem)
        viewer.ghosts(ghosts)
        viewer.look(shot.eye, shot.target)
        return viewer.picture(path, SIZE, legend=False)


def main(folder: Path) -> None:
    """Write all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SETS:
        sys.stdout.write(f"{draw(name, folder / f'set-{name}.png')}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m wholebody.bench.suite.problem_sets.pictures FOLDER")
    main(Path(sys.argv[1]))

"""One robot, in a process of its own: load it, and reach with its tips to where a free posture has them."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.errors import WholebodyError

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.scene import Scene


SEED = 7
"""Of the postures whose tips are the targets."""

FAR = 100.0
"""Metres: pairs farther apart in the default posture do not count."""

SHARES = (1.0, 0.75, 0.5, 0.25, 0.125, 0.0625)
"""How far from the default posture towards a random one a target's posture is: the first that is free of contact."""


@dataclass(frozen=True)
class Loaded:
    """What loading gave.

    Attributes:
        seconds: CPU time of `wholebody.load`, packages imported before.
        refused: the sentence it was refused with; empty where it was loaded.
        kind: "URDF" or "MJCF".
        nv: degrees of freedom.
        pieces: convex pieces.
        pairs: pairs that can touch.
        notes: sentences on what was changed about the geometry.
        left_out: pairs that overlap at zero and could not be parted.
        free: least distance of any pair in the default posture, metres; inf without pairs.
        solved: reaches that ended `solved`.
        times: CPU seconds of each reach.
        statuses: status of each reach.
    """

    seconds: float
    refused: str = ""
    kind: str = "URDF"
    nv: int = 0
    pieces: int = 0
    pairs: int = 0
    notes: int = 0
    left_out: int = 0
    free: float = float("inf")
    solved: int = 0
    times: tuple[float, ...] = ()
    statuses: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether all reaches were solved."""
        return self.solved == len(self.times)

    @property
    def median(self) -> float:
        """Median of the reaches' times."""
        return float(np.median(self.times))


def examine(path: str, reaches: int) -> Loaded:
    """Load a description, and reach.

    Args:
        path: of the description.
        reaches: how many; 0 loads only.
    """
    import wholebody as wb
    from wholebody.figures.rest_posture import UNPARTED
    from wholebody.geometry import convex, meshes

    _ = convex, meshes
    wb.load("hand")  # what every load needs is imported
    began = time.process_time()
    try:
        figure = wb.load(path)
    except WholebodyError as error:
        return Loaded(time.process_time() - began, refused=str(error))
    seconds = time.process_time() - began
    scene = wb.Scene(figure)
    contacts = scene.contacts(figure.neutral, within=FAR) if len(figure.geometry.collisionPairs) else None
    found = Loaded(
        seconds,
        kind="MJCF" if path.endswith(".xml") else "URDF",
        nv=figure.model.nv,
        pieces=figure.geometry.ngeoms,
        pairs=len(figure.geometry.collisionPairs),
        notes=len(figure.notes),
        left_out=sum(pair.reason == UNPARTED for pair in figure.excluded_pairs),
        free=float(contacts.distance.min(initial=FAR)) if contacts is not None else float("inf"),
    )
    if not reaches or not figure.chains:
        return found
    statuses, times = _reach(figure, scene, reaches)
    solved = sum(status == "solved" for status in statuses)
    return Loaded(**{**asdict(found), "solved": solved, "times": tuple(times), "statuses": tuple(statuses)})


def _reach(figure: Figure, scene: Scene, count: int) -> tuple[list[str], list[float]]:
    import wholebody as wb

    statuses: list[str] = []
    times: list[float] = []
    targets = tip_targets(figure, scene, count)
    wb.solve(wb.Problem(scene, goals=[wb.Point(*targets[0])]))  # numba's loops are compiled or read back
    for tip, target in targets:
        problem = wb.Problem(scene, goals=[wb.Point(tip, target)])
        began = time.process_time()
        statuses.append(wb.solve(problem).status)
        times.append(time.process_time() - began)
    return statuses, times


def tip_targets(figure: Figure, scene: Scene, count: int) -> list[tuple[str, Array]]:
    """Tips, the longest chain's first, and where each is in a random posture that is free of contact."""
    from wholebody.figures.self_pairs import random_postures

    chains = sorted(figure.chains.values(), key=lambda chain: -len(chain.joints))
    data = figure.model.createData()
    found = []
    for number, other in enumerate(random_postures(figure.model, count, SEED)):
        tip = chains[number % len(chains)].tip
        q = figure.neutral
        for share in SHARES:
            q = np.asarray(pin.interpolate(figure.model, figure.neutral, other, share))
            if not len(scene.contacts(q, within=0.0).number):
                break
        pin.framesForwardKinematics(figure.model, data, q)
        found.append((tip, np.array(data.oMf[figure.frame_id(tip)].translation)))
    return found

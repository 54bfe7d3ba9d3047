"""Robots as they come: six arms and six humanoids of public descriptions, each tip to a place among things.

The descriptions are not a part of this package: the environment variable `WHOLEBODY_ROBOTS` names the folder of the
wheel example-robot-data, or one that holds it.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.bodies import CLEARANCE, ROOM, until_found
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.bench.suite.problem_sets.things import Occupied, add_things
from wholebody.figures.self_pairs import random_postures

VARIABLE = "WHOLEBODY_ROBOTS"
ARMS = (
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "kinova_description/robots/kinova.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "z1_description/urdf/z1.urdf",
    "so_arm_description/urdf/so101.urdf",
)
HUMANOIDS = (
    "talos_data/robots/talos_reduced.urdf",
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "romeo_description/urdf/romeo.urdf",
    "centauro_description/urdf/centauro.urdf",
    "alex_description/urdf/alex_nub_hands.urdf",
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
)
ROBOTS = tuple(name for pair in zip(ARMS, HUMANOIDS, strict=True) for name in pair)
"""An arm and a humanoid in turn."""

THINGS = 8
AROUND = 0.2  # m: how far beyond both postures things are put
SHARES = (1.0, 0.75, 0.5)  # of the way to a random posture: the first that is free is the witness
FEWEST = 4  # joints of a chain whose tip reaches: fingers are no arms


def folder() -> Path:
    """Where the descriptions are.

    Raises:
        InputError: the variable names no folder with them.
    """
    named = os.environ.get(VARIABLE, "")
    folders: list[Path] = [Path(named), *Path(named).glob("**/example-robot-data/robots")] if named else []
    for found in folders:
        if (found / ROBOTS[0]).is_file():
            return found
    raise InputError(
        f"the set robots needs public descriptions: unpack the wheel example-robot-data, and let {VARIABLE} name its "
        f"folder (it is {named!r})"
    )


@lru_cache(maxsize=2)
def robot(name: str) -> wb.Figure:
    """A robot with its root where it stands; the path is relative to the folder.

    Raises:
        InputError: there is no such folder.
        FileFormatError: the description cannot be read.
    """
    return wb.load(folder() / name)


def _posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The robots in turn; a place and an orientation in every other round, only a place in the others."""
    figure = robot(ROBOTS[number % len(ROBOTS)])
    start = figure.neutral
    chains = [chain for chain in figure.chains.values() if len(chain.joints) >= FEWEST]
    tip = chains[int(rng.integers(len(chains)))].tip
    alone = wb.Problem(wb.Scene(figure), start, goals=[wb.Point(tip, (0.0, 0.0, 0.0))], clearance=CLEARANCE)

    def sampled() -> Array | None:
        other = random_postures(figure.model, 1, int(rng.integers(1 << 31)))[0]
        for share in SHARES:
            q: Array = figure.clamp(np.asarray(pin.interpolate(figure.model, start, other, share)))
            if wb.assess(alone, q).holds(1e-9):  # some pairs of a robot are always nearer than the clearance
                return q
        return None

    witness = until_found(sampled)
    scene = wb.Scene(figure)
    taken = Occupied(figure, (start, witness))
    space = taken.centres.min(axis=0) - AROUND, taken.centres.max(axis=0) + AROUND
    add_things(scene, THINGS, taken, ROOM, rng, (space[0].tolist(), space[1].tolist()))
    place = figure.placement(witness, tip)
    turned = number // len(ROBOTS) % 2 == 1
    goal = wb.Frame(tip, place) if turned else wb.Point(tip, place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE), witness


SET = ProblemSet(
    "robots",
    "robots as they come",
    "Six arms and six humanoids of public descriptions, with the pieces and limits that their files give, bring a "
    "tip to a place among eight things, in half of the problems with an orientation.",
    _posed,
)

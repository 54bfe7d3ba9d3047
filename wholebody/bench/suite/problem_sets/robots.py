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
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things
from wholebody.figures.self_pairs import random_postures

given = numbers("robots")


def folder() -> Path:
    """Where the descriptions are.

    Raises:
        InputError: the variable names no folder with them.
    """
    named = os.environ.get("WHOLEBODY_ROBOTS", "")
    folders: list[Path] = [Path(named), *Path(named).glob("**/example-robot-data/robots")] if named else []
    for found in folders:
        if (found / given.files[0]).is_file():
            return found
    raise InputError(
        "the set robots needs public descriptions: unpack the wheel example-robot-data, and let WHOLEBODY_ROBOTS name "
        f"its folder (it is {named!r})"
    )


@lru_cache(maxsize=2)
def robot(name: str) -> wb.Figure:
    """A robot with its root where it stands; the path is relative to the folder.

    Raises:
        InputError: there is no such folder.
        FileFormatError: the description cannot be read.
    """
    return wb.load(folder() / name)


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The robots in turn; a place and an orientation in every other round, only a place in the others."""
    figure = robot(given.files[number % len(given.files)])
    start = figure.neutral
    chains = [chain for chain in figure.chains.values() if len(chain.joints) >= given.fewest_joints]
    tip = chains[int(rng.integers(len(chains)))].tip
    alone = wb.Problem(wb.Scene(figure), start, goals=[wb.Point(tip, (0.0, 0.0, 0.0))], clearance=CLEARANCE)

    def sampled() -> Array | None:
        other = random_postures(figure.model, 1, int(rng.integers(1 << 31)))[0]
        for share in given.shares:
            q: Array = figure.clamp(np.asarray(pin.interpolate(figure.model, start, other, share)))
            if wb.assess(alone, q).holds(1e-9):  # some pairs of a robot are always nearer than the clearance
                return q
        return None

    witness = until_found(sampled)
    scene = wb.Scene(figure)
    taken = Occupied(figure, (start, witness))
    space = taken.centres.min(axis=0) - given.around_m, taken.centres.max(axis=0) + given.around_m
    add_things(scene, given.things, taken, ROOM, rng, (space[0].tolist(), space[1].tolist()))
    place = figure.placement(witness, tip)
    turned = number // len(given.files) % 2 == 1
    goal = wb.Frame(tip, place) if turned else wb.Point(tip, place.translation)
    return wb.Problem(scene, start, goals=[goal], clearance=CLEARANCE), witness

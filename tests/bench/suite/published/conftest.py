from __future__ import annotations

import fcntl
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bench.suite.published.published_helpers import SEED
from wholebody.bench.suite.problem_sets.case import Posed
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.suite.published.export import export

EVERY = 10  # of how many frames of a drag one is there: each of them is judged


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an export of two problems of every set, of whose drags only some frames are there; workers share it."""
    base = tmp_path_factory.getbasetemp()
    found = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "published"
    with (found.parent / "published.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not found.exists():
            _export(found)
    return found


def _export(found: Path) -> None:
    whole = SETS["drag"]

    def short(number: int, rng: np.random.Generator) -> Posed:
        problem, witness, *ways = whole.pose(number, rng)
        frames, path = ways
        return problem, witness, frames[::EVERY], path[::EVERY]

    export([*({**SETS, "drag": replace(whole, pose=short)}).values()], 2, SEED, found)


@pytest.fixture(scope="session")
def names(folder: Path) -> list[str]:
    """Return the names of all exported problems."""
    index = json.loads((folder / "index.json").read_text())
    return [name for family in index["sets"].values() for name in family["problems"]]

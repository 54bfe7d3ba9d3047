from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path

import pytest

from tests.bench.suite.published.published_helpers import SEED, short_drag
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.suite.published.export import export


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
    export([*({**SETS, "drag": short_drag()}).values()], 2, SEED, found)


@pytest.fixture(scope="session")
def names(folder: Path) -> list[str]:
    """Return the names of all exported problems."""
    index = json.loads((folder / "index.json").read_text())
    return [name for family in index["sets"].values() for name in family["problems"]]

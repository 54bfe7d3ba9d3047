from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from wholebody.bench.problem_sets.registry import SETS
from wholebody.bench.published.export import export

sys.path.insert(0, str(Path(__file__).parent))
from published_helpers import SEED


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an export of two problems of every set."""
    found = tmp_path_factory.mktemp("published") / "problems"
    export(list(SETS.values()), 2, SEED, found)
    return found


@pytest.fixture(scope="session")
def names(folder: Path) -> list[str]:
    """Return the names of all exported problems."""
    index = json.loads((folder / "index.json").read_text())
    return [name for family in index["sets"].values() for name in family["problems"]]

"""Files with random faults, as the attack makes them: tasks, robots, meshes, tracks and results."""

from __future__ import annotations

from pathlib import Path

import pytest

from wholebody.bench.attack.judging import Case
from wholebody.bench.attack.running import run


@pytest.mark.parametrize("seed", [1])  # in none a mesh stays whole enough to be decomposed, for seconds
def test_faulty_files_are_read_or_refused_in_one_sentence(seed: int, tmp_path: Path) -> None:
    refused = 0
    for number in range(60):
        folder = tmp_path / str(number)
        folder.mkdir()
        verdict = run(Case(seed, number, "file"), folder)
        assert verdict.outcome != "wrong", (number, verdict.words)
        refused += verdict.outcome == "refused"
    assert refused > 15

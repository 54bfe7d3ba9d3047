"""What tests of the published problems share."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.bench.suite.problem_sets.case import Posed, ProblemSet
from wholebody.bench.suite.problem_sets.registry import SETS

SEED = 3
EVERY = 10  # of how many frames of a drag one is there: each of them is judged


def short_drag() -> ProblemSet:
    """Return the set of drags with some of its frames."""
    whole = SETS["drag"]

    def short(number: int, rng: np.random.Generator) -> Posed:
        problem, witness, *ways = whole.pose(number, rng)
        frames, path = ways
        return problem, witness, frames[::EVERY], path[::EVERY]

    return replace(whole, pose=short)


def witness(folder: Path, name: str) -> dict[str, Any]:
    family = name.partition("/")[0]
    found: dict[str, Any] = json.loads((folder / "witnesses" / f"{family}.json").read_text())["witnesses"][name]
    return found


def answers(folder: Path, names: list[str], **more: Any) -> dict[str, Any]:
    """Return a file of answers that has the witnesses."""
    listed = [{"problem": name, "seed": "near", **witness(folder, name), "seconds": 0.5} for name in names]
    return {"format": "wholebody answers", "version": "1.0", "method": "witness", "answers": listed, **more}

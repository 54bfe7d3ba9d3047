"""Answers of a method of this package, or of one's own, to published problems, as a file that `judge` reads."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, UnknownNameError
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.jobs import kernel_seconds
from wholebody.bench.suite.compare.results import DEFAULT
from wholebody.bench.suite.compare.solving import Ready, ready, solve
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.suite.published.answers import SEEDS
from wholebody.bench.suite.published.bodies import BodyFiles, body_files
from wholebody.bench.suite.published.problems import problem_content
from wholebody.bench.suite.published.rebuilt import VERSION, Rebuilt, dumped, read_index
from wholebody.bench.tables import machine
from wholebody.bench.tables import sentence as machine_sentence
from wholebody.figures.figure import Figure


def chosen_problems(folder: Path, sets: Sequence[str] | None = None) -> list[tuple[str, int]]:
    """Sets and numbers of the problems of an export; UnknownNameError for a set that it does not have."""
    known = read_index(folder)["sets"]
    for name in sets or ():
        if name not in known:
            raise UnknownNameError("problem set", name, known, str(folder))
    return [(name, number) for name in sets or known for number in range(len(known[name]["problems"]))]


class Answering:
    """A method that answers the problems of an export one after the other from both seeds."""

    def __init__(self, folder: Path, adapter: Adapter) -> None:
        """Take the folder of an export; InputError or FileFormatError where it is none."""
        self._folder, self._adapter, self._index = folder, adapter, read_index(folder)
        self._bodies: dict[int, tuple[Figure, BodyFiles]] = {}
        self._answers: list[dict[str, Any]] = []
        self._warm: set[bool] = set()

    def answer(self, family: str, number: int) -> None:
        """Solve a problem, posed anew, from both seeds; FileFormatError says where the files have another."""
        case = ready(problem_set(family), number, int(self._index["seed"])).case
        rebuilt = Rebuilt(self._folder, self._index["sets"][family]["problems"][number])
        body = self._body(case, rebuilt)
        seeds = {seed: _in_figure(body, rebuilt.seed(seed)) for seed in SEEDS}
        if json.loads(dumped(problem_content(case, body, seeds["far"], {}))) != rebuilt.content:
            raise FileFormatError(
                f"{self._folder}: {rebuilt.content['name']} is another problem in the files; export them with this "
                "version of wholebody"
            )
        if rebuilt.moving not in self._warm:  # the first solve compiles, which nobody's time is to count
            self._warm.add(rebuilt.moving)
            self._answered(case, body, case.problem.start)
        for seed, start in seeds.items():
            found = self._answered(case, body, start)
            self._answers.append({"problem": rebuilt.content["name"], "seed": seed, **found})

    def content(self) -> dict[str, Any]:
        """The content of the file of answers."""
        heading = {"format": "wholebody answers", "version": VERSION, "method": self._adapter.name}
        about = {"about": self._adapter.setup, "machine": machine_sentence(machine())}
        return {**heading, **about, "kernel_seconds": kernel_seconds(), "answers": self._answers}

    def _body(self, case: Case, rebuilt: Rebuilt) -> BodyFiles:
        figure = case.problem.scene.figure
        if id(figure) not in self._bodies:
            self._bodies.clear()
            self._bodies[id(figure)] = figure, body_files(figure, Path(rebuilt.content["body"]).stem, {})
        return self._bodies[id(figure)][1]

    def _answered(self, case: Case, body: BodyFiles, start: Array) -> dict[str, Any]:
        """Postures and seconds, or why the method refuses the problem or fails."""
        asked = replace(case, problem=copy.copy(case.problem).with_start(start))
        record, found = solve(self._adapter, DEFAULT, Ready(asked, inf))
        if not found:
            return {"refused": record.said}
        postures = [body.posture(q) for q in found]
        return ({"postures": postures} if case.frames else {"posture": postures[0]}) | {"seconds": record.seconds}


def _in_figure(body: BodyFiles, values: Array) -> Array:
    """A posture (nq,) of the figure from numbers in the order of the files."""
    q = np.empty_like(values)
    q[body.order] = values
    return q

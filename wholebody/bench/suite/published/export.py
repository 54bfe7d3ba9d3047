"""Write the problem sets as files: bodies, problems, witnesses, difficulty, schemas, an index, and the licence."""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import make_folder, read_text, write
from wholebody.bench.statistics import wilson
from wholebody.bench.suite.problem_sets.bodies import human
from wholebody.bench.suite.problem_sets.case import Case, ProblemSet, generator
from wholebody.bench.suite.published.bodies import BodyFiles, body_files
from wholebody.bench.suite.published.problems import (
    away,
    descended,
    far_seed,
    problem_content,
    problem_name,
    witness_content,
)
from wholebody.bench.suite.published.rebuilt import (
    EXACT,
    INDEX,
    SOLVED,
    VERSION,
    Rebuilt,
    Score,
    dumped,
    read_body,
    worst_of,
)
from wholebody.figures.packaged_urdf import client_paths


@dataclass
class _Export:
    """What a run has written so far."""

    folder: Path
    bodies: dict[int, BodyFiles] = field(default_factory=dict)
    kept: list[wb.Figure] = field(default_factory=list)  # while their ids are keys
    digest: Any = field(default_factory=hashlib.sha256)

    def write(self, path: str, text: str) -> None:
        """Write a file below the folder, and take it into the fingerprint."""
        target = self.folder / path
        make_folder(target.parent)
        write(target, text)
        self.digest.update(f"{path}\n{text}".encode())


def export(
    sets: Sequence[ProblemSet], per_set: int, seed: int, folder: Path, say: Callable[[str], None] = lambda text: None
) -> Path:
    """Write problems of some sets into an empty folder; the index. The same arguments give the same files."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is not an empty folder; name one that does not exist yet")
    done = _Export(folder)
    described: dict[str, Any] = {}
    for family in sets:
        described[family.name] = _written_set(done, family, per_set, seed, say)
    schemas = {f"{name}.schema.json": f"{name}.schema.json" for name in ("problem", "body", "answers", "verdict")}
    for name, source in {**schemas, "LICENSE": "LICENSE.txt", "README.md": "README.txt"}.items():
        done.write(name, read_text(Path(__file__).parent / "static" / source))
    for path in client_paths().values():
        done.write(f"clients/{path.name}", read_text(path))
    index = {
        "format": "wholebody index",
        "version": VERSION,
        "licence": "CC0-1.0",
        "seed": seed,
        "per_set": per_set,
        "fingerprint": done.digest.hexdigest(),
        "sets": described,
    }
    write(folder / INDEX, dumped(index))  # last: a folder without it was not finished
    return folder / INDEX


def _written_set(
    done: _Export, family: ProblemSet, per_set: int, seed: int, say: Callable[[str], None]
) -> dict[str, Any]:
    witnesses, measured, best = {}, {}, {}
    for number in range(per_set):
        name = problem_name(family.name, number)
        case = family.make(number, seed)
        far = far_seed(case, generator(f"{family.name} far", number, seed))
        body = _body(done, case)
        meshes: dict[str, str] = {}
        content = problem_content(case, body, far, meshes)
        for path, text in meshes.items():
            done.write(path, text)
        done.write(f"problems/{name}.json", dumped(content))
        rebuilt = Rebuilt(done.folder, name)
        witnesses[name] = witness_content(case, body)
        proof = _confirmed(rebuilt, witnesses[name])
        measured[name] = _rounded(_difficulty(case, body, rebuilt, far))
        best[name] = None if family.moving else _rounded(_best(case, body, rebuilt, proof))
        say(name)
    heading = {"version": VERSION, "set": family.name}
    done.write(
        f"witnesses/{family.name}.json",
        dumped({"format": "wholebody witnesses", **heading, "witnesses": witnesses}),
    )
    done.write(
        f"difficulty/{family.name}.json",
        dumped({"format": "wholebody difficulty", **heading, "problems": measured, "best_known_effort": best}),
    )
    return {
        "title": family.title,
        "about": family.about,
        "moving": family.moving,
        "problems": list(measured),
        "difficulty": _of_set(measured),
    }


def _body(done: _Export, case: Case) -> BodyFiles:
    figure = case.problem.scene.figure
    if id(figure) not in done.bodies:
        name = "human" if figure is human() else f"{case.set}-{case.number:04d}"
        meshes: dict[str, str] = {}
        made = body_files(figure, name, meshes)
        for path, text in {**meshes, f"bodies/{name}.urdf": made.urdf}.items():
            done.write(path, text)
        done.write(f"bodies/{name}.json", dumped(made.content))
        done.bodies[id(figure)] = made
        done.kept.append(figure)
        read_body.cache_clear()  # one of the same name may have been read from another export
    return done.bodies[id(figure)]


def _confirmed(rebuilt: Rebuilt, witness: Mapping[str, Any]) -> Score:
    postures = witness["postures"] if rebuilt.moving else [witness["posture"]]
    score = worst_of([rebuilt.score(np.array(q), frame) for frame, q in enumerate(postures)])
    if score.worst > EXACT:
        raise WholebodyError(
            f"{rebuilt.content['name']}: the witness is off by {score.worst:.1e} in the written files; report this"
        )
    return score


def _best(case: Case, body: BodyFiles, rebuilt: Rebuilt, proof: Score) -> float:
    """Least effort known: of the witness, and of an exact answer of our own method, without a limit of time."""
    problem = copy.copy(case.problem)
    problem.measures = tuple(term for term in problem.measures if isinstance(term, wb.Effort))
    # The effort to compare with is that of an exact answer.
    found = wb.methods.QP(tolerance=1e-7, time_limit=math.inf).solve(problem)
    score = rebuilt.score(np.array(body.posture(found.q)))
    return min(proof.effort, score.effort) if score.worst <= EXACT else proof.effort


def _of_set(measured: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of a set: the median distance of its witnesses, and shares with intervals."""
    count = len(measured)
    distances = sorted(one["witness_distance"] for one in measured.values())
    shares = {}
    for seed in ("near", "far"):
        solved = sum(one["gauss_newton"][seed] for one in measured.values())
        low, high = wilson(solved, count)
        shares[seed] = {"solved": solved, "of": count, "interval": [round(low, 4), round(high, 4)]}
    return {"witness_distance_median": distances[count // 2], "gauss_newton": shares}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.9g}")  # the last digits are rounding
    return {name: _rounded(item) for name, item in value.items()} if isinstance(value, dict) else value


def _difficulty(case: Case, body: BodyFiles, rebuilt: Rebuilt, far: Array) -> dict[str, Any]:
    """How hard a case is; the judge of the files says what a descent solves; of moving goals the first."""
    way, solved = away(case), {}
    for seed, start in (("near", case.problem.start), ("far", far)):
        found = descended(case, start)
        worst = math.inf if found is None else rebuilt.score(np.array(body.posture(found))).worst
        solved[seed] = bool(worst <= SOLVED)
    largest = float(np.abs(way).max(initial=0.0))
    return {"witness_distance": float(np.linalg.norm(way)), "witness_largest": largest, "gauss_newton": solved}

"""Problems of many, solved in a process one by one, or of one form in batches; what is sent to other processes."""

from __future__ import annotations

import hashlib
import io
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, as_dict
from wholebody.base.errors import WholebodyError, one_line
from wholebody.base.runner import packed
from wholebody.methods.base import Method, check_problem
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.studies.records import JUDGED, REFUSED, SolveRecord, answer_of
from wholebody.tasks.bounds import Freeze

Make = Callable[[], Problem]

Start = tuple[Make, Any]  # a problem, and the posture (nq,) from which it is solved, None for its own start

SHIFTING = ("JointModelP", "JointModelTranslation")
"""How the names of Pinocchio's joints begin that shift: prismatic, planar and translation."""

Run = tuple[Any, Sequence[Make]]
"""The posture (nq,) from which the first of some problems is tried, None for its own start; and the problems."""


@dataclass(frozen=True)
class Case:
    """A problem that is made where it is solved."""

    record: SolveRecord  # its record before it is done: name and factors
    make: Make  # makes the problem
    asked: str = ""  # fingerprint; a case with the same is not done again
    place: tuple[int, ...] = ()  # numbers of its factors; cases are neighbours as far as these are alike


def solve_runs(runs: Sequence[Run], method: Method) -> list[list[dict[str, Any]]]:
    """Solve the problems of runs: what their records say."""
    answers: list[list[dict[str, Any]]] = []
    for q, run in runs:
        answers.append([])
        for make in run:
            answers[-1].append(_solved(make, method, q))
            q = answers[-1][-1]["q"] if answers[-1][-1]["outcome"] == "solved" else q
    return answers


def _solved(make: Make, method: Method, q: Array | None) -> dict[str, Any]:
    try:
        problem = check_problem(make(), "the task's answer")
        if q is not None and q.shape == problem.start.shape:
            warm = _warm_answer(problem, method, q)
            if warm is not None:
                return warm
        return answer_of(method.solve(problem))
    except WholebodyError as error:
        message = str(error)
    except Exception as error:  # of a term or a task of the user's own
        message = one_line(f"{type(error).__name__}: {error}")
    return {"outcome": REFUSED, "message": message, "q": None}


def _warm_answer(problem: Problem, method: Method, q: Array) -> dict[str, Any] | None:
    """What a record says of a problem solved from another's answer (nq,); None where not solved, or refused."""
    plain = warmed(method)
    try:
        begun = begun_at(problem, q)
        if type(plain) is QP:  # feasibility first, as what is closest is of no use here
            # of 61 that succeeded none took over 20; more cost misses alone
            near = replace(plain, iterations=min(plain.iterations, 50))
            solution = next(near.minima(begun, [begun.start]))
        else:
            solution = plain.solve(begun)
    except WholebodyError:
        return None
    return answer_of(solution) if solution.solved else None


def solve_from(given: Sequence[Start], method: Method) -> list[dict[str, Any] | None]:
    """Solve problems from given starts: what their records say; None for one that is not solved."""
    answers: list[dict[str, Any] | None] = []
    for make, q in given:
        if q is None:
            own = _solved(make, method, None)
            answers.append(own if own["outcome"] == "solved" else None)
        else:
            answers.append(_warm_answer(check_problem(make(), "the task's answer"), warmed(method), q))
    return answers


def most_turned(given: Sequence[tuple[Make, Array, Array]], _method: Method) -> list[tuple[str, float]]:
    """Of each problem, the joint that turns most between two postures (nq,), and the angle, radians."""
    found = []
    for make, one, other in given:
        model = make().scene.model
        turned = np.asarray(pin.difference(model, one, other))
        hinges = [(float(np.linalg.norm(turned[joint.idx_v : joint.idx_v + joint.nv])), name)
                  for joint, name in zip(model.joints, model.names, strict=True)
                  if joint.nv in (1, 3) and not joint.shortname().startswith(SHIFTING)]  # fmt: skip
        angle, name = max(hinges, default=(0.0, ""))
        found.append((name, angle))
    return found


def begun_at(problem: Problem, q: Array) -> Problem:
    """Return a problem that begins at the answer (nq,) of another one; what is frozen stays at its own start."""
    model = problem.scene.model
    away = np.asarray(pin.difference(model, problem.start, q))
    for bound in problem.bounds:
        if isinstance(bound, Freeze):
            away[problem.scene.figure.dofs(bound.joints)] = 0.0
    return problem.with_start(np.asarray(pin.integrate(model, problem.start, away)))


def warmed(method: Any) -> Any:
    """Return the method without starts of its own and the search that goes with them, where these are its settings."""
    settings = {one.name for one in fields(type(method)) if one.init} if is_dataclass(type(method)) else set()
    if "restarts" not in settings:
        return method
    try:
        return replace(method, **dict.fromkeys(settings & {"restarts", "budget"}, 0))
    except Exception:  # a method of the user's own may refuse them
        return method


def run_batches(batches: Sequence[Any], _method: Method) -> list[Any]:
    """Answers of batches that a method with `batches` made."""
    return [batch.run() for batch in batches]


def batch_answers(batch: Any, answers: Any) -> Iterator[tuple[int, dict[str, Any]]]:
    """The place of each problem of a batch that is solved, and what its record says."""
    seconds = answers.seconds / len(batch.places)
    columns = {name: values.tolist() for name, values in as_dict(answers.judged).items() if name in JUDGED}
    for k in answers.solved.nonzero()[0].tolist():
        numbers = {name: values[k] for name, values in columns.items()}
        said = {"outcome": "solved", "message": "solved directly", "seconds": seconds}
        yield batch.places[k], {**said, "iterations": int(answers.iterations[k]), "q": answers.q[k].copy(), **numbers}


class Sent(NamedTuple):
    """What is sent to another process."""

    value: bytes  # pickled, with scenes left out
    scenes: dict[str, bytes]  # digest of each of its scenes to that scene, pickled

    def read(self) -> Any:
        """The value, with the scenes that this process has seen; KeyError for one that was not sent."""
        return _Reader(self).load()


class Sender:
    """Pickles values; every scene is pickled once as long as nothing in it moves."""

    def __init__(self) -> None:
        self._scenes: dict[tuple[int, int, int], tuple[str, bytes, Scene]] = {}

    def sent(self, value: Any, full: bool = True) -> Sent:
        """A value, ready to be sent; in full, or without the scenes to a process that has seen them."""
        into, scenes = io.BytesIO(), {}

        def leave_out(given: object) -> str | None:
            if not isinstance(given, Scene):
                return None
            key = id(given), given.revision, given.built.moves
            if key not in self._scenes:
                made = packed(given)
                self._scenes[key] = hashlib.sha256(made).hexdigest(), made, given
            digest, made, _ = self._scenes[key]
            if full:
                scenes[digest] = made
            return digest

        import cloudpickle

        pickler = cloudpickle.Pickler(into)
        pickler.persistent_id = leave_out
        pickler.dump(value)
        return Sent(into.getvalue(), scenes)


def sent_to(function: Callable[..., Any], given: Sent, *others: Any) -> Any:
    """What a function answers to a value that was sent; None where this process has not seen a scene of it."""
    try:
        value = given.read()
    except KeyError:
        return None
    return function(value, *others)


_SEEN: OrderedDict[str, Scene] = OrderedDict()  # scenes that were sent to this process, the newest last


class _Reader(pickle.Unpickler):
    def __init__(self, sent: Sent) -> None:
        super().__init__(io.BytesIO(sent.value))
        self._scenes = sent.scenes

    def persistent_load(self, digest: str) -> Scene:
        """The scene with a digest."""
        if digest not in _SEEN:
            _SEEN[digest] = pickle.loads(self._scenes[digest])
        _SEEN.move_to_end(digest)
        while len(_SEEN) > 4:
            _SEEN.popitem(last=False)
        return _SEEN[digest]

"""`wb.solve_many`: many problems beside each other, each in a child process; one that fails has a record."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from wholebody.base import checks
from wholebody.base.arrays import brief
from wholebody.base.batches import JobOptions, Jobs, fingerprint, run_batch, shared
from wholebody.base.runner import EndedError, Job
from wholebody.methods.base import Method, check_problem
from wholebody.methods.control import ctrl_c_ends_all
from wholebody.methods.solve import as_method, warn_of_left_out
from wholebody.problem import Problem
from wholebody.studies.neighbours import Family, Work, lower, name_changes, solve_from_neighbours
from wholebody.studies.records import ENDED, KeptRecords, Records, SolveRecord
from wholebody.studies.solving import Case, Run, Sender, batch_answers, run_batches, sent_to, solve_runs
from wholebody.tasks.answers import is_own

LONGEST = 1e7  # s: a greater deadline of a solve is a mistake


class SolveProgress(NamedTuple):
    """How far a run is, after each problem.

    Attributes:
        done: problems, those of an earlier run included.
        total: how many there are in all.
        record: the one that was done last; None before the first.

    Examples:
        >>> records = wb.solve_many([problem], progress=lambda now: now.done >= 100)  # ends after a hundred
    """

    done: int
    total: int
    record: SolveRecord | None

    def __repr__(self) -> str:
        return brief(self)


@dataclass(frozen=True)
class Running:
    """How cases are run; see `solve_many`."""

    method: Method
    jobs: int = 1
    cluster: str | None = None
    seconds: float | None = None
    progress: Callable[[SolveProgress], Any] | None = None

    @classmethod
    def checked(cls, what: str, method: object, seconds: object = None, **running: Any) -> Running:
        """Check the arguments of a function that runs cases; `running` are `JobOptions`."""
        jobs, cluster, tell = Jobs.checked(what, **running)
        deadline = None if seconds is None else checks.number(seconds, f"{what}: seconds", 1e-3, LONGEST, "s")
        return cls(as_method(method), jobs, cluster, deadline, tell)


class RunOptions(JobOptions, total=False):
    """How cases are run and where records are kept, as keyword arguments; see `solve_many`."""

    seconds: float | None
    folder: str | os.PathLike[str] | None


def solve_many(
    problems: Iterable[Problem] | Mapping[str, Problem],
    method: str | Method = "qp",
    *,
    jobs: int = 1,
    cluster: str | None = None,
    warm_start: bool = False,
    seconds: float | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[SolveProgress], Any] | bool | None = None,
) -> Records:
    """Solve many problems, several at a time, in processes that keep the scenes which they have seen.

    The answers are the same whatever `jobs` is. A problem that fails, or whose process ends, has a record that says so
    and ends no other. Without a deadline and with the package's own terms alone, problems are solved in this process,
    and beside it in others once these are ready, which are kept for the next call. A problem that is not solved from
    its own start is tried from the answers of two solved ones beside it in the order given, of figures with as many
    coordinates; of four where two factors of a study vary. `SolveRecord.neighbour` names the one that led to its
    answer.

    Args:
        problems: the problems; a mapping gives them names, otherwise they are numbered from "0".
        method: name or settings, see `solve`.
        jobs: problems at a time.
        cluster: address of a dask scheduler that runs them; None for this machine.
        warm_start: begin each problem at the answer of the last one before it that is solved, if of the same figure.
            One that is not solved from there is solved from its own start, and so are goals of arms that are answered
            many at a time: the least of their branches is known at once. Runs of 16 problems in the order given are
            linked so, and their first ones, whatever `jobs` is. The middle one of each run is solved from its own start
            too. Where neighbours differ by more than 10 degrees in a joint, both are solved from each other's answers,
            then from their own starts, and the lower measure stays: at most four more solves of a problem.
            `SolveRecord.change` names the jumps that are left. An answer may be another local solution than without.
        seconds: deadline of each problem, by the clock; its record's outcome is then "ended". None for none.
        folder: keeps the records (`records.jsonl`). What it holds already of the same problem and method is not solved
            again: a run that was ended goes on. Made if it does not exist.
        progress: called with a `SolveProgress` after each problem; if it returns True, the run ends, and the
            remaining problems are "cancelled". True in place of a function prints a line that counts.

    Returns:
        The records, in the order of the problems.

    Raises:
        InputError: something else than problems, or a value out of range.
        UnknownNameError: there is no such method.
        FileFormatError: the folder holds other records.
        MissingPackageError: dask is not installed.
        WholebodyError: the cluster does not answer.

    Examples:
        >>> records = wb.solve_many({"first": problem, "second": problem})
        >>> [record.outcome for record in records]
        ['solved', 'solved']
    """
    what = "solve_many"
    named = _named(problems, what)
    running = Running.checked(what, method, seconds, jobs=jobs, cluster=cluster, progress=progress)
    warn_of_left_out(running.method, 2, *(problem for _, problem in named))
    warm_start = checks.flag(warm_start, f"{what}: warm_start")
    store = None if folder is None else KeptRecords(checks.path(folder, f"{what}: folder"))
    cases = []
    for number, (name, problem) in enumerate(named):
        asked = "" if store is None else fingerprint(problem, running.method, warm_start)
        cases.append(Case(SolveRecord(name), _Given(problem), asked, (number,)))
    return run_cases(cases, warm_start, running, store)


@ctrl_c_ends_all()
def run_cases(
    order: Sequence[Case], warm_start: bool, running: Running, store: KeptRecords | None, *, lowers: bool = True
) -> Records:
    """Solve cases, with `warm_start` from each other; `lowers`: those beside jumps again, see `lower`."""
    found = {} if store is None else {k: store.done(case.asked) for k, case in enumerate(order)}
    done = {k: replace(record, name=order[k].record.name, factors=order[k].record.factors)
            for k, record in found.items() if record is not None}  # fmt: skip
    # longer runs: fewer cold starts, fewer processes busy at the end
    tell, length = running.progress, 16 if warm_start else 1
    numbered = [range(k, min(k + length, len(order))) for k in range(0, len(order), length)]

    def keep(number: int, record: SolveRecord) -> bool:
        done[number] = record
        if store is not None:
            store.add(order[number].asked, record)
        return tell is not None and tell(SolveProgress(len(done), len(order), record)) is True

    over = tell is not None and tell(SolveProgress(len(done), len(order), None)) is True
    waiting = [run for run in numbered if any(k not in done for k in run)]
    asked = [k for run in waiting for k in run if k not in done]
    if not over and hasattr(running.method, "batches") and _is_quick([order[k] for k in asked], running):
        over = _at_once(asked, order, running, keep)
    settled = done.keys() & asked
    # The first of each run begin at each other's answers, one after the other, and the rest of a run at its first: so
    # all runs are of one family of postures, whatever `jobs` is.
    linked = [run for run in waiting if len(run) > 1]
    firsts, alone = [run[0] for run in numbered if len(run) > 1], list[Sequence[int]]()
    leading = [firsts] if linked and len(firsts) > 1 else []
    for runs_now in (leading, waiting, alone):  # the cases of a run whose process ended are done again, one by one
        starts, work = dict[int, int | None](), list[Sequence[int]]()
        for part in runs_now:
            if left := [k for k in part if k not in done]:
                led = [*firsts, *part] if len(part) > 1 else []
                starts[left[0]] = _solved_before(left[0], led, done)
                work.append(left)
        if not over and work:
            over = _run(work, order, running, keep, alone, {k: done[j].q for k, j in starts.items() if j is not None})
    if not over and waiting:
        family = Family(order, done, partial(_computed, order, running), keep, settled)
        starts = {k: _solved_before(k, run, done) for run in (*leading, *linked) for k in run[1:]}
        before_it = {k: j for k, j in starts.items() if j is not None}
        middles = [run[len(run) // 2] for run in linked]  # far from the own start that began all of them
        _ = solve_from_neighbours(family, before_it) or (
            linked and lowers and (lower(family, middles) or name_changes(family))
        )
    return Records([done.get(k, order[k].record) for k in range(len(order))])


def _solved_before(number: int, run: Iterable[int], done: Mapping[int, SolveRecord]) -> int | None:
    """The last case of a run before one that is solved; None if none is."""
    return max((j for j in run if j < number and j in done and done[j].solved), default=None)


def _at_once(
    asked: Sequence[int], order: Sequence[Case], running: Running, keep: Callable[[int, SolveRecord], bool]
) -> bool:
    """Solve those cases that a method with `batches` answers many of at a time; whether the caller ended them."""
    # larger: fewer calls; smaller: earlier progress, processes end together
    batches = running.method.batches([order[k].make() for k in asked], 256)  # type: ignore[attr-defined]
    work = {number: ([asked[k] for k in batch.places], batch) for number, batch in enumerate(batches)}
    with closing(_answers(run_batches, work, order, running)) as outcomes:
        for number, answers, error in outcomes:
            for k, answer in batch_answers(batches[number], answers) if error is None else ():
                record = order[asked[k]].record  # `replace` would take three times as long
                if keep(asked[k], SolveRecord(record.name, factors=record.factors, **answer)):
                    return True
    return False


def _computed(order: Sequence[Case], running: Running, function: Callable[..., Any], work: Work) -> dict[Any, Any]:
    """Answers of a function of `solving` by key, see `Family`."""
    given = {key: ([k], (order[k].make, *rest)) for key, (k, *rest) in work.items()}
    with closing(_answers(function, given, order, running)) as outcomes:
        return {key: answer for key, answer, error in outcomes if error is None and answer is not None}


def _run(
    work: Sequence[Sequence[int]], order: Sequence[Case], running: Running, keep: Callable[[int, SolveRecord], bool],
    alone: list[Sequence[int]], begun: Mapping[int, Any],
) -> bool:  # fmt: skip
    """Do runs; whether the caller ended them. Those of several cases whose process ended are left in `alone`."""
    given: dict[Any, tuple[Sequence[int], Run]] = {
        tuple(run): (run, (begun.get(run[0]), [order[k].make for k in run])) for run in work
    }
    with closing(_answers(solve_runs, given, order, running)) as outcomes:
        for run, answers, error in outcomes:
            if error is not None and len(run) > 1:
                alone.extend([k] for k in run)
                continue
            found = [{"outcome": ENDED, "message": str(error)}] if error is not None else answers
            for k, answer in zip(run, found, strict=True):
                if keep(k, replace(order[k].record, **answer)):
                    return True
    return False


def _answers(
    function: Callable[..., Any], work: Mapping[Any, tuple[Sequence[int], Any]], order: Sequence[Case], running: Running
) -> Generator[tuple[Any, Any, EndedError | None], None, None]:
    """What a function of `solving` answers, by key; `work` has of each key the cases and what the function takes."""
    # In this process too where nobody else's code can end it.
    sender, keys = Sender(), [*work]
    cases = [order[k] for numbers, _ in work.values() for k in numbers]

    def here(key: Any) -> Any:
        return function([work[key][1]], running.method)[0]

    def there(some: list[Any], full: bool) -> Job:
        given = sender.sent([work[key][1] for key in some], full)
        seconds = (running.seconds or 0.0) * len(work[some[0]][0])
        return Job(some, sent_to, (function, given, running.method), seconds)

    if running.cluster is None and _is_quick(cases, running):
        yield from shared(keys, running.jobs, here, there)
        return
    # Up to 16 in a job, since each has its scene with it; those of a job whose process ended are done one by one. A
    # deadline is of one. More: fewer scenes are sent, processes end less together. Keys are of runs of cases.
    most = 16 * len(keys) // max(1, len(cases))
    size = 1 if running.seconds else max(1, min(most, len(keys) // (4 * running.jobs)))
    alone = list[list[Any]]()
    for chunks in ([keys[k : k + size] for k in range(0, len(keys), size)], alone):
        with closing(run_batch((there(each, True) for each in chunks), running.jobs, running.cluster)) as outcomes:  # type: ignore[type-var]
            for job, _, answer, error in outcomes:
                if error is not None and len(job.name) > 1:
                    alone += [[part] for part in job.name]
                else:
                    yield from zip(job.name, answer or [None], [error] * len(job.name), strict=True)


def _is_quick(cases: Iterable[Case], running: Running) -> bool:
    """Whether nobody else's code can end or hold up the process that solves these."""
    return running.seconds is None and all(isinstance(case.make, _Given) and not case.make.is_own for case in cases)


@dataclass(frozen=True)
class _Given:
    problem: Problem

    @property
    def is_own(self) -> bool:
        """Whether it has terms of one's own."""
        problem = self.problem
        return any(map(is_own, (*problem.goals, *problem.constraints, *problem.bounds, *problem.measures)))

    def __call__(self) -> Problem:
        return self.problem


def _named(given: Any, what: str) -> list[tuple[str, Problem]]:
    if isinstance(given, Mapping):
        named = [(checks.text(name, f"{what}: a name of problems"), problem) for name, problem in given.items()]
    else:
        listed = checks.listed(given, f"{what}: problems", "[problem, other_problem]")
        named = [(str(k), problem) for k, problem in enumerate(listed)]
    return [(name, check_problem(problem, f"{what}: problems[{name}]")) for name, problem in named]

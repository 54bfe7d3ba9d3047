"""Many problems of one form, solved in batches whose arrays are sent to other processes instead of the problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from wholebody.base.arrays import as_dict
from wholebody.base.batches import shared
from wholebody.base.runner import Job
from wholebody.problem import Problem
from wholebody.studies.records import JUDGED
from wholebody.studies.sending import Sender, sent_to

LARGEST = 256  # problems of a batch. More: fewer calls; less: progress is told sooner, and processes end together.


def at_once(problems: Sequence[Problem], method: Any, jobs: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Solve those problems that a method with `batches` answers many of at a time: place and record of each solved."""
    sender = Sender()

    def there(batches: list[Any], full: bool) -> Job:
        return Job(batches, sent_to, (_run_all, sender.sent(batches, full)), 0.0)

    batches = method.batches(problems, LARGEST)
    for batch, answers, error in shared(batches, jobs, lambda batch: batch.run(), there):
        if error is None:
            yield from _records(batch, answers)


def _run_all(batches: Sequence[Any]) -> list[Any]:
    return [batch.run() for batch in batches]


def _records(batch: Any, answers: Any) -> Iterator[tuple[int, dict[str, Any]]]:
    """The place of each problem of a batch that is solved, and what its record says."""
    seconds = answers.seconds / len(batch.places)
    columns = {name: values.tolist() for name, values in as_dict(answers.judged).items() if name in JUDGED}
    for k in answers.solved.nonzero()[0].tolist():
        numbers = {name: values[k] for name, values in columns.items()}
        said = {"outcome": "solved", "message": "solved directly", "seconds": seconds}
        yield batch.places[k], {**said, "iterations": int(answers.iterations[k]), "q": answers.q[k].copy(), **numbers}

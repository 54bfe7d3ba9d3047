"""`wb.study`: one task for many people, targets and layouts, in one table."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

from wholebody.base import checks
from wholebody.base.batches import fingerprint, own_child
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import read_bytes
from wholebody.base.runner import packed
from wholebody.figures import Figure, load
from wholebody.figures.anthropometry import Person, design_cases, make_person
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import left_out, warn_of_names
from wholebody.problem import Problem
from wholebody.studies.many import Running, RunOptions, run_cases
from wholebody.studies.records import KeptRecords, Records, SolveRecord
from wholebody.studies.solving import Case
from wholebody.studies.study_files import SIZE, TaskFile

if TYPE_CHECKING:
    from typing_extensions import Unpack

MOST_CASES = 1_000_000

TaskFunction = Callable[[Any, Any, Any], Problem]
"""Makes the problem of a figure, a target and a layout; each is None where the study has none."""


def study(
    task: TaskFunction | str | os.PathLike[str],
    *,
    people: Any = None,
    targets: Any = None,
    layouts: Any = None,
    method: str | Method | None = None,
    warm_start: bool = False,
    **running: Unpack[RunOptions],
) -> Records:
    """Solve one task for every person, with every target, in every layout.

    A case that is not solved from the task's start is tried from the answers of its nearest solved neighbours: cases
    whose person, target and layout are the same or beside its own in the order given. See `solve_many`.

    Args:
        task: a function of a figure, a target and a layout that returns a problem, or a task file. In a task file, a
            person replaces the figure's options by name, and sex, stature, mass, percentile, age and proportions all
            together where it has one of them; of several figures they are of the one that its option `called` names. A
            target (3,) replaces the place of the first goal of type point or frame, and a layout the placements of
            things, by name.
        people: in a list, or by name in a mapping. A person is a design case of the anthropometric tables ("F5" to
            "M95", percentiles of women and men), a mapping of options of `wb.load("human")` such as `{"sex":
            "female", "stature": 1.6}`, or a figure (for functions).
        targets: likewise; for functions any values.
        layouts: likewise.
        method: name or settings; None for the file's, and for "qp" with functions.
        warm_start: begin each target at the answer of the one before it, and the first of a person at that of the
            person before, see `solve_many`.
        running: `jobs`, `cluster`, `seconds`, `folder` and `progress`, as of `solve_many`.

    Returns:
        One record for each combination, the targets varying fastest. Its columns `person`, `target` and `layout` are
        the names that were given, or the values in words.

    Raises:
        InputError: a value of the wrong kind or range, or nothing to vary.
        UnknownNameError: an unknown method, option, design case or thing.
        FileFormatError: the task file cannot be read, or the folder holds other records.
        MissingPackageError: dask is not installed.
        WholebodyError: the cluster does not answer.

    Examples:
        >>> def task(figure, target, layout):
        ...     return wb.Problem(wb.Scene(figure), goals=[wb.Point("right_index_tip", target)])
        >>> records = wb.study(task, people=["F5", "M95"], targets=[(0.3, -0.2, 1.2)])
        >>> [record.outcome for record in records]
        ['solved', 'solved']
    """
    checks.keywords(running, RunOptions, "study")
    folder = running.pop("folder", None)
    run = partial(Running.checked, "study", **running)
    varied = {"people": people, "targets": targets, "layouts": layouts}
    cases, warm, how, store = planned(task, varied, method, run, warm_start, folder)
    warn_of_first(cases, how.method, 2)
    return run_cases(cases, warm, how, store)


def warn_of_first(cases: Sequence[Case], method: Method, level: int) -> None:
    """Say what a method leaves out of the first case before any is computed; `level` as in `warnings.warn`."""
    if type(method) is QP:  # looks at all; making a person takes a second
        return
    try:  # a task of the user's own can end the process that makes it
        names = own_child().call(_left_out, cases[0].make, method, seconds=0.0)
    except WholebodyError:  # the records tell
        return
    warn_of_names(method, level + 1, names)


def _left_out(make: Callable[[], Problem], method: Method) -> tuple[str, ...]:
    try:
        return tuple(left_out(method, make()))
    except Exception:  # of a task of the user's own
        return ()


def planned(
    task: TaskFunction | str | os.PathLike[str], varied: Mapping[str, Any], method: str | Method | None,
    run: Callable[..., Running], warm_start: bool, folder: str | os.PathLike[str] | None,
) -> tuple[list[Case], bool, Running, KeptRecords | None]:  # fmt: skip
    """What `run_cases` takes of the arguments of `study`; `run` makes of a method how cases are run."""
    what = "study"
    make: TaskFile | TaskFunction
    mark: Any
    file: TaskFile | None = None
    if isinstance(task, (str, os.PathLike)):
        make = file = TaskFile(checks.path(task, f"{what}: task"))
        chosen, mark = file.task.method if method is None else method, read_bytes(file.path, "task file")
    elif callable(task):
        _check_takes_three(task, f"{what}: task")
        make, chosen, mark = task, "qp" if method is None else method, _source(task)
    else:
        raise InputError(f"study: task is {checks.shown(task)}; give the path of a task file, or a function")
    running = run(chosen)
    warm_start = checks.flag(warm_start, f"{what}: warm_start")
    factors = [_named(values, f"{what}: {name}") for name, values in varied.items()]
    if not any(factors):
        raise InputError("study: nothing varies; give people, targets or layouts")
    if prod(len(values) or 1 for values in factors) > MOST_CASES:
        raise InputError(f"study: more than {MOST_CASES} cases; give fewer people, targets or layouts")
    factors[0] = {name: options_of(person) for name, person in factors[0].items()}
    if file is None and any(isinstance(person, Mapping) and "called" in person for person in factors[0].values()):
        raise InputError("study: people have 'called', which names a figure of a task file; the function knows them")
    if file is not None:
        file.check(*(values.values() for values in factors))
    store = None if folder is None else KeptRecords(checks.path(folder, f"{what}: folder"))
    cases = []
    # a figure has a megabyte: it is hashed once, and not for each case
    marks = {who: fingerprint(mark, person) for who, person in (factors[0] or {"": None}).items()} if store else {}
    persons, aims, places = (list(enumerate(values.items() or [("", None)])) for values in factors)
    for (i, (who, person)), (j, (where, layout)) in product(persons, places):
        for k, (aim, target) in aims:
            named = {"person": who, "target": aim, "layout": where}
            named = {factor: name for factor, name in named.items() if name}
            variant = Variant(make, person, target, layout)
            asked = fingerprint(marks[who], target, layout, running.method, warm_start) if store else ""
            record = SolveRecord(", ".join(named.values()), factors=named)
            cases.append(Case(record, variant, asked, (i, j, k)))
    return cases, warm_start, running, store


def _check_takes_three(task: Any, what: str) -> None:
    """Refuse a function that cannot be called with a figure, a target and a layout."""
    try:
        signature = inspect.signature(task)
    except ValueError:  # a compiled function tells nothing
        return
    try:
        signature.bind(None, None, None)
    except TypeError:
        raise InputError(
            f"{what} takes {signature}; give one that takes a figure, a target and a layout, also where these do "
            "not vary: def task(figure, target, layout)"
        ) from None


@dataclass(frozen=True)
class Variant:
    """Makes the problem of one case, in the process that solves it."""

    make: Any
    person: Any
    target: Any
    layout: Any

    def __call__(self) -> Problem:
        """Make the problem."""
        person = self.person
        if isinstance(self.make, TaskFile):
            return self.make(person, self.target, self.layout)
        figure = loaded(_fixed(person)) if isinstance(person, Mapping) else person
        made: Problem = self.make(figure, self.target, self.layout)
        _check_of(figure, made)
        return made


def _check_of(figure: Figure | None, made: Any) -> None:
    """Refuse a problem of people among whom the one that the task was given is not: all cases would be one body."""
    given = None if figure is None else figure.describe().person
    if given is None or not isinstance(made, Problem):
        return
    own = made.scene.figure
    bodies = [one.describe().person for one in (own, *(member.figure for member in own.members.values()))]
    sizes = {(body.sex, body.stature, body.mass) for body in bodies if body is not None}
    if sizes and (given.sex, given.stature, given.mass) not in sizes:
        raise InputError(
            f"the task's problem is of {own.name!r} of another size than the figure that the task was given; "
            "pose that one: wb.Scene(figure)"
        )


@lru_cache(maxsize=64)
def loaded(options: tuple[tuple[str, Any], ...]) -> Figure:
    """A person by options of `load`, made once a process."""
    return load("human", **{name: dict(value) if name == "proportions" else value for name, value in options})


def _fixed(person: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """Options in a form that can be looked up."""
    return tuple(
        (name, tuple(sorted(value.items())) if isinstance(value, Mapping) else value)
        for name, value in sorted(person.items())
    )


def options_of(given: Any) -> Any:
    """A figure as it is, or options of `load`."""
    if isinstance(given, Figure):
        return given
    if isinstance(given, str):
        cases = design_cases()
        body = cases[checks.known(given, cases, "design case", "study: people")]
        return {"sex": body.sex, "stature": body.stature, "mass": body.mass}
    if isinstance(given, Mapping):
        # Wrong options are refused before anything is computed. A body takes a hundred times as long as who it is of.
        named = {name: value for name, value in given.items() if name != "called"}
        size, rest = ({name: value for name, value in named.items() if (name in SIZE) is own} for own in (True, False))
        try:
            loaded(_fixed(rest))
            make_person(**size)
            return dict(given)
        except TypeError:  # of options that no dictionary of arguments has
            pass
    raise InputError(f"study: a person is {checks.shown(given)}; give 'F5', {{'sex': 'female'}} or a figure")


def loaded_person(given: Any) -> Person | None:
    """Whose body a person of a study is; None of a figure that is no person."""
    if isinstance(given, Figure):
        return given.describe().person
    options = options_of(given)
    return make_person(**{name: options[name] for name in SIZE if name in options})


def _named(given: Any, what: str) -> dict[str, Any]:
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {checks.text(name, f"{what}: a name"): value for name, value in given.items()}
    found: dict[str, Any] = {}
    for value in checks.listed(given, what, "[...], or values by name"):
        name, number = _words(value), 2
        while name in found:
            name, number = f"{_words(value)} ({number})", number + 1
        found[name] = value
    return found


def _words(value: Any) -> str:
    """A value as the name of a case."""
    if isinstance(value, Figure):
        return value.name
    if isinstance(value, Mapping):
        return " ".join(f"{_word(key)}={_word(part)}" for key, part in value.items())
    if isinstance(value, Iterable) and not isinstance(value, str) and getattr(value, "shape", (1,)) != ():
        return " ".join(map(_word, value))
    return _word(value)


def _word(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else checks.shown(value)


def _source(task: Any) -> Any:
    """What tells one task function from another: its code and what it is bound to."""
    try:
        return inspect.getsource(task), packed(task)
    except (OSError, TypeError):
        return packed(task)

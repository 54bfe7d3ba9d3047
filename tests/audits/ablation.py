"""Which constants and mechanisms of a method matter: each changed or switched off, on problems that stay the same.

Counts do not depend on the machine; the processor's time is compared as a ratio to that of the unchanged method in the
same run. A constant that changes no answer when it is halved and doubled decides nothing here.
"""

from __future__ import annotations

import ast
import math
import pkgutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from wholebody.base.arrays import Array, as_dict, with_values
from wholebody.bench.rows import Row
from wholebody.bench.rows import report as tables_of
from wholebody.bench.suite.problem_sets.registry import NAMED, SETS
from wholebody.bench.suite.stability.catalogue import Posed, cases
from wholebody.methods.solve import method_named
from wholebody.problem import Problem

Value = float | int | tuple[float, ...]

FACTORS = {"halved": 0.5, "doubled": 2.0}


@dataclass(frozen=True)
class Constant:
    """A number, or several, that a module gives a name in capitals, or a field of a record with one: "NAME.field"."""

    module: str
    name: str
    value: Value

    def times(self, factor: float) -> Value:
        """The value times a factor; whole numbers stay whole and at least one."""
        if isinstance(self.value, tuple):
            return tuple(_times(each, factor) for each in self.value)
        return _times(self.value, factor)


@dataclass(frozen=True)
class Outcome:
    """What a method did with all problems together: those solved, goal errors left [m, rad], processor seconds."""

    solved: int
    iterations: int
    left: float
    seconds: float
    answers: tuple[Array, ...]

    def differ(self, other: Outcome) -> int:
        """How many answers differ, in any digit."""
        return sum(not np.array_equal(a, b) for a, b in zip(self.answers, other.answers, strict=True))


def constants(method: str) -> tuple[list[Constant], list[str]]:
    """Constants of a method but those of tracking, and the modules whose constants are compiled in and stay."""
    package = import_module(f"wholebody.methods.{method}")
    names = [found.name for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
    names = [name for name in names if not name.endswith(".tracking")]  # no step is asked for here
    shared = "wholebody.methods.starts", "wholebody.geometry.continuous.passing_through"
    return constants_in((*names, *shared))


def constants_in(modules: Iterable[str]) -> tuple[list[Constant], list[str]]:
    """Constants of modules by name, and those modules whose constants are compiled in; see `constants`."""
    found: list[Constant] = []
    compiled: list[str] = []
    for name in modules:
        try:
            module = import_module(name)
        except ModuleNotFoundError as missing:
            if missing.name is not None and missing.name.startswith("wholebody"):
                raise
            continue  # of an optional package that is not installed
        mine = [one for each in _assigned(module) for one in _constants(name, each, getattr(module, each))]
        mine = [each for each in mine if _is_number(each.value)]
        if mine and any(hasattr(value, "signatures") for value in vars(module).values()):  # loops of numba
            compiled.append(name)
        else:
            found += mine
    return found, compiled


def problems(count: int, method: str) -> list[Problem]:
    """The first problems of every still set, and the hard cases that are solved once: those that the method takes."""
    still = {name: each for name, each in {**SETS, **NAMED}.items() if not each.moving and name != "robots"}
    made = [each.make(number, seed=5).problem for each in still.values() for number in range(count)]
    posed = [given.problem for given in (case.question() for case in cases()) if isinstance(given, Posed)]
    solver = method_named(method)
    return [problem for problem in made + posed if solver.accepts(problem) is None]


def outcome(method: str, given: Sequence[Problem]) -> Outcome:
    """Solve all problems."""
    solver = method_named(method)
    began = time.process_time()
    solutions = [solver.solve(problem) for problem in given]
    seconds = time.process_time() - began
    left = sum(each.assessment.goal_error + each.assessment.goal_angle for each in solutions)
    return Outcome(
        sum(each.solved for each in solutions),
        sum(each.iterations for each in solutions),
        float(left),
        seconds,
        tuple(each.q for each in solutions),
    )


def ablation(
    method: str,
    given: Sequence[Problem],
    mechanisms: Mapping[str, tuple[Any, str, Any]],
    tell: Callable[[str], None],
) -> tuple[Outcome, list[Row]]:
    """Change one thing after the other; return what the method does unchanged, and a row a change; tell them.

    `mechanisms` are what is switched off by name: an owner, its attribute, and what takes its place.
    """
    outcome(method, given)  # what is compiled or loaded at first use
    whole = outcome(method, given)
    rows: list[Row] = []
    before = whole.seconds

    def note(what: str, change: str, now: Outcome, unchanged: float) -> None:
        figures = {
            "answers that differ": now.differ(whole),
            "solved": now.solved - whole.solved,
            "iterations": now.iterations - whole.iterations,
            "left m, rad": now.left - whole.left,
            "time": now.seconds / unchanged,
        }
        rows.append(Row(what, change, figures))
        tell(f"{what}, {change}: {figures}")

    for name, (owner, attribute, instead) in mechanisms.items():
        with replaced([(owner, attribute)], instead):
            now = outcome(method, given)
        after = outcome(method, given).seconds
        note(name, "off", now, 0.5 * (before + after))  # the machine's speed drifts
        before = after
    for constant in constants(method)[0]:
        for change, factor in FACTORS.items():
            value = constant.times(factor)
            if value != constant.value:
                with changed(constant, value):
                    now = outcome(method, given)
                name = f"{constant.module.removeprefix('wholebody.methods.')}.{constant.name}"
                note(name, change, now, before)
    return whole, rows


def mechanisms(method: str) -> dict[str, tuple[Any, str, Any]]:
    """What a method can do without, by name; empty where nothing is listed."""
    if method != "qp":
        return {}
    from wholebody.methods.qp import closest, feasibility, multistart, sqp
    from wholebody.methods.qp import method as qp
    from wholebody.methods.qp import search as descents
    from wholebody.methods.qp.feasibility import Feasibility
    from wholebody.methods.qp.solvers import base
    from wholebody.methods.qp.solvers.base import WorkingSet
    from wholebody.terms import linearisation

    search, descent, corrected = multistart.QPMultistart, sqp.SQP, WorkingSet._corrected

    def plain(self: multistart.QPMultistart, start: Array) -> Any:
        probe = self._probe(start, 0.0)
        self._minima.add(probe.violation.total, probe.converged)
        return self._descend(probe.q, "restart") if probe.violation.worst <= self.settings.tolerance else probe

    def cold(self: WorkingSet, *given: Any) -> Any:
        self.reset()
        return corrected(self, *given)

    return {
        "watchdog": (descent, "_is_tentative", lambda self, here, there: False),
        "normal and tangential parts": (sqp, "parts_of", lambda *given: None),
        "Lagrangian in the judgement of steps": (sqp, "lagrangian", lambda multipliers, measure, rows: measure),
        "supporting planes": (linearisation, "term_planes", lambda terms, counts, state: None),
        "second derivatives of contacts": (descent, "_bent", lambda self, here: here.at),
        "warm start from the last active set": (WorkingSet, "_corrected", cold),
        "seeds of arms": (qp, "from_seeds", lambda *given: None),
        "before contact": (multistart, "before_contact", lambda *given, **options: iter(())),
        "feasibility first": (search, "feasibility_first", lambda self, start: self.directly(start)),
        "turning on to the other limit": (Feasibility, "_turned_on", lambda self, here, program, step, wrapped: None),
        "contradictions of goals": (multistart, "contradictions", lambda problem, workspace: ()),
        "hooked hands": (multistart, "hooked_hands", lambda problem, state, start: iter(())),
        "leaving contacts that cancel": (multistart, "posture_apart", lambda problem, workspace, q: None),
        "multipliers": (sqp, "DESCENT", with_values(sqp.DESCENT, near_met=0.0)),
        "working sets that grow": (base, "CORRECTIONS", with_values(base.CORRECTIONS, near=-1e9)),
        "end of probes that stall": (feasibility, "stalls", lambda history, tolerance: False),
        "Latin hypercube": (descents, "throughout", descents.restarts),
        "closest posture: curvature": (
            closest.Closest,
            "_curvature",
            lambda self, rows, push: (rows.soft[:0], rows.soft_error[:0]),
        ),
        "probes without relaxation": (search, "_relaxed", plain),
        "relaxed probes": (search, "_relaxed", lambda self, start: None),
        "test of out of reach": (search, "_seems_out_of_reach", lambda self, q: False),
        "closest posture to goals that are not met": (search, "_find_closest", lambda self: None),
        "closest posture past things": (search, "_pass_things", lambda self, count: None),
        "closest posture among things": (search, "_closest_from_best", lambda self: None),
    }


def _times(value: float | int, factor: float) -> float | int:
    return max(1, round(factor * value)) if isinstance(value, int) else factor * value


def _assignments(module: ModuleType) -> Iterator[tuple[tuple[str, ...], ast.expr]]:
    """Names that a module assigns at its top, and the expression that they are given."""
    for node in ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target = node.targets[0]
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            yield tuple(each.id for each in names if isinstance(each, ast.Name)), node.value


def _assigned(module: ModuleType) -> list[str]:
    """Names in capitals that a module assigns itself."""
    return [name for names, _ in _assignments(module) for name in names if name.isupper()]


def _constants(module: str, name: str, value: Any) -> list[Constant]:
    """What a module gives a name: a constant, or those of a record."""
    if hasattr(value, "_fields"):
        return [Constant(module, f"{name}.{field}", each) for field, each in as_dict(value).items()]
    return [Constant(module, name, value)]


def _is_number(value: Any) -> bool:
    parts = value if isinstance(value, tuple) else (value,)
    return bool(parts) and all(
        isinstance(part, int | float) and not isinstance(part, bool) and math.isfinite(part) for part in parts
    )


def places(constant: Constant) -> list[tuple[Any, str]]:
    """The module of a constant or of its record, and those that import it by its name."""
    owner, name = sys.modules[constant.module], constant.name.partition(".")[0]
    value = getattr(owner, name)
    others = [
        module
        for known, module in sys.modules.items()
        if known.startswith("wholebody.") and module is not owner and vars(module).get(name) is value
        and name not in _assigned(module)
    ]  # fmt: skip
    return [(module, name) for module in (owner, *others)]


@contextmanager
def changed(constant: Constant, value: Value) -> Iterator[None]:
    """Give a constant another value for a while, wherever it was imported, and what its module made of it at import."""
    owner, (name, _, field) = sys.modules[constant.module], constant.name.partition(".")
    given = with_values(getattr(owner, name), **{field: value}) if field else value
    with ExitStack() as stack:
        stack.enter_context(replaced(places(constant), given))
        anew = {name}
        for names, expression in _assignments(owner):
            used = {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}
            if used & anew and len(names) == 1:
                made = eval(compile(ast.Expression(expression), str(owner.__file__), "eval"), vars(owner))
                stack.enter_context(replaced(places(Constant(constant.module, names[0], made)), made))
                anew.add(names[0])
        yield


@contextmanager
def replaced(places: Sequence[tuple[Any, str]], value: Any) -> Iterator[None]:
    """Put something in the place of attributes for a while."""
    before = [getattr(owner, name) for owner, name in places]
    for owner, name in places:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for (owner, name), old in zip(places, before, strict=True):
            setattr(owner, name, old)


def report(
    method: str, given: int, whole: Outcome, rows: Sequence[Row], compiled: Sequence[str], facts: Mapping[str, str]
) -> str:
    """The counts as Markdown: mechanisms, constants that matter by what they change, and those that change nothing."""
    changes = [row for row in rows if row.tool != "off"]
    matter = [row for row in changes if row["answers that differ"]]
    unnoticed = dict.fromkeys(row.case for row in changes if row.case not in {each.case for each in matter})
    about = (
        f"{method} on {given} problems: {whole.solved} solved, {whole.iterations} iterations, {whole.left:.4g} m and "
        f"rad left, {whole.seconds:.3g} s of the processor. Columns are changes of these, and the ratio of the times."
    )
    notes = [f"Half and twice of these changed no answer: {', '.join(unnoticed) or 'none'}."]
    notes += [f"Compiled in, and not changed: the constants of {', '.join(compiled)}."] if compiled else []
    switched = [row for row in rows if row.tool == "off"]
    return tables_of(about, {"Mechanisms": switched, "Constants": matter}, facts, notes)

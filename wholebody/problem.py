"""A problem: scene, start, goals, constraints and measures, stated once and checked."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from operator import is_
from typing import Any, TypeVar

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.charts import listing
from wholebody.base.errors import InputError, TermError
from wholebody.base.fields import Range
from wholebody.base.pool import Loan
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace, borrowed
from wholebody.tasks.answers import in_words, is_own
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.checks import KINDS, check_frozen, check_own, checked_terms, owner_pair, start_posture
from wholebody.tasks.defaults import alike, seen, standing, usual_constraints, usual_measures
from wholebody.tasks.inputs import once
from wholebody.terms.linearisation import Lineariser
from wholebody.terms.plan import TermPlan, Terms, make_plan

CLEARANCE = Range(0.0, 0.5, "m")  # more is refused as a wrong unit
_Term = TypeVar("_Term", Constraint, Measure)
_TermError = TypeVar("_TermError", bound=TermError)
_Planned = tuple[tuple[Constraint, ...], tuple[Bound, ...], tuple[Measure, ...]]


class Problem(checks.FixedAttributes):
    """Scene, start, goals, constraints and measures, in the same form for every method.

    Joint limits and non-penetration are part of every problem. A person keeps its `RangeOfMotion` and `ReachCones`, and
    its `Balance` if it stands: both feet are held in the world where they are at the start, and nothing else carries
    it, that is, no other frame is held in the world and the root is not frozen. What is stated takes the place of a
    default.

    A pair that is nearer than the clearance at the start, but does not penetrate (soles on a floor, a hand on a table),
    must keep its distance. A pair that penetrates at the start must reach the full clearance.

    Attributes:
        scene: figure and things.
        start: (nq,) the start posture.
        goals, constraints, bounds, measures: the terms, resolved on this scene and start.
        defaults: the constraints that were not stated; methods that cannot take one leave it to the assessment.
        left_out: which default makes no sense at the start and is left out, and why, in words; "" where none is.
        measures_given: whether the caller gave measures; false if they are the default.
        clearance: least distance of every pair, metres.
        touching: pairs of segment or object names whose clearance is zero.
        range_of_motion, balance: as they were given.
        clearances: (pairs,) least distance of each collision pair of the scene, metres; may be changed between runs.

    `start`, `clearances` and resolved terms of another problem may be set; `retarget` takes new goals. The other
    attributes cannot be set.

    Threads may solve and assess one problem at the same time; only one thread may change it. It can be pickled; a copy
    shares the scene, a deep copy has its own.

    Examples:
        >>> reach = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.55, -0.25, 0.95))], clearance=0.005)
    """

    _settable = frozenset({"start", "goals", "constraints", "bounds", "measures", "measures_given", "clearances"})
    _correction = "state another problem with wb.Problem(...)"

    scene: Scene
    start: Array
    goals: tuple[Goal, ...]
    constraints: tuple[Constraint, ...]
    bounds: tuple[Bound, ...]
    measures: tuple[Measure, ...]
    defaults: tuple[Constraint, ...]
    left_out: str
    measures_given: bool
    clearance: float
    touching: tuple[tuple[str, str], ...]
    range_of_motion: bool
    balance: bool | None
    clearances: Array
    _plan: tuple[_Planned, TermPlan] | None
    """The terms as arrays, and the terms that they were made of; every solve begins with it."""
    _known: tuple[Goal, ...]
    _joined: tuple[Constraint, ...]  # the goals that the defaults are of, and the constraints with these defaults
    _places: tuple[int, ...]
    _rest: Array  # (nq,) the start that the problem was stated with, which the defaults are of
    _revision: int
    _usual: tuple[Measure, ...] | None  # the measures by default; None where others were stated

    def __init__(
        self,
        scene: Scene,
        start: Array | str | Mapping[str, Array | str] | None = None,
        *,
        goals: Iterable[Goal] = (),
        constraints: Iterable[Constraint | Bound] = (),
        measures: Iterable[Measure] | None = None,
        clearance: float = 0.0,
        touching: Iterable[tuple[str, str]] = (),
        range_of_motion: bool = True,
        balance: bool | None = None,
    ) -> None:
        """State a problem.

        Args:
            scene: figure and things.
            start: (nq,) posture, or the name of one; of several figures also one by figure; None for the first posture.
            goals: equalities that are met if possible.
            constraints: what must always hold; bounds on the displacement are given here too.
            measures: costs to minimise; None for `Effort()`, of a person also `Rhythm()`, `Stance()`, `Hang()`,
                `LevelHead()`, and of who sits `SeatCenterline()`.
            clearance: least distance between pieces, metres.
            touching: pairs of segment or object names whose clearance is zero; those of contact terms are added.
            range_of_motion: whether a person keeps its ranges of motion and reach cones, and moves in its `Rhythm`.
            balance: whether the centre of mass stays above the feet; None if the figure is a person who stands.

        Raises:
            InputError: a value of the wrong kind, shape or range.
            UnknownNameError: a name that the figure or scene does not have.
        """
        scene = checks.instance(scene, Scene, "Problem: scene", "make one with wb.Scene(figure)")
        q = start_posture(scene, start)
        listed = checked_terms(goals, (Goal,), "goals")
        given = checked_terms(constraints, (Constraint, Bound), "constraints")
        measured = None if measures is None else checked_terms(measures, (Measure,), "measures")
        pairs = checks.listed(touching, "touching", "[('right_hand', 'table')]")
        vars(self).update(  # a tenth of the time of setting one after the other
            scene=scene,
            _revision=scene.revision,
            start=q,
            _rest=q,
            clearance=CLEARANCE(clearance, "clearance"),
            measures_given=measures is not None,
            range_of_motion=checks.flag(range_of_motion, "range_of_motion"),
            balance=balance if balance is None else checks.flag(balance, "balance"),
            goals=tuple([goal.resolve(scene, q) for goal in listed]),
            bounds=tuple([term.resolve(scene, q) for term in given if isinstance(term, Bound)]),
            touching=tuple([owner_pair(scene, pair) for pair in pairs]),
            defaults=(),
            _usual=None if measured is not None else (),
            _places=tuple([place for place, term in enumerate(given) if isinstance(term, Constraint)]),
            _plan=None,
        )
        own = self._resolved([given[place] for place in self._places])
        costs = self._resolved(measured or ())
        vars(self).update(constraints=own, _joined=own, measures=costs)
        vars(self).update(self._by_default(self.goals))
        if self.bounds or any(map(is_own, (*self.goals, *own, *costs))):
            check_frozen(self.bounds, scene, state := scene.state(q))
            check_own(state, goals=self.goals, constraints=self.constraints, measures=self.measures)
        vars(self).update(clearances=self._clearances(self.goals))

    def _by_default(self, goals: tuple[Goal, ...]) -> dict[str, Any]:
        """Attributes that follow from the terms that were stated, with these resolved goals."""
        stated, measured, joined = self.stated, self.measures is self._usual, self.constraints is self._joined
        make = partial(self._usual_terms, stated, goals, measured, joined)
        told = tuple(map(seen, goals))
        # own terms may change, and others are not told from those of another statement
        if self.bounds or any(map(is_, told, goals)) or any(map(is_own, (*stated, *goals))):
            measures, (defaults, left_out) = make()
        else:
            asked = measured, joined, self.range_of_motion, self.balance
            key = "defaults", asked, stated, told, self._rest.tobytes()
            measures, (defaults, left_out) = once(self.scene, key, make)
        found: dict[str, Any] = {"goals": goals, "_known": goals}
        if measured:
            found.update(measures=measures, _usual=measures)
        if joined:
            constraints = self.constraints if defaults is self.defaults else (*stated, *defaults)
            found.update(constraints=constraints, _joined=constraints, defaults=defaults, left_out=left_out)
        return found

    def _usual_terms(
        self, stated: tuple[Constraint, ...], goals: tuple[Goal, ...], measured: bool, joined: bool
    ) -> tuple[tuple[Measure, ...], tuple[tuple[Constraint, ...], str]]:
        """The measures and the constraints by default of resolved terms; none of those that were stated or set."""
        scene, at = self.scene, self._rest
        terms: list[Constraint | Goal] = [*stated, *goals]
        stands = standing(scene, at, terms, self.bounds)
        ranges, balance = self.range_of_motion, self.balance
        measures = usual_measures(scene, at, terms, self.bounds, stands, ranges=ranges) if measured else ()
        if not joined:
            return measures, ((), "")
        return measures, usual_constraints(scene, at, stated, stands, ranges=ranges, balance=balance)

    def _resolved(self, terms: Sequence[_Term]) -> tuple[_Term, ...]:
        """Terms that were stated, resolved; the same ones in the same scene at the same start are known."""
        if not terms:
            return ()
        found = (term.resolve(self.scene, self.start) for term in terms)
        key = self.start.tobytes(), *((type(term), *vars(term).values()) for term in terms)
        try:
            hash(key)
        except TypeError:  # arrays and placements
            return tuple(found)
        return tuple(found) if any(map(is_own, terms)) else once(self.scene, key, partial(tuple, found))

    def _in_words(self) -> tuple[str, dict[str, list[str]]]:
        things, pairs = len(self.scene.objects), len(self.clearances)
        counts = f"{things} things, {pairs} pairs, clearance {1e3 * self.clearance:g} mm"
        terms = {"goals": self.goals, "constraints": (*self.constraints, *self.bounds), "measures": self.measures}
        words = {name: [in_words(term) for term in given] for name, given in terms.items()}
        return f"Problem of {self.scene.figure.name!r} among {counts}", words

    def __repr__(self) -> str:
        heading, words = self._in_words()
        goals, constraints, measures = (checks.some(each) or "none" for each in words.values())
        return f"{heading}\n  goals: {goals}\n  constraints: {constraints}; measures: {measures}"

    def _repr_html_(self) -> str:
        return listing(*self._in_words())

    def _checked_value(self, name: str, value: Any) -> Any:
        """What is set after the problem was stated: a posture, clearances, or terms that are resolved already."""
        if name == "start":
            return checks.posture(value, self.scene.model.nq, "start")
        if name == "clearances":
            return checks.array(value, name, "one number a collision pair, metres").copy()
        if name == "measures_given":
            return checks.flag(value, name)
        terms = checked_terms(value, KINDS[name], name)
        for number, term in enumerate(terms):
            if is_dataclass(term) and not all(hasattr(term, field.name) for field in fields(term)):
                correction = "give it to problem.retarget([...])" if name == "goals" else self._correction
                raise InputError(f"{name}[{number}] is a {type(term).__name__} that is not resolved; {correction}")
        return tuple(terms)

    @property
    def stated(self) -> tuple[Constraint, ...]:
        """The constraints without the defaults."""
        added = {id(term) for term in self.defaults}
        return tuple([term for term in self.constraints if id(term) not in added]) if added else self.constraints

    @property
    def constraint_names(self) -> tuple[str, ...]:
        """What messages call each constraint: where it stood in the list that was given, its class and its frame.

        A default of a person, which stood nowhere, is called by its class alone. Constraints that were set afterwards
        are counted as they were set.
        """
        if not self.constraints:
            return ()
        defaults = {id(term) for term in self.defaults}
        count = sum(id(term) not in defaults for term in self.constraints)
        places = iter(self._places if len(self._places) == count else range(count))
        found = []
        for term in self.constraints:
            frame = getattr(term, "frame", None)
            name = type(term).__name__ + (f"({frame!r})" if frame else "")
            found.append(f"{name} (by default)" if id(term) in defaults else f"constraints[{next(places)}], {name}")
        return tuple(found)

    def placed(self, error: _TermError) -> _TermError:
        """The same error of a term, with the term's place in this problem in front: "goals[1] (Mine)"."""
        groups = (("goals", self.goals), ("bounds", self.bounds), ("measures", self.measures))
        names: list[tuple[str, object]] = [*zip(self.constraint_names, self.constraints, strict=True)]
        names += [(f"{what}[{n}] ({in_words(term)})", term) for what, terms in groups for n, term in enumerate(terms)]
        found = next((name for name, term in names if term is error.term), error.name)
        return type(error)(error.term, found, error.reason)

    def retarget(self, goals: Iterable[Goal]) -> None:
        """Replace the goals, for a goal that moves from frame to frame.

        Goals of other kinds or frames have other defaults: a free arm hangs, who sits keeps no balance, and pairs that
        a goal brings together have no clearance. What was stated or set stays; all stays if a new goal is refused.

        Raises:
            InputError: not a list of goals, or a goal with a value of the wrong kind, shape or range.
            UnknownNameError: a name that the figure does not have.
        """
        listed = checked_terms(goals, (Goal,), "goals")
        resolved = tuple(goal.resolve(self.scene, self.start) for goal in listed)
        if any(map(is_own, resolved)):
            with self.borrow() as workspace:
                check_own(workspace.state.update(self.start), goals=resolved)
        found: dict[str, Any] = {"goals": resolved}
        if not alike(resolved, self._known):  # others may have been set since
            self.check_fresh()
            found = self._by_default(resolved)
            if any(goal.touching for goal in (*resolved, *self._known)):
                stays = self.clearances != self._clearances(self._known)  # which were set
                found["clearances"] = np.where(stays, self.clearances, self._clearances(resolved))
        vars(self).update(found)  # they need no other check

    def with_start(self, q: Array) -> Problem:
        """Copy with another start; terms that were resolved at the old start stay.

        Args:
            q: (nq,) the posture.

        Raises:
            InputError: q has the wrong shape or a value that is not finite.
        """
        result = copy.copy(self)
        result._plan = self._plan
        result.start = checks.posture(q, self.scene.model.nq, "with_start: q")
        self.scene.figure.warn_of_angles(result.start, "with_start: q")
        return result

    def __getstate__(self) -> dict[str, Any]:
        """All but what a solve has added: a problem is the same problem before and after it."""
        return {**vars(self), "_plan": None}

    def borrow(self) -> Loan[Workspace]:
        """Borrow a workspace on this problem's scene for one run; see `Scene.borrow`.

        Raises:
            InputError: objects were added to or removed from the scene after the problem was made.
        """
        return borrowed(self.scene.built, self._begin)

    def _begin(self, workspace: Workspace) -> None:
        workspace.begin()
        self.check_fresh()  # after borrowing: later changes of the scene do not change the workspace

    def workspace(self) -> Workspace:
        """A new workspace for a long-lived object; see `Scene.workspace`.

        Raises:
            InputError: objects were added to or removed from the scene after the problem was made.
        """
        workspace = self.scene.workspace()
        self.check_fresh()
        return workspace

    def lineariser(self, workspace: Workspace, dt: float | None = None) -> Lineariser:
        """A lineariser of this problem, with its present terms and clearances.

        Args:
            workspace: from this problem's `borrow` or `workspace`.
            dt: time step in seconds, for bounds that need one.
        """
        state = workspace.state.update(self.start)  # where terms of one's own tell how many rows they have
        return Lineariser(
            workspace,
            self.scene.figure.limits,
            Terms(self.goals, self.constraints, self.bounds, self.measures),
            self.clearances,
            dt,
            self._planned(state) if dt is None else None,
        )

    def _planned(self, state: State) -> TermPlan:
        """The plan of the present constraints, bounds and measures, and of some goals; made when they are new."""
        terms = (self.constraints, self.bounds, self.measures)
        if self._plan is None or not all(map(is_, self._plan[0], terms)):
            self._plan = terms, make_plan(self.scene.figure.limits, Terms(self.goals, *terms), None, state)
        return self._plan[1]

    def check_fresh(self) -> None:
        """Refuse a problem that is out of date; things may be moved and clearances changed.

        Raises:
            InputError: objects were added or removed after the problem was made, or clearances are wrong.
        """
        self.check_scene()
        asked, count = self.clearances, len(self.scene.built.table.pairs)
        if asked.shape != (count,):
            raise InputError(f"clearances have shape {asked.shape}; give one for each of the {count} pairs")
        fits = (asked >= 0.0) & (asked <= CLEARANCE.high)
        if 0 in fits.tobytes():  # in a tenth of the time of a reduction
            wrong = int(np.argmin(fits))
            raise InputError(f"clearances[{wrong}] is {asked[wrong]}; give numbers between {CLEARANCE}")

    def check_scene(self) -> None:
        """Refuse a problem whose scene has other things now, by an InputError."""
        if self.scene.revision != self._revision:
            raise InputError("objects came to or left the scene after the problem was stated; state the problem anew")

    def _clearances(self, goals: tuple[Goal, ...]) -> Array:
        """(pairs,) the clearance of each with these goals, as it follows from what was stated."""
        built = self.scene.built
        if self.clearance == 0.0:  # which no pair has less than
            return np.zeros(len(built.table.pairs))
        brought = [pair for term in (*goals, *self.constraints, *self.measures) for pair in term.touching]
        allowed = frozenset((*self.touching, *brought))
        key = "clearances", self.clearance, allowed, built.moves, self._rest.tobytes()
        return np.array(built.known(key, partial(self._asked, allowed)))

    def _asked(self, allowed: frozenset[tuple[str, str]]) -> Array:
        """(pairs,) the clearance of each: none of those that may touch, the distance at the start of those at rest."""
        built = self.scene.built
        asked = np.full(len(built.table.pairs), self.clearance)
        if allowed:
            asked[built.known(("touching", allowed), partial(built.between, allowed))] = 0.0
        with borrowed(built) as workspace, self.scene.figure.posed(self._rest) as state:
            near = workspace.proximity.query_views(state.data, self.clearance + 1e-9)
            resting = near.distance >= -1e-6  # the others penetrate
            number = near.number[resting]
            asked[number] = np.minimum(asked[number], np.maximum(near.distance[resting], 0.0))
        return asked

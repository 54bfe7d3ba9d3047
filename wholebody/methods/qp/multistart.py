"""Multistart: attempts until one meets the goals; where none does, the closest posture is sought."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array, with_values
from wholebody.methods.contradictions import NEAREST, contradictions, least_left
from wholebody.methods.control import Control
from wholebody.methods.qp.closest import ENDLESS, Closest, reach_trials
from wholebody.methods.qp.iterates import LocalSolution, held
from wholebody.methods.qp.search import Search
from wholebody.methods.qp.settings import SEARCH, SEEDS, Settings
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.sqp import SQP
from wholebody.methods.qp.start_postures import at_its_place, before_contact, posture_apart
from wholebody.methods.starts import Attempt, alike, arms_ahead, crouched, hooked_hands, least_effort, restarts, seated
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace

MUCH = 2 / 3  # share of what the start misses: where postures miss less, few goals are met from the start alone


class QPMultistart(Search):
    """The search for one problem."""

    def __init__(
        self, problem: Problem, workspace: Workspace, solver: QPSolver, settings: Settings, control: Control
    ) -> None:
        super().__init__(problem, workspace, solver, settings, control)
        self._least = 0.0  # lower bound of the goals' residual, metres
        self._in_contact, self._seats = list[float](), list[Array]()  # violations from before contact; (nq,) nearer
        self._touches = any(hasattr(term, "touches") for term in (*problem.goals, *problem.constraints))  # contacts
        self._ahead, self._through_measure = self._from_ahead(), 0.0  # starts; of what meets the goals through things
        self._doubtful = self.out_of_reach = False  # whether the start may lead lower than a squat; as it seems

    def run(
        self, begin: tuple[Array, ...] = (), other: Array | None = None, near: tuple[Array, ...] = (),
        rest: float = 0.0, least: float = 0.0,
    ) -> LocalSolution:  # fmt: skip
        """The best of attempts, from `begin` first, and a descent from `other`; out of reach, the closest to `near`."""
        # `rest`: residual at which descents through things rest; `least`: measures where the goals are known to be met,
        # if through things; 0 where nothing is known
        self.out_of_reach, self._through_measure = bool(near), least
        if not near:
            self.search(self._attempts(begin))
            other = self._start if self._doubtful and self.how == "from a squat" else other
        else:
            self.contradictions = contradictions(self.problem, self.lineariser.workspace)
            self._least, self._rest = least_left(self.contradictions) or 0.0, max(rest, SEEDS.deep)
        for q in near:
            self.accept(self._ran(self._closest(), q))
            if self._proven():
                break
        if near and self.settings.measures and self.solves(self.best):
            self.accept(self._descend(self.best.q))
        if other is not None:
            self.accept(self.directly(other), "directly")
        self._find_closest()
        self._go_on()
        self._seek_lower(max(self.settings.restarts_for_measure, SEARCH.poor if self._descend_again() else 0))
        self._to_the_left()
        if self.best.violation.worst <= self.settings.tolerance:
            self.contradictions = ()  # by less than the tolerance
        settled = self.out_of_reach or self.best.converged  # although a closer posture may be near
        return with_values(self.best, converged=settled and not self.control.reason)

    def enough(self) -> bool:
        """Whether the programs are spent, or the best is as near to the goals as others, or known to be the closest."""
        return alike(self._in_contact) or super().enough() or self._proven()

    def _attempts(self, begin: tuple[Array, ...]) -> Iterator[Attempt[LocalSolution]]:
        """The attempts in their order; each is decided on when those before it failed."""
        rests, now = least_effort(self.problem, self.lineariser.state), False
        # Who stands begins on the seat, with the hands below a desk or above; who sits, only if it is much nearer.
        seats = ((0.0, "sitting"), *[(0.0, "arms_forward")] * bool(rests), (1.0, "sitting"))
        for given in () if begin else seats:
            on, share = self._nearer(seated(self.problem, self.lineariser.state, self._start, *given))
            self._seats += on if share < SEARCH.nearer else []
            now = now or bool(rests) or share < MUCH
            yield Attempt(on if now else (), self.directly, "from the seat")
        yield Attempt(() if begin else self._low(), self._from_low, "from a squat")
        yield Attempt(begin or [self._start], self.directly, "directly")
        yield Attempt(() if now else self._seats[:1], self.directly, "from the seat")
        yield Attempt(rests, self.directly, "from the posture of least effort")
        self.contradictions = contradictions(self.problem, self.lineariser.workspace)
        if (least := least_left(self.contradictions)) is None:
            return
        self._least = least
        if self.settings.measures and not self._proven():
            yield Attempt(self._ahead, self.directly, "with arms ahead")
            yield Attempt([self._start], self._without_measures, "")
        elif not self._proven():
            yield from self._attempts_for_feasibility()

    def _from_ahead(self) -> Iterator[Array]:
        """Arms that reach, from ahead: hands from below, or led through a desk, end in poorer minima (nq,)."""
        level, ahead = ([*arms_ahead(self.problem, self.lineariser.state, self._start, each)] for each in (True, False))
        starts = chain(self._before_contact(begin=ahead), level, ahead) if self._touches else ()
        yield from self.lineariser.defined(starts)

    def _low(self) -> Iterator[Array]:
        """Who balances in a squat, if goals are nearer from there, and in front of what surfaces are to meet (nq,)."""
        # from upright, descents into what is low end in poor minima: one leg ahead, or bent back
        squats, share = self._nearer(crouched(self.problem, self.lineariser.state, self._start))
        self._doubtful = share >= MUCH
        for q in squats:
            yield from [*self._before_contact(begin=[q])] or [q]

    def _from_low(self, start: Array) -> LocalSolution:
        """A descent from a squat; if it ends inside of things, by feasibility first."""
        local = self.directly(start)
        return local if held(local, self.settings.tolerance) else self.feasibility_first(start) or local

    def _attempts_for_feasibility(self) -> Iterator[Attempt[LocalSolution]]:
        """Those in which measures do not count."""
        start, least, tried, self._first = self._start, self._least, self.tried, len(self.trace)
        yield Attempt(self._before_contact(grips=True), self._gripping, "from before a grip")
        yield Attempt(self._before_contact(), self._into_contact, "from before contact")
        yield Attempt([start], self._closing, "by feasibility first")
        self.out_of_reach = self._seems_out_of_reach(self.best.q)
        if self.out_of_reach or self._proven():
            return
        if not held(self.best, self.settings.tolerance):
            apart = posture_apart(self.problem, self.lineariser.workspace, self.best.q)
            starts = self.lineariser.defined([] if apart is None else [apart])
            yield Attempt(starts, lambda q: self._probe(q, 0.0), "from where contacts that cancel are left")
        # Measures lay limbs beside each other, also before contact; random hands at the face cross, and jam.
        if self.problem.measures and self.tried <= tried + 1:
            relaxed = with_values(self._shared, lineariser=self.lineariser.relaxed(SEARCH.rest_depth))
            rest = SQP(relaxed, self.settings.tolerance, self._at_most(SEARCH.rest_programs), "through things")
            if (local := self._ran(rest, start)).violation.worst <= SEARCH.reached * self.settings.tolerance:
                yield Attempt([local.q], self._free, "from a rest through things")
        restarts = self.settings.restarts
        yield from self._from_elsewhere(min(restarts, SEARCH.inside_probes) if least else restarts)

    def _from_elsewhere(self, count: int) -> Iterator[Attempt[LocalSolution]]:
        """From the seat's edge, turned each way: who fits not below a desk fits beside; then `count` others."""
        edge = seated(self.problem, self.lineariser.state, self._start, 1.0, "arms_forward")
        yield Attempt(self.lineariser.defined(edge), self._free, "from the seat")
        starts = self._seeded(count, self._seats[0] if self._seats else self._start)
        aimed = self.problem.goals and not (self._few() or self._least or self.out_of_reach or self._seats)
        beside = self._beside(min(count, SEARCH.beside) if aimed else 0)
        for _ in range(count):  # in turn: one from beside takes the programs of two others
            yield Attempt(islice(beside, 1), self._free, "from beside the goals")
            # descents by whole steps sit and grip, which probes hardly ever do
            yield Attempt(islice(starts, 2), self.directly if self._seats else self._relaxed, "from another start")

    def _without_measures(self, start: Array) -> LocalSolution | None:
        """Seek a feasible posture so that no measure changes what is reached, and descend; None: nothing but start."""
        settings = replace(self.settings, measures=False)
        found = QPMultistart(self.problem, self.lineariser.workspace, self.solver, settings, self.control)
        found.contradictions, found._least, found._seats = self.contradictions, self._least, self._seats
        found._best = begin = found._ran(found._feasibility(found.lineariser, 0, ""), start)
        found.search(found._attempts_for_feasibility())
        self.count(found)
        self.tried += found.tried
        self.out_of_reach, self._near, self._resting = found.out_of_reach, found._near, found._resting
        if found.best is begin and begin.violation.worst > self.settings.tolerance:
            return None
        return self._descend(found.best.q) if self.accept(found.best, found.how) else found.best

    def _beside(self, count: int) -> Iterator[Array]:
        """Postures whose goals are displaced at random, where descents that pass through nothing lead to (nq,)."""
        rng, most = np.random.default_rng(self.settings.seed), self._at_most(SEARCH.probe_programs)
        for away in rng.normal(0.0, SEARCH.displaced, (count, len(self.subproblem.terms.share))):
            descent = self._descent(most, away, "beside the goals", measures=False, full_step=True)
            yield self._ran(descent, self._start).q

    def _into_contact(self, start: Array) -> LocalSolution:
        """A descent from before contact; where three end alike, the search ends."""
        local = self._descend(start, full_step=True)
        if not local.converged and local.violation.total <= SEARCH.on_its_way:
            local = self._descend(local.q)
        if local.converged and held(local, self.settings.tolerance):
            self._in_contact.append(local.violation.total)
        return local

    def _before_contact(self, grips: bool = False, begin: Sequence[Array] | None = None) -> Iterator[Array]:
        """Postures where surfaces are in front of the faces that they are to meet, or bars in front of palms."""
        given = self.problem, self._shared, self.settings.seed, len(self.trace) + self._left
        for local in before_contact(*given, grips=grips, begin=begin):
            self.spent += local.iterations
            yield local.q

    def _closing(self, start: Array) -> LocalSolution | None:
        """Close hands around bars: from hooked fingers by relaxed probes, then, or without such hands, as they are."""
        for q in self._hooked(start):
            if (local := self._relaxed(q)) is not None and self.accept(local, "from hooked hands"):
                return local
        return self.feasibility_first(start)

    def _gripping(self, start: Array) -> LocalSolution | None:
        """Close hands from before a grip, first so that nothing else changes sides."""
        for q in self._hooked(start) or [start]:
            if self.accept(local := self._free(q), "from before a grip"):
                return local
        return self._closing(start)

    def _hooked(self, start: Array) -> list[Array]:
        """The start with hooked fingers."""
        return [*self.lineariser.defined(hooked_hands(self.problem, self.lineariser.state, start))]

    def _relaxed(self, start: Array) -> LocalSolution | None:
        """A relaxed probe through things, and a descent from where it reaches the goals; None where out of reach."""
        relaxed = self._probe(start, SEARCH.relaxation_depth)
        return self._free(relaxed.q, start) if self.solves(relaxed, SEARCH.reached) else None

    def _free(self, start: Array, other: Array | None = None) -> LocalSolution:
        """A probe with the true clearances, and a descent from where it reaches the goals; `other` is (nq,)."""
        tolerance = self.settings.tolerance
        probe = self._probe(start, 0.0)
        if tolerance < probe.violation.total <= SEARCH.on_its_way and not probe.converged:
            probe = self._probe(probe.q, 0.0)
        if other is not None and not held(probe, tolerance) and not held(self.best, tolerance):
            probe = self._probe(other, 0.0)  # nothing leads out from there; to be outside comes before the goals
        if probe.violation.worst > tolerance:
            return probe
        return self._descend(probe.q, "restart", most=max(self._left, 1))

    def _go_on(self) -> None:
        """Descend on where a descent had spent its programs while the measures still decreased."""
        gains = self.settings.measures and self.best.violation.worst <= self.settings.tolerance
        while gains and not self.best.converged and self._left > 0 and not self.control.over:
            before = self.best.measure
            gains = self.accept(self._descend(self.best.q)) and self.best.measure < SEARCH.moved * before

    def _descend_again(self) -> bool:
        """If contacts are met, descend from beside, at their place and beside a kink; whether it is no minimum."""
        # Descents from a symmetric posture stay symmetric: of a squat they end at a saddle, from which lunges descend.
        # At a kink two points touch at once; the point that counts as the contact should leave.
        problem, tolerance = self.problem, self.settings.tolerance
        if not (self._touches and self.settings.measures and self.best.violation.worst <= tolerance):
            return False
        if self.settings.restarts and self.best.measure > SEARCH.poor_contact:
            for q in self._ahead:  # those that were not tried
                self.accept(self._descend(q), "with arms ahead")
        closes = at_its_place(problem, self.lineariser.state.update(self.best.q)) is None  # fingers: it takes long
        for q in self.lineariser.defined(
            self._aside(self.best.q, each) for each in (() if closes else (1.0, 2.0, 3.0))
        ):
            self.accept(local := self._descend(q))
            if local.violation.worst <= tolerance or self.control.over:
                break
        while self._to_the_place():
            pass
        for share in (0.3, 1.0, 0.1):  # of that step: more leaves more kinks, and comes to other minima
            judged = assess(problem, self.best.q)
            if judged.optimality <= SEARCH.optimal or self.control.over:
                return False
            step = -share * judged.first_order.residual
            start = problem.scene.figure.clamp(np.asarray(pin.integrate(problem.scene.model, self.best.q, step)))
            self.accept(self._ran(self._descent(self.settings.iterations, None, "", tolerance=0.1 * tolerance), start))
        return assess(problem, self.best.q).optimality > SEARCH.optimal

    def _seek_lower(self, count: int) -> None:
        """Where all is met, seek lower minima: `count` from feasible postures, and from those through things."""
        tolerance, measures = self.settings.tolerance, self.settings.measures and self.problem.measures
        if not measures or self.best.violation.worst > tolerance:
            return
        given, found = (self.problem, self.lineariser.state, self._start), list[LocalSolution]()
        seeded = restarts(*given, np.random.default_rng([self.settings.seed, count]), SEARCH.screened * count - 1)
        for q in chain([self._start], self.lineariser.defined(seeded)) if count else ():
            local = None if self.control.over else self._through_things(q, "for measure")
            if local is not None and local.violation.worst <= tolerance:
                found.append(local)
        for local in sorted(found, key=lambda each: each.measure)[:count]:
            self.accept(self._descend(local.q, note="for measure"), "from a start for the measures")
        if not self.settings.restarts or self.best.measure <= 0.0:
            return
        begun, rng = 2 * len(self.trace) + SEARCH.cheap, np.random.default_rng([self.settings.seed, count + 1])
        starts = self.lineariser.defined(restarts(*given, rng, self.settings.restarts))
        others: Iterable[Array] = ()  # a descent to a contact takes ten times as long: only from poor ones
        if self._touches and not count and self.best.measure > SEARCH.poor_contact:
            others = [self._start]  # from there nobody is bent back or astride
        elif not (self._touches or count):
            others = islice(starts, 1, 2)  # half way to the limits
        least = self._through_measure or self._below_things(others)
        for number, q in enumerate(chain(islice(starts, 1), [self._start], starts)):
            dear = np.log(self.best.measure / least) if 0.0 < least < self.best.measure else 0.0
            most = 0 if self._touches else int(SEARCH.dear * dear)
            if number >= most or len(self.trace) > begun or self.control.over:
                break
            self._lower(q)

    def _below_things(self, others: Iterable[Array]) -> float:
        """Seek a lower minimum beside one through things, from the best or others; their least measures, else 0."""
        less, least, before = SEARCH.less_of_contacts if self._touches else SEARCH.less, np.inf, self.best.measure
        for number, q in enumerate(chain([self.best.q], others)):
            if self.best.measure < before or least < before * np.exp(-1.0 / SEARCH.dear):
                break  # lower, or others follow at random
            local = self._through(q, less, feasible=number > 0)
            if local.measure < less * min(self.best.measure, least) and not self.control.over:
                self._lower(local.q)
            least = min(least, local.measure)
        return least if np.isfinite(least) else 0.0

    def _through(self, start: Array, less: float, feasible: bool = False) -> LocalSolution:
        """A descent through things, as long as it may come below a share of the least measures; else these are inf.

        From a `feasible` posture first: far from the goals measures lead to the minimum that is known.
        """
        alone, most = self.lineariser.relaxed(ENDLESS), self._at_most(SEARCH.probe_programs)
        if feasible:
            start = self._ran(self._feasibility(alone, most, "through things"), start).q
        given = with_values(self._shared, lineariser=alone), self.settings.tolerance, most, "through things"
        local = self._ran(SQP(*given, width=SEARCH.width, below=less * self.best.measure, through=True), start)
        met = local.violation.worst <= self.settings.tolerance
        return local if met else with_values(local, measure=np.inf)

    def _lower(self, start: Array) -> None:
        """Seek feasibility from a start, and descend from there as long as the measures may come below the least."""
        local = self._through_things(start, "for measure")
        if local is None or local.violation.worst > self.settings.tolerance:
            return
        descent = self._descent(self.settings.iterations, None, "for measure")
        # far from the least measures, steps along curved constraints are short inside of a narrow funnel
        descent.width, descent.below = SEARCH.width, SEARCH.less * self.best.measure
        self.accept(self._ran(descent, local.q), "from a start for the measures")

    def _find_closest(self) -> None:
        """Where the goals are not reached, find the closest posture, then improve the measures from there."""
        tolerance = self.settings.tolerance
        if self.control.over:
            return
        if self.out_of_reach and not self._proven():
            self.accept(self._ran(self._closest(), self.best.q))
        if not held(self.best, tolerance):
            self.accept(self._stay(self.best))
        if self.problem.goals and not held(self.best, tolerance):
            self._seek_held()
        if not self.out_of_reach and self.best.violation.worst > tolerance:
            self._closest_from_best()
        many = SEARCH.reach_trials_few if self._rest is None else SEARCH.agreeing_few
        if not self._proven():
            self._pass_things(many if (self.out_of_reach or self._least) and self._few() else 0)
        if self.best.violation.left > tolerance and self.problem.measures and self.settings.measures:
            local = self._stay(self.best)
            if held(local, tolerance) and local.violation.left <= self.best.violation.left + tolerance:
                self._best = local

    def _seek_held(self) -> None:
        """Seek a posture that keeps the constraints, as near to the goals as any; then one without goals."""
        tolerance, near = self.settings.tolerance, self._near
        if near is not None and (self.out_of_reach or self._least) and not self._few():  # else others were tried
            self._missed = SEARCH.agree * near.violation.left
            self._in_contact = []
            self.search(self._from_elsewhere(self.settings.restarts))
            self.accept(self._ran(self._closest(), self.best.q))
        if not held(self.best, tolerance) and not self.control.over:
            alone, settings = copy.copy(self.problem), replace(self.settings, measures=False)
            alone.goals = ()
            search = QPMultistart(alone, self.lineariser.workspace, self.solver, settings, self.control)
            found = search.run()
            self.count(search)
            for stage in (self._feasibility(self.lineariser, 0, ""), self._closest()):
                self.accept(self._ran(stage, found.q))

    def _proven(self) -> bool:
        """Whether the best posture is known to be the closest to the goals."""
        known = self._least > 0.0 and self.best.violation.left <= NEAREST * self._least
        return known and held(self.best, self.settings.tolerance)

    def _seems_out_of_reach(self, q: Array) -> bool:
        """Whether the goals are out of reach of q (nq,): descents through everything all rest at the same distance."""
        if not (self.problem.goals and self.problem.scene.model.nv):
            return False
        agreeing = SEARCH.agreeing_few if (few := self._few()) else SEARCH.agreeing
        starts = chain([q], self._seeded((SEARCH.reach_trials_few if few else SEARCH.reach_trials) - 1, self._start))
        enough, programs = SEARCH.reached * self.settings.tolerance, self._at_most(SEARCH.reach_trial_programs)
        alone = with_values(self._shared, lineariser=self.lineariser.relaxed(ENDLESS))
        reach = Closest(alone, enough, programs, problem=self.problem, contacts=False)
        found = reach_trials(reach, starts, self._near, agreeing, self.settings.tolerance)
        self.spent += found.spent
        self._near, self._resting = found.nearest, found.others
        return found.out_of_reach

    def _closest_from_best(self) -> None:
        """Find the closest posture from the best one."""
        self.accept(nearest := self._ran(self._closest(), self.best.q))
        if not nearest.converged:
            self.accept(nearest := self._descend(self.best.q, note="nearest", measures=False))
        self._best = with_values(self.best, converged=self.best.converged or nearest.converged)

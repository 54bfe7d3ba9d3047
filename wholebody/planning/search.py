"""The search for short paths from the start of a problem to its ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.methods.control import BUDGET, within_budget
from wholebody.planning.ends import End, nearer
from wholebody.planning.local_planner import Geodesics
from wholebody.planning.projected_motions import ProjectedMotions
from wholebody.planning.rrt_connect import GEODESICS, RRTConnect
from wholebody.planning.sampling import Sampler, holds
from wholebody.planning.smoothing import length, shortcut
from wholebody.planning.tightening import tighten
from wholebody.planning.tracked_motions import LocalPlanner, TrackedMotions
from wholebody.problem import Problem

SEARCHED = 0.75  # of the time limit: for the first path; the rest is for shortcuts, smoothing and the judgement
HELD_AGAIN = 0.3  # the same where something is held, as a second search of a body takes as long as the first
AGAIN = 0.4  # of the time limit: for shorter paths; more = shorter, later
STEPPED = 2  # samples of trees that look for a shorter path, of which one is stepped towards; more = shorter paths
LONG = 2.0  # of the straight motion to the nearest end: a path that is longer is worth the time until LATER
LATER = 0.65  # of the time limit: as AGAIN, for long paths, but of bodies that hold nothing, whose polishing is dear
ASIDE = 0.6  # of samples beside what is held: a limb that moves or its tip is elsewhere; more = less else is tried
LIMBS = 0.7  # of these: joints of the limb are random; of others its tip is displaced, and all else follows
POLISHED = 0.7  # of the time limit: the shortest paths are drawn tight until then


class Search:
    """The search for paths from the start of a problem to its ends."""

    def __init__(
        self,
        problem: Problem,
        in_time: Callable[..., AbstractContextManager[None]],
        planners: tuple[LocalPlanner, TrackedMotions],
        ends: Iterator[End],
        random: tuple[Sampler, np.random.Generator],
    ) -> None:
        self._problem, self._in_time, self._ends, self._begun = problem, in_time, ends, False
        self._local, self._slides = planners
        self._sampler, self._rng = random
        self._reached: list[Array] = []
        self._moved: dict[bytes, Array] = {}  # how far an end is from the start for each chain's tip, metres
        self._said = ""
        self._held = holds(problem)
        free_root = bool(problem.scene.figure.roots) and not self._held
        self._bodily = free_root and self._local is not self._slides
        self._spreads = (0.0,) * free_root + (0.1, 0.3, 1.0)
        self._slides.admit(problem.start)
        self._tightens = self._local is not self._slides
        self._again = HELD_AGAIN if self._held and problem.scene.figure.roots else AGAIN
        self._straight, self._until = False, self._again

    def shortest(self) -> tuple[list[Array] | None, str]:
        """The shortest of some paths, with shortcuts, and how it was found; or None and why there is none."""
        model, most, samples, runs = self._problem.scene.model, np.inf, 0, 0
        paths: list[list[Array]] = []
        enough: float = self._local.samples
        while most == np.inf or (runs < self._local.searches and samples < enough and BUDGET.spent < self._until):
            # other motions are shorter than this share of the best one
            within = np.inf if self._held else 0.95 * most
            path, trees = self._path(within, np.inf if most == np.inf else enough - samples, most == np.inf)
            runs, samples = runs + 1, samples + trees.samples * (runs > 0)
            if path is None:
                break
            if self._straight and self._proven(path):
                return path, "the straight motion"
            before = np.inf
            # a shorter path is judged sooner, which leaves time for other shortcuts; half of it is for smoothing
            while length(model, path) < 0.9 * before and (before == np.inf or (self._held and BUDGET.spent < POLISHED)):
                before = length(model, path)
                with self._in_time(path, 0.5 if self._held else 1.0):
                    # limbs that move evenly cost as much as five other shortcuts
                    path = shortcut(model, path, self._local, self._rng, self._local.partial and not self._bodily)
            with self._in_time(path):
                path = nearer(self._problem, path, self._local, self._sampler)
            spent = BUDGET.spent
            path = self._tight(path) if self._held and self._tightens and spent < self._until else path
            paths.append(path)
            # steps along things may be none that are proven, and trees are sought beside these
            if (found := length(model, path)) < most and self._proven(path):
                most = found
                if not any(np.array_equal(path[-1], q) for q in self._reached):
                    self._reached.append(path[-1])
            straight = min(self._apart(self._problem.start, q) for q in self._reached)
            long = not (self._local is self._slides or self._bodily) and most > LONG * straight
            long = long and spent <= LATER
            self._until, enough = (self._later(paths), np.inf) if long else (self._again, self._local.samples)
        ready = sorted([*self._polished(paths), *paths], key=lambda path: length(model, path))
        best = next((path for path in ready if self._proven(path)), None)
        if best is not None:
            return best, f"the shortest of {runs} searches"
        if not self._reached:
            late = "" if BUDGET.spent < SEARCHED else " was found in time that"
            return None, f"no posture{late} meets the goals: {self._said}"
        return None, "no motion was found within the time limit"

    def _polished(self, paths: list[list[Array]]) -> list[list[Array]]:
        """Paths drawn tight: the shortest one again and again, and where that is tight the next, as time lets them."""
        model, found = self._problem.scene.model, list[list[Array]]()
        waiting = sorted(paths, key=lambda path: length(model, path))
        while waiting and self._tightens and BUDGET.spent < POLISHED:
            path = waiting.pop(0)
            best = self._tight(path)
            if length(model, best) > 0.97 * length(model, path):  # it counts as tight
                found.append(best)
            else:
                waiting.insert(0, best)
        return [*found, *waiting]

    def _later(self, paths: list[list[Array]]) -> float:
        """Share of the time limit until which shorter paths are sought: what is left smooths and judges the best."""
        with self._in_time(min(paths, key=lambda path: length(self._problem.scene.model, path))):
            left = BUDGET.left
        return min(LATER, BUDGET.spent + left / BUDGET.seconds - 0.45)

    def _tight(self, path: list[Array]) -> list[Array]:
        """A path drawn tight for a while; the path itself where that is no shorter."""
        model = self._problem.scene.model
        with self._in_time(path):
            left = BUDGET.left
        # a path that there is no time to smooth stops at its corners, and is judged three times as long
        if left < 0.2:  # s: a body's smoothing takes as long
            return path
        # most of the remaining time is for smoothing and the last program, which ends late
        with within_budget(0.2 * left):
            tight = tighten(model, path, self._local, self._slides)
        return tight if length(model, tight) < length(model, path) and self._proven(tight) else path

    def _proven(self, path: list[Array]) -> bool:
        """Whether all motions between the postures of a path are free and keep constraints, those by steps too."""
        return all(not BUDGET.over and self._slides.geodesics.follows(*pair) for pair in pairwise(path))

    def _path(self, most: float, samples: float, first: bool) -> tuple[list[Array] | None, RRTConnect]:
        """A path from the start to an end by new trees, which stay empty where it is straight.

        The trees grow towards at most so many samples, through which a path can be shorter than `most`, radians and
        metres (as in anytime RRTs, Ferguson and Stentz 2006).
        """
        start, model, rounds = self._problem.start, self._problem.scene.model, 0
        self._straight = False
        sliding = self._problem.scene.figure.roots and type(self._local) is Geodesics
        trees = RRTConnect(self._local, self._slides if sliding else None, model, start, 1 if first else STEPPED)
        ends = [q for q in self._reached if self._apart(start, q) < most]
        for reached in ends:
            trees.add_end(reached)
        while rounds < samples and (BUDGET.spent < (SEARCHED if first else self._until) or not self._begun):
            self._begun = True
            if rounds % self._local.rounds == 0 or not ends:
                q, why = next(self._ends, (None, ""))
                if q is None and not why and not ends:
                    break
                if q is None and why:
                    self._said = self._said or why
                    continue
                if q is not None:
                    self._slides.admit(q)
                    self._reached.append(q)
                    if self._apart(start, q) < most:
                        ends.append(q)
                        if led := self._led(q):
                            return led, trees
                        trees.add_end(q)
                if not ends:
                    continue
            rounds += 1
            near = ends[self._rng.integers(len(ends))]
            # Half of the samples are at an end: bodies leave narrow places as they are.
            share = float(np.clip(self._rng.uniform(-0.5, 1.5), 0.0, 1.0))
            middle = np.asarray(pin.interpolate(model, start, near, share))
            sample = self._sampler.near(middle, self._spread(trees.samples))
            if isinstance(self._local, ProjectedMotions) and self._rng.uniform() < ASIDE:
                sample = self._aside(self._local, middle, near)
            if most < np.inf and self._apart(start, sample) + min(self._apart(sample, q) for q in ends) > most:
                continue
            path = trees.grow(sample)
            if path is not None:
                return path, trees
        return None, trees

    def _aside(self, local: ProjectedMotions, q: Array, end: Array) -> Array:
        """A posture (nq,) near q with one of the limbs that the motion moves, or its tip, somewhere else.

        What gets round a thing has few freedoms: joints at random seldom move all of a body that way, and differences
        of others hide which posture of a tree is near.
        """
        figure, rng = self._problem.scene.figure, self._rng
        chains, key = list(figure.chains.values()), end.tobytes()
        if key not in self._moved:
            ends = (self._problem.start, end)
            here, there = ([figure.placement(each, chain.tip).translation for chain in chains] for each in ends)
            self._moved[key] = np.linalg.norm(np.subtract(there, here).reshape(-1, 3), axis=1)
        far = self._moved[key]
        if not far.any():
            return q
        chain = chains[rng.choice(len(chains), p=far / far.sum())]
        if rng.uniform() < LIMBS:
            return self._sampler.limb(q, figure.dofs(chain.joints))
        *joints, at = (figure.placement(q, name).translation for name in (*chain.joints, chain.tip))
        offset = rng.normal(size=3)
        offset *= rng.uniform() * np.linalg.norm(np.diff([*joints, at], axis=0), axis=1).sum() / np.linalg.norm(offset)
        return local.reaching(q, chain.tip, at + offset)

    def _spread(self, samples: int) -> float:
        """Of the next of so many samples; bodies get through most narrow places sooner if the root alone turns."""
        if self._bodily and samples < GEODESICS:
            return max(0.0, self._rng.uniform(-0.1, 0.1))
        return self._spreads[self._rng.integers(len(self._spreads))]

    def _led(self, end: Array) -> list[Array]:
        """Postures from the start to an end (nq,) without trees, if any: straight, or along things from the end back.

        Most narrow places are around ends, and steps towards the start lead out of them.
        """
        start = self._problem.start
        # steps that a bound of one's own limits may be thousands
        if self._local is self._slides and (motion := self._slides.geodesics.joined(start, end, np.inf)):
            self._straight = True
            return [start, *motion]
        motion, self._straight = self._local.towards(start, end)
        if self._straight:
            return [start, *motion[:-1], end]
        if self._held:  # steps along things found none of 20 ways, and projected ones are sooner
            return []
        motion, met = self._slides.towards(end, start)
        return [start, *motion[-2::-1], end] if met else []

    def _apart(self, q: Array, other: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._problem.scene.model, q, other)))

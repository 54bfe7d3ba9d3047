"""Removal of overlap from frame to frame: the posture shown is as near to the tracked one as contact allows.

Each frame goes from the last posture without overlap towards the tracked one, in steps short enough that what they
overlap is shallow, and every step is pushed out again by the loop of `resolver`. So joints are attracted to the tracked
ones in every frame, also at rest (the coach and trainee of Boulic and others 1997), limbs slide along what stops them,
and the global penetration is asked only where it is a good estimate. A step that cannot be pushed out is shortened by
interpolation with the last posture without overlap (algorithm 1, step 4, of Schmidl and Lin).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.geometry.continuous.bisection import last_free
from wholebody.geometry.continuous.moved_pairs import Placed
from wholebody.geometry.continuous.passing_through import first_passed
from wholebody.methods.ccd.attraction import Attraction
from wholebody.methods.ccd.overlap_resolution.chain import MARGIN
from wholebody.methods.ccd.overlap_resolution.resolver import Counts, OverlapResolver
from wholebody.scene import Scene

STEP = 0.03  # m: farthest that a chain's tip moves at once; half of a forearm's width
SMALL_STEP = 0.006  # m: where steps of that length lead around a bulge that the straight way cuts
STEPS = 8  # most steps of one frame
BUDGET = 42  # queries and goals after which a frame makes no further step, and the next one goes on: some 3 ms
SMALL_STEP_BUDGET = 15  # queries and goals for small steps, where larger ones led nowhere straight
OVERRUN = 16  # queries and goals beyond these after which no chain has another turn
HALVINGS = 7  # of an interpolation: a step of 3 cm to a quarter of a millimetre
PERTURBATIONS = (0.02, 0.05, 0.1, 0.2)  # rad: of a posture that things came upon and that no joint's best value frees
APART = 0.02  # m: how far a tip moves between two queries on the straight way from one shown posture to the next
MOST_QUERIES = 5
DIP = 4e-4  # m: how deep it may go in there
PASSED = (
    2e-3  # m: overlap of a single step, not of what is shown, that does not count; the way shown is swept more closely
)
WIDE = 5e-3  # m: how far what is to come back to a free posture is pushed out, so that it has room to turn
TINY = 1e-12  # rad, m


@dataclass(frozen=True)
class OverlapResult:
    """A posture without overlap, and what it took.

    Attributes:
        q: (nq,) the posture to show.
        iterations: goals that cyclic coordinate descent was given.
        joints: joints that took part, counted once for each goal that moved them.
        pairs: different pairs of pieces that overlapped on the way.
        contact_seconds: time of contact queries.
        ik_seconds: time of cyclic coordinate descent.
        fell_back: interpolation with the last posture without overlap was needed.
        deepest: deepest overlap left, metres.
        swept: the straight way from the posture shown before was swept and goes into nothing.
    """

    q: Array
    iterations: int
    joints: int
    pairs: int
    contact_seconds: float
    ik_seconds: float
    fell_back: bool
    deepest: float
    swept: bool


def resolve_overlap(
    scene: Scene, q_free: Array, q_wanted: Array, rng: np.random.Generator, pace: Array | None = None
) -> OverlapResult:
    """The posture nearest to the wanted one that this frame can reach without overlap.

    Args:
        scene: figure and things. What was prepared for it is kept from call to call.
        q_free: (nq,) the last posture without overlap: the one shown before.
        q_wanted: (nq,) the tracked posture. It may be in anything; limits and cones are kept for it.
        rng: of the order of the chains; the same seed gives the same answer.
        pace: (nv,) most that each degree of freedom may move, radians and metres; without end where None. What is left
            waits for the next frame. Where things moved onto `q_free`, leaving them comes first.

    Returns:
        The posture, within limits and reach cones and never NaN. Where things moved onto `q_free`, that is removed
        first; `deepest` says what could not be.

    Raises:
        InputError: a posture of the wrong shape, or a value that is not finite.
    """
    checked = [_posture(scene, q, what) for q, what in ((q_free, "q_free"), (q_wanted, "q_wanted"))]
    with scene.built.pool(FrameResolver, lambda: FrameResolver(scene)).lend() as frames:
        return frames.remove(checked[0], checked[1], rng, pace)


class FrameResolver:
    """Removal of overlap from frame to frame in one scene."""

    def __init__(self, scene: Scene) -> None:
        """Prepare the chains, and which degrees of freedom are of which."""
        self._model, self._figure, self._workspace = scene.model, scene.figure, scene.workspace()
        self._resolver = OverlapResolver(scene, self._workspace, exact=False)
        self._attraction = Attraction(scene, self._resolver)
        self._parts = self._attraction.parts

    def remove(
        self, q_free: Array, q_wanted: Array, rng: np.random.Generator, pace: Array | None = None
    ) -> OverlapResult:
        """See `resolve_overlap`."""
        self._workspace.begin()
        self._pace = np.full(self._model.nv, np.inf) if pace is None else pace
        resolver = self._resolver
        resolver.counts, resolver.margin = Counts(), MARGIN
        wanted = resolver.into_cones(self._figure.clamp(q_wanted))
        self._fell_back = self._swept = False
        q, overlaps = resolver.resolve(q_free, rng, OVERRUN)
        pushed = resolver.counts.iterations > 0
        for size in PERTURBATIONS if overlaps else ():
            perturbed, still = resolver.resolve(self._perturbed(q_free, size, rng), rng, resolver.counts.work + OVERRUN)
            if not still:
                q, overlaps = perturbed, still
                break
        if overlaps:
            return self._result(q if resolver.query(wanted) else wanted)
        before = self._resolver.placed
        shown = None
        self._attraction.free = not resolver.query(wanted)
        resolver.margin = WIDE if self._attraction.free else MARGIN
        if self._attraction.free and not self._passes_through(before, q, wanted):
            shown = self._toward(q, wanted)
        self._attraction.limit = resolver.counts.work + BUDGET + OVERRUN
        for self._attraction.step_length in (STEP, SMALL_STEP) if shown is None else ():
            self._attraction.limit = max(self._attraction.limit, resolver.counts.work + SMALL_STEP_BUDGET + OVERRUN)
            way = self._approach(q, wanted, before, rng)
            chosen = dict.fromkeys((len(way) - 1, len(way) // 2, 0)) if way else ()
            found = (self._toward(q, way[k]) for k in chosen)
            shown = next((made for made in found if made is not None), None)
            if shown is not None:
                break
        self._swept = shown is not None and not pushed
        return self._result(q if shown is None else shown)

    def _approach(self, q: Array, wanted: Array, before: Placed, rng: np.random.Generator) -> list[Array]:
        """From a free posture towards the wanted one, step by step: the postures on the way."""
        resolver = self._resolver
        settled = [False] * len(self._parts)
        settled[-1] = later = (
            self._attraction.free
        )  # limbs that are pressed at something leave it before the root goes on
        way = []
        for _ in range(STEPS):
            if resolver.counts.work > self._attraction.limit - OVERRUN:
                break
            moved = self._attraction.step(q, wanted, settled)
            if moved is None and later:
                settled[-1] = later = False
                moved = self._attraction.step(q, wanted, settled)
            if moved is None:
                break
            trial, overlaps = resolver.resolve(moved[0], rng, self._attraction.limit)
            if overlaps:
                trial = self._interpolate(q, trial)
            if self._passes_through(before, q, trial):
                trial = self._interpolate(q, self._hit)
            q = self._attraction.keep_gains(q, trial, wanted, moved[1], settled)
            way.append(q)
            before = self._resolver.placed
        return way

    def _toward(self, q0: Array, q1: Array) -> Array | None:
        """As far from q0 straight towards q1 as a frame may go, without dipping in; None where that is not free.

        Where the way is too long each part goes its own share of it, or else all of them the least of these.
        """
        way = np.asarray(pin.difference(self._model, q0, q1))
        shares = np.minimum(1.0, self._pace / np.maximum(np.abs(way), TINY))
        for dofs, _ in self._parts:
            shares[dofs] = shares[dofs].min(initial=1.0)
        least = float(shares.min())
        for share in (shares, least) if least < 1.0 else (1.0,):
            q = self._figure.clamp(np.asarray(pin.integrate(self._model, q0, share * way)))
            q = self._resolver.into_cones(q)
            if not self._resolver.query(q) and self._clear(q0, q):
                return q
        return None

    def _clear(self, q0: Array, q1: Array) -> bool:
        """Whether the straight way between two shown postures does not dip in; queries are cheap, the sweep is sure."""
        way = np.abs(np.asarray(pin.difference(self._model, q0, q1)))
        length = max(float(way[dofs] @ reach) for dofs, reach in self._parts)
        queries = min(int(length / APART), MOST_QUERIES)
        for k in range(queries):
            self._resolver.query(np.asarray(pin.interpolate(self._model, q0, q1, (k + 1) / (queries + 1))))
            if self._resolver.deepest > DIP:
                return False
        return self._workspace.sweep.first_contact(q0, q1, None, 2.0 * DIP) is None

    def _perturbed(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with its joints moved at random: a straight arm pushed along itself must bend."""
        step = size * rng.normal(size=self._model.nv)
        step[self._parts[-1][0]] = 0.0
        return self._resolver.into_cones(self._figure.clamp(np.asarray(pin.integrate(self._model, q, step))))

    def _interpolate(self, free: Array, q: Array) -> Array:
        """The last free posture on the way from a free one, by halving."""
        self._fell_back = True
        result = last_free(self._model, free, q, self._resolver.query, HALVINGS)
        self._resolver.query(result)
        return result

    def _passes_through(self, before: Placed, q0: Array, q1: Array) -> bool:
        """Whether the motion passes through something; `_hit` is then where it meets it first."""
        hit = first_passed(self._workspace, before, self._resolver.placed, q0, q1, PASSED)
        if hit is not None:
            self._hit = hit.q
        return hit is not None

    def _result(self, q: Array) -> OverlapResult:
        counts = self._resolver.counts
        self._resolver.query(q)
        return OverlapResult(
            q=q,
            iterations=counts.iterations,
            joints=counts.joints,
            pairs=len(counts.pairs),
            contact_seconds=counts.contact_seconds,
            ik_seconds=counts.ik_seconds,
            fell_back=self._fell_back,
            deepest=self._resolver.deepest,
            swept=self._swept,
        )


def _posture(scene: Scene, q: Array, what: str) -> Array:
    posture = np.asarray(q, dtype=float)
    if posture.shape != (scene.model.nq,) or not np.isfinite(posture).all():
        raise InputError(f"{what} is ({scene.model.nq},) finite numbers; got shape {posture.shape}")
    return np.asarray(pin.normalize(scene.model, posture))

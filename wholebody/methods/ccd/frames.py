"""Overlap resolution from frame to frame, towards the tracked posture as far as contact allows: docs/theory/ccd.md.

Joints are attracted to the tracked ones (the coach and trainee of Boulic and others 1997) by steps so short that
overlaps are shallow; a step whose overlap remains is shortened (algorithm 1, step 4, of Schmidl and Lin).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.checks import posture
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import first_passed, last_free
from wholebody.methods.ccd.chain import Tracked
from wholebody.methods.ccd.resolver import PERTURBATIONS, Counts, OverlapResolver
from wholebody.scene.scene import Scene

BUDGET = 42  # queries and goals after which a frame makes no further step, and the next one continues: some 3 ms
OVERRUN = 16  # further queries and goals after which no chain is processed any more
LEAST_GAIN = 1e-7  # rad^2: a part that gets nearer to the tracked posture by less than this stays where it is


@dataclass(frozen=True)
class OverlapResult:
    """A posture (nq,) without overlap, and the work to find it."""

    q: Array
    iterations: int  # number of goals of cyclic coordinate descent
    joints: int  # number of joints that moved, counted once for each goal
    pairs: int  # number of different pairs of pieces that overlapped during the search
    contact_seconds: float  # time of contact queries, and of cyclic coordinate descent
    ik_seconds: float
    deepest: float  # deepest remaining overlap, metres
    swept: bool  # whether the direct motion from the posture shown before was swept and is free


def resolve_overlap(
    scene: Scene, q_free: Array, q_wanted: Array, rng: np.random.Generator, largest_motion: Array | None = None
) -> OverlapResult:
    """The posture nearest to the wanted one that this frame can reach without overlap, and the work to find it.

    It goes from `q_free` (nq,), the posture shown before, or out of things moved there, by `largest_motion` (nv,) at
    most, and is within limits and reach cones, as `q_wanted` (nq,) is made. `rng` orders the chains.
    """
    given = (posture(q, scene.model.nq, what) for q, what in ((q_free, "q_free"), (q_wanted, "q_wanted")))
    checked = [np.asarray(pin.normalize(scene.model, q)) for q in given]
    with scene.built.pool(FrameResolver, lambda: FrameResolver(scene)).borrow() as frames:
        return frames.remove(checked[0], checked[1], rng, largest_motion)


class Attraction:
    """Moves parts of a figure towards the tracked posture: its chains, and root and trunk as one more part.

    Attributes:
        parts: degrees of freedom (k,) of each part, and for each the greatest distance of a point of the part, (k,).
        limit: of the work in the resolver's counts; beyond it joints are not tried one by one.
    """

    def __init__(self, scene: Scene, resolver: OverlapResolver) -> None:
        self._model, self._resolver = scene.model, resolver
        self.limit = 0
        self._most = 0.03  # m: largest motion of a part's tip in one step; half of a forearm's width
        self.parts: list[tuple[NDArray[np.intp], Array]] = []
        rest = np.ones(scene.model.nv, dtype=bool)
        for chain in resolver.chains.values():
            joints = [scene.model.joints[joint] for joint in chain.limbs.joints]
            dofs = np.array([joint.idx_v for joint in joints], dtype=np.intp)
            fresh = rest[dofs]
            rest[dofs] = False
            reach = np.maximum(chain.reach, 1e-9)  # m: steps are divided by it, and a last link may have no shape
            self.parts.append((dofs[fresh], reach[fresh]))
        size = max([float(reach.max(initial=0.5)) for _, reach in self.parts], default=0.5)
        others = np.flatnonzero(rest)
        reach = np.full(len(others), 2.0 * size)
        for root in scene.figure.roots.values():
            first = int(scene.model.joints[root].idx_v)
            reach[(others >= first) & (others < first + 3)] = 1.0
        self.parts.append((others, reach))

    def step(self, q: Array, wanted: Array, settled: list[bool]) -> tuple[Array, Array] | None:
        """Move all parts that are not settled a step to the wanted posture; (nq,) and shares (parts,), or None."""
        motion = np.asarray(pin.difference(self._model, q, wanted))
        shares = np.zeros(len(self.parts))
        for k, (dofs, reach) in enumerate(self.parts):
            part = motion[dofs]
            length = float(np.abs(part) @ reach)
            if not settled[k] and float(part @ part) >= 1e-12:  # rad^2: it has not arrived
                shares[k] = min(1.0, self._most / length)
            motion[dofs] = part * shares[k]
        if not shares.any():
            return None
        return np.asarray(pin.integrate(self._model, q, motion)), shares

    def keep_gains(self, q: Array, trial: Array, wanted: Array, shares: Array, settled: list[bool]) -> Array:
        """Undo changes that moved a part no nearer to the wanted posture; then move joints of blocked parts singly."""
        # A shoulder can move the arm back although the wrist cannot straighten. A part that gains nothing is settled.
        before = np.asarray(pin.difference(self._model, q, wanted))
        after = np.asarray(pin.difference(self._model, trial, wanted))
        back = np.zeros(self._model.nv, dtype=bool)
        slow = []
        for k, (dofs, _) in enumerate(self.parts):
            old, new = float(before[dofs] @ before[dofs]), float(after[dofs] @ after[dofs])
            if shares[k] and old - new < LEAST_GAIN:
                back[dofs] = True
            if shares[k] and old - new < 0.4 * shares[k] * old:  # blocked: without contact it gains 2 shares
                slow.append(k)
        if back.any():
            motion = np.asarray(pin.difference(self._model, trial, q))
            kept = np.asarray(pin.integrate(self._model, trial, np.where(back, motion, 0.0)))
            if not self._resolver.query(kept):
                trial = kept
        for k in slow:
            trial, gained = self._attract_joints(trial, wanted, k)
            settled[k] = not gained
        if len(slow) or back.any():
            self._resolver.query(trial)
        return trial

    def _attract_joints(self, q: Array, wanted: Array, part: int) -> tuple[Array, bool]:
        """Move one joint after the other, from the root outwards, if its motion is free; returns whether any moved."""
        gained = False
        chains = list(self._resolver.chains.values())
        held = {self._model.joints[joint].idx_v for joint in (chains[part].translated if part < len(chains) else ())}
        for dof, reach in zip(*self.parts[part], strict=True):
            if dof in held:  # it would turn a link that was moved out by translation
                continue
            motion = float(pin.difference(self._model, q, wanted)[dof])
            if motion * motion < LEAST_GAIN or self._resolver.counts.work > self.limit:
                continue
            step = np.zeros(self._model.nv)
            step[dof] = min(max(motion, -self._most / reach), self._most / reach)
            trial = np.asarray(pin.integrate(self._model, q, step))
            if not self._resolver.query(trial):
                q, gained = trial, True
        return q, gained


class FrameResolver:
    """Overlap resolution from frame to frame in one scene."""

    def __init__(self, scene: Scene) -> None:
        self._model, self._figure, self._workspace = scene.model, scene.figure, scene.workspace()
        self._resolver = OverlapResolver(scene, self._workspace)
        self._data = scene.model.createData(), scene.model.createData()  # at the tracked posture, and as shown before
        self._resolver.tracked = Tracked(*(data.oMi for data in self._data))
        self._attraction = Attraction(scene, self._resolver)
        self._parts = self._attraction.parts

    def remove(
        self, q_free: Array, q_wanted: Array, rng: np.random.Generator, largest_motion: Array | None = None
    ) -> OverlapResult:
        """See `resolve_overlap`."""
        self._workspace.begin()
        self._largest_motion = np.full(self._model.nv, np.inf) if largest_motion is None else largest_motion
        resolver = self._resolver
        resolver.counts = Counts()
        wanted = resolver.into_cones(self._figure.clamp(q_wanted))
        for data, q in zip(self._data, (wanted, q_free), strict=True):
            pin.forwardKinematics(self._model, data, q)
        for chain in resolver.chains.values():
            chain.translated.clear()
        self._swept = False
        q, free = self._freed(q_free, rng)
        if not free:
            return self._result(q if resolver.query(wanted) else wanted)
        pushed = resolver.counts.iterations > 0
        shown = self._followed(q, wanted, rng)
        self._swept = shown is not None and not pushed
        return self._result(q if shown is None else shown)

    def _freed(self, q: Array, rng: np.random.Generator) -> tuple[Array, bool]:
        """A posture near q (nq,) out of what things were moved into it, and whether it is free."""
        resolver = self._resolver
        found, overlaps = resolver.resolve(q, rng, OVERRUN)
        for size in PERTURBATIONS if overlaps else ():
            perturbed, still = resolver.resolve(self._perturbed(q, size, rng), rng, resolver.counts.work + OVERRUN)
            if not still:
                return perturbed, True
        return found, not overlaps

    def _followed(self, q: Array, wanted: Array, rng: np.random.Generator) -> Array | None:
        """The posture of this frame, from a free posture q towards the wanted one; None if no motion is free."""
        resolver, attraction = self._resolver, self._attraction
        before = resolver.placed
        if not resolver.query(wanted) and not self._passes_through(before, q, wanted):
            shown = self._toward(q, wanted)
            if shown is not None:
                return shown
        attraction.limit = resolver.counts.work + BUDGET + OVERRUN
        path = self._approach(q, wanted, before, rng)
        chosen = dict.fromkeys((len(path) - 1, len(path) // 2, 0)) if path else ()
        found = (self._toward(q, path[k]) for k in chosen)
        return next((made for made in found if made is not None), None)

    def _approach(self, q: Array, wanted: Array, before: QueryResult, rng: np.random.Generator) -> list[Array]:
        """Steps from a free posture towards the wanted one; returns the postures."""
        resolver = self._resolver
        settled = [False] * len(self._parts)
        path = []
        for _ in range(8):
            if resolver.counts.work > self._attraction.limit - OVERRUN:
                break
            moved = self._attraction.step(q, wanted, settled)
            if moved is None:
                break
            for chain in resolver.chains.values():
                chain.translated.clear()
            trial, overlaps = resolver.resolve(moved[0], rng, self._attraction.limit)
            if overlaps:
                trial = self._interpolate(q, trial)
            if self._passes_through(before, q, trial):
                trial = self._interpolate(q, self._hit)
            q = self._attraction.keep_gains(q, trial, wanted, moved[1], settled)
            path.append(q)
            before = self._resolver.placed
        return path

    def _toward(self, q0: Array, q1: Array) -> Array | None:
        """The direct motion from q0 towards q1, by each part's share or by the least share; None if it is not free."""
        motion = np.asarray(pin.difference(self._model, q0, q1))
        shares = np.minimum(1.0, self._largest_motion / np.maximum(np.abs(motion), 1e-12))
        for dofs, _ in self._parts:
            shares[dofs] = shares[dofs].min(initial=1.0)
        least = float(shares.min())
        for share in (shares, least) if least < 1.0 else (1.0,):
            q = self._figure.clamp(np.asarray(pin.integrate(self._model, q0, share * motion)))
            q = self._resolver.into_cones(q)
            overlaps, sweep = self._resolver.query(q), self._workspace.sweep
            # m: twice the allowed depth of the direct motion from one shown posture to the next
            if not overlaps and sweep.first_contact(q0, q, None, 8e-4) is None:
                return q
        return None

    def _perturbed(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with random changes of its joints, so that a straight arm can bend."""
        step = size * rng.normal(size=self._model.nv)
        step[self._parts[-1][0]] = 0.0
        return self._resolver.into_cones(self._figure.clamp(np.asarray(pin.integrate(self._model, q, step))))

    def _interpolate(self, free: Array, q: Array) -> Array:
        """The last free posture between a free one and q, by bisection."""
        result = last_free(self._model, free, q, self._resolver.query, 7)  # 3 cm to a quarter of a millimetre
        self._resolver.query(result)
        return result

    def _passes_through(self, before: QueryResult, q0: Array, q1: Array) -> bool:
        """Whether the motion passes through something; `_hit` is then the first contact."""
        hit = first_passed(self._workspace, before, self._resolver.placed, q0, q1, 2e-3)  # m
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
            deepest=self._resolver.deepest,
            swept=self._swept,
        )

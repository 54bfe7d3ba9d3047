"""Retargeting frame by frame: a free fit that follows the skeleton alone, then postures that hold what rests.

Frames pass a row of stages. Each stage looks ahead by some frames of the stage before, so that the same postures come
out of a recording and of a stream. The postures follow the free fit by a deviation d. A first pass goes forward in
time, each frame from the deviation of the one before. Sweeps follow, each two frames behind the one before: a frame is
solved anew between its neighbours, whose deviations say where the acceleration of d is least (block coordinate descent
on the sum of all frames' costs and of |w d''|^2),

    d_k* = (4 (d_{k-1} + d_{k+1}) - (d_{k-2} + d_{k+2})) / 6,

by successive over-relaxation (Young 1954): a sweep seeks d_k + omega (d_k* - d_k), the last one with omega = 1. The
first pass and first sweeps take every second or fourth frame of a fast recording, so that a contact is felt equally far
ahead at every rate; the frames between are interpolated, and swept after (nested iteration; Briggs, Henson and
McCormick, A Multigrid Tutorial, 2000). The body begins to give way before a contact comes.

Postures that are free may have motions between them that are not: feet pass each other in a thirtieth of a second. The
last sweeps have contact rows there too, and so have sweeps after them of the frames about such motions alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.figures.figure import Figure
from wholebody.motion.faults import DIP
from wholebody.motion.holds import SPAN, Holds
from wholebody.motion.posture_fit import CLEARANCE, LEAST_LEVER, Fitter, Goals, Midway, layout_of, levers
from wholebody.motion.retarget_targets import Targets, Wanted, has_trunk, parts_of
from wholebody.motion.roles import Roles
from wholebody.motion.structure import upright
from wholebody.motion.windows import leaning, normal
from wholebody.scene.workspace import Workspace

# most steps of a first frame, a free one, one of the first pass, one there in which parts touch things, one of a sweep
FIRST, FREE, FORWARD, TOUCHING, SWEEP = 60, 2, 3, 12, 1
EVERY, WORTH = 0.25, 0.8  # s after which a free posture is sought anew, and the share of the cost that it is for
SLOWING = 0.2  # s before it would be too fast in which a joint begins to move
STARTS = 4  # how often the first frame is solved, each time from where soles came down beside each other
SWEEPS: tuple[float, ...] = (1.8, 1.7, 1.6, 1.4, 1.2, 1.0)  # omega of each; more: less jerk, and slower by a tenth each
FINER: tuple[float, ...] = (1.4, 1.2, 1.0)  # the same of sweeps over twice as many frames
STAY = 0.03  # m/rad from the neutral posture of a person, for what no goal determines
PERSON = 0.9  # m that a joint of a person moves what it carries at most; bones of smaller figures miss fewer metres
CHANGE = 0.055  # s^0.5, weight of a change of the deviation in the first pass, over the root of the time step
BEND = 0.067  # s², weight of an acceleration of the deviation in sweeps, in metres that limbs move
GOES_ON, RETURN = 0.32, 0.3  # s in which a change of the deviation ends, and a deviation that nothing needs
EVEN, KEEP = 0.06, 0.1  # s over which what bones do not determine is smoothed; weight of it, in metres that limbs move
CALM, SPREAD = 0.025, 0.06  # s over which the free fit and the deviation of the first pass are smoothed
LATE = 1.3  # omega of sweeps that look at motions between frames: earlier ones are far from where these will be
MENDED = 8, 8, 16  # parts of a motion between frames that are looked at before each mend after the sweeps
KEPT = 30  # frames before the last one that stay known, for what looks back
SPARE = 0.9  # share of the speed limits that the free fit takes, so that there is some for what deviates from it


class Run:
    """Postures of the frames of one skeleton, as these come."""

    def __init__(
        self,
        figure: Figure,
        targets: Targets,
        roles: Roles,
        dt: float,
        holds: Holds | None,
        workspace: Workspace,
        free: list[Array] | None = None,  # the free fit by frame, (nq,) each, where a run without holds found it
    ) -> None:
        """Set up for goals like `targets`; without holds the skeleton alone is followed, and nothing is free."""
        self.free = list[Array]() if free is None else free
        self.figure, self.model, self.dt, self.holds = figure, figure.model, dt, holds
        points, turns = parts_of(targets, roles)
        self.fitter = Fitter(figure, layout_of(points, turns, roles, figure, holds.points if holds else []), workspace)
        self.hips = [k for k, role in enumerate(points) if role.endswith("hip")] or [0]
        self.led = figure.root == "free" and has_trunk(roles.joints)
        self.upright = upright(figure)
        self.levers = levers(figure)
        size = float(self.levers[6 if figure.root == "free" else 0 :].max(initial=LEAST_LEVER))
        self.stay = STAY * min(size / PERSON, 1.0) * figure.neutral_weights
        if figure.root == "free" and not self.led:
            self.stay[:6] = 1.0  # nothing says where the figure is, so it stays
        limit = np.array(self.model.velocityLimit, dtype=float)
        self.most = np.where(limit > 0.0, np.minimum(limit, 1e9) * dt, np.inf)
        self.reach = np.stack([-self.most, self.most])
        # where a posture has the joints of one value that have a speed limit, and by how much they move in a frame
        joints = [one for one in self.model.joints[1:] if one.nq == one.nv == 1 and np.isfinite(self.most[one.idx_v])]
        self.slow: Indices = np.array([one.idx_q for one in joints], dtype=np.intp)
        self.slow_most = np.array([SPARE * self.most[one.idx_v] for one in joints])
        self.none = (np.zeros((len(self.fitter.layout.held), 3)),) * 2
        self.every, self.slowing = (max(1, round(time / dt)) for time in (EVERY, SLOWING))
        # frames between those of the first pass and first sweeps
        self.span = 2 ** int(max(0.0, np.log2((SPAN if holds else dt) / dt)))
        self.even, self.calm, self.spread = normal(EVEN, dt), normal(CALM, dt), normal(SPREAD, self.span * dt)
        # by frames: goals, free postures with their costs, those within speed limits, the free fit, where it has the
        # points that may be held, deviations of the first pass, what is held in sweeps, postures, deviations of the
        # sweeps
        self._wanted, self._chain = dict[int, Wanted](), dict[int, tuple[Array, float]]()
        self._slow, self._even, self._free, self._paths = (dict[int, Array]() for _ in range(4))
        self._first, self._found, self._deviation = (dict[int, Array]() for _ in range(3))
        self._held = dict[int, tuple[int, tuple[Array, Array]]]()
        self._dips = dict[int, list[float]]()  # shares of the motion to a frame at which something overlaps
        self._backward = dict[int, tuple[Array, float]]()
        self._came, self.ended = 0, False
        self._front, self._latest = np.zeros(0), (np.zeros(self.model.nv), np.zeros(self.model.nv))
        self._stages: list[tuple[Callable[[int], None], int]] = [
            (self._fit, 0), (self._slowed, self.slowing), (self._evened, len(self.even) // 2),
            (self._calmed, len(self.calm) // 2),
        ] if free is None else [(self._known, 0)]  # fmt: skip
        if holds is None:
            self._stages.append((self._alone, 0))
        else:
            self._stages += [
                (self._passed, holds.ahead + holds.over),
                (self._spread, max(len(self.spread) // 2 * self.span, holds.ahead)),
            ]
            span, sweeps = self.span, SWEEPS
            while span:
                for number, omega in enumerate(sweeps):
                    if span == 1 and omega < LATE:
                        self._stages.append((partial(self._looked, parts=MENDED[0] // 2), 0))
                    # what lies between is interpolated from frames up to three away, as the sweeps before left them
                    wait = 2 * span if number or span == self.span else 3 * span
                    self._stages.append((partial(self._swept, omega=omega, span=span), wait))
                span, sweeps = span // 2, FINER
                if span:
                    self._stages.append((partial(self._between, span=span), 3 * span))
            for number, parts in enumerate(MENDED):
                self._stages += [(partial(self._looked, parts=parts, again=number > 0), 0), (self._mended, 2)]
            holds.begin(self._free)
        self._done = [0] * len(self._stages)  # frames that each stage has passed

    @property
    def ahead(self) -> int:
        """By how many frames it looks ahead: so much later a posture comes out."""
        return sum(wait for _, wait in self._stages)

    def push(self, wanted: Wanted) -> list[Array]:
        """Take the goals of the next frame; the postures (nq,) that are known now, in their order."""
        self._wanted[self._came] = wanted
        self._came += 1
        return self._advanced(self._came)

    def led_by(self, frames: list[Wanted]) -> None:
        """Know frames before they come: fitted backward in time too, these may have better postures."""
        following: tuple[Array, float] | None = None
        for k in range(len(frames) - 1, -1, -1):
            self._wanted[k] = frames[k]
            following = self._fitted(k, following and following[0], (len(frames) - 1 - k) % self.every == 0)
            self._backward[k] = following

    def pass_first(self, frames: list[Wanted]) -> None:
        """Take all frames at once, and do the first pass over them: then it is known what they cannot reach."""
        assert self.holds is not None
        self._wanted, self._came, self.ended = dict(enumerate(frames)), len(frames), True
        self.holds.finish(self._came)
        self._advanced(len(frames), 2)  # the free fit is known

    def advance(self, until: int) -> list[Array]:
        """The postures (nq,) that come out when all stages after the first pass know its frames `until` one."""
        self.ended = until >= self._came
        return self._advanced(until)

    def finish(self) -> list[Array]:
        """The postures (nq,) of the last frames."""
        self.ended = True
        if self.holds is not None:
            self.holds.finish(self._came)
        return self._advanced(self._came)

    def _advanced(self, come: int, stages: int | None = None) -> list[Array]:
        """Let every stage, or the first ones, do the frames whose later ones have come."""
        given = self._done[-1]
        for number, (stage, wait) in enumerate(self._stages[:stages]):
            for frame in range(self._done[number], come if self.ended else come - wait):
                stage(frame)
                self._done[number] = frame + 1
            come = min(come, self._done[number])
        come = self._done[-1]
        found = [self._found[frame] for frame in range(given, come)]
        known: tuple[dict[int, Any], ...] = (
            self._wanted, self._chain, self._slow, self._even, self._free, self._paths, self._first, self._found,
            self._deviation, self._held, self._dips,
        )  # fmt: skip
        for values in known:
            for frame in range(given - KEPT, come - KEPT):
                values.pop(frame, None)
        return found

    def jerk(self, postures: Sequence[Array] | Array) -> float:
        """Root mean square of the jerk of the points over postures (nq,), m/s³."""
        if len(postures) < 4:
            return 0.0
        steps = np.diff(np.array([self.fitter.places(q) for q in postures]), 3, axis=0)
        return float(((steps**2).sum(axis=2).mean()) ** 0.5 / self.dt**3)

    def _goals(self, frame: int, posture: Array, weights: Array, held: tuple[Array, Array] | None = None) -> Goals:
        wanted = self._wanted[frame]
        return Goals(wanted.places, wanted.turns, *(held or self.none), posture, weights)

    def _fitted(self, k: int, near: Array | None, anew: bool) -> tuple[Array, float]:
        """The free posture of a frame and its cost, from a posture near to it, or anew if that is better."""
        goals = self._goals(k, self.upright, self.stay)
        best = (self.upright, np.inf) if near is None else self.fitter.descend(near, goals, FREE)
        if not anew:
            return best
        q = np.array(self.upright)
        if self.led:
            hips = self._wanted[k].places[self.hips].mean(axis=0)
            q[:7] = pin.SE3ToXYZQUAT(pin.SE3(self._wanted[k].root, hips))
        alone = self.fitter.descend(q, goals, FIRST)
        return alone if alone[1] < WORTH * best[1] else best

    def _fit(self, k: int) -> None:
        """The free posture of a frame, from that before."""
        best = self._fitted(k, self._chain[k - 1][0] if k else None, k % self.every == 0)
        other = self._backward.pop(k, None)
        if other is not None and other[1] < WORTH * best[1]:
            best = other
        self._chain[k] = best

    def _slowed(self, k: int) -> None:
        """The free posture within speed limits: the middle between what keeps to them forward and backward in time."""
        q = np.array(self._chain[k][0])
        for joint in self.model.joints[1:] if k else ():
            if joint.nq not in (joint.nv, 2):  # a quaternion may have either sign
                turned = slice(joint.idx_q + joint.nq - 4, joint.idx_q + joint.nq)
                q[turned] *= 1.0 if q[turned] @ self._slow[k - 1][turned] >= 0.0 else -1.0
        if len(self.slow):
            values, most = self.slow, self.slow_most
            here = q[values]
            self._front = np.clip(here, self._front - most, self._front + most) if k else here
            last = min(k + self.slowing, self._came - 1)
            back = self._chain[last][0][values]
            for j in range(last - 1, k - 1, -1):
                back = np.clip(self._chain[j][0][values], back - most, back + most)
            q[values] = 0.5 * (self._front + back)
            if k:  # a longer way than a window slows
                q[values] = np.clip(q[values], self._slow[k - 1][values] - most, self._slow[k - 1][values] + most)
        self._slow[k] = q

    def _evened(self, k: int) -> None:
        """The fit with what bones leave open at the mean of frames about it, so that limits begin to hold gently."""
        q = self.figure.clamp(pin.normalize(self.model, self._mean(self._slow, k, self.even)))
        before = self._even[k - 1] if k else None
        self._even[k] = self.fitter.step(
            q, self._goals(k, q, KEEP * np.minimum(self.levers, 1.0)), among=False, most=self._room(q, before)
        )

    def _calmed(self, k: int) -> None:
        """The free fit, without the noise of the recording."""
        q = self.figure.clamp(pin.normalize(self.model, self._mean(self._even, k, self.calm)))
        self._free[k], self._paths[k] = q, self.fitter.held(q)

    def _known(self, k: int) -> None:
        self._free[k], self._paths[k] = self.free[k], self.fitter.held(self.free[k])

    def _mean(self, values: dict[int, Array], k: int, weights: Array, span: int = 1) -> Array:
        """The value at a frame of the line nearest to those about it: inside, their mean."""
        half, last = len(weights) // 2, self._came - 1
        away = np.arange(max(-half, -k // span), (min(half, (last - k) // span) if self.ended else half) + 1)
        near = leaning(weights[away + half], away)
        return np.asarray(near @ np.array([values[k + span * j] for j in away.tolist()]))

    def _alone(self, k: int) -> None:
        q = self._free[k]
        self.free.append(q)
        goals = self._goals(k, q, self.levers)
        for _ in range(8):
            if not self.fitter.outside(q):
                break
            q = self.fitter.step(q, goals, among=False)
        self._found[k] = q

    def _passed(self, k: int) -> None:
        """The posture of the first pass; it decides where points come down."""
        assert self.holds is not None
        model, free, holds, span, dt = self.model, self._free[k], self.holds, self.span, self.span * self.dt
        if k % span:
            return
        deviation, change = self._latest
        expected = np.exp(-dt / RETURN) * (deviation + np.exp(-dt / GOES_ON) * change)
        reference = np.asarray(pin.integrate(model, free, expected))
        shift = pin.XYZQUATToSE3(free[:7]).rotation @ deviation[:3] if self.figure.root == "free" else np.zeros(3)
        before = np.asarray(pin.integrate(model, self._free[k - span], self._first[k - span])) if k else None
        self.fitter.see(holds.moved(k))
        q = self.fitter.reached(before, reference, span * self.most)
        for _ in range(1 if k else STARTS):
            held = holds.goals(k, self._paths, shift, span=span)
            goals = self._goals(k, reference, CHANGE / dt**0.5 * self.levers, held)
            if before is not None and self.fitter.touching(goals):  # what goes on may be deep in a thin thing
                q = min((q, before), key=lambda each: self.fitter.merit(each, goals))
            q = self._settled(q, goals, before)
            if holds.lost(k, q, self.fitter.held(q), held):
                q = self._settled(self.fitter.reached(before, reference, span * self.most), goals, before)
            holds.touch(k, q, self.fitter.held(q), held)
            holds.landed(k, self.fitter.held(q), held, span)
        self._first[k] = np.asarray(pin.difference(model, free, q))
        self._latest = self._first[k], self._first[k] - deviation if k else change

    def _spread(self, k: int) -> None:
        if k % self.span:
            return
        self._deviation[k] = self._mean(self._first, k, self.spread, self.span)
        self._found[k] = self.figure.clamp(pin.integrate(self.model, self._free[k], self._deviation[k]))

    def _settled(self, q: Array, goals: Goals, before: Array | None) -> Array:
        """The posture (nq,) after the steps of a frame of the first pass."""
        for _ in range(FIRST if before is None else TOUCHING if self.fitter.touching(goals) else FORWARD):
            if before is None:
                goals = with_values(goals, posture=q)
            following = self.fitter.careful_step(q, goals, self._room(q, before, self.span))
            moved, q = float(np.abs(pin.difference(self.model, q, following)).max()), following
            if moved < 1e-3:  # rad, m
                break
        return q

    def _between(self, k: int, span: int) -> None:
        """The deviation of a frame `span` frames from two that were swept: the cubic through four of these."""
        if k % (2 * span) == span:
            near = [self._near(k + j * span, 2 * span) for j in (-3, -1, 1, 3)]
            self._deviation[k] = (9.0 * (near[1] + near[2]) - (near[0] + near[3])) / 16.0
            self._found[k] = self.figure.clamp(pin.integrate(self.model, self._free[k], self._deviation[k]))

    def _near(self, k: int, span: int) -> Array:
        """The deviation of every `span`-th frame; beyond the first and the last one it goes on half as fast."""
        last = (self._came - 1) // span * span
        inside = min(max(k, 0), last)
        found = self._deviation[inside]
        if inside == k or not last:
            return found
        inner = self._deviation[inside + np.sign(inside - k) * span]
        return np.asarray(found + 0.5 * abs(k - inside) / span * (found - inner))

    def _swept(self, k: int, omega: float, span: int, start: Array | None = None) -> None:
        """Solve a frame anew between those `span` and twice as far away; from `start` in reach of the next too."""
        assert self.holds is not None
        if k % span:
            return
        near = [self._near(k + j * span, span) for j in range(-2, 3)]
        smooth = (4.0 * (near[1] + near[3]) - (near[0] + near[4])) / 6.0
        reference = np.asarray(pin.integrate(self.model, self._free[k], near[2] + omega * (smooth - near[2])))
        self.fitter.see(self.holds.moved(k))
        if k not in self._held or self._held[k][0] != span:
            self._held[k] = span, self.holds.goals(k, self._paths, np.zeros(3), again=True, span=span)
        held = self._held[k][1]
        goals = self._goals(k, reference, BEND / (span * self.dt) ** 2 * self.levers, held)
        after = None if start is None else self._found.get(k + 1)
        before = self._found[k - span] if k else after
        q = self.fitter.reached(before, reference if start is None else start, span * self.most)
        late = span == 1 and omega < LATE
        midway, deepest = (self._midway(k), DIP) if late else ([], CLEARANCE)
        for number in range(8 * SWEEP):  # more than the usual where cones, or contacts, are curved
            if number >= SWEEP and not (self.fitter.outside(q) or self.fitter.depth(q) > deepest):
                break
            # what is wanted draws q to and fro across an edge: then the least way back inside
            if number >= (SWEEP if late else 4 * SWEEP):
                goals, midway = with_values(goals, posture=q), []
            q = self.fitter.careful_step(q, goals, self._room(q, before, span, after), midway)
        if self.holds.touches:
            self.holds.touch(k, q, self.fitter.held(q), held)
        self._found[k], self._deviation[k] = q, np.asarray(pin.difference(self.model, self._free[k], q))

    def _looked(self, k: int, parts: int, again: bool = False) -> None:
        """Note where the motion from the frame before overlaps; `again` only where a mend changed one of the two."""
        assert self.holds is not None
        if not k or self.holds.moved(k) or (again and not any(map(self._dips.get, range(k - 1, k + 3)))):
            return
        known, ends = self._dips.setdefault(k, []), (self._found[k - 1], self._found[k])
        for share in (number / parts for number in range(1, parts)):
            depth = self.fitter.depth(pin.interpolate(self.model, *ends, share))
            # an end that overlaps is to be mended first: rows of its way would be many, and cost most of the time
            if share not in known and depth > DIP and max(map(self.fitter.depth, ends)) < CLEARANCE:
                known.append(share)

    def _mended(self, k: int) -> None:
        """Solve a frame again whose motion to one beside it overlaps, or one before such a frame, which leads to it."""
        if any(map(self._dips.get, range(k, k + 3))):
            self._swept(k, 1.0, 1, self._found[k])

    def _midway(self, k: int) -> list[Midway]:
        """Where motions to the frames beside one overlap; it gives way by half to the next one, which does the rest."""
        weight = 0.6 / self.dt**2  # 0.6 s²: 0.8 turns legs that press on each other to and fro, 0.1 leaves 1 mm
        found = [Midway(self._found[k - 1], 1.0 - share, 1.0, weight) for share in self._dips.get(k, ())]
        return found + [Midway(self._found[k + 1], share, 0.5, weight) for share in self._dips.get(k + 1, ())]

    def _room(self, q: Array, before: Array | None, span: int = 1, after: Array | None = None) -> Array | None:
        """Least and greatest displacement (2, nv) of q that joints reach from the postures before and after in time."""
        if before is None:
            touches = self.holds is not None and self.holds.touches
            # rad, m: largest change in a step of a first frame whose parts touch things; longer ones miss these
            return np.asarray(0.1 * np.outer((-1.0, 1.0), np.ones(self.model.nv))) if touches else None
        room = np.asarray(span * self.reach - pin.difference(self.model, before, q))
        if after is not None:
            other = self.reach - pin.difference(self.model, after, q)
            room = np.stack([np.maximum(room[0], other[0]), np.minimum(room[1], other[1])])
        return room

"""The program of one step of a trajectory: the objective, rows of all nodes, limits, speeds, a trust region.

Unknowns, frame by frame: the deviations of the degrees of freedom that count, then the slacks of the frame's nodes. A
missed contact has a slack of its own. The others of a figure at a node share one. So a program always has an answer:
where contacts contradict each other, the sum of what is missed is least.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import scipy.sparse as sp

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.trajectory.deviations import Chart, Objective
from wholebody.motion.trajectory.interior_point import BandedQP
from wholebody.motion.trajectory.nodes import Rows

SOFT = 1e3  # 1/m, of loads that are beyond their bounds: large, so that they are met where contacts let them be
ONE_STEP = 0.03  # m, rad: of a deeper shortfall one step asks for this much; the normals are looked at again on the way


class Limits(NamedTuple):
    """What every deviation keeps to."""

    lower: Array  # and upper: (n, nv) limits of joints, and of frozen ones; infinite where there is none
    upper: Array
    slowest: Array  # and fastest: (n - 1, nv) bounds on the change of the deviation from a frame to the next
    fastest: Array

    @classmethod
    def of(
        cls, terms: FrameTerms, chart: Chart, first: int, seams: tuple[bool, bool], rate: float | None = None,
        begun: Array | None = None,
    ) -> Limits:  # fmt: skip
        """Those of a chart from frame `first` on, begun with (n, nv); `seams` as ends, `rate` of speed limits."""
        count, nv = len(chart), chart.model.nv
        lower, upper = np.full((count, nv), -np.inf), np.full((count, nv), np.inf)
        slowest, fastest = lower[1:].copy(), upper[1:].copy()
        at_q, at_v, least, most = terms.scene.figure.limits
        lower[:, at_v], upper[:, at_v] = least - chart.original[:, at_q], most - chart.original[:, at_q]
        for place in range(count):
            bounds = terms.bounds(first + place)
            away = pin.difference(chart.model, terms.q[first + place], chart.original[place])
            lower[place] = np.maximum(lower[place], bounds.lower - away)
            upper[place] = np.minimum(upper[place], bounds.upper - away)
            still = bounds.lower == bounds.upper
            lower[place, still] = upper[place, still] = 0.0
            if rate is not None and place < count - 1:
                # where the original is faster than a limit, it may stay as fast
                slow, fast = terms.step_bounds(first + place)
                slowest[place] = np.minimum(rate * slow, chart.steps[place]) - chart.steps[place]
                fastest[place] = np.maximum(rate * fast, chart.steps[place]) - chart.steps[place]
        for seam, place in zip(seams, (0, -1), strict=True):
            if seam:
                lower[place] = upper[place] = 0.0 if begun is None else begun[place]
        return cls(lower, upper, slowest, fastest)

    def passed(self, x: Array) -> Array:
        """(n, nv) by how much deviations (n, nv) pass their limits, or their changes the bounds on speed."""
        past: Array = np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0)
        change = np.diff(x, axis=0)
        past[1:] = np.maximum(past[1:], np.maximum(self.slowest - change, change - self.fastest))
        return past


class Layout(NamedTuple):
    """A program, the index in it of each frame's deviations (n, a), and their degrees of freedom (a,)."""

    program: BandedQP
    place: Indices
    dofs: Indices

    def deviations(self, z: Array, x: Array) -> Array:
        """(n, nv) deviations that the unknowns z say, with those of x elsewhere."""
        found: Array = x.copy()
        found[:, self.dofs] = z[self.place]
        return found


class Step(NamedTuple):
    """A step from deviations: what its program is made of."""

    x: Array  # (n, nv) deviations
    rows: Sequence[Rows]  # of all nodes at x, in the order of their frames
    dofs: Indices  # (a,) degrees of freedom that may change, ascending
    radius: float  # largest change of any deviation, radians and metres
    penalty: float  # of a metre or radian of shortfall
    multipliers: Sequence[Array]  # of the equalities of each node
    kept: Sequence[Mask]  # for each node which of its rows the program gets
    tree: Indices  # (nv,) the figure of each degree of freedom, from 0


def lay_out(objective: Objective, limits: Limits, step: Step) -> Layout:
    """The program of a step."""
    count = len(step.dofs)
    slacks = [_slacks(one, keep, step.tree) for one, keep in zip(step.rows, step.kept, strict=True)]
    per_frame = np.zeros(len(step.x), dtype=np.intp)
    for one, (_, number) in zip(step.rows, slacks, strict=True):
        per_frame[one.node.frame] += number
    start = np.concatenate([[0], np.cumsum(count + per_frame)]).astype(np.intp)
    size = int(start[-1])
    place = start[:-1, None] + np.arange(count)[None]
    prices, used, columns = np.zeros(size), start[:-1] + count, list[Indices]()
    for one, (slack, number) in zip(step.rows, slacks, strict=True):
        frame = one.node.frame
        prices[used[frame] : used[frame] + number] = SOFT if one.node.soft else step.penalty
        columns.append(used[frame] + slack)
        used[frame] += number
    P, c = _cost(objective, step, place, prices)
    G, lower = _contact_part(step, columns, place, size)
    D, slowest, fastest = _speed_part(step, place, limits, size)
    least, most = np.zeros(size), np.full(size, np.inf)
    least[place], most[place] = box(step.x, limits, step.radius, step.dofs)
    begun = np.zeros(size)
    begun[place] = step.x[:, step.dofs]
    program = BandedQP(
        P, c, sp.vstack([G, D], format="csr"), np.concatenate([lower, slowest]),
        np.concatenate([np.full(len(lower), np.inf), fastest]), least, most, begun,
    )  # fmt: skip
    return Layout(program, place, step.dofs)


def box(x: Array, limits: Limits, radius: float, dofs: Indices) -> tuple[Array, Array]:
    """(n, a) bounds of the deviations: the limits and the trust region; where these are apart, bounds towards it."""
    now = x[:, dofs]
    low, high = limits.lower[:, dofs], limits.upper[:, dofs]
    least, most = np.maximum(low, now - radius), np.minimum(high, now + radius)
    return np.minimum(least, now + radius), np.maximum(most, now - radius)


def touched(rows: Sequence[Rows], which: Sequence[Mask]) -> Mask:
    """(nv,) the degrees of freedom that move some of the rows."""
    found = np.zeros(rows[0].parts[0].shape[1], dtype=bool)
    for one, mask in zip(rows, which, strict=True):
        if mask.any():
            for part in one.parts:
                moved = np.abs(part[mask])
                # what moves a load by less than a tenth of its greatest derivative does not join the program for it
                least = 0.1 * moved.max(axis=1, initial=0.0) if one.node.soft else np.zeros(len(moved))
                found |= (moved > least[:, None]).any(axis=0)
    return found


def predicted(one: Rows, step: Array) -> Array:
    """(r,) gaps of a node's rows after a step (n, nv), to first order."""
    frame = one.node.frame
    after: Array = one.gap.copy()
    for offset, part in enumerate(one.parts):
        after += part @ step[frame + offset]
    return after


def active(rows: Sequence[Rows], step: Array) -> list[Mask]:
    """For each node which rows are tight or missed after a step (n, nv), to a micrometre."""
    return [predicted(one, step) <= one.asked + 1e-6 for one in rows]


def within_reach(one: Rows, dofs: Indices, radius: float) -> Mask:
    """(r,) rows of a node that a step within the radius could miss."""
    reach = np.zeros(len(one.gap))
    for part in one.parts:
        reach += np.abs(part[:, dofs]).sum(axis=1)
    return np.asarray((one.gap < one.node.room + radius * reach) & (reach > 0.0))


def likely(one: Rows, radius: float) -> Mask:
    """(r,) rows of a node that a program is begun with: a step of the radius hardly ever misses others."""
    near: Mask = one.gap < one.node.room + max(3e-3, 0.3 * radius)  # m, and m for each rad
    return np.ones_like(near) if one.node.soft else near


def _slacks(one: Rows, kept: Mask, tree: Indices) -> tuple[Indices, int]:
    """The slack of each kept row, from 0, and how many there are; of figures (nv,)."""
    group = one.group[kept]
    missed = one.shortfalls[group] > 0.0 if len(group) else np.zeros(0, dtype=bool)
    own, place = np.unique(group[missed], return_inverse=True)
    slack = np.zeros(len(group), dtype=np.intp)
    slack[missed] = place
    # what is not missed shares those of its figure: one slack of all would couple figures that do not meet
    moved = np.any([part[kept][~missed] != 0.0 for part in one.parts], axis=0)
    figures, shared = np.unique(tree[moved.argmax(axis=1)] if moved.size else tree[:0], return_inverse=True)
    slack[~missed] = len(own) + shared
    return slack, len(own) + len(figures)


def _cost(objective: Objective, step: Step, place: Indices, prices: Array) -> tuple[sp.csr_matrix, Array]:
    """P and c: the objective, the prices of slacks, and the augmented Lagrangian of equalities."""
    x, dofs, count = step.x, step.dofs, len(step.dofs)
    stiffness = 1e6  # 1/m^2 and 1/rad^2, of equalities; their multipliers do the rest
    c = prices.copy()
    c[place] += objective.slope[:, dofs] * objective.weights[dofs]
    first, second = np.nonzero(objective.bands)
    values = [np.outer(objective.bands[first, second], objective.weights[dofs]).ravel()]
    at, to = [place[first].ravel()], [place[second].ravel()]
    slack = np.flatnonzero(prices)
    values.append(1e-2 * prices[slack])  # 1/m^2: keeps equal splits of a shortfall unique
    at.append(slack)
    to.append(slack)
    for one, multiplier in zip(step.rows, step.multipliers, strict=True):
        if len(one.equal):
            part, here = one.equal_rows[:, dofs], place[one.node.frame]
            wanted = part @ x[one.node.frame, dofs] - one.equal - multiplier
            values.append((stiffness * part.T @ part).ravel())
            at.append(np.repeat(here, count))
            to.append(np.tile(here, count))
            c[here] -= stiffness * part.T @ wanted
    triplets = (np.concatenate(values), (np.concatenate(at), np.concatenate(to)))
    return sp.csr_matrix(triplets, shape=(len(c), len(c))), c


def _contact_part(step: Step, columns: Sequence[Indices], place: Indices, size: int) -> tuple[sp.csr_matrix, Array]:
    """Rows ``gap + J (y - x) + slack >= 0``; `columns` has the slack of each row that is kept."""
    x, dofs, count = step.x, step.dofs, len(step.dofs)
    values, at, to, lower = [np.zeros(0)], [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)], [np.zeros(0)]
    number = 0
    for one, keep, slack in zip(step.rows, step.kept, columns, strict=True):
        frame, many = one.node.frame, len(slack)
        index = np.arange(number, number + many)
        bound = np.minimum((one.asked - one.gap)[keep], ONE_STEP)
        for offset, part in enumerate(one.parts):
            own = part[np.ix_(keep, dofs)]
            values.append(own.ravel())
            at.append(np.repeat(index, count))
            to.append(np.tile(place[frame + offset], many))
            bound = bound + own @ x[frame + offset, dofs]
        values.append(np.ones(many))
        at.append(index)
        to.append(slack)
        lower.append(bound)
        number += many
    triplets = (np.concatenate(values), (np.concatenate(at), np.concatenate(to)))
    return sp.csr_matrix(triplets, shape=(number, size)), np.concatenate(lower)


def _speed_part(step: Step, place: Indices, limits: Limits, size: int) -> tuple[sp.csr_matrix, Array, Array]:
    """Rows that bound the change of a deviation from a frame to the next, where it is near the bound."""
    x = step.x[:, step.dofs]
    change = np.diff(x, axis=0)
    slowest, fastest = limits.slowest[:, step.dofs], limits.fastest[:, step.dofs]
    # from half of a bound on; one may be zero, where the original is as fast as the limit: a little before it is near
    near = 0.3 * step.radius
    fast, slow = np.minimum(0.5 * fastest, fastest - near), np.maximum(0.5 * slowest, slowest + near)
    frame, dof = np.nonzero((change > fast) | (change < slow))
    low, high = slowest[frame, dof], fastest[frame, dof]
    index = np.arange(len(frame))
    values = np.concatenate([np.ones(len(index)), -np.ones(len(index))])
    columns = np.concatenate([place[frame + 1, dof], place[frame, dof]])
    return sp.csr_matrix((values, (np.tile(index, 2), columns)), shape=(len(index), size)), low, high

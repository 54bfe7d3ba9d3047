"""Paths drawn tight round what is in the way: programs for all postures of a path at once.

A path through postures q_k is displaced by tangents x_k that minimise

    sum_k w_k |q_k+1 - q_k + x_k+1 - x_k|^2 + m sum_k |x_k|^2,   rows_k x_k + gap_k >= 0,

where w_k, the inverse lengths of the motions between, make the first sum the length of the path (iteratively
reweighted least squares), and rows are those of near pairs, constraints and limits, two for what is held, onto which
displaced postures are projected. Free roots are displaced along the axes of the world, so that all freedoms share one
matrix with a row for each posture. Its inverse is small, and leaves a program of the rows alone, whose multipliers
Gauss-Seidel finds. Postures then move as far as straight motions between them are free. In an elastic band (Quinlan and
Khatib 1993) each follows its neighbours alone, and takes tens of sweeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.methods.control import BUDGET, within_budget
from wholebody.planning.projection_kernel import projected_gauss_seidel
from wholebody.planning.smoothing import banded, length
from wholebody.planning.tracked_motions import LocalPlanner, Rows, TrackedMotions

DAMPING = 0.005  # m of the first program, and least; larger = shorter displacements, more programs
HELD = 1e3  # of what is held: larger = nearer to it; projections make up for the rest


class Program(NamedTuple):
    """What displaces the postures (nq,) of a path that are not its ends."""

    away: Array  # (n, nv) displacements, along the axes of the world
    turns: list[Array]  # (nv, nv) axes of each posture's tangent in those of the world
    foreseen: float  # by how much the path becomes shorter, radians and metres


def tighten(model: pin.Model, path: list[Array], local: LocalPlanner, slides: TrackedMotions) -> list[Array]:
    """A path drawn tight round things, to which few shortcuts lead as they go from one posture to another one."""
    band, damping = banded(model, path, local), DAMPING
    while len(band) > 2 and not BUDGET.over:
        program, before, better = programmed(model, band, slides, damping), length(model, band), 0.0
        if program is None or not program.foreseen > 1e-6 * before:  # what foresees nothing would come again and again
            break
        for _ in range(3):  # a part of displacements that make it longer, as some are cut, costs less than other ones
            moved, cut = _moved(model, band, program, (local, slides))
            better = before - length(model, moved)
            if better > 0.0 or BUDGET.over:
                break
            program = with_values(program, away=0.3 * program.away)
        # what comes much shorter of what was foreseen was displaced too far
        damping = max(0.5 * damping, DAMPING) if better > 0.25 * program.foreseen else 4.0 * damping
        band = moved if better > 0.0 else band
        count = len(band)
        band = _halved(model, band, cut, local) if count < 40 else band  # more = nearer to things, dearer
        if len(band) == count and (0.0 < better < 0.003 * before or damping > 0.5):  # it is tight
            break
    found = [band[0]]
    with within_budget(np.inf):  # motions that were free, once more
        for q in band[1:]:
            found += local.joined(found[-1], q, np.inf) or [q]
    return found


def programmed(model: pin.Model, band: list[Array], slides: TrackedMotions, damping: float) -> Program | None:
    """The program of a path as it is; None where time ends before."""
    turns, rows, counts = [_turn(model, q) for q in band], list[Rows](), list[int]()
    for q, turn in zip(band[1:-1], turns[1:-1], strict=True):
        if BUDGET.over:
            return None
        each = slides.rows(q)
        rows.append(with_values(each, derivative=each.derivative @ turn.T, held=each.held @ turn.T))
        counts.append(len(each.gap))
    steps = np.array([turn @ pin.difference(model, *pair) for turn, pair in zip(turns, pairwise(band), strict=False)])
    lengths = np.linalg.norm(steps, axis=1)
    if not lengths.any():  # it stays
        return None
    weights = lengths.mean() / np.maximum(lengths, 0.3 * lengths.mean())  # bounded where a motion is short
    pull = weights[1:, None] * steps[1:] - weights[:-1, None] * steps[:-1]
    pull -= HELD * np.array([each.held.T @ each.missed for each in rows])
    # of nodes by those before them, as displacements are eliminated from the start on
    inverses = list[Array]()
    for k, each in enumerate(rows):
        stiff = (weights[k] + weights[k + 1] + damping) * np.eye(model.nv) + HELD * each.held.T @ each.held
        inverses.append(np.linalg.inv(stiff - weights[k] ** 2 * inverses[-1] if k else stiff))
    node = np.repeat(np.arange(len(counts)), counts)
    spread = Spread(np.array(inverses), weights[1:-1])
    listed = np.concatenate([each.derivative for each in rows]), np.concatenate([each.gap for each in rows])
    away = _kept(pull, spread, node, listed)
    # rad, m: farther ones lead to things that no row is of
    away *= min(1.0, 0.4 / max(float(np.linalg.norm(away, axis=1).max()), 1e-15))
    ends = np.zeros((1, model.nv))
    after = np.linalg.norm(steps + np.diff(np.vstack([ends, away, ends]), axis=0), axis=1)
    return Program(away, turns, float(lengths.sum() - after.sum()))


class Spread(NamedTuple):
    """What forces on the postures of a path displace, with what is held: a matrix of bands of blocks, factored."""

    inverses: Array  # (n, nv, nv) of each block less what is eliminated before it
    beside: Array  # (n - 1,) how stiff displacements of neighbours are joined

    def displaced(self, forces: Array) -> Array:
        """Displacements (n, nv, r) by forces (n, nv, r)."""
        found: Array = forces.copy()
        for k in range(1, len(found)):
            found[k] += self.beside[k - 1] * (self.inverses[k - 1] @ found[k - 1])
        for k in range(len(found) - 1, -1, -1):
            ahead = found[k] + self.beside[k] * found[k + 1] if k < len(self.beside) else found[k]
            found[k] = self.inverses[k] @ ahead
        return found


def _kept(pull: Array, spread: Spread, node: Indices, rows: tuple[Array, Array]) -> Array:
    """Displacements (n, nv) by forces (n, nv) that keep rows (r, nv) with gaps (r,), of nodes (r,)."""
    derivative, gap = rows
    free = found = spread.displaced(pull[:, :, None])[:, :, 0]
    ahead = np.einsum("ij,ij->i", derivative, free[node]) + gap
    force, asked = np.zeros(len(gap)), ahead < 0.0
    for _ in range(6):  # the last ones seldom find more
        at = np.flatnonzero(asked)
        forces = np.zeros((*free.shape, len(at)))
        forces[node[at], :, np.arange(len(at))] = derivative[at]
        moved = spread.displaced(forces)
        given = force[at]
        projected_gauss_seidel(np.einsum("ij,ijk->ik", derivative[at], moved[node[at]]), ahead[at], given)
        force[at] = given
        found = free + moved @ given
        missed = np.einsum("ij,ij->i", derivative, found[node]) + gap < -1e-4
        if not (missed & ~asked).any():
            break
        asked |= missed
    return found


def _moved(
    model: pin.Model, band: list[Array], program: Program, planners: tuple[LocalPlanner, TrackedMotions]
) -> tuple[list[Array], list[bool]]:
    """The displaced path, as far as motions between its postures are free; the path itself where time ends before.

    And which displacements were cut.
    """
    (local, slides), count = planners, len(band)
    share, free, anew = np.ones(count), np.zeros(count - 1, dtype=bool), np.ones(count, dtype=bool)
    share[[0, -1]] = 0.0
    moved, cuts = list(band), 0
    while True:
        for k in np.flatnonzero(anew[1:-1]) + 1:
            step = share[k] * (program.turns[k].T @ program.away[k - 1])
            moved[k] = local.projected(slides.displaced(band[k], step)) if share[k] else band[k]
        for k in np.flatnonzero(anew[:-1] | anew[1:]):
            # what is as before need not be proven: steps along things made it
            free[k] = not (share[k] or share[k + 1]) or bool(local.joined(moved[k], moved[k + 1], np.inf))
        if BUDGET.over and not free.all():
            return band, [False] * count
        if free.all():
            return moved, (share < 1.0).tolist()
        anew, cuts = np.zeros(count, dtype=bool), cuts + 1
        beside = np.flatnonzero(~free)
        anew[beside] = anew[beside + 1] = True
        anew &= share > 0.0
        share[anew] *= 0.4 if cuts < 3 else 0.0


def _halved(model: pin.Model, band: list[Array], cut: Sequence[bool], local: LocalPlanner) -> list[Array]:
    """A path with postures in the middle of long motions beside cut displacements, as rows are those of postures."""
    found = [band[0]]
    inner = [False, *cut[1:-1], False]
    for (q, there), beside in zip(pairwise(band), map(any, pairwise(inner)), strict=True):
        if beside and length(model, [q, there]) > 0.1:  # rad, m: smaller = nearer to things, dearer
            middle = local.projected(np.asarray(pin.interpolate(model, q, there, 0.5)))
            if local.joined(q, middle, np.inf) and local.joined(middle, there, np.inf):  # these may be nearer
                found.append(middle)
        found.append(there)
    return found


def _turn(model: pin.Model, q: Array) -> Array:
    """(nv, nv) axes of the tangent at q (nq,), those of free roots in the axes of the world."""
    found = np.eye(model.nv)
    for joint in model.joints:
        if joint.nv == 6:
            turn, at = pin.XYZQUATToSE3(q[joint.idx_q : joint.idx_q + 7]).rotation, joint.idx_v
            found[at : at + 3, at : at + 3] = found[at + 3 : at + 6, at + 3 : at + 6] = turn
    return found

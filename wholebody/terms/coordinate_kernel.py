"""Errors of postures in the joints' own coordinates, and heights of masses, as compiled loops: see `plan`."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.terms.entries import Integers
from wholebody.terms.residual_kernel import SMALL, equidistant, inverse_left, rotation_vector

Table: TypeAlias = tuple[Array, Integers]  # numbers and places of the terms of one kind, a row each

Carried: TypeAlias = tuple[Array, Integers, NDArray[np.int8]]
"""Columns of the joint Jacobian (n, 6), the degree of freedom of each, and which of them move a joint (njoints, n)."""


@compiled(inner=True)
def coordinates(targets: Array, places: Integers, q: Array, value: Array, jacobian: Array) -> None:
    """Joints with a plain coordinate: see `tasks.Posture`."""
    for e in range(len(targets)):
        value[places[e, 0]] = q[places[e, 1]] - targets[e, 0]
        jacobian[places[e, 0], places[e, 2]] = 1.0


@compiled(inner=True)
def coupled_ranges(tables: Array, places: Integers, q: Array, value: Array, jacobian: Array) -> None:
    """See `tasks.range_of_motion.CoupledRow`."""
    for e in range(len(tables)):
        row = places[e, 0]
        value[row] = tables[e, 2]
        for k in range(2):
            if places[e, 1 + 2 * k] >= 0:
                value[row] -= tables[e, k] * q[places[e, 1 + 2 * k]]
                jacobian[row, places[e, 2 + 2 * k]] -= tables[e, k]


@compiled(inner=True, error_model="numpy")
def elliptic_ranges(tables: Array, places: Integers, q: Array, value: Array, jacobian: Array) -> None:
    """See `tasks.range_of_motion.EllipticRow`."""
    for e in range(len(tables)):
        row, size = places[e, 0], tables[e, 9]
        value[row] = 0.5 * size
        for k in range(3):
            angle = tables[e, k]
            for j in range(4 * k + 1, 4 * k + 5, 2):
                if places[e, j] >= 0:
                    angle += q[places[e, j]]
            limit = tables[e, 6 + k] if angle > 0.0 else tables[e, 3 + k]
            value[row] -= 0.5 * size * angle * angle / (limit * limit)
            for j in range(4 * k + 1, 4 * k + 5, 2):
                if places[e, j] >= 0:
                    jacobian[row, places[e, j + 1]] -= size * angle / (limit * limit)


@compiled(inner=True)
def turns(targets: Array, places: Integers, q: Array, value: Array, jacobian: Array) -> None:
    """Joints that turn for ever, whose coordinates are a cosine and a sine."""
    for e in range(len(targets)):
        cosine, sine = q[places[e, 1]], q[places[e, 1] + 1]
        across = targets[e, 0] * sine - targets[e, 1] * cosine
        value[places[e, 0]] = np.arctan2(across, targets[e, 0] * cosine + targets[e, 1] * sine)
        jacobian[places[e, 0], places[e, 2]] = 1.0


@compiled(inner=True, error_model="numpy")
def roots(targets: Array, places: Integers, q: Array, value: Array, jacobian: Array) -> None:
    """Free roots: log of the motion from the target, and its derivative by a motion in the root's own frame.

    With log M = (v, w), v = J p: [[A, B A], [0, A]], A the transpose of J, B the derivative of v by the rotation
    (Chirikjian 2011, section 10.6, in the form of Pinocchio's Jlog6).
    """
    own, change, left, bend = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    angle, offset, along = np.empty(3), np.empty(3), np.empty(3)
    for e in range(len(targets)):
        row, at, v = places[e, 0], places[e, 1], places[e, 2]
        target = targets[e].reshape((4, 3))
        _rotation(q[at + 3 : at + 7], own)
        for i in range(3):
            offset[i] = 0.0
            for k in range(3):
                offset[i] += target[i, k] * (q[at + k] - target[3, k])
            for j in range(3):
                change[i, j] = 0.0
                for k in range(3):
                    change[i, j] += target[i, k] * own[k, j]
        rotation_vector(change, angle)
        inverse_left(angle, left)
        for i in range(3):
            value[row + i] = left[i, 0] * offset[0] + left[i, 1] * offset[1] + left[i, 2] * offset[2]
            value[row + 3 + i] = angle[i]
        square = angle[0] ** 2 + angle[1] ** 2 + angle[2] ** 2
        size = np.sqrt(square)
        if size < SMALL:
            beta, slope = 1.0 / 12.0 + square / 720.0, 1.0 / 360.0
        else:
            half = 0.5 / (1.0 - np.cos(size))
            share = np.sin(size) / size
            beta = 1.0 / square - share * half
            slope = -2.0 / (square * square) + (1.0 + share) * half / square
        inner = angle[0] * offset[0] + angle[1] * offset[1] + angle[2] * offset[2]
        for i in range(3):
            along[i] = slope * inner * angle[i] - (square * slope + 2.0 * beta) * offset[i]
        for i in range(3):
            for m in range(3):
                bend[i, m] = along[i] * angle[m] + beta * angle[i] * offset[m]
            bend[i, i] += beta * inner
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            bend[j, i] += 0.5 * offset[k]
            bend[k, i] -= 0.5 * offset[j]
        for i in range(3):
            for m in range(3):
                jacobian[row + i, v + m] = jacobian[row + 3 + i, v + 3 + m] = left[m, i]
                jacobian[row + i, v + 3 + m] = (
                    bend[i, 0] * left[m, 0] + bend[i, 1] * left[m, 1] + bend[i, 2] * left[m, 2]
                )


@compiled(inner=True)
def root_distances(tables: Array, places: Integers, q: Array, measure: Array) -> None:
    """Squared distance of a free root, see `tasks.distance.SquaredDistance`; its curvature is always the same."""
    at, target, error, slope = np.zeros((1, 3), dtype=np.int64), np.empty((1, 12)), np.zeros(6), np.zeros((6, 6))
    last = measure.shape[1] - 1
    for e in range(len(tables)):
        at[0, 1] = places[e, 0]
        for k in range(12):
            target[0, k] = tables[e, k]
        roots(target, at, q, error, slope)
        for i in range(6):
            force = tables[e, 12 + i] * error[i]
            measure[0, last] += force * error[i]
            for v in range(6):
                measure[0, places[e, 1] + v] += 2.0 * force * slope[i, v]


@compiled(inner=True)
def rhythms(of_limbs: Table, of_lumbar: Table, q: Array, measure: Array, squares: Array) -> None:
    """See `tasks.Rhythm`; `squares` is as for `kernel.linearise`."""
    (elevations, elevation_places), (lumbars, lumbar_places) = of_limbs, of_lumbar
    slopes, at = np.empty(5), np.empty(5, dtype=np.int64)
    for e in range(len(elevations)):
        flexion, abduction = q[elevation_places[e, 1]], q[elevation_places[e, 2]]
        rise, onset = elevations[e, 1], elevations[e, 3]
        if onset > 0.0:
            root = np.sqrt(flexion * flexion + onset * onset)
            share = 0.5 * (flexion + root - onset)
            slopes[1], slopes[2] = -rise * 0.5 * (1.0 + flexion / root), 0.0
        else:
            share = 1.0 - np.cos(flexion) * np.cos(abduction)
            slopes[1] = -rise * np.sin(flexion) * np.cos(abduction)
            slopes[2] = -rise * np.cos(flexion) * np.sin(abduction)
        excess = q[elevation_places[e, 0]] - rise * share - elevations[e, 2]
        slopes[0] = 1.0
        for k in range(3):
            at[k] = elevation_places[e, 3 + k]
        _square(elevations[e, 0], excess, slopes[:3], at[:3], measure, squares, e)
    for e in range(len(lumbars)):
        root, first = lumbar_places[e, 6], lumbar_places[e, 7]
        x, y, z, w = q[root + 3], q[root + 4], q[root + 5], q[root + 6]
        share = np.tanh(-lumbars[e, 2] * 2.0 * (x * z - y * w))
        steep = lumbars[e, 1] * lumbars[e, 2] * (1.0 - share * share)
        excess = -lumbars[e, 1] * share - lumbars[e, 3]
        for k in range(3):
            excess += q[lumbar_places[e, k]]
            slopes[k], at[k] = 1.0, lumbar_places[e, 3 + k]
        slopes[3], at[3] = -steep * (1.0 - 2.0 * (x * x + y * y)), first + 4
        slopes[4], at[4] = steep * 2.0 * (y * z + x * w), first + 5
        _square(lumbars[e, 0], excess, slopes, at, measure, squares, len(elevations) + e)


@compiled(inner=True, error_model="numpy")
def balls(tables: Array, places: Integers, q: Array, measure: Array, squares: Array, first: int) -> None:
    """Ball joints, see `tasks.distance.BallJoint`; their squares begin at the row `first`."""
    turn, axes, part, away = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    vector, left, slopes, at = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(3, dtype=np.int64)
    for e in range(len(tables)):
        own, start, weights = tables[e, :9].reshape((3, 3)), tables[e, 9:18].reshape((3, 3)), tables[e, 18:21]
        turn[:] = 0.0
        for i in range(3):
            turn[i, i] = 1.0
        for k in range(3):
            for i in range(3):
                axes[i, k] = turn[i, 0] * own[k, 0] + turn[i, 1] * own[k, 1] + turn[i, 2] * own[k, 2]
            # A turn about an axis, after Rodrigues; applied to the left of what was turned before.
            cosine, sine = np.cos(q[places[e, k]]), np.sin(q[places[e, k]])
            x, y, z = axes[0, k], axes[1, k], axes[2, k]
            for j in range(3):
                a, b, c = turn[0, j], turn[1, j], turn[2, j]
                along = (1.0 - cosine) * (x * a + y * b + z * c)
                part[0, j] = cosine * a + sine * (y * c - z * b) + along * x
                part[1, j] = cosine * b + sine * (z * a - x * c) + along * y
                part[2, j] = cosine * c + sine * (x * b - y * a) + along * z
            for i in range(3):
                for j in range(3):
                    turn[i, j] = part[i, j]
            at[k] = places[e, 3 + k]
        for i in range(3):
            for j in range(3):
                away[i, j] = turn[i, 0] * start[j, 0] + turn[i, 1] * start[j, 1] + turn[i, 2] * start[j, 2]
        rotation_vector(away, vector)
        inverse_left(vector, left)
        for k in range(3):
            excess = own[k, 0] * vector[0] + own[k, 1] * vector[1] + own[k, 2] * vector[2]
            for j in range(3):
                slopes[j] = 0.0
                for i in range(3):
                    slopes[j] += own[k, i] * (
                        left[i, 0] * axes[0, j] + left[i, 1] * axes[1, j] + left[i, 2] * axes[2, j]
                    )
            _square(weights[k], excess, slopes, at, measure, squares, first + 3 * e + k)


@compiled(inner=True)
def _square(
    weight: float, excess: float, slopes: Array, at: Integers, measure: Array, squares: Array, row: int
) -> None:
    """Add a weighted square with slopes (k,) at these places of the tangent; row sums bound its second derivative."""
    steep = 0.0
    for k in range(len(slopes)):
        steep += abs(slopes[k])
    measure[0, measure.shape[1] - 1] += weight * excess * excess
    for k in range(len(slopes)):
        measure[0, at[k]] += 2.0 * weight * excess * slopes[k]
        measure[1, at[k]] += 2.0 * weight * abs(slopes[k]) * steep
    if row < len(squares):
        squares[row] = 0.0
        for k in range(len(slopes)):
            squares[row, at[k]] += np.sqrt(2.0 * weight) * slopes[k]
            measure[2, at[k]] += 2.0 * weight * abs(slopes[k]) * steep


@compiled(inner=True)
def _rotation(unit: Array, turn: Array) -> None:
    """Rotation (3, 3) of a unit quaternion x, y, z, w."""
    x, y, z, w = unit[0], unit[1], unit[2], unit[3]
    turn[0, 0], turn[0, 1], turn[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    turn[1, 0], turn[1, 1], turn[1, 2] = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    turn[2, 0], turn[2, 1], turn[2, 2] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)


@compiled(inner=True)
def heights(tables: Array, entries: Integers, joints: Array, tree: Carried, measure: Array) -> None:
    """See `tasks.PotentialEnergy`."""
    columns, column, support = tree
    nv = measure.shape[1] - 1
    row = np.empty(nv)
    centre = np.empty(3)
    for e in range(len(tables)):
        joint = entries[e, 0]
        for i in range(3):
            centre[i] = joints[joint, 3, i]
            for k in range(3):
                centre[i] += joints[joint, k, i] * tables[e, k]
        weight, rise = tables[e, 3], centre[2] - tables[e, 4]
        measure[0, nv] += weight * rise * rise
        row[:] = 0.0
        for k in range(len(columns)):
            if support[joint, k]:
                row[column[k, 0]] += columns[k, 2] + centre[1] * columns[k, 3] - centre[0] * columns[k, 4]
        for v in range(nv):
            measure[0, v] += 2.0 * weight * rise * row[v]
            measure[1, v] += 2.0 * weight * row[v] * row[v]


@compiled(inner=True)
def hangs(table: Table, joints: Array, tree: Carried, measure: Array, squares: Array, first: int) -> None:
    """See `tasks.Hang`."""
    tables, entries = table
    columns, column, support = tree
    nv = measure.shape[1] - 1
    row, at, hanging, turn = np.empty(nv), np.arange(nv), np.empty(3), np.empty(3)
    error, change = np.empty(2), np.empty((2, 3))
    for e in range(len(tables)):
        joint = entries[e, 0]
        for i in range(3):
            hanging[i] = 0.0
            for k in range(3):
                hanging[i] += joints[joint, k, i] * tables[e, 1 + k]
        equidistant(hanging[0], hanging[1], -hanging[2], error, change)
        for r in range(2):
            change[r, 2] = -change[r, 2]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                turn[i] = hanging[j] * change[r, k] - hanging[k] * change[r, j]
            row[:] = 0.0
            for c in range(len(columns)):
                if support[joint, c]:
                    row[column[c, 0]] += turn[0] * columns[c, 3] + turn[1] * columns[c, 4] + turn[2] * columns[c, 5]
            _square(tables[e, 0], error[r], row, at, measure, squares, first + 2 * e + r)

"""A plan's terms at a posture, to first order, as compiled loops: see `term_plan` and `linearisation`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.compiled import compiled
from wholebody.tasks.axis import NO_ANGLE, STEEPEST, TOUCHING
from wholebody.tasks.discomfort import POWER, STEEPNESS
from wholebody.term_plan import (
    AXIS,
    BODY,
    BOX,
    COLUMN,
    COORDINATE,
    CURVATURE,
    DISCOMFORT,
    DISTANCE,
    LIMIT,
    MASS_CENTER,
    PLANE,
    RESIDUAL,
    Integers,
)

SMALL = 1e-4
"""Angle [rad] below which the series of log and its derivative are exact to rounding."""


@compiled()
def _floats(flat: Array, layout: Integers, table: int) -> Array:
    start, rows, columns = layout[table, 0], layout[table, 1], layout[table, 2]
    return flat[start : start + rows * columns].reshape((rows, columns))


@compiled()
def _integers(flat: Integers, layout: Integers, table: int) -> Integers:
    start, rows, columns = layout[table, 3], layout[table, 4], layout[table, 5]
    return flat[start : start + rows * columns].reshape((rows, columns))


@compiled(error_model="numpy")
def linearise(
    joints: Array,
    columns: Array,
    support: NDArray[np.int8],
    q: Array,
    floats: Array,
    integers: Integers,
    layout: Integers,
    gap_wrench: Array,
    gap_joints: Integers,
    gaps: int,
    wrench: Array,
    value: Array,
    jacobian: Array,
    box: Array,
    measure: Array,
) -> None:
    """Values and Jacobian rows of all terms of a plan, then the Jacobian rows of contacts; bounds and measures.

    Args:
        joints: (njoints, 4, 3) placements of the joints; see `placement_view`.
        columns: (n, 6) columns of the joint Jacobian, in the world.
        support: (njoints, n) 1 where a column moves a joint.
        q: (nq,) the posture.
        floats: of the plan.
        integers: of the plan.
        layout: of the plan.
        gap_wrench: (gaps or more, 6) wrenches of the contacts' rows.
        gap_joints: (gaps or more, 2) joints of the first and second piece of each.
        gaps: how many.
        wrench: (terms' rows, 6) room.
        value: (terms' rows,) room for the values.
        jacobian: (terms' rows + gaps, nv) room for all rows.
        box: (2, nv) room for the bounds on the displacement.
        measure: (2, nv + 1) room for the gradient and the value, and for the curvature.
    """
    nv = jacobian.shape[1]
    terms = len(value)
    column = _integers(integers, layout, COLUMN)
    jacobian[:terms] = 0.0
    wrench[:] = 0.0
    _residuals(_floats(floats, layout, RESIDUAL), _integers(integers, layout, RESIDUAL), joints, wrench, value)
    _planes(_floats(floats, layout, PLANE), _integers(integers, layout, PLANE), joints, wrench, value)
    _axes(_floats(floats, layout, AXIS), _integers(integers, layout, AXIS), joints, wrench, value)
    for table, rows in ((RESIDUAL, 0), (PLANE, 1), (AXIS, 2)):
        entries = _integers(integers, layout, table)
        for e in range(len(entries)):
            against = entries[e, 2] if table == RESIDUAL else 0
            count = 3 * (entries[e, 3] + entries[e, 4]) if table == RESIDUAL else rows
            for r in range(entries[e, 0], entries[e, 0] + count):
                _row(wrench[r], entries[e, 1], against, columns, support, column, jacobian[r])
    for r in range(gaps):
        jacobian[terms + r] = 0.0
        _row(gap_wrench[r], gap_joints[r, 1], gap_joints[r, 0], columns, support, column, jacobian[terms + r])
    centers = _floats(floats, layout, MASS_CENTER)
    if len(centers):
        _mass_centers(
            centers, _integers(integers, layout, MASS_CENTER), _floats(floats, layout, BODY),
            _integers(integers, layout, BODY), column, joints, columns, value, jacobian,
        )  # fmt: skip
    targets, places = _floats(floats, layout, COORDINATE), _integers(integers, layout, COORDINATE)
    for e in range(len(targets)):
        value[places[e, 0]] = q[places[e, 1]] - targets[e, 0]
        jacobian[places[e, 0], places[e, 2]] = 1.0
    _box(_floats(floats, layout, LIMIT), _integers(integers, layout, LIMIT), _floats(floats, layout, BOX), q, box)
    constant = _floats(floats, layout, CURVATURE)
    for v in range(nv):
        measure[0, v] = 0.0
        measure[1, v] = constant[0, v]
    measure[0, nv] = measure[1, nv] = 0.0
    _measures(
        _floats(floats, layout, DISTANCE), _integers(integers, layout, DISTANCE), _floats(floats, layout, DISCOMFORT),
        _integers(integers, layout, DISCOMFORT), q, measure,
    )  # fmt: skip


@compiled()
def _row(
    wrench: Array, joint: int, against: int, columns: Array, support: NDArray[np.int8], column: Integers, row: Array
) -> None:
    """Add to a row (nv,) the rates at which a wrench works on the motion of a joint relative to another."""
    a, b, c, d, e, f = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    for k in range(len(columns)):
        sign = support[joint, k] - support[against, k]
        if sign != 0:
            row[column[k, 0]] += sign * (
                a * columns[k, 0]
                + b * columns[k, 1]
                + c * columns[k, 2]
                + d * columns[k, 3]
                + e * columns[k, 4]
                + f * columns[k, 5]
            )


@compiled()
def _placed(joint: Array, part: Array, turn: Array, place: Array) -> None:
    """Rotation (3, 3) and origin (3,) in the world of a frame with the place `part` (12,) in a joint (4, 3)."""
    for i in range(3):
        place[i] = joint[3, i]
        for k in range(3):
            place[i] += joint[k, i] * part[9 + k]
    for i in range(3):
        for j in range(3):
            turn[i, j] = 0.0
            for k in range(3):
                turn[i, j] += joint[k, i] * part[3 * j + k]


@compiled(error_model="numpy")
def _residuals(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.residuals.PlacementResidual`."""
    turn, base_turn, relative, change = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    place, base_place, way, angle = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    left = np.empty((3, 3))
    for e in range(len(tables)):
        row, position, orientation, based = entries[e, 0], entries[e, 3], entries[e, 4], entries[e, 5]
        _placed(joints[entries[e, 1]], tables[e, :12], turn, place)
        if based:
            _placed(joints[entries[e, 2]], tables[e, 12:24], base_turn, base_place)
        else:
            for i in range(3):
                base_place[i] = 0.0
                for j in range(3):
                    base_turn[i, j] = 1.0 if i == j else 0.0
        if position:
            for i in range(3):
                way[i] = place[i] - base_place[i]
            for i in range(3):
                value[row + i] = -tables[e, 24 + i]
                for k in range(3):
                    value[row + i] += base_turn[k, i] * way[k]
                x, y, z = base_turn[0, i], base_turn[1, i], base_turn[2, i]  # axis i of the base, in the world
                wrench[row + i, 0], wrench[row + i, 1], wrench[row + i, 2] = x, y, z
                wrench[row + i, 3] = place[1] * z - place[2] * y
                wrench[row + i, 4] = place[2] * x - place[0] * z
                wrench[row + i, 5] = place[0] * y - place[1] * x
            row += 3
        if orientation:
            for i in range(3):
                for j in range(3):
                    relative[i, j] = 0.0
                    for k in range(3):
                        relative[i, j] += base_turn[k, i] * turn[k, j]
            for i in range(3):
                for j in range(3):
                    change[i, j] = 0.0
                    for k in range(3):
                        change[i, j] += relative[i, k] * tables[e, 27 + 3 * j + k]
            rotation_vector(change, angle)
            inverse_left(angle, left)
            for i in range(3):
                value[row + i] = angle[i]
                for j in range(3):
                    for k in range(3):
                        wrench[row + i, 3 + j] += left[i, k] * base_turn[j, k]


@compiled(error_model="numpy")
def rotation_vector(turn: Array, angle: Array) -> None:
    """Rotation vector (3,) of a rotation (3, 3), by way of its quaternion, which is exact at every angle.

    Shepperd 1978, "Quaternion from Rotation Matrix", Journal of Guidance and Control 1(3).
    """
    trace = turn[0, 0] + turn[1, 1] + turn[2, 2]
    largest, best = -1, trace
    for i in range(3):
        if turn[i, i] > best:
            largest, best = i, turn[i, i]
    if largest < 0:
        w = 1.0 + trace
        x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    elif largest == 0:
        w = turn[2, 1] - turn[1, 2]
        x, y, z = 1.0 + 2.0 * turn[0, 0] - trace, turn[0, 1] + turn[1, 0], turn[0, 2] + turn[2, 0]
    elif largest == 1:
        w = turn[0, 2] - turn[2, 0]
        x, y, z = turn[0, 1] + turn[1, 0], 1.0 + 2.0 * turn[1, 1] - trace, turn[1, 2] + turn[2, 1]
    else:
        w = turn[1, 0] - turn[0, 1]
        x, y, z = turn[0, 2] + turn[2, 0], turn[1, 2] + turn[2, 1], 1.0 + 2.0 * turn[2, 2] - trace
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine < 1e-12 * w else 2.0 * np.arctan2(sine, w) / sine
    angle[0], angle[1], angle[2] = scale * x, scale * y, scale * z


@compiled(error_model="numpy")
def inverse_left(angle: Array, left: Array) -> None:
    """Inverse (3, 3) of the left Jacobian of SO(3) at a rotation vector (3,): 1 - [a]/2 + c [a]^2.

    c = (1 - (t/2) cot(t/2)) / t^2 at the angle t (Chirikjian 2011, section 10.6).
    """
    x, y, z = angle[0], angle[1], angle[2]
    square = x * x + y * y + z * z
    if square < SMALL * SMALL:
        c = 1.0 / 12.0 + square / 720.0
    else:
        half = 0.5 * np.sqrt(square)
        c = (1.0 - half / np.tan(half)) / square
    left[0, 0], left[1, 1], left[2, 2] = (
        1.0 + c * (x * x - square),
        1.0 + c * (y * y - square),
        1.0 + c * (z * z - square),
    )
    left[0, 1], left[1, 0] = c * x * y + 0.5 * z, c * x * y - 0.5 * z
    left[0, 2], left[2, 0] = c * x * z - 0.5 * y, c * x * z + 0.5 * y
    left[1, 2], left[2, 1] = c * y * z + 0.5 * x, c * y * z - 0.5 * x


@compiled()
def _planes(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.Plane`."""
    place = np.empty(3)
    for e in range(len(tables)):
        row, joint = entries[e, 0], joints[entries[e, 1]]
        value[row] = -tables[e, 6]
        for i in range(3):
            place[i] = joint[3, i]
            for k in range(3):
                place[i] += joint[k, i] * tables[e, k]
            value[row] += tables[e, 3 + i] * place[i]
            wrench[row, i] = tables[e, 3 + i]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            wrench[row, 3 + i] = place[j] * tables[e, 3 + k] - place[k] * tables[e, 3 + j]


@compiled(error_model="numpy")
def _axes(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.Axis`."""
    turn, axes, place, direction = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    change, move = np.empty((2, 3)), np.empty((2, 3))
    for e in range(len(tables)):
        row = entries[e, 0]
        _placed(joints[entries[e, 1]], tables[e, :12], turn, place)
        distance = np.inf
        for i in range(3):
            direction[i] = tables[e, 21 + i]
        if entries[e, 2]:
            distance = 0.0
            for i in range(3):
                direction[i] -= place[i]
                distance += direction[i] * direction[i]
            distance = np.sqrt(distance)
            for i in range(3):
                direction[i] /= max(distance, TOUCHING)
        if distance < TOUCHING:
            value[row] = value[row + 1] = 0.0
            continue
        for i in range(3):
            for j in range(3):
                axes[i, j] = 0.0
                for k in range(3):
                    axes[i, j] += tables[e, 12 + 3 * i + k] * turn[j, k]
        x = axes[0, 0] * direction[0] + axes[0, 1] * direction[1] + axes[0, 2] * direction[2]
        y = axes[1, 0] * direction[0] + axes[1, 1] * direction[1] + axes[1, 2] * direction[2]
        along = axes[2, 0] * direction[0] + axes[2, 1] * direction[1] + axes[2, 2] * direction[2]
        sine = np.hypot(x, y)
        angle = np.arctan2(sine, along)
        if sine < NO_ANGLE:
            value[row], value[row + 1] = angle, 0.0
            gain = 1.0 if along > 0.0 else STEEPEST
        else:
            value[row], value[row + 1] = x * angle / sine, y * angle / sine
            gain = min(angle / sine, STEEPEST)
        ux, uy = (x / sine, y / sine) if sine > NO_ANGLE else (1.0, 0.0)
        fall = along - gain
        change[0, 0], change[0, 1], change[0, 2] = gain + fall * ux * ux, fall * ux * uy, -x
        change[1, 0], change[1, 1], change[1, 2] = fall * ux * uy, gain + fall * uy * uy, -y
        for r in range(2):
            inner = 0.0
            for j in range(3):
                move[r, j] = change[r, 0] * axes[0, j] + change[r, 1] * axes[1, j] + change[r, 2] * axes[2, j]
                inner += move[r, j] * direction[j]
            for j in range(3):
                k, m = (j + 1) % 3, (j + 2) % 3
                wrench[row + r, 3 + j] = move[r, k] * direction[m] - move[r, m] * direction[k]
            if entries[e, 2]:
                for j in range(3):
                    wrench[row + r, j] = (inner * direction[j] - move[r, j]) / distance
                for j in range(3):
                    k, m = (j + 1) % 3, (j + 2) % 3
                    wrench[row + r, 3 + j] -= wrench[row + r, k] * place[m] - wrench[row + r, m] * place[k]


@compiled(error_model="numpy")
def _mass_centers(
    tables: Array,
    entries: Integers,
    bodies: Array,
    parents: Integers,
    column: Integers,
    joints: Array,
    columns: Array,
    value: Array,
    jacobian: Array,
) -> None:
    """Rows of the centre of mass: what hangs on a joint moves with it, so each column needs its subtree's moment."""
    count = len(bodies)
    moment = np.zeros((count, 4))  # mass, and mass times centre in the world
    for j in range(1, count):
        mass = bodies[j, 0]
        moment[j, 0] = mass
        for i in range(3):
            center = joints[j, 3, i]
            for k in range(3):
                center += joints[j, k, i] * bodies[j, 1 + k]
            moment[j, 1 + i] = mass * center
    for j in range(count - 1, 0, -1):
        for i in range(4):
            moment[parents[j, 0], i] += moment[j, i]
    total = moment[0, 0]
    for e in range(len(tables)):
        row = entries[e, 0]
        a, b, c = tables[e, 0], tables[e, 1], tables[e, 2]
        value[row] = (a * moment[0, 1] + b * moment[0, 2] + c * moment[0, 3]) / total - tables[e, 3]
        for k in range(len(columns)):
            j = column[k, 1]
            mass, x, y, z = moment[j, 0], moment[j, 1], moment[j, 2], moment[j, 3]
            jacobian[row, column[k, 0]] += (
                a * (mass * columns[k, 0] + columns[k, 4] * z - columns[k, 5] * y)
                + b * (mass * columns[k, 1] + columns[k, 5] * x - columns[k, 3] * z)
                + c * (mass * columns[k, 2] + columns[k, 3] * y - columns[k, 4] * x)
            ) / total


@compiled()
def _box(limits: Array, places: Integers, boxes: Array, q: Array, box: Array) -> None:
    for v in range(box.shape[1]):
        box[0, v], box[1, v] = -np.inf, np.inf
    for e in range(len(limits)):
        box[0, places[e, 1]] = limits[e, 0] - q[places[e, 0]]
        box[1, places[e, 1]] = limits[e, 1] - q[places[e, 0]]
    for e in range(0, len(boxes), 2):
        # a joint out of its limits comes back no faster than the bound lets it
        for v in range(box.shape[1]):
            low, high = boxes[e, v], boxes[e + 1, v]
            box[0, v] = min(max(box[0, v], low), high)
            box[1, v] = min(max(box[1, v], low), high)


@compiled()
def _measures(
    distances: Array, distance_places: Integers, joints: Array, joint_places: Integers, q: Array, measure: Array
) -> None:
    """See `tasks.distance.SquaredDistance` and `tasks.Discomfort`."""
    last = measure.shape[1] - 1
    for e in range(len(distances)):
        away = q[distance_places[e, 0]] - distances[e, 1]
        measure[0, last] += distances[e, 0] * away * away
        measure[0, distance_places[e, 1]] += 2.0 * distances[e, 0] * away
    for e in range(len(joints)):
        at, v = q[joint_places[e, 0]], joint_places[e, 1]
        factor, away, own = joints[e, 0], at - joints[e, 1], joints[e, 2]
        measure[0, last] += factor * own * away * away
        slope, bend = 2.0 * own * away, 0.0
        for side in range(2):
            rate = joints[e, 5 + side]
            phase = min(max((at - joints[e, 3 + side]) * rate, 0.0), STEEPNESS)
            cosine, sine = np.cos(phase), np.sin(phase)
            base = cosine ** (POWER - 2)
            measure[0, last] += factor * base * cosine * cosine
            slope -= POWER * base * cosine * sine * rate
            bend += max(POWER * base * ((POWER - 1) * sine * sine - cosine * cosine) * rate * rate, 0.0)
        measure[0, v] += factor * slope
        measure[1, v] += factor * (2.0 * own + bend)

"""A plan's terms at a posture, to first order, as compiled loops: see `term_plan` and `linearisation`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.geometry.records import RowRoom
from wholebody.tasks.discomfort import POWER, STEEPNESS
from wholebody.terms.coordinate_kernel import (
    balls,
    coordinates,
    coupled_ranges,
    elliptic_ranges,
    heights,
    rhythms,
    root_distances,
    roots,
    turns,
)
from wholebody.terms.entries import (
    AXIS,
    BALL,
    BODY,
    BOX,
    COLUMN,
    CONE,
    COORDINATE,
    COUPLED,
    CURVATURE,
    DISCOMFORT,
    DISTANCE,
    EDGE,
    ELEVATION,
    ELLIPSE,
    HEIGHT,
    LIMIT,
    LUMBAR,
    MASS_CENTER,
    PLANE,
    RESIDUAL,
    ROOT,
    ROOT_DISTANCE,
    TURN,
    TWIST,
    Integers,
    Pose,
    TermRoom,
    TermTables,
)
from wholebody.terms.residual_kernel import axis_errors, cones, planes, residuals, twists


@compiled(inner=True)
def _floats(tables: TermTables, table: int) -> Array:
    start, rows, columns = tables.layout[table, 0], tables.layout[table, 1], tables.layout[table, 2]
    return tables.floats[start : start + rows * columns].reshape((rows, columns))


@compiled(inner=True)
def _integers(tables: TermTables, table: int) -> Integers:
    start, rows, columns = tables.layout[table, 3], tables.layout[table, 4], tables.layout[table, 5]
    return tables.integers[start : start + rows * columns].reshape((rows, columns))


@compiled(error_model="numpy")
def linearise(pose: Pose, tables: TermTables, contacts: RowRoom, count: int, room: TermRoom) -> None:
    """Values and Jacobian rows of all terms of a plan, then the Jacobian rows of contacts; bounds and measures.

    Args:
        pose: the posture.
        tables: of the plan.
        contacts: the contacts' rows.
        count: how many there are.
        room: for the answers.
    """
    room.jacobian[: len(room.value)] = 0.0
    room.wrench[:] = 0.0
    _wrench_terms(pose, tables, contacts, count, room)
    _coordinate_terms(pose, tables, room)
    _box(_floats(tables, LIMIT), _integers(tables, LIMIT), _floats(tables, BOX), pose.q, room.box)
    _measure_terms(pose, tables, room)


@compiled(inner=True, error_model="numpy")
def _wrench_terms(pose: Pose, tables: TermTables, contacts: RowRoom, count: int, room: TermRoom) -> None:
    """Terms whose rows are wrenches between two joints, the contacts' rows, and the centre of mass."""
    joints, columns, jacobian, wrench, value = pose.joints, pose.columns, room.jacobian, room.wrench, room.value
    column, bodies = _integers(tables, COLUMN), _integers(tables, BODY)
    residuals(_floats(tables, RESIDUAL), _integers(tables, RESIDUAL), joints, wrench, value)
    planes(_floats(tables, PLANE), _integers(tables, PLANE), joints, wrench, value)
    axis_errors(_floats(tables, AXIS), _integers(tables, AXIS), joints, wrench, value)
    cones(
        _floats(tables, CONE), _integers(tables, CONE), _floats(tables, EDGE), joints, wrench, value
    )  # fmt: skip
    twists(_floats(tables, TWIST), _integers(tables, TWIST), joints, wrench, value)
    for table, rows in ((RESIDUAL, 0), (PLANE, 1), (AXIS, 2), (CONE, 1), (TWIST, 1)):
        entries = _integers(tables, table)
        for e in range(len(entries)):
            against = entries[e, 2] if table in (RESIDUAL, CONE, TWIST) else 0
            height = 3 * (entries[e, 3] + entries[e, 4]) if table == RESIDUAL else rows
            for r in range(entries[e, 0], entries[e, 0] + height):
                _row(wrench[r], entries[e, 1], against, columns, bodies, column, jacobian[r])
    terms, gap_joints, gap_wrench = len(value), contacts.joints, contacts.wrench
    for r in range(count):
        jacobian[terms + r] = 0.0
        first, second = gap_joints[r, 0], gap_joints[r, 1]
        _row(gap_wrench[r], second, first, columns, bodies, column, jacobian[terms + r])
    if tables.layout[MASS_CENTER, 1]:
        _mass_centers(pose, tables, room)


@compiled(inner=True, error_model="numpy")
def _coordinate_terms(pose: Pose, tables: TermTables, room: TermRoom) -> None:
    """Terms of joint coordinates."""
    q, value, jacobian = pose.q, room.value, room.jacobian
    coordinates(_floats(tables, COORDINATE), _integers(tables, COORDINATE), q, value, jacobian)
    turns(_floats(tables, TURN), _integers(tables, TURN), q, value, jacobian)
    roots(_floats(tables, ROOT), _integers(tables, ROOT), q, value, jacobian)
    coupled_ranges(_floats(tables, COUPLED), _integers(tables, COUPLED), q, value, jacobian)
    elliptic_ranges(_floats(tables, ELLIPSE), _integers(tables, ELLIPSE), q, value, jacobian)


@compiled(inner=True, error_model="numpy")
def _measure_terms(pose: Pose, tables: TermTables, room: TermRoom) -> None:
    """Value, derivative and curvature of the measures."""
    q, measure, squares = pose.q, room.measure, room.squares
    constant, nv = _floats(tables, CURVATURE), measure.shape[1] - 1
    for v in range(nv):
        measure[0, v] = 0.0
        measure[1, v] = constant[0, v]
    measure[0, nv] = measure[1, nv] = 0.0
    if len(squares):
        measure[2] = 0.0
    _measures(
        _floats(tables, DISTANCE), _integers(tables, DISTANCE), _floats(tables, DISCOMFORT),
        _integers(tables, DISCOMFORT), q, measure,
    )  # fmt: skip
    root_distances(_floats(tables, ROOT_DISTANCE), _integers(tables, ROOT_DISTANCE), q, measure)
    rhythmic = tables.layout[ELEVATION, 1] + tables.layout[LUMBAR, 1]
    if rhythmic:
        rhythms(
            _floats(tables, ELEVATION), _integers(tables, ELEVATION), _floats(tables, LUMBAR),
            _integers(tables, LUMBAR), q, measure, squares,
        )  # fmt: skip
    if tables.layout[BALL, 1]:
        balls(_floats(tables, BALL), _integers(tables, BALL), q, measure, squares, rhythmic)
    if tables.layout[HEIGHT, 1]:
        heights(
            _floats(tables, HEIGHT), _integers(tables, HEIGHT), pose.joints, pose.columns, tables.support,
            _integers(tables, COLUMN), measure,
        )  # fmt: skip


@compiled(error_model="numpy")
def wrench_rows(wrench: Array, joint: int, against: int, columns: Array, tables: TermTables, rows: Array) -> None:
    """Write the Jacobian rows (m, nv) of wrenches (m, 6) that work on the motion of a joint relative to another.

    `columns` and `tables` are those of `linearise`.
    """
    column, bodies = _integers(tables, COLUMN), _integers(tables, BODY)
    rows[:] = 0.0
    for r in range(len(wrench)):
        _row(wrench[r], joint, against, columns, bodies, column, rows[r])


@compiled(inner=True)
def _row(
    wrench: Array, joint: int, against: int, columns: Array, bodies: Integers, column: Integers, row: Array
) -> None:
    """Add to a row (nv,) the rates at which a wrench works on the motion of a joint relative to another.

    Only the columns of joints between the two count: those of what carries both would cancel.
    """
    a, b, c, d, e, f = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    while joint != against:  # a joint's number is larger than its parent's
        sign, at = (1.0, joint) if joint > against else (-1.0, against)
        for k in range(bodies[at, 1], bodies[at, 1] + bodies[at, 2]):
            row[column[k, 0]] += sign * (
                a * columns[k, 0]
                + b * columns[k, 1]
                + c * columns[k, 2]
                + d * columns[k, 3]
                + e * columns[k, 4]
                + f * columns[k, 5]
            )
        if joint > against:
            joint = bodies[at, 0]
        else:
            against = bodies[at, 0]


@compiled(inner=True, error_model="numpy")
def _mass_centers(pose: Pose, tables: TermTables, room: TermRoom) -> None:
    """Rows of the centre of mass: what hangs on a joint moves with it, so each column needs its subtree's moment."""
    centers, entries = _floats(tables, MASS_CENTER), _integers(tables, MASS_CENTER)
    bodies, parents, column = _floats(tables, BODY), _integers(tables, BODY), _integers(tables, COLUMN)
    joints, columns, value, jacobian = pose.joints, pose.columns, room.value, room.jacobian
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
    for e in range(len(centers)):
        inner = centers[e, 0] * moment[0, 1] + centers[e, 1] * moment[0, 2] + centers[e, 2] * moment[0, 3]
        value[entries[e, 0]] = inner / total - centers[e, 3]
    for k in range(len(columns)):
        j = column[k, 1]
        mass, x, y, z = moment[j, 0] / total, moment[j, 1] / total, moment[j, 2] / total, moment[j, 3] / total
        forth = mass * columns[k, 0] + columns[k, 4] * z - columns[k, 5] * y
        left = mass * columns[k, 1] + columns[k, 5] * x - columns[k, 3] * z
        up = mass * columns[k, 2] + columns[k, 3] * y - columns[k, 4] * x
        for e in range(len(centers)):
            along = centers[e, 0] * forth + centers[e, 1] * left + centers[e, 2] * up
            jacobian[entries[e, 0], column[k, 0]] += along


@compiled(inner=True)
def _box(limits: Array, places: Integers, boxes: Array, q: Array, box: Array) -> None:
    for v in range(box.shape[1]):
        box[0, v], box[1, v] = -np.inf, np.inf
    for e in range(len(limits)):
        low, high = limits[e, 0] - q[places[e, 0]], limits[e, 1] - q[places[e, 0]]
        # a joint that is to brake goes a share of the way that is left, and comes back the whole way
        box[0, places[e, 1]] = low * limits[e, 2] if low < 0.0 else low
        box[1, places[e, 1]] = high * limits[e, 2] if high > 0.0 else high
    for e in range(0, len(boxes), 2):
        # a joint out of its limits comes back no faster than the bound lets it
        for v in range(box.shape[1]):
            low, high = boxes[e, v], boxes[e + 1, v]
            box[0, v] = min(max(box[0, v], low), high)
            box[1, v] = min(max(box[1, v], low), high)


@compiled(inner=True)
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

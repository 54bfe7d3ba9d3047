"""A plan's terms at a posture, to first order, as compiled loops: see `term_plan` and `linearisation`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
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
)
from wholebody.terms.residual_kernel import axis_errors, cones, planes, residuals, twists


@compiled(inner=True)
def _floats(flat: Array, layout: Integers, table: int) -> Array:
    start, rows, columns = layout[table, 0], layout[table, 1], layout[table, 2]
    return flat[start : start + rows * columns].reshape((rows, columns))


@compiled(inner=True)
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
    squares: Array,
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
        measure: (2, nv + 1) room for the gradient and the value, and for the curvature; with squares a third row is
            for their part of the curvature.
        squares: (s, nv) room for the rows S of measures that are sums of squares, whose second derivative is S' S;
            (0, nv) if they are not asked for.
    """
    nv = jacobian.shape[1]
    terms = len(value)
    column, bodies = _integers(integers, layout, COLUMN), _integers(integers, layout, BODY)
    jacobian[:terms] = 0.0
    wrench[:] = 0.0
    residuals(_floats(floats, layout, RESIDUAL), _integers(integers, layout, RESIDUAL), joints, wrench, value)
    if layout[PLANE, 1]:
        planes(_floats(floats, layout, PLANE), _integers(integers, layout, PLANE), joints, wrench, value)
    if layout[AXIS, 1]:
        axis_errors(_floats(floats, layout, AXIS), _integers(integers, layout, AXIS), joints, wrench, value)
    if layout[CONE, 1]:
        cones(
            _floats(floats, layout, CONE), _integers(integers, layout, CONE), _floats(floats, layout, EDGE), joints,
            wrench, value,
        )  # fmt: skip
    if layout[TWIST, 1]:
        twists(_floats(floats, layout, TWIST), _integers(integers, layout, TWIST), joints, wrench, value)
    for table, rows in ((RESIDUAL, 0), (PLANE, 1), (AXIS, 2), (CONE, 1), (TWIST, 1)):
        entries = _integers(integers, layout, table)
        for e in range(len(entries)):
            against = entries[e, 2] if table in (RESIDUAL, CONE, TWIST) else 0
            count = 3 * (entries[e, 3] + entries[e, 4]) if table == RESIDUAL else rows
            for r in range(entries[e, 0], entries[e, 0] + count):
                _row(wrench[r], entries[e, 1], against, columns, bodies, column, jacobian[r])
    for r in range(gaps):
        jacobian[terms + r] = 0.0
        _row(gap_wrench[r], gap_joints[r, 1], gap_joints[r, 0], columns, bodies, column, jacobian[terms + r])
    centers = _floats(floats, layout, MASS_CENTER)
    if len(centers):
        _mass_centers(
            centers, _integers(integers, layout, MASS_CENTER), _floats(floats, layout, BODY), bodies, column, joints,
            columns, value, jacobian,
        )  # fmt: skip
    if layout[COORDINATE, 1]:
        coordinates(
            _floats(floats, layout, COORDINATE), _integers(integers, layout, COORDINATE), q, value, jacobian
        )  # fmt: skip
    if layout[TURN, 1]:
        turns(_floats(floats, layout, TURN), _integers(integers, layout, TURN), q, value, jacobian)
    if layout[ROOT, 1]:
        roots(_floats(floats, layout, ROOT), _integers(integers, layout, ROOT), q, value, jacobian)
    if layout[COUPLED, 1]:
        coupled_ranges(
            _floats(floats, layout, COUPLED), _integers(integers, layout, COUPLED), q, value, jacobian
        )  # fmt: skip
    if layout[ELLIPSE, 1]:
        elliptic_ranges(
            _floats(floats, layout, ELLIPSE), _integers(integers, layout, ELLIPSE), q, value, jacobian
        )  # fmt: skip
    _box(_floats(floats, layout, LIMIT), _integers(integers, layout, LIMIT), _floats(floats, layout, BOX), q, box)
    constant = _floats(floats, layout, CURVATURE)
    for v in range(nv):
        measure[0, v] = 0.0
        measure[1, v] = constant[0, v]
    measure[0, nv] = measure[1, nv] = 0.0
    if len(squares):
        measure[2] = 0.0
    _measures(
        _floats(floats, layout, DISTANCE), _integers(integers, layout, DISTANCE), _floats(floats, layout, DISCOMFORT),
        _integers(integers, layout, DISCOMFORT), q, measure,
    )  # fmt: skip
    root_distances(_floats(floats, layout, ROOT_DISTANCE), _integers(integers, layout, ROOT_DISTANCE), q, measure)
    if layout[ELEVATION, 1] + layout[LUMBAR, 1]:
        rhythms(
            _floats(floats, layout, ELEVATION), _integers(integers, layout, ELEVATION), _floats(floats, layout, LUMBAR),
            _integers(integers, layout, LUMBAR), q, measure, squares,
        )  # fmt: skip
    if layout[BALL, 1]:
        balls(
            _floats(floats, layout, BALL), _integers(integers, layout, BALL), q, measure, squares,
            layout[ELEVATION, 1] + layout[LUMBAR, 1],
        )  # fmt: skip
    if layout[HEIGHT, 1]:
        heights(
            _floats(floats, layout, HEIGHT), _integers(integers, layout, HEIGHT), joints, columns, support, column,
            measure,
        )  # fmt: skip


@compiled(error_model="numpy")
def wrench_rows(
    wrench: Array, joint: int, against: int, columns: Array, integers: Integers, layout: Integers, rows: Array
) -> None:
    """Write the Jacobian rows (m, nv) of wrenches (m, 6) that work on the motion of a joint relative to another.

    `columns`, `integers` and `layout` are as for `linearise`.
    """
    column, bodies = _integers(integers, layout, COLUMN), _integers(integers, layout, BODY)
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
        inner = tables[e, 0] * moment[0, 1] + tables[e, 1] * moment[0, 2] + tables[e, 2] * moment[0, 3]
        value[entries[e, 0]] = inner / total - tables[e, 3]
    for k in range(len(columns)):
        j = column[k, 1]
        mass, x, y, z = moment[j, 0] / total, moment[j, 1] / total, moment[j, 2] / total, moment[j, 3] / total
        forth = mass * columns[k, 0] + columns[k, 4] * z - columns[k, 5] * y
        left = mass * columns[k, 1] + columns[k, 5] * x - columns[k, 3] * z
        up = mass * columns[k, 2] + columns[k, 3] * y - columns[k, 4] * x
        for e in range(len(tables)):
            jacobian[entries[e, 0], column[k, 0]] += tables[e, 0] * forth + tables[e, 1] * left + tables[e, 2] * up


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

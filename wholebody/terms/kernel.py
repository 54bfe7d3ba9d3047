"""A plan's terms at a posture, to first order, as compiled loops: see `plan` and `linearisation`.

Those of `seldom_kernel` are added afterwards; the first solve of most people and robots need not wait for their loops.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.patch_kernel import TableArrays, contact_rows
from wholebody.geometry.proximity_kernel import gather
from wholebody.tasks.discomfort import POWER, STEEPNESS
from wholebody.terms import entries as kinds
from wholebody.terms.coordinate_kernel import Table, coupled_ranges, elliptic_ranges, rhythms, root_distances
from wholebody.terms.entries import Integers
from wholebody.terms.residual_kernel import cones, residuals, twists

Plan: TypeAlias = tuple[Array, Integers, Integers, NDArray[np.int8]]
"""Floats, integers, layout and support of a `TermPlan`."""

Tree: TypeAlias = tuple[Array, Integers, Integers]
"""Columns of the joint Jacobian (n, 6), the degree of freedom of each, and the parents of the bodies."""

NearArrays: TypeAlias = tuple[Array, Array, Indices, Indices, Array, Array, Array, Indices, Indices, Array]
"""Room for contacts and their rows; see `linearise`."""


@compiled(inner=True)
def floats_of(flat: Array, layout: Integers, table: int) -> Array:
    """A table of floats, a view."""
    start, rows, columns = layout[table, 0], layout[table, 1], layout[table, 2]
    return flat[start : start + rows * columns].reshape((rows, columns))


@compiled(inner=True)
def integers_of(flat: Integers, layout: Integers, table: int) -> Integers:
    """A table of integers, a view."""
    start, rows, columns = layout[table, 3], layout[table, 4], layout[table, 5]
    return flat[start : start + rows * columns].reshape((rows, columns))


@compiled(inner=True)
def table_of(plan: Plan, table: int) -> Table:
    """The floats and the integers of a table."""
    floats, integers, layout, _ = plan
    return floats_of(floats, layout, table), integers_of(integers, layout, table)


@compiled(error_model="numpy")
def linearise(
    state: tuple[Array, Array, Array, Array], plan: Plan, asked: tuple[Array, Indices, Indices, Array, Array, float],
    clearances: Array, pieces: TableArrays, near: NearArrays, known: int,
    room: tuple[Array, Array, Array, Array, Array, Array],
) -> tuple[int, int, bool]:  # fmt: skip
    """Values and Jacobian rows of terms of a plan, then contacts and their Jacobian rows; bounds and measures.

    Args:
        state: placements of the joints (njoints, 4, 3), see `placement_view`; columns of the joint Jacobian (n, 6), in
            the world; the posture (nq,); placements of the pieces (p, 4, 3).
        plan: of the terms.
        asked: what `gather` takes: results of coal, the pairs (k,) that were asked; pairs, `travelled` and `bound`;
            metres within which pairs are near.
        clearances: (2, pairs) clearance of each pair, and metres in place of `within` where they are less.
        pieces: their arrays.
        near: room for distances (k,), normals and points (3, k, 3), numbers (k,) and pieces (k, 2) of the contacts, and
            for the distance asked of each (k,); for wrench, gap, contact and joints of their rows, and for the
            clearance of each.
        known: how many contacts are in their room already; less than 0 to gather them.
        room: for the terms' wrenches (terms' rows, 6) and values (terms' rows,), for all rows (terms' rows + gaps, nv),
            for the bounds on the displacement (2, nv), for the gradient and the value of the measures and for their
            curvature (2, nv + 1), and for the rows S (s, nv) of measures that are sums of squares, whose second
            derivative is S' S: (0, nv) if they are not asked for, otherwise a third row of the measures' room is for
            their part of the curvature.

    Returns:
        How many contacts there are, how many rows of them, and whether one needs its normal repaired: then there are
        no rows yet.
    """
    joints, columns, q, placement = state
    results, index, pairs, travelled, bound, within = asked
    distance, vectors, number, pair, least, gap_wrench, gap, gap_contact, gap_joints, gap_clearance = near
    wrench, value, jacobian, box, measure, squares = room
    floats, integers, layout, _ = plan
    terms = len(value)
    column, bodies = integers_of(integers, layout, kinds.COLUMN), integers_of(integers, layout, kinds.BODY)
    tree = (columns, column, bodies)
    jacobian[:terms] = 0.0
    wrench[:] = 0.0
    _wrench_terms(plan, joints, tree, wrench, value, jacobian)
    if layout[kinds.COUPLED, 1]:
        coupled_ranges(*table_of(plan, kinds.COUPLED), q, value, jacobian)
    if layout[kinds.ELLIPSE, 1]:
        elliptic_ranges(*table_of(plan, kinds.ELLIPSE), q, value, jacobian)
    limits, limit_places = table_of(plan, kinds.LIMIT)
    _box(limits, limit_places, floats_of(floats, layout, kinds.BOX), q, box)
    _measures(plan, q, measure, squares)
    if known < 0:
        given = (pairs, travelled, bound)
        known, broken = gather(results, index, given, within, clearances[1], (distance, vectors, number, pair))
        if broken:
            return known, 0, True
    for c in range(known):
        least[c] = clearances[0, number[c]]
    contacts = (
        pair[:known], distance[:known], vectors[0][:known], vectors[1][:known], vectors[2][:known], number[:known],
        placement,
    )  # fmt: skip
    # called last, so that another process has compiled it meanwhile: see `base.compiled.SHARED`
    gaps = contact_rows(contacts, least, pieces, (gap_wrench, gap, gap_contact, gap_joints))
    for r in range(gaps):
        gap_clearance[r] = least[gap_contact[r]]
        jacobian[terms + r] = 0.0
        wrench_row(gap_wrench[r], gap_joints[r, 1], gap_joints[r, 0], columns, bodies, column, jacobian[terms + r])
    return known, gaps, False


@compiled(inner=True)
def _wrench_terms(plan: Plan, joints: Array, tree: Tree, wrench: Array, value: Array, jacobian: Array) -> None:
    """Terms whose rows are wrenches on one or two bodies."""
    floats, integers, layout, _ = plan
    columns, column, bodies = tree
    residuals(*table_of(plan, kinds.RESIDUAL), joints, wrench, value)
    if layout[kinds.CONE, 1]:
        cones(*table_of(plan, kinds.CONE), floats_of(floats, layout, kinds.EDGE), joints, wrench, value)
    if layout[kinds.TWIST, 1]:
        twists(*table_of(plan, kinds.TWIST), joints, wrench, value)
    for table in (kinds.RESIDUAL, kinds.CONE, kinds.TWIST):
        entries = integers_of(integers, layout, table)
        for e in range(len(entries)):
            count = 3 * (entries[e, 3] + entries[e, 4]) if table == kinds.RESIDUAL else 1
            for r in range(entries[e, 0], entries[e, 0] + count):
                wrench_row(wrench[r], entries[e, 1], entries[e, 2], columns, bodies, column, jacobian[r])


@compiled(inner=True)
def _measures(plan: Plan, q: Array, measure: Array, squares: Array) -> None:
    """Gradient, value and curvature of the measures, and rows of those that are sums of squares."""
    floats, _, layout, _ = plan
    constant = floats_of(floats, layout, kinds.CURVATURE)
    nv = measure.shape[1] - 1
    for v in range(nv):
        measure[0, v] = 0.0
        measure[1, v] = constant[0, v]
    measure[0, nv] = measure[1, nv] = 0.0
    if len(squares):
        measure[2] = 0.0
    _distances(*table_of(plan, kinds.DISTANCE), q, measure)
    _discomforts(*table_of(plan, kinds.DISCOMFORT), q, measure)
    if layout[kinds.ROOT_DISTANCE, 1]:
        root_distances(*table_of(plan, kinds.ROOT_DISTANCE), q, measure)
    if layout[kinds.ELEVATION, 1] + layout[kinds.LUMBAR, 1]:
        rhythms(table_of(plan, kinds.ELEVATION), table_of(plan, kinds.LUMBAR), q, measure, squares)


@compiled(error_model="numpy")
def wrench_rows(wrench: Array, joint: int, against: int, columns: Array, plan: Plan, rows: Array) -> None:
    """Write the Jacobian rows (m, nv) of wrenches (m, 6) that work on the motion of a joint relative to another."""
    _, integers, layout, _ = plan
    column, bodies = integers_of(integers, layout, kinds.COLUMN), integers_of(integers, layout, kinds.BODY)
    rows[:] = 0.0
    for r in range(len(wrench)):
        wrench_row(wrench[r], joint, against, columns, bodies, column, rows[r])


@compiled(inner=True)
def wrench_row(
    wrench: Array, joint: int, against: int, columns: Array, bodies: Integers, column: Integers, row: Array
) -> None:
    """Add to a row (nv,) the rates of a wrench on a joint's motion relative to another: of columns between the two."""
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


@compiled(inner=True)
def _box(limits: Array, places: Integers, boxes: Array, q: Array, box: Array) -> None:
    for v in range(box.shape[1]):
        box[0, v], box[1, v] = -np.inf, np.inf
    for e in range(len(limits)):
        low, high = limits[e, 0] - q[places[e, 0]], limits[e, 1] - q[places[e, 0]]
        # a joint that brakes moves a share of the remaining distance, and returns the whole distance
        box[0, places[e, 1]] = low * limits[e, 2] if low < 0.0 else low
        box[1, places[e, 1]] = high * limits[e, 2] if high > 0.0 else high
    for e in range(0, len(boxes), 2):
        for v in range(box.shape[1]):  # a joint out of its limits comes back no faster than the bound lets it
            low, high = boxes[e, v], boxes[e + 1, v]
            box[0, v] = min(max(box[0, v], low), high)
            box[1, v] = min(max(box[1, v], low), high)


@compiled(inner=True)
def _distances(distances: Array, places: Integers, q: Array, measure: Array) -> None:
    """See `tasks.distance.SquaredDistance`."""
    last = measure.shape[1] - 1
    for e in range(len(distances)):
        away = q[places[e, 0]] - distances[e, 1]
        measure[0, last] += distances[e, 0] * away * away
        measure[0, places[e, 1]] += 2.0 * distances[e, 0] * away


@compiled(inner=True)
def _discomforts(joints: Array, places: Integers, q: Array, measure: Array) -> None:
    """See `tasks.Discomfort`."""
    last = measure.shape[1] - 1
    for e in range(len(joints)):
        at, v = q[places[e, 0]], places[e, 1]
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

"""Terms and measures of a plan that few problems have, as compiled loops: what `kernel.linearise` leaves out."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.terms import entries as kinds
from wholebody.terms.coordinate_kernel import Table, balls, coordinates, hangs, heights, roots, turns
from wholebody.terms.entries import Integers
from wholebody.terms.kernel import Plan, Tree, floats_of, integers_of, table_of, wrench_row
from wholebody.terms.residual_kernel import axis_errors, planes


@compiled(error_model="numpy")
def add_seldom(
    joints: Array, columns: Array, q: Array, plan: Plan, room: tuple[Array, Array, Array, Array, Array]
) -> None:
    """Write the values and rows of these terms, and add these measures; see `kernel.linearise`.

    `room`: for the terms' wrenches, values and rows, for the measures, and for the rows of squares.
    """
    wrench, value, jacobian, measure, squares = room
    floats, integers, layout, support = plan
    column, bodies = integers_of(integers, layout, kinds.COLUMN), integers_of(integers, layout, kinds.BODY)
    if layout[kinds.PLANE, 1]:
        planes(*table_of(plan, kinds.PLANE), joints, wrench, value)
    if layout[kinds.AXIS, 1]:
        axis_errors(*table_of(plan, kinds.AXIS), joints, wrench, value)
    for table, rows in ((kinds.PLANE, 1), (kinds.AXIS, 2)):
        entries = integers_of(integers, layout, table)
        for e in range(len(entries)):
            for r in range(entries[e, 0], entries[e, 0] + rows):
                wrench_row(wrench[r], entries[e, 1], 0, columns, bodies, column, jacobian[r])
    if layout[kinds.MASS_CENTER, 1]:
        masses = floats_of(floats, layout, kinds.BODY)
        _mass_centers(table_of(plan, kinds.MASS_CENTER), masses, joints, (columns, column, bodies), value, jacobian)
    if layout[kinds.COORDINATE, 1]:
        coordinates(*table_of(plan, kinds.COORDINATE), q, value, jacobian)
    if layout[kinds.TURN, 1]:
        turns(*table_of(plan, kinds.TURN), q, value, jacobian)
    if layout[kinds.ROOT, 1]:
        roots(*table_of(plan, kinds.ROOT), q, value, jacobian)
    first = layout[kinds.ELEVATION, 1] + layout[kinds.LUMBAR, 1]
    if layout[kinds.BALL, 1]:
        balls(*table_of(plan, kinds.BALL), q, measure, squares, first)
    if layout[kinds.HANG, 1]:
        first += 3 * layout[kinds.BALL, 1]
        hangs(table_of(plan, kinds.HANG), joints, (columns, column, support), measure, squares, first)
    if layout[kinds.HEIGHT, 1]:
        heights(*table_of(plan, kinds.HEIGHT), joints, (columns, column, support), measure)


@compiled(inner=True)
def _moments(bodies: Array, joints: Array, parents: Integers) -> Array:
    """Mass of each subtree, and its mass times its centre in the world (njoints, 4)."""
    count = len(bodies)
    moment = np.zeros((count, 4))
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
    return moment


@compiled(inner=True, error_model="numpy")
def _mass_centers(table: Table, bodies: Array, joints: Array, tree: Tree, value: Array, jacobian: Array) -> None:
    """Rows of the centre of mass of one figure or all: each column needs its subtree's moment."""
    tables, entries = table
    columns, column, parents = tree
    count = len(bodies)
    moment = _moments(bodies, joints, parents)
    whole = np.empty(4)
    begin = 0
    while begin < len(tables):
        first, last, end = entries[begin, 1], entries[begin, 2], begin
        while end < len(tables) and entries[end, 1] == first and entries[end, 2] == last:
            end += 1
        for i in range(4):
            whole[i] = moment[0, i]
        if first > 1 or last < count:
            whole[:] = 0.0
            for j in range(first, last):
                for i in range(4 if parents[j, 0] == 0 else 0):
                    whole[i] += moment[j, i]
        total = whole[0]
        for e in range(begin, end):
            inner = tables[e, 0] * whole[1] + tables[e, 1] * whole[2] + tables[e, 2] * whole[3]
            value[entries[e, 0]] = inner / total - tables[e, 3]
        for k in range(len(columns)):
            j = column[k, 1]
            if j < first or j >= last:
                continue
            mass, x, y, z = moment[j, 0] / total, moment[j, 1] / total, moment[j, 2] / total, moment[j, 3] / total
            forth = mass * columns[k, 0] + columns[k, 4] * z - columns[k, 5] * y
            left = mass * columns[k, 1] + columns[k, 5] * x - columns[k, 3] * z
            up = mass * columns[k, 2] + columns[k, 3] * y - columns[k, 4] * x
            for e in range(begin, end):
                jacobian[entries[e, 0], column[k, 0]] += tables[e, 0] * forth + tables[e, 1] * left + tables[e, 2] * up
        begin = end


def compiled_kernel() -> ModuleType:
    """This module, with its loop compiled or loaded from the cache."""
    none, rows, places = np.zeros(0), np.zeros((0, 6)), np.zeros(0, dtype=np.int64)
    plan = none, places, np.zeros((kinds.EDGE + 1, 6), dtype=np.int64), np.zeros((0, 0), dtype=np.int8)
    add_seldom(np.zeros((0, 4, 3)), rows, none, plan, (rows, none, rows, rows, rows))
    return sys.modules[__name__]

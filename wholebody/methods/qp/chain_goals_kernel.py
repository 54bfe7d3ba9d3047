"""Joints of a chain and what they are to reach: placements, errors and their rows, as compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import dot
from wholebody.terms.entries import Integers
from wholebody.terms.residual_kernel import axis_errors, residuals


class Chain(NamedTuple):
    """Joints of one degree of freedom each that carry the frames of some goals."""

    parents: Indices  # (n,) joint that each joint hangs on, 0 being the world; joint k is number k + 1
    places: Array  # (n, 4, 3) its placement in its parent at zero: columns of the rotation, then the translation
    turns: Array  # (n, 3) axis that it turns about, in its own frame; zero for one that slides
    slides: Array  # (n, 3) axis that it slides along; zero for one that turns
    support: NDArray[np.int8]  # (n + 1, n) 1 where a column moves a joint
    lower: Array  # (n,) least values of the joints
    upper: Array  # (n,) greatest values


class Goals(NamedTuple):
    """Goals and constraints as in tables of `terms.entries`, with the numbers of the chain's joints."""

    tables: Array  # (e, 36) floats of places and rotations
    entries: Integers  # (e, 6) their integers
    axis_tables: Array  # (a, 24) floats of axes
    axis_entries: Integers  # (a, 3) their integers
    plane_tables: Array  # (p, 7) floats of planes
    plane_entries: Integers  # (p, 3) their integers, the last the joint that a plane is fixed to, 0 being the world
    mass_tables: Array  # (c, 4) floats of rows of one centre of mass
    mass_entries: Integers  # (c, 1) their integers: the row
    bodies: Array  # (n + 1, 4) share of the mass that is fixed to each joint, and that times its place there
    one_sided: Mask  # (m,) rows that may be positive too; all of them stand behind the others


class Room(NamedTuple):
    """Room for a descent."""

    joints: Array  # (n + 1, 4, 3) placements of the joints; the first is the world's
    columns: Array  # (n, 6) columns of the joint Jacobian
    wrench: Array  # (m, 6) of the errors
    value: Array  # (m,) the errors
    jacobian: Array  # (m, n) their derivatives
    free: Mask  # (n,) whether a joint moves in the present step
    active: Mask  # (m,) whether a row counts there
    moment: Array  # (n + 1, 4) share of the mass that each joint carries, and that times its place in the world


@compiled(error_model="numpy", fastmath={"contract", "reassoc"})
def evaluate(chain: Chain, goals: Goals, room: Room, q: Array) -> None:
    """Placements of the joints, columns of their Jacobian in the world, and the errors of the goals with wrenches."""
    joints, columns, places, turns, slides = room.joints, room.columns, chain.places, chain.turns, chain.slides
    for k in range(len(q)):
        b, c = chain.parents[k], k + 1
        for i in range(3):
            d, e, f = joints[b, 0, i], joints[b, 1, i], joints[b, 2, i]
            for j in range(4):
                joints[c, j, i] = d * places[k, j, 0] + e * places[k, j, 1] + f * places[k, j, 2]
            joints[c, 3, i] += joints[b, 3, i]
        x, y, z = turns[k, 0], turns[k, 1], turns[k, 2]
        if x == 0.0 and y == 0.0 and z == 0.0:
            for i in range(3):
                slide = joints[c, 0, i] * slides[k, 0] + joints[c, 1, i] * slides[k, 1] + joints[c, 2, i] * slides[k, 2]
                columns[k, i], columns[k, 3 + i] = slide, 0.0
                joints[c, 3, i] += q[k] * slide
            continue
        cosine, sine = np.cos(q[k]), np.sin(q[k])
        for i in range(3):  # Rodrigues, in the joint's frame: the rows of R (c 1 + (1 - c) u u' + s [u])
            d, e, f = joints[c, 0, i], joints[c, 1, i], joints[c, 2, i]
            axis = d * x + e * y + f * z
            along = (1.0 - cosine) * axis
            joints[c, 0, i] = cosine * d + sine * (e * z - f * y) + along * x
            joints[c, 1, i] = cosine * e + sine * (f * x - d * z) + along * y
            joints[c, 2, i] = cosine * f + sine * (d * y - e * x) + along * z
            columns[k, 3 + i] = axis
        x, y, z = columns[k, 3], columns[k, 4], columns[k, 5]
        columns[k, 0] = joints[c, 3, 1] * z - joints[c, 3, 2] * y
        columns[k, 1] = joints[c, 3, 2] * x - joints[c, 3, 0] * z
        columns[k, 2] = joints[c, 3, 0] * y - joints[c, 3, 1] * x
    residuals(goals.tables, goals.entries, joints, room.wrench, room.value)
    if len(goals.axis_entries) > 0:  # their arrays take time in every descent
        for row in goals.axis_entries[:, 0]:
            room.wrench[row : row + 2] = 0.0  # of a direction no force is written
        axis_errors(goals.axis_tables, goals.axis_entries, joints, room.wrench, room.value)


@compiled(error_model="numpy")
def evaluate_others(chain: Chain, goals: Goals, room: Room) -> None:
    """The same of planes and of the centre of mass: apart, as within `evaluate` they take a tenth of its time."""
    _planes(goals, room)
    if len(goals.mass_entries) > 0:
        _mass_center(chain, goals, room)


@compiled(inner=True)
def _planes(goals: Goals, room: Room) -> None:
    """Distances of points from planes, with wrenches in the world."""
    tables, point, normal = goals.plane_tables, np.empty(3), np.empty(3)
    for e in range(len(tables)):
        row, joint, base = goals.plane_entries[e, 0], room.joints[goals.plane_entries[e, 1]], goals.plane_entries[e, 2]
        room.value[row] = -tables[e, 6]
        for i in range(3):
            point[i], normal[i] = joint[3, i], 0.0
            for k in range(3):
                point[i] += joint[k, i] * tables[e, k]
                normal[i] += room.joints[base, k, i] * tables[e, 3 + k]
            room.value[row] += normal[i] * (point[i] - room.joints[base, 3, i])
            room.wrench[row, i] = normal[i]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            room.wrench[row, 3 + i] = point[j] * normal[k] - point[k] * normal[j]


@compiled(inner=True, error_model="numpy")
def _mass_center(chain: Chain, goals: Goals, room: Room) -> None:
    """Moments of the mass that joints carry, and the errors of the centre of mass."""
    joints, moment, bodies = room.joints, room.moment, goals.bodies
    for k in range(len(moment)):
        moment[k, 0] = bodies[k, 0]
        for i in range(3):
            moment[k, 1 + i] = bodies[k, 0] * joints[k, 3, i]
            for j in range(3):
                moment[k, 1 + i] += joints[k, j, i] * bodies[k, 1 + j]
    for k in range(len(moment) - 1, 0, -1):
        for i in range(4):
            moment[chain.parents[k - 1], i] += moment[k, i]
    for e in range(len(goals.mass_entries)):
        row, value = goals.mass_entries[e, 0], -goals.mass_tables[e, 3]
        for i in range(3):
            value += goals.mass_tables[e, i] * moment[0, 1 + i]
        room.value[row] = value


@compiled(error_model="numpy")
def rows_of(chain: Chain, goals: Goals, room: Room) -> None:
    """Rows of the goals: the rates at which their wrenches work on the motion of a joint relative to another."""
    entries, axes, support = goals.entries, goals.axis_entries, chain.support
    for e in range(len(entries)):
        for r in range(entries[e, 0], entries[e, 0] + 3 * (entries[e, 3] + entries[e, 4])):
            for k in range(len(room.columns)):
                moved = support[entries[e, 1], k] - support[entries[e, 2], k]
                room.jacobian[r, k] = moved * dot(room.wrench[r], room.columns[k]) if moved != 0 else 0.0
    for e in range(len(axes)):
        for r in range(axes[e, 0], axes[e, 0] + 2):
            for k in range(len(room.columns)):
                room.jacobian[r, k] = support[axes[e, 1], k] * dot(room.wrench[r], room.columns[k])


@compiled(error_model="numpy")
def rows_of_others(chain: Chain, goals: Goals, room: Room) -> None:
    """The same of planes and of the centre of mass."""
    support = chain.support
    for e in range(len(goals.plane_entries)):
        r, joint, base = goals.plane_entries[e]
        for k in range(len(room.columns)):
            moved = support[joint, k] - support[base, k]
            room.jacobian[r, k] = moved * dot(room.wrench[r], room.columns[k]) if moved != 0 else 0.0
    for e in range(len(goals.mass_entries)):
        r, direction = goals.mass_entries[e, 0], goals.mass_tables[e]
        for k in range(len(room.columns)):
            column, carried, rate = room.columns[k], room.moment[k + 1], 0.0
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                turned = column[3 + j] * carried[1 + m] - column[3 + m] * carried[1 + j]
                rate += direction[i] * (carried[0] * column[i] + turned)
            room.jacobian[r, k] = rate

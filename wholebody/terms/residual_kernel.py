"""Errors of frames, planes, axes, reach cones and twists with their wrenches, as compiled loops: see `plan`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.figures.motion_ranges import PARALLEL
from wholebody.figures.motion_ranges import TOUCHING as ON_EDGE
from wholebody.tasks.axis import NO_ANGLE, STEEPEST, TOUCHING
from wholebody.tasks.range_of_motion import OPPOSITE
from wholebody.terms.entries import Integers

SMALL = 1e-4  # angle [rad] below which the series of log and its derivative are exact to rounding


@compiled(inner=True)
def _turned(joint: Array, part: Array, turn: Array) -> None:
    """Rotation (3, 3) in the world of a frame with the rotation `part` (9 or more,) in a joint (4, 3)."""
    for i in range(3):
        for j in range(3):
            turn[i, j] = 0.0
            for k in range(3):
                turn[i, j] += joint[k, i] * part[3 * j + k]


@compiled(inner=True)
def _placed(joints: Array, joint: int, tables: Array, e: int, first: int, place: Array) -> None:
    """Rotation and origin (4, 3) in the world of a frame; its place in a joint (12,) begins at `first` in a row."""
    for i in range(3):
        x, y, z = joints[joint, 0, i], joints[joint, 1, i], joints[joint, 2, i]
        for j in range(4):
            k = first + 3 * j
            place[j, i] = x * tables[e, k] + y * tables[e, k + 1] + z * tables[e, k + 2]
        place[3, i] += joints[joint, 3, i]


@compiled(inner=True, error_model="numpy")
def residuals(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.residuals.PlacementResidual`."""
    room = np.empty((5, 4, 3))
    frame, base, change, left, angle = room[0], room[1], room[2, :3], room[3, :3], room[4, 0]
    for e in range(len(tables)):
        row, position, orientation = entries[e, 0], entries[e, 3], entries[e, 4]
        _placed(joints, entries[e, 1], tables, e, 0, frame)
        if entries[e, 5]:
            _placed(joints, entries[e, 2], tables, e, 12, base)
        else:
            base[:] = 0.0
            base[0, 0] = base[1, 1] = base[2, 2] = 1.0
        if position:
            for i in range(3):
                x, y, z = base[i, 0], base[i, 1], base[i, 2]  # axis i of the base, in the world
                value[row + i] = (
                    x * (frame[3, 0] - base[3, 0]) + y * (frame[3, 1] - base[3, 1]) + z * (frame[3, 2] - base[3, 2])
                    - tables[e, 24 + i]
                )  # fmt: skip
                wrench[row + i, 0], wrench[row + i, 1], wrench[row + i, 2] = x, y, z
                wrench[row + i, 3] = frame[3, 1] * z - frame[3, 2] * y
                wrench[row + i, 4] = frame[3, 2] * x - frame[3, 0] * z
                wrench[row + i, 5] = frame[3, 0] * y - frame[3, 1] * x
            row += 3
        if orientation:
            for i in range(3):
                x, y, z = base[i, 0], base[i, 1], base[i, 2]
                a = x * frame[0, 0] + y * frame[0, 1] + z * frame[0, 2]
                b = x * frame[1, 0] + y * frame[1, 1] + z * frame[1, 2]
                c = x * frame[2, 0] + y * frame[2, 1] + z * frame[2, 2]
                for j in range(3):
                    k = 27 + 3 * j
                    change[i, j] = a * tables[e, k] + b * tables[e, k + 1] + c * tables[e, k + 2]
            rotation_vector(change, angle)
            inverse_left(angle, left)
            for i in range(3):
                value[row + i] = angle[i]
                for j in range(3):
                    wrench[row + i, j] = 0.0
                    wrench[row + i, 3 + j] = left[i, 0] * base[0, j] + left[i, 1] * base[1, j] + left[i, 2] * base[2, j]


@compiled(inner=True, error_model="numpy")
def rotation_vector(turn: Array, angle: Array) -> None:
    """Rotation vector (3,) of a rotation (3, 3), exact at every angle by its quaternion (Shepperd 1978)."""
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


@compiled(inner=True, error_model="numpy")
def inverse_left(angle: Array, left: Array) -> None:
    """Inverse (3, 3) of the left Jacobian of SO(3) at a rotation vector (3,): 1 - [a]/2 + c [a]^2."""
    # c = (1 - (t/2) cot(t/2)) / t^2 at the angle t (Chirikjian 2011, section 10.6)
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


@compiled(inner=True)
def planes(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
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


@compiled(inner=True, error_model="numpy")
def _wanted(given: Array, place: Array, toward: int, direction: Array) -> float:
    """Write the direction (3,) that is given, or that from a place towards a given one, whose distance it returns."""
    distance = 0.0 if toward else np.inf
    for i in range(3):
        direction[i] = given[i]
        if toward:
            direction[i] -= place[i]
            distance += direction[i] * direction[i]
    if toward:
        distance = np.sqrt(distance)
        for i in range(3):
            direction[i] /= max(distance, TOUCHING)
    return distance


@compiled(inner=True, error_model="numpy")
def equidistant(x: float, y: float, along: float, error: Array, change: Array) -> None:
    """Write `tasks.axis.equidistant_error` (2,) and `equidistant_jacobian` (2, 3)."""
    sine = np.hypot(x, y)
    angle = np.arctan2(sine, along)
    if sine < NO_ANGLE:
        error[0], error[1] = angle, 0.0
        gain = 1.0 if along > 0.0 else STEEPEST
    else:
        error[0], error[1] = x * angle / sine, y * angle / sine
        gain = min(angle / sine, STEEPEST)
    ux, uy = (x / sine, y / sine) if sine > NO_ANGLE else (1.0, 0.0)
    fall = along - gain
    change[0, 0], change[0, 1], change[0, 2] = gain + fall * ux * ux, fall * ux * uy, -x
    change[1, 0], change[1, 1], change[1, 2] = fall * ux * uy, gain + fall * uy * uy, -y


@compiled(inner=True, error_model="numpy")
def axis_errors(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.Axis`."""
    frame, axes, direction = np.empty((4, 3)), np.empty((3, 3)), np.empty(3)
    turn, place = frame[:3].T, frame[3]
    error, change, move = np.empty(2), np.empty((2, 3)), np.empty((2, 3))
    for e in range(len(tables)):
        row = entries[e, 0]
        _placed(joints, entries[e, 1], tables, e, 0, frame)
        distance = _wanted(tables[e, 21:24], place, entries[e, 2], direction)
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
        equidistant(x, y, along, error, change)
        value[row], value[row + 1] = error[0], error[1]
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
def cones(tables: Array, entries: Integers, edges: Array, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.ReachCones` and `figures.reach_cones.ReachCone.signed_angle`."""
    turn, world, local, outward = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for e in range(len(tables)):
        row, limb, reference = entries[e, 0], joints[entries[e, 1]], joints[entries[e, 2]]
        for i in range(3):
            world[i] = limb[0, i] * tables[e, 0] + limb[1, i] * tables[e, 1] + limb[2, i] * tables[e, 2]
        _turned(reference, tables[e, 3:12], turn)
        for j in range(3):
            local[j] = turn[0, j] * world[0] + turn[1, j] * world[1] + turn[2, j] * world[2]
        value[row] = signed_angle(edges[entries[e, 4] : entries[e, 4] + entries[e, 3]], local, outward)
        for i in range(3):
            local[i] = turn[i, 0] * outward[0] + turn[i, 1] * outward[1] + turn[i, 2] * outward[2]
        for i in range(3):  # the direction turns as w x d, so the angle changes by g . (w x d) = w . (d x g)
            j, k = (i + 1) % 3, (i + 2) % 3
            wrench[row, 3 + i] = world[j] * local[k] - world[k] * local[j]


@compiled(inner=True, error_model="numpy")
def twists(tables: Array, entries: Integers, joints: Array, wrench: Array, value: Array) -> None:
    """See `tasks.range_of_motion.TwistRow`."""
    limb, base, seen, along = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for e in range(len(tables)):
        row = entries[e, 0]
        _turned(joints[entries[e, 1]], tables[e, :9], limb)
        _turned(joints[entries[e, 2]], tables[e, 9:18], base)
        for i in range(3):
            for j in range(3):
                seen[i, j] = base[0, i] * limb[0, j] + base[1, i] * limb[1, j] + base[2, i] * limb[2, j]
        sine, cosine = seen[1, 0] - seen[0, 1], seen[0, 0] + seen[1, 1]
        square = max(sine * sine + cosine * cosine, OPPOSITE)
        sign = tables[e, 22]
        value[row] = tables[e, 21] - sign * np.arctan2(sine, cosine)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            value[row] += tables[e, 18 + i] * seen[i, 2]
            along[i] = seen[j, 2] * tables[e, 18 + k] - seen[k, 2] * tables[e, 18 + j]
        along[0] -= sign * (sine * seen[2, 1] - cosine * seen[2, 0]) / square
        along[1] += sign * (cosine * seen[2, 1] + sine * seen[2, 0]) / square
        along[2] -= sign
        for i in range(3):
            wrench[row, 3 + i] = base[i, 0] * along[0] + base[i, 1] * along[1] + base[i, 2] * along[2]


@compiled(inner=True)
def _dot(edge: Array, part: int, direction: Array) -> float:
    """A plane of an edge times a direction (3,)."""
    product: float = (
        edge[3 * part] * direction[0] + edge[3 * part + 1] * direction[1] + edge[3 * part + 2] * direction[2]
    )
    return product


@compiled(inner=True, error_model="numpy")
def signed_angle(edges: Array, direction: Array, gradient: Array) -> float:
    """Angle of a unit direction (3,) to the nearest edge (k, 15) of a cone, positive inside; writes its gradient."""
    count = len(edges)
    nearest, best, beside, wedge = 0, -2.0, False, -1
    for i in range(count):
        after = edges[(i + 1) % count]
        height = _dot(edges[i], 0, direction)
        within = _dot(edges[i], 1, direction) >= 0.0 and _dot(edges[i], 2, direction) >= 0.0
        nearness = max(_dot(edges[i], 3, direction), _dot(after, 3, direction))
        if within:
            nearness = np.sqrt(max(1.0 - height * height, 0.0))
        if nearness > best:
            nearest, best, beside = i, nearness, within
        if wedge < 0 and _dot(edges[i], 4, direction) >= 0.0 and _dot(after, 4, direction) < 0.0:
            wedge = i
    edge, after = edges[nearest], edges[(nearest + 1) % count]
    height = _dot(edge, 0, direction)
    place = gradient
    if beside and best > PARALLEL:
        length = 0.0
        for k in range(3):
            place[k] = direction[k] - height * edge[k]
            length += place[k] * place[k]
        for k in range(3):
            place[k] /= np.sqrt(length)
    else:
        corner = after if _dot(after, 3, direction) > _dot(edge, 3, direction) else edge
        for k in range(3):
            place[k] = corner[9 + k]
    sign = 1.0 if _dot(edges[max(wedge, 0)], 0, direction) >= 0.0 else -1.0
    cosine = direction[0] * place[0] + direction[1] * place[1] + direction[2] * place[2]
    square = 0.0
    for k in range(3):
        gradient[k] = cosine * direction[k] - place[k]
        square += gradient[k] * gradient[k]
    sine = np.sqrt(square)
    if sine > ON_EDGE:
        for k in range(3):
            gradient[k] *= sign / sine
    else:
        _inward(edges, direction, gradient)
    angle: float = sign * np.arctan2(sine, cosine)
    return angle


@compiled(inner=True, error_model="numpy")
def _inward(edges: Array, direction: Array, gradient: Array) -> None:
    """Direction into the cone at a place on its edge."""
    nearest, least = 0, np.inf
    for i in range(len(edges)):
        height = abs(_dot(edges[i], 0, direction))
        if height < least:
            nearest, least = i, height
    height, square = _dot(edges[nearest], 0, direction), 0.0
    for k in range(3):
        gradient[k] = edges[nearest, k] - height * direction[k]
        square += gradient[k] * gradient[k]
    for k in range(3):
        gradient[k] /= np.sqrt(square)

"""Closed forms of arms of six turning joints, and of seven with one of them held, as compiled loops: `closed_form`.

A posture places the last link at ``e_1 ... e_6 M``, where M is its placement at zero and e_k turns about axis k, which
at zero goes through o_k along h_k. The angles of ``e_1 ... e_6 = E`` come from two subproblems that have closed forms
(A. J. Elias, J. T. Wen, "IK-Geo: Unified robot inverse kinematics using subproblem decomposition", Mechanism and
Machine Theory 209, 2025).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import copy

CROSSING, PARALLEL, THREE_PARALLEL = range(3)
"""Axes 4 to 6 cross in o_6, and axes 1 and 2 in o_1, or axes 2 and 3 are parallel; or axes 2 to 4 are parallel, and
axes 5 and 6 cross in o_6."""

BRANCHES = 8
FULL = 2.0 * np.pi
SLACK = 1e-6  # rad and a share: a stretched arm and a joint at its limit are found in spite of rounding
ALONG = 1e-10  # product of lengths across an axis below which an angle about it is free: 1e-5 rad or m each
SPREAD = 89  # times a free angle are those of joints behind: both may be free, and are seen in all combinations
BETWEEN = 0.2  # rad: beyond limits, of a sample; what is within them may lie between it and the next one

Vector: TypeAlias = tuple[float, float, float]


class Arm(NamedTuple):
    """The axes of an arm at zero, from the base to the end, or from the end to the base."""

    axes: Array  # (n, 3) h_k, unit vectors; n is 6, or 7 with one that is held
    points: Array  # (n, 3) o_k
    joints: Indices  # (n,) which joint of the chain each is
    held: int  # which of them is held, -1 for none
    kind: int  # what makes it solvable
    backwards: int  # 1 where the axes begin at the end
    end: Array  # (4, 3) placement of the last joint at zero: the columns of its rotation, then its translation
    slack: float  # share by which an arm may be stretched too far


@compiled(inner=True)
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled(inner=True)
def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled(inner=True)
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled(inner=True)
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled(inner=True)
def _turn(axis: Vector, angle: float, v: Vector) -> Vector:
    """A vector, turned about an axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    across, along = _cross(axis, v), (1.0 - c) * _dot(axis, v)
    return (
        c * v[0] + s * across[0] + along * axis[0],
        c * v[1] + s * across[1] + along * axis[1],
        c * v[2] + s * across[2] + along * axis[2],
    )


@compiled(inner=True)
def _between(axis: Vector, a: Vector, b: Vector, free: float) -> float:
    """The angle about an axis that turns a to b, or to where it is nearest to b (subproblem 1); `free` for any."""
    across, along = _dot(axis, _cross(a, b)), _dot(a, b) - _dot(axis, a) * _dot(axis, b)
    return free if across * across + along * along < ALONG * ALONG else float(np.arctan2(across, along))


@compiled(inner=True, error_model="numpy")
def _angles(h: Vector, axis: Vector, v: Vector, d: float, slack: float, free: float) -> tuple[int, float, float]:
    """How many angles about an axis turn v to where h . v = d, and both of them (subproblem 4); `free` for any."""
    along = _dot(h, axis) * _dot(axis, v)
    a, b, c = _dot(h, v) - along, _dot(h, _cross(axis, v)), d - along
    most = np.sqrt(a * a + b * b)
    if not abs(c) <= most * (1.0 + slack) + slack * slack:
        return 0, 0.0, 0.0
    if most * most < ALONG:
        return 2, free, free + np.pi
    middle, side = np.arctan2(b, a), np.arccos(min(max(c / most, -1.0), 1.0))
    return 2, middle + side, middle - side


@compiled(inner=True)
def _bent(
    first: Vector, axis: Vector, second: Vector, v: Vector, far: Vector, slack: float
) -> tuple[int, float, float]:
    """Angles about an axis through `second` at which v is as far from `first` as `far` is (subproblem 3)."""
    x, y, z = _minus(second, first), _minus(v, second), _minus(far, first)
    return _angles(x, axis, y, 0.5 * (_dot(z, z) - _dot(x, x) - _dot(y, y)), slack, 0.0)


@compiled(inner=True)
def _vector(rows: Array, k: int) -> Vector:
    return rows[k, 0], rows[k, 1], rows[k, 2]


@compiled(inner=True)
def _rotated(place: Array, v: Vector) -> Vector:
    """A vector turned by a placement (4, 3): the columns of its rotation, then its translation."""
    return (
        place[0, 0] * v[0] + place[1, 0] * v[1] + place[2, 0] * v[2],
        place[0, 1] * v[0] + place[1, 1] * v[1] + place[2, 1] * v[2],
        place[0, 2] * v[0] + place[1, 2] * v[1] + place[2, 2] * v[2],
    )


@compiled(inner=True)
def _rotated_back(place: Array, v: Vector) -> Vector:
    return _dot(_vector(place, 0), v), _dot(_vector(place, 1), v), _dot(_vector(place, 2), v)


@compiled(inner=True)
def _across(h: Vector) -> Vector:
    """A vector at right angles to another."""
    return (0.0, h[2], -h[1]) if abs(h[0]) < 0.6 else (-h[2], 0.0, h[0])


@compiled(inner=True, error_model="numpy")
def _with_wrist(kind: int, slack: float, free: float, h: Array, o: Array, place: Array, found: Array) -> None:
    """The branches (8, 6) of an arm whose last axes cross; the place of their crossing comes first."""
    h1, h2, h3, o1, o2, o3 = _vector(h, 0), _vector(h, 1), _vector(h, 2), _vector(o, 0), _vector(o, 1), _vector(o, 2)
    wrist, at = _vector(o, 5), _plus(_rotated(place, _vector(o, 5)), _vector(place, 3))
    away = _minus(at, o1)
    if kind == PARALLEL:
        number, one, other = _angles(h2, (-h1[0], -h1[1], -h1[2]), away, _dot(h2, _minus(wrist, o1)), slack, free)
    else:
        number, one, other = _bent(o1, h3, o3, wrist, at, slack)
    for outer in range(number):
        first = one if outer == 0 else other
        if kind == PARALLEL:
            back = _plus(o1, _turn(h1, -first, away))
            count, low, high = _bent(o2, h3, o3, wrist, back, slack)
        else:
            arm = _minus(_plus(o3, _turn(h3, first, _minus(wrist, o3))), o1)
            count, low, high = _angles(h1, h2, arm, _dot(h1, away), slack, free)
        for inner in range(count):
            second = low if inner == 0 else high
            if kind == PARALLEL:
                arm = _minus(_plus(o3, _turn(h3, second, _minus(wrist, o3))), o2)
                q1, q2, q3 = first, _between(h2, arm, _minus(back, o2), free), second
            else:
                q1, q2, q3 = _between(h1, _turn(h2, second, arm), away, free), second, first
            _turned_wrist(h, place, (q1, q2, q3), slack, free, found[4 * outer + 2 * inner : 4 * outer + 2 * inner + 2])


@compiled(inner=True)
def _turned_wrist(h: Array, place: Array, first: Vector, slack: float, free: float, found: Array) -> None:
    """The two branches (2, 6) to turn a wrist where the first three angles are known."""
    h1, h2, h3, h4, h5, h6 = (
        _vector(h, 0), _vector(h, 1), _vector(h, 2), _vector(h, 3), _vector(h, 4), _vector(h, 5),
    )  # fmt: skip
    q1, q2, q3 = first
    asked = _turn(h3, -q3, _turn(h2, -q2, _turn(h1, -q1, _rotated(place, h6))))
    side = _across(h6)
    turned = _turn(h3, -q3, _turn(h2, -q2, _turn(h1, -q1, _rotated(place, side))))
    count, low, high = _angles(h4, h5, h6, _dot(h4, asked), slack, free)
    for k in range(count):
        q5 = low if k == 0 else high
        q4 = _between(h4, _turn(h5, q5, h6), asked, SPREAD * free)
        q6 = _between(h6, side, _turn(h5, -q5, _turn(h4, -q4, turned)), 0.0)
        found[k, 0], found[k, 1], found[k, 2], found[k, 3], found[k, 4], found[k, 5] = q1, q2, q3, q4, q5, q6


@compiled(inner=True, error_model="numpy")
def _with_parallels(slack: float, free: float, h: Array, o: Array, place: Array, found: Array) -> None:
    """The branches (8, 6) of an arm whose axes 2 to 4 are parallel."""
    h1, h2, h3, h5, h6 = _vector(h, 0), _vector(h, 1), _vector(h, 2), _vector(h, 4), _vector(h, 5)
    o1, o2, o3, o4, end = _vector(o, 0), _vector(o, 1), _vector(o, 2), _vector(o, 3), _vector(o, 5)
    third, fourth = _dot(h2, h3), _dot(h2, _vector(h, 3))
    away, side = _minus(_plus(_rotated(place, end), _vector(place, 3)), o1), _across(h2)
    number, one, other = _angles(h2, (-h1[0], -h1[1], -h1[2]), away, _dot(h2, _minus(end, o1)), slack, free)
    for outer in range(number):
        q1 = one if outer == 0 else other
        back = _plus(o1, _turn(h1, -q1, away))
        count, low, high = _angles(h2, h5, h6, _dot(h2, _turn(h1, -q1, _rotated(place, h6))), slack, free)
        for inner in range(count):
            q5 = low if inner == 0 else high
            asked = _rotated_back(place, _turn(h1, q1, h2))
            across = _cross(h6, asked)
            parallel = _dot(across, across) < ALONG  # axes 2 and 6: any q6 meets the rotation
            for k in range(16 if parallel else 1):  # to the first with which the arm is long enough
                q6 = SPREAD * free + np.pi * inner + FULL / 16 * ((k + 1) // 2) * (2 * (k % 2) - 1)
                q6 = q6 if parallel else _between(h6, asked, _turn(h5, -q5, h2), 0.0)
                turned = _turn(h1, -q1, _rotated(place, _turn(h6, -q6, _turn(h5, -q5, side))))
                total = _between(h2, side, turned, 0.0)
                elbow = _minus(back, _turn(h2, total, _minus(end, o4)))
                both, up, down = _bent(o2, h3, o3, o4, elbow, slack)
                if both > 0:
                    break
            for k in range(both):
                q3 = up if k == 0 else down
                q2 = _between(h2, _minus(_plus(o3, _turn(h3, q3, _minus(o4, o3))), o2), _minus(elbow, o2), free)
                row = found[4 * outer + 2 * inner + k]
                row[0], row[1], row[2], row[3], row[4], row[5] = q1, q2, q3, fourth * (total - q2 - third * q3), q5, q6


@compiled(error_model="numpy")
def branches(arm: Arm, goal: Array, values: Array, found: Array) -> None:
    """All postures of an arm in which a frame of its last joint is at a placement.

    Args:
        arm: the axes.
        goal: (36,) the placement, and that of the frame in the joint, as in `terms.entries.RESIDUAL`.
        values: (v,) of the joint that is held; where none is, of those that are free where axes line up.
        found: (v, 8, n) written: angles in the order of the chain, NaN where a branch does not exist.
    """
    place, asked, six = np.empty((4, 3)), np.empty((4, 3)), np.empty((BRANCHES, 6))
    h, o = np.empty((6, 3)), np.empty((6, 3))
    _target(arm, goal, place, asked)
    for number in range(len(values)):
        k = 0
        for i in range(4):
            copy(asked[i], place[i])
        for i in range(len(arm.joints)):
            axis, point = _vector(arm.axes, i), _vector(arm.points, i)
            if i == arm.held:  # e_i e_j ... = (e_i e_j e_i^-1) ... e_i: those behind it are turned as it is
                for j in range(3):
                    unit = 1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0
                    place[j, 0], place[j, 1], place[j, 2] = _rotated(asked, _turn(axis, -values[number], unit))
                there = _minus(_plus(_rotated(asked, point), _vector(asked, 3)), _rotated(place, point))
                place[3, 0], place[3, 1], place[3, 2] = there
                continue
            if 0 <= arm.held < i:
                by, centre = _vector(arm.axes, arm.held), _vector(arm.points, arm.held)
                axis = _turn(by, values[number], axis)
                point = _plus(centre, _turn(by, values[number], _minus(point, centre)))
            h[k, 0], h[k, 1], h[k, 2] = axis
            o[k, 0], o[k, 1], o[k, 2] = point
            k += 1
        six[:] = np.nan
        free = values[number] if arm.held < 0 else 0.0
        if arm.kind == THREE_PARALLEL:
            _with_parallels(arm.slack, free, h, o, place, six)
        else:
            _with_wrist(arm.kind, arm.slack, free, h, o, place, six)
        for b in range(BRANCHES):
            k = 0
            for i in range(len(arm.joints)):
                found[number, b, arm.joints[i]] = values[number] if i == arm.held else six[b, k]
                k += 0 if i == arm.held else 1


@compiled(inner=True)
def _target(arm: Arm, goal: Array, frame: Array, target: Array) -> None:
    """E (4, 3): the columns of its rotation, then its translation; its inverse for axes that begin at the end."""
    for j in range(4):
        for i in range(3):
            frame[j, i] = goal[3 * j + i]
    for j in range(3):  # rows of the frame's rotation at zero are brought to rows of the placement's
        first = _rotated(arm.end, _vector(frame, j))
        for i in range(3):
            target[j, i] = 0.0
        frame[j, 0], frame[j, 1], frame[j, 2] = first
    for i in range(3):
        for j in range(3):
            for k in range(3):
                target[j, i] += goal[27 + 3 * i + k] * frame[k, j]
    origin = _plus(_rotated(arm.end, _vector(frame, 3)), _vector(arm.end, 3))
    moved = _minus((goal[24], goal[25], goal[26]), _rotated(target, origin))
    if arm.backwards:
        for i in range(3):
            for j in range(i):
                target[i, j], target[j, i] = target[j, i], target[i, j]
        moved = _rotated(target, (-moved[0], -moved[1], -moved[2]))
    target[3, 0], target[3, 1], target[3, 2] = moved


@compiled(error_model="numpy")
def sampled(
    arm: Arm, goal: Array, limits: tuple[Array, Array], nearest: Array, found: Array, effort: Array, order: Indices
) -> int:  # fmt: skip
    """Which postures within limits take less effort than the samples beside them in their branch, the least first.

    Samples are those of the joint that is held, all over its limits, or over a whole turn of them about a posture; of
    six joints, whole turns of those that are free where axes line up.

    Args:
        arm: the axes.
        goal: (36,) as in `branches`.
        limits: (n,) lower and upper ones of the joints.
        nearest: (2, n) the posture, and weights of the effort ``sum w (q - nearest)^2``; where these are zero, ones.
        found: (v, 8, n) written: angles, NaN for none; within limits, by whole turns and clamped, near the posture.
        effort: (v, 8) written; inf for a posture that does not exist or is nowhere within limits.
        order: (v * 8,) written: places in the flattened first two axes of `found`.

    Returns:
        How many there are.
    """
    (lower, upper), near, values = limits, nearest.copy(), np.zeros(len(found))
    weighed = False
    for weight in nearest[1]:
        weighed = weighed or weight > 0.0
    if not weighed:
        near[1] = 1.0
    if arm.held >= 0:
        joint = arm.joints[arm.held]
        low = min(max(near[0, joint] - np.pi, lower[joint]), max(upper[joint] - FULL, lower[joint]))
        high = min(low + FULL, upper[joint])
        for v in range(len(values)):
            values[v] = low + (high - low) * v / (len(values) - 1)
    for v in range(0 if arm.held >= 0 else len(values)):
        values[v] = FULL * v / len(values)
    branches(arm, goal, values, found)
    count, number = 0, len(found)
    for b in range(BRANCHES):
        for v in range(number):
            effort[v, b] = within(found[v, b], lower, upper, near, BETWEEN if arm.held >= 0 else SLACK)
        for v in range(number):
            own = effort[v, b]
            if own == np.inf or (v > 0 and effort[v - 1, b] <= own) or (v + 1 < number and effort[v + 1, b] < own):
                continue
            place = count
            while place > 0 and effort[order[place - 1] // BRANCHES, order[place - 1] % BRANCHES] > own:
                order[place] = order[place - 1]
                place -= 1
            order[place] = BRANCHES * v + b
            count += 1
    return count


@compiled(inner=True, error_model="numpy")
def foreseen(effort: Array, v: int, b: int) -> float:
    """Least effort of the parabola through a sample and those beside it in its branch; 0 at an end of the branch."""
    if v == 0 or v + 1 == len(effort):
        return 0.0
    before, own, after = effort[v - 1, b], effort[v, b], effort[v + 1, b]
    bent = before - 2.0 * own + after
    if not 0.0 < bent < np.inf:
        return 0.0
    return float(own - 0.125 * (after - before) ** 2 / bent)


@compiled(inner=True, error_model="numpy")
def within(q: Array, lower: Array, upper: Array, nearest: Array, slack: float) -> float:
    """Turn angles (n,) by whole turns to within limits and near to a posture; the effort, inf for none."""
    effort = 0.0
    for i in range(len(q)):
        angle = q[i] + FULL * np.floor((nearest[0, i] - q[i]) / FULL + 0.5)
        if angle > upper[i] + slack:
            angle -= FULL * np.ceil((angle - upper[i] - slack) / FULL)
        elif angle < lower[i] - slack:
            angle += FULL * np.ceil((lower[i] - slack - angle) / FULL)
        if not lower[i] - slack <= angle <= upper[i] + slack:
            return np.inf
        q[i] = min(max(angle, lower[i]), upper[i])
        effort += nearest[1, i] * (q[i] - nearest[0, i]) ** 2
    return effort


@compiled(inner=True, error_model="numpy")
def beside(
    arm: Arm, goal: Array, limits: tuple[Array, Array], nearest: Array, value: float, q: Array, posture: Array
) -> float:  # fmt: skip
    """Effort of the branch nearest to q (n,), written, with its held joint at a value; inf if over 1 rad away."""
    found, best, chosen = np.empty((1, BRANCHES, len(q))), np.inf, -1
    held = arm.joints[arm.held]
    branches(arm, goal, value * np.ones(1), found)
    for b in range(BRANCHES):
        effort, away = within(found[0, b], limits[0], limits[1], nearest, SLACK), abs(found[0, b, held] - value)
        for i in range(len(q)):
            away = max(away, 0.0 if i == held else abs(found[0, b, i] - q[i]))
        if effort < np.inf and away < min(best, 1.0):
            best, chosen, most = away, b, effort
    if chosen < 0:
        return np.inf
    copy(found[0, chosen], posture)
    return most

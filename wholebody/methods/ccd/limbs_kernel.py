"""Kinematics and sweeps of cyclic coordinate descent, as compiled loops: see `limbs` and `sweep`."""

from __future__ import annotations

from math import acos, atan2, ceil, cos, floor, inf, pi, sin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled

X, Y, Z, OBLIQUE, SLIDE = range(5)
"""What a joint does: turn about an axis of its own frame (either way round), about any other, or slide."""

TURN = 2.0 * pi
FLAT = 1e-12  # m^2: below this a joint cannot change the distances, and the angle would be that of rounding


@compiled()
def forward(
    parents: Indices,
    places: Array,
    kinds: Indices,
    signs: Array,
    axes: Array,
    values: Array,
    frames: Array,
    lines: Array,
) -> None:
    """Compute frames and lines from values.

    Args:
        parents: (n,) node that each hangs on; -1 is the world.
        places: (n, 12) rotation from the parent, row by row, and translation.
        kinds: (n,) X, Y, Z, OBLIQUE or SLIDE.
        signs: (n,) -1 where the joint turns about the negative axis.
        axes: (n, 3) unit axis in the joint's own frame.
        values: (n,) radians or metres.
        frames: (n + 1, 12) written: placements, the last being the world.
        lines: (n, 6) written: unit axis and origin of each node.
    """
    for k in range(len(parents)):
        base, place, frame, line = frames[parents[k]], places[k], frames[k], lines[k]
        for row in range(3):
            a, b, c = base[3 * row], base[3 * row + 1], base[3 * row + 2]
            for column in range(3):
                frame[3 * row + column] = a * place[column] + b * place[3 + column] + c * place[6 + column]
            frame[9 + row] = base[9 + row] + (a * place[9] + b * place[10] + c * place[11])
        kind, value = kinds[k], signs[k] * values[k]
        if kind < OBLIQUE:
            co, si = cos(value), sin(value)
            after, before = (kind + 1) % 3, (kind + 2) % 3  # the axes that turn, in the order of a right-handed turn
            for row in range(3):
                line[row] = signs[k] * frame[3 * row + kind]
                one, other = frame[3 * row + after], frame[3 * row + before]
                frame[3 * row + after] = co * one + si * other
                frame[3 * row + before] = co * other - si * one
        else:
            for row in range(3):
                line[row] = 0.0
                for column in range(3):
                    line[row] += frame[3 * row + column] * axes[k, column]
            if kind == SLIDE:
                for row in range(3):
                    frame[9 + row] += value * line[row]
            else:
                co, si = cos(value), sin(value)
                for column in range(3):
                    x, y, z = frame[column], frame[3 + column], frame[6 + column]
                    x, y, z = _turned(line, co, si, x, y, z)
                    frame[column], frame[3 + column], frame[6 + column] = x, y, z
        for row in range(3):
            line[3 + row] = frame[9 + row]


@compiled()
def sweep(
    lines: Array,
    kinds: Indices,
    values: Array,
    lower: Array,
    upper: Array,
    here: Array,
    there: Array,
    weights: Array,
    nodes: Indices,
    first: Indices,
    moved: Indices,
    points: Indices,
) -> float:
    """Give each joint its best value and carry the aims along; return the largest change.

    Args:
        lines: (n, 6) unit axis and origin of each node.
        kinds: (n,) what each does.
        values: (n,) changed in place.
        lower: (n,) least values.
        upper: (n,) greatest values.
        here: (m, 3) points and directions, carried along in place.
        there: (m, 3) where they should be.
        weights: (m,) factor on each squared distance.
        nodes: (s,) nodes in the order of their turns.
        first: (s + 1,) where in `moved` each of them begins.
        moved: what each moves, points before directions.
        points: (s,) how many of these are points.
    """
    largest = 0.0
    for step in range(len(nodes)):
        node = nodes[step]
        mine = moved[first[step] : first[step + 1]]
        line = lines[node]
        if kinds[node] == SLIDE:
            change = _slide(line, values, lower, upper, here, there, weights, node, mine, points[step])
            largest = max(largest, abs(change))
            continue
        ux, uy, uz, ox, oy, oz = line
        cosine, sine, size = 0.0, 0.0, 0.0
        for n in range(len(mine)):
            k = mine[n]
            x, y, z = here[k, 0], here[k, 1], here[k, 2]
            tx, ty, tz = there[k, 0], there[k, 1], there[k, 2]
            if n < points[step]:
                x, y, z, tx, ty, tz = x - ox, y - oy, z - oz, tx - ox, ty - oy, tz - oz
            weight = weights[k]
            cosine += weight * (x * tx + y * ty + z * tz - (ux * x + uy * y + uz * z) * (ux * tx + uy * ty + uz * tz))
            sine += weight * (tx * (uy * z - uz * y) + ty * (uz * x - ux * z) + tz * (ux * y - uy * x))
            size += weight
        if (cosine * cosine + sine * sine) ** 0.5 <= FLAT * size:
            continue
        old = values[node]
        new = old + atan2(sine, cosine)
        if not lower[node] <= new <= upper[node]:
            new = within(new, lower[node], upper[node])
        change = new - old
        if change == 0.0:
            continue
        values[node] = new
        largest = max(largest, abs(change))
        co, si = cos(change), sin(change)
        for n in range(len(mine)):
            k = mine[n]
            if n < points[step]:
                x, y, z = _turned(line, co, si, here[k, 0] - ox, here[k, 1] - oy, here[k, 2] - oz)
                here[k, 0], here[k, 1], here[k, 2] = x + ox, y + oy, z + oz
            else:
                here[k, 0], here[k, 1], here[k, 2] = _turned(line, co, si, here[k, 0], here[k, 1], here[k, 2])
    return largest


@compiled()
def within(best: float, lower: float, upper: float) -> float:
    """The allowed angle nearest to the best one on the circle: the same after whole turns, or the nearer limit.

    The objective is A cos + B sin of the angle, so it falls with the distance on the circle from the best.
    """
    turns = ceil((lower - best) / TURN) if lower > -inf else floor((upper - best) / TURN)
    angle = best + TURN * turns
    if lower <= angle <= upper:
        return angle
    return lower if cos(lower - best) >= cos(upper - best) else upper


@compiled()
def distance(here: Array, there: Array, weights: Array) -> float:
    """Root of the weighted sum of squared distances left."""
    total = 0.0
    for k in range(len(here)):
        for axis in range(3):
            total += weights[k] * (there[k, axis] - here[k, axis]) ** 2
    return float(total**0.5)


@compiled()
def carry(frames: Array, nodes: Indices, local: Array, points: Mask, here: Array) -> None:
    """Write where points and directions are now.

    Args:
        frames: (n + 1, 12) as `forward` wrote them.
        nodes: (m,) that carry each; -1 is the world.
        local: (m, 3) each in its node's frame.
        points: (m,) which are points.
        here: (m, 3) written.
    """
    for k in range(len(nodes)):
        frame = frames[nodes[k]]
        for row in range(3):
            here[k, row] = (
                frame[3 * row] * local[k, 0] + frame[3 * row + 1] * local[k, 1] + frame[3 * row + 2] * local[k, 2]
            )
            if points[k]:
                here[k, row] += frame[9 + row]


@compiled()
def greatest_error(here: Array, there: Array, points: Mask) -> float:
    """Largest distance of a point (m, 3) from its place, or angle of three directions, one after the other."""
    worst, k = 0.0, 0
    while k < len(here):
        square = 0.0
        for n in range(k, k + 1 if points[k] else k + 3):
            for axis in range(3):
                square += (here[n, axis] - there[n, axis]) ** 2
        if points[k]:
            worst = max(worst, square**0.5)
            k += 1
        else:  # the sum over the three axes is 4 (1 - cos angle) = 8 sin^2(angle / 2)
            worst = max(worst, acos(max(-1.0, 1.0 - square / 4.0)))
            k += 3
    return worst


@compiled(inner=True)
def _slide(
    line: Array,
    values: Array,
    lower: Array,
    upper: Array,
    here: Array,
    there: Array,
    weights: Array,
    node: int,
    mine: Indices,
    points: int,
) -> float:
    """The best displacement of a sliding joint is the mean distance of its points from their targets, along it."""
    total, weight = 0.0, 0.0
    for k in mine[:points]:
        for axis in range(3):
            total += weights[k] * line[axis] * (there[k, axis] - here[k, axis])
        weight += weights[k]
    if weight == 0.0:  # axes alone, which no slide moves
        return 0.0
    old = values[node]
    new = min(max(old + total / weight, lower[node]), upper[node])
    values[node] = new
    for k in mine[:points]:
        for axis in range(3):
            here[k, axis] += (new - old) * line[axis]
    return float(new - old)


@compiled(inner=True)
def _turned(line: Array, co: float, si: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector turned about a line's unit axis (Rodrigues)."""
    ux, uy, uz = line[0], line[1], line[2]
    along = (1.0 - co) * (ux * x + uy * y + uz * z)
    return (
        co * x + si * (uy * z - uz * y) + along * ux,
        co * y + si * (uz * x - ux * z) + along * uy,
        co * z + si * (ux * y - uy * x) + along * uz,
    )

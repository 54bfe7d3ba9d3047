"""Whether a step turns some pair nearer than its rows foresee, as compiled loops: see `turning`."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices, Mask
from wholebody.compiled import compiled


@compiled()
def bent(
    displacement: Array,
    columns: Array,
    column_joint: Indices,
    parents: Indices,
    joint: Indices,
    reach: Array,
    point: Mask,
    placement: Array,
    pair: Indices,
    distance: Array,
    asked: Array,
    unseen: Array,
    violation: Array,
    contact: Indices,
    first: int,
    lengths: Array,
) -> float:
    """Largest share of its `unseen` by which a pair that may end too near can be nearer than its rows say; 0 for none.

    The distance of a pair is at least that of its points to a plane that moves with one of its pieces. To second order
    a point of a piece leaves its tangent by half of its acceleration at constant joint speeds, and the plane adds its
    turn times the way of the points.

    Args:
        displacement: (n,) spread over the columns.
        columns: (n, 6) of the joint Jacobian at the world's origin.
        column_joint: (n,) the joint of each column.
        parents: (njoints,) of the joints.
        joint: (pieces,) that carries each piece.
        reach: (pieces,) of the swept points of each piece about its place; infinite for a half-space.
        point: (pieces,) whether a piece has a single swept point, so that its turn does not matter.
        placement: (pieces, 4, 3) see `Contacts.placements`.
        pair: (k, 2) pieces of the contacts.
        distance: (k,) of the contacts.
        asked: (k,) clearances.
        unseen: (k,) by which each may end nearer than its rows say.
        violation: (r,) what the elastic rows are violated by after the displacement, to first order.
        contact: (r,) label of the contact of each row.
        first: label of the first contact.
        lengths: room within which a pair counts, in times of what it may be nearer by; how much farther than the
            witness point the points without rows are; how far beyond its clearance a pair is at most for this to hold.
    """
    joints = len(parents)
    twist, change = np.zeros((joints, 6)), np.zeros((joints, 6))
    own = np.zeros((joints, 6))
    for c in range(len(columns)):
        for i in range(6):
            own[column_joint[c], i] += columns[c, i] * displacement[c]
    for j in range(1, joints):
        # the axes of a joint move with the body that carries it
        v, s = twist[parents[j]], own[j]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            change[j, i] = change[parents[j], i] + v[3 + a] * s[b] - v[3 + b] * s[a] + v[a] * s[3 + b] - v[b] * s[3 + a]
            change[j, 3 + i] = change[parents[j], 3 + i] + v[3 + a] * s[3 + b] - v[3 + b] * s[3 + a]
        for i in range(6):
            twist[j, i] = v[i] + s[i]
    room = np.full(len(distance), np.inf)
    for r in range(len(contact)):
        c = contact[r] - first
        if c >= 0:
            room[c] = min(room[c], -violation[r])
    worst = 0.0
    for c in range(len(distance)):
        way, bend, turns = 0.0, 0.0, np.zeros(2)
        for side in range(2):
            p = pair[c, side]
            j = joint[p]
            if j == 0:
                continue
            speed, bow = np.zeros(3), np.zeros(3)
            turn, spin = 0.0, 0.0
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                speed[i] = twist[j, i] + twist[j, 3 + a] * placement[p, 3, b] - twist[j, 3 + b] * placement[p, 3, a]
                turn += twist[j, 3 + i] ** 2
                spin += change[j, 3 + i] ** 2
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                bow[i] = (
                    change[j, i] + change[j, 3 + a] * placement[p, 3, b] - change[j, 3 + b] * placement[p, 3, a]
                    + twist[j, 3 + a] * speed[b] - twist[j, 3 + b] * speed[a]
                )  # fmt: skip
            turns[side] = np.sqrt(turn)
            far = reach[p] if turn > 0.0 else 0.0
            way += np.sqrt(np.sum(speed * speed)) + turns[side] * far
            bend += np.sqrt(np.sum(bow * bow)) + (np.sqrt(spin) + turn) * far
        one, other = point[pair[c, 0]], point[pair[c, 1]]
        if one and other:
            plane = 0.0
        elif one:
            plane = turns[1]
        elif other:
            plane = turns[0]
        else:
            plane = min(turns[0], turns[1])
        nearer = 0.5 * bend + plane * way
        if nearer <= unseen[c]:
            continue
        spare = distance[c] - asked[c]
        beyond = lengths[1] if spare <= lengths[2] else 0.0
        if room[c] < lengths[0] * nearer or (not one and not other and spare + beyond < way):
            worst = max(worst, nearer / unseen[c])
    return worst

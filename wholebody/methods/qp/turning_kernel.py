"""Whether a step turns some pair nearer than its rows foresee, as compiled loops: see `turning`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import dot


@compiled()
def linearisation_error(
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
    normal: Array,
    asked: Array,
    step: Array,
    elastic: Array,
    violation: Array,
    contact: Indices,
    first: int,
    lengths: Array,
    twists: Array,
) -> float:
    """Largest share of what is unseen by which a pair that may end too near can be nearer than its rows say.

    Unseen is what a pair may end nearer than its rows say: what is asked of it, within bounds. 0 where no pair can be
    nearer by so much.

    The distance of a pair is at least that of its points to a plane that moves with one of its pieces. To second order
    a point leaves its tangent by half of its acceleration at constant joint speeds, as seen from the plane; only what
    points at the plane brings it nearer, and what lies along it as far as the plane turns meanwhile.

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
        normal: (k, 3) from the first piece of each to the second.
        asked: (k,) clearances.
        step: (nv,) the displacement.
        elastic: (r, nv) elastic rows.
        violation: (r,) what they are violated by before it.
        contact: (r,) label of the contact of each row.
        first: label of the first contact.
        lengths: room within which a pair counts, in times of what it may be nearer by; how much farther than the
            witness point the points without rows are; how far beyond its clearance a pair is at most for this to hold;
            by how many radians its normal may be off; least and largest that is unseen.
        twists: (3, njoints, 6) room.
    """
    joints = len(parents)
    twists[:] = 0.0
    twist, change, own = twists[0], twists[1], twists[2]
    for c in range(len(columns)):
        for i in range(6):
            own[column_joint[c], i] += columns[c, i] * displacement[c]
    for j in range(1, joints):
        # the axes of a joint move with the body that carries it
        v, s = twist[parents[j]], own[j]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            moved = v[3 + a] * s[b] - v[3 + b] * s[a] + v[a] * s[3 + b] - v[b] * s[3 + a]
            change[j, i] = change[parents[j], i] + moved
            change[j, 3 + i] = change[parents[j], 3 + i] + v[3 + a] * s[3 + b] - v[3 + b] * s[3 + a]
        for i in range(6):
            twist[j, i] = v[i] + s[i]
    room = np.empty(len(distance))
    room[:] = np.inf
    for r in range(len(violation)):
        c = contact[r] - first
        if c >= 0:
            room[c] = min(room[c], dot(elastic[r], step) - violation[r])
    worst, vectors = 0.0, np.empty((5, 3))
    for c in range(len(distance)):
        nearer, way = np.inf, np.inf
        round_piece = point[pair[c, 0]] or point[pair[c, 1]]
        for side in range(2):
            # a plane that moves with one piece, and the points of the other one; a single point has no plane
            p, carrier = pair[c, side], joint[pair[c, 1 - side]]
            if round_piece and not point[p]:
                continue
            gone, bend = _seen_from(
                placement[p, 3], reach[p], twist[joint[p]], change[joint[p]], twist[carrier], change[carrier],
                normal[c], 1.0 - 2.0 * side, lengths[3], vectors,
            )  # fmt: skip
            if bend < nearer:
                nearer, way = bend, gone
        nearer += lengths[3] * way
        unseen = min(max(asked[c], lengths[4]), lengths[5])
        if nearer <= unseen:
            continue
        spare = distance[c] - asked[c]
        beyond = lengths[1] if spare <= lengths[2] else 0.0
        if room[c] < lengths[0] * nearer or (not round_piece and spare + beyond < way):
            worst = max(worst, nearer / unseen)
    return worst


@compiled(inner=True)
def _seen_from(
    place: Array,
    reach: float,
    own: Array,
    own_change: Array,
    carrier: Array,
    carrier_change: Array,
    normal: Array,
    sign: float,
    off: float,
    vectors: Array,
) -> tuple[float, float]:
    """Longest way of the points of a piece as seen from another body, and by how much it can bow towards it.

    `place` (3,) is the piece's and `reach` its points' distance from there; twists (6,) at the world's origin and their
    changes are those of the piece's body and of the body from which it is seen. `normal` (3,) times `sign` points from
    the piece to that body and may be `off` by so many radians. `vectors` (5, 3) is room.
    """
    speed, bow, spin, own_speed, carrier_speed = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    turn_square, speed_square, bow_square, spin_square = 0.0, 0.0, 0.0, 0.0
    towards, own_square, carrier_square = 0.0, 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        speed[i] = (
            own[i] - carrier[i] + (own[3 + j] - carrier[3 + j]) * place[k] - (own[3 + k] - carrier[3 + k]) * place[j]
        )
        turn_square += (own[3 + i] - carrier[3 + i]) ** 2
        spin[i] = (
            own_change[3 + i] - carrier_change[3 + i] - carrier[3 + j] * own[3 + k] + carrier[3 + k] * own[3 + j]
        )  # fmt: skip
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        own_speed[i] = own[i] + own[3 + j] * place[k] - own[3 + k] * place[j]
        carrier_speed[i] = carrier[i] + carrier[3 + j] * place[k] - carrier[3 + k] * place[j]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        bow[i] = (
            own_change[i] + own_change[3 + j] * place[k] - own_change[3 + k] * place[j]
            + own[3 + j] * own_speed[k] - own[3 + k] * own_speed[j]
            - carrier_change[i] - carrier_change[3 + j] * place[k] + carrier_change[3 + k] * place[j]
            - carrier[3 + j] * carrier_speed[k] + carrier[3 + k] * carrier_speed[j]
            - 2.0 * (carrier[3 + j] * speed[k] - carrier[3 + k] * speed[j])
        )  # fmt: skip
        speed_square += speed[i] * speed[i]
        bow_square += bow[i] * bow[i]
        towards += sign * normal[i] * bow[i]
        own_square += own[3 + i] * own[3 + i]
        carrier_square += carrier[3 + i] * carrier[3 + i]
        spin_square += spin[i] * spin[i]
    far = reach if turn_square + spin_square > 0.0 else 0.0
    way = np.sqrt(speed_square) + np.sqrt(turn_square) * far
    # the bow itself turns with the bodies on the way
    aside = (off + np.sqrt(own_square) + np.sqrt(carrier_square)) * np.sqrt(bow_square)
    return way, 0.5 * (max(towards, 0.0) + aside + (np.sqrt(spin_square) + turn_square) * far)

"""How the pieces of a step move, and whether it turns some pair nearer than its rows predict: see `turning`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import dot
from wholebody.methods.qp.quadratic_program import Bodies, Near, Rows, Seen


@compiled(forceinline=True)
def moved(displacement: Array, bodies: Bodies) -> tuple[float, float]:
    """Longest way of any point of any piece [m], and largest turn [rad], to first order in a displacement (nv,)."""
    places, column_joint, joint = bodies.place, bodies.column_joint, bodies.joint
    placement, reach = bodies.placement, bodies.reach
    columns, parents, twist = bodies.columns, bodies.parents, bodies.twists[0]
    twist[:] = 0.0
    for k in range(len(columns)):
        j, share = column_joint[k], displacement[places[k]]
        for i in range(6):
            twist[j, i] += columns[k, i] * share
    for j in range(1, len(parents)):
        for i in range(6):
            twist[j, i] += twist[parents[j], i]
    longest, most = 0.0, 0.0
    for p in range(len(joint)):
        if joint[p] == 0:
            continue
        own, place = twist[joint[p]], placement[p, 3]
        shift, turn = 0.0, 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            speed = own[i] + own[3 + j] * place[k] - own[3 + k] * place[j]
            shift += speed * speed
            turn += own[3 + i] * own[3 + i]
        turn = np.sqrt(turn)
        most = max(most, turn)
        longest = max(longest, np.sqrt(shift) + (turn * reach[p] if turn > 0.0 else 0.0))
    return longest, most


@compiled()
def linearisation_error(
    displacement: Array, arrays: tuple[Any, ...], single: Mask, lengths: Array, pairs: tuple[Any, ...],
    own: tuple[Any, ...],
) -> float:  # fmt: skip
    """Largest share of what is unseen by which a pair that may end too near can be nearer than its rows say.

    Unseen is by how much a pair may end nearer than its rows say: its clearance, within bounds. 0 where no pair can be
    nearer by so much.

    The distance of a pair is at least that of its points to a plane that moves with one of its pieces. To second order
    a point leaves its tangent by half of its acceleration at constant joint speeds, as seen from the plane; only what
    points at the plane brings it nearer, and what lies along it as far as the plane turns meanwhile.

    Args:
        displacement: (nv,) of the step.
        arrays: where it begins, see `Bodies`; `reach` is that of the swept points of each piece, infinite for a
            half-space. A record as a tuple of its fields is read in a fifth of the time.
        single: (p,) whether a piece has a single swept point, so that its turn does not matter.
        lengths: bounds, see `Seen`.
        pairs: the contacts, see `Near`.
        own: of the program, see `Rows`.
    """
    bodies, near, rows = Bodies(*arrays), Near(*pairs), Rows(*own)
    seen = Seen(lengths[0], lengths[1], lengths[2], lengths[3], lengths[4], lengths[5])
    pair, distance, asked, joint = near.pair, near.distance, near.asked, bodies.joint
    count = len(distance)
    _second_order(displacement, bodies)
    twist, change, placement, first = bodies.twists[0], bodies.twists[1], bodies.placement, rows.contacts - count
    room = np.empty(count)
    room[:] = np.inf
    for r in range(len(rows.contact)):
        c = rows.contact[r] - first
        if c >= 0:
            room[c] = min(room[c], dot(rows.elastic[r], displacement) - rows.elastic_violation[r])
    worst, vectors = 0.0, np.empty((5, 3))
    for c in range(count):
        nearer, length = np.inf, np.inf
        round_piece = single[pair[c, 0]] or single[pair[c, 1]]
        for side in range(2):
            # a plane that moves with one piece, and the points of the other one; a single point has no plane
            p = pair[c, side]
            mine, carrier = joint[p], joint[pair[c, 1 - side]]
            if round_piece and not single[p]:
                continue
            piece = Moved(placement[p, 3], bodies.reach[p], twist[mine], change[mine])
            gone, bend = _seen_from(
                piece, twist[carrier], change[carrier], near.normal[c], 1.0 - 2.0 * side, seen.off, vectors
            )
            if bend < nearer:
                nearer, length = bend, gone
        nearer += seen.off * length
        unseen = min(max(asked[c], seen.least), seen.most)
        if nearer <= unseen:
            continue
        spare = distance[c] - asked[c]
        beyond = seen.band if spare <= seen.lever else 0.0
        if room[c] < seen.room * nearer or (not round_piece and spare + beyond < length):
            worst = max(worst, nearer / unseen)
    return worst


@compiled(inner=True, forceinline=True)
def _second_order(displacement: Array, bodies: Bodies) -> None:
    """Write the twist of every joint, and its change at constant joint speeds, into the room of the bodies."""
    columns, place, column_joint = bodies.columns, bodies.place, bodies.column_joint
    parents, twists = bodies.parents, bodies.twists
    twists[:] = 0.0
    twist, change, own = twists[0], twists[1], twists[2]
    for c in range(len(columns)):
        joint, share = column_joint[c], displacement[place[c]]
        for i in range(6):
            own[joint, i] += columns[c, i] * share
    for j in range(1, len(parents)):
        # the axes of a joint move with the body that carries it
        parent = parents[j]
        v, s = twist[parent], own[j]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            moved = v[3 + a] * s[b] - v[3 + b] * s[a] + v[a] * s[3 + b] - v[b] * s[3 + a]
            change[j, i] = change[parent, i] + moved
            change[j, 3 + i] = change[parent, 3 + i] + v[3 + a] * s[3 + b] - v[3 + b] * s[3 + a]
        for i in range(6):
            twist[j, i] = v[i] + s[i]


class Moved(NamedTuple):
    """A piece that moves: its place (3,), its points' distance from there, its twist (6,) and how that changes (6,)."""

    place: Array
    reach: float
    twist: Array
    change: Array


@compiled(inner=True, forceinline=True)
def _seen_from(
    piece: Moved, carrier: Array, carrier_change: Array, normal: Array, sign: float, off: float, vectors: Array
) -> tuple[float, float]:
    """Longest way of a piece's points as seen from a carrier's twist (6,), and by how much it can bow towards it."""
    # `normal` (3,) times `sign` points to that body and may be `off` by so many radians. `vectors` (5, 3) is room.
    place, reach, own, own_change = piece.place, piece.reach, piece.twist, piece.change
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
    length = np.sqrt(speed_square) + np.sqrt(turn_square) * far
    # the bow itself turns with the bodies on the way
    aside = (off + np.sqrt(own_square) + np.sqrt(carrier_square)) * np.sqrt(bow_square)
    return length, 0.5 * (max(towards, 0.0) + aside + (np.sqrt(spin_square) + turn_square) * far)

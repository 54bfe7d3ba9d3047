"""Reaches of any figure, for `wholebody bench step --figure`: the tip of its longest chain among twenty objects.

A way without contact is known: the chain moves from the default posture through two random postures, along which the
figure stays free of itself, and the objects are put clear of all of it. "free" follows the tip along this way, "alone"
does so without the objects, and "contact" goes to the first of the two postures and back, with a block where the tip
would be. A free root is held where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.measure.track import (
    BLOCK,
    BOXES,
    CLEARANCE,
    ROOM_START,
    SEED,
    VARIANTS,
    Track,
    put_objects,
    smooth_way,
)
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.figures.self_pairs import random_postures

FARTHEST = 1.0  # rad, m: that a joint moves to each of the two postures; a way of two seconds keeps the speed bound
SHARES = (1.0, 0.75, 0.5, 0.25, 0.125, 0.0625)
"""How far towards random postures the way goes, and how large the block is: the largest that leaves room."""
CANDIDATES = 40  # ways that are tried for each of these
SAMPLES = 12  # postures along the way that the objects are put clear of
OWN_ROOM = 2e-4  # m: what a way leaves between pieces of the figure
PERSON = 2.0  # m: size of what the objects of the standing human surround; those of a figure are scaled with its own
ROOM_SPACE = 0.2  # m: by which the space of the objects exceeds that of the pieces along the way, for a person's size
TESTED = 50  # postures along a way that are tested for being free


def figure_tracks(spec: str, steps: int = 200) -> list[Track]:
    """Build the reaches of a figure, named as those of the human.

    Pairs are kept apart by the clearance of the human's reaches, or by half of the least distance along the way if
    that is less, as it is for links of robots whose hulls nearly touch.

    Args:
        spec: name or path of a figure, as for `wholebody.load`.
        steps: of each way.

    Raises:
        WholebodyError: the figure cannot be loaded.
        InputError: it has no chain that moves, no way without contact was found, or no place for an object.
    """
    figure = wb.load(spec)
    chains = [chain for chain in figure.chains.values() if chain.joints]
    if not chains:
        raise InputError(f"{spec}: it has no chain of joints with a tip that could reach; give a figure that moves")
    chain = max(chains, key=lambda chain: len(chain.joints))
    dofs = sorted({dof for name in chain.joints for dof in figure.dofs([name]).tolist()})
    ways, distance = _ways(figure, spec, dofs, steps)
    clearance = min(CLEARANCE, 0.5 * distance)
    held = (str(figure.segments[0]),) if figure.root == "free" else ()
    places = tuple(np.array([figure.placement(q, chain.tip).translation for q in way]) for way in ways)
    tracks = []
    for name in VARIANTS:
        scene = wb.Scene(figure)
        contact = name == "contact"
        if name != "alone":
            _furnish(scene, ways, places, block=contact)
        label = f"{Path(spec).stem}, {name}"
        tracks.append(Track(label, scene, figure.neutral, places[contact], chain.tip, held, clearance))
    return tracks


def _ways(figure: wb.Figure, spec: str, dofs: Sequence[int], steps: int) -> tuple[tuple[Array, Array], float]:
    """Postures (steps, nq) through two random ones, and those to the first and back; the figure's least distance."""
    scene, start, still = wb.Scene(figure), figure.neutral, np.zeros(figure.model.nv)
    random = random_postures(figure.model, 2 * CANDIDATES, SEED).reshape(CANDIDATES, 2, -1)
    for share in SHARES:
        for pair in random:
            moves = np.zeros((2, figure.model.nv))
            for move, q in zip(moves, pair, strict=True):
                move[dofs] = pin.difference(figure.model, start, q)[dofs]
                move *= share * min(1.0, FARTHEST / max(float(np.abs(move).max()), 1e-12))
            there, back = (
                np.array([pin.integrate(figure.model, start, move) for move in smooth_way(np.vstack(places), steps)])
                for places in ((still, *moves), (still, moves[0], still))
            )
            tested = max(1, steps // TESTED)
            least = _least(scene, np.vstack([start, there[::tested], there[-1:], back[::tested]]))
            if least > OWN_ROOM:
                return (there, back), least
    raise InputError(f"{spec}: no way was found along which it stays free of itself; give another figure")


def _least(scene: wb.Scene, q: Array) -> float:
    """Least distance of any pair at postures (n, nq) up to the first that is not free, at most twice the clearance."""
    least = 2.0 * CLEARANCE
    for posture in q:
        if least > OWN_ROOM and len(scene.geometry.collisionPairs):
            least = float(scene.contacts(posture, within=least).distance.min(initial=least))
    return least


def _furnish(scene: wb.Scene, ways: tuple[Array, Array], places: Sequence[Array], block: bool) -> None:
    """Put the objects clear of both ways, and a block about where the second one takes the tip farthest."""
    taken = Occupied(scene.figure, np.vstack([way[:: max(1, len(way) // SAMPLES)] for way in ways]))
    tips = np.vstack(places)
    occupied = np.vstack([taken.centres, tips])
    low, high = occupied.min(axis=0), occupied.max(axis=0)
    size = float((high - low).max()) / PERSON
    if block:
        _add_block(scene, places[1], size)
    space = (low - size * ROOM_SPACE).tolist(), (high + size * ROOM_SPACE).tolist()
    put_objects(scene, taken, tips, np.random.default_rng(SEED), space, size, BOXES - block)


def _add_block(scene: wb.Scene, places: Array, size: float) -> None:
    """Put a box about the place of the tip that is farthest from the first, as large as leaves the start free."""
    standing, edges = Occupied(scene.figure, (scene.figure.neutral,)), size * np.array(BLOCK[0])
    at = places[np.argmax(np.linalg.norm(places - places[0], axis=1))]
    for share in SHARES:
        x, y, z = (share * edges).tolist()
        box = wb.Box((x, y, z))
        if standing.clear_of(box, (*at.tolist(),), size * ROOM_START):
            scene.add(box, name="block", at=tuple(at.tolist()))
            return
    raise InputError(f"{scene.figure.name}: a block at the end of its way would touch it where it starts")

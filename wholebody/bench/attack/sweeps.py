"""Sweeps: ways between postures, with thin things across them, against a fine subdivision of the way."""

from __future__ import annotations

from pathlib import Path
from time import process_time

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.attack.bodies import body
from wholebody.bench.attack.case import Verdict, chosen
from wholebody.bench.attack.judging import Pairs
from wholebody.bench.attack.solves import scene_of
from wholebody.bench.attack.things import clear, inside
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.geometry.continuous.sweep import TOLERANCE, FirstContact
from wholebody.scene.scene import Scene


def case(rng: np.random.Generator, folder: Path) -> Verdict:
    """Sweep from a posture to another, and judge what was found by a fine subdivision."""
    figure = body(rng, folder)
    q = figure.figure.clamp(figure.figure.posture(chosen(rng, figure.figure.postures)))
    share = float(rng.choice([0.01, 0.1, 0.5, 1.0]))
    free = list(range(figure.figure.model.nv)) if rng.random() < 0.3 else None
    end = figure.near(q, share, rng, free)
    middle = np.asarray(pin.interpolate(figure.figure.model, q, end, float(rng.uniform(0.2, 0.8))))
    placed = Occupied(figure.figure, [middle, q])
    things = []
    for _ in range(int(rng.integers(0, 6))):
        if rng.random() < 0.5:
            thing = inside(rng, placed, figure.size, float(np.exp(rng.uniform(np.log(1e-5), np.log(0.1)))))
            if thing is not None and placed.distance(thing.shape, thing.placement, 1) < 0.0 and rng.random() < 0.8:
                thing = None
        else:
            thing = clear(rng, placed, figure.size, 0.0, [1])
        if thing is not None and np.abs(thing.at[:3]).max() < 99.0:
            things.append(thing)
    scene = scene_of(figure, things)
    began = process_time()
    found = scene.sweep(q, end)
    return verdict(scene, q, end, found, process_time() - began)


def verdict(scene: Scene, start: Array, end: Array, found: FirstContact | None, seconds: float) -> Verdict:
    """Judge what a sweep found on the way from one posture (nq,) to another, and took in seconds of CPU time."""
    pairs, parts = Pairs(scene), 150
    rounding = 3e-6 * max(1.0, pairs.size)
    shares = np.linspace(0.0, 1.0, parts + 1)
    deeper = _deeper(pairs, scene, start, end, shares)
    top = int(np.argmax(deeper))
    near = np.linspace(shares[max(top - 1, 0)], shares[min(top + 1, parts)], 40)
    shares, deeper = np.append(shares, near), np.append(deeper, _deeper(pairs, scene, start, end, near))
    deepest = float(deeper.max(initial=0.0))
    words = f"the deepest on the way is {deepest:.3g} m deeper than at the start"
    if found is None:
        if deepest > TOLERANCE + rounding:
            return Verdict("wrong", f"nothing was found; {words}", seconds)
        return Verdict("right", f"nothing was found; {words}", seconds)
    said = f"{'a contact' if found.certain else 'the end of the search'} at {found.fraction:.6f}"
    if not (0.0 <= found.fraction <= 1.0 and np.isfinite(found.q).all()):
        return Verdict("wrong", f"{said}: no place on the way", seconds)
    before = float(deeper[shares < found.fraction - 1e-9].max(initial=0.0))
    if before > TOLERANCE + rounding:
        return Verdict("wrong", f"{said}, and before it something is {before:.3g} m deeper", seconds)
    if not found.certain:
        return Verdict("gave up", f"{said}; {words}", seconds)
    at = float(_deeper(pairs, scene, start, end, np.array([found.fraction]))[0])
    if at < 0.5 * TOLERANCE - rounding:
        return Verdict("wrong", f"{said}, where nothing is more than {at:.3g} m deeper; {words}", seconds)
    return Verdict("right", f"{said}; {words}", seconds)


def _deeper(pairs: Pairs, scene: Scene, start: Array, end: Array, shares: Array) -> Array:
    """By how much some pair is deeper than at the start (k,), metres, at shares (k,) of the way."""
    began = np.minimum(pairs.distances(start), 0.0)
    if not len(began):
        return np.zeros(len(shares))
    ways = (np.asarray(pin.interpolate(scene.model, start, end, float(share))) for share in shares)
    return np.array([float((began - pairs.distances(q)).max()) for q in ways])

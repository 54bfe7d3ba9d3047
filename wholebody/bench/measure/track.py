"""The reach that every tool makes: 200 steps of a fingertip, both feet held, among twenty convex objects.

"free" passes the body and the objects and comes near many without having to touch any; "contact" asks for a place
inside a box and then for one before the chest; "alone" is the free way without the objects. No tool's own distances are
believed, ours included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.assessment.motion import limit_violation, pairs_along, velocities
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things
from wholebody.figures.self_pairs import random_postures

VARIANTS = ("free", "contact", "alone")


given = numbers("step")
SETTING = given.told  # what every tool is told of a reach; see the end of `sets.toml`


@dataclass(frozen=True)
class Track:
    """One reach: `start` (nq,), `targets` (steps, 3) of `tip` [m], feet that stay, a `clearance` [m] of pairs."""

    name: str
    scene: wb.Scene
    start: Array
    targets: Array
    tip: str = "right_index_tip"
    feet: tuple[str, ...] = ("left_foot", "right_foot")
    clearance: float = SETTING.clearance

    @property
    def floating(self) -> bool:
        """Whether the root moves."""
        return self.scene.figure.root == "free"

    @property
    def pairs(self) -> int:
        """How many pairs of pieces can touch."""
        return len(self.scene.geometry.collisionPairs)


def track(name: str, steps: int = 200) -> Track:
    """Build the human's reach of a name."""
    if name not in VARIANTS:
        raise UnknownNameError("reach", name, VARIANTS)
    if steps < 2:
        raise InputError(f"a reach of {steps} steps has no way; give --steps 2 or more")
    figure = wb.load("human")
    # arms that hang are nearer to the trunk than the clearance
    abducted = dict.fromkeys(("left_shoulder_abduction", "right_shoulder_abduction"), 0.3)
    start = figure.with_joints(figure.posture("standing"), abducted)
    tip, thorax = (figure.placement(start, name).translation for name in ("right_index_tip", "thorax"))
    by_way = np.vstack([tip, given.free_m])
    free = smooth_way(by_way, 400)
    scene = wb.Scene(figure)
    if name != "alone":
        add_objects(scene, start, free, np.random.default_rng(given.seed))
    if name != "contact":
        return Track(name, scene, start, smooth_way(by_way, steps))
    chest = thorax + (0.16, 0.0, 0.0)  # m: before the origin of the thorax' frame, level with it
    inside = np.array(given.inside_m)
    first, second = round(given.into * steps), round((given.into + given.along) * steps)
    parts = [
        smooth_way(np.array([start_place, end_place]), count)
        for start_place, end_place, count in (
            (tip, inside[0], first),
            (inside[0], inside[1], second - first),
            (inside[1], chest, steps - second),
        )
    ]
    return Track(name, scene, start, np.vstack(parts))


def smooth_way(places: Array, steps: int) -> Array:
    """Way (steps, 3) through places (k, 3), at rest at both ends, with a tenth of the time at the end."""
    # 10 t^3 - 15 t^4 + 6 t^5 (Flash and Hogan 1985, "The coordination of arm movements")
    from scipy.interpolate import CubicSpline

    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    t = np.minimum(np.arange(1, steps + 1) / (0.9 * steps), 1.0)
    share = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return np.asarray(CubicSpline(chord / chord[-1], places, bc_type="natural")(share), dtype=float)


def add_objects(scene: wb.Scene, start: Array, way: Array, rng: np.random.Generator) -> None:
    """Put boxes, spheres and hulls around a body, clear of how it stands and of a way (k, 3) for its fingertip."""
    scene.add(wb.Box(tuple(given.block_m)), name="block", at=given.block_at_m)
    put_objects(scene, Occupied(scene.figure, (start,)), way, rng, given.space_m)


def put_objects(
    scene: wb.Scene, taken: Occupied, way: Array, rng: np.random.Generator, space: Sequence[Sequence[float]],
    size: float = 1.0, boxes: int = 6,
) -> None:  # fmt: skip
    """Put boxes, spheres and hulls, scaled by `size`, into a space (2, 3) [m], clear of what is there and a way."""
    kinds = ["box"] * boxes + ["sphere"] * given.spheres + ["hull"] * given.hulls
    taken.keep_free(way[::8], size * (given.room_way_m - given.room_start_m))

    def make(number: int, rng: np.random.Generator) -> tuple[str, wb.Shape]:
        return kinds[number], _shape(kinds[number], rng, size)

    add_things(scene, len(kinds), taken, size * given.room_start_m, rng, space, make)


def _shape(kind: str, rng: np.random.Generator, size: float) -> wb.Shape:
    if kind == "box":
        edges = size * rng.uniform(0.06, 0.28, 3)
        return wb.Box((float(edges[0]), float(edges[1]), float(edges[2])))
    if kind == "sphere":
        return wb.Sphere(size * float(rng.uniform(0.04, 0.12)))
    points = rng.normal(size=(100, 3))
    points *= size * rng.uniform(0.05, 0.12, 3) / np.linalg.norm(points, axis=1, keepdims=True)
    return wb.Hull(points)


class Verdict(NamedTuple):
    """What came of one run.

    After each step (steps,): least signed distance of all pairs [m], pairs nearer than `SETTING.within`, pairs at the
    clearance to 1 mm, distance of the tip from its target [m]. Of the run: the greatest distance [m] and angle [rad] of
    a foot from where it began; how far the worst joint was out of its limits [rad]; the fastest joint and root as
    shares of the bounds; the mean of all joints' absolute accelerations [rad/s^2].
    """

    least_distance: Array
    near: Array
    touching: Array
    error: Array
    foot_drift: float
    foot_turn: float
    limit_violation: float
    fastest_joint: float
    fastest_root: float
    acceleration: float


def judge(track: Track, postures: Array) -> Verdict:
    """Judge the postures (steps, nq) that a tool went through; ValueError where one is not finite."""
    if not np.isfinite(postures).all():
        raise ValueError("a tool went to a posture that is not finite")
    scene, figure = track.scene, track.scene.figure
    feet, tip = [figure.frame_id(name) for name in track.feet], figure.frame_id(track.tip)
    state = scene.state(track.start)
    stood = [pin.SE3(state.frame(foot)) for foot in feet]
    least, near, touching, error, drift, turn = [], [], [], [], [0.0], [0.0]
    for pairs, target in zip(pairs_along(scene, postures), track.targets, strict=True):
        least.append(pairs.least)
        near.append(int((pairs.distance < SETTING.within).sum()))
        # A pair nearer than the clearance and 1 mm is in contact.
        touching.append(int((pairs.distance < track.clearance + 1e-3).sum()))
        error.append(float(np.linalg.norm(pairs.state.frame(tip).translation - target)))
        for foot, there in zip(feet, stood, strict=True):
            moved = there.actInv(pairs.state.frame(foot))
            drift.append(float(np.linalg.norm(moved.translation)))
            turn.append(float(np.linalg.norm(pin.log3(moved.rotation))))
    whole = np.vstack([track.start, postures])
    speed = np.abs(velocities(scene.model, whole, SETTING.dt)).max(axis=0)
    root, joints = np.split(speed, [6 if track.floating else 0])
    angles = np.vstack([track.start, whole])[:, figure.limits.idx_q]
    return Verdict(
        np.array(least), np.array(near), np.array(touching), np.array(error), max(drift), max(turn),
        limit_violation(figure, postures), float(joints.max(initial=0.0)) / SETTING.joint_speed,
        max(
            float(root[:3].max(initial=0.0)) / SETTING.root_speed, float(root[3:].max(initial=0.0)) / SETTING.root_turn
        ),
        float(np.abs(np.diff(angles, 2, axis=0)).mean()) / SETTING.dt**2,
    )  # fmt: skip


def figure_tracks(spec: str, steps: int = 200) -> list[Track]:
    """Build the reaches of a figure, by name or path; pairs keep half of the least distance if that is less."""
    figure = wb.load(spec)
    chains = [chain for chain in figure.chains.values() if chain.joints]
    if not chains:
        raise InputError(f"{spec}: it has no chain of joints with a tip that could reach; give a figure that moves")
    chain = max(chains, key=lambda chain: len(chain.joints))
    dofs = sorted({dof for name in chain.joints for dof in figure.dofs([name]).tolist()})
    paths, distance = _ways(figure, spec, dofs, steps)
    clearance = min(SETTING.clearance, 0.5 * distance)
    held = (str(figure.segments[0]),) if figure.root == "free" else ()
    places = tuple(np.array([figure.placement(q, chain.tip).translation for q in way]) for way in paths)
    tracks = []
    for name in VARIANTS:
        scene = wb.Scene(figure)
        contact = name == "contact"
        if name != "alone":
            _furnish(scene, paths, places, block=contact)
        label = f"{Path(spec).stem}, {name}"
        tracks.append(Track(label, scene, figure.neutral, places[contact], chain.tip, held, clearance))
    return tracks


def _ways(figure: wb.Figure, spec: str, dofs: Sequence[int], steps: int) -> tuple[tuple[Array, Array], float]:
    """Postures (steps, nq) through two random ones, and those to the first and back; the figure's least distance."""
    scene, start, still = wb.Scene(figure), figure.neutral, np.zeros(figure.model.nv)
    random = random_postures(figure.model, 2 * given.candidates, given.seed).reshape(given.candidates, 2, -1)
    for share in given.shares:
        for pair in random:
            moves = np.zeros((2, figure.model.nv))
            for move, q in zip(moves, pair, strict=True):
                move[dofs] = pin.difference(figure.model, start, q)[dofs]
                # A joint moves by 1 rad or m at most to each posture: a way of two seconds keeps the speed bound.
                move *= share * min(1.0, 1.0 / max(float(np.abs(move).max()), 1e-12))
            there, back = (
                np.array([pin.integrate(figure.model, start, move) for move in smooth_way(np.vstack(places), steps)])
                for places in ((still, *moves), (still, moves[0], still))
            )
            tested = max(1, steps // 50)  # postures along a way that are tested for being free
            least = _least(scene, np.vstack([start, there[::tested], there[-1:], back[::tested]]))
            if least > given.own_room_m:
                return (there, back), least
    raise InputError(f"{spec}: no way was found along which it stays free of itself; give another figure")


def _least(scene: wb.Scene, q: Array) -> float:
    """Least distance of any pair at postures (n, nq) up to the first that is not free, at most twice the clearance."""
    least: float = 2.0 * SETTING.clearance
    for posture in q:
        if least > given.own_room_m and len(scene.geometry.collisionPairs):
            least = float(scene.contacts(posture, within=least).distance.min(initial=least))
    return least


def _furnish(scene: wb.Scene, paths: tuple[Array, Array], places: Sequence[Array], block: bool) -> None:
    """Put the objects clear of both paths, and a block about where the second one takes the tip farthest."""
    # Objects are put clear of twelve postures along each way.
    taken = Occupied(scene.figure, np.vstack([way[:: max(1, len(way) // 12)] for way in paths]))
    tips = np.vstack(places)
    occupied = np.vstack([taken.centres, tips])
    low, high = occupied.min(axis=0), occupied.max(axis=0)
    # The objects of the standing human surround 2 m; those of a figure are scaled with its own size.
    size = float((high - low).max()) / 2.0
    if block:
        _add_block(scene, places[1], size)
    space = (low - size * given.room_space_m).tolist(), (high + size * given.room_space_m).tolist()
    put_objects(scene, taken, tips, np.random.default_rng(given.seed), space, size, given.boxes - block)


def _add_block(scene: wb.Scene, places: Array, size: float) -> None:
    """Put a box about the place of the tip that is farthest from the first, as large as leaves the start free."""
    standing, edges = Occupied(scene.figure, (scene.figure.neutral,)), size * np.array(given.block_m)
    at = places[np.argmax(np.linalg.norm(places - places[0], axis=1))]
    for share in given.shares:
        x, y, z = (share * edges).tolist()
        box = wb.Box((x, y, z))
        if standing.clear_of(box, (*at.tolist(),), size * given.room_start_m):
            scene.add(box, name="block", at=tuple(at.tolist()))
            return
    raise InputError(f"{scene.figure.name}: a block at the end of its way would touch it where it starts")

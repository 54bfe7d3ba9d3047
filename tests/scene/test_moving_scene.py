"""Things that move get joints: they stand where a moved thing stands, meet what they should, and go straight."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import wholebody as wb
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.proximity import PairTable, Proximity
from wholebody.scene.moving_obstacles import PER_THING, MovingScene


def hull_points() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(12, 3)) * (0.1, 0.2, 0.05) + (0.2, 0.0, 0.1)


@pytest.fixture
def scene() -> wb.Scene:
    scene = wb.Scene(wb.load("avatar"))
    scene.add(wb.Box((0.02, 0.6, 0.6)), name="board", at=(0.6, 0.0, 1.0))
    scene.add(wb.Hull(hull_points()), name="stone", at=(0.5, 0.5, 1.2))
    scene.add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.01))
    scene.add(wb.Sphere(0.1), name="lamp", at=(0.0, 0.0, 2.2))
    scene.attach(wb.Box((0.1, 0.2, 0.02)), to="right_hand", name="tray", at=(0.0, 0.0, -0.2))
    return scene


def turned(place: pin.SE3, rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)) @ place.rotation, place.translation + 0.3 * rng.normal(size=3))


def test_pieces_and_distances_are_those_of_a_scene_whose_things_were_moved(scene: wb.Scene) -> None:
    moving = MovingScene(scene.built, ["board", "tray", "stone"], between_things=False)
    model, rng = scene.model, np.random.default_rng(0)
    assert moving.model.nq == model.nq + 3 * PER_THING
    assert moving.model.nv == model.nv + 3 * 6
    table = PairTable(moving.model, moving.geometry)
    proximity, data = Proximity(table), moving.model.createData()
    for _ in range(5):
        q = scene.figure.clamp(pin.integrate(model, scene.figure.posture("standing"), 0.2 * rng.normal(size=model.nv)))
        places = {name: turned(scene.objects[name].placement, rng) for name in moving.names}
        at = moving.configuration(q, places)
        assert at[: moving.figure_nq] == pytest.approx(q)
        for name, place in places.items():
            assert moving.placement(at, name).homogeneous == pytest.approx(place.homogeneous, abs=1e-12)
            scene.move(name, at=place)
        pin.forwardKinematics(moving.model, data, at)
        found, expected = proximity.query(data, 0.5), scene.contacts(q, 0.5)
        assert found.placements == pytest.approx(expected.placements, abs=1e-9)
        found = found.nearest_first()
        assert len(found.number) > 50
        assert found.distance == pytest.approx(expected.distance, abs=2e-6)
        assert set(map(tuple, found.pair)) == set(map(tuple, expected.pair))


def test_pairs_of_things_are_those_of_which_one_moves(scene: wb.Scene) -> None:
    moving = MovingScene(scene.built, ["board", "lamp"])
    own = [(pair.first, pair.second) for pair in scene.geometry.collisionPairs]
    pairs = [tuple(pair) for pair in pairs_of(moving.geometry)]
    assert pairs[: len(own)] == own
    more = pairs[len(own) :]
    assert len(set(pairs)) == len(pairs)
    named = {frozenset(moving.owners[k] for k in pair) for pair in more}
    assert named == {
        frozenset(pair)
        for pair in [("board", "stone"), ("board", "floor"), ("board", "lamp"), ("lamp", "stone"), ("lamp", "floor")]
    }


def test_the_centre_goes_straight_and_is_that_of_the_volume(scene: wb.Scene) -> None:
    moving = MovingScene(scene.built, ["stone"])
    centroid = trimesh.convex.convex_hull(hull_points()).center_mass
    assert moving.centres["stone"] == pytest.approx(centroid, abs=1e-9)
    q, rng = scene.figure.posture("standing"), np.random.default_rng(1)
    start, end = (turned(scene.objects["stone"].placement, rng) for _ in range(2))
    first, last = (moving.configuration(q, {"stone": place}) for place in (start, end))
    turn = pin.log3(start.rotation.T @ end.rotation)
    for share in (0.0, 0.3, 0.7, 1.0):
        place = moving.placement(pin.interpolate(moving.model, first, last, share), "stone")
        straight = (1.0 - share) * start.act(centroid) + share * end.act(centroid)
        assert place.act(centroid) == pytest.approx(straight, abs=1e-9)
        assert place.rotation == pytest.approx(start.rotation @ pin.exp3(share * turn), abs=1e-9)


def test_things_that_stay_are_where_they_were_moved_to(scene: wb.Scene) -> None:
    moving = MovingScene(scene.built, ["board"])
    scene.move("lamp", at=(1.0, 2.0, 3.0)).move("board", at=(9.0, 9.0, 9.0))
    moving.refresh()
    lamp = moving.geometry.geometryObjects[moving.owners.index("lamp")]
    assert lamp.placement.translation == pytest.approx([1.0, 2.0, 3.0])
    board = moving.geometry.geometryObjects[moving.owners.index("board")]
    assert board.placement.translation == pytest.approx([0.0, 0.0, 0.0])


def test_a_sweep_in_which_both_sides_move_is_that_of_fine_subdivision() -> None:
    """A moving person and flying plates, balls and rods: pieces placed share by share, coal asked for all pairs."""
    scene, rng = wb.Scene(wb.load("avatar")), np.random.default_rng(5)
    shapes = (wb.Box((0.001, 0.4, 0.4)), wb.Sphere(0.05), wb.Capsule(0.01, 0.8), wb.Box((0.05, 0.3, 0.3)))
    for number, shape in enumerate(shapes):
        scene.add(shape, name=f"thing{number}", at=(2.0 + number, 0.0, 1.0))
    moving = MovingScene(scene.built, [f"thing{number}" for number in range(4)])
    sweep, model = Sweep(moving.model, moving.geometry), scene.model
    data, results = moving.model.createData(), pin.GeometryData(moving.geometry)
    hits = 0
    standing = scene.figure.posture("standing")
    for _ in range(14):
        q0 = scene.figure.clamp(pin.integrate(model, standing, 0.05 * rng.normal(size=model.nv)))
        q1 = scene.figure.clamp(pin.integrate(model, q0, 0.1 * rng.normal(size=model.nv)))
        starts, ends = {}, {}
        for number, name in enumerate(moving.names):
            angle = rng.uniform(0.0, 2.0 * np.pi)
            middle = np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), rng.uniform(0.2, 1.7)])
            way = rng.normal(size=3)
            way *= rng.uniform(1.0, 20.0) / 60.0 / np.linalg.norm(way)
            turn = pin.exp3(rng.normal(size=3))
            starts[name] = pin.SE3(turn, middle + (number - 1.5) * np.array([0.0, 0.0, 0.02]))
            ends[name] = pin.SE3(pin.exp3(0.3 * rng.normal(size=3)) @ turn, starts[name].translation + way)
        begin, end = moving.configuration(q0, starts), moving.configuration(q1, ends)
        found = sweep.first_contact(begin, end)

        def distances(share: float, begin=begin, end=end) -> np.ndarray:
            at = pin.interpolate(moving.model, begin, end, share)
            pin.computeDistances(moving.model, data, moving.geometry, results, at)
            return np.array([result.min_distance for result in results.distanceResults])

        level = np.minimum(distances(0.0), 0.0) - 1e-4
        sampled = next((share for share in np.linspace(0, 1, 201) if (distances(share) < level).any()), None)
        if found is None:
            assert sampled is None
            continue
        assert found.certain
        assert sampled is None or found.fraction <= sampled
        there = distances(found.fraction)
        assert (there >= level - 1e-9).all()
        assert there[found.index] <= level[found.index] + 0.51e-4
        hits += 1
    assert 4 <= hits <= 12


def test_a_frame_sees_where_things_were_put_between_the_frames_of_others(scene: wb.Scene) -> None:
    """By one workspace, of which the sets that move take turns, and by a copy of the scene that has seen no frame."""
    workspace, q = scene.workspace(), scene.figure.posture("standing")
    there = pin.integrate(scene.model, q, np.concatenate([[0.8, 0.0, 0.0], np.zeros(scene.model.nv - 3)]))
    scene.move("board", at=(5.0, 0.0, 1.0))
    met = list[str | None]()
    for number, (mover, put, at) in enumerate(
        [
            ("stone", "lamp", (0.6, 0.0, 1.1)),
            ("board", "lamp", (5.0, 3.0, 1.1)),
            ("stone", "board", (0.7, 0.0, 1.0)),
            ("lamp", "board", (6.0, 0.0, 1.0)),
            ("stone", "lamp", (0.5, 0.0, 1.1)),
            ("board", "lamp", (0.9, 0.1, 1.1)),
        ]
    ):
        scene.move(put, at=at)
        scene.move(mover, at=(5.0, -3.0 - number, 1.0), over=0.1)
        workspace.refresh()
        way = workspace.where(mover)
        found = workspace.frame({mover: (way, way)}).first_contact(q, there, 1e-4)
        expected = copy.copy(scene).sweep(q, there, moves={mover: (way, way)})
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert found.fraction == pytest.approx(expected.fraction, abs=1e-9)
        met.append(None if found is None else workspace.owners[found.pair[1]])
    assert met == ["lamp", None, "board", None, "lamp", "lamp"]

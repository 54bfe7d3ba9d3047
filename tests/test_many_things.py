"""Scenes of very many things: what they take, and that no answer differs from that of few."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.flesh import settle
from tests.reference import moved_pairs as reference
from wholebody.assessment import all_pairs
from wholebody.assessment.all_pairs import AllPairs
from wholebody.geometry import hull, pair_distances, pieces
from wholebody.geometry.continuous.moved_pairs import QueryResult, far_moved
from wholebody.geometry.large_models import TABLED, geometry_model
from wholebody.motion.checking import check


def crowd(count: int, spread: float = 1.2) -> wb.Scene:
    """An avatar among balls, boxes and a floor, some of them in it."""
    rng = np.random.default_rng(count)
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    for k in range(count):
        shape = wb.Sphere(0.02) if k % 2 else wb.Box((0.03, 0.02, 0.05))
        scene.add(shape, name=f"thing {k}", at=rng.uniform(-spread, spread, 3) + (0.0, 0.0, 1.0))
    return scene


def by_coal(scene: wb.Scene, data: pin.Data, q: Any) -> Any:
    """Distances of all pairs at q by Pinocchio and coal alone."""
    geometry = scene.geometry
    pin.forwardKinematics(scene.model, data, q)
    exact = pin.GeometryData(geometry)
    pin.updateGeometryPlacements(scene.model, data, geometry, exact)
    settle(geometry, exact)
    pin.computeDistances(geometry, exact)
    return np.array([result.min_distance for result in exact.distanceResults])


@pytest.fixture
def no_pair_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_distances, "KEPT", 0)
    monkeypatch.setattr(all_pairs, "MANY", 0)


def answers(scene: wb.Scene) -> dict[str, object]:
    """What a scene says of a motion and of its ends."""
    figure = scene.figure
    q = figure.posture(figure.postures[0])
    end = q.copy()
    end[0] += 0.3
    pairs = AllPairs(scene.built)
    pairs.move(q)
    near = pairs.nearer(np.full(len(scene.pair_table.pairs), 0.1))
    contacts = scene.contacts(q, 0.1)
    found = scene.sweep(q, end)
    problem = wb.Problem(scene, goals=[wb.Point("right_palm", figure.placement(q, "right_palm").translation)])
    return {
        "least": pairs.least,
        "near": (near.number, near.found[:, 0]),
        "contacts": (contacts.number, contacts.distance),
        "sweep": None if found is None else found.fraction,
        "overlapping": int((pairs.distance < 0.0).sum()),
        "violation": wb.assess(problem, q).penetration,
        "dip": check(wb.Clip(figure, np.array([q, end]), 0.1), scene).between[0],
    }


def test_pairs_without_data_are_measured_where_their_pieces_are_now(no_pair_data: None) -> None:
    scene = crowd(30)
    figure, data = scene.figure, scene.model.createData()
    distances = pair_distances.PairDistances(scene.geometry, scene.pair_table.pairs)
    for share in (0.0, 0.5, 0.5, 0.0):  # parts move, things do not, and then nothing does
        q = figure.clamp(pin.integrate(scene.model, figure.neutral, np.full(scene.model.nv, share)))
        pin.forwardKinematics(scene.model, data, q)
        distances.place(scene.model, data)
        np.testing.assert_allclose(distances.all_measured()[:, 0], by_coal(scene, data, q), atol=1e-6)


def test_no_answer_depends_on_whether_data_are_kept_for_each_pair(request: pytest.FixtureRequest) -> None:
    kept = answers(crowd(120))
    request.getfixturevalue("no_pair_data")
    scene = crowd(120)
    assert len(scene.workspace().proximity.results.distanceResults) == 0
    single = answers(scene)
    for name, value in kept.items():
        if isinstance(value, tuple):
            assert (value[0] == single[name][0]).all(), name
            assert single[name][1] == pytest.approx(value[1], abs=2e-6), name
        else:
            assert single[name] == pytest.approx(value, abs=1e-5), name


@pytest.mark.parametrize("floor", [False, True])
def test_judging_among_many_things_is_asking_coal_for_every_pair(floor: bool) -> None:
    """Balls, turned boxes, long walls and a floor: what is near is exact, and the rest is bounded from below."""
    rng, scene = np.random.default_rng(3), wb.Scene(wb.load("avatar"))
    for k in range(300):
        shape = wb.Sphere(0.05) if k % 3 else wb.Box((0.1, 0.05, 0.1 if k % 9 else 3.0))
        turn = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
        scene.add(shape, name=f"thing {k}", at=(*rng.uniform(-2.0, 2.0, 2), rng.uniform(0.0, 2.0), *turn))
    if floor:
        scene.add(wb.HalfSpace(), name="floor")
    table = scene.pair_table
    assert len(table.pairs) >= all_pairs.MANY
    pairs, data, within = (
        AllPairs(scene.built),
        scene.model.createData(),
        rng.choice([0.0, 0.02, 0.3], len(table.pairs)),
    )
    for shift in (0.0, 0.5, 30.0):
        q = scene.figure.posture(scene.figure.postures[0])
        q[:3] += shift
        wanted = by_coal(scene, data, q)
        pairs.move(q)
        assert pairs.least == pytest.approx(wanted.min(), abs=2e-6)
        near = pairs.nearer(within)
        for few in (wanted < within - 2e-6, wanted < pairs.least + 1e-9):
            assert pairs.distance[few] == pytest.approx(wanted[few], abs=2e-6)
        assert (pairs.distance <= wanted + 2e-6).all()
        assert (pairs.distance < 0.0).sum() == pytest.approx((wanted < 0.0).sum(), abs=1)
        assert (
            set(np.flatnonzero(wanted < within - 2e-6))
            <= set(near.number)
            <= set(np.flatnonzero(wanted < within + 2e-6))
        )


def test_near_pairs_of_two_figures_among_many_things_are_those_that_coal_finds() -> None:
    """Also after figures and things went far, and came back, and beside things of which a part is near alone."""
    rng = np.random.default_rng(8)
    scene = wb.Scene({"anna": wb.load("avatar"), "otto": (wb.load("hand"), (6.0, 0.0, 1.0))})
    for k in range(200):
        shape = wb.Sphere(0.05) if k % 3 else wb.Box((0.1, 0.05, 0.1 if k % 9 else 3.0))
        turn = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
        scene.add(shape, name=f"thing {k}", at=(rng.uniform(-2.0, 8.0), *rng.uniform(-1.5, 2.0, 2), *turn))
    begin, second, body, first, members = scene.pair_table.blocks
    assert set(body.tolist()) == {-1, 0, 1}
    assert len(first) == 3
    assert first[-1] == len(members) == len(set(members.tolist()))
    assert (np.bincount(second[second >= 0])[-200:] == 2).all()  # each thing beside both
    assert len(begin) == len(second) + 1
    data = scene.model.createData()
    rest = scene.figure.posture(scene.figure.postures[0])
    last, before, passed, met = None, rest, 0, 0
    with scene.borrow() as workspace:
        for shift in (0.0, 0.4, 50.0, 1.0, 1.01, 2.0):
            q = pin.integrate(scene.model, rest, np.concatenate([[shift, 0, 0], np.zeros(scene.model.nv - 3)]))
            wanted = by_coal(scene, data, q)
            for within in (0.0, 0.3):
                found = workspace.near(q, within)
                assert set(np.flatnonzero(wanted < within - 2e-6)) <= set(found.number)
                assert found.distance == pytest.approx(wanted[found.number], abs=2e-6)
            least = workspace.proximity.least(workspace.state.data, 0.02)
            assert (least <= wanted + 2e-6).all()
            assert np.median(wanted - least) < 0.5  # what is far has a bound of its own
            here = QueryResult(found, within)
            if last is not None:
                moved = far_moved(scene.pair_table, last, here)
                assert np.array_equal(moved, reference.far_moved(scene.pair_table, last, here))
                passed += len(moved)
                every = workspace.sweep.first_contact(before, q, np.arange(len(wanted)))
                found_first = workspace.sweep.first_contact(before, q)
                assert (found_first is None) == (every is None)
                if found_first is not None and every is not None:
                    assert (found_first.index, found_first.fraction) == (every.index, every.fraction)
                    met += 1
            last, before = here, q
    assert passed > 100
    assert met >= 2


def test_solves_without_pair_data_are_free_and_repeatable(no_pair_data: None) -> None:
    scene = crowd(60, spread=2.5)
    target = scene.figure.placement(scene.figure.posture(scene.figure.postures[0]), "right_palm").translation
    problem = wb.Problem(scene, goals=[wb.Point("right_palm", target + (0.1, 0.0, 0.1))], clearance=0.001)
    one, other = wb.solve(problem), wb.solve(problem)
    assert (one.q == other.q).all()
    assert one.status in ("solved", "stalled", "unreachable")
    assert one.assessment.penetration <= 1e-5 or one.status != "solved"


def test_the_pairs_of_a_large_model_are_those_of_a_small_one() -> None:
    count = TABLED + 10
    pieces = [pin.GeometryObject(f"p{k}", 0, 0, pin.SE3(np.eye(3), np.ones(3) * k), None) for k in range(count)]
    pairs = np.array([[0, 1], [5, 900], [7, count - 1]])
    made = geometry_model(pieces, pairs)
    assert [(pair.first, pair.second) for pair in made.collisionPairs] == [tuple(pair) for pair in pairs.tolist()]
    assert made.ngeoms == count
    assert made.collisionPairMapping.size == 0
    assert made.geometryObjects[9].name == "p9"
    again = pickle.loads(pickle.dumps(made))
    assert len(again.collisionPairs) == 3
    assert again.ngeoms == count


def test_a_scene_of_more_things_than_are_tabled_is_as_one_of_few() -> None:
    scene = crowd(TABLED, spread=2.0)
    q = scene.figure.posture(scene.figure.postures[0])
    assert scene.geometry.collisionPairMapping.size == 0
    contacts = scene.contacts(q, 0.05)
    body = len(scene.figure.geometry.geometryObjects)
    few = wb.Scene(scene.figure)
    near = {scene.piece_owner[piece] for piece in contacts.pair.ravel().tolist() if piece >= body}
    for name in sorted(near):
        few.add(scene.objects[name].shape, name=name, at=scene.objects[name].placement)
    assert np.sort(contacts.distance) == pytest.approx(np.sort(few.contacts(q, 0.05).distance), abs=2e-6)
    for copied in (copy.copy(scene), pickle.loads(pickle.dumps(scene))):
        assert copied.contacts(q, 0.05).distance == pytest.approx(contacts.distance, abs=2e-6)
    scene.move("thing 5", at=(0.0, 0.0, 1.0))
    assert "thing 5" in {scene.piece_owner[piece] for piece in scene.overlapping(q).pair.ravel().tolist()}


def test_hulls_of_cylinders_are_made_once_and_their_faces_are_those_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many sizes there are: a scene is built anew when a thing comes."""
    scene = wb.Scene(wb.load("avatar")).add(wb.Cylinder(0.1, 0.2), name="one")
    _ = scene.built
    made: list[int] = []
    faces: list[int] = []
    make, look = hull.coal_convex, pieces._convex_faces
    monkeypatch.setattr(hull, "coal_convex", lambda *given: (made.append(1), make(*given))[1])
    monkeypatch.setattr(pieces, "_convex_faces", lambda *given: (faces.append(1), look(*given))[1])
    for number in range(1100):
        scene.add(wb.Cylinder(0.01 + 1e-5 * number, 0.3), name=f"post {number}", at=(5.0, 0.0, 0.01 * number))
    for changed in (scene, scene.remove("one")):
        assert changed.built.table.points.shape[0] > 1100 * 2 * hull.SIDES
    assert (len(made), len(faces)) == (1100, 0)


def test_hulls_of_like_shapes_are_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of cylinders of any size, of rings of one size, and of one hull that many things have, when it is made."""
    found: list[str] = []
    search = hull._solid_hull
    monkeypatch.setattr(hull, "_solid_hull", lambda cloud, what: (found.append(what), search(cloud, what))[1])
    hull._unit_cylinder.cache_clear()
    hull.torus_pieces.cache_clear()
    rng = np.random.default_rng(0)
    solid, scene = wb.Hull(rng.normal(size=(20, 3))), wb.Scene(wb.load("avatar"))
    for number, (radius, length) in enumerate(rng.uniform(0.01, 0.5, size=(10, 2))):
        for shape in (wb.Cylinder(radius, length), wb.Torus(0.3, 0.02), solid):
            scene.add(shape, name=f"{type(shape).__name__}{number}", at=(5.0, 0.0, float(number)))
    for number, piece in enumerate(scene.geometry.geometryObjects):
        if piece.name.startswith("Cylinder"):
            own = np.array(piece.geometry.points())
            again = hull.hull_piece(own, "as it is")
            assert len(own) == len(np.array(again.geometry.points())) == 2 * hull.SIDES, number
    names = [what for what in found if what != "as it is"]
    assert sorted(names) == sorted(["Cylinder", "Hull", *["Torus"] * hull.SECTORS])

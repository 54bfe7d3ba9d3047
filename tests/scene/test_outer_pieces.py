"""A person in spheres meets things as closely as one in hulls: answers are judged by coal on the hulls alone."""

import copy
import pickle
from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

INSIDE = 1e-4  # m: deeper than this a posture is inside something


def shelf(figure, seed):
    """A reach between two boards with a post beside the hand; the answer is among random places before the person."""
    rng = np.random.default_rng(seed)
    target = np.array([rng.uniform(0.35, 0.55), rng.uniform(-0.45, 0.1), rng.uniform(0.8, 1.4)])
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.4, 0.8, 0.02)), name="board", at=target + [0.15, 0.0, -rng.uniform(0.05, 0.08)])
    scene.add(wb.Box((0.4, 0.8, 0.02)), name="top", at=target + [0.15, 0.0, rng.uniform(0.07, 0.12)])
    side = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.08)
    scene.add(wb.Cylinder(0.02, 2.0), name="post", at=(target[0] - rng.uniform(0.05, 0.15), target[1] + side, 1.0))
    return wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", target)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
    )


@pytest.fixture(scope="module")
def hulls():
    return wb.load("human", detail="hulls")


@pytest.fixture(scope="module")
def spheres():
    return wb.load("human", detail="spheres")


def deepest(hulls, things, q):
    """How deep the hulls are in things of the world at q, metres, by one call to coal a pair."""
    data, placed = hulls.model.createData(), hulls.geometry.createData()
    pin.updateGeometryPlacements(hulls.model, data, hulls.geometry, placed, q)
    found = 0.0
    parts = [(part.geometry, thing.placement * part.placement) for thing in things for part in thing.shape.pieces()]
    for (number, piece), (shape, place) in product(enumerate(hulls.geometry.geometryObjects), parts):
        at = coal.Transform3s(placed.oMg[number].rotation, placed.oMg[number].translation)
        there = coal.Transform3s(place.rotation, place.translation)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        found = max(found, -coal.distance(piece.geometry, at, shape, there, request, result))
    return found


def test_solved_reaches_are_free_by_the_hulls(spheres, hulls):
    problems = [shelf(spheres, seed) for seed in range(4)]
    answers = [wb.solve(problem) for problem in problems]
    inside = [
        deepest(hulls, problem.scene.objects.values(), answer.q)
        for problem, answer in zip(problems, answers, strict=True)
        if answer.solved
    ]
    assert len(inside) >= len(problems) // 2, [answer.message for answer in answers]
    assert max(inside) < INSIDE


def test_a_tracker_keeps_the_hulls_out(spheres, hulls):
    problem = shelf(spheres, 2)
    tracker, q, inside = wb.methods.QP().tracker(problem, 0.02), problem.start.copy(), 0.0
    for _ in range(20):
        q = tracker.step(q).q
        inside = max(inside, deepest(hulls, problem.scene.objects.values(), q))
    assert inside < INSIDE


def test_the_assessment_sees_the_hulls(spheres, hulls):
    """A board is put into the tip of the index finger, which no sphere reaches."""
    q = spheres.posture(spheres.postures[0])
    tip = spheres.placement(q, "right_index_tip").translation
    scene = wb.Scene(spheres).add(wb.Box((0.04, 0.04, 0.02)), name="board", at=tip + [0.0, 0.0, 0.005])
    judged = wb.assess(wb.Problem(scene), q)
    assert judged.penetration == pytest.approx(deepest(hulls, scene.objects.values(), q), abs=1e-6)
    assert judged.penetration > 0.01
    assert str(judged.blockers[0]) == "right_hand against board"
    assert {(one.a, one.b) for one in scene.penetration(q)} == {("right_hand", "board")}


def test_a_body_meets_itself_and_what_it_carries_with_its_spheres(spheres, hulls):
    scene = wb.Scene(spheres).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(2.0, 0.0, 0.0))
    scene.attach(wb.Box((0.1, 0.1, 0.1)), to="right_hand", name="held", at=(0.0, 0.0, -0.2))
    count, names = spheres.geometry.ngeoms, scene.piece_owner
    for first, second in scene.pair_table.pairs.tolist():
        owners = {names[first], names[second]}
        outer = [piece for piece in (first, second) if count <= piece < count + len(spheres.outer)]
        assert bool(outer) == ("box" in owners and "held" not in owners)
    met = {names[first] for first, second in scene.pair_table.pairs.tolist() if names[second] == "box"}
    assert met == {piece.name.partition(":")[0] for piece in hulls.geometry.geometryObjects} | {"held"}


def test_copies_and_smaller_figures_have_outer_pieces(spheres, hulls):
    problem = shelf(spheres, 3)
    small = wb.simplify(problem)
    q = wb.solve(small.problem).q
    assert deepest(hulls, problem.scene.objects.values(), q) < INSIDE
    count = len(problem.scene.pair_table.pairs)
    for copied in (copy.copy(problem.scene), pickle.loads(pickle.dumps(problem.scene))):
        assert len(copied.pair_table.pairs) == count
    reduced = spheres.reduced(["right_arm", "spine"])
    q = reduced.posture(reduced.postures[0])
    data, geometry = reduced.model.createData(), pin.GeometryModel()
    for piece in reduced.outer:
        geometry.addGeometryObject(piece)
    placed = geometry.createData()
    pin.updateGeometryPlacements(reduced.model, data, geometry, placed, q)
    others = hulls.geometry.createData()
    pin.updateGeometryPlacements(
        hulls.model, hulls.model.createData(), hulls.geometry, others, hulls.posture(hulls.postures[0])
    )
    lift = placed.oMg[0].translation - others.oMg[0].translation  # a fixed root stays where the model has it
    for one, other in zip(placed.oMg, others.oMg, strict=True):
        np.testing.assert_allclose(one.translation - lift, other.translation, atol=1e-9)


def test_a_falling_body_meets_the_hulls(spheres, hulls):
    ends = []
    for figure in (spheres, hulls):
        scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box((0.1, 0.1, 0.1)), name="cube", at=(0.02, 0.15, 1.9), body=wb.Body(density=300.0))
        world = wb.World(scene)
        for _ in range(30):
            frame = world.step()
        ends.append(frame.placements["cube"].translation)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_outer_pieces_are_not_drawn(spheres, tmp_path):
    scene = wb.Scene(spheres).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(2.0, 0.0, 0.0))
    with wb.Viewer(scene) as viewer:
        viewer.show(spheres.posture(spheres.postures[0]), pieces=True)
        text = viewer.save(tmp_path / "pieces.glb").read_bytes()
    assert b"left_hand" in text
    assert b"(outer)" not in text

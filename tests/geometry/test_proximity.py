"""Signed distances of all pairs: against coal asked pair by pair, and where coal's own answers are no use."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.flesh import settle
from wholebody.geometry import pair_distances
from wholebody.geometry.memory_views import fields, guess_view, placement_view, result_view
from wholebody.geometry.proximity import PairTable, Proximity

SHAPES = {
    "sphere": wb.Sphere(0.12),
    "capsule": wb.Capsule(0.06, 0.3),
    "box": wb.Box((0.3, 0.2, 0.14)),
    "ellipsoid": wb.Ellipsoid((0.2, 0.12, 0.09)),
    "hull": wb.Hull(np.random.default_rng(5).normal(size=(40, 3)) * 0.12),
    "half-space": wb.HalfSpace((0.1, 0.2, 0.97), -0.5),
}


def among_things(detail, rng):
    scene = wb.Scene(wb.load("human", detail=detail))
    for k, shape in enumerate([*SHAPES.values(), *list(SHAPES.values())[:5]]):
        turn = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
        place = rng.uniform(-0.9, 0.9, 3) * (0.0 if isinstance(shape, wb.HalfSpace) else 1.0)
        scene.add(shape, name=f"thing{k}", at=(*place, *turn) if place.any() else (0.0, 0.0, 0.0))
    scene.attach(wb.Box((0.2, 0.1, 0.3)), to="thorax", name="pack", at=(-0.25, 0.0, 0.1))
    return scene


def random_posture(figure, rng):
    q = pin.integrate(figure.model, figure.neutral, 0.6 * rng.normal(size=figure.model.nv))
    return figure.clamp(q)


def exact(scene, pair):
    """Whether coal is exact for a pair: it iterates on ellipsoids, to 1e-6 m."""
    return not any(isinstance(scene.geometry.geometryObjects[int(i)].geometry, coal.Ellipsoid) for i in pair)


def asked_one_by_one(scene, q):
    """Distance, normal and points of every pair from coal itself, each with a fresh result."""
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, q)
    settle(scene.geometry, placed)
    shapes = [piece.geometry for piece in scene.geometry.geometryObjects]
    at = [coal.Transform3s(place.rotation, place.translation) for place in placed.oMg]
    table = {}
    for pair in scene.geometry.collisionPairs:
        a, b = pair.first, pair.second
        result = coal.DistanceResult()
        coal.distance(shapes[a], at[a], shapes[b], at[b], coal.DistanceRequest(), result)
        points = [result.getNearestPoint1(), result.getNearestPoint2()]
        table[a, b] = np.concatenate([[result.min_distance], result.normal, *points])
    return table


@pytest.mark.parametrize("detail", ["capsules", "hulls"])
def test_agrees_with_coal_asked_pair_by_pair(detail):
    """To 1e-9 m at first; from then on coal begins where it ended, and is right to its own tolerance of 1e-6 m."""
    rng = np.random.default_rng(11)
    scene = among_things(detail, rng)
    assert len(scene.geometry.collisionPairs) > 600
    seen = {"near": 0, "inside": 0}
    used = scene.workspace().proximity
    for _ in range(1):
        q = random_posture(scene.figure, rng)
        expected = asked_one_by_one(scene, q)
        for k, within in enumerate((5.0, 0.02, 0.5, -0.01, 0.0, 0.1, 5.0)):
            proximity = Proximity(scene.pair_table) if k == 0 else used
            ask = proximity.query_views if k % 2 else proximity.query
            found = ask(scene.state(q).data, within)
            check(scene, found, expected, within, 1e-9 if k == 0 else 3e-6)
            seen["near"] += len(found.pair)
            seen["inside"] += int((found.distance < 0.0).sum())
    assert min(seen.values()) > 50


def check(scene, found, expected, within, tolerance):
    """Nothing is missed, nothing is there that should not be, and every number is coal's."""
    numbers = {tuple(pair): k for k, pair in enumerate(found.pair)}
    assert len(numbers) == len(found.pair)
    for pair, row in expected.items():
        fine = exact(scene, pair)
        slack = tolerance if fine else 5e-6
        if pair not in numbers:
            assert row[0] >= within - slack
            continue
        k = numbers[pair]
        assert found.distance[k] < within
        assert found.distance[k] == pytest.approx(row[0], abs=slack)
        # faces that are nearly parallel are as near in slightly different directions
        rest = np.concatenate([found.normal[k], found.point_a[k], found.point_b[k]])
        assert rest == pytest.approx(row[1:], abs=1e-4 if tolerance < 1e-8 and fine else 5e-3)
    assert set(numbers) <= set(expected)


def test_bounds_from_below_are_distances_where_pairs_are_near():
    rng = np.random.default_rng(3)
    scene = among_things("capsules", rng)
    state, proximity = scene.state(scene.figure.neutral), Proximity(scene.pair_table)
    for within in (0.02, 0.3, 0.02):
        q = random_posture(scene.figure, rng)
        least, true = proximity.least(state.update(q).data, within), asked_one_by_one(scene, q)
        distance = np.array([true[tuple(pair)][0] for pair in scene.pair_table.pairs.tolist()])
        near = distance < within - 1e-5
        assert (least <= distance + 1e-5).all()
        assert (least[~near] >= within - 2e-5).all()
        np.testing.assert_allclose(least[near], distance[near], atol=1e-5)
        assert np.mean(least > within + 0.1) > 0.2  # far pairs have more than the query asked


def test_contacts_come_nearest_first():
    scene = among_things("capsules", np.random.default_rng(2))
    found = scene.contacts(scene.figure.neutral, 0.5)
    assert len(found.distance) > 20
    assert (np.diff(found.distance) >= 0.0).all()


def test_what_a_contact_says_fits_together():
    scene = among_things("capsules", np.random.default_rng(2))
    found = scene.contacts(random_posture(scene.figure, np.random.default_rng(3)), 0.3)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(1.0, abs=1e-6)
    gap = found.point_b - found.point_a
    assert gap == pytest.approx(found.distance[:, None] * found.normal, abs=2e-6)
    pairs = np.array([[p.first, p.second] for p in scene.geometry.collisionPairs])
    assert np.array_equal(pairs[found.number], found.pair)


def test_numbers_of_the_last_posture_are_never_read(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.1), wb.Sphere(0.1)))

    def at(*x):
        q = scene.figure.neutral
        q[[0, 7, 14]] = x
        return scene.contacts(q, 0.05)

    assert len(at(0.0, 0.0, 0.1).distance) == 3
    assert len(at(0.0, 10.0, 20.0).distance) == 0
    close = at(0.0, 10.0, 10.21)
    assert close.pair.tolist() == [[1, 2]]
    assert close.distance == pytest.approx([0.01])


def test_answers_are_kept_when_the_next_question_comes(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Box((0.1, 0.1, 0.1))))
    q = scene.figure.neutral
    first = scene.contacts(q, 1.0)
    copies = [np.array(part) for part in first]
    q[7:10] = 0.2, 0.1, 0.0
    scene.contacts(q, 1.0)
    for part, copy in zip(first, copies, strict=True):
        assert np.array_equal(part, copy)


def test_answers_in_passing_are_overwritten_and_take_no_memory(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Box((0.1, 0.1, 0.1))))
    workspace, q = scene.workspace(), scene.figure.neutral
    first, kept = workspace.proximity.query_views(workspace.state.update(q).data, 1.0), workspace.near(q, 1.0)
    for part, again in zip(first, kept, strict=True):
        assert np.array_equal(part, again)
    q[7:10] = 0.2, 0.1, 0.0
    second = workspace.proximity.query_views(workspace.state.update(q).data, 1.0)
    for before, after, same in zip(first, second, kept, strict=True):
        assert np.shares_memory(before, after)
        assert not np.shares_memory(after, same)
    assert second.distance[0] != kept.distance[0]


@pytest.mark.parametrize(
    ("name_a", "name_b"),
    [(a, b) for a in list(SHAPES)[:5] for b in list(SHAPES)[:5]],
)
def test_every_pair_in_the_same_place_has_a_way_out(free_bodies, name_a, name_b):
    """Coal leaves the normal zero where capsules' axes cross and where balls are concentric."""
    figure = free_bodies(SHAPES[name_a], SHAPES[name_b])
    scene = wb.Scene(figure)
    for turn in ((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0), (0.0, 0.5, 0.0)):
        q = figure.neutral
        q[10:14] = pin.Quaternion(pin.exp3(np.array(turn))).coeffs()
        found = scene.contacts(q, 0.0)
        assert found.pair.tolist() == [[0, 1]]
        assert all(np.isfinite(part).all() for part in found)
        normal, depth = found.normal[0], -found.distance[0]
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-9)
        assert found.point_b[0] - found.point_a[0] == pytest.approx(-depth * normal, abs=1e-6)
        q[7:10] += (depth + 0.01) * normal  # the second piece, moved along the normal, comes free
        assert scene.contacts(q, 1.0).distance[0] == pytest.approx(
            0.01, abs=1e-3 if "ellipsoid" in (name_a, name_b) else 2e-6
        )


@pytest.mark.parametrize("along", [0.0, 0.05, 0.25])
def test_capsules_on_one_axis(free_bodies, along):
    scene = wb.Scene(free_bodies(SHAPES["capsule"], SHAPES["capsule"]))
    q = scene.figure.neutral
    q[9] = along
    found = scene.contacts(q, 0.0)
    assert found.distance[0] == pytest.approx(-0.12)
    assert found.normal[0] @ (0.0, 0.0, 1.0) == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1.0)


@pytest.mark.parametrize("swapped", [False, True])
def test_normal_points_from_the_first_to_the_second(free_bodies, swapped):
    shapes = [SHAPES["capsule"], SHAPES["box"]]
    scene = wb.Scene(free_bodies(*(shapes[::-1] if swapped else shapes)))
    for gap in (0.05, -0.02):
        q = scene.figure.neutral
        q[7] = 0.15 + 0.06 + gap
        found = scene.contacts(q, 1.0)
        assert found.normal[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
        assert found.distance[0] == pytest.approx(gap, abs=1e-6)


@pytest.mark.parametrize("shape", list(SHAPES)[:5])
def test_half_space_reaches_everywhere(free_bodies, shape):
    """Height over a tilted floor = lowest support of the shape, far from the floor's origin."""
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    figure = free_bodies(SHAPES[shape])
    scene = wb.Scene(figure).add(wb.HalfSpace(tuple(normal), 0.25), name="floor", at=(0.0, 0.0, 0.0))
    q = figure.neutral
    q[:3] = 40.0 * np.array([0.9, 0.0, -0.3]) + normal * 0.25
    low = {
        "sphere": 0.12,
        "capsule": 0.06 + 0.15 * abs(normal[2]),
        "box": np.array([0.15, 0.1, 0.07]) @ np.abs(normal),
        "ellipsoid": np.linalg.norm(np.array([0.2, 0.12, 0.09]) * normal),
        "hull": -(SHAPES["hull"].points @ normal).min(),
    }[shape]
    height = q[:3] @ normal - 0.25 - low
    assert scene.contacts(q, 10.0).distance == pytest.approx([height], abs=1e-6)
    assert len(scene.contacts(q, height - 1e-4).distance) == 0


def test_moved_objects_are_seen(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball", at=(1.0, 0.0, 0.0))
    q = scene.figure.neutral
    assert scene.contacts(q, 5.0).distance == pytest.approx([0.7])
    built = scene.built
    scene.move("ball", at=(0.0, 3.0, 0.0))
    assert scene.built is built
    assert scene.contacts(q, 5.0).distance == pytest.approx([2.7])
    assert len(scene.contacts(q, 2.6).distance) == 0
    scene.move("ball", at=(0.0, 0.0, 0.25))
    assert scene.contacts(q, 0.0).distance == pytest.approx([-0.05])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_postures_that_are_no_numbers_are_refused(free_bodies, value):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball")
    for index in range(7):
        q = scene.figure.neutral
        q[index] = value
        with pytest.raises(wb.InputError, match=f"entry {index} is not finite"):
            scene.contacts(q)
    with pytest.raises(wb.InputError, match="within is "):
        scene.contacts(scene.figure.neutral, value)
    with pytest.raises(wb.InputError, match=r"has shape \(6,\); give \(7,\)"):
        scene.contacts(np.zeros(6))


@pytest.mark.parametrize("lost", [("result_view", "placement_view")])
def test_official_getters_stand_in_for_views(monkeypatch, lost):
    """On a build of Pinocchio that lays its memory out differently the numbers stay the same."""
    rng = np.random.default_rng(7)
    scene = among_things("capsules", rng)
    queries = [(random_posture(scene.figure, rng), within) for within in (0.05, 0.5, 0.05)]
    expected = [scene.contacts(q, within) for q, within in queries]
    for name in lost:
        monkeypatch.setattr(pair_distances, name, lambda results: None)
    slow = Proximity(scene.pair_table)
    for (q, within), wanted in zip(queries, expected, strict=True):
        found = slow.query(scene.state(q).data, within)
        slow.reset()
        for part, want in zip(found.nearest_first(), wanted, strict=True):
            assert np.array_equal(part, want)


@pytest.mark.parametrize("count", [1, 2, 7])
def test_views_show_what_pinocchio_computes_after_they_were_made(count):
    """Of results that nothing was computed of when the view was made; the guesses are where coal begins."""
    model, geometry, data = pin.Model(), pin.GeometryModel(), None
    for k in range(count + 1):
        place = pin.SE3(pin.exp3(np.full(3, 0.1 * k)), np.array([0.5 * k, 0.02 * k, 0.0]))
        geometry.addGeometryObject(pin.GeometryObject(f"box {k}", 0, place, coal.Box(0.1, 0.2, 0.3)))
    for k in range(count):
        geometry.addCollisionPair(pin.CollisionPair(k, k + 1))
    data = pin.GeometryData(geometry)
    placed, results, guesses = (
        view(part)
        for view, part in (
            (placement_view, data.oMg), (result_view, data.distanceResults), (guess_view, data.distanceRequests),
        )
    )  # fmt: skip
    assert all(view is not None for view in (placed, results, guesses))
    pin.updateGeometryPlacements(model, model.createData(), geometry, data)
    pin.computeDistances(geometry, data)
    for k, result in enumerate(data.distanceResults):
        assert np.array_equal(placed[k + 1], [*data.oMg[k + 1].rotation.T, data.oMg[k + 1].translation])
        read = [result.min_distance, *result.normal, *result.getNearestPoint1(), *result.getNearestPoint2()]
        assert np.array_equal(fields(results)[k], read)
        assert 0.2 < result.min_distance < 0.5
        assert np.array_equal(guesses[k, :3], data.distanceRequests[k].cached_gjk_guess)


def test_views_notice_another_layout():
    """The rows of a vector from its last to its first: single objects may lie one behind the other by chance."""
    model = pin.buildSampleModelManipulator()
    geometry = pin.buildSampleGeometryModelManipulator(model)
    geometry.addAllCollisionPairs()
    placements, data = model.createData().oMi, geometry.createData()
    for view, vector in (
        (placement_view, placements), (result_view, data.distanceResults), (guess_view, data.distanceRequests)
    ):  # fmt: skip
        assert len(vector) > 2
        assert view(vector) is not None
        assert view([vector[k] for k in range(len(vector))][::-1]) is None


def test_nothing_to_measure(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    assert all(len(part) == 0 for part in scene.contacts(scene.figure.neutral, 1.0)[:-1])


def test_shapes_without_exact_distance_are_refused():
    model, geometry = pin.Model(), pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("drum", 0, pin.SE3.Identity(), coal.Cylinder(0.1, 0.2)))
    with pytest.raises(wb.InputError, match="Cylinder is not a convex piece"):
        PairTable(model, geometry)


def test_boxes_of_long_walls_hide_nothing(free_bodies):
    """Turned bodies that nearly touch walls whose spheres hold the whole room: the same pairs as coal's."""
    rng, found_any = np.random.default_rng(6), 0
    shapes = [wb.Box((0.3, 0.2, 0.1)), wb.Capsule(0.05, 0.4), wb.Ellipsoid((0.2, 0.1, 0.1)), SHAPES["hull"]]
    scene = wb.Scene(free_bodies(*shapes))
    scene.add(wb.Box((10.0, 0.1, 3.0)), name="wall", at=(0.0, 0.3, 0.0))
    scene.add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.3))
    for _ in range(60):
        q = scene.figure.neutral
        for k in range(len(shapes)):
            q[7 * k : 7 * k + 3] = rng.uniform(-0.4, 0.2, 3)
            q[7 * k + 3 : 7 * k + 7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
        expected = asked_one_by_one(scene, q)
        for within in (0.1, 0.0, -0.02):
            found = {tuple(pair) for pair in scene.contacts(q, within).pair.tolist()}
            found_any += len(found)
            assert {pair for pair, row in expected.items() if row[0] < within - 5e-6} <= found
    assert found_any > 300


@pytest.mark.parametrize("step", [3e-4, 0.02])
def test_pairs_that_cannot_have_come_near_are_not_asked_and_none_is_missed(step):
    """A walk in steps of any length among things that move too: the same pairs as coal finds among all."""
    rng = np.random.default_rng(21)
    scene = among_things("capsules", rng)
    workspace = scene.workspace()
    q, asked, found_any = scene.figure.posture("standing"), [], 0
    for k in range(12):
        q = scene.figure.clamp(pin.integrate(scene.model, q, step * rng.normal(size=scene.model.nv)))
        if k % 5 == 4:
            scene.move(
                "thing1", at=(*rng.uniform(-0.5, 0.5, 3), *pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs())
            )
        workspace.refresh()
        before = workspace.proximity.asked
        found = workspace.near(q, 0.04)
        asked.append(workspace.proximity.asked - before)
        assert sum(workspace.proximity.results.activeCollisionPairs) == asked[-1]  # and coal is asked for no other
        wanted = {pair: row[0] for pair, row in asked_one_by_one(scene, q).items() if row[0] < 0.04}
        assert {pair for pair, distance in wanted.items() if distance < 0.04 - 1e-5} <= {
            *map(tuple, found.pair.tolist())
        }
        np.testing.assert_allclose(
            found.distance, [wanted[pair] for pair in map(tuple, found.pair.tolist())], atol=3e-6
        )
        found_any += len(found.distance)
    assert found_any > 20
    if step == 3e-4:
        assert np.mean(asked[1:4]) < 0.95 * asked[0]  # what is far away was not asked again


class Interrupted:
    """The compiled loops, with a Ctrl-C after the pairs are marked and before Pinocchio is told of them."""

    def __init__(self, kernel):
        self._kernel = kernel

    def __getattr__(self, name):
        return getattr(self._kernel, name)

    def look(self, *arguments):
        self._kernel.look(*arguments)
        raise KeyboardInterrupt


def test_a_query_that_is_interrupted_hides_no_pair(monkeypatch):
    """Pairs are told by what comes and goes: what was not told before Ctrl-C is told after it."""
    rng = np.random.default_rng(5)
    scene = among_things("capsules", rng)
    workspace, found_any = scene.workspace(), 0
    for _ in range(8):
        q = random_posture(scene.figure, rng)
        with monkeypatch.context() as patch:
            patch.setattr(workspace.proximity, "_kernel", Interrupted(workspace.proximity._kernel))
            with pytest.raises(KeyboardInterrupt):
                workspace.near(q, 0.04)
        found, wanted = workspace.near(q, 0.04), asked_one_by_one(scene, q)
        pairs = [*map(tuple, found.pair.tolist())]
        assert {pair for pair, row in wanted.items() if row[0] < 0.04 - 1e-5} <= {*pairs}
        np.testing.assert_allclose(found.distance, [wanted[pair][0] for pair in pairs], atol=3e-6)
        found_any += len(pairs)
    assert found_any > 20

"""How deep objects are in each other, and how they get out, by hand and by brute force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from wholebody import InputError
from wholebody.base.arrays import Array
from wholebody.geometry.pair_distances import SinglePairs
from wholebody.geometry.penetration import ObjectPenetration, global_depth, object_penetrations, way_out
from wholebody.geometry.proximity import Contacts
from wholebody.geometry.shapes import Box, Capsule, HalfSpace, Hull, Shape, Sphere

Placed = tuple[Shape, tuple[float, float, float]]


class Two:
    """Two objects of pieces at places, and all pairs of a piece of each."""

    def __init__(self, first: Sequence[Placed], second: Sequence[Placed], turned: Array | None = None) -> None:
        turn = np.eye(3) if turned is None else turned
        self.geometry, own = pin.GeometryModel(), list[str]()
        for name, things in (("a", first), ("b", second)):
            for shape, at in things:
                for piece in shape.pieces():
                    place = pin.SE3(turn, turn @ np.array(at)) * piece.placement
                    made = pin.GeometryObject(f"{name}{len(own)}", 0, place, piece.geometry)
                    self.geometry.addGeometryObject(made)
                    own.append(name)
        self.owners = tuple(own)
        self.of_a, of_b = (np.flatnonzero(np.array(own) == name) for name in "ab")
        self.pairs = np.array([(i, j) for i in self.of_a for j in of_b])
        places = [piece.placement for piece in self.geometry.geometryObjects]
        self.placements = np.array([[*at.rotation.T, at.translation] for at in places])

    def found(self) -> list[ObjectPenetration]:
        rows = SinglePairs(self.geometry).measured(self.placements, self.pairs)
        parts = (np.ascontiguousarray(part) for part in np.split(rows, (1, 4, 7), axis=1))
        distance, normal, point_a, point_b = parts
        number = np.arange(len(rows))
        near = Contacts(self.pairs, distance[:, 0], normal, point_a, point_b, number, self.placements)
        return object_penetrations(near, self.owners)

    def deepest(self, way: Array) -> float:
        """Depth of the deepest pair with the first object moved."""
        there = self.placements.copy()
        there[self.of_a, 3] += way
        return -float(SinglePairs(self.geometry).measured(there, self.pairs)[:, 0].min())

    def out(self, normal: Array | tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Array | None:
        return way_out(self.geometry, self.placements, self.pairs, self.of_a, np.array(normal))


def test_two_boxes() -> None:
    (found,) = Two([(Box((1, 1, 1)), (0, 0, 0.9))], [(Box((1, 1, 1)), (0, 0, 0))]).found()
    assert (found.a, found.b, found.pairs) == ("a", "b", 1)
    assert np.allclose(found.global_depth, [0, 0, 0.1], atol=1e-6)
    assert found.deepest == pytest.approx(0.1, abs=1e-6)


def test_a_corner_by_hand() -> None:
    # A cube 0.1 deep in a floor and 0.2 deep in a wall: PD_g = (0.1^2 z + 0.2^2 x) / 0.3.
    corner = [(Box((4, 4, 1)), (0, 0, -0.5)), (Box((1, 4, 4)), (-0.5, 0, 0))]
    (found,) = Two([(Box((1, 1, 1)), (0.3, 0, 0.4))], corner).found()
    assert found.pairs == 2
    assert np.allclose(found.global_depth, [0.04 / 0.3, 0, 0.01 / 0.3], atol=1e-6)
    assert found.deepest == pytest.approx(0.2, abs=1e-6)


def test_opposed_normals_cancel_but_the_way_out_is_found() -> None:
    # Figure 4b: a bar between two walls, 0.05 deep in both. The estimate vanishes; the bar leaves along z, however all
    # of it is turned.
    walls = [(Box((0.2, 2, 1)), (-0.55, 0, 0)), (Box((0.2, 2, 1)), (0.55, 0, 0))]
    for seed in range(4):
        turned = Rotation.random(random_state=seed).as_matrix() if seed else np.eye(3)
        two = Two([(Box((1.0, 0.3, 0.5)), (0, 0, 0))], walls, turned)
        (found,) = two.found()
        assert np.linalg.norm(found.global_depth) < 1e-6
        way = two.out(turned[:, 0])
        assert way is not None
        assert two.deepest(way) < 3e-6
        assert 0.75 - 1e-5 <= np.linalg.norm(way) < (0.76 if not seed else 0.85)


def test_nothing_leads_out_of_a_slot_without_an_end() -> None:
    slot = Two([(Sphere(0.2), (0, 0, 0.05))], [(HalfSpace(), (0, 0, 0)), (HalfSpace((0, 0, -1), -0.1), (0, 0, 0))])
    assert slot.out() is None
    assert np.isfinite(slot.found()[0].global_depth).all()


def test_global_depth_is_equation_1() -> None:
    rng = np.random.default_rng(5)
    depths, normals = rng.uniform(0, 1, 7), rng.normal(size=(7, 3))
    summed = sum(d * d * n for d, n in zip(depths, normals, strict=True)) / sum(depths)
    assert np.allclose(global_depth(depths, normals), summed)
    assert np.array_equal(global_depth(np.zeros(0), np.zeros((0, 3))), np.zeros(3))
    for bad in (([-1.0], [[0, 0, 1]]), ([np.nan], [[0, 0, 1]]), ([1.0], [[0, 0]]), ([1.0, 2.0], [[0, 0, 1]])):
        with pytest.raises(InputError):
            global_depth(*map(np.array, bad))


@pytest.mark.parametrize("seed", range(6))
def test_no_way_along_random_directions_is_a_quarter_shorter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [Sphere(0.1), Capsule(0.05, 0.2), Box((0.2, 0.1, 0.3)), Hull(0.1 * rng.normal(size=(8, 3)))]
    heaps = [[(shapes[rng.integers(4)], tuple(rng.normal(size=3) * 0.05)) for _ in range(3)] for _ in range(2)]
    two = Two(heaps[0], heaps[1])
    way = two.out()
    assert way is not None
    assert two.deepest(np.zeros(3)) > 1e-3
    assert two.deepest(way) < 3e-6
    best, length = np.inf, float(np.linalg.norm(way))
    directions = np.vstack([rng.normal(size=(150, 3)), way + 0.1 * length * rng.normal(size=(50, 3))])
    for direction in directions / np.linalg.norm(directions, axis=1)[:, None]:
        gone = 0.0
        while gone < best:
            depth = two.deepest(gone * direction)
            best = gone if depth <= 1e-6 else best
            gone += max(depth, 1e-3)
    assert length < 1.25 * best + 1e-3


def test_owners_of_pairs_in_any_order() -> None:
    geometry, owners = pin.GeometryModel(), ("table", "table", "box", "ball")
    things: list[Placed] = [(Box((2, 2, 0.1)), (0, 0, 0)), (Box((0.1, 0.1, 1)), (0, 0, -0.5))]
    things += [(Box((0.4, 0.4, 0.4)), (0, 0, 0.22)), (Sphere(0.1), (0.8, 0, 0.05))]
    for k, (shape, at) in enumerate(things):
        geometry.addGeometryObject(
            pin.GeometryObject(f"p{k}", 0, pin.SE3(np.eye(3), np.array(at)), shape.pieces()[0].geometry)
        )
    pairs = np.array([[2, 0], [1, 2], [0, 3], [1, 3], [2, 3]])
    places = [piece.placement for piece in geometry.geometryObjects]
    placements = np.array([[*at.rotation.T, at.translation] for at in places])
    found = SinglePairs(geometry).measured(placements, pairs)
    near = Contacts(pairs, found[:, 0], found[:, 1:4], found[:, 4:7], found[:, 7:], np.arange(5), placements)
    told = object_penetrations(near, owners)
    assert [(one.a, one.b) for one in told] == [("table", "ball"), ("table", "box")]
    assert np.allclose(told[0].global_depth, [0, 0, -0.1], atol=1e-5)
    assert np.allclose(told[1].global_depth, [0, 0, -0.03], atol=1e-5)

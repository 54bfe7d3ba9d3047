"""A surface cut between segments: nothing opens, nothing is lost, and the borders are where both sides count alike."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from wholebody.figures.surface.making import Bound, divided, strongest

SIDE = 9


def sheet(segments: int, seed: int) -> tuple[Bound, NDArray[np.int64]]:
    """A square of triangles, and influences that change smoothly over it."""
    steps = range(SIDE)
    places = np.array([(x, y, 0.0) for x, y in itertools.product(steps, steps)]) / (SIDE - 1)
    corner = np.array([x * SIDE + y for x, y in itertools.product(steps[:-1], steps[:-1])])
    faces = np.concatenate([corner[:, None] + (0, SIDE, SIDE + 1), corner[:, None] + (0, SIDE + 1, 1)])
    middles = np.random.default_rng(seed).uniform(0.0, 1.0, (segments, 2))
    weights = np.exp(-4.0 * ((places[:, None, :2] - middles) ** 2).sum(axis=-1))
    weights /= weights.sum(axis=1, keepdims=True)
    return Bound(places, np.tile((0.0, 0.0, 1.0), (len(places), 1)), weights, weights), faces


def areas(bound: Bound, faces: NDArray[np.int64]) -> NDArray[np.float64]:
    first, second, third = np.moveaxis(bound.vertices[faces], 1, 0)
    return np.asarray(np.cross(second - first, third - first)[:, 2] / 2.0)


@pytest.mark.parametrize(("segments", "seed"), [(2, 0), (3, 1), (4, 2), (6, 3)])
def test_a_cut_sheet_is_the_same_sheet(segments: int, seed: int) -> None:
    bound, faces = sheet(segments, seed)
    cut, made, owner = divided(bound, faces)
    assert len(made) == len(owner) > len(faces)
    assert (areas(cut, made) > 0.0).all()  # wound as before
    assert areas(cut, made).sum() == pytest.approx(1.0)
    np.testing.assert_allclose(cut.normals, np.tile((0.0, 0.0, 1.0), (len(cut.normals), 1)))
    edges = [(a, b) for face in made.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)]
    assert len(set(edges)) == len(edges)
    alone = [edge for edge in edges if edge[::-1] not in set(edges)]
    rim = cut.vertices[np.array(alone)]
    assert (
        np.isin(rim[..., 0], (0.0, 1.0)).all(axis=1) | np.isin(rim[..., 1], (0.0, 1.0)).all(axis=1)
    ).all()  # no crack


@pytest.mark.parametrize(("segments", "seed"), [(2, 0), (4, 2)])
def test_borders_are_where_two_segments_count_alike(segments: int, seed: int) -> None:
    bound, faces = sheet(segments, seed)
    cut, made, owner = divided(bound, faces)
    count = 0
    for a, b in itertools.combinations(range(segments), 2):
        between = np.intersect1d(made[owner == a], made[owner == b])
        two = [k for k in between if np.sort(cut.strength[k])[-2:].sum() > 0.99 or segments == 2]
        for k in two:
            assert cut.strength[k, a] == pytest.approx(cut.strength[k, b], abs=0.05)
            count += 1
    assert count > 5 or segments > 2
    bones, weights = strongest(cut.weights)
    assert bones.shape == (len(cut.vertices), min(4, segments))
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


def test_what_one_segment_moves_stays_as_it_is() -> None:
    bound, faces = sheet(2, 0)
    one = bound._replace(strength=np.tile((0.7, 0.3), (len(bound.vertices), 1)))
    same, made, owner = divided(one, faces)
    assert len(same.vertices) == len(one.vertices)
    np.testing.assert_array_equal(made, faces)
    assert not owner.any()

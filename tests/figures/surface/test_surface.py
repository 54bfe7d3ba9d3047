"""The body's surface: closed, near the pieces, moved as the segments move, and kept on disk."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wholebody.figures import load
from wholebody.figures import surface as surfaces
from wholebody.figures.anthropometry import design_cases
from wholebody.figures.surface import Bone, Surface, making, surface_of
from wholebody.figures.surface.garments import halfway
from wholebody.figures.surface.making import Part, person_parts
from wholebody.figures.surface.person_shape import PersonShape
from wholebody.geometry.mesh_cache import VARIABLE, cache_state

FINE_SURFACES = True

PEOPLE: dict[str, dict[str, Any]] = {
    "heavy man": {"sex": "male", "stature": 1.87, "mass": 125.0},
}

NEAR = 0.025
"""Metres: no piece comes farther out of the surface than this; hands, feet and head are shaped on their own."""

SHARE = 0.05
"""Share of the pieces' points that come out by more than 3 mm, at most."""


@cache
def parts_of(who: str) -> tuple[Any, list[Bone], list[Part]]:
    """One of `PEOPLE`, its bones, and the closed parts of its surface."""
    figure = load("human", **PEOPLE[who])
    bones, parts = person_parts(figure.describe().person)
    return figure, list(bones.values()), parts


def bent(figure: Any, bones: Sequence[Bone], parts: Iterable[tuple[Any, Any]], q: Any) -> list[Any]:
    """Vertices (n, 3) with weights (n, b) at a posture, by linear blend skinning as the page does it."""
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    moved = []
    for bone in bones:
        if bone.segment in figure.segments:
            place = data.oMf[figure.frame_id(bone.segment)].homogeneous
        else:
            place = data.oMf[figure.frame_id(bone.instead)].homogeneous @ bone.rest
        if bone.parent is not None:
            place = halfway(data.oMf[figure.frame_id(bone.parent)].homogeneous, place, bone)
        moved.append(place @ np.linalg.inv(bone.bind))
    found = []
    for vertices, weights in parts:
        blend = np.einsum("nb,bij->nij", weights, moved)
        found.append(np.einsum("nij,nj->ni", blend, np.column_stack([vertices, np.ones(len(vertices))]))[:, :3])
    return found


def patches_of(figure: Any) -> tuple[list[Bone], list[tuple[Any, Any]], Any]:
    """Bones, vertices and weights of each patch, and the surface."""
    surface = surface_of(figure)
    assert surface is not None
    parts = []
    for patch in surface.patches:
        weights = np.zeros((len(patch.vertices), len(surface.bones)))
        np.put_along_axis(weights, patch.bones.astype(np.intp), patch.weights, axis=1)
        parts.append((patch.vertices, weights))
    return list(surface.bones), parts, surface


def is_closed(faces: Any) -> bool:
    """Whether every directed edge is there as often as its reverse."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(faces.max()) + 1
    forth = np.sort(edges[:, 0] * size + edges[:, 1])
    back = np.sort(edges[:, 1] * size + edges[:, 0])
    return bool((forth == back).all())


def sample(piece: Any, count: int = 60) -> Any:
    """Points on a capsule's, sphere's or box's surface, in its own frame."""
    directions = np.random.default_rng(0).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shape = piece.geometry
    kind = type(shape).__name__
    if kind == "Box":
        return directions / np.abs(directions / np.asarray(shape.halfSide)).max(axis=1, keepdims=True)
    points = float(shape.radius) * directions
    if kind == "Capsule":
        points[:, 2] += np.linspace(-1.0, 1.0, count) * float(shape.halfLength)
    return points


@pytest.mark.parametrize("who", PEOPLE)
def test_every_part_is_closed_and_weights_add_up(who: str) -> None:
    _, _, parts = parts_of(who)
    assert {part.name for part in parts} >= {"shirt", "trousers", "head", "hair", "left_hand", "right_shoe"}
    for part in parts:
        assert is_closed(part.surface.faces), part.name
        assert part.surface.faces.max() == len(part.surface.vertices) - 1
        np.testing.assert_allclose(part.weights.sum(axis=1), 1.0, atol=1e-5)
        assert ((part.weights > 0.0).sum(axis=1) <= 4).all()
        np.testing.assert_allclose(np.linalg.norm(part.surface.normals, axis=1), 1.0, atol=1e-3)
        assert np.isfinite(part.surface.vertices).all()


@pytest.mark.parametrize("who", PEOPLE)
def test_the_pieces_are_near_the_surface(who: str) -> None:
    from scipy.spatial import cKDTree

    figure, bones, parts = parts_of(who)
    q = figure.posture("a_pose")
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, q)
    moved = bent(figure, bones, [(part.surface.vertices, part.weights) for part in parts], q)
    trees = [cKDTree(points) for points in moved]
    out = []
    for piece in figure.geometry.geometryObjects:
        if any(part in piece.name for part in ("hand", "head", "foot", "toes", "thumb", "finger")):
            continue
        place = data.oMi[piece.parentJoint] * piece.placement
        places = sample(piece) @ place.rotation.T + place.translation
        heights, distances = [], []
        for part, points, tree in zip(parts, moved, trees, strict=True):
            distance, nearest = tree.query(places)
            distances.append(distance)
            heights.append(np.einsum("ij,ij->i", places - points[nearest], part.surface.normals[nearest]))
        outside = np.min(heights, axis=0) > 0.0  # a point deep inside may be taken for one outside, so look closer
        for part, points in zip(parts, moved, strict=True):
            if part.name in ("shirt", "trousers", "head"):
                outside[outside] = turns(places[outside], points[part.surface.faces]) < 0.5
        out.append(np.where(outside, np.min(distances, axis=0), 0.0))
    above = np.concatenate(out)
    assert above.max() < NEAR
    assert np.mean(above > 0.003) < SHARE


def turns(points: Any, corners: Any) -> Any:
    """Winding numbers (n,) of a closed surface of triangles (m, 3, 3) around points: 1 inside, 0 outside.

    By the solid angles of its triangles (van Oosterom & Strackee, IEEE Trans. Biomed. Eng. 30(2), 1983).
    """
    found = np.empty(len(points))
    for number, point in enumerate(points):
        a, b, c = np.moveaxis(corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a)))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        found[number] = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (2.0 * np.pi)
    return found


def volume(corners: Any) -> float:
    """Of a closed surface, by Gauss, from the corners (n, 9) of its triangles."""
    a, b, c = np.moveaxis(corners.reshape(-1, 3, 3) - corners.reshape(-1, 3).mean(axis=0), 1, 0)
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)


def test_the_patches_cover_every_part_once(monkeypatch: pytest.MonkeyPatch) -> None:
    figure, bones, parts = parts_of("heavy man")
    monkeypatch.setattr(making, "person_parts", lambda person: (dict(enumerate(bones)), parts))
    patches = making.person_surface(figure.describe().person).patches
    assert len({patch.name for patch in patches}) == len(patches)
    for part in parts:
        own = [patch for patch in patches if patch.name.startswith(f"{part.name}:")]
        corners = np.concatenate([patch.vertices[patch.faces].reshape(-1, 9) for patch in own])
        whole = part.surface.vertices[part.surface.faces].reshape(-1, 9)
        assert len(whole) <= len(corners) < 1.7 * len(whole)  # some are cut at a border
        whole = whole.astype(np.float32).astype(float)
        uncut = {face.tobytes() for face in whole} & {face.tobytes() for face in corners}
        assert len(uncut) > 0.6 * len(whole), part.name
        assert volume(corners) == pytest.approx(volume(whole), rel=1e-6), part.name
        _, numbers = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        assert is_closed(numbers.reshape(-1, 3)), part.name
        few = np.concatenate([patch.vertices[patch.coarse].reshape(-1, 9) for patch in own])
        assert 0 < len(few) < 0.7 * len(corners)
        places, numbers = np.unique(few.reshape(-1, 3), axis=0, return_inverse=True)
        assert is_closed(numbers.reshape(-1, 3)), part.name  # neighbours meet without a gap
        assert len(places) > 3
        assert volume(few) == pytest.approx(volume(corners), rel=0.1, abs=1e-6), part.name  # brows are thin
    assert max(len(patch.vertices) for patch in patches) < 2**16
    assert {patch.segment for patch in patches} >= {"head", "thorax", "pelvis", "left_thigh", "right_forearm"}


@pytest.mark.parametrize("name", ["human", "avatar"])
def test_what_is_far_from_a_joint_moves_with_its_segment(name: str) -> None:
    figure = load(name)
    bones, parts, _ = patches_of(figure)
    q = figure.with_joints(figure.posture("standing"), {"left_elbow_flexion": 1.5, "right_knee_flexion": 1.2})
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    names, count = [bone.segment for bone in bones], 0
    for (vertices, weights), moved in zip(parts, bent(figure, bones, parts, q), strict=True):
        for segment in ("left_forearm", "right_shank", "head"):
            number = names.index(segment)
            chosen = weights[:, number] > 0.999
            placement = data.oMf[figure.frame_id(segment)].homogeneous @ np.linalg.inv(bones[number].bind)
            expected = vertices[chosen] @ placement[:3, :3].T + placement[:3, 3]
            np.testing.assert_allclose(moved[chosen], expected, atol=2e-3)
            count += chosen.sum()
    assert count > 1000


@pytest.mark.parametrize("sex", ["female", "male"])
def test_below_a_raised_shoulder_the_flank_is_nearly_as_wide(sex: str) -> None:
    figure = load("human", sex=sex, percentile=50)
    bones, parts, surface = patches_of(figure)
    q = figure.posture("hands_up")
    moved = zip(surface.patches, bent(figure, bones, parts, q), strict=True)
    points = np.concatenate([vertices for patch, vertices in moved if "hand" not in patch.name])
    shoulder = figure.placement(q, "left_upper_arm").translation
    edges = shoulder[2] + np.array([-0.08, -0.06, 0.02, 0.04])
    heights = np.digitize(points[:, 2], edges)
    below, shoulders = (points[heights == band, 1].max() for band in (1, 3))
    assert below > 0.85 * shoulders  # 0.72 where the shoulder hangs over the chest


def test_the_index_finger_ends_where_the_frame_is() -> None:
    figure = load("human")
    bones, parts, surface = patches_of(figure)
    q = figure.posture("t_pose")
    moved = bent(figure, bones, parts, q)
    for side in ("left", "right"):
        hand = [places for places, patch in zip(moved, surface.patches, strict=True) if f"{side}_hand:" in patch.name]
        frame = figure.placement(q, f"{side}_index_tip")
        local = (np.concatenate(hand) - frame.translation) @ frame.rotation
        finger = np.hypot(local[:, 1], local[:, 2]) < 0.008
        assert local[finger, 0].max() == pytest.approx(0.0, abs=0.002)


def test_a_hand_has_a_surface_and_other_figures_have_none() -> None:
    hand = load("hand")
    bones, parts, _ = patches_of(hand)
    moved = np.concatenate(bent(hand, bones, parts, hand.neutral))
    for name in hand.frames:
        if name.endswith("_tip"):
            tip = hand.placement(hand.neutral, name).translation
            assert np.linalg.norm(moved - tip, axis=1).min() < 0.004
    assert surface_of(None) is None
    assert surface_of(load("human").reduced("left_arm")) is not None


def test_what_is_kept_equals_what_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    hand = load("hand", side="left")

    def kept() -> Surface:
        surfaces._kept.cache_clear()
        found = surface_of(hand)
        assert found is not None
        return found

    first = kept()
    assert cache_state().entries == 1
    with monkeypatch.context() as patch:
        patch.setattr(making, "hand_surface", None)  # it is not made again
        second = kept()
    made = making.hand_surface(hand.describe().person, "left")
    for one, other, third in zip(first.patches, second.patches, made.patches, strict=True):
        assert one[:3] == other[:3] == third[:3]
        for mine, theirs, new in zip(one[3:], other[3:], third[3:], strict=True):
            np.testing.assert_array_equal(mine, theirs)
            np.testing.assert_allclose(mine, new, rtol=0.0, atol=1e-7)  # kept in single precision
    assert [bone.segment for bone in first.bones] == [bone.segment for bone in second.bones]
    surfaces._kept.cache_clear()


@pytest.mark.parametrize("who", PEOPLE)
def test_the_shirt_ends_in_one_level_line_and_covers_the_belt(who: str) -> None:
    parts = {part.name: part.surface for part in parts_of(who)[2]}
    shirt, trousers = parts["shirt"], parts["trousers"]
    top = float(trousers.vertices[:, 2].max())
    trunk = (np.abs(shirt.vertices[:, 1]) < 0.25) & (shirt.vertices[:, 2] < top)
    hem = float(shirt.vertices[trunk, 2].min())
    assert 0.015 < top - hem < 0.03
    # Around the trunk the lowest vertex that points outward is at the hem, in every direction.
    outward = np.hypot(shirt.normals[:, 0], shirt.normals[:, 1]) > 0.7
    middle = shirt.vertices[trunk].mean(axis=0)
    angle = np.degrees(np.arctan2(*(shirt.vertices - middle)[:, 1::-1].T)) // 15
    lowest = [shirt.vertices[trunk & outward & (angle == sector), 2].min() for sector in range(-12, 12)]
    np.testing.assert_allclose(lowest, hem, atol=5e-4)
    under = trousers.vertices[trousers.vertices[:, 2] > hem + 0.002]
    assert turns(under, shirt.vertices[shirt.faces]).min() > 0.5


@pytest.mark.parametrize("case", ["F5"])
def test_the_drawn_neck_has_the_girth_that_was_measured(case: str) -> None:
    """Of people of that stature and mass (ANSUR II), although the piece within is thinner."""
    person = design_cases()[case]
    shape = PersonShape(person)
    (head,) = (garment for garment in shape.garments() if garment.name == "head")
    low, high = shape.at("neck"), shape.at("head")
    turn = np.linspace(0.0, 2.0 * np.pi, 91)[:-1]
    around = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
    radii = np.linspace(0.03, 0.12, 181)  # half a millimetre apart
    girths = []
    for share in np.linspace(0.2, 0.9, 5):
        rays = low + share * (high - low) + radii[:, None, None] * around
        inside = head.field(rays.reshape(-1, 3)).reshape(rays.shape[:2]) < 0.0
        ends = radii[inside.sum(axis=0) - 1, None] * around
        girths.append(np.linalg.norm(ends - np.roll(ends, 1, axis=0), axis=1).sum())
    assert min(girths) == pytest.approx(2.0 * np.pi * person.radius("neck"), abs=0.005)

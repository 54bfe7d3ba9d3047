"""Things come, move, are carried and go; names are checked, pairs are all there."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb


@pytest.fixture
def scene():
    return wb.Scene(wb.load("human"))


def pairs_of(scene):
    owner = scene.piece_owner
    return {frozenset((owner[pair.first], owner[pair.second])) for pair in scene.geometry.collisionPairs}


def test_figure_alone(scene):
    assert scene.model is scene.figure.model
    assert scene.geometry.ngeoms == scene.figure.geometry.ngeoms == len(scene.piece_names)
    assert len(scene.geometry.collisionPairs) == len(scene.figure.geometry.collisionPairs)
    assert dict(scene.objects) == {}


def test_every_piece_of_the_figure_meets_every_thing(scene):
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.8, 0.0, 0.7)).add(wb.Sphere(0.1), name="ball", at=(1, 1, 1))
    before = len(scene.figure.geometry.collisionPairs)
    body = scene.figure.geometry.ngeoms
    assert len(scene.geometry.collisionPairs) == before + 2 * body
    assert frozenset(("table", "ball")) not in pairs_of(scene)  # neither moves
    assert scene.piece_owner[-2:] == ("table", "ball")
    assert set(scene.piece_owner[:-2]) <= set(scene.figure.segments)


def test_things_stand_where_they_are_put(scene):
    turn = pin.Quaternion(pin.exp3(np.array([0.1, 0.2, 0.3])))
    place = pin.SE3(turn, np.array([1.0, 2.0, 3.0]))
    for k, at in enumerate([place, place.homogeneous, (1.0, 2.0, 3.0, *turn.coeffs())]):
        scene.add(wb.Sphere(0.1), name=f"ball{k}", at=at)
    for piece in list(scene.geometry.geometryObjects)[-3:]:
        assert piece.placement.homogeneous == pytest.approx(place.homogeneous)
        assert piece.parentJoint == 0


def test_what_is_carried_moves_with_its_segment_and_meets_all_else(scene):
    offset = pin.SE3(pin.exp3(np.array([0.0, 0.4, 0.0])), np.array([0.3, 0.1, -0.2]))
    scene.attach(wb.Box((0.1, 0.1, 0.1)), to="right_hand", name="tool", at=offset)
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 1.0))
    q = scene.figure.posture("t_pose")
    state = scene.state(q)
    index = scene.piece_names.index("tool:0")
    expected = state.frame(scene.frame_id("right_hand")) * offset
    placed = scene.contacts(q).placements[index]
    assert pytest.approx(expected.homogeneous[:3], abs=1e-12) == np.vstack([placed[:3], placed[3]]).T
    pairs = pairs_of(scene)
    assert frozenset(("tool", "ball")) in pairs
    assert frozenset(("tool", "thorax")) in pairs or ("thorax", "tool") in scene.excluded_pairs
    assert frozenset(("tool", "right_hand")) not in pairs


def test_what_leans_on_a_segment_at_rest_is_not_tested_against_it_and_said_so(scene):
    scene.attach(wb.Box((0.15, 0.3, 0.4)), to="thorax", name="pack", at=(-0.15, 0.0, 0.0))
    scene.attach(wb.Sphere(0.02), to="right_forearm", name="watch", at=(0.0, 0.0, 0.6))
    excluded = scene.excluded_pairs
    assert excluded
    rest = wb.Scene(scene.figure).figure.posture("standing")
    named = {frozenset(pair) for pair in excluded}
    assert not named & pairs_of(scene)
    assert all("standing" in reason for reason in excluded.values())
    assert all({"pack", "watch"} & pair for pair in named)
    found = scene.contacts(rest, 0.0)
    owner = scene.piece_owner
    assert not [pair for pair in found.pair if {"pack", "watch"} & {owner[i] for i in pair}]


def test_a_carried_half_space_meets_everything_but_another_half_space(human: wb.Figure) -> None:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor").add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 1.0))
    scene.attach(wb.HalfSpace(), name="sole", to="left_foot", at=(0.0, 0.0, -0.3))
    assert "no end" in scene.excluded_pairs["sole", "floor"]
    owners = scene.piece_owner
    pairs = {frozenset((owners[pair.first], owners[pair.second])) for pair in scene.geometry.collisionPairs}
    assert frozenset(("sole", "ball")) in pairs
    assert frozenset(("sole", "floor")) not in pairs


def test_moving_keeps_the_geometry_and_the_revision(scene):
    scene.add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(1.0, 0.0, 1.0))
    scene.attach(wb.Sphere(0.05), to="right_hand", name="ball", at=(0.2, 0.0, 0.0))
    geometry, revision = scene.geometry, scene.revision
    scene.move("box", at=(0.0, 2.0, 1.0)).move("ball", at=(0.0, 0.3, 0.0))
    assert scene.geometry is geometry
    assert scene.revision == revision
    assert scene.objects["box"].placement.translation == pytest.approx([0.0, 2.0, 1.0])
    fresh = wb.Scene(scene.figure).add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(0.0, 2.0, 1.0))
    fresh.attach(wb.Sphere(0.05), to="right_hand", name="ball", at=(0.0, 0.3, 0.0))
    q = scene.figure.posture("sitting")
    mine, theirs = scene.contacts(q, 3.0), fresh.contacts(q, 3.0)
    kept = {frozenset(pair) for pair in mine.pair.tolist()} & {frozenset(pair) for pair in theirs.pair.tolist()}
    table = {frozenset(pair.tolist()): d for pair, d in zip(theirs.pair, theirs.distance, strict=True)}
    for pair, distance in zip(mine.pair, mine.distance, strict=True):
        if frozenset(pair.tolist()) in kept:
            assert distance == pytest.approx(table[frozenset(pair.tolist())], abs=3e-6)


def test_a_thing_of_several_pieces_moves_as_one(scene):
    boxes = [
        np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.1 + shift for shift in (0.0, 0.5)
    ]
    faces = np.array(
        [
            (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
            (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
        ]
    )  # fmt: skip
    mesh = wb.Mesh((np.vstack(boxes), np.vstack([faces, faces + 8])))
    scene.add(mesh, name="pair", at=(1.0, 0.0, 0.0))
    before = [piece.placement.translation.copy() for piece in list(scene.geometry.geometryObjects)[-2:]]
    scene.move("pair", at=(1.0, 0.5, 0.25))
    after = [piece.placement.translation for piece in list(scene.geometry.geometryObjects)[-2:]]
    assert scene.piece_owner[-2:] == ("pair", "pair")
    for one, other in zip(before, after, strict=True):
        assert other - one == pytest.approx([0.0, 0.5, 0.25])


def test_removing_takes_the_pairs_with_it(scene):
    before = len(scene.geometry.collisionPairs)
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 1.0))
    revision = scene.revision
    scene.remove("ball")
    assert scene.revision > revision
    assert len(scene.geometry.collisionPairs) == before
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 1.0))


def test_mistakes_are_answered_before_anything_changes(scene):
    scene.add(wb.Sphere(0.1), name="table", at=(1.0, 0.0, 1.0))
    revision = scene.revision
    with pytest.raises(wb.InputError, match="already has 'table'"):
        scene.add(wb.Sphere(0.1), name="table")
    with pytest.raises(wb.InputError, match="already has 'thorax'"):
        scene.add(wb.Sphere(0.1), name="thorax")
    with pytest.raises(wb.InputError, match="the name of an object is ''; give a line of text"):
        scene.add(wb.Sphere(0.1), name="")
    with pytest.raises(wb.InputError):
        scene.add(wb.Sphere(0.1), name="ball", at=(1.0, np.nan, 0.0))
    with pytest.raises(wb.InputError):
        scene.move("table", at=(1.0, 0.0))
    with pytest.raises(wb.UnknownNameError, match="did you mean table"):
        scene.move("tabel", at=(1.0, 0.0, 0.0))
    with pytest.raises(wb.UnknownNameError, match="did you mean table"):
        scene.remove("tables")
    with pytest.raises(wb.UnknownNameError, match="right_hand"):
        scene.attach(wb.Sphere(0.1), to="rigth_hand", name="ball")
    assert (scene.revision, list(scene.objects)) == (revision, ["table"])


def test_what_is_no_shape_is_refused_when_it_is_added(scene):
    with pytest.raises(wb.InputError):
        scene.add("box", name="thing")


def test_objects_cannot_be_changed_behind_the_scenes_back(scene):
    with pytest.raises(TypeError):
        scene.objects["ball"] = 1
    with pytest.raises(TypeError):
        scene.excluded_pairs["a", "b"] = "because"


@pytest.mark.parametrize("wrong", ["no color", (1, 0), (1, 0, 0, 0, 0), (2, 0, 0), (np.nan, 0, 0), 3, object(), {}])
def test_colors_are_checked_when_they_are_given(scene, wrong):
    with pytest.raises(wb.InputError, match=r"'ball': color is .*each from 0 to 1"):
        scene.add(wb.Sphere(0.1), name="ball", color=wrong)
    with pytest.raises(wb.InputError, match="'ball': color is"):
        scene.attach(wb.Sphere(0.1), to="head", name="ball", color=wrong)
    scene.add(wb.Sphere(0.1), name="ball", at=(1, 1, 1), color=(1, 0, 0))
    assert scene.objects["ball"].color == (1.0, 0.0, 0.0, 1.0)


def test_what_was_used_last_is_kept_of_what_follows_from_a_scene(scene):
    built = scene.built
    first = built.known(("of a test", "first"), object)
    for number in range(200):
        built.known(("of a test", number), object)
        assert built.known(("of a test", "first"), object) is first
    assert built.known(("of a test", 199), list) != []
    assert built.known(("of a test", 0), list) == []  # forgotten, and made anew

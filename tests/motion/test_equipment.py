"""Equipment on figures: where it sits, what it is tested against, exact and as spheres."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Compound
from wholebody.motion.worn_equipment import READY, Equipment, bounds, equipment, group_of


@pytest.fixture(scope="module", params=["capsules", "spheres"])
def person(request: pytest.FixtureRequest) -> Figure:
    return wb.load("human", detail=request.param)


@pytest.fixture(scope="module")
def capsules() -> Figure:
    return wb.load("human")


def others_of(scene: wb.Scene, thing: str) -> set[str]:
    """Owners that a thing is tested against."""
    owners = scene.piece_owner
    pairs = [{owners[a], owners[b]} for a, b in scene.pair_table.pairs]
    return set().union(*(pair - {thing} for pair in pairs if thing in pair))


@pytest.mark.parametrize("name", READY)
def test_ready_equipment_sits_on_the_trunk_of_a_standing_person(person: Figure, name: str) -> None:
    scene = wb.Scene(person)
    for piece in equipment(name, person):
        piece.attach(scene)
    near = scene.contacts(person.neutral, within=0.0)
    owners = scene.piece_owner
    for pair, distance in zip(near.pair, near.distance, strict=True):
        limbs = {owners[k] for k in pair} - set(scene.objects)
        assert limbs <= {f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm", "hand")}
        assert distance > -0.06  # an arm beside it gets into it, as figures 4.1 to 4.3 of the thesis have it


def test_what_is_worn_touches_its_segment_and_does_not_enter_it(capsules: Figure) -> None:
    """Brute force: the nearest corner of the pack is where the capsule of the thorax ends behind."""
    worn = Equipment.worn(wb.Box((0.2, 0.3, 0.4)), capsules, name="box", to="thorax", side="back")
    piece = next(g for g in capsules.geometry.geometryObjects if g.name == "thorax")
    frame = capsules.model.frames[capsules.frame_id("thorax")].placement
    capsule = frame.inverse() * piece.placement
    ends = [capsule.act(np.array([0.0, 0.0, s * piece.geometry.halfLength])) for s in (-1, 1)]
    behind = min(end[0] for end in ends) - piece.geometry.radius
    assert worn.at.translation[0] + 0.1 == pytest.approx(behind, abs=1e-9)  # type: ignore[union-attr]


def test_exact_equipment_is_tested_against_limbs_and_spheres_across_groups_only(capsules: Figure) -> None:
    box = Equipment("pouch", wb.Box((0.1, 0.05, 0.1)), "thorax", (0.2, 0.1, -0.2))
    exact, filled = wb.Scene(capsules), wb.Scene(capsules)
    box.attach(exact)
    box.filled(6).attach(filled)
    assert {"pelvis", "left_thigh", "left_forearm", "head"} <= others_of(exact, "pouch")
    across = {name for name in capsules.segments if name not in group_of(capsules, "thorax")}
    assert others_of(filled, "pouch") == across & others_of(exact, "pouch")
    assert "pelvis" not in others_of(filled, "pouch")


def test_filled_equipment_of_one_group_is_not_tested_against_each_other(capsules: Figure) -> None:
    scene = wb.Scene(capsules)
    Equipment("plate", wb.Box((0.03, 0.2, 0.3)), "thorax", (0.2, 0.0, 0.0)).filled(3).attach(scene)
    Equipment("belt", wb.Box((0.05, 0.2, 0.05)), "pelvis", (0.2, 0.0, 0.1)).filled(2).attach(scene)
    Equipment("bracelet", wb.Box((0.1, 0.1, 0.02)), "left_forearm", (0.0, 0.0, -0.1)).filled(2).attach(scene)
    assert "belt" not in others_of(scene, "plate")
    assert {"plate", "belt"} <= others_of(scene, "bracelet")


def test_the_sphere_test_is_the_intersection_of_all_pairs_across_groups(shared_spheres: Figure) -> None:
    """C3 and C4 by brute force: centres and radii of all spheres, groups by segment, the named exclusions left out."""
    figure = shared_spheres
    scene = wb.Scene(figure)
    equipment("pack", figure)[0].filled(12, envelope=True).attach(scene)
    excluded = {frozenset((pair.a, pair.b)) for pair in figure.excluded_pairs if pair.reason == "limbs meet the trunk"}
    group = {**figure.collision_groups, "pack": figure.collision_groups["thorax"]}
    names, owners = scene.piece_names, scene.piece_owner
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(40):
        q = figure.clamp(figure.neutral + np.concatenate([np.zeros(7), rng.normal(0.0, 0.5, figure.model.nq - 7)]))
        state = scene.state(q)
        centers, radii = [], []
        for piece in scene.geometry.geometryObjects:
            place = state.data.oMi[piece.parentJoint] * piece.placement
            centers.append(place.translation)
            radii.append(piece.geometry.radius)
        expected = {
            (a, b)
            for b in range(len(radii))
            for a in range(b)
            if group[owners[a]] != group[owners[b]]
            and frozenset((names[a], names[b])) not in excluded
            and np.linalg.norm(centers[a] - centers[b]) < radii[a] + radii[b]
        }
        assert {tuple(sorted(pair)) for pair in scene.contacts(q, within=0.0).pair.tolist()} == expected
        found += len(expected)
    assert found > 40


@pytest.fixture(scope="module")
def shared_spheres() -> Figure:
    return wb.load("human", detail="spheres")


def test_bounds_of_a_mesh_are_those_of_its_vertices() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.1]])
    mesh = wb.Mesh((vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])))
    low, high = bounds(mesh)
    assert np.allclose(low, 0.0, atol=1e-9)
    assert np.allclose(high, (0.3, 0.2, 0.1), atol=1e-9)


def test_what_has_no_end_has_no_bounds() -> None:
    for endless in (wb.HalfSpace(), Compound(((wb.HalfSpace(), pin.SE3.Identity()),))):
        with pytest.raises(InputError, match="has no bounds"):
            bounds(endless)

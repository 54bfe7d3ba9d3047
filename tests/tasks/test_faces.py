"""Faces to sit and stand on: of chairs, benches and ramps made from boxes, whose faces are known by construction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.geometry.shapes import Compound
from wholebody.scene.scene import Scene
from wholebody.tasks.faces import UP, back_above, face

SEAT, BACK = (0.40, 0.44, 0.05), (0.04, 0.44, 0.50)  # m: sizes of boards
LEGS = [((0.04, 0.04, 0.38), (x, y, 0.19)) for x in (-0.18, 0.18) for y in (-0.2, 0.2)]
CHAIR = [(SEAT, (0.0, 0.0, 0.405)), (BACK, (-0.18, 0.0, 0.68)), *LEGS]  # its seat is 0.43 m high
ARMS = [((0.38, 0.05, 0.04), (0.0, y, 0.64)) for y in (-0.235, 0.235)]


def made(*boards: tuple[Sequence[float], Sequence[float]]) -> wb.Mesh:
    return wb.Mesh(trimesh.util.concatenate([trimesh.creation.box(size).apply_translation(at) for size, at in boards]))


def placed(yaw: float, tilt: float = 0.0) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, tilt, yaw), np.array((0.7, -0.4, 0.0)))


def beside(thing: object, at: pin.SE3) -> Scene:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    return scene.add(thing, name="thing", at=at)  # type: ignore[arg-type]


def seat_of(scene: Scene, direction: Array = UP) -> tuple[Array, Array, Array]:
    with scene.figure.posed(scene.figure.neutral) as state:
        found = face(scene, "thing", direction, state, "here")
        middle, axes = found.at(state)
        return middle, axes[2], found.half


@pytest.mark.parametrize("yaw", [0.0, 0.9, -2.5])
@pytest.mark.parametrize("boards", [CHAIR, [*CHAIR, *ARMS]], ids=["chair", "armchair"])
def test_the_seat_of_a_chair_is_not_the_top_of_its_backrest(
    yaw: float, boards: list[tuple[tuple[float, ...], ...]]
) -> None:
    middle, normal, half = seat_of(beside(made(*boards), placed(yaw)))
    # the backrest covers the last 40 mm; what is not covered is seen on a grid of 16
    np.testing.assert_allclose(placed(yaw).actInv(middle), (0.02, 0.0, 0.43), atol=0.02)
    np.testing.assert_allclose(normal, UP, atol=1e-6)
    np.testing.assert_allclose(sorted(half), (0.18, 0.22), atol=0.02)


def test_the_back_of_a_chair_looks_over_its_seat() -> None:
    at = placed(2.0)
    scene = beside(made(*CHAIR, *ARMS), at)
    with scene.figure.posed(scene.figure.neutral) as state:
        seat = face(scene, "thing", UP, state, "here")
        back, behind = back_above(scene, "thing", seat, state, "here")
        middle, axes = back.at(state)
    np.testing.assert_allclose(at.actInv(middle)[:2], (-0.16, 0.0), atol=0.02)
    assert 0.6 < middle[2] < 0.8
    np.testing.assert_allclose(at.rotation.T @ axes[2], (1.0, 0.0, 0.0), atol=1e-6)
    pieces = [scene.geometry.geometryObjects[k] for k in behind.pieces]  # neither the seat nor the rests for arms
    corners = np.vstack([[at.actInv(each.placement.act(p)) for p in each.geometry.points()] for each in pieces])
    assert corners[:, 0].max() < -0.1


def test_a_ramp_is_as_steep_as_it_is() -> None:
    corners = [(x, y, z) for y in (-0.5, 0.5) for x, z in ((0.0, 0.0), (1.0, 0.0), (1.0, 0.3))]
    middle, normal, half = seat_of(beside(wb.Hull(corners), placed(1.0)))
    np.testing.assert_allclose(placed(1.0).actInv(middle), (0.5, 0.0, 0.15), atol=1e-6)
    np.testing.assert_allclose(
        placed(1.0).rotation.T @ normal, np.array((-0.3, 0.0, 1.0)) / np.hypot(0.3, 1.0), atol=1e-6
    )
    np.testing.assert_allclose(sorted(half), sorted((0.5, 0.5 * np.hypot(1.0, 0.3))), atol=1e-6)


def test_of_stairs_it_is_the_highest_step_and_of_what_is_round_the_highest_point() -> None:
    steps = [((0.3, 1.0, 0.2 * (k + 1)), (0.3 * k, 0.0, 0.1 * (k + 1))) for k in range(4)]
    middle, _, half = seat_of(beside(made(*steps), placed(0.3)))
    np.testing.assert_allclose(placed(0.3).actInv(middle), (0.9, 0.0, 0.8), atol=0.02)
    np.testing.assert_allclose(sorted(half), (0.15, 0.5), atol=0.04)
    middle, normal, _ = seat_of(beside(wb.Ellipsoid((0.3, 0.2, 0.1)), placed(0.3)))
    np.testing.assert_allclose((*middle, *normal), (0.7, -0.4, 0.1, 0.0, 0.0, 1.0), atol=1e-6)


@pytest.mark.parametrize("start", ["standing", "sitting"])
@pytest.mark.parametrize("yaw", [0.5, 2.8])
def test_a_person_sits_on_a_chair_whichever_way_it_stands(yaw: float, start: str) -> None:
    scene = beside(made(*CHAIR), placed(yaw))
    seated = wb.Sit(on="thing", back="thing")
    found = wb.solve(wb.Problem(scene, start, goals=[seated], constraints=[wb.Stand(on="floor", balance=False)]))
    assert found.status == "solved", found.message
    assert not scene.penetration(found.q) or scene.penetration(found.q)[0].depth < 1e-4
    pelvis = placed(yaw).actInv(scene.figure.placement(found.q, "pelvis"))
    assert -0.16 < pelvis.translation[0] < 0.2
    assert abs(pelvis.translation[1]) < 0.2
    assert 0.43 < pelvis.translation[2] < 0.56
    ahead = scene.figure.placement(scene.figure.posture("standing"), "pelvis").rotation.T[
        :, 0
    ]  # it looks along x there
    assert (pelvis.rotation @ ahead)[0] > 0.8


def test_a_stool_has_no_back() -> None:
    scene = beside(made(CHAIR[0], *LEGS), placed(0.0))
    with pytest.raises(wb.InputError, match=r"has no flat back above its seat; name the thing or piece that is it"):
        wb.Problem(scene, goals=[wb.Sit(on="thing", back="thing")])


def test_nobody_sits_under_a_seat() -> None:
    """A woman whose shanks are short for a seat hung under it with her thighs, and that was called solved."""
    scene = beside(made(*CHAIR), placed(0.0))
    problem = wb.Problem(scene, goals=[wb.Sit(on="thing")])
    q = scene.figure.posture("sitting")
    q[:3] = (0.72, -0.4, 0.43 - 0.2)  # m
    under = 0.43 - scene.figure.placement(q, "pelvis").translation[2]
    assert under > 0.1
    with scene.figure.posed(q) as state:
        missed = problem.goals[0].error(state)
    assert np.abs(np.abs(missed) - under).min() < 1e-6


def test_of_a_thing_with_a_half_space_one_piece_is_named() -> None:
    at = pin.SE3.Identity()
    scene = beside(Compound([(wb.Box(SEAT), placed(0.0)), (wb.HalfSpace(), at)]), at)
    with pytest.raises(wb.InputError, match=r"half-space among its pieces; name one, as 'thing:0'"):
        wb.Problem(scene, goals=[wb.Sit(on="thing")])
    assert wb.Problem(scene, goals=[wb.Sit(on="thing:0")]).goals


def test_a_palm_lies_on_a_desk_and_not_on_what_stands_on_it() -> None:
    """A desk with a screen in one mesh; and a wall with a narrow ledge to lean at."""
    desk = made(((0.8, 1.6, 0.03), (0.0, 0.0, 0.735)), ((0.05, 0.5, 0.35), (0.2, 0.0, 0.925)))
    wall = made(((0.1, 2.0, 2.0), (0.0, 0.0, 1.0)), ((0.15, 2.0, 0.04), (0.12, 0.0, 1.9)))
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(desk, name="desk", at=(0.55, 0.0, 0.0)).add(wall, name="wall", at=(-0.5, 0.0, 0.0))
    feet = [wb.tasks.Stand(on="floor")]
    laid = wb.solve(wb.Problem(scene, goals=[wb.Grasp("right", "desk", side=(0, 0, 1))], constraints=feet))
    assert laid.status == "solved", laid.message
    below = scene.figure.placement(laid.q, "right_palm").translation
    assert 0.75 - 1e-5 < below[2] < 0.79  # the desk is 0.75 m high
    leaning = wb.solve(wb.Problem(scene, goals=[wb.tasks.Lean("wall")], constraints=feet))
    assert leaning.status == "solved", leaning.message
    touching = [{scene.piece_owner[piece] for piece in pair} for pair in scene.contacts(leaning.q, within=1e-4).pair]
    assert {"thorax", "wall"} in touching  # its chest is below the ledge

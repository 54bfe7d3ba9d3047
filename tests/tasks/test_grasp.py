"""Grasps: sides that oppose by coal's normals, derivatives by differences, options, and wheels held from outside."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.tasks.grips import Oblique, opened

FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]
AT = (0.40, -0.2, 1.1)
FOUR = ("index", "middle", "ring", "little")


@pytest.fixture(scope="module")
def figure() -> wb.Figure:
    return wb.load("human", hands="fingers")


def _start(figure: wb.Figure) -> Any:
    return figure.with_joints(figure.posture("standing"), {"right_elbow_flexion": np.radians(80.0)})


def _nearest(scene: wb.Scene, q: Any, pieces: str | tuple[str, ...]) -> tuple[float, Any]:
    """Distance and normal of the nearest contact of pieces, by the beginnings of their names, with the thing."""
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, q)
    best, request = None, coal.DistanceRequest()
    for one in scene.geometry.geometryObjects:
        for other in scene.geometry.geometryObjects:
            if one.name.startswith(pieces) and other.name.startswith("thing:"):
                ends = [data.oMi[piece.parentJoint] * piece.placement for piece in (one, other)]
                a, b = (coal.Transform3s(end.rotation, end.translation) for end in ends)
                result = coal.DistanceResult()
                coal.distance(one.geometry, a, other.geometry, b, request, result)
                if best is None or result.min_distance < best[0]:
                    best = result.min_distance, np.array(result.normal)
    assert best is not None
    return best


def _normal(scene: wb.Scene, q: Any, pieces: str | tuple[str, ...]) -> Any:
    return _nearest(scene, q, pieces)[1]


def _apart(a: Any, b: Any) -> float:
    return float(np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))))


@pytest.mark.parametrize(
    ("kind", "shape"),
    [
        ("pinch", wb.Capsule(0.01, 0.2)),
        ("fingertips", wb.Sphere(0.01)),
    ],
    ids=["pinch bar", "fingertips ball"],
)
def test_thumb_and_fingers_oppose(figure: wb.Figure, kind: Any, shape: Any) -> None:
    scene = wb.Scene(figure).add(shape, name="thing", at=AT)
    grasp = wb.Grasp("right", "thing", kind)
    solution = wb.solve(
        wb.Problem(scene, start=_start(figure), goals=[grasp], constraints=FEET), wb.methods.QP(measures=False)
    )
    assert solution.status == "solved", solution.message
    fingers = ("index",) if kind == "pinch" else FOUR
    thumb, *others = (_nearest(scene, solution.q, f"right_{finger}_distal") for finger in ("thumb", *fingers))
    assert _apart(thumb[1], np.sum([normal for _, normal in others], axis=0)) > 135.0 - 0.1
    assert max(abs(distance) for distance, _ in (thumb, *others)) < 2e-5


def test_an_edged_thing_is_pinched_from_two_sides(figure: wb.Figure) -> None:
    """From a start from which the finger that lies on a flat end of the cylinder used to leave it."""
    scene = wb.Scene(figure).add(wb.Cylinder(0.033, 0.1), name="thing", at=(0.42, -0.28, 1.15))
    relaxed = wb.figures.finger_angles("relaxed", "right")
    start = figure.with_joints(figure.posture("standing"), {"right_elbow_flexion": np.radians(45.0), **relaxed})
    problem = wb.Problem(scene, start=start, goals=[wb.Grasp("right", "thing", "pinch")], constraints=FEET)
    solution = wb.solve(problem)
    assert solution.status == "solved", solution.message
    ends = [_normal(scene, solution.q, f"right_{finger}_distal") for finger in ("thumb", "index")]
    assert _apart(*ends) > 135.0 - 6.0  # a cylinder is a prism whose sides are 5.6 degrees apart


def _outer(finger: str) -> tuple[str, ...]:
    inner = "proximal" if finger == "thumb" else "middle"
    return f"right_{finger}_{inner}", f"right_{finger}_distal"


@pytest.mark.parametrize(
    ("shape", "at"),
    [
        (wb.Sphere(0.04), AT),
        (wb.Capsule(0.0141, 0.515), (0.433, -0.157, 1.237, -0.6237, -0.5206, 0.5251, -0.2534)),
    ],
    ids=["ball 80 mm", "thin rod behind the fingers"],
)
def test_in_a_power_grip_the_thumb_opposes_the_fingers(figure: wb.Figure, shape: Any, at: Any) -> None:
    """The rod was called unreachable, although postures that solve neighbouring rods lead to it."""
    quaternion = np.array(at[3:] or (0.0, 0.0, 0.0, 1.0))
    scene = wb.Scene(figure).add(shape, name="thing", at=(*at[:3], *(quaternion / np.linalg.norm(quaternion))))
    problem = wb.Problem(scene, start=_start(figure), goals=[wb.Grasp("right", "thing", "power")], constraints=FEET)
    solution = wb.solve(problem, wb.methods.QP(measures=False))
    assert solution.status == "solved", solution.message
    mean = np.sum([_normal(scene, solution.q, _outer(finger)) for finger in FOUR], axis=0)
    assert _apart(_normal(scene, solution.q, _outer("thumb")), mean) > 135.0 - 0.1


@pytest.mark.parametrize("radius", [0.008, 0.03])
def test_a_hand_on_its_own_takes_a_bar_as_a_persons_does(radius: float) -> None:
    hand = wb.load("hand")
    assert set(hand.joints) < set(wb.load("human", hands="fingers").joints)
    scene = wb.Scene(hand).add(wb.Capsule(radius, 0.25), name="bar", at=(0.1, 0.0, 0.1, 0.5**0.5, 0.0, 0.0, 0.5**0.5))
    solution = wb.solve(wb.Problem(scene, goals=[wb.Grasp("right", "bar", "power")]), wb.methods.QP(measures=False))
    assert solution.status == "solved", solution.message


def test_a_mug_is_taken_from_a_table() -> None:
    """From below the table no descent leads around it, and around so thick a bar no thumb reaches across its middle."""
    scene = wb.Scene(wb.load("human", sex="female", hands="fingers"))
    scene.add(wb.Box((0.5, 1.2, 0.03)), name="table", at=(0.50, 0.0, 0.835))
    scene.add(wb.Cylinder(0.04, 0.12), name="thing", at=(0.40, 0.10, 0.9101))
    grasp = wb.Grasp("left", "thing", "power", approach="side")
    solution = wb.solve(wb.Problem(scene, goals=[grasp], constraints=FEET), wb.methods.QP(measures=False))
    assert solution.status == "solved", solution.message
    palm = scene.figure.placement(solution.q, "left_palm")
    assert 0.85 < palm.translation[2] < 0.97
    assert abs(palm.rotation[2, 1]) > 0.999  # the mug stands across the palm
    toward = scene.objects["thing"].placement.translation - palm.translation
    assert palm.rotation[:2, 2] @ toward[:2] > 0.9 * 0.04  # which looks at it


def test_derivative_of_a_hand_about_to_close(figure: wb.Figure) -> None:
    q = _start(figure)
    place = figure.placement(q, "right_palm")
    scene = wb.Scene(figure).add(wb.Capsule(0.03, 0.3), name="thing", at=place.act(np.array((0.05, 0.0, 0.09))))
    term = opened(wb.Grasp("right", "thing", "power").resolve(scene, q), 0.01)
    rng, state = np.random.default_rng(1), scene.state(q)
    there = pin.integrate(figure.model, q, 0.05 * rng.normal(size=figure.model.nv))
    way = rng.normal(size=figure.model.nv)
    ends = [term.value(state.update(pin.integrate(figure.model, there, step * way))) for step in (1e-6, -1e-6)]
    given = term.jacobian(state.update(there)) @ way
    np.testing.assert_allclose((ends[0] - ends[1]) / 2e-6, given, atol=1e-5)
    assert np.abs(given[0]) > 1e-3


@pytest.mark.parametrize("radius", [0.01, 0.006, 0.002], ids=["stick", "handle of a drawer", "cord"])
def test_around_a_thin_bar_the_fingers_oppose_the_palm(figure: wb.Figure, radius: float) -> None:
    scene = wb.Scene(figure).add(wb.Capsule(radius, 0.3), name="thing", at=AT)
    problem = wb.Problem(scene, start=_start(figure), goals=[wb.Grasp("right", "thing", "power")], constraints=FEET)
    solution = wb.solve(problem, wb.methods.QP(measures=False))
    assert solution.status == "solved", solution.message
    distance, palm = _nearest(scene, solution.q, "right_hand")
    assert distance < max(0.016 - 2 * radius, 0.0) + 2e-5
    fingers = [_nearest(scene, solution.q, _outer(finger)) for finger in FOUR]
    assert max(abs(found[0]) for found in fingers) < 2e-5  # each touches the bar
    assert _apart(palm, np.sum([found[1] for found in fingers], axis=0)) > 135.0 - 0.1


def test_fingers_on_one_side_do_not_oppose(figure: wb.Figure) -> None:
    """All fingertips on a floor, which has one side."""
    scene = wb.Scene(figure).add(wb.HalfSpace(offset=1.0), name="thing")
    q = _start(figure)
    for opposed in (np.pi / 4, np.pi):
        grasp = wb.Grasp("right", "thing", "fingertips", opposed=opposed).resolve(scene, q)
        down = figure.placement(q, "right_index_tip").translation[2] - 1.0
        state = scene.state(q)
        near = pin.integrate(figure.model, q, np.eye(figure.model.nv)[2] * -(down - 0.01))
        value = grasp.value(state.update(near))
        assert (value[-1] > 1e-3) == (opposed < np.pi)


@pytest.mark.parametrize(
    ("shape", "kind"),
    [(wb.Sphere(0.02), "pinch"), (wb.Capsule(0.015, 0.3), "fingertips"), (wb.Capsule(0.015, 0.3), "power"),
     (wb.Box((0.05, 0.06, 0.04)), "pinch")],
)  # fmt: skip
def test_derivatives(figure: wb.Figure, shape: Any, kind: Any) -> None:
    model, q = figure.model, _start(figure)
    place = figure.placement(q, "right_palm")
    scene = wb.Scene(figure).add(shape, name="thing", at=place.act(np.array((0.05, 0.0, 0.06))))
    grasp = wb.Grasp("right", "thing", kind, approach="overhand").resolve(scene, q)
    state, rng, half = scene.state(q), np.random.default_rng(1), 2e-6
    there = pin.integrate(model, q, 0.05 * rng.normal(size=model.nv))
    given, kinks = grasp.jacobian(state.update(there)), 0
    for way in rng.choice([-1.0, 1.0], size=(10, model.nv)):
        ahead = grasp.value(state.update(pin.integrate(model, there, half * way)))
        behind = grasp.value(state.update(pin.integrate(model, there, -half * way)))
        kinks += int(np.abs((ahead - behind) / (2.0 * half) - given @ way).max() > 1e-2)
    assert kinks <= 1


def test_the_end_of_the_opposed_angles_is_a_plane(figure: wb.Figure) -> None:
    """With k the weight of the angle a, rows of `opposed` of 0 and 0.1 are k a and k (a - 0.1): the plane is theirs.

    Without it a step of the measures went beyond the end, the next one came back, and a descent took 150 of these.
    """
    place = figure.placement(_start(figure), "right_palm")
    scene = wb.Scene(figure).add(wb.Capsule(0.015, 0.3), name="thing", at=place.act(np.array((0.05, 0.0, 0.06))))
    state = scene.state(_start(figure))

    def grasp(opposed: float) -> wb.Grasp:
        return wb.Grasp("right", "thing", "fingertips", opposed=opposed, approach="side").resolve(scene, state.q)

    opposing = 5  # the part after the gaps of five fingers, one row each
    (whole, less), (row, other) = (
        [getattr(grasp(opposed), what)(state)[opposing] for opposed in (0.0, 0.1)] for what in ("value", "jacobian")
    )
    most = 0.1 * whole / (whole - less) + 0.05
    inside = grasp(float(most))
    assert inside.value(state)[opposing] == 0.0
    planes = inside.supporting_planes(state)
    (place_of,) = np.flatnonzero(planes.key // (3 * 256) == opposing)
    assert planes.value[place_of] == pytest.approx(whole - most / 0.1 * (whole - less), rel=1e-6)
    np.testing.assert_allclose(planes.jacobian[place_of], row - most / 0.1 * (row - other), atol=1e-9)
    tilt = np.arcsin(abs(place.rotation[2, 2]))  # of the palm, which may look down or up by 45 degrees
    assert planes.value[planes.key // (3 * 256) > opposing][-1] == pytest.approx(tilt - np.pi / 4)


@pytest.mark.parametrize(("approach", "low", "high"), [("underhand", 0.7, 1.0), ("side", -0.71, 0.71)])
def test_the_palm_looks_where_the_approach_says(approach: Any, low: float, high: float) -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure).add(
        wb.Capsule(0.015, 0.4), name="thing", at=(0.4, -0.25, 1.1, 0.0, 0.7071068, 0.0, 0.7071068)
    )
    grasp = wb.Grasp("right", "thing", "power", approach=approach)
    solution = wb.solve(wb.Problem(scene, goals=[grasp], constraints=FEET))
    assert solution.status == "solved", solution.message
    assert low - 1e-3 < figure.placement(solution.q, "right_palm").rotation[2, 2] < high + 1e-2


@pytest.mark.parametrize("along", [0.0, 0.5])
def test_the_hand_is_where_along_says(along: float) -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.Capsule(0.015, 0.4), name="thing", at=(0.4, -0.25, 1.1))
    solution = wb.solve(wb.Problem(scene, goals=[wb.Grasp("right", "thing", "power", along=along)], constraints=FEET))
    assert solution.status == "solved", solution.message
    palm = figure.placement(solution.q, "right_palm").translation
    assert palm[2] - 1.1 == pytest.approx(along * 0.215, abs=1e-3)


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
@pytest.mark.parametrize(
    ("degrees", "off"),
    [(-15.0, 15.0), (0.0, 0.0), (12.0, 0.0), (20.0, 0.0), (50.0, 30.0), (95.0, 75.0), (105.0, 75.0), (190.0, 0.0)],
)
def test_a_bar_lies_in_a_fist_up_to_20_degrees_from_across_the_palm(
    side: str, sign: float, degrees: float, off: float
) -> None:
    """On the side of the thumb it is nearer to the fingers; beyond, the first angle is what is too much, either way."""
    figure = wb.load("human")
    palm = figure.placement(figure.neutral, f"{side}_palm")
    scene = wb.Scene(figure).add(wb.Capsule(0.02, 0.4), name="bar", at=(0.4, 0.0, 1.1))
    grasp = wb.Grasp(side, "bar", "power").resolve(scene, figure.neutral)
    thumb = palm.actInv(figure.placement(figure.neutral, f"{side}_thumb_tip").translation)[1]
    assert thumb * sign > 0.0
    way = np.array((np.sin(np.radians(degrees)), sign * np.cos(np.radians(degrees)), 0.0))  # of the end at the thumb
    turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), palm.rotation @ way)
    scene.move("bar", at=pin.SE3(turn.matrix(), palm.act(np.array((0.0, 0.0, 0.02)))))
    found = grasp.value(scene.state(figure.neutral))
    np.testing.assert_allclose(np.degrees(np.abs(found[1:3])), (off, 0.0), atol=1e-5)


def test_a_bar_is_held_from_being_turned_beyond_the_range() -> None:
    """The planes that keep a hand within the range are its angle from both ends, with their derivatives."""
    scene, grip, q = _at_a_ring()
    model, state, half = scene.model, scene.state(q), 1e-6
    q = pin.integrate(model, q, 0.01 * np.random.default_rng(3).normal(size=model.nv))
    planes = next(part for part in grip.parts if isinstance(part, Oblique)).planes
    given = planes(state.update(q))
    assert given.value.sum() == pytest.approx(-np.radians(20.0))
    for way in np.eye(model.nv)[:6]:
        ahead, behind = (planes(state.update(pin.integrate(model, q, side * half * way))).value for side in (1.0, -1.0))
        np.testing.assert_allclose((ahead - behind) / (2.0 * half), given.jacobian @ way, atol=1e-6)


def test_a_wheel_is_held_by_its_rim_from_outside() -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.Torus(0.18, 0.015), name="wheel", at=(0.45, 0.0, 1.1))
    grips = [wb.Grasp(side, "wheel", "power") for side in ("left", "right")]
    solution = wb.solve(wb.Problem(scene, goals=grips, constraints=FEET))
    assert solution.status == "solved", solution.message
    wheel = scene.objects["wheel"].placement
    for side, sign in (("left", 1.0), ("right", -1.0)):
        palm = wheel.actInv(figure.placement(solution.q, f"{side}_palm"))
        outwards = np.array((*palm.translation[:2], 0.0)) / np.hypot(*palm.translation[:2])
        assert np.hypot(*palm.translation[:2]) > 0.18
        assert palm.rotation[:, 2] @ outwards < 0.0  # the palm looks inwards
        rim = sign * palm.rotation.T @ np.cross((0.0, 0.0, 1.0), outwards)  # it crosses the palm, in its plane
        assert -1e-4 < np.arctan2(sign * rim[0] * np.sign(rim[1]), abs(rim[1])) < np.radians(20.0) + 1e-4
        assert abs(rim[2]) < 1e-4
        assert sign * palm.translation[1] > 0.0


def _at_a_ring() -> tuple[wb.Scene, Any, Any]:
    """A person in the air, the grip of a leaning ring, and a posture where the bar is 35 mm in front of the palm."""
    person, at = wb.load("human"), pin.SE3(pin.utils.rotate("y", -1.1), np.array((0.4, 0.1, 1.0)))
    scene, q = wb.Scene(person).add(wb.Torus(0.18, 0.015), name="ring", at=at), person.posture("standing")
    grip = wb.Grasp("left", "ring", "power").resolve(scene, q)  # its left is that of the world
    # fingers along the ring's axis, thumb along the rim, the palm looks inwards
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    palm = at * pin.SE3(turn, np.array((0.0, 0.215, 0.0)))
    q[:7] = pin.SE3ToXYZQUAT(palm * person.placement(q, "left_palm").inverse() * pin.XYZQUATToSE3(q[:7]))
    return scene, grip, q


@pytest.mark.parametrize(
    ("degrees", "held"), [(-40.0, True), (20.0, True), (44.0, True), (-50.0, False), (60.0, False)]
)
def test_a_ring_is_taken_anywhere_in_a_quarter(degrees: float, held: bool) -> None:
    """A hand that goes around the ring with it takes it as before, up to 45 degrees: beyond it is out by the sine."""
    scene, grip, q = _at_a_ring()
    at = scene.objects["ring"].placement
    before = grip.value(scene.state(q))[1:]  # the first is the gap: a ring is of straight pieces
    turned = at * pin.SE3(pin.utils.rotate("z", np.radians(degrees)), np.zeros(3)) * at.inverse()
    q[:7] = pin.SE3ToXYZQUAT(turned * pin.XYZQUATToSE3(q[:7]))
    after = grip.value(scene.state(q))[1:]
    np.testing.assert_allclose(before, 0.0, atol=1e-9)
    if held:
        np.testing.assert_allclose(after, 0.0, atol=1e-9)
    else:
        assert np.abs(after).max() == pytest.approx(0.215 * np.sin(np.radians(abs(degrees) - 45.0)), abs=1e-6)


def test_derivatives_at_a_ring() -> None:
    scene, grip, q = _at_a_ring()
    model, state, rng, half = scene.model, scene.state(q), np.random.default_rng(2), 1e-6
    for spread in (0.1, 0.5):  # the second is beyond the quarter, and beside the ring
        there = pin.integrate(model, q, spread * rng.normal(size=model.nv))
        given = grip.jacobian(state.update(there))[1:]
        for way in np.eye(model.nv)[:6]:
            ahead = grip.value(state.update(pin.integrate(model, there, half * way)))[1:]
            behind = grip.value(state.update(pin.integrate(model, there, -half * way)))[1:]
            np.testing.assert_allclose((ahead - behind) / (2.0 * half), given @ way, atol=1e-6)


@pytest.mark.parametrize(
    ("thing", "kind"), [(wb.Torus(0.18, 0.015), "power"), (wb.Box((0.3, 0.3, 0.3)), "palm")], ids=["wheel", "crate"]
)
def test_what_a_hand_holds_it_holds_whichever_way_its_figure_turns(thing: wb.Shape, kind: Any) -> None:
    """Postures that solve a problem keep its grip as their own start: the side is that of the hand, not of the root."""
    person = wb.load("human")
    scene = wb.Scene(person).add(thing, name="thing", at=(0.45, 0.0, 1.1))
    grip = wb.Grasp("left", "thing", kind)
    held = wb.solve(wb.Problem(scene, goals=[grip]))
    assert held.status == "solved", held.message
    place = person.placement(held.q, "left_palm")
    for degrees in (-55.0, 55.0):
        ahead = (np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0)
        goals = [wb.Frame("left_palm", place), wb.Axis("pelvis", (1.0, 0.0, 0.0), direction=ahead)]
        turned = wb.solve(wb.Problem(scene, held.q, goals=goals, clearance=0.0))
        assert turned.status == "solved", turned.message
        assert wb.assess(wb.Problem(scene, held.q, constraints=[grip]), turned.q).constraint_violation < 2e-4
        assert wb.assess(wb.Problem(scene, turned.q, constraints=[grip]), turned.q).constraint_violation < 2e-4


def test_a_wheel_has_no_ends_to_be_along() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Torus(0.18, 0.015), name="wheel", at=(0.45, 0.0, 1.1))
    with pytest.raises(wb.InputError, match="is a ring"):
        wb.Problem(scene, goals=[wb.Grasp("left", "wheel", "power", along=0.5)])


def test_a_crate_that_no_hand_spans_is_not_grasped():
    """Its edges count as rounded for the normals alone: where fingers touch, opposition counts in full."""
    scene = wb.Scene(wb.load("human", hands="fingers"))
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="crate", at=(0.45, -0.25, 1.1))
    problem = wb.Problem(scene, goals=[wb.Grasp("right", "crate", "pinch")])
    assert not wb.solve(problem, wb.methods.QP(restarts=1, budget=80)).solved


def test_somebody_kneels_to_take_the_handle_of_a_drawer() -> None:
    """Fingers close from in front of the bar once the knee is at the floor; a rigid hand shows that it is in reach."""
    solved = []
    for hands in ("rigid", "fingers"):
        scene = wb.Scene(wb.load("human", sex="female", percentile=25, hands=hands)).add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box((0.5, 0.6, 0.9)), name="chest", at=(0.85, 0.0, 0.45))
        lying = pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("x", 0.5 * np.pi), np.array((0.55, 0.0, 0.5))))
        scene.add(wb.Cylinder(0.006, 0.12), name="handle", at=lying)
        knees = wb.Stand(on="floor", feet=["right_foot", "left_shank"], knees=["left_shank"])
        grip = wb.Grasp("right", "handle", kind="power")
        solved.append(wb.solve(wb.Problem(scene, goals=[grip], constraints=[knees])))
    assert [each.status for each in solved] == ["solved", "solved"], solved[1].message

"""Contact terms: distances by formula on both sides of zero, derivatives by finite differences, solved by methods."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State

SEAT = 0.40  # m: top of the seat


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return _furnished(wb.load("human", sex="male", stature=1.75))


def _furnished(figure: wb.Figure) -> wb.Scene:
    made = wb.Scene(figure)
    made.add(wb.HalfSpace(), name="floor")
    made.add(wb.Box((0.44, 0.48, 0.04)), name="seat", at=(-0.35, 0.0, SEAT - 0.02))
    made.add(wb.Box((0.03, 0.48, 0.36)), name="backrest", at=(-0.57, 0.0, 0.82))
    made.add(wb.Box((0.30, 0.32, 0.24)), name="box", at=(0.45, 0.0, 0.92))
    made.add(wb.Sphere(0.2), name="ball", at=(0.1, -0.9, 1.3))
    made.add(wb.Capsule(0.015, 0.5), name="bar", at=(0.4, -0.3, 1.2, 0.6, 0.0, 0.0, 0.8))
    return made


TERMS = {
    "touch": wb.Touch("left_hand", "box"),
    "touch_piece": wb.Touch("left_forearm", "ball"),
    "touch_point": wb.Touch("right_index_tip", "ball"),
    "touch_frames": wb.Touch("right_palm", "left_palm"),
    "touch_itself": wb.Touch("right_hand", "left_thigh"),
    "lean": wb.tasks.Lean("backrest"),
    "sit": wb.Sit("seat"),
    "sit_back": wb.Sit("seat", "backrest"),
    "stand": wb.Stand("floor"),
    "palm": wb.Grasp("left", "box"),
    "palm_side": wb.Grasp("right_hand", "box", side=(0, 0, 1)),
    "power": wb.Grasp("right", "bar", "power"),
}
OFTEN = {
    **TERMS,
    "on_a_tray": wb.Stand("tray", balance=False),
    "on_a_step": wb.Stand("step", balance=False),
    "sit_on_a_tray": wb.Sit("tray"),
    "still": wb.Posture("sitting"),
    "comfort": wb.tasks.Discomfort(),
    "low": wb.tasks.PotentialEnergy(),
}


@pytest.mark.parametrize("name", OFTEN)
def test_a_term_is_the_same_whatever_was_stated_before(name: str) -> None:
    # what does not follow from the start is kept with the scene; a tray in the hand turns with the start
    figure, rng = wb.load("human", sex="male", stature=1.75), np.random.default_rng(5)
    tray = wb.Box((0.3, 0.2, 0.02))
    used, anew = (_furnished(figure).attach(tray, to="right_palm", name="tray", at=(0.1, 0.0, 0.05)) for _ in range(2))
    for scene in (used, anew):
        scene.add(wb.Box((0.5, 0.6, 0.2)), name="step", at=(0.1, 0.0, 0.0))
    start = pin.integrate(figure.model, figure.posture("standing"), 0.2 * rng.normal(size=55))
    OFTEN[name].resolve(used, figure.posture("sitting"))
    for scene in (used, anew):
        for thing, place in (
            ("floor", (0.0, 0.0, 0.05)),
            ("seat", (-0.3, 0.1, 0.5, 0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))),
            ("step", (0.1, 0.2, 0.1, 0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))),
            ("tray", (0.1, 0.0, 0.05, 0.6, 0.0, 0.0, 0.8)),
        ):
            scene.move(thing, at=place)
    OFTEN[name].resolve(used, figure.posture("arms_forward"))
    terms: list[Any] = [OFTEN[name].resolve(scene, start) for scene in (used, anew)]
    for q in (start, figure.posture("sitting")):
        here = State(figure.model).update(q)
        values = [term.value(here) if hasattr(term, "value") else term.error(here) for term in terms]
        np.testing.assert_array_equal(*values)


HALF = 2e-6  # m, rad: half of a difference; coal's distances are good to 1e-9


@pytest.mark.parametrize("name", TERMS)
@pytest.mark.parametrize("shift", [0.0, -0.3])  # the second puts feet, pelvis and hands into things
def test_derivative_of_every_contact(scene: wb.Scene, name: str, shift: float) -> None:
    figure, model = scene.figure, scene.model
    term = TERMS[name].resolve(scene, figure.posture("standing"))
    state, rng = State(model), np.random.default_rng(4)
    for number in range(2):
        q = pin.integrate(model, figure.posture("sitting" if number else "arms_forward"), 0.1 * rng.normal(size=55))
        q[2] += shift
        given = term.jacobian(state.update(q))
        kinks = 0
        for way in rng.choice([-1.0, 1.0], size=(8, model.nv)):
            ahead = term.value(state.update(pin.integrate(model, q, HALF * way)))
            behind = term.value(state.update(pin.integrate(model, q, -HALF * way)))
            slope = (ahead - behind) / (2.0 * HALF)
            kinks += int(np.abs(slope - given @ way).max() > 1e-2)
        assert kinks <= 1  # where another piece becomes the nearest one within the difference


@pytest.mark.parametrize("name", TERMS)
def test_a_term_keeps_what_it_was_resolved_with_whatever_is_resolved_later(scene: wb.Scene, name: str) -> None:
    figure, state, values = scene.figure, State(scene.figure.model), []
    start, other = figure.posture("standing"), figure.posture("sitting")
    for first in (start, other):
        TERMS[name].resolve(scene, first)
        term = TERMS[name].resolve(scene, start)
        values.append(term.value(state.update(start)))
        TERMS[name].resolve(scene, other)
        np.testing.assert_array_equal(term.value(state.update(start)), values[0])
    np.testing.assert_array_equal(values[1], values[0])


@pytest.mark.parametrize("depth", [0.3, 0.02, 1e-4, -1e-4, -0.02, -0.1])
def test_touch_is_the_signed_distance(depth: float) -> None:
    """A point and a ball: the distance is a formula, and the derivative is the direction."""
    figure = wb.load("human")
    q = figure.posture("standing")
    tip = figure.placement(q, "right_index_tip").translation
    way = np.array((0.6, -0.64, 0.48))
    scene = wb.Scene(figure).add(wb.Sphere(0.2), name="ball", at=tip + (0.2 + depth) * way)
    touch = wb.Touch("right_index_tip", "ball").resolve(scene, q)
    state = scene.state(q)
    assert touch.value(state)[0] == pytest.approx(depth, abs=1e-5)  # the end of the finger may be a little turned
    point = wb.Point("right_index_tip", (0, 0, 0)).resolve(scene, q)
    np.testing.assert_allclose(touch.jacobian(state)[0], -way @ state.wrench_jacobian(point.jacobian(state)), atol=1e-5)


@pytest.mark.parametrize("turn", [0.0, 0.03, 0.3])
def test_a_frame_touches_where_the_round_end_of_its_piece_does(turn: float) -> None:
    """Between two balls: as far as the frame is 8e-6 m off where they meet, else it is the frame that is to touch."""
    figure, ball = wb.load("human"), 0.2
    q = figure.posture("standing")
    tip = figure.placement(q, "right_index_tip")
    state, finger = State(figure.model).update(q), figure.geometry.getGeometryId("right_hand:2")
    piece = figure.geometry.geometryObjects[finger]
    end = state.data.oMi[piece.parentJoint] * piece.placement
    middle = end.translation + piece.geometry.halfLength * end.rotation[:, 2]
    radius = float(np.linalg.norm(tip.translation - middle))
    assert radius == pytest.approx(piece.geometry.radius, abs=1e-9)
    pointing = (tip.translation - middle) / radius
    aside = np.cross(pointing, (1.0, 0.0, 0.0)) / np.linalg.norm(np.cross(pointing, (1.0, 0.0, 0.0)))
    center = middle + (ball + radius) * (np.cos(turn) * pointing + np.sin(turn) * aside)
    scene = wb.Scene(figure).add(wb.Sphere(ball), name="ball", at=center)
    touch = wb.Touch("right_index_tip", "ball").resolve(scene, q)
    apart = float(np.linalg.norm(tip.translation - center)) - ball
    asked = 0.0 if turn < 0.1 else apart - 8e-6
    assert touch.value(scene.state(q))[0] == pytest.approx(asked, abs=1e-8)


def test_a_frame_within_a_face_is_told_how_far_the_face_is_turned() -> None:
    """A palm a millimetre over a board that is turned by 0.01 rad: the rows are the angle, at the farthest corner."""
    figure = wb.load("human")
    q = figure.posture("standing")
    palm, state = figure.placement(q, "right_palm"), State(figure.model).update(q)
    hand = figure.geometry.geometryObjects[figure.geometry.getGeometryId("right_hand:0")]
    place, half = state.data.oMi[hand.parentJoint] * hand.placement, np.asarray(hand.geometry.halfSide)
    local = place.actInv(palm.translation)
    axis = int(np.argmin(half - np.abs(local)))
    out = place.rotation[:, axis] * np.sign(local[axis])
    others = [k for k in range(3) if k != axis]
    corners = np.array([local + np.where(np.arange(3) == axis, 0.0, s * half - local) for s in _signs(others)])
    far = float(np.linalg.norm(corners - local, axis=1).max())
    for turn in (0.0, 0.01):
        normal = pin.exp3(turn * place.rotation[:, others[0]]) @ out
        board = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), normal)
        at = pin.SE3(board.matrix(), palm.translation + 1e-3 * out + 0.01 * normal)
        scene = wb.Scene(figure).add(wb.Box((2.0, 2.0, 0.02)), name="board", at=at)
        planes = wb.Touch("right_palm", "board").resolve(scene, q).supporting_planes(scene.state(q))
        turned = planes.value[planes.key >= 512] + 8e-6 * np.cos(np.pi / 8)
        assert np.abs(turned).max() == pytest.approx((far + 1e-3) * np.sin(turn), abs=2e-2 * far * turn + 1e-8)


def _signs(axes: list[int]) -> list[Any]:
    found = []
    for first in (-1.0, 1.0):
        for second in (-1.0, 1.0):
            signs = np.zeros(3)
            signs[axes] = first, second
            found.append(signs)
    return found


def test_touch_of_a_segment_is_coals_least_distance(scene: wb.Scene) -> None:
    q = scene.figure.posture("arms_forward")
    state = scene.state(q)
    pieces, owners = scene.geometry.geometryObjects, scene.piece_owner
    least = min(
        coal.distance(
            a.geometry, _at(state, a), b.geometry, _at(state, b), coal.DistanceRequest(), coal.DistanceResult()
        )
        for a, mine in zip(pieces, owners, strict=True)
        for b, other in zip(pieces, owners, strict=True)
        if (mine, other) == ("left_hand", "box")
    )
    assert wb.Touch("left_hand", "box").resolve(scene, q).value(state)[0] == pytest.approx(least, abs=2e-6)


def _at(state: State, piece: Any) -> Any:
    place = state.data.oMi[piece.parentJoint] * piece.placement
    return coal.Transform3s(place.rotation, place.translation)


def test_a_frame_touches_in_spite_of_a_clearance_that_its_segment_keeps_from_all_else() -> None:
    """Both fingertip and button are within the clearance of each other; the panel behind the button is not."""
    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((0.02, 0.6, 0.6)), name="panel", at=(0.60, -0.2, 1.1))
    scene.add(wb.Sphere(0.03), name="button", at=(0.57, -0.2, 1.1))
    held = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    goal = wb.Touch("right_index_tip", "button")
    solution = wb.solve(wb.Problem(scene, goals=[goal], constraints=held, clearance=0.01))
    assert solution.status == "solved", solution.message
    tip = scene.figure.placement(solution.q, "right_index_tip").translation
    assert np.linalg.norm(tip - (0.57, -0.2, 1.1)) == pytest.approx(0.03, abs=2e-5)
    near = scene.contacts(solution.q, within=0.02)
    kept = [
        distance
        for pair, distance in zip(near.pair, near.distance, strict=True)
        if {scene.piece_owner[pair[0]], scene.piece_owner[pair[1]]} == {"right_hand", "panel"}
    ]
    assert all(distance > 0.01 - 1e-5 for distance in kept)


def test_a_thing_that_is_moved_is_touched_where_it_is(scene: wb.Scene) -> None:
    own = copy.deepcopy(scene)
    q = own.figure.posture("standing")
    touch = wb.Touch("right_index_tip", "ball").resolve(own, q)
    state = own.state(q)  # whose posture stays
    before = touch.value(state)[0]
    own.move("ball", at=np.array((0.1, -0.9, 1.3)) + (0.0, -1.0, 0.0))
    assert touch.value(state)[0] > before + 0.5
    assert touch.value(state)[0] == touch.value(State(own.model).update(q))[0]
    assert pickle.loads(pickle.dumps(touch)).value(own.state(q))[0] == pytest.approx(touch.value(own.state(q))[0])


def test_sits_with_the_back_at_the_backrest(scene: wb.Scene) -> None:
    problem = wb.Problem(
        scene, goals=[wb.Sit("seat", "backrest")], constraints=[wb.Stand("floor", balance=False)], clearance=0.003
    )
    solution = wb.solve(problem)
    assert solution.status == "solved"
    touching = _touching(scene, solution.q)
    assert touching & {("pelvis", "seat"), ("left_thigh", "seat"), ("right_thigh", "seat")}
    assert any(other == "backrest" for _, other in touching)
    assert {("left_foot", "floor"), ("right_foot", "floor")} <= touching
    pelvis = scene.figure.placement(solution.q, "pelvis")
    assert SEAT + 0.06 < pelvis.translation[2] < SEAT + 0.16
    assert pelvis.rotation[0, 0] > 0.8  # looks forward
    assert solution.assessment.penetration < 1e-5


def _touching(scene: wb.Scene, q: Any) -> set[tuple[str, str]]:
    owners = scene.piece_owner
    return {(owners[a], owners[b]) for a, b in scene.contacts(q, within=2e-5).pair}


def test_both_palms_on_a_box_as_constraints(scene: wb.Scene) -> None:
    """As constraints they hold while a goal is reached for."""
    palms = [wb.Grasp("left", "box"), wb.Grasp("right", "box")]
    problem = wb.Problem(
        scene, goals=[wb.Axis("gaze", (1, 0, 0), toward=(0.45, 0, 0.92))], constraints=[*palms, wb.Stand("floor")]
    )
    solution = wb.solve(problem, wb.methods.QP(measures=False))
    assert solution.status == "solved"
    for side, sign in (("left", 1.0), ("right", -1.0)):
        palm = scene.figure.placement(solution.q, f"{side}_palm")
        np.testing.assert_allclose(palm.rotation[:, 2], (0.0, -sign, 0.0), atol=1e-4)
        assert 0.15 < sign * palm.translation[1] < 0.19  # on the face at 0.16
        assert abs(palm.translation[0] - 0.45) < 0.15
        assert abs(palm.translation[2] - 0.92) < 0.12
    assert {("left_hand", "box"), ("right_hand", "box")} <= _touching(scene, solution.q)


def test_a_hand_around_a_bar(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[wb.Grasp("right", "bar", "power")], constraints=[wb.Stand("floor")])
    solution = wb.solve(problem)
    assert solution.status == "solved"
    palm, bar = scene.figure.placement(solution.q, "right_palm"), scene.objects["bar"].placement
    along = palm.rotation.T @ bar.rotation[:, 2]
    assert along[2] == pytest.approx(0.0, abs=1e-6)
    assert np.cos(np.radians(20.0)) - 1e-6 < abs(along[1]) < 1.0 + 1e-6
    assert abs(bar.actInv(palm.translation)[2]) < 0.25


def test_who_stands_keeps_the_balance_where_the_feet_are() -> None:
    """The feet slide: the centre of mass is over the soles at the end, not over those of the start."""
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (1.5, -0.2, 0.9))], constraints=[wb.Stand("floor")])
    solution = wb.solve(problem)
    assert solution.status == "solved"
    heel = figure.placement(solution.q, "right_heel").translation
    tip = figure.placement(solution.q, "right_toe_tip").translation
    center = pin.centerOfMass(figure.model, figure.model.createData(), solution.q)
    assert heel[0] > 0.1
    assert min(heel[0], tip[0]) - 0.05 < center[0] < max(heel[0], tip[0]) + 0.05
    for side in ("left", "right"):
        sole = figure.placement(solution.q, f"{side}_sole")
        assert sole.rotation[2, 2] > 1.0 - 1e-8
        assert abs(sole.translation[2]) < 1e-5


def test_the_rest_of_the_problem_may_be_simplified(scene: wb.Scene) -> None:
    problem = wb.Problem(
        scene, goals=[wb.Touch("right_hand", "ball")], constraints=[wb.Grasp("left", "box"), wb.Stand("floor")]
    )
    answer = wb.solve(wb.simplify(problem).problem)
    assert wb.assess(problem, answer.q).met(1e-4)
    assert wb.assess(problem, answer.q).holds(1e-4)


@pytest.mark.parametrize("method", ["ccd", "placo"])
def test_other_methods_refuse_by_name(scene: wb.Scene, method: str) -> None:
    problem = wb.Problem(scene, goals=[wb.Touch("right_hand", "ball")])
    with pytest.raises(wb.InputError, match="Touch"):
        wb.solve(problem, method)


@pytest.mark.parametrize("height", [0.6, 0.02, 0.0, -0.05])
def test_grounded_puts_the_soles_on_the_floor(height: float) -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(offset=0.25), name="floor").add(wb.Box((0.1, 0.1, 2.0)), name="post",
                                                                             at=(0.4, 0.0, 1.0))  # fmt: skip
    q = figure.posture("standing")
    q[2] += 0.25 + height
    down = figure.grounded(q, scene)
    np.testing.assert_allclose(np.delete(down, 2), np.delete(q, 2))
    assert down[2] - q[2] == pytest.approx(-height, abs=1e-5)
    assert scene.contacts(down, 0.01).distance.min() == pytest.approx(0.0, abs=1e-5)


ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.3 0 0"/><geometry><box size="0.4 0.05 0.05"/></geometry></collision></link>
<link name="wrist">{wrist}</link><link name="hand">{hand}</link><link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="wrist"/><origin xyz="0.6 0 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="palm" type="fixed"><parent link="wrist"/><child link="hand"/><origin xyz="0.1 0 0"/></joint>
<joint name="tip" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0.2 0 0"/></joint></robot>"""
MASS = '<inertial><mass value="0.2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
COLLISION = '<collision><origin xyz="0.06 0 0"/><geometry><sphere radius="0.03"/></geometry></collision>'


@pytest.mark.parametrize(
    ("wrist", "hand", "part", "along", "radius"),
    [
        ("", COLLISION, "hand", 0.16, 0.03),
        (COLLISION, COLLISION.replace("collision", "visual") + MASS, "hand", 0.16, 0.03),
        (COLLISION, '<visual><geometry><cylinder radius="0.02" length="0.1"/></geometry></visual>', "hand", 0.1, 0.02),
        (COLLISION, MASS, "hand", 0.06, 0.03),
        (MASS, COLLISION, "wrist", 0.16, 0.03),
        (COLLISION, COLLISION, "tool", 0.3, 0.0),
    ],
    ids=["own pieces", "drawn", "drawn cylinder", "mass alone", "pieces of a fixed child", "bare frame"],
)
def test_a_link_at_a_fixed_joint_touches_with_its_surface(
    tmp_path: Any, wrist: str, hand: str, part: str, along: float, radius: float
) -> None:
    """By its pieces, by what is drawn of it, or by what moves with it; a frame without a body by its origin."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(wrist=wrist, hand=hand))
    figure = wb.load(path).reduced("shoulder")
    scene = wb.Scene(figure).add(wb.HalfSpace(offset=-0.4), name="table")
    found = wb.solve(wb.Problem(scene, goals=[wb.Touch(part, "table")]))
    assert found.status == "solved", found.message
    center = figure.placement(found.q, "wrist").act(np.array((along, 0.0, 0.0)))
    lowest = radius if "cylinder" not in hand else _cylinder(figure.placement(found.q, "hand"), 0.02, 0.05)
    assert center[2] - lowest == pytest.approx(-0.4, abs=2e-4)


def _cylinder(place: pin.SE3, radius: float, half: float) -> float:
    """How far a cylinder reaches below its middle."""
    tilt = abs(float(place.rotation[2, 2]))
    return half * tilt + radius * float(np.sqrt(1.0 - tilt**2))


def test_who_stands_keeps_the_margin_of_people() -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    goals = [wb.Point("right_index_tip", (0.2, -0.2, 2.05))]
    found = {
        margin: wb.solve(wb.Problem(scene, "standing", goals=goals, constraints=[wb.Stand("floor", margin=margin)]))
        for margin in (None, 0.0)
    }
    assert all(one.solved for one in found.values())
    stand = wb.Stand("floor").resolve(scene, figure.posture("standing"))
    # 0.15 of the soles from heel to ball: 201 mm in men of ANSUR II. The toes do not carry in `Stand`.
    assert stand.keeps == pytest.approx(0.15 * 0.201, abs=0.001)
    inside = stand.value(scene.state(found[None].q))[stand.lower > 0.0]
    assert inside.min() >= stand.keeps - 1e-4


@pytest.mark.parametrize("knees", ["left_foot", None, 3, ["left_shank"], ["left_shank", "left_foot"], [["a"]]], ids=str)
def test_knees_that_are_no_feet_are_refused(knees: Any) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    with pytest.raises(
        wb.InputError, match=r"knees (is .*, not a list|are of the feet, and (left_shank|\['a'\]) is not)"
    ):
        wb.Problem(scene, constraints=[wb.Stand("floor", knees=knees)])


@pytest.mark.parametrize("percentile", [5, 95])
def test_who_kneels_on_one_knee_has_the_thigh_level_and_the_trunk_upright_from_any_start(percentile: int) -> None:
    # The ankle of a small woman who stands is as near to the floor as a knee that is thick.
    woman = wb.load("human", sex="female", percentile=percentile)
    scene = wb.Scene(woman).add(wb.HalfSpace(), name="floor")
    kneels = wb.Stand("floor", feet=["left_foot", "right_shank"], knees=["right_shank"])
    for start in ("standing", "kneeling"):
        solution = wb.solve(wb.Problem(scene, start, constraints=[kneels]))
        assert solution.solved
        hip, knee = (woman.placement(solution.q, f"left_{name}").translation for name in ("hip", "knee"))
        assert abs(hip[2] - knee[2]) < 0.06
        assert woman.placement(solution.q, "thorax").rotation[2, 2] > np.cos(np.radians(15.0))


def test_a_foot_stands_on_a_rung_with_the_middle_of_its_sole() -> None:
    person, level = wb.load("human", sex="female"), (0.5**0.5, 0.0, 0.0, 0.5**0.5)
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Cylinder(0.015, 0.5), name="rung", at=(0.3, -0.1, 0.3, *level))
    stands = [wb.Stand("floor", feet=["left_foot"]), wb.Stand("rung", feet=["right_foot"], balance=False)]
    solution = wb.solve(wb.Problem(scene, constraints=stands))
    assert solution.solved
    heel, ball = (person.placement(solution.q, f"right_{end}").translation for end in ("heel", "ball"))
    # On the rung and not under it, within the 7 mm of its face in front of and behind its middle.
    assert 0.5 * (heel + ball)[2] == pytest.approx(0.315, abs=1e-4)
    assert abs(0.5 * (heel + ball)[0] - 0.3) < 0.0072
    # People stand 203 mm apart, with a standard deviation of 46 (Applied Sciences 2025, 15(10):5417).
    left, right = (person.placement(solution.q, f"{side}_foot").translation for side in ("left", "right"))
    assert left[1] - right[1] < 0.203 + 2.0 * 0.046


def test_a_person_kneels_in_balance() -> None:
    shanks = ("left_shank", "right_shank")
    person = wb.load("human")
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    goals = [wb.Point("right_index_tip", (0.5, -0.1, 0.3))]
    kneels = wb.Stand("floor", feet=shanks, knees=shanks)
    solution = wb.solve(wb.Problem(scene, "standing", goals=goals, constraints=[kneels]))
    assert solution.solved
    center = pin.centerOfMass(person.model, person.model.createData(), solution.q)
    knees, toes = (
        [person.placement(solution.q, f"{side}_{end}").translation for side in ("left", "right")]
        for end in ("knee", "toe_tip")
    )
    # The joint of a knee on the floor is as high as the knee is thick; the body is over shins and feet.
    assert all(0.04 < knee[2] < 0.08 for knee in knees)
    assert all(abs(toe[2]) < 0.05 for toe in toes)
    assert min(toe[0] for toe in toes) < center[0] < max(knee[0] for knee in knees) + 0.06

"""The person's sizes against ANSUR II, and the postures in which its flesh meets itself and things."""

import math
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.measuring import measure
from wholebody.figures import load
from wholebody.figures.anthropometry import design_cases, dimension_names, make_person

CASES = tuple(design_cases())


@cache
def person(case="M50", detail="capsules"):
    who = design_cases()[case]
    return load("human", sex=who.sex, stature=who.stature, mass=who.mass, detail=detail)


BUILDS = (*({"sex": who.sex, "stature": who.stature, "mass": who.mass} for who in design_cases().values()),
          {"stature": 1.88, "mass": 64.0}, {"stature": 1.65, "mass": 110.0},
          {"sex": "female", "stature": 1.74, "mass": 51.0}, {"sex": "female", "stature": 1.53, "mass": 87.0},
          *list(wb.people(6).values()))  # fmt: skip


@pytest.mark.parametrize("build", BUILDS[::2], ids=range(len(BUILDS[::2])))
def test_the_body_has_every_dimension(build):
    figure = load("human", **build)
    found, wanted = measure(figure), dict(figure.describe().person.dimensions)
    assert set(found) == set(wanted) == set(dimension_names())
    off = {name: round(1e3 * (found[name] - wanted[name]), 1) for name in wanted}
    # One circumference is that of a round piece, the others are lengths.
    assert {name: far for name, far in off.items() if abs(far) > 3.0} == {}


def test_given_stature_and_mass_dimensions_are_not_of_the_same_percentile():
    # Of 4082 men of ANSUR II: regression on both, at the 95th percentile of stature and the 5th of mass.
    found = measure(load("human", stature=1.87, mass=64.4))
    assert found["bideltoid_breadth"] == pytest.approx(0.4535, abs=0.010)
    assert found["buttock_knee_length"] == pytest.approx(0.630, abs=0.010)


def test_inertia_of_the_female_thigh_belongs_to_its_sources_segment():
    # de Leva 1996: length 0.2124 of the stature, centre of mass 36.12 % from the hip, gyration 36.9 %.
    who = make_person("female", 1.626, 66.8)
    assert who.center_of_mass("left_thigh")[2] == pytest.approx(-0.361 * 0.2124 * 1.626, rel=1e-9)
    moment = who.segment_mass("left_thigh") * (0.369 * 0.2124 * 1.626) ** 2
    assert who.inertia("left_thigh")[0] == pytest.approx(moment, rel=1e-9)


def seated(case):
    """A person with right angles at hips and knees, and where frames and pieces are."""
    figure = person(case)
    data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
    names = ("left_hip_flexion", "right_hip_flexion", "left_knee_flexion", "right_knee_flexion")
    q = figure.with_joints(pin.neutral(figure.model), dict.fromkeys(names, math.pi / 2))
    pin.framesForwardKinematics(figure.model, data, q)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data)
    return figure, data, geometry_data


@pytest.mark.parametrize("case", CASES)
def test_thighs_and_buttocks_are_level_on_a_seat(case):
    figure, _, geometry_data = seated(case)
    lowest = {}
    for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True):
        if piece.name in ("pelvis", "left_thigh:0", "right_thigh:0"):
            half = abs(placement.rotation[2, 2]) * piece.geometry.halfLength
            lowest[piece.name] = placement.translation[2] - piece.geometry.radius - half
    assert np.ptp(list(lowest.values())) < 1e-9


@pytest.mark.parametrize("case", CASES)
def test_the_thigh_lies_on_the_seat_up_to_its_front_edge(case):
    """Popliteal height is that of the thigh's underside at the knee: a seat that is higher presses there."""
    figure, data, geometry_data = seated(case)
    sole, knee = (data.oMf[figure.frame_id(f"left_{name}")].translation for name in ("sole", "knee"))
    gap = math.inf
    for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True):
        if piece.name.startswith("left_thigh"):
            shape = piece.geometry
            line = np.linspace(-1.0, 1.0, 300)[:, None] * shape.halfLength * placement.rotation[:, 2]
            balls = line + placement.translation
            gap = min(gap, (balls[balls[:, 0] > knee[0] - 0.13][:, 2] - shape.radius).min(initial=math.inf) - sole[2])
    assert gap == pytest.approx(measure(figure)["popliteal_height"], abs=0.003)


@pytest.mark.parametrize("build", BUILDS[1::3], ids=range(len(BUILDS[1::3])))
def test_a_seat_may_be_as_deep_as_buttock_popliteal_length(build):
    """ANSUR II measures it in the seat's plane, from the buttocks to the back of the knee; the calf bulges below."""
    figure = load("human", **build)
    joints = ("left_hip_flexion", "right_hip_flexion", "left_knee_flexion", "right_knee_flexion")
    q = figure.with_joints(pin.neutral(figure.model), dict.fromkeys(joints, math.pi / 2))
    found = measure(figure)
    placed = pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, figure.model.createData(), figure.geometry, placed, q)
    ends = {"pelvis": [], "shank": []}  # balls at the ends of the capsules
    for piece, at in zip(figure.geometry.geometryObjects, placed.oMg, strict=True):
        segment = piece.name.partition(":")[0].removeprefix("left_")
        if segment in ends:
            shape = piece.geometry
            line = np.linspace(-shape.halfLength, shape.halfLength, 300)[:, None] * at.rotation[:, 2] + at.translation
            ends[segment].append((line, shape.radius))
    ((pelvis, rear),) = ends["pelvis"]
    back, seat = pelvis[:, 0].min() - rear, pelvis[:, 2].min() - rear
    for below, least, most in ((0.02, -0.01, 0.02), (0.03, -0.015, 0.001), (0.04, -0.022, 0.0)):
        behind = []  # of the shank at some height below the seat
        for line, radius in ends["shank"]:
            high = line[:, 2] - seat + below
            inside = abs(high) < radius
            behind += list(line[inside, 0] - np.sqrt(radius**2 - high[inside] ** 2))
        beyond = min(behind) - back - found["buttock_popliteal_length"]
        assert least <= beyond <= most, (below, beyond)


def test_calf_and_thigh_give_way_by_what_flesh_does():
    # The pair moves with the knee alone, so its limit stands for it: there they touch, and overlap by at most 40 mm.
    import coal

    short, tall, light, heavy = (make_person(percentile=one) for one in (5, 95, 5, 95))
    stout = load("human", stature=short.stature, mass=heavy.mass), load("human", stature=tall.stature, mass=heavy.mass)
    for figure in (*map(person, CASES), *stout, load("human", stature=tall.stature, mass=light.mass)):
        case = figure.describe().person
        data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
        most = figure.model.upperPositionLimit[figure.model.joints[figure.joint_id("left_knee_flexion")].idx_q]
        q = figure.with_joints(pin.neutral(figure.model), {"left_knee_flexion": most})
        pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data, q)
        thigh, calf = (figure.geometry.getGeometryId(name) for name in ("left_thigh:0", "left_shank:0"))
        pieces = figure.geometry.geometryObjects
        here, there = (
            coal.Transform3s(geometry_data.oMg[k].rotation, geometry_data.oMg[k].translation) for k in (thigh, calf)
        )
        depth = -coal.distance(
            pieces[thigh].geometry, here, pieces[calf].geometry, there, coal.DistanceRequest(), coal.DistanceResult()
        )
        assert 0.0 < depth < 0.040, case


@pytest.mark.parametrize("detail", ["capsules", "hulls"])
def test_shoes_lift_and_clothing_surrounds(detail):
    # 30 mm of sole, 10 mm of cloth: all around for a girth, on both sides for a breadth, once under who sits.
    bare, dressed = (measure(load("human", sex="female", detail=detail, **worn))
                     for worn in ({}, {"shoes": 0.03, "clothing": 0.01}))  # fmt: skip
    more = {name: round(1e3 * (dressed[name] - bare[name]), 6) for name in bare}
    wanted = {
        "hip_breadth": 20.0, "hip_breadth_sitting": 20.0, "waist_depth": 20.0, "chest_breadth": 20.0,
        "bideltoid_breadth": 20.0, "thigh_clearance": 20.0, "buttock_knee_length": 20.0,
        "sitting_height": 10.0, "popliteal_height": 30.0 - 10.0, "acromial_height": 30.0 + 10.0, "wrist_height": 30.0,
        "span": 0.0, "hand_breadth": 0.0, "head_length": 0.0, "foot_length": 0.0,
    } | ({"calf_circumference": 20.0 * math.pi} if detail == "capsules" else {})  # fmt: skip
    assert {name: more[name] for name in wanted} == pytest.approx(wanted, abs=1.0 if detail == "hulls" else 1e-6)


def test_who_wears_shoes_stands_and_sees_higher_by_their_soles():
    for detail in ("capsules", "hulls", "spheres"):
        bare, shod = (load("human", percentile=5, detail=detail, shoes=sole) for sole in (0.0, 0.04))
        eyes = [figure.placement(figure.posture("standing"), "gaze").translation[2] for figure in (bare, shod)]
        assert eyes[1] - eyes[0] == pytest.approx(0.04, abs=1e-6)
        tips = [shod.placement(shod.posture("standing"), f"left_{name}").translation[2] for name in ("heel", "toe_tip")]
        assert tips == pytest.approx([0.0, 0.0], abs=1e-6)
    with pytest.raises(wb.InputError, match=r"shoes is 30; .*0.03"):
        load("human", shoes=30)


@pytest.mark.parametrize("case", CASES)
def test_a_percentile_is_a_design_case(case):
    who = design_cases()[case]
    made = make_person(who.sex, percentile=int(case[1:]))
    assert (made.stature, made.mass) == pytest.approx((who.stature, who.mass), rel=1e-3)
    assert make_person(who.sex, stature=1.7, percentile=50).stature == 1.7


def test_percentiles_in_between_follow_the_normal_deviate():
    # Statures are nearly normal: mean 175.62 cm, standard deviation 6.86 cm (4082 men of ANSUR II).
    for percentile, deviate in ((10, -1.2816), (40, -0.2533), (90, 1.2816)):
        assert make_person(percentile=percentile).stature == pytest.approx(1.7562 + 0.0686 * deviate, abs=0.006)


# ---- feet, and the 39 spheres


@pytest.mark.parametrize("case", CASES)
def test_feet_are_as_long_and_broad_as_those_of_ansur(case):
    figure, who = person(case), design_cases()[case]
    pieces = {piece.name: piece for piece in figure.geometry.geometryObjects}
    foot, toes = pieces["left_foot"].geometry, pieces["left_toes"].geometry
    length = 2.0 * float(foot.halfSide[0] + toes.halfSide[0])
    assert length == pytest.approx(dict(who.dimensions)["foot_length"], abs=1e-9)
    if who.sex == "male":
        # Regression of foot breadth on stature of 60 men of ANSUR II: 101.9 mm at 1.755 m.
        assert 2.0 * float(foot.halfSide[1]) == pytest.approx(0.1019 * who.stature / 1.755, abs=0.004)


def _placed(figure):
    geometry_data = pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(
        figure.model, figure.model.createData(), figure.geometry, geometry_data, pin.neutral(figure.model)
    )
    return [
        (
            piece.name.partition(":")[0],
            piece.geometry,
            np.asarray(placement.rotation),
            np.asarray(placement.translation),
        )
        for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True)
        if not piece.name.endswith("_thigh:3") or figure.detail == "spheres"  # flesh that things meet alone
    ]


def _outside(geometry, rotation, translation, points):
    """Signed distance of points from a sphere, a capsule or a box."""
    local = (points - translation) @ rotation
    kind = type(geometry).__name__
    if kind == "Box":
        beyond = np.abs(local) - np.asarray(geometry.halfSide)
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    if kind == "Capsule":
        local[:, 2] -= np.clip(local[:, 2], -geometry.halfLength, geometry.halfLength)
    return np.linalg.norm(local, axis=1) - geometry.radius


@pytest.mark.parametrize("case", ["F50"])
def test_spheres_cover_the_pieces_as_far_as_the_page_says(case):
    pieces, spheres = _placed(person(case)), _placed(person(case, "spheres"))
    rng = np.random.default_rng(0)
    volume = bare = deepest = 0.0
    for segment in sorted({segment for segment, *_ in pieces}):
        own = [piece[1:] for piece in pieces if piece[0] == segment]
        center = np.mean([placement for *_, placement in own], axis=0)
        points = center + rng.uniform(-0.35, 0.35, (40_000, 3))
        points = points[np.min([_outside(*piece, points) for piece in own], axis=0) < 0.0]
        depth = np.min([_outside(*sphere[1:], points) for sphere in spheres], axis=0)
        volume, bare, deepest = volume + len(points), bare + np.sum(depth > 0.0), max(deepest, depth.max())
    assert bare / volume < 0.15
    assert deepest < 0.053
    sides = rng.normal(size=(2000, 3))
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    out = [
        np.min([_outside(*piece[1:], at + ball.radius * sides) for piece in pieces], axis=0).max()
        for _, ball, _, at in spheres
    ]
    assert max(out) < 0.035


@pytest.mark.parametrize(
    ("detail", "who"),
    [("capsules", {"sex": "female"}), ("hulls", {"stature": 1.65, "mass": 110.0}), ("spheres", {"sex": "male"})],
)
def test_named_postures_of_who_is_dressed_are_free(who, detail):
    scene = wb.Scene(load("human", clothing=0.03, detail=detail, **who))
    for name in scene.figure.postures:
        q = scene.figure.posture(name)
        assert len(scene.contacts(q, within=0.0).pair) == 0, name
        if name in ("squatting", "sitting"):
            assert scene.figure.placement(q, "left_sole").rotation[2, 2] > 0.9, name
    assert not scene.figure.notes
    assert "overlap" in load("human", clothing=0.05, **who).notes[0]


@pytest.mark.parametrize("build", [
    {"stature": 1.75, "mass": 84.0}, {"stature": 1.72, "mass": 122.0}, {"stature": 1.75, "mass": 140.0},
    {"stature": 1.72, "mass": 122.0, "clothing": 0.005}, {"sex": "female", "stature": 1.60, "mass": 105.0},
    {"sex": "female", "stature": 1.70, "mass": 62.0, "proportions": {"thigh_clearance": 0.185}},
], ids=range(6))  # fmt: skip
def test_who_sits_as_measured_does_not_meet_the_own_belly(build):
    # Everybody of ANSUR II was measured sitting erect with level, parallel thighs, whatever the belly.
    figure = load("human", **build)
    flexed = {f"{side}_hip_flexion": 90.0 for side in ("left", "right")}

    def met(more):
        """Pairs of trunk and thighs that penetrate, as coal says, with the hips bent further by so many degrees."""
        angles = {name: math.radians(angle + more) for name, angle in flexed.items()}
        data = pin.GeometryData(figure.geometry)
        q = figure.with_joints(pin.neutral(figure.model), angles)
        pin.updateGeometryPlacements(figure.model, figure.model.createData(), figure.geometry, data, q)
        parts = [piece.name.partition(":")[0] for piece in figure.geometry.geometryObjects]
        soft = ("lumbar", "thorax", "pelvis", "thigh")
        return {
            (parts[pair.first], parts[pair.second])
            for k, pair in enumerate(figure.geometry.collisionPairs)
            if parts[pair.first].endswith(soft) and parts[pair.second].endswith(soft)
            and pin.computeDistance(figure.geometry, data, k).min_distance < 0.0
        }  # fmt: skip

    assert met(0.0) == set()
    if build["mass"] > 100.0:
        assert ("upper_lumbar", "left_thigh") in met(15.0)


def test_what_differs_from_the_usual_is_printed():
    figure = load("human", sex="female", age=60, shoes=0.03, clothing=0.01)
    assert "age=60, shoes=0.03, clothing=0.01" in repr(figure)
    assert repr(figure.describe().person).endswith("age=60.0, shoes=0.03, clothing=0.01)")
    assert repr(make_person()) == "Person('male', stature=1.755, mass=84.6)"
    assert "sitting_height" in repr(make_person(proportions={"sitting_height": 0.93}))

"""The person against what is known of people, and against mechanics."""

import math
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.audits.packaged import packaged_files
from wholebody.base.errors import InputError
from wholebody.figures import load, urdf_path
from wholebody.figures.anthropometry import design_cases, make_person
from wholebody.figures.tables import table

CASES = tuple(design_cases())
DETAILS = ("spheres", "capsules", "hulls")


@cache
def person(case="M50", detail="capsules"):
    who = design_cases()[case]
    return load("human", sex=who.sex, stature=who.stature, mass=who.mass, detail=detail)


def frames(figure, q):
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return {frame.name: data.oMf[index] for index, frame in enumerate(figure.model.frames)}


def arms_down(figure):
    return figure.with_joints(figure.posture("standing"), dict.fromkeys(figure.joints, 0.0))


def test_has_fifty_five_degrees_of_freedom_in_its_groups():
    figure = person()
    assert (figure.model.nq, figure.model.nv, len(figure.joints)) == (56, 55, 49)
    assert [
        len(figure.groups[name]) for name in ("spine", "neck", "left_arm", "right_arm", "left_leg", "right_leg")
    ] == [
        12,
        5,
        9,
        9,
        7,
        7,
    ]
    assert set(figure.groups["upper_body"]) == {name for name in figure.joints if name in figure.groups["spine"]} | set(
        figure.groups["arms"]
    )


@pytest.mark.parametrize("case", CASES)
def test_mass_adds_up_and_inertias_are_of_bodies(case):
    figure, who = person(case), design_cases()[case]
    assert pin.computeTotalMass(figure.model) == pytest.approx(who.mass, abs=1e-8)
    for inertia in list(figure.model.inertias)[1:]:
        if inertia.mass:
            a, b, c = np.sort(np.linalg.eigvalsh(inertia.inertia))
            assert a > 0
            assert a + b >= c * (1 - 1e-9)


@pytest.mark.parametrize(("case", "fraction"), [("M50", 0.5517), ("F50", 0.5507)])
def test_center_of_mass_is_as_high_as_peoples(case, fraction):
    # 0.55 to 0.57 of the stature in the literature on standing people (for example Winter 2009).
    figure = person(case)
    center = pin.centerOfMass(figure.model, figure.model.createData(), arms_down(figure))
    assert center[2] / design_cases()[case].stature == pytest.approx(fraction, abs=0.002)
    assert abs(center[1]) < 1e-9


@pytest.mark.parametrize(("case", "measured"), [("M50", 0.4825), ("F50", 0.488)])
def test_wrist_hangs_where_it_was_measured(case, measured):
    # Wrist height of ANSUR II: not an input of the tables, so an independent check of all lengths above it.
    figure = person(case)
    height = frames(figure, arms_down(figure))["left_wrist"].translation[2]
    assert height / design_cases()[case].stature == pytest.approx(measured, abs=0.003)


@pytest.mark.parametrize("case", CASES)
def test_stands_on_the_ground_at_its_stature(case):
    figure = person(case)
    q = figure.posture("standing")
    at = frames(figure, q)
    for name in ("left_heel", "right_heel", "left_ball", "right_ball", "left_toe_tip", "right_toe_tip"):
        assert at[name].translation[2] == pytest.approx(0.0, abs=1e-6)
    assert at["head_top"].translation[2] == pytest.approx(design_cases()[case].stature, abs=1e-6)
    assert q[:2] == pytest.approx([0.0, 0.0])
    assert at["gaze"].rotation[:, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("case", "detail"), [(c, d) for c in CASES for d in DETAILS if d == "capsules" or c == "M95"])
def test_every_posture_is_free_and_within_limits(case, detail):
    figure = person(case, detail)
    data, geometry = figure.model.createData(), figure.geometry
    geometry_data = pin.GeometryData(geometry)
    for name in figure.postures:
        q = figure.posture(name)
        assert figure.within_limits(q, 0.0), name
        pin.updateGeometryPlacements(figure.model, data, geometry, geometry_data, q)
        pin.computeDistances(geometry, geometry_data)
        gap = min(result.min_distance for result in geometry_data.distanceResults)
        assert gap >= 0.004, f"{name}: {gap}"
        at = frames(figure, q)
        for cone in figure.cones.values():
            direction = at[cone.reference].rotation.T @ at[cone.limb].rotation @ cone.axis
            assert cone.cone.contains(direction), name


def test_lying_postures_face_the_right_way():
    figure = person()
    assert frames(figure, figure.posture("prone"))["gaze"].rotation[:, 0] == pytest.approx([0, 0, -1], abs=1e-9)
    assert frames(figure, figure.posture("supine"))["gaze"].rotation[:, 0] == pytest.approx([0, 0, 1], abs=1e-9)


def test_sitting_has_horizontal_thighs_and_soles_on_the_ground():
    figure = person()
    at = frames(figure, figure.posture("sitting"))
    assert at["left_knee"].translation[2] == pytest.approx(at["left_hip"].translation[2], abs=1e-9)
    assert at["left_heel"].translation[2] == pytest.approx(0.0, abs=1e-6)


def test_squat_is_balanced():
    figure = person()
    q = figure.posture("squatting")
    at = frames(figure, q)
    x = pin.centerOfMass(figure.model, figure.model.createData(), q)[0]
    assert at["left_heel"].translation[0] < x < at["left_toe_tip"].translation[0]


@settings(max_examples=6)
@given(
    sex=st.sampled_from(["male", "female"]),
    stature=st.floats(1.45, 2.05),
    index=st.floats(15.0, 40.0),
    detail=st.sampled_from(DETAILS),
)
def test_any_build_stands_free(sex, stature, index, detail):
    figure = load("human", sex=sex, stature=stature, mass=index * stature**2, detail=detail)
    data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
    for name in ("standing", "sitting", "t_pose"):
        q = figure.posture(name)
        assert figure.within_limits(q)
        assert not pin.computeCollisions(figure.model, data, figure.geometry, geometry_data, q, True)


def mirrored(figure, q):
    """The posture of the mirror image: sides exchanged, and what turns about x or z in the middle negated."""
    values = figure.joint_values(q)
    middle = {name: -1.0 if name.endswith(("_lateral", "_rotation")) else 1.0 for name in values}
    exchanged = {}
    for name, value in values.items():
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            exchanged[f"{'right' if side == 'left' else 'left'}_{rest}"] = value
        else:
            exchanged[name] = middle[name] * value
    image = figure.with_joints(q, exchanged)
    image[1] *= -1.0
    image[3], image[5] = -q[3], -q[5]
    return image


def test_mirrored_posture_gives_mirrored_frames_and_pieces():
    figure, rng = person(), np.random.default_rng(3)
    flip = np.diag([1.0, -1.0, 1.0])
    for _ in range(10):
        low, high = figure.limits.lower, figure.limits.upper
        q = pin.integrate(figure.model, figure.neutral, np.r_[rng.normal(size=6), np.zeros(49)])
        q[figure.limits.idx_q] = rng.uniform(low, high)
        here, there = frames(figure, q), frames(figure, mirrored(figure, q))
        for name in (*figure.frames, *figure.segments):
            side, _, rest = name.partition("_")
            other = {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)
            assert there[other].translation == pytest.approx(flip @ here[name].translation, abs=1e-10)
        palm = here["left_palm"].rotation
        assert there["right_palm"].rotation[:, 2] == pytest.approx(flip @ palm[:, 2], abs=1e-10)
        assert there["right_palm"].rotation[:, 0] == pytest.approx(flip @ palm[:, 0], abs=1e-10)


@pytest.mark.parametrize(
    ("joint", "frame", "direction"),
    [
        ("left_shoulder_flexion", "left_elbow", (1, 0, 0)),
        ("left_shoulder_abduction", "left_elbow", (0, 1, 0)),
        ("right_shoulder_abduction", "right_elbow", (0, -1, 0)),
        ("left_elbow_flexion", "left_wrist", (1, 0, 0)),
        ("left_wrist_flexion", "left_index_tip", (0, -1, 0)),
        ("left_clavicle_elevation", "left_shoulder", (0, 0, 1)),
        ("left_clavicle_protraction", "left_shoulder", (1, 0, 0)),
        ("right_clavicle_protraction", "right_shoulder", (1, 0, 0)),
        ("right_hip_flexion", "right_knee", (1, 0, 0)),
        ("right_hip_abduction", "right_knee", (0, -1, 0)),
        ("right_knee_flexion", "right_ankle", (-1, 0, 0)),
        ("left_ankle_dorsiflexion", "left_ball", (0, 0, 1)),
        ("left_toe_extension", "left_toe_tip", (0, 0, 1)),
        ("spine2_flexion", "head_top", (1, 0, 0)),
        ("spine3_lateral", "head_top", (0, -1, 0)),
        ("neck2_rotation", "gaze", (0, 1, 0)),
    ],
)
def test_joints_move_as_anatomy_says(joint, frame, direction):
    figure = person()
    q = arms_down(figure)
    before = frames(figure, q)[frame].translation
    moved = frames(figure, figure.with_joints(q, {joint: 0.1}))[frame].translation - before
    assert moved @ np.array(direction) > 0.7 * np.linalg.norm(moved) > 0.0


def test_palm_has_its_axes():
    # Hanging hands: fingers down, palms towards the thighs; the palm lies on the hand's surface.
    figure = person()
    at = frames(figure, arms_down(figure))
    for side, inwards in (("left", -1.0), ("right", 1.0)):
        palm = at[f"{side}_palm"]
        assert palm.rotation[:, 0] == pytest.approx([0, 0, -1], abs=1e-9)
        assert palm.rotation[:, 2] == pytest.approx([0, inwards, 0], abs=1e-9)


@pytest.mark.parametrize("detail", ["capsules", "hulls"])
@pytest.mark.parametrize(
    "name",
    ["left_index_tip", "right_index_tip", "left_palm", "right_palm", "left_heel", "right_toe_tip", "head_top", "gaze"],
)
def test_what_people_reach_with_lies_on_the_skin(detail, name):
    import coal

    figure = person("F95", detail)
    q = figure.posture("a_pose")
    data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data, q)
    at = frames(figure, q)[name]
    probe, joint = coal.Sphere(1e-6), figure.model.frames[figure.frame_id(name)].parentJoint
    distances = []
    for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True):
        if piece.parentJoint == joint:
            result = coal.DistanceResult()
            here = coal.Transform3s(np.eye(3), at.translation)
            there = coal.Transform3s(placement.rotation, placement.translation)
            distances.append(coal.distance(probe, here, piece.geometry, there, coal.DistanceRequest(), result))
    # The face is a facet of a polyhedron in "hulls", up to 4 mm inside the round head that `gaze` lies on.
    assert abs(min(distances)) < (5e-3 if name == "gaze" else 1e-5)


CONTACTS = [
    ("hand on thigh", {"shoulder_abduction": -2, "elbow_flexion": 15}, ("left_hand", "left_thigh")),
    (
        "forearm on belly",
        {"shoulder_rotation": 70, "elbow_flexion": 95, "shoulder_abduction": 8},
        ("left_forearm", "upper_lumbar"),
    ),
    ("elbow to waist", {"shoulder_abduction": -8, "elbow_flexion": 30}, ("left_upper_arm", "upper_lumbar")),
    ("thighs crossed", {"hip_abduction": -18}, ("left_thigh", "right_thigh")),
    ("shanks together", {"hip_abduction": -12}, ("left_shank", "right_shank")),
    ("hand to head", {"shoulder_flexion": 120, "elbow_flexion": 140, "shoulder_rotation": 40}, ("left_hand", "head")),
]


SHRUG = {"clavicle_elevation": 40, "neck1_lateral": -45, "neck2_flexion": 10, "spine4_lateral": -11}
CONTACTS += [
    ("ear to shoulder", SHRUG, ("head", "left_upper_arm")),
    ("ear to arm", {**SHRUG, "shoulder_abduction": 120, "clavicle_elevation": 40}, ("head", "left_upper_arm")),
]


@pytest.mark.parametrize(("what", "degrees", "pair"), CONTACTS, ids=[contact[0] for contact in CONTACTS])
@pytest.mark.parametrize("detail", ["capsules", "hulls"])
def test_real_self_contact_is_caught(what, degrees, pair, detail):
    figure = person("M50", detail)
    values = {
        joint: math.radians(value)
        for name, value in degrees.items()
        for joint in (name, f"left_{name}", f"right_{name}")
        if joint in figure.joints
    }
    q = figure.with_joints(figure.posture("standing"), values)
    assert figure.within_limits(q)
    geometry, geometry_data = figure.geometry, pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, figure.model.createData(), geometry, geometry_data, q)
    pin.computeDistances(geometry, geometry_data)
    distance = {}
    for k, entry in enumerate(geometry.collisionPairs):
        names = frozenset(geometry.geometryObjects[i].name.partition(":")[0] for i in (entry.first, entry.second))
        distance[names] = min(distance.get(names, 1.0), geometry_data.distanceResults[k].min_distance)
    assert distance[frozenset(pair)] < 0.0, what


@pytest.mark.parametrize("detail", ["capsules", "hulls"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_index_finger_leads_the_hand(side, detail):
    # A wall that the tip touches square on is touched by nothing else of the hand.
    figure = person("M50", detail)
    tip = figure.model.frames[figure.frame_id(f"{side}_index_tip")]
    for piece in figure.geometry.geometryObjects:
        if piece.name.startswith(f"{side}_hand"):
            across = tip.placement.inverse() * piece.placement
            shape = piece.geometry
            if detail == "hulls":
                reach = (np.array(shape.points()) @ across.rotation[0]).max()
            elif type(shape).__name__ == "Box":
                reach = np.abs(across.rotation[0]) @ shape.halfSide
            else:
                reach = shape.radius + abs(across.rotation[0, 2]) * shape.halfLength
            assert across.translation[0] + reach < 1e-9


def test_spheres_are_the_thirty_nine_across_five_groups():
    figure = person("M50", "spheres")
    assert figure.geometry.ngeoms == 39
    assert len(figure.geometry.collisionPairs) == 567
    group = [figure.collision_groups[piece.name.partition(":")[0]] for piece in figure.geometry.geometryObjects]
    assert {name: group.count(name) for name in set(group)} == {
        "torso_head": 11,
        "left_arm": 7,
        "right_arm": 7,
        "left_leg": 7,
        "right_leg": 7,
    }
    assert all(group[pair.first] != group[pair.second] for pair in figure.geometry.collisionPairs)


@pytest.mark.parametrize("detail", DETAILS)
def test_every_pair_is_tested_or_excluded_with_a_reason(detail):
    figure = person("M50", detail)
    pieces = [piece.name for piece in figure.geometry.geometryObjects]
    tested = {frozenset((pieces[pair.first], pieces[pair.second])) for pair in figure.geometry.collisionPairs}
    excluded = {frozenset((entry.a, entry.b)) for entry in figure.excluded_pairs}
    assert not tested & excluded
    assert len(tested) + len(excluded) == len(pieces) * (len(pieces) - 1) // 2
    assert all(entry.reason for entry in figure.excluded_pairs)


@pytest.mark.parametrize(("angle", "mean"), [("flexion", 20.0), ("lateral", 105.0), ("rotation", 10.0)])
def test_levels_of_the_spine_share_a_motion_as_their_ranges_do(angle: str, mean: float):
    figure = person()
    rows = {row["name"]: row for row in table("joints")}
    ranges = np.array([float(rows[f"spine{level}_{angle}"]["upper_deg"]) for level in range(1, 5)])
    weights = np.array([figure.effort_weights[figure.dofs([f"spine{level}_{angle}"])][0] for level in range(1, 5)])
    # Least weighted squares that add up to something are shared as 1 / weight. People who lift lose less of their
    # lordosis than that (von Arx et al. 2021): flexion of the three lumbar levels weighs four times as much.
    stiff = np.array([4.0, 4.0, 4.0, 1.0]) if angle == "flexion" else 1.0
    np.testing.assert_allclose(weights, stiff * mean * ranges.mean() / ranges, rtol=0.03)


def test_packaged_files_are_the_builders_output():
    folder = urdf_path("human").parent
    for name, text in packaged_files().items():
        assert (folder / name).read_text(encoding="utf-8") == text, f"{name} is stale: python -m tests.audits.packaged"


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_packaged_urdf_is_the_figure(name):
    built, read = load(name), load(urdf_path(name), root="free")
    assert list(built.model.names) == list(read.model.names)
    q = built.posture(built.postures[0])
    for a, b in zip(built.model.jointPlacements, read.model.jointPlacements, strict=True):
        assert a.homogeneous == pytest.approx(b.homogeneous, abs=1e-12)
    for a, b in zip(built.model.inertias, read.model.inertias, strict=True):
        assert a.toPseudoInertia().toMatrix() == pytest.approx(b.toPseudoInertia().toMatrix(), abs=1e-12)
    ours, theirs = built.geometry, read.geometry
    assert ours.ngeoms == theirs.ngeoms
    ours_data, theirs_data = pin.GeometryData(ours), pin.GeometryData(theirs)
    pin.updateGeometryPlacements(built.model, built.model.createData(), ours, ours_data, q)
    pin.updateGeometryPlacements(read.model, read.model.createData(), theirs, theirs_data, q)
    order = {
        model.frames[piece.parentFrame].name: [] for model, piece in [(read.model, p) for p in theirs.geometryObjects]
    }
    for index, piece in enumerate(theirs.geometryObjects):
        order[read.model.frames[piece.parentFrame].name].append(index)
    for index, piece in enumerate(ours.geometryObjects):
        other = order[built.model.frames[piece.parentFrame].name].pop(0)
        assert type(piece.geometry) is type(theirs.geometryObjects[other].geometry)
        assert ours_data.oMg[index].translation == pytest.approx(theirs_data.oMg[other].translation, abs=1e-9)
        assert piece.geometry.computeVolume() == pytest.approx(
            theirs.geometryObjects[other].geometry.computeVolume(), rel=1e-6
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"stature": 17.5}, "stature is 17.5"),
        ({"stature": math.nan}, "stature is nan"),
        ({"mass": -3}, "mass is -3"),
        ({"mass": math.inf}, "mass is inf"),
        ({"sex": "x"}, "'male' or 'female'"),
        ({"sex": None}, "'male' or 'female'"),
        ({"stature": "tall"}, "between 1.3 and 2.2 m"),
        ({"stature": 1.9, "mass": 30}, "does not go with stature"),
    ],
)
def test_impossible_people_are_refused(options, words):
    with pytest.raises(InputError, match=words):
        load("human", **options)


def test_mass_left_out_is_what_people_of_that_stature_weigh():
    # Fits of mass to stature in ANSUR II: 27.41 H^1.999 (men), 23.00 H^2.192 (women).
    for sex, factor, exponent in (("male", 27.41, 1.999), ("female", 23.00, 2.192)):
        for stature in (1.55, 1.65, 1.75, 1.85):
            assert make_person(sex, stature).mass == pytest.approx(factor * stature**exponent, rel=0.025)

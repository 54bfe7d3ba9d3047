"""People of their own proportions and of an age."""

import math
from functools import cache

import numpy as np
import pytest

from tests.measuring import measure
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures import load
from wholebody.figures.tables import table


@cache
def usual_dimensions():
    return measure(load("human"))


def placements(figure):
    return [np.asarray(placement.homogeneous) for placement in figure.model.jointPlacements]


@pytest.mark.parametrize(
    ("size", "proportions"),
    [
        ({"sex": "female", "stature": 1.55}, {"sitting_height": 0.87, "hip_breadth_sitting": 0.37}),
        ({"percentile": 95}, {"span": 1.90, "knee_height_sitting": 0.61}),
        ({"sex": "female"}, {"sitting_height": 0.87, "eye_height_sitting": 0.74}),
        (
            {"stature": 1.8, "mass": 110},
            {"waist_depth": 0.34, "elbow_rest_height": 0.28, "overhead_reach_sitting": 1.40},
        ),
    ],
)
def test_stated_dimensions_are_measured_on_the_figure(size, proportions):
    usual = measure(load("human", **size)) if size else usual_dimensions()
    found = measure(load("human", proportions=proportions, **size))
    for name, value in proportions.items():
        assert found[name] == pytest.approx(value, abs=0.001), name
        assert abs(usual[name] - value) > 0.003, name


def test_without_a_stature_it_is_likely_for_the_proportions():
    """Five dimensions that regress to a tall or a short stature; the standard deviation is 69 mm."""
    names = ("sitting_height", "popliteal_height", "span", "knee_height_sitting", "hip_breadth_sitting")
    for stature, mass in ((1.90, 95.0), (1.62, 60.0)):
        whole = measure(load("human", stature=stature, mass=mass))
        person = load("human", proportions={name: whole[name] for name in names}).describe().person
        assert person.stature == pytest.approx(stature, abs=0.02)
        assert person.mass == pytest.approx(mass, abs=8.0)
        stated = load("human", mass=80.0, proportions={name: whole[name] for name in names}).describe().person
        assert stated.mass == 80.0


def test_hands_and_feet_have_the_stated_sizes():
    figure = load("human", proportions={"hand_length": 0.205, "foot_length": 0.285})
    place = {name: figure.model.frames[figure.model.getFrameId(name)].placement.translation for name in figure.frames}
    assert place["left_middle_tip"][2] == pytest.approx(-0.991 * 0.205, abs=1e-9)
    data = figure.model.createData()
    import pinocchio as pin

    pin.framesForwardKinematics(figure.model, data, pin.neutral(figure.model))
    ends = [data.oMf[figure.model.getFrameId(f"left_{name}")].translation[0] for name in ("toe_tip", "heel")]
    assert ends[0] - ends[1] == pytest.approx(0.285, abs=0.012)  # the toe tip's frame lies within the toes


def test_the_others_follow_as_they_go_together_in_people():
    # A long trunk at the same stature means short legs and arms: all correlations of residuals are negative there.
    usual, found = usual_dimensions(), measure(load("human", stature=1.755, proportions={"sitting_height": 0.96}))
    assert found["eye_height_sitting"] - usual["eye_height_sitting"] == pytest.approx(0.037, abs=0.008)
    for name in ("buttock_knee_length", "popliteal_height", "knee_height_sitting", "span"):
        assert found[name] < usual[name] - 0.005, name


@pytest.mark.parametrize("options", [{}, {"proportions": {}}, {"proportions": None}])
def test_without_proportions_the_body_is_the_same(options):
    old, new = load("human", sex="female"), load("human", sex="female", **options)
    assert np.array_equal(placements(old), placements(new))
    assert np.array_equal(old.model.lowerPositionLimit, new.model.lowerPositionLimit)
    assert np.array_equal(old.model.upperPositionLimit, new.model.upperPositionLimit)
    assert old.describe().person.stated == new.describe().person.stated == ()


def test_a_usual_dimension_changes_nothing():
    usual = usual_dimensions()
    proportions = {"sitting_height": usual["sitting_height"]}
    found = measure(load("human", stature=1.755, mass=84.6, proportions=proportions))
    assert found == pytest.approx(usual, abs=2e-4)


def test_the_avatar_has_the_proportions_of_its_person():
    avatar = load("avatar", proportions={"sitting_height": 0.96})
    assert avatar.describe().person == load("human", proportions={"sitting_height": 0.96}).describe().person


@pytest.mark.parametrize(
    ("proportions", "error", "words"),
    [
        ({"sitting_height": 1.2}, InputError, r"7\.\d standard deviations from that of men; give 0.7\d\d to 1.0\d\d m"),
        ({"sitting_height": 93}, InputError, "sitting_height is 93; give a number between 0 and 3 m"),
        ({"sitting_height": math.nan}, InputError, "sitting_height is nan"),
        (
            {"sitting_height": 0.97, "eye_height_sitting": 0.79},
            InputError,
            "standard deviations from that of men with the others; give .* m, or change another",
        ),
        ({"siting_height": 0.93}, UnknownNameError, "sitting_height"),
        (0.93, InputError, "give metres by dimension"),
    ],
)
def test_impossible_proportions_are_one_sentence(proportions, error, words):
    with pytest.raises(error, match=words) as caught:
        load("human", proportions=proportions)
    assert "\n" not in str(caught.value)


# ---- age

SOUCIE = {  # degrees: men and women, 20 to 44 and 45 to 69
    ("shoulder_flexion", "upper"): (168.8, 164.0, 172.0, 168.1),
    ("elbow_flexion", "upper"): (144.6, 143.5, 150.0, 148.3),
    ("knee_flexion", "upper"): (137.7, 132.9, 141.9, 137.8),
    ("ankle_dorsiflexion", "upper"): (12.7, 11.9, 13.8, 11.6),
    ("elbow_pronation", "lower"): (85.0, 82.4, 90.6, 87.2),
}


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_older_people_have_the_published_share_of_the_ranges(sex, side):
    young, old = load("human", sex=sex), load("human", sex=sex, age=65)
    for (joint, end), means in SOUCIE.items():
        share = means[1] / means[0] if sex == "male" else means[3] / means[2]
        limits = [getattr(figure.model, f"{end}PositionLimit") for figure in (young, old)]
        at = young.model.joints[young.model.getJointId(f"{side}_{joint}")].idx_q
        assert limits[1][at] / limits[0][at] == pytest.approx(share, rel=1e-9), joint
    at = young.model.joints[young.model.getJointId(f"{side}_hip_flexion")].idx_q
    assert math.degrees(old.model.lowerPositionLimit[at]) == pytest.approx(-13.5 if sex == "male" else -16.7)


def test_other_ranges_do_not_depend_on_age():
    young, old = load("human"), load("human", age=69)
    changed = {
        name.split("_", 1)[1]
        for name, joint in zip(young.model.names, young.model.joints, strict=True)
        if joint.nq == 1
        and (
            young.model.lowerPositionLimit[joint.idx_q] != old.model.lowerPositionLimit[joint.idx_q]
            or young.model.upperPositionLimit[joint.idx_q] != old.model.upperPositionLimit[joint.idx_q]
        )
    }
    # How far the clavicle rises follows from the dimensions, which change with age.
    assert changed - {"clavicle_elevation"} == {row["joint"] for row in table("age_ranges")}


@pytest.mark.parametrize("joint", ["knee_flexion", "elbow_flexion"])
def test_soft_parts_stop_stout_people_earlier(joint):
    """Obese men flex the knee by 11 % less than others (Park et al. 2010), of which the flesh takes a part."""
    thin, usual, obese, heavy = (
        load("human", stature=1.755, mass=mass).model for mass in (65.0, 84.6, 101.6, 130.0)
    )  # kg: the second is the median man's, the third is 33 kg/m^2
    ends = [model.upperPositionLimit[model.joints[model.getJointId(f"left_{joint}")].idx_q]
            for model in (thin, usual, obese, heavy)]  # fmt: skip
    assert ends[0] == ends[1] == pytest.approx(math.radians(150.0))
    assert 0.889 < ends[2] / ends[1] < 0.98
    assert 0.8 < ends[3] / ends[1] < ends[2] / ends[1]


def test_older_people_of_one_stature_and_mass_have_more_of_a_waist():
    young, old = (measure(load("human", stature=1.75, mass=85.0, age=age)) for age in (20, 55))
    assert 0.005 < old["waist_depth"] - young["waist_depth"] < 0.05


def test_an_overhead_reach_beyond_the_shoulders_is_noted():
    far = {"overhead_reach_sitting": 1.55, "wrist_height": 0.85, "acromial_height": 1.44, "span": 1.81}
    figure = load("human", proportions=far)
    assert figure.notes == (
        f"overhead_reach_sitting is {measure(figure)['overhead_reach_sitting']:.3f} m, not 1.550 m: "
        "the shoulder rises as far as it can",
    )
    assert load("human", proportions={"overhead_reach_sitting": 1.45}).notes == ()


@pytest.mark.parametrize("age", [16, 70, math.nan, "old"])
def test_ages_without_published_ranges_are_refused(age):
    with pytest.raises(InputError, match="age is"):
        load("human", age=age)


def test_a_posture_of_older_people_is_within_their_limits():
    figure = load("human", age=60)
    for name in figure.postures:
        q = figure.posture(name)
        assert np.array_equal(figure.clamp(q), q), name

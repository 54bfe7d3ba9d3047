"""RULA, REBA and OWAS: examples on the printed tables, and postures whose scores follow from the papers' words."""

from __future__ import annotations

import itertools
import json
from math import radians
from pathlib import Path
from typing import get_args

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.reference import worksheets
from wholebody.cli.main import main
from wholebody.ergonomics.observation import published, reba_of, rula_of
from wholebody.ergonomics.work import Coupling, Seen


@pytest.fixture(scope="module")
def person() -> wb.Figure:
    return wb.load("human")


def bent(person: wb.Figure, **degrees: float) -> np.ndarray:
    """The upright posture with joints at other angles, degrees."""
    names = {name: radians(value) for name, value in degrees.items()}
    return person.with_joints(person.posture("standing"), names)


def flat(table: tuple) -> list[int]:
    return [table] if isinstance(table, int) else [value for row in table for value in flat(row)]


@pytest.mark.parametrize(
    ("parts", "a", "b", "score"),
    [
        # a worksheet with the tables printed: least and greatest scores of everything
        ((1, 1, 1, 1, 1, 1, 1, 0, 0), 1, 1, 1),
        ((6, 3, 4, 2, 6, 6, 2, 1, 3), 9, 9, 7),
        # read from the printed tables by hand
        ((2, 2, 3, 1, 2, 3, 1, 1, 0), 3, 4, 5),
        ((3, 2, 3, 1, 3, 4, 1, 1, 2), 4, 5, 7),
        ((4, 3, 4, 1, 4, 5, 1, 1, 0), 6, 7, 7),
    ],
)
def test_rula_by_its_printed_tables(parts: tuple[int, ...], a: int, b: int, score: int) -> None:
    found = wb.ergonomics.RulaParts(*parts)
    assert (found.arm, found.body, found.score) == (a, b, score)


def test_rula_tables_are_those_of_the_printed_worksheet() -> None:
    """Written down anew, as the worksheet of Cornell University lays them out."""
    for name, sheet in (("A", worksheets.RULA_A), ("B", worksheets.RULA_B), ("C", worksheets.RULA_C)):
        assert flat(published("rula")[name]) == worksheets.digits(sheet)


def test_reba_tables_are_those_of_the_printed_worksheet() -> None:
    """Written down anew, as the employee assessment worksheet lays them out: table A by trunk, not by neck."""
    by_trunk = np.reshape(worksheets.digits(worksheets.REBA_A), (5, 3, 4))
    assert np.array_equal(np.array(published("reba")["A"]), by_trunk.transpose(1, 0, 2))
    assert flat(published("reba")["B"]) == worksheets.digits(worksheets.REBA_B)
    assert flat(published("reba")["C"]) == worksheets.digits(worksheets.REBA_C)


def test_scores_of_random_postures_are_those_of_the_worksheets(person: wb.Figure) -> None:
    """120 postures and works, whose scores the worksheets, followed step by step, give too."""
    rng = np.random.default_rng(38)
    limits, seen, grips = person.limits, {"rula": set[int](), "reba": set[int]()}, get_args(Coupling)
    for _ in range(120):
        q = person.posture("standing")
        # by shares of the ranges, as most people stand and work within a small part of these
        joint = q[limits.idx_q] + rng.uniform(0.0, 1.0) * (rng.uniform(limits.lower, limits.upper) - q[limits.idx_q])
        q[limits.idx_q] = np.clip(joint, limits.lower, limits.upper)
        tilt = rng.normal(size=3) * rng.choice((0.0, 0.1, 0.5))
        q[3:7] = pin.Quaternion(pin.exp3(tilt)).coeffs()
        static, repeated, shock, unstable, arms, legs, seated = rng.random(7) < (0.3, 0.3, 0.1, 0.2, 0.2, 0.8, 0.4)
        work = wb.ergonomics.Work(
            load=float(rng.choice((0.0, 1.9, 2.0, 5.0, 10.0, 12.0))), static=bool(static), repeated=bool(repeated),
            shock=bool(shock), unstable=bool(unstable), coupling=grips[rng.integers(4)], arms_supported=bool(arms),
            legs_supported=bool(legs), seated=bool(seated), back_supported=(None, True, False)[rng.integers(3)],
            walking=not seated and bool(rng.random() < 0.2),
        )  # fmt: skip
        angles = wb.ergonomics.body_angles(person, q)
        shown = Seen(person, angles, work, "")
        for name, found, other in (
            ("rula", rula_of(shown), worksheets.rula),
            ("reba", reba_of(shown), worksheets.reba),
        ):
            expected = [other(angles, side, work) for side in ("left", "right")]
            assert [found.left.score, found.right.score] == expected, (name, angles, work)
            seen[name].update(expected)
    assert min(map(len, seen.values())) >= 5, seen


def test_reba_by_the_example_of_a_public_package() -> None:
    """rs9000/ergonomics prints two poses: neck 2, trunk 2, legs 2, upper arm 1, lower arm 2, wrist 3 and 2."""
    left, right = wb.ergonomics.RebaParts(2, 2, 2, 1, 2, 3), wb.ergonomics.RebaParts(2, 2, 2, 1, 2, 2)
    assert (left.body, left.arm, left.score) == (4, 3, 4)
    assert (right.body, right.arm, right.score) == (4, 2, 4)
    assert wb.ergonomics.RebaParts(3, 5, 4, 6, 2, 3, 3, 3, 3).score == 15
    assert wb.ergonomics.RebaParts(1, 1, 1, 1, 1, 1).score == 1


def test_owas_by_an_example_of_a_lecture() -> None:
    """A. Freivalds (Pennsylvania State University): 2151 is a bent back, arms below, knees bent, less than 10 kg."""
    assert wb.ergonomics.Owas(2, 1, 5, 1).category == 3
    assert wb.ergonomics.Owas(1, 1, 2, 1).category == 1
    assert wb.ergonomics.Owas(1, 2, 2, 1).category == 1  # the example of rs9000/ergonomics
    assert wb.ergonomics.Owas(4, 3, 4, 3).category == 4
    codes = itertools.product((1, 2, 3, 4), (1, 2, 3), range(1, 8), (1, 2, 3))
    assert {wb.ergonomics.Owas(*code).category for code in codes} == {1, 2, 3, 4}


def test_angles_are_those_of_the_joints_that_are_turned(person: wb.Figure) -> None:
    for side, other in (("left", "right"), ("right", "left")):
        angles = wb.ergonomics.body_angles(person, bent(person, **{
            f"{side}_shoulder_flexion": 50, f"{side}_elbow_flexion": 80, f"{side}_elbow_pronation": 40,
            f"{side}_wrist_flexion": 25, f"{side}_knee_flexion": 35,
        }))  # fmt: skip
        mine, still = angles.side(side), angles.side(other)
        arm = [mine.shoulder_flexion, mine.elbow_flexion, mine.wrist_flexion, mine.forearm_twist]
        found = np.degrees([*arm, mine.knee_flexion])
        np.testing.assert_allclose(found, [50, 80, 25, 40, 35], atol=1.0)
        assert abs(still.shoulder_flexion) < 1e-6
    bowed = wb.ergonomics.body_angles(person, bent(person, neck1_flexion=15, spine2_rotation=20))
    assert np.degrees(bowed.neck_flexion) == pytest.approx(15.0, abs=1e-6)
    assert np.degrees(bowed.trunk_twist) == pytest.approx(20.0, abs=1e-6)


def test_a_raised_arm_scores_as_raised_whichever_way_it_went(person: wb.Figure) -> None:
    """The angle between upper arm and trunk is taken from the joints' centres, at random postures of the shoulder."""
    rng, raised = np.random.default_rng(9), 0
    shoulder = [f"right_shoulder_{turn}" for turn in ("flexion", "abduction", "rotation")]
    places = {name: person.model.joints[person.joint_id(name)].idx_q for name in shoulder}
    low, high = person.model.lowerPositionLimit, person.model.upperPositionLimit
    limits = {name: (low[k], high[k]) for name, k in places.items()}
    for _ in range(120):
        q = person.with_joints(person.posture("standing"), {name: rng.uniform(*limits[name]) for name in shoulder})
        arm = person.placement(q, "right_elbow").translation - person.placement(q, "right_shoulder").translation
        along = person.placement(q, "thorax").rotation[:, 2] @ arm / np.linalg.norm(arm)
        if along > np.cos(radians(60.0)):  # 120 degrees from hanging
            raised += 1
            assert wb.ergonomics.rula(person, q).right.upper_arm >= 4
            assert wb.ergonomics.reba(person, q).right.upper_arm >= 4
    assert raised > 10
    over = bent(person, right_shoulder_abduction=165, right_shoulder_flexion=3)
    assert wb.ergonomics.rula(person, over).right.upper_arm >= 4
    for degrees, upper_arm in ((90, 2), (97, 5)):  # the worksheet: no flexion, and abducted; above 90
        sideways = bent(person, right_shoulder_abduction=degrees)
        assert wb.ergonomics.rula(person, sideways).right.upper_arm == upper_arm
    inward = bent(person, right_shoulder_flexion=60, right_shoulder_abduction=-30)  # not abducted
    assert wb.ergonomics.body_angles(person, inward).right.shoulder_abduction < radians(-20.0)
    assert wb.ergonomics.rula(person, inward).right.upper_arm == wb.ergonomics.reba(person, inward).right.upper_arm == 3


def test_angles_do_not_depend_on_where_a_person_stands_and_looks(person: wb.Figure) -> None:
    q = bent(person, left_shoulder_flexion=50, spine1_flexion=20, neck1_rotation=15)
    moved = q.copy()
    moved[:3] += (1.0, -2.0, 0.3)
    half = radians(60.0)
    moved[3:7] = 0.0, 0.0, np.sin(half), np.cos(half)
    one, other = wb.ergonomics.body_angles(person, q), wb.ergonomics.body_angles(person, moved)
    for name in ("trunk_flexion", "trunk_lateral", "trunk_twist", "neck_twist", "left_share"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-9)
    assert one.left.shoulder_flexion == pytest.approx(other.left.shoulder_flexion, abs=1e-9)


def test_upright_is_acceptable_and_stooping_is_not(person: wb.Figure) -> None:
    upright = wb.ergonomics.ergonomics_of(person, person.posture("standing"))
    assert upright.rula.score <= 2
    assert upright.reba.score == 1
    assert upright.owas.code == "1121"
    stoop = bent(person, left_hip_flexion=70, right_hip_flexion=70, spine1_flexion=15, spine2_rotation=20)
    stoop[3:7] = 0.0, np.sin(radians(35)), 0.0, np.cos(radians(35))
    stooping = wb.ergonomics.ergonomics_of(person, stoop, wb.ergonomics.Work(load=25.0, repeated=True))
    assert stooping.rula.score == 7
    assert stooping.reba.score == 7  # table A 4 and load 2, table B 1: table C 6, and repeated
    assert stooping.owas.back == 2 or stooping.owas.back == 4
    assert stooping.owas.load == 3
    assert stooping.torques.worst[1] > upright.torques.worst[1]


def test_the_worse_side_is_reported(person: wb.Figure) -> None:
    raised = wb.ergonomics.rula(person, bent(person, left_shoulder_flexion=100, left_wrist_flexion=40))
    assert raised.left.score > raised.right.score
    assert (raised.worse, raised.score) == ("left", raised.left.score)
    raised = wb.ergonomics.reba(person, bent(person, right_shoulder_flexion=100, right_wrist_flexion=40))
    assert raised.worse == "right"


@pytest.mark.parametrize(("posture", "legs"), [("standing", 2), ("sitting", 1), ("kneeling", 6), ("squatting", 4)])
def test_owas_tells_how_a_body_is_carried(person: wb.Figure, posture: str, legs: int) -> None:
    assert wb.ergonomics.owas(person, person.posture(posture)).legs == legs


def gap(scene: wb.Scene, q: np.ndarray, thing: str, segment: str) -> float:
    """Distance of a thing from a segment."""
    found = scene.contacts(q, within=3.0)
    owners = [{scene.piece_owner[k] for k in pair} for pair in found.pair]
    return min(d for both, d in zip(owners, found.distance, strict=True) if both == {thing, segment})


def test_who_has_a_thing_below_the_pelvis_sits(person: wb.Figure) -> None:
    """Nearly upright with one leg hanging, on a saddle whose top touches the pelvis from below."""
    q = bent(person, left_hip_flexion=35, right_hip_flexion=20, left_knee_flexion=25, right_knee_flexion=5)
    scene = wb.Scene(person).add(wb.Sphere(0.01), name="saddle", at=(0.0, 0.0, q[2] - 0.4))
    scene.move("saddle", at=(0.0, 0.0, q[2] - 0.4 + gap(scene, q, "saddle", "pelvis")))
    assert wb.ergonomics.owas(person, q).legs == 3  # the posture alone does not tell it
    found = wb.ergonomics.ergonomics_of(scene, q)
    assert found.owas.legs == wb.ergonomics.owas(scene, q).legs == 1
    assert wb.ergonomics.reba(scene, q).left.legs == wb.ergonomics.rula(scene, q).left.legs == 1
    assert found.seat == "sits, as saddle is below pelvis or thighs"
    assert found.rows()[-1] == ("seat", "", "", found.seat)
    assert wb.ergonomics.owas(scene, q, wb.ergonomics.Work(seated=False)).legs == 3
    scene.move("saddle", at=(0.0, 0.0, q[2] - 0.4))  # well below: it bears nothing
    assert wb.ergonomics.ergonomics_of(scene, q).seat == "does not sit, by the posture"


@pytest.mark.parametrize("posture", ["standing", "sitting"])
def test_arms_at_rest_are_neutral(person: wb.Figure, posture: str) -> None:
    """The lowest scores that the worksheets give to hanging arms: the elbow is less bent than 60 degrees."""
    rula, reba = (score(person, person.posture(posture)).left for score in (wb.ergonomics.rula, wb.ergonomics.reba))
    assert (rula.upper_arm, rula.lower_arm, rula.wrist, rula.wrist_twist) == (1, 2, 1, 1)
    assert (reba.upper_arm, reba.lower_arm, reba.wrist) == (1, 2, 1)


def test_a_seated_trunk_with_a_back_scores_one_in_rula(person: wb.Figure) -> None:
    """McAtamney and Corlett: 1 "when sitting and well supported with a hip-trunk angle of 90 degrees or more"."""
    q = person.posture("sitting")
    half = radians(-12.5)  # leans back by 25 degrees; the thighs rise with it
    q[3:7] = 0.0, np.sin(half), 0.0, np.cos(half)
    q = person.with_joints(q, {"left_hip_flexion": radians(60), "right_hip_flexion": radians(60)})
    assert wb.ergonomics.rula(person, q, wb.ergonomics.Work(seated=True)).left.trunk == 3
    assert wb.ergonomics.rula(person, q, wb.ergonomics.Work(seated=True, back_supported=True)).left.trunk == 1
    assert wb.ergonomics.rula(person, q, wb.ergonomics.Work(seated=False, back_supported=True)).left.trunk == 3
    for back, trunk in ((True, 1), (False, 2)):  # "also if trunk is well supported while seated; 2 if not"
        work = wb.ergonomics.Work(seated=True, back_supported=back)
        assert wb.ergonomics.rula(person, person.posture("sitting"), work).left.trunk == trunk
    curled = person.with_joints(q, {"left_hip_flexion": radians(115), "right_hip_flexion": radians(115)})
    assert wb.ergonomics.rula(person, curled, wb.ergonomics.Work(seated=True, back_supported=True)).left.trunk == 3
    scene = wb.Scene(person).add(wb.Box((0.1, 1.0, 0.1)), name="backrest", at=(-2.0, 0.0, q[2] + 0.3))
    scene.move("backrest", at=(-2.0 + gap(scene, q, "backrest", "thorax"), 0.0, q[2] + 0.3))
    for _ in range(5):  # the nearest point of a slanted trunk is not straight ahead
        place = scene.objects["backrest"].placement.translation
        scene.move("backrest", at=(place[0] + gap(scene, q, "backrest", "thorax"), 0.0, place[2]))
    found = wb.ergonomics.ergonomics_of(scene, q, wb.ergonomics.Work(seated=True))
    assert found.seat == "sits, as Work says; the back is at backrest"
    assert found.rula.left.trunk == 1


def test_who_leans_at_a_thing_or_lies_on_it_does_not_sit(person: wb.Figure) -> None:
    q = person.posture("standing")
    scene = wb.Scene(person).add(wb.Box((0.1, 1.0, 0.1)), name="rail", at=(1.0, 0.0, 0.7))
    scene.move("rail", at=(1.0 - gap(scene, q, "rail", "left_thigh"), 0.0, 0.7))
    assert gap(scene, q, "rail", "left_thigh") < 1e-3
    assert wb.ergonomics.owas(scene, q).legs == 2
    lying = q.copy()
    lying[3:7] = 0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)  # on the back
    scene = wb.Scene(person).add(wb.Box((3.0, 3.0, 0.1)), name="bed")
    scene.move("bed", at=(0.0, 0.0, gap(scene, lying, "bed", "pelvis")))
    assert gap(scene, lying, "bed", "pelvis") < 1e-3
    assert not wb.ergonomics.ergonomics_of(scene, lying).seat.startswith("sits")


def test_one_leg_is_told_from_two(person: wb.Figure) -> None:
    lifted = bent(person, left_hip_flexion=60, left_knee_flexion=50)
    assert wb.ergonomics.owas(person, lifted).legs == 3
    assert wb.ergonomics.reba(person, lifted).right.legs == 3  # one leg, and a knee between 30 and 60 degrees


def test_reba_scores_legs_once_for_both_arms(person: wb.Figure) -> None:
    """Group A of the score sheet has one box for legs, "+2 if knee(s) > 60": the other side's arm counts with it."""
    lunge = bent(person, left_knee_flexion=70, left_hip_flexion=35, right_shoulder_flexion=100)
    found = wb.ergonomics.reba(person, lunge)
    assert found.left.legs == found.right.legs >= 3
    assert found.worse == "right"
    assert found.score == worksheets.reba(wb.ergonomics.body_angles(person, lunge), "right", wb.ergonomics.Work())


def test_scores_print_as_a_table(person: wb.Figure) -> None:
    found = wb.ergonomics.ergonomics_of(person, person.posture("standing"))
    head, rula, *rest = str(found).splitlines()
    assert head.split() == ["score", "left", "right", "worse"]
    assert rula.split()[:3] == ["RULA", str(found.rula.left.score), str(found.rula.right.score)]
    assert [line.split()[0] for line in rest] == ["REBA", "OWAS", "strength", "back", "seat"]


def test_colours_are_of_every_segment_and_red_where_it_is_worst(person: wb.Figure) -> None:
    found = wb.ergonomics.ergonomics_of(person, bent(person, left_shoulder_flexion=120, left_shoulder_abduction=30))
    colors = found.colors(person)
    assert set(colors) == set(person.segments)
    assert colors["left_upper_arm"][0] > colors["right_upper_arm"][0]


def test_the_command_prints_a_table_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = tmp_path / "task.toml"
    task.write_text(
        '[figure]\nname = "human"\n[[goal]]\ntype = "point"\nframe = "head_top"\ntarget = [0.0, 0.0, 1.74]\n'
    )
    main(["pose", str(task), "--out", str(tmp_path), "--no-picture", "--json"])
    capsys.readouterr()
    assert main(["assess", str(tmp_path / "result.json"), "--ergonomics", "--load", "6"]) == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("RULA", "REBA", "OWAS", "strength"))
    assert main(["assess", str(tmp_path / "result.json"), "--ergonomics", "--seated", "yes"]) == 0
    assert "sits, as Work says" in capsys.readouterr().out
    assert main(["assess", str(tmp_path / "result.json"), "--ergonomics", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ergonomics"]["rula"]["score"] == max(
        found["ergonomics"]["rula"][s]["score"] for s in ("left", "right")
    )
    assert found["assessment"]["penetration"] < 1e-5
    assert main(["assess", str(tmp_path / "result.json"), "--ergonomics", "--coupling", "firm"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    for option in (["--load", "6"], ["--repeated"], ["--seated", "no"]):
        assert main(["assess", str(tmp_path / "result.json"), *option]) == 2
        assert f"{option[0]} is read by the scores" in capsys.readouterr().err


def test_a_back_of_which_nothing_is_known_does_not_count_against_a_seated_trunk(person: wb.Figure) -> None:
    q = person.posture("sitting")
    for work, trunk in ((None, 1), (wb.ergonomics.Work(back_supported=False), 2)):
        assert wb.ergonomics.rula(person, q, work).left.trunk == trunk
    assert wb.ergonomics.rula(wb.Scene(person), q).left.trunk == 2  # the scene shows that nothing is there

"""Forces and strength in the search for a posture: levers by hand, and what people do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.ergonomics import Exertion, LoadedBalance, StrengthLimit, back_compression

CARRIED = [wb.Force(f"{side}_palm", (0.0, 0.0, -98.1)) for side in ("left", "right")]
PUSHED = [wb.Force(f"{side}_palm", (-100.0, 0.0, 0.0)) for side in ("left", "right")]
FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]


@pytest.fixture(scope="module")
def person() -> wb.Figure:
    return wb.load("human")


@pytest.fixture(scope="module")
def bent(person: wb.Figure) -> Any:
    joints = {"spine1_flexion": 0.3, "spine2_lateral": 0.1, "left_elbow_flexion": 1.2, "left_shoulder_flexion": 0.7,
              "left_shoulder_abduction": 1.2, "left_knee_flexion": 0.4, "left_hip_flexion": 0.5}  # fmt: skip
    return person.with_joints(person.posture("standing"), joints)


@pytest.mark.parametrize(
    "term",
    [Exertion([*CARRIED, *PUSHED]), StrengthLimit(PUSHED, standing=False), LoadedBalance(PUSHED)],
    ids=lambda term: type(term).__name__,
)  # fmt: skip
def test_derivatives_are_those_of_finite_differences(person: wb.Figure, bent: Any, term: Any) -> None:
    assert wb.check_derivatives(term, wb.Scene(person), bent).agrees


@pytest.mark.parametrize("term", [LoadedBalance, StrengthLimit])
def test_who_would_slip_is_refused(person: wb.Figure, term: Any) -> None:
    """The ground gives at most 0.8 of what it bears; the median man pushed 700 N by 830 N of weight."""
    weight = 9.81 * sum(inertia.mass for inertia in person.model.inertias)
    for share, carried, slips in ((0.79, 0.0, False), (0.81, 0.0, True), (0.81, 20.0, False), (0.79, -20.0, True)):
        force = wb.Force("left_palm", (0.6 * share * weight, -0.8 * share * weight, -carried))
        if slips:
            with pytest.raises(wb.InputError, match="soles slip at"):
                wb.Problem(wb.Scene(person), constraints=[*FEET, term([force])])
        else:
            wb.Problem(wb.Scene(person), constraints=[*FEET, term([force])])
    sitting = StrengthLimit([wb.Force("left_palm", (-weight, 0.0, 0.0))], standing=False)
    wb.Problem(wb.Scene(person), constraints=[*FEET, sitting])  # no sole bears
    braced = [wb.Force("left_palm", (-weight, 0.0, 0.0)), wb.Force("thorax", (0.5 * weight, 0.0, 0.0))]
    wb.Problem(wb.Scene(person), constraints=[*FEET, term(braced)])  # by a wall behind


@pytest.mark.parametrize("raised", [(0.0, 0.0), (-10.0, 50.0), (0.0, 90.0), (80.0, 60.0), (150.0, 20.0)])
def test_torques_are_those_of_inverse_dynamics(person: wb.Figure, raised: tuple[float, float]) -> None:
    # The same on both sides: there the two ways to split the ground's force over the feet are one.
    joints = {"hip_flexion": 0.6, "knee_flexion": 0.8, "ankle_dorsiflexion": 0.2, "elbow_flexion": 1.2}
    joints |= dict(zip(("shoulder_flexion", "shoulder_abduction"), np.radians(raised), strict=True))
    joints["shoulder_rotation"] = 0.5
    sides = {f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in joints.items()}
    q = person.with_joints(person.posture("standing"), {**sides, "spine1_flexion": 0.2})
    q[2] -= person.placement(q, "left_sole").translation[2]
    term = StrengthLimit(compression=None).resolve(wb.Scene(person), q)
    share = term.statics.efforts(wb.Scene(person).state(q))[0]
    needed = wb.motion.torques(wb.Clip(person, np.array([q, q]), 1.0, "still"), cutoff=None)
    alone = wb.ergonomics.static_torques(person, q)
    for joint, one in zip(term.statics.joints.tolist(), share, strict=True):
        name = needed.joint_of(joint)
        # Stand-ins for the ground differ in the sideways forces at the feet.
        near = 1e-9 if "shoulder" in name or "elbow" in name else 0.02
        assert abs(one) == pytest.approx(needed.share[0, joint], abs=near), name
        if near < 0.02:
            assert abs(one) == pytest.approx(alone.share[name], abs=1e-9)
            assert needed.torque[0, joint] == pytest.approx(alone.torque[name], abs=1e-9)


@pytest.mark.parametrize("standing", [True, False])
def test_torques_of_one_of_several_are_those_of_the_person_alone(person: wb.Figure, bent: Any, standing: bool) -> None:
    alone = StrengthLimit(CARRIED, standing=standing).resolve(wb.Scene(person), bent)
    scene = wb.Scene({"hand": (wb.load("hand"), (2.0, 0.0, 1.0)), "anna": person})
    q = scene.figure.posture({"anna": bent})
    forces = [wb.Force(f"anna/{one.frame}", one.force) for one in CARRIED]
    among = StrengthLimit(forces, standing=standing, person="anna")
    found = among.resolve(scene, q).value(scene.state(q))
    np.testing.assert_allclose(found, alone.value(wb.Scene(person).state(bent)), atol=1e-9)
    with pytest.raises(wb.InputError, match="several figures"):
        StrengthLimit(forces).resolve(scene, q)
    with pytest.raises(wb.UnknownNameError, match="anna"):
        Exertion(CARRIED, person="ana").resolve(scene, q)


def test_the_disc_bears_what_levers_say(person: wb.Figure) -> None:
    standing = person.posture("standing")
    # Nachemson (1981): 500 N at L3 of people of 70 kg who stand at ease.
    assert back_compression(person, standing) == pytest.approx(500.0, rel=0.25)
    ahead = person.with_joints(standing, {f"{side}_shoulder_flexion": 0.5 * np.pi for side in ("left", "right")})
    empty, loaded = (back_compression(person, ahead, forces) for forces in ((), CARRIED))
    lever = person.placement(ahead, "left_palm").translation[0]
    lever -= person.placement(ahead, "spine1_flexion").translation[0]
    assert loaded - empty == pytest.approx(196.2 * lever / 0.06 + 196.2, rel=0.03)


@pytest.mark.parametrize(("sex", "forward"), [("male", 20.0), ("female", -5.0), ("female", 40.0)])
def test_the_disc_bears_the_moment_of_all_that_is_above_over_the_lever(sex: str, forward: float) -> None:
    """By hand: weights and forces times levers about L5/S1; before, it was 60 to 80 N less."""
    woman = wb.load("human", sex=sex)
    bent = {"spine1_flexion": forward, "spine3_lateral": 8.0, "left_shoulder_flexion": 60.0, "neck1_flexion": 20.0}
    q = woman.with_joints(woman.posture("standing"), {name: np.radians(angle) for name, angle in bent.items()})
    model, data = woman.model, woman.model.createData()
    pin.forwardKinematics(model, data, q)
    disc = woman.joint_id("spine1_flexion")
    at = data.oMi[disc].translation
    moment, force = np.zeros(3), np.zeros(3)
    for joint in (k for k in range(disc, model.njoints) if disc in list(model.supports[k])):
        weight = np.array((0.0, 0.0, -9.81 * model.inertias[joint].mass))
        moment += np.cross(data.oMi[joint].act(model.inertias[joint].lever) - at, weight)
        force += weight
    for one in CARRIED:
        moment += np.cross(woman.placement(q, str(one.frame)).translation - at, one.force)
        force += one.force
    axes = [
        data.oMi[woman.joint_id(f"spine1_{way}")].rotation[:, axis] for way, axis in (("flexion", 1), ("lateral", 0))
    ]
    spine = data.oMi[woman.joint_id("spine2_flexion")].translation - at
    along = float(force @ spine) / float(np.linalg.norm(spine))
    across = float(np.hypot(*(moment @ axis for axis in axes)))
    assert back_compression(woman, q, CARRIED) == pytest.approx(across / 0.06 - along, abs=3.0)


@pytest.mark.parametrize("slide", [False, True])
def test_who_pushes_leans_forward(person: wb.Figure, slide: bool) -> None:
    goals = [wb.Point("left_palm", (0.5, 0.2, 1.0)), wb.Point("right_palm", (0.5, -0.2, 1.0))]
    feet = [wb.Stand("floor", balance=False)] if slide else FEET
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[*feet, LoadedBalance(PUSHED)]))
    assert solution.solved
    heel, toe = (person.placement(solution.q, f"left_{end}").translation[0] for end in ("heel", "toe_tip"))
    center = pin.centerOfMass(person.model, person.model.createData(), solution.q)[0]
    weight = 9.81 * pin.computeTotalMass(person.model)
    # About the heels the weight has at least the moment of 200 N one metre high; about the toes it has no more.
    assert weight * (center - heel) >= 200.0 * 1.0
    assert weight * (center - toe) <= 200.0 * 1.0


def test_a_bound_on_the_back_is_kept(person: wb.Figure) -> None:
    goals = [wb.Point("left_palm", (0.6, 0.2, 1.0)), wb.Point("right_palm", (0.6, -0.2, 1.0))]
    found = []
    for bound in ([], [StrengthLimit(CARRIED, compression=3000.0)]):
        problem = wb.Problem(wb.Scene(person), goals=goals, constraints=[*FEET, LoadedBalance(CARRIED), *bound])
        solution = wb.solve(problem)
        assert solution.solved
        found.append(back_compression(person, solution.q, CARRIED))
    assert found[0] > 3500.0
    assert found[1] <= 3000.1


def test_who_holds_a_load_brings_it_near(person: wb.Figure) -> None:
    level = [wb.Plane(f"{side}_palm", (0, 0, 1), point=(0.0, 0.0, 1.0)) for side in ("left", "right")]
    constraints = [*FEET, *level, LoadedBalance(CARRIED)]
    usual, strong = (
        wb.solve(wb.Problem(wb.Scene(person), constraints=constraints, measures=measures)).q
        for measures in (None, [wb.Effort(), Exertion(CARRIED, weight=10.0)])
    )
    ahead = [person.placement(q, "left_palm").translation[0] for q in (usual, strong)]
    assert ahead[1] < ahead[0] - 0.1


def test_a_load_beside_the_shoulder_is_held_by_its_whole_torque(person: wb.Figure) -> None:
    """By hand: axes square to each other miss nothing of the torque, however the arm is raised."""
    rng, arm = np.random.default_rng(14), [f"left_shoulder_{way}" for way in ("flexion", "abduction", "rotation")]
    ways = [np.radians((-60.0, 76.0, 9.0)), *rng.uniform((-1.0, -0.5, -1.0), (2.5, 2.5, 1.0), (20, 3))]
    model, data, pull = person.model, person.model.createData(), CARRIED[0]
    first, last = (person.joint_id(name) for name in (arm[0], arm[-1]))
    for angles in ways:
        q = person.with_joints(
            person.posture("standing"), {**dict(zip(arm, angles, strict=True)), "left_elbow_flexion": 1.3}
        )
        pin.forwardKinematics(model, data, q)
        at = data.oMi[last].translation
        moment = np.cross(person.placement(q, "left_palm").translation - at, pull.force)
        for joint in (k for k in range(first, model.njoints) if first in list(model.supports[k])):
            weight = (0.0, 0.0, -9.81 * model.inertias[joint].mass)
            moment += np.cross(data.oMi[joint].act(model.inertias[joint].lever) - at, weight)
        term = Exertion([pull]).resolve(wb.Scene(person), q)
        share = term.statics.efforts(wb.Scene(person).state(q))[0]
        columns = [model.joints[person.joint_id(name)].idx_v for name in arm]
        places = [int(np.flatnonzero(term.statics.joints == column)[0]) for column in columns]
        shares = share[places]
        torque = np.where(shares > 0.0, term.statics.upper[places], -term.statics.lower[places]) * shares
        assert np.linalg.norm(torque) == pytest.approx(np.linalg.norm(moment), rel=1e-9)


def test_who_holds_a_load_keeps_the_elbows_in(person: wb.Figure) -> None:
    level = [wb.Plane(f"{side}_palm", (0, 0, 1), point=(0.0, 0.0, 1.0)) for side in ("left", "right")]
    heavy = [wb.Force(f"{side}_palm", (0.0, 0.0, -196.2)) for side in ("left", "right")]
    measures = [wb.Effort(), Exertion(heavy, weight=10.0)]
    q = wb.solve(wb.Problem(wb.Scene(person), constraints=[*FEET, *level, LoadedBalance(heavy)], measures=measures)).q
    angles = wb.ergonomics.body_angles(person, q)
    assert max(angles.left.shoulder_abduction, angles.right.shoulder_abduction) < np.radians(45.0)

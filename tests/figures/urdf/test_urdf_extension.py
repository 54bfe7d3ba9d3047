"""A figure that is written as URDF and read back is the same figure; and other programs read it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError
from wholebody.cli import main
from wholebody.figures import urdf_path
from wholebody.figures.anthropometry import make_person
from wholebody.figures.packaged_urdf import write_human
from wholebody.figures.state import State


def pairs(figure: wb.Figure) -> set[frozenset[str]]:
    names = [piece.name for piece in figure.geometry.geometryObjects]
    return {frozenset((names[pair.first], names[pair.second])) for pair in figure.geometry.collisionPairs}


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_what_is_read_back_is_what_was_written(name: str) -> None:
    built, read = wb.load(name), wb.load(urdf_path(name))
    assert (read.root, read.detail) == (built.root, built.detail)
    assert pairs(read) == pairs(built)
    assert read.postures == built.postures
    for posture in built.postures:
        assert read.posture(posture) == pytest.approx(built.posture(posture), abs=1e-10)
    assert read.frames == built.frames
    assert read.segments == built.segments
    for what in ("groups", "chains", "collision_groups"):
        assert dict(getattr(read, what)) == dict(getattr(built, what))
    assert read.effort_weights == pytest.approx(built.effort_weights)
    assert {frozenset((p.a, p.b)): p.reason for p in read.excluded_pairs} == {
        frozenset((p.a, p.b)): p.reason for p in built.excluded_pairs
    }
    for cone in built.cones:
        assert read.cones[cone].cone.vertices == pytest.approx(built.cones[cone].cone.vertices, abs=1e-10)
        assert read.cones[cone][1:3] == built.cones[cone][1:3]
    assert repr(read.describe().person) == repr(built.describe().person)
    assert sorted(read.ranges) == sorted(built.ranges)
    scenes = wb.Scene(read), wb.Scene(built)
    for part in built.ranges:  # the same values and slopes where every joint has moved
        q = pin.integrate(built.model, built.neutral, np.full(built.model.nv, 0.2))
        terms = [wb.tasks.RangeOfMotion([part]).resolve(scene, q) for scene in scenes]
        states = [State(scene.model).update(q) for scene in scenes]
        mine, theirs = (
            [*term.value(state), *term.jacobian(state).ravel()] for term, state in zip(terms, states, strict=True)
        )
        assert mine == pytest.approx(theirs, abs=1e-9)


def test_a_person_of_any_size_can_be_written_and_read_with_a_fixed_root(tmp_path: Path) -> None:
    path = tmp_path / "woman.urdf"
    assert main(["figure", "human", "--sex", "female", "--stature", "1.55", "--out", str(path)]) == 0
    figure = wb.load(path, root="fixed")
    assert (figure.root, figure.model.nv) == ("fixed", 49)
    assert len(figure.geometry.collisionPairs) == len(wb.load("human").geometry.collisionPairs)
    assert "sitting" in figure.postures
    assert sum(inertia.mass for inertia in figure.model.inertias) == pytest.approx(
        sum(inertia.mass for inertia in wb.load("human", sex="female", stature=1.55).model.inertias)
    )


def test_whose_body_it_is_comes_back(tmp_path: Path) -> None:
    """Strength follows sex and age: 52 years leave a person less of it."""
    own = {"sitting_height": 0.86, "hip_breadth_sitting": 0.41}
    person = make_person("female", 1.62, 71.5, age=52.0, proportions=own, shoes=0.02, clothing=0.004)
    write_human(path := tmp_path / "woman.urdf", person)
    figure = wb.load(path)
    read = figure.describe().person
    assert read is not None
    assert (read.sex, read.age, read.shoes, read.clothing) == ("female", 52.0, 0.02, 0.004)
    assert (read.stature, read.mass, read.stated) == (1.62, 71.5, tuple(sorted(own)))
    assert dict(read.dimensions) == pytest.approx(dict(person.dimensions))
    young = wb.load("human", sex="female", stature=1.62, mass=71.5, proportions=own)
    old, strong = (np.nan_to_num(wb.motion.Strength().limits(one)[1], posinf=0.0) for one in (figure, young))
    assert 0.0 < np.abs(old).sum() < np.abs(strong).sum()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('sex="male"', 'sex="robot"', "give 'male' or 'female'"),
        ('stature="1.755"', 'stature="175.5"', "stature"),
        ('mass="84.6"', 'mass="much"', "give a finite number"),
        ('mass="84.6"', 'mass="84.6" dimensions="nose" values="0.05"', "nose"),
        (' mass="84.6"', "", "mass=None; give a finite number"),
        ('mass="84.6"', 'mass="84.6" age=""', "age=''; give a finite number"),
        ('mass="84.6"', 'mass="84.6" values="0.93"', "values='0.93'; give 0 finite numbers"),
        ('mass="84.6"', 'mass="84.6" dimensions="span span" values="1.7 1.8"', "'span' is stated twice"),
    ],
)
def test_a_person_whom_nobody_can_be_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = urdf_path("human").read_text()
    assert text.count(old) == 1
    path = tmp_path / "human.urdf"
    path.write_text(text.replace(old, new))
    with pytest.raises(FileFormatError, match=said) as caught:
        wb.load(path)
    assert "<person>" in str(caught.value)


@pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="mujoco is not installed")
def test_mujoco_reads_the_person() -> None:
    import mujoco

    figure = wb.load("human")
    model = mujoco.MjModel.from_xml_path(str(urdf_path("human")))
    assert model.nv == figure.model.nv - 6
    pelvis = figure.model.inertias[1].mass  # a part of MuJoCo's world
    assert model.body_mass.sum() == pytest.approx(sum(i.mass for i in figure.model.inertias) - pelvis, abs=1e-6)
    data = mujoco.MjData(model)
    q = figure.posture("sitting")
    for joint, value in figure.joint_values(q).items():
        data.joint(joint).qpos = value
    mujoco.mj_forward(model, data)
    assert np.isfinite(data.qacc).all()


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_mujoco_has_the_same_joints_and_places(name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    figure = wb.load(name)
    model = mujoco.MjModel.from_xml_path(str(urdf_path(name)))
    assert model.nv == figure.model.nv - 6
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    q = figure.clamp(pin.integrate(figure.model, figure.neutral, 0.3 * rng.normal(size=figure.model.nv)))
    q[:7] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # what the root carries is a part of MuJoCo's world
    for joint, value in figure.joint_values(q).items():
        data.joint(joint).qpos = value
    mujoco.mj_forward(model, data)
    state = wb.Scene(figure).state(q)
    for number in range(1, model.nbody):
        ours = state.frame(figure.frame_id(model.body(number).name)).translation
        assert data.body(number).xpos == pytest.approx(ours, abs=1e-6)


WRONG = {
    "no such joint": ('joints="left_shoulder', 'joints="left_sholder', "no joint is called 'left_sholder"),
    "no such piece": ('pairs="pelvis ', 'pairs="pelvi ', "no piece is called 'pelvi'"),
    "posture without unit root": ('root="0 0 ', 'root="0 0 0 9 ', "7 finite numbers"),
    "values do not fit": ('values="', 'values="1 ', "finite number"),
    "no name": ('<posture name="standing"', "<posture", "<posture> has no name"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_element_is_one_sentence(what: str, tmp_path: Path) -> None:
    before, after, words = WRONG[what]
    text = urdf_path("human").read_text()
    assert before in text
    path = tmp_path / "human.urdf"
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(FileFormatError, match=words) as caught:
        wb.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)

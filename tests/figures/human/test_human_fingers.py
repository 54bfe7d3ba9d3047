"""The person whose hands have fingers: joints, mass, self-contact, files, and what such hands can take."""

import importlib.util

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.cli.main import main

TIPS = ("thumb", "index", "middle", "ring", "little")
FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]


@pytest.fixture(scope="module")
def figure():
    return wb.load("human", hands="fingers")


def gaps(model, geometry, q, data=None):
    """Signed distance of every tested pair by coal, and its two names."""
    data, placed = data or model.createData(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(model, data, geometry, placed, q)
    pin.computeDistances(geometry, placed)
    names = [piece.name for piece in geometry.geometryObjects]
    return [
        (result.min_distance, names[pair.first], names[pair.second])
        for pair, result in zip(geometry.collisionPairs, placed.distanceResults, strict=True)
    ]


def test_a_hand_has_twenty_joints_and_the_rest_of_the_body_stays(figure):
    rigid = wb.load("human")
    assert (rigid.model.nv, figure.model.nv) == (55, 95)
    assert [len(figure.groups[f"{side}_fingers"]) for side in ("left", "right")] == [20, 20]
    assert set(figure.joints) > set(rigid.joints)
    assert set(figure.frames) > set(rigid.frames)
    a, b = rigid.posture("standing"), figure.posture("standing")
    for name in ("left_palm", "right_grip", "gaze", "left_sole"):
        assert np.abs(rigid.placement(a, name).homogeneous - figure.placement(b, name).homogeneous).max() < 1e-9


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_hand_keeps_its_mass_and_its_length(sex):
    rigid, figure = wb.load("human", sex=sex), wb.load("human", sex=sex, hands="fingers")
    assert pin.computeTotalMass(figure.model) == pytest.approx(pin.computeTotalMass(rigid.model), abs=1e-8)
    q = figure.with_joints(figure.neutral, wb.figures.finger_angles("flat"))
    for side in ("left", "right"):
        middle = f"{side}_middle_tip"
        assert (
            np.linalg.norm(figure.placement(q, middle).translation - rigid.placement(rigid.neutral, middle).translation)
            < 2e-3
        )  # the finger's knuckle stands 0.008 hand breadths beside the middle of the hand


@pytest.mark.parametrize(("sex", "detail"), [("male", "capsules"), ("female", "hulls")])
def test_shapes_of_the_hand_are_free_of_self_contact(sex, detail):
    figure = wb.load("human", sex=sex, detail=detail, hands="fingers")
    data = figure.model.createData()
    for shape in ("relaxed", "flat", "fist", "hook", "pinch", "pointing"):
        q = figure.with_joints(figure.posture("a_pose"), wb.figures.finger_angles(shape))
        assert figure.within_limits(q, 0.0), shape
        assert min(gaps(figure.model, figure.geometry, q, data))[0] > 1e-3, shape


def test_a_fist_closes_and_a_pinch_nearly_does(figure):
    q = figure.with_joints(figure.posture("a_pose"), wb.figures.finger_angles("pinch", "left"))
    q = figure.with_joints(q, wb.figures.finger_angles("fist", "right"))

    def apart(first, second):
        return np.linalg.norm(figure.placement(q, first).translation - figure.placement(q, second).translation)

    assert apart("left_thumb_tip", "left_index_tip") < 0.025
    assert apart("right_middle_tip", "right_palm") < 0.05
    assert apart("left_middle_tip", "left_palm") > 0.08


def test_the_thumb_moves_out_of_the_palm_and_fingers_towards_it(figure):
    q = figure.posture("standing")
    for side in ("left", "right"):
        for joint, tip in (("thumb_cmc_abduction", "thumb"), ("index_mcp_flexion", "index")):
            value = figure.joint_values(q)[f"{side}_{joint}"]
            more = figure.with_joints(q, {f"{side}_{joint}": value + 0.1})
            palm = figure.placement(q, f"{side}_palm")
            ends = [palm.actInv(figure.placement(p, f"{side}_{tip}_tip").translation)[2] for p in (q, more)]
            assert ends[1] > ends[0] + 0.002


def test_a_pencil_is_taken_by_a_pinch(figure):
    scene = wb.Scene(figure).add(wb.Capsule(0.004, 0.15), name="pencil", at=(0.45, -0.25, 1.2))
    assert wb.solve(wb.Problem(scene, goals=[wb.Grasp("right", "pencil", "pinch")], constraints=FEET)).solved


def test_a_hand_of_one_segment_cannot_take_by_all_fingertips():
    scene = wb.Scene(wb.load("human")).add(wb.Sphere(0.02), name="ball", at=(0.4, -0.2, 1.1))
    with pytest.raises(wb.InputError, match="hands='fingers'"):
        wb.Problem(scene, goals=[wb.Grasp("right", "ball", "fingertips")])


def test_the_written_file_reads_back(figure, tmp_path):
    path = tmp_path / "fingers.urdf"
    assert main(["figure", "human", "--hands", "fingers", "--out", str(path)]) == 0
    read = wb.load(path)
    assert (read.model.nv, len(read.geometry.collisionPairs)) == (95, len(figure.geometry.collisionPairs))
    for name in ("standing", "sitting"):
        assert read.posture(name) == pytest.approx(figure.posture(name), abs=1e-9)
    assert read.groups == figure.groups
    assert read.effort_weights == pytest.approx(figure.effort_weights)


@pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="mujoco is not installed")
def test_mujoco_has_the_same_places(figure, tmp_path):
    import mujoco

    path = tmp_path / "fingers.urdf"
    assert main(["figure", "human", "--hands", "fingers", "--out", str(path)]) == 0
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.nv == 89
    data, q = mujoco.MjData(model), figure.with_joints(pin.neutral(figure.model), wb.figures.finger_angles("fist"))
    for joint, value in figure.joint_values(q).items():
        data.joint(joint).qpos = value
    mujoco.mj_forward(model, data)
    for number in range(1, model.nbody):
        name = model.body(number).name
        assert data.body(number).xpos == pytest.approx(figure.placement(q, name).translation, abs=1e-6)


def test_a_task_file_names_the_hands(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(
        '[figure]\nname = "human"\nhands = "fingers"\n'
        '[[goal]]\ntype = "point"\nframe = "right_ring_tip"\ntarget = [0.4, -0.2, 1.1]\n'
    )
    problem = wb.read_task(path).problem
    assert problem.scene.figure.model.nv == 95
    written = wb.taskfile.write_task(problem, tmp_path / "again.toml")
    assert wb.read_task(written).problem.scene.figure.model.nv == 95


@pytest.mark.parametrize(
    ("options", "sentence"),
    [({"hands": "claws"}, "claws"), ({"hands": "fingers", "detail": "spheres"}, "spheres"), ({"hands": 3}, "hands")],
)
def test_wrong_hands_are_refused_in_one_sentence(options, sentence):
    with pytest.raises(wb.WholebodyError, match=sentence):
        wb.load("human", **options)
    with pytest.raises(wb.WholebodyError, match="open"):
        wb.figures.finger_angles("open")
    with pytest.raises(wb.InputError, match=r"give .left. or .right."):
        wb.figures.finger_angles("flat", "up")


def test_a_flat_hand_closes_around_a_thin_bar(figure):
    """A relaxed hand ends with the thumb between this bar and the palm."""
    scene = wb.Scene(figure).add(wb.Capsule(0.0125, 0.3), name="bar", at=(0.40, -0.2, 1.1))
    flat = {"right_elbow_flexion": np.radians(80.0), **wb.figures.finger_angles("flat", "right")}
    start = figure.with_joints(figure.posture("standing"), flat)
    grasp = wb.Grasp("right", "bar", "power")
    solution = wb.solve(wb.Problem(scene, start=start, goals=[grasp], constraints=FEET), wb.methods.QP(measures=False))
    assert solution.status == "solved"
    found = gaps(scene.model, scene.geometry, solution.q)
    assert min(found)[0] > -1e-5
    at_bar = {a if b.startswith("bar") else b: gap for gap, a, b in found if "bar:" in a + b}
    assert abs(at_bar["right_hand:0"]) < 2e-5
    for finger in TIPS:
        outer = [f"right_{finger}_{part}" for part in ("proximal" if finger == "thumb" else "middle", "distal")]
        assert abs(min(at_bar[part] for part in outer)) < 2e-5

"""Any URDF: a robot arm with every kind of shape, and files that are wrong."""

import copy
import os
import pickle
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError, InputError
from wholebody.figures import load

ARM = Path(__file__).resolve().parents[2] / "data" / "arm" / "arm.urdf"
TEXT = ARM.read_text(encoding="utf-8")


def test_arm_has_its_own_geometry_in_convex_pieces():
    arm = load(ARM, concavity=0.2)
    assert (arm.root, arm.detail, arm.model.nv, arm.model.nq) == ("fixed", "own", 6, 7)
    kinds = {}
    for piece in arm.geometry.geometryObjects:
        kinds.setdefault(piece.name.partition(":")[0], []).append(type(piece.geometry).__name__)
    assert kinds["base"] == ["Box"]
    assert kinds["column"] == ["Convex"]
    assert kinds["wrist1"] == ["Sphere"]
    assert len(kinds["tool"]) > 1  # the bracket is concave
    assert set(kinds["tool"]) == {"Convex"}
    assert arm.chains["tool"].joints == ("turn", "shoulder", "elbow", "roll", "pitch", "spin")


def test_cylinder_becomes_a_prism_around_it():
    arm = load(ARM)
    piece = next(p for p in arm.geometry.geometryObjects if p.name == "fore:0")
    volume = np.pi * 0.04**2 * 0.32
    assert volume < piece.geometry.computeVolume() < 1.01 * volume
    points = np.array(piece.geometry.points())
    assert len(points) == 64
    assert np.ptp(points[:, 2]) == pytest.approx(0.32)


def test_long_names_are_quoted_in_short(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        f'<robot name="r"><link name="base"/><joint name="{"j" * 5000}" type="fixed"><parent link="base"/>'
        f'<child link="{"c" * 5000}"/></joint></robot>'
    )
    with pytest.raises(FileFormatError, match="which is not in the file") as caught:
        load(path)
    assert len(str(caught.value)) < 400 + len(str(path))


def test_bracket_keeps_its_volume():
    arm = load(ARM, concavity={"tool": 0.2})
    volume = sum(p.geometry.computeVolume() for p in arm.geometry.geometryObjects if p.name.startswith("tool"))
    assert volume == pytest.approx((0.1 * 0.03 + 0.07 * 0.03) * 0.03, rel=0.1)


def test_pairs_are_chosen_and_the_others_reported():
    arm = load(ARM)
    reasons = {frozenset((entry.a, entry.b)): entry.reason for entry in arm.excluded_pairs}
    assert reasons[frozenset(("base:0", "column:0"))] == "neighbours"
    assert "sampled posture" in reasons[frozenset(("wrist1:0", "wrist3:0"))]
    pieces = arm.geometry.geometryObjects
    tested = {frozenset((pieces[p.first].name, pieces[p.second].name)) for p in arm.geometry.collisionPairs}
    assert frozenset(("base:0", "fore:0")) in tested
    assert not tested & set(reasons)
    assert len(tested) + len(reasons) == arm.geometry.ngeoms * (arm.geometry.ngeoms - 1) // 2
    again = load(ARM)
    assert again.excluded_pairs == arm.excluded_pairs


def test_tested_pairs_can_be_free():
    arm = load(ARM)
    rng = np.random.default_rng(5)
    geometry_data = pin.GeometryData(arm.geometry)
    ever_free = np.zeros(len(arm.geometry.collisionPairs), dtype=bool)
    for _ in range(400):
        q = arm.with_joints(arm.neutral, {name: rng.uniform(-2.4, 2.4) for name in arm.joints})
        pin.updateGeometryPlacements(arm.model, arm.model.createData(), arm.geometry, geometry_data, arm.clamp(q))
        pin.computeCollisions(arm.geometry, geometry_data, False)
        ever_free |= np.array([not result.isCollision() for result in geometry_data.collisionResults])
    assert ever_free.all()


def test_kinematics_are_pinocchios_with_either_root():
    reference = pin.buildModelFromUrdf(str(ARM))
    arm, floating = load(ARM), load(str(ARM), root="free")
    assert floating.model.nv == arm.model.nv + 6
    assert floating.dofs(["root"]).tolist() == list(range(6))
    values = dict.fromkeys(arm.joints, 0.3)
    q = arm.with_joints(arm.neutral, values)
    data, expected = arm.model.createData(), reference.createData()
    pin.framesForwardKinematics(arm.model, data, q)
    pin.framesForwardKinematics(reference, expected, q)
    tool = data.oMf[arm.frame_id("tool")]
    assert tool.homogeneous == pytest.approx(expected.oMf[reference.getFrameId("tool")].homogeneous)
    assert arm.joint_values(q) == pytest.approx(values)


def test_neutral_is_within_limits():
    arm = load(ARM)
    assert arm.within_limits(arm.neutral)
    assert arm.joint_values(arm.neutral)["spin"] == pytest.approx(0.2)
    assert "turn" not in {arm.joints[k] for k in arm.limits.idx_v}  # continuous


def write(tmp_path, text, name="robot.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_mesh_is_found_in_a_package_folder_or_beside_the_file(tmp_path):
    path = write(tmp_path, TEXT)
    with pytest.raises(FileFormatError, match=r"link 'tool'.*bracket\.stl.*not found.*package_dirs"):
        load(path)
    assert load(path, package_dirs=[ARM.parents[1]]).geometry.ngeoms == load(ARM).geometry.ngeoms
    relative = TEXT.replace("package://arm/meshes", "meshes")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "bracket.stl").write_bytes((ARM.parent / "meshes" / "bracket.stl").read_bytes())
    assert load(write(tmp_path, relative)).geometry.ngeoms == load(ARM).geometry.ngeoms


def test_a_marked_cylinder_is_a_capsule(tmp_path):
    text = """<robot name="r"><link name="a"><collision name="rod">
    <geometry><cylinder radius="0.1" length="0.5"/></geometry>
    </collision><collision_checking><capsule name="rod"/></collision_checking></link></robot>"""
    shape = load(write(tmp_path, text)).geometry.geometryObjects[0].geometry
    assert (type(shape).__name__, shape.radius, shape.halfLength) == ("Capsule", 0.1, 0.25)


WRONG = {
    "broken XML": (TEXT.replace("</robot>", ""), "XML is broken.*line"),
    "not a robot": ("<scene/>", "<scene>, not <robot>"),
    "no links": ("<robot name='r'/>", "no links"),
    "unknown joint type": (
        TEXT.replace('type="continuous"', 'type="hinge"'),
        "joint 'turn' has the type 'hinge'; use one of revolute",
    ),
    "unknown parent": (
        TEXT.replace('<parent link="upper"/>', '<parent link="uper"/>'),
        "'uper', which is not in the file",
    ),
    "two roots": (TEXT + "", None),
    "limits exchanged": (
        TEXT.replace('lower="-2" upper="2"', 'lower="2" upper="-2"'),
        "joint 'shoulder'.*above the upper",
    ),
    "not a number": (TEXT.replace('size="0.24 0.24 0.1"', 'size="0.24 nan 0.1"'), "link 'base'.*3 finite numbers"),
    "negative size": (TEXT.replace('radius="0.045"', 'radius="-0.045"'), "link 'wrist1'.*above zero"),
    "unknown shape": (TEXT.replace('<sphere radius="0.045"/>', '<cone radius="0.045"/>'), "<cone>"),
    "zero axis": (TEXT.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', 1), "zero axis"),
    "two links of one name": (
        TEXT.replace('<link name="fore">', '<link name="upper">'),
        "two links are called 'upper'",
    ),
    "a second parent": (TEXT.replace('<child link="fore"/>', '<child link="upper"/>'), "already hangs on 'column'"),
}
WRONG["two roots"] = (TEXT.replace("</robot>", '<link name="loose"/></robot>'), "2 roots: base, loose")


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_one_sentence_with_place_and_mend(what, tmp_path):
    text, words = WRONG[what]
    path = write(tmp_path, text)
    with pytest.raises(FileFormatError, match=words) as caught:
        load(path, package_dirs=[ARM.parents[1]])
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_loop_is_no_tree(tmp_path):
    text = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
    <joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>
    <joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint></robot>"""
    with pytest.raises(FileFormatError, match="loop"):
        load(write(tmp_path, text))


@pytest.mark.parametrize("name", ["nowhere.urdf", "robot.stl", "folder/robot.xacro"])
def test_a_file_that_is_not_there_or_no_urdf(name):
    with pytest.raises(FileFormatError, match=r"no such file|a figure is a URDF"):
        load(name)


def test_binary_and_damaged_mesh(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"\xff\xfe\x00\x81" * 50)
    with pytest.raises(FileFormatError, match="not a text file"):
        load(path)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "bracket.stl").write_bytes(b"")
    with pytest.raises(FileFormatError, match=r"link 'tool'.*bracket\.stl"):
        load(write(tmp_path, TEXT.replace("package://arm/meshes", "meshes")))


def test_finer_pieces_can_be_asked_for_and_added_volume_is_said():
    fine, hulls = load(ARM, concavity=0.05), load(ARM)
    count = [sum(p.name.startswith("tool") for p in arm.geometry.geometryObjects) for arm in (fine, hulls)]
    assert count[0] > count[1] == 1
    # The hull of the bracket is a pentagon of 0.00755 m^2, the bracket itself has 0.0051 m^2.
    assert any("'tool'" in note and "48% more volume" in note for note in hulls.notes), hulls.notes


MASS, ORIGIN = '<mass value="5"/>', '<origin xyz="0 0 0.05"/>'
ODD = {
    "NaN mass": (MASS, '<mass value="nan"/>', "a finite number"),
    "a mass as Python writes it": (MASS, '<mass value="1_0"/>', "a finite number"),
    "negative mass": (MASS, '<mass value="-1"/>', "has the mass -1; give kilograms"),
    "huge mass": (MASS, '<mass value="2147483647"/>', "at most 1e.09"),
    "no mass": (MASS, "", "without <mass>"),
    "NaN inertia": ('ixx="0.01"', 'ixx="nan"', "ixx='nan'; give a finite number"),
    "huge origin": (ORIGIN, '<origin xyz="0 0 1e300"/>', "at most 10000"),
    "NaN origin": (ORIGIN, '<origin xyz="0 0 nan"/>', "3 finite numbers"),
    "huge angle": (ORIGIN, '<origin xyz="0 0 0.05" rpy="0 0 1e300"/>', r"at most 1e.06"),
    "huge velocity": ('velocity="2"/>', 'velocity="1e300"/>', "at most 1e.20"),
    "negative velocity": ('velocity="2"/>', 'velocity="-2"/>', "velocity limit -2; give a number that is not negative"),
    "NaN velocity": ('velocity="2"/>', 'velocity="nan"/>', "a finite number"),
    "NaN limit": ('lower="-2"', 'lower="nan"', "a finite number"),
    "huge size": ('<sphere radius="0.045"/>', '<sphere radius="1e300"/>', "at most 10000"),
    "too many digits": ('<sphere radius="0.045"/>', f'<sphere radius="{"9" * 5000}"/>', "a finite number"),
    "zero scale": ('scale="1 1 1"', 'scale="1 0 1"', "give no zeros"),
    "unknown encoding": ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="foo"?>', "encoding cannot be read"),
    "a long encoding": (
        '<?xml version="1.0"?>',
        f'<?xml version="1.0" encoding="utf-{"9" * 5000}"?>',
        "encoding cannot be read",
    ),
    "an encoding of many bytes": ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="shift_jis"?>', "encoding"),
}


@pytest.mark.parametrize("what", ODD)
def test_numbers_and_encodings_that_no_robot_has_are_refused(what, tmp_path):
    before, after, words = ODD[what]
    assert before in TEXT
    path = write(tmp_path, TEXT.replace(before, after, 1))
    with pytest.raises(FileFormatError, match=words) as caught:
        load(path, package_dirs=[ARM.parents[1]])
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_blanks_around_numbers_change_nothing(tmp_path):
    """Pinocchio's reader drops an inertial whose mass has blanks around it, and takes such a moment for 0."""
    text = TEXT.replace(MASS, '<mass value=" 5 "/>', 1).replace('ixx="0.01"', 'ixx=" 0.01 "', 1)
    arm, spaced = load(ARM), load(write(tmp_path, text), package_dirs=[ARM.parents[1]])
    assert text != TEXT
    for one, other in zip(arm.model.inertias, spaced.model.inertias, strict=True):
        np.testing.assert_array_equal(one.toDynamicParameters(), other.toDynamicParameters())


def test_another_encoding_is_read(tmp_path):
    text = TEXT.replace('<?xml version="1.0"?>', '<?xml version="1.0" encoding="latin-1"?>').replace("arm of", "Ärm of")
    path = tmp_path / "robot.urdf"
    path.write_bytes(text.encode("latin-1"))
    assert load(path, package_dirs=[ARM.parents[1]]).joints == load(ARM).joints


def test_limits_that_are_missing_are_none_and_told(tmp_path):
    limit = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'
    cases = {
        "": "has no <limit>",
        '<limit effort="1" velocity="1"/>': "neither lower nor upper",
        '<limit lower="-1e+16" upper="1e+16" effort="1" velocity="1"/>': "",
        '<limit lower="-2" upper="2"/>': "",
    }
    for written, words in cases.items():
        arm = load(write(tmp_path, TEXT.replace(limit, written, 1)), package_dirs=[ARM.parents[1]])
        joint = arm.model.joints[arm.joint_id("shoulder")]
        assert any(note.startswith("joint 'shoulder'") and words in note for note in arm.notes) == bool(words)
        assert (joint.idx_q in arm.limits.idx_q) == ("-2" in written)
        assert np.isfinite(arm.neutral).all()
    assert np.isinf(arm.model.velocityLimit[joint.idx_v])


def test_planar_and_floating_joints_are_taken(tmp_path):
    text = """<robot name="r"><link name="a"/><link name="b"><collision><geometry><sphere radius="0.1"/></geometry>
    </collision></link><link name="c"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
    <joint name="p" type="planar"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
    <joint name="f" type="floating"><parent link="a"/><child link="c"/></joint></robot>"""
    figure = load(write(tmp_path, text))
    assert figure.model.nv == 9
    assert sorted(figure.joints) == ["f", "p"]


def test_a_package_is_found_where_ros_names_it(tmp_path, monkeypatch):
    path = write(tmp_path, TEXT)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere{os.pathsep}{ARM.parents[1]}")
    assert load(path).geometry.ngeoms == load(ARM).geometry.ngeoms
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    (tmp_path / "install" / "share").mkdir(parents=True)
    (tmp_path / "install" / "share" / "arm").symlink_to(ARM.parent)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert load(path).geometry.ngeoms == load(ARM).geometry.ngeoms
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    with pytest.raises(FileFormatError, match="not found"):
        load(path)


def test_a_mesh_without_triangles_and_a_flat_box_do_not_refuse_the_robot(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "bracket.stl").write_text("solid nothing\nendsolid nothing\n")
    text = TEXT.replace("package://arm/meshes", "meshes").replace('size="0.24 0.24 0.1"', 'size="0.24 0.24 0"')
    arm = load(write(tmp_path, text))
    assert any("'tool'" in note and "left out" in note for note in arm.notes)
    assert any("'base'" in note and "thick" in note for note in arm.notes)


def test_more_joints_than_memory_suffices_for_are_refused_at_once(tmp_path):
    links = [f'<link name="l{k}"/>' for k in range(2001)]
    joints = [
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(2000)
    ]
    path = write(tmp_path, f'<robot name="r">{"".join(links + joints)}</robot>')
    with pytest.raises(InputError, match="2000 degrees of freedom need 1024 GB"):
        load(path)


def test_a_figure_without_limits_can_be_pickled_and_copied(tmp_path):
    """Pinocchio writes an infinite limit into its archives, and cannot read it again."""
    text = re.sub(r"<limit [^>]*/>", "", TEXT)
    arm = load(write(tmp_path, text), package_dirs=[ARM.parents[1]])
    assert np.isinf(arm.model.velocityLimit).any()
    for same in (pickle.loads(pickle.dumps(arm)), copy.deepcopy(arm)):
        for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit", "effortLimit"):
            assert np.array_equal(getattr(same.model, name), getattr(arm.model, name))
        assert same.joints == arm.joints


@pytest.mark.parametrize("zero", ["0", "0.0", "-0", "0e3"])
def test_a_velocity_limit_of_zero_is_none_and_told(tmp_path, zero):
    text = TEXT.replace('effort="100" velocity="2"/>', f'effort="100" velocity="{zero}"/>', 1)
    arm = load(write(tmp_path, text), package_dirs=[ARM.parents[1]])
    told = [note for note in arm.notes if "velocity limit is 0, which is read as none" in note]
    assert len(told) == 1
    name = told[0].split("'")[1]
    assert arm.model.velocityLimit[arm.dofs([name])[0]] == np.inf
    assert (arm.model.velocityLimit > 0.0).all()


def test_a_limit_of_minus_one_is_none_and_told(tmp_path):
    """Exporters write -1 for no limit, as Halodi's eve_r3 has it."""
    text = TEXT.replace('effort="100" velocity="2"/>', 'effort="-1" velocity="-1"/>', 1)
    arm = load(write(tmp_path, text), package_dirs=[ARM.parents[1]])
    told = [note for note in arm.notes if "limit is -1, which is read as none" in note]
    assert len(told) == 2
    index = arm.dofs([told[0].split("'")[1]])[0]
    assert (arm.model.velocityLimit[index], arm.model.effortLimit[index]) == (np.inf, np.inf)


def test_a_joint_whose_upper_limit_is_minus_zero_is_one_that_does_not_move(tmp_path):
    """`-0.0` is not below `0.0`, and numpy refuses to draw numbers between the two."""
    path = tmp_path / "robot.urdf"
    links = [
        f'<link name="l{k}"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'
        for k in range(4)
    ]
    joints = [
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0 0 0.3"/>'
        f'<axis xyz="0 1 0"/><limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'
        for k, (low, high) in enumerate([("-1", "1"), ("0.0", "-0.0"), ("-2", "2")])
    ]
    path.write_text(f'<robot name="r">{"".join(links + joints)}</robot>')
    robot = load(path)
    q = np.array((0.3, 0.0, -0.5))
    tip = tuple(robot.placement(q, "l3").translation)
    for method in ("qp", "ccd"):
        solution = wb.solve(wb.Problem(wb.Scene(robot), goals=[wb.Point("l3", tip)]), method=method)
        assert solution.q[1] == 0.0
        assert not np.signbit([robot.model.lowerPositionLimit, robot.model.upperPositionLimit])[:, 1].any()


@pytest.mark.parametrize("root", [None, "free", "fixed"])
def test_a_file_that_floats_on_an_empty_link_has_one_root(root, tmp_path):
    """As the maker's H1 does, for MuJoCo: it went about on two free joints, one on the other."""
    text = """<robot name="r"><link name="world"/><link name="pelvis"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><link name="leg"/>
    <joint name="floating_base" type="floating"><origin xyz="0.5 0 1" rpy="0 0 0.3"/><parent link="world"/>
    <child link="pelvis"/></joint>
    <joint name="hip" type="continuous"><parent link="pelvis"/><child link="leg"/><axis xyz="0 1 0"/></joint></robot>"""
    figure = load(write(tmp_path, text), **({} if root is None else {"root": root}))
    assert figure.joints == ("hip",)
    assert figure.root == (root or "free")
    assert figure.model.nv == (1 if root == "fixed" else 7)
    srdf = tmp_path / "robot.srdf"
    srdf.write_text("""<robot name="r"><group name="all">
    <chain base_link="world" tip_link="leg"/></group><group name="rest"><joint name="floating_base"/></group>
    <group_state name="home" group="all"><joint name="hip" value="0.3"/></group_state>
    <group_state name="off" group="rest"><joint name="floating_base" value="0 0 2 0 0 0 1"/></group_state>
    <disable_collisions link1="world" link2="leg"/></robot>""")
    described = load(tmp_path / "robot.urdf", srdf=srdf, **({} if root is None else {"root": root}))
    for one, posture in ((figure, "neutral"), (described, "home")):  # they were at the world's origin
        placed = one.placement(one.posture(posture), "pelvis")
        np.testing.assert_allclose(placed.translation, (0.5, 0.0, 1.0), atol=1e-12)
        np.testing.assert_allclose(pin.rpy.matrixToRpy(placed.rotation), (0.0, 0.0, 0.3), atol=1e-12)
    assert described.groups["all"] == ("hip",)  # it was empty: the link of the world is cut
    if root == "fixed":
        assert [note for note in described.notes if "SRDF" in note] == [
            "SRDF: state 'off' names the joint 'floating_base', which does not move"
        ]
    else:
        assert not [note for note in described.notes if "SRDF" in note]
        np.testing.assert_allclose(described.posture("off")[:3], (0.5, 0.0, 3.0))  # from the joint's origin

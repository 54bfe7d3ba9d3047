"""Any URDF: a robot arm with every kind of shape, and files that are wrong."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wholebody.errors import FileFormatError, InputError, UnknownNameError
from wholebody.figures import load

ARM = Path(__file__).resolve().parents[1] / "data" / "arm" / "arm.urdf"
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


def test_options_are_checked():
    with pytest.raises(InputError, match="'fixed' or 'free'"):
        load(ARM, root="floating")
    with pytest.raises(UnknownNameError, match="package_dirs"):
        load(ARM, package_dir=".")


def test_finer_pieces_can_be_asked_for_and_added_volume_is_said():
    fine, hulls = load(ARM, concavity=0.05), load(ARM)
    count = [sum(p.name.startswith("tool") for p in arm.geometry.geometryObjects) for arm in (fine, hulls)]
    assert count[0] > count[1] == 1
    # The hull of the bracket is a pentagon of 0.00755 m^2, the bracket itself has 0.0051 m^2.
    assert any("'tool'" in note and "48% more volume" in note for note in hulls.notes), hulls.notes

"""MJCF files: kinematics, masses, limits and contacts as MuJoCo has them, and sentences on what is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.figures.mjcf.random_files import mjcf
from wholebody.base.errors import FileFormatError, InputError
from wholebody.figures.link_pieces import drawn_of

mujoco = pytest.importorskip("mujoco", reason="MuJoCo, which reads MJCF files, is not installed")

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<asset><mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/></asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 0.1" pos="0 0 -1"/>
  <body name="base"><geom type="box" size="0.05 0.05 0.05"/>
    <body name="upper" pos="0 0 0.1"><joint name="swing" axis="0 1 0" range="-1 1" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02"/>
      <body name="fore" pos="0 0 0.25"><joint name="roll" axis="1 0 0"/>
        <geom type="cylinder" size="0.02 0.1" pos="0 0 0.1"/>
        <geom type="ellipsoid" size="0.02 0.03 0.04" pos="0 0 0.2"/>
        <body name="hand" pos="0 0 0.25"><joint name="slide" type="slide" axis="0 0 1" range="0 0.1" limited="true"/>
          <geom type="mesh" mesh="wedge"/><geom type="sphere" size="0.03" contype="0" conaffinity="0"/>
          <site name="tip" pos="0 0 0.1"/>
</body></body></body></body></worldbody></mujoco>"""


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    (folder / name).write_text(text)
    return folder / name


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    return written(tmp_path, ARM, "arm.xml")


def test_bodies_joints_and_geoms_are_read(arm: Path) -> None:
    figure = wb.load(arm)
    assert (figure.name, figure.root, figure.joints) == ("arm", "fixed", ("swing", "roll", "slide"))
    kinds = {piece.name: type(piece.geometry).__name__ for piece in figure.geometry.geometryObjects}
    assert kinds.pop("base:0") == "Box"
    assert kinds == {"upper:0": "Capsule", "fore:0": "Convex", "fore:1": "Ellipsoid", "hand:0": "Convex"}
    assert figure.limits.upper == pytest.approx([1.0, 0.1])
    assert figure.notes == ("1 geoms of the world are no part of the robot: wb.read_scene(path) has them",)
    scene = wb.Scene(figure)
    data = figure.model.createData()
    q = figure.with_joints(figure.neutral, {"swing": 0.4, "roll": -0.7, "slide": 0.06})
    pin.framesForwardKinematics(figure.model, data, q)
    target = data.oMf[figure.frame_id("tip")].translation.copy()
    assert wb.solve(wb.Problem(scene, goals=[wb.Point("tip", target)])).solved
    assert wb.load(arm, root="free").root == "free"


def configuration(model: object, figure: wb.Figure, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's random configuration, with followers where they are led to, and ours."""
    rng, theirs = np.random.default_rng(seed), mujoco.MjData(model)
    q = pin.neutral(figure.model)
    for k in range(model.njnt):  # type: ignore[attr-defined]
        joint = model.joint(k)  # type: ignore[attr-defined]
        body = model.body(joint.bodyid[0])  # type: ignore[attr-defined]
        kind, at = int(joint.type[0]), int(joint.qposadr[0])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            place = pin.SE3.Random()
            x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(place)
            theirs.qpos[at : at + 7], q[:7] = (x, y, z, qw, qx, qy, qz), (x, y, z, qx, qy, qz, qw)
            continue
        siblings = [j for j in range(model.njnt) if model.jnt_bodyid[j] == body.id]  # type: ignore[attr-defined]
        named = body.name or f"body{body.id}"
        number = [j for j in siblings if not model.joint(j).name].index(k) if not joint.name else 0  # type: ignore[attr-defined]
        name = joint.name or f"{named}_joint" + (f"_{number + 1}" if number else "")
        if kind == mujoco.mjtJoint.mjJNT_BALL:
            turn = pin.Quaternion(pin.SE3.Random().rotation)
            theirs.qpos[at : at + 4] = (turn.w, turn.x, turn.y, turn.z)
            made = figure.model.joints[figure.joint_id(name)]
            q[made.idx_q : made.idx_q + 4] = turn.coeffs()
        elif name in figure.followers:
            theirs.qpos[at] = figure.followers[name].value(q)
        else:
            theirs.qpos[at] = q[figure.model.joints[figure.joint_id(name)].idx_q] = rng.uniform(-2.0, 2.0)
    return theirs.qpos.copy(), q


@pytest.mark.parametrize("first", range(0, 20, 10))
def test_random_files_are_mujocos(first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    for seed in range(first, first + 10):
        path = written(tmp_path, mjcf(seed), f"m{seed}.xml")
        model, figure = mujoco.MjModel.from_xml_path(str(path)), wb.load(path, samples=0)
        theirs, data = mujoco.MjData(model), figure.model.createData()
        theirs.qpos[:], q = configuration(model, figure, seed)
        mujoco.mj_forward(model, theirs)
        pin.framesForwardKinematics(figure.model, data, q)
        table = model.body("table").id
        for body in set(range(1, model.nbody)) - {table}:
            place = data.oMf[figure.frame_id(model.body(body).name or f"body{body}")]
            assert np.abs(place.translation - theirs.xpos[body]).max() < 1e-9, path
            assert np.abs(place.rotation.ravel() - theirs.xmat[body]).max() < 1e-9, path
        for site in range(model.nsite):
            there = data.oMf[figure.frame_id(model.site(site).name)].translation
            assert np.abs(there - theirs.site_xpos[site]).max() < 1e-9
        mass = sum(float(inertia.mass) for inertia in figure.model.inertias)
        assert mass == pytest.approx(float(model.body_mass.sum() - model.body_mass[table]), rel=1e-12)
        led = {follower.joint for follower in figure.followers.values()}
        for k in range(model.njnt):
            joint = model.joint(k)
            if not joint.name or joint.name in {*led, *figure.followers} or int(joint.type[0]) < 2:
                continue
            slot = figure.model.joints[figure.joint_id(joint.name)].idx_q
            ends = (figure.model.lowerPositionLimit[slot], figure.model.upperPositionLimit[slot])
            limited = bool(model.jnt_limited[k])
            assert ends == (pytest.approx(tuple(joint.range), abs=1e-12) if limited else (-np.inf, np.inf))


def test_includes_world_bodies_and_keyframes_are_kept(tmp_path: Path) -> None:
    written(tmp_path, ARM.replace('<body name="base">', '<body name="base" pos="0.3 0 1" quat="0 0 0 1">'), "arm.xml")
    path = written(
        tmp_path,
        '<mujoco><include file="arm.xml"/><worldbody><geom type="plane" size="1 1 1" pos="0 0 -2"/>'
        '<body name="target" mocap="true"><geom type="sphere" size="0.1"/></body></worldbody>'
        '<keyframe><key name="home" qpos="0.3 0.1 0.02"/></keyframe></mujoco>',
        "scene.xml",
    )
    figure = wb.load(path)
    assert figure.joints == ("swing", "roll", "slide")
    assert figure.placement(figure.neutral, "base").translation == pytest.approx([0.3, 0.0, 1.0])
    assert figure.joint_values(figure.posture("home")) == {"swing": 0.3, "roll": 0.1, "slide": 0.02}
    assert "things beside the robot (target)" in " ".join(figure.notes)


def test_pairs_are_those_of_the_file(tmp_path: Path) -> None:
    bits = ARM.replace('<geom type="box"', '<geom contype="2" conaffinity="2" type="box"')
    excluded = bits.replace("</mujoco>", '<contact><exclude body1="upper" body2="hand"/></contact></mujoco>')
    figure = wb.load(written(tmp_path, excluded))
    reasons = {frozenset((pair.a, pair.b)): pair.reason for pair in figure.excluded_pairs}
    assert reasons[frozenset(("base:0", "hand:0"))] == "their contact bits do not meet"
    assert reasons[frozenset(("upper:0", "hand:0"))] == "the file excludes them"
    named = bits.replace('type="sphere" size', 'name="ball" type="sphere" size')
    named = named.replace('<geom contype="2"', '<geom name="foot" contype="2"')
    pair = '<contact><pair geom1="foot" geom2="ball"/></contact></mujoco>'
    geometry = wb.load(written(tmp_path, named.replace("</mujoco>", pair)), samples=0).geometry
    names = [piece.name for piece in geometry.geometryObjects]
    tested = {frozenset((names[pair.first], names[pair.second])) for pair in geometry.collisionPairs}
    assert frozenset(("base:0", "hand:1")) in tested  # the ball can touch nothing else
    assert not [pair for pair in tested if "hand:1" in pair and "base:0" not in pair]


def test_a_linear_equality_is_followed_and_others_are_told(tmp_path: Path) -> None:
    linear = '<equality><joint joint1="swing" joint2="roll" polycoef="0.1 0.5 0 0 0"/></equality></mujoco>'
    figure = wb.load(written(tmp_path, ARM.replace("</mujoco>", linear)))
    values = figure.joint_values(figure.with_joints(figure.neutral, {"swing": 0.4}))
    assert values["swing"] == pytest.approx(0.1 + 0.5 * values["roll"])
    keys = '<keyframe><key name="home" qpos="0.3 0.4 0"/><key name="other" qpos="0.35 0.4 0"/></keyframe></mujoco>'
    told = wb.load(written(tmp_path, ARM.replace("</mujoco>", linear.replace("</mujoco>", keys))))
    assert [note for note in told.notes if "keyframe" in note] == [
        "keyframe 'other': the joint 'roll' is where its equality puts it"
    ]
    square = linear.replace("0.5 0 0 0", "0.5 1 0 0")
    notes = wb.load(written(tmp_path, ARM.replace("</mujoco>", square))).notes
    assert "joint 'swing': its <equality> is not linear in another joint, so it moves by itself" in notes


@pytest.mark.parametrize("seed", range(6))
def test_chains_of_equalities_hold_in_any_order_of_the_file(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    body = '<body pos="0.3 0 0"><joint name="j{}" axis="0 1 0" ref="{:.3f}"/><geom size="0.02"/>'
    tree = "".join(body.format(k, rng.uniform(-0.5, 0.5)) for k in range(5)) + 5 * "</body>"
    joint = '<joint joint1="j{}" joint2="j{}" polycoef="{:.3f} {:.3f} 0 0 0"/>'
    pairs = [rng.permutation((int(rng.integers(0, k)), k)) for k in range(1, 5)]
    laws = [joint.format(*pair, rng.uniform(-0.3, 0.3), rng.choice([-1.5, 0.5, 1.2])) for pair in pairs]
    text = f"<body><geom size='0.1'/>{tree}</body></worldbody><equality>{''.join(rng.permutation(laws))}"
    path = written(tmp_path, f'<mujoco><compiler angle="radian"/><worldbody>{text}</equality></mujoco>')
    model, figure = mujoco.MjModel.from_xml_path(str(path)), wb.load(path, samples=0)
    assert set(figure.followers) == {"j1", "j2", "j3", "j4"}
    theirs = mujoco.MjData(model)
    for value in (-0.4, 0.7):
        values = figure.joint_values(figure.with_joints(figure.neutral, {"j0": value}))
        theirs.qpos[:] = [values[model.joint(k).name] for k in range(model.njnt)]
        mujoco.mj_forward(model, theirs)
        assert np.abs(theirs.efc_pos[: theirs.ne]).max() < 1e-9
        assert theirs.ne == 4


def test_the_range_of_a_follower_that_leaves_its_leader_no_room_is_left_out(tmp_path: Path) -> None:
    linear = '<equality><joint joint1="slide2" joint2="slide" polycoef="0 1 0 0 0"/></equality></mujoco>'
    second = '<body><joint name="slide2" type="slide" range="0.2 0.3" limited="true"/><geom size="0.01"/></body>'
    text = ARM.replace("</mujoco>", linear).replace("<site", f"{second}<site")
    figure = wb.load(written(tmp_path, text))
    assert "joint 'slide2': its range leaves 'slide' no room, so it is left out" in figure.notes
    slot = figure.model.joints[figure.joint_id("slide")].idx_q
    assert (figure.model.lowerPositionLimit[slot], figure.model.upperPositionLimit[slot]) == (0.0, 0.1)


def test_a_ball_keeps_the_range_of_its_swing(tmp_path: Path) -> None:
    ball = ARM.replace(
        '<joint name="swing" axis="0 1 0" range="-1 1" limited="true"/>',
        '<joint name="swing" type="ball" range="0 0.8"/>',
    )
    figure = wb.load(written(tmp_path, ball))
    cone = figure.cones["swing"]
    assert cone.axis == pytest.approx([0.0, 0.0, 1.0])
    for angle, inside in ((0.7, True), (0.9, False)):
        assert cone.cone.contains([np.sin(angle), 0.0, np.cos(angle)]) == inside


def test_a_ball_at_the_world_keeps_its_range_beside_other_figures(tmp_path: Path) -> None:
    """The cone is of what carries the figure's world: no frame of its own has the name."""
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="arm">
    <joint name="ball" type="ball" range="0 0.8"/>
    <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/></body></worldbody></mujoco>"""
    alone = wb.load(written(tmp_path, text))
    turned = np.array([0.0, 0.0, 1.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])  # by 90 degrees about z
    hand = wb.load("hand")
    beside = wb.Scene({"one": (alone, turned), "other": alone}).figure
    held = hand.mounted(alone, on="right_palm", name="one", at=turned)
    for figure, prefix in ((alone, ""), (beside, "one/"), (beside, "other/"), (held, "one/")):
        problem = wb.Problem(wb.Scene(figure), constraints=[wb.tasks.ReachCones()])
        joint = figure.model.joints[figure.joint_id(f"{prefix}ball")]
        for axis in np.eye(3)[1:]:
            for angle, inside in ((0.7, True), (0.9, False)):
                q = figure.neutral.copy()
                q[joint.idx_q : joint.idx_q + 4] = pin.Quaternion(pin.exp3(angle * axis)).coeffs()
                assert (wb.assess(problem, q).constraint_violation < 1e-9) == inside


def test_one_of_several_robots_is_chosen(tmp_path: Path) -> None:
    second = '<body name="other" pos="1 0 0"><joint name="turn"/><geom size="0.1"/></body></worldbody>'
    path = written(tmp_path, ARM.replace("</worldbody>", second))
    with pytest.raises(InputError, match=r"2 robots.*root=: base, other"):
        wb.load(path)
    assert wb.load(path, root="other").joints == ("turn",)
    assert "other robots of the file (other) are not read" in " ".join(wb.load(path, root="base").notes)


WRONG = {
    "no bodies": ("<mujoco><worldbody/></mujoco>", "no bodies"),
    "an unknown joint": (ARM.replace('type="slide"', 'type="screw"'), "MuJoCo cannot read it .*screw"),
    "no mesh": (ARM.replace('vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"', 'file="gone.stl"'), "gone.stl"),
    "a long name": (ARM.replace('type="slide"', f'class="{"c" * 300}"'), "MuJoCo cannot read it .*unknown default"),
    "broken": (ARM[:-40], "MuJoCo cannot read it"),
    "another file": ("<scene/>", "<scene>, not <robot>"),
    "a part of a file": ("<mujocoinclude/>", "<mujocoinclude>, not <robot>; load the MJCF file that includes it"),
}


@pytest.mark.parametrize("ending", ["stl", "obj", "msh"])
def test_a_pointer_in_place_of_a_mesh_is_refused(ending: str, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / f"parts/hand.{ending}").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    arm = '<body><joint name="j"/><geom type="mesh" mesh="hand"/></body>'
    mesh = f'<compiler meshdir="parts"/><asset><mesh name="hand" file="hand.{ending}"/></asset>'
    with pytest.raises(FileFormatError, match=rf"hand\.{ending}: the file is a pointer of Git LFS"):
        wb.load(written(tmp_path, f"<mujoco>{mesh}<worldbody>{arm}</worldbody></mujoco>"))


def test_a_keyframe_that_is_no_posture_is_refused(tmp_path: Path) -> None:
    arm = '<body><joint name="j"/><geom size="0.1"/></body>'
    key = '<keyframe><key name="up" qpos="nan"/></keyframe>'
    with pytest.raises(FileFormatError, match="keyframe 'up' has values that are not finite"):
        wb.load(written(tmp_path, f"<mujoco><worldbody>{arm}</worldbody>{key}</mujoco>"))


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_one_sentence(what: str, tmp_path: Path) -> None:
    text, words = WRONG[what]
    path = written(tmp_path, text)
    with pytest.raises(FileFormatError, match=words) as caught:
        wb.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_urdf_may_be_called_xml(tmp_path: Path) -> None:
    assert wb.load(written(tmp_path, '<robot name="r"><link name="a"/></robot>')).frames == ("a",)


def test_what_is_drawn_is_what_mujocos_viewer_draws(tmp_path: Path) -> None:
    """Meshes as they are, in the colours of geoms, materials and textures; geoms of contacts alone are hidden."""
    text = ARM.replace(
        "<asset>",
        '<asset><texture name="chess" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>'
        '<texture name="gone" type="2d" file="gone.png"/>'
        '<material name="board" texture="chess"/><material name="green" rgba="0 1 0 1"/>'
        '<mesh name="corner" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1 .02 .02 .02" '
        'face="0 2 4 0 4 1 0 1 2 1 4 3 4 2 3 1 3 2"/>',
    ).replace(
        '<geom type="mesh" mesh="wedge"/>',
        '<geom type="mesh" mesh="corner" material="board" contype="0" conaffinity="0" pos="0 0 .02" euler=".3 0 0"/>'
        '<geom type="box" size=".01 .01 .01" material="green" group="1"/>'
        '<geom type="box" size=".02 .02 .02" material="green" rgba="0 0 1 1" group="4"/>',
    )
    figure = wb.load(written(tmp_path, text))
    assert any("textures are left out" in note for note in figure.notes)
    figure = wb.load(written(tmp_path, text.replace('<texture name="gone" type="2d" file="gone.png"/>', "")))
    assert not any("textures" in note for note in figure.notes)
    hand = [one for one in drawn_of(figure) if one.link == "hand"]
    kinds = {type(one.shape).__name__: one for one in hand}
    assert sorted(kinds) == ["Box", "Sphere", "tuple"]
    assert kinds["Box"].color == (0.0, 1.0, 0.0, 1.0)
    assert kinds["tuple"].color == pytest.approx((0.5, 0.0, 0.5, 1.0), abs=1e-6)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    theirs, data = mujoco.MjData(model), figure.model.createData()
    q = figure.with_joints(figure.neutral, {"swing": 0.4, "roll": -0.7, "slide": 0.06})
    theirs.qpos[:] = [0.4, -0.7, 0.06]
    mujoco.mj_forward(model, theirs)
    pin.forwardKinematics(figure.model, data, q)
    vertices, faces = kinds["tuple"].shape
    place = data.oMi[figure.joint_id(kinds["tuple"].joint)].homogeneous @ kinds["tuple"].placement
    geom = next(k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_MESH)
    first = model.mesh_vertadr[model.geom_dataid[geom]]
    wanted = (
        model.mesh_vert[first : first + len(vertices)] @ theirs.geom_xmat[geom].reshape(3, 3).T + theirs.geom_xpos[geom]
    )
    np.testing.assert_allclose(vertices @ place[:3, :3].T + place[:3, 3], wanted, atol=1e-6)
    assert len(faces) == 6
    assert wb.load(written(tmp_path, ARM.replace('type="mesh" mesh="wedge"', 'size=".01"'))).visual is not None


def test_joints_that_are_parked_without_a_shape_are_no_robot(tmp_path: Path) -> None:
    parked = '<body name="unused" pos="0 0 20"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint/></body>'
    figure = wb.load(written(tmp_path, ARM.replace("</worldbody>", f"{parked}</worldbody>")))
    assert figure.joints == ("swing", "roll", "slide")
    assert "bodies without a shape beside the robot (unused) are not kept" in figure.notes


def test_what_mujoco_reads_of_files_that_are_not_quite_xml_is_read(tmp_path: Path) -> None:
    head = "\ufeff<?xml version='1.0'?>\n<!-- <robot> -->\n"
    assert wb.load(written(tmp_path, head + ARM + "\n</mujoco>\n")).joints == ("swing", "roll", "slide")


def test_what_mujoco_warns_of_leaves_no_log_in_the_callers_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    body = '<body pos="nan 0 1"><joint/><geom size="0.1"/></body>'
    path = written(tmp_path, f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(InputError, match="not finite"):
        wb.load(path)
    assert list(tmp_path.iterdir()) == [path]


def test_declarations_and_two_bytes_a_letter_do_not_hide_what_a_file_is(arm: Path, tmp_path: Path) -> None:
    declared = written(tmp_path, '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "y">]>\n' + ARM)
    assert wb.load(declared).joints == wb.load(arm).joints
    (tmp_path / "wide.xml").write_bytes(ARM.encode("utf-16"))
    with pytest.raises(FileFormatError, match="MuJoCo cannot read it"):
        wb.load(tmp_path / "wide.xml")

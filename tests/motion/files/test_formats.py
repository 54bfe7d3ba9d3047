"""Formats of clips: round trips, damaged files, and what other readers find in what is written."""

from __future__ import annotations

import io
import json
import os
import struct
import warnings
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.clip import MOST_FRAMES

CLOSE = {".npz": 1e-14, ".csv": 1e-14, ".txt": 1e-6, ".bvh": 1e-4}
"""Radians and metres by which a file may change a value; near a gimbal lock three angles lose digits of a rotation."""


def swinging(figure: Figure, frames: int, seed: int, dt: float = 0.04) -> wb.Clip:
    """A clip that moves between random postures within the limits, its root turning all the way round."""
    random = np.random.default_rng(seed)
    low, high = figure.limits.lower, figure.limits.upper
    ends = [low + random.uniform(0.05, 0.95, len(low)) * (high - low) for _ in range(2)]
    q = np.tile(figure.neutral, (frames, 1))
    for k in range(frames):
        share = k / max(1, frames - 1)
        q[k, figure.limits.idx_q] = (1.0 - share) * ends[0] + share * ends[1]
        turn = pin.AngleAxis(6.5 * share, np.array([0.6, 0.0, 0.8])).matrix()
        q[k, :7] = pin.SE3ToXYZQUAT(pin.SE3(turn, np.array([share, -0.5 * share, 1.0])))
    return wb.Clip(figure, q, dt, "swing")


def furthest(clip: wb.Clip, other: wb.Clip) -> float:
    model = clip.figure.model
    return max(float(np.abs(pin.difference(model, a, b)).max()) for a, b in zip(clip.q, other.q, strict=True))


@pytest.mark.parametrize("ending", CLOSE)
@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(2, 5), dt=st.floats(1e-3, 1.0))
@settings(max_examples=6)
def test_what_is_written_is_read_again(
    ending: str, seed: int, frames: int, dt: float, human: Figure, tmp_path_factory: pytest.TempPathFactory
) -> None:
    clip = swinging(human, frames, seed, dt)
    path = tmp_path_factory.getbasetemp() / f"again{ending}"
    again = wb.read_clip(clip.write(path), human)
    assert furthest(clip, again) < CLOSE[ending]
    assert again.dt == pytest.approx(dt, rel=1e-9)


ONE = """<robot name="one"><link name="base"/><link name="arm"/><joint name="j" type="revolute"><parent link="base"/>
<child link="arm"/><origin xyz="0 0 {}"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint></robot>"""
ARM = Path(__file__).parents[2] / "data" / "arm" / "arm.urdf"


@pytest.mark.parametrize("name", ["left hand", "one joint", "at the base", "one body", "arm", "small arm"])
@pytest.mark.parametrize("root", ["free", "fixed"])
def test_bodies_of_any_size_and_shape_are_read_again_from_bvh(name: str, root: str, tmp_path: Path) -> None:
    """Their size is no person's, and the first frame is at rest: the file says what it is."""
    texts = {"one joint": ONE.format(0.1), "at the base": ONE.format(0)}
    texts |= {"one body": '<robot name="body"><link name="base"/></robot>', "small arm": ONE.format(0.002)}
    path = tmp_path / "robot.urdf"
    path.write_text(texts.get(name, ""))
    options = {"side": "left"} if name == "left hand" else {"root": root}
    figure = wb.load({"left hand": "hand", "arm": ARM}.get(name, path), **options)
    random = np.random.default_rng(0)
    q = np.tile(pin.neutral(figure.model), (5, 1))
    for k in range(1, 5):
        q[k] = pin.integrate(figure.model, q[0], random.normal(0.0, 0.3, figure.model.nv))
    clip = wb.Clip(figure, np.array([figure.clamp(each) for each in q]), 0.02)
    again = wb.read_clip(clip.write(tmp_path / "a.bvh"), figure)
    assert len(again) == 5
    assert figure.model.nv == 0 or furthest(clip, again) < 1e-6


def test_a_joint_profile_is_text_as_the_thesis_writes_it(human: Figure, tmp_path: Path) -> None:
    clip = swinging(human, 3, 1)
    lines = clip.write(tmp_path / "a.txt").read_text().splitlines()
    rows = [line for line in lines if not line.startswith("#")]
    assert float(rows[0]) == clip.dt
    assert int(rows[1]) == 3
    assert [len(row.split("\t")) for row in rows[2:]] == [55] * 3
    values = np.array([row.split("\t") for row in rows[2:]], dtype=float)
    assert values[:, :3] == pytest.approx(clip.q[:, :3], abs=1e-8)
    assert values[:, 6:] == pytest.approx(clip.q[:, 7:], abs=1e-8)
    turns = [
        pin.utils.rotate("x", a) @ pin.utils.rotate("y", b) @ pin.utils.rotate("z", c) for a, b, c in values[:, 3:6]
    ]
    for turn, q in zip(turns, clip.q, strict=True):
        assert turn == pytest.approx(pin.Quaternion(q[3:7]).matrix(), abs=1e-8)


def test_a_joint_profile_of_other_hands_is_read(human: Figure, tmp_path: Path) -> None:
    """Comments anywhere, blank lines, spaces for tabs, six digits, and a line end of Windows."""
    row = " ".join(f"{0.01 * k:.6f}" for k in range(55))
    text = f"# Joint profiles in rad\r\n\r\n0.033333\r\n2\r\n# frames\r\n{row}\r\n  {row}  \r\n"
    (tmp_path / "a.txt").write_bytes(text.encode())
    clip = wb.read_clip(tmp_path / "a.txt", human)
    assert len(clip) == 2
    assert clip.dt == 0.033333
    assert clip.q[0, 7:] == pytest.approx(0.01 * np.arange(6, 55), abs=1e-9)


PROFILE = ["# comment", "0.1", "2", "\t".join(["0"] * 55), "\t".join(["0"] * 55)]


@pytest.mark.parametrize(
    ("line", "text", "sentence"),
    [
        (1, "0", r"line 2: the time step is 0 s"),
        (1, "nan", r"line 2: nan is not finite"),
        (2, "3", r"line 5: 2 rows and not 3"),
        (2, "two", r"line 3: 'two' is no number of frames"),
        (3, "0\t1", r"line 4: 2 values and not 55"),
        (4, "\t".join(["0"] * 54 + ["nan"]), r"line 5: Q49 is nan"),
    ],
)
def test_a_wrong_joint_profile_names_its_line(
    line: int, text: str, sentence: str, human: Figure, tmp_path: Path
) -> None:
    lines = list(PROFILE)
    lines[line] = text
    (tmp_path / "a.txt").write_text("\n".join(lines))
    with pytest.raises(wb.FileFormatError, match=rf"^a\.txt, {sentence}"):
        wb.read_clip(tmp_path / "a.txt", human)


@pytest.mark.parametrize("ending", CLOSE)
@given(data=st.data())
@settings(max_examples=20)
def test_a_damaged_file_is_one_sentence_or_a_clip(
    ending: str, data: st.DataObject, human: Figure, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp()
    whole = folder / f"whole{ending}"
    if not whole.exists():
        swinging(human, 3, 0).write(whole)
    content = bytearray(whole.read_bytes())
    del content[data.draw(st.integers(0, len(content))) :]
    words = [b"nan", b" ", b"\n", b"}", b"1e400", b"\xff", b"ROOT x\n", b"-", b"\x00"]
    for _ in range(data.draw(st.integers(0, 3))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 8))] = data.draw(st.sampled_from(words))
    damaged = folder / f"damaged{ending}"
    damaged.write_bytes(content)
    try:
        clip = wb.read_clip(damaged, human)
        said = "damaged, but finite" if np.isfinite(clip.q).all() else ""
    except wb.WholebodyError as error:
        said = str(error)
    assert "damaged" in said
    assert "\n" not in said
    assert len(said) < 400


# ---- glTF, read by the specification


def glb(path: Path) -> tuple[dict[str, Any], Callable[[int], np.ndarray]]:
    """The JSON of a GLB file, and a function: number of an accessor -> its values."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    tree = json.loads(data[20 : 20 + size])
    start = 20 + size + 8
    assert data[start - 4 : start] == b"BIN\0"
    assert tree["buffers"][0]["byteLength"] == len(data) - start

    def values(index: int) -> np.ndarray:
        accessor = tree["accessors"][index]
        view = tree["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5125: "<u4", 5123: "<u2"}[accessor["componentType"]]
        wide = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        begin = start + view["byteOffset"] + accessor.get("byteOffset", 0)
        found = np.frombuffer(data, dtype, wide * accessor["count"], begin).reshape(-1, wide)
        for end in {"min", "max"} & accessor.keys():
            assert getattr(found, end)(axis=0) == pytest.approx(accessor[end])
        return found

    return tree, values


def test_a_gltf_animation_moves_as_pinocchio_does(human: Figure, tmp_path: Path) -> None:
    clip = swinging(human, 6, 2)
    tree, values = glb(clip.write(tmp_path / "a.glb"))
    nodes, animation = tree["nodes"], tree["animations"][0]
    above = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    keys: dict[tuple[int, str], np.ndarray] = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        assert sampler["interpolation"] == "LINEAR"
        assert values(sampler["input"])[:, 0] == pytest.approx(clip.times, abs=1e-6)
        keys[channel["target"]["node"], channel["target"]["path"]] = values(sampler["output"])
        assert "matrix" not in nodes[channel["target"]["node"]]  # the specification forbids both

    def placed(index: int, frame: int) -> np.ndarray:
        node = nodes[index]
        at = np.array(node["matrix"]).reshape(4, 4).T if "matrix" in node else np.eye(4)
        turn = keys[index, "rotation"][frame] if (index, "rotation") in keys else node.get("rotation")
        place = keys[index, "translation"][frame] if (index, "translation") in keys else node.get("translation")
        if turn is not None:
            at[:3, :3] = pin.Quaternion(np.array(turn, dtype=float)).normalized().matrix()
        if place is not None:
            at[:3, 3] = place
        return placed(above[index], frame) @ at if index in above else at

    upward = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # our left, up, forward are its x, y, z
    data = human.model.createData()
    numbers = {node["name"]: k for k, node in enumerate(nodes)}
    for frame, q in enumerate(clip.q):
        pin.forwardKinematics(human.model, data, q)
        for joint, name in enumerate(human.model.names):
            found = placed(numbers[f"joint {name}"], frame)
            assert found[:3, 3] == pytest.approx(upward @ data.oMi[joint].translation, abs=2e-6)
            assert found[:3, :3] == pytest.approx(upward @ data.oMi[joint].rotation, abs=2e-6)
    assert [node["name"] for node in nodes if "mesh" in node] == ["body human"]  # one mesh, which bones bend
    for turns in (keys[key] for key in keys if key[1] == "rotation"):
        assert ((turns[1:] * turns[:-1]).sum(axis=1) > 0.0).all()  # the shorter way from key to key


# ---- BVH


def test_what_is_written_as_bvh_moves_as_pinocchio_does(human: Figure, tmp_path: Path) -> None:
    """Read by pybvh alone, whose kinematics is its own."""
    pybvh = pytest.importorskip("pybvh")
    clip = swinging(human, 40, 5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = pybvh.read_bvh_file(clip.write(tmp_path / "a.bvh"))
    places = 0.01 * read.joint_positions()[:, :, [2, 0, 1]]
    data = human.model.createData()
    for joint, name in (("left_forearm", "left_elbow"), ("right_foot", "right_ankle"), ("left_thigh", "left_hip")):
        at = read.joint_names.index(joint)
        for frame in (0, 17, 39):
            pin.framesForwardKinematics(human.model, data, clip.q[frame])
            assert places[frame, at] == pytest.approx(data.oMf[human.frame_id(name)].translation, abs=1e-6)
    assert np.abs(np.diff(read.joint_angles, axis=0)).max() < 1.6  # no flip of half a turn


@pytest.mark.parametrize("ending", ["bvh", "txt"])
@pytest.mark.parametrize("middle", [0, 4, 8])
def test_an_arm_straight_out_to_the_side_keeps_its_angles(
    ending: str, middle: int, human: Figure, tmp_path: Path
) -> None:
    """There the first and the third angle of a shoulder turn about one axis; so do those of the file's elbow."""
    ways = np.radians(90.0 + 6.0 * (np.arange(9.0) - middle))
    q = np.array(
        [
            human.with_joints(
                human.neutral,
                {"left_shoulder_flexion": 0.3, "left_shoulder_abduction": way, "left_shoulder_rotation": 0.5,
                 "left_elbow_flexion": way},
            )
            for way in ways
        ]
    )  # fmt: skip
    q[:, 3:7] = pin.Quaternion(pin.utils.rotate("x", 0.2) @ pin.utils.rotate("y", np.pi / 2)).coeffs()
    clip = wb.Clip(human, q, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        read = wb.read_clip(clip.write(tmp_path / f"a.{ending}"), human)
    assert furthest(read, clip) < 1e-5


BVH = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Yrotation Xposition Zposition Xrotation Yposition Zrotation
  JOINT Bip01 L Thigh
  {
    OFFSET 10 0 0
    CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
    JOINT shank
    {
      OFFSET 0 -40 0
      CHANNELS 2 Zrotation Xrotation
      End Site
      {
        OFFSET 0 -40 0
      }
    }
  }
  JOINT spine
  {
    OFFSET 0 100 0
    CHANNELS 3 Xrotation Zrotation Yrotation
  }
}
MOTION
Frames: 2
Frame Time: 0.05
30 1 2 40 90 50 12 0 0 10 20 30 40 50 10 20 30
31 1 3 41 91 51 12 0 0 11 21 31 41 51 11 21 31
"""
"""Rotations before places, all orders mixed, places of a joint, a joint of two rotations, a name with spaces."""


def turned(*turns: tuple[str, float]) -> np.ndarray:
    found = np.eye(3)
    for axis, degrees in turns:
        found = found @ pin.utils.rotate(axis, np.radians(degrees))
    return found


def test_channels_of_any_order_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(BVH)
    motion = wb.motion.read_skeleton(tmp_path / "a.bvh")
    assert motion.names == ("hips", "Bip01 L Thigh", "shank", "shank_end", "spine")
    assert motion.notes == ("y is up", "lengths are in centimetres")
    ours = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    root = np.array([1.0, 90.0, 2.0])
    hips = turned(("y", 30), ("x", 40), ("z", 50))
    thigh = root + hips @ (12.0, 0.0, 0.0)
    shank = thigh + hips @ turned(("y", 10), ("x", 20), ("z", 30)) @ (0.0, -40.0, 0.0)
    end = shank + hips @ turned(("y", 10), ("x", 20), ("z", 30)) @ turned(("z", 40), ("x", 50)) @ (0.0, -40.0, 0.0)
    for joint, place in enumerate((root, thigh, shank, end)):
        assert motion.positions[0, joint] == pytest.approx(0.01 * ours @ place, abs=1e-12)


def test_up_and_units_are_recognised_or_said(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(BVH)
    standing = BVH.replace("OFFSET 0 100 0", "OFFSET 0 0 100").replace("OFFSET 0 -40 0", "OFFSET 0 0 -40")
    (tmp_path / "z.bvh").write_text(standing)
    assert wb.motion.read_skeleton(tmp_path / "z.bvh").notes[0] == "z is up"
    said = wb.motion.read_skeleton(tmp_path / "a.bvh", unit="metres", up="z")
    assert said.notes == ()
    assert said.positions[0, 0] == pytest.approx([1.0, 90.0, 2.0])


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("HIERARCHY", "hello", r"line 1: is no BVH file"),
        ("  JOINT spine", "}\nROOT other\n{\n  JOINT spine", r"line \d+: a second root, 'other'"),
        ("Frames: 2", "Frames: 3", r"line 30: 2 frames and not 3; the file is cut off"),
        ("Frames: 2", "Frames: x", r"line 27: 'x' is no number of frames"),
        ("Frame Time: 0.05", "Frame Time: 0", r"line 28: the time step is 0 s"),
        ("31 1 3", "31 1 nan", r"line 30: value 3 is nan"),
        ("31 1 3", "31 1 a", r"line 30: 'a' is no number"),
        ("OFFSET 10 0 0", "OFFSET 10 0", r"line 8: an OFFSET has three numbers"),
        ("CHANNELS 2", "CHANNELS 3", r"line 13: CHANNELS are a count and as many names"),
        ("MOTION", "}\nMOTION", r"line 26: a brace that closes nothing"),
    ],
)
def test_a_wrong_bvh_names_its_line(old: str, new: str, sentence: str, human: Figure, tmp_path: Path) -> None:
    assert old in BVH
    (tmp_path / "a.bvh").write_text(BVH.replace(old, new, 1))
    with pytest.raises(wb.FileFormatError, match=rf"^a\.bvh, {sentence}"):
        wb.read_clip(tmp_path / "a.bvh", human)


def test_a_skeleton_of_unknown_bones_names_its_file(human: Figure, tmp_path: Path) -> None:
    text = BVH.replace("hips", "one").replace("Bip01 L Thigh", "two").replace("shank", "three").replace("spine", "four")
    (tmp_path / "a.bvh").write_text(text)
    with pytest.raises(wb.FileFormatError, match=r"^a\.bvh: no bones of the skeleton are known to belong to human"):
        wb.read_clip(tmp_path / "a.bvh", human)


# ---- AMASS


def amass(path: Path, **changed: Any) -> Path:
    random = np.random.default_rng(0)
    arrays = {
        "poses": random.uniform(-0.3, 0.3, (7, 156)),
        "trans": np.tile([0.0, 0.0, 0.9], (7, 1)),
        "mocap_framerate": np.array(60.0),
        "gender": np.array("male"),
        "betas": np.zeros(16),
    }
    arrays["poses"][:, :3] = (np.pi / 2, 0.0, 0.0)
    arrays |= changed
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_an_archive_of_amass_stands_upright_and_faces_forward(tmp_path: Path, human: Figure) -> None:
    """A root turned by a right angle about x takes the template's y (up) to z, and its z (forward) to -y."""
    motion = wb.motion.read_skeleton(amass(tmp_path / "a.npz", poses=np.tile([np.pi / 2] + [0.0] * 155, (7, 1))))
    at = dict(zip(motion.names, motion.positions[0], strict=True))
    assert motion.dt == pytest.approx(1 / 60)
    assert at["head"][2] > at["pelvis"][2] + 0.4 > at["left_ankle"][2] + 0.8
    assert at["left_foot"][1] < at["left_ankle"][1] - 0.1
    assert at["left_hip"][0] > at["right_hip"][0] + 0.1
    assert len(wb.read_clip(amass(tmp_path / "b.npz"), human)) == 7
    turned = np.tile([np.pi / 2] + [0.0] * 155, (7, 1))
    shaped = wb.motion.read_skeleton(amass(tmp_path / "c.npz", poses=turned.reshape(7, 52, 3)))
    np.testing.assert_array_equal(shaped.positions, motion.positions)


def test_an_archive_of_a_person_along_y_stands_too_and_its_unit_is_metres(tmp_path: Path) -> None:
    """A root of no turn leaves the template as it is: y up, z forward, its origin 1.15 m above the soles."""
    path = amass(tmp_path / "a.npz", poses=np.zeros((7, 156)), trans=np.tile([0.0, 1.15, 0.0], (7, 1)))
    found = wb.motion.read_skeleton(path)
    assert "y is up" in found.notes
    at = dict(zip(found.names, found.positions[0], strict=True))
    assert at["head"][2] > at["pelvis"][2] + 0.4 > at["left_ankle"][2] + 0.8
    assert 0.0 < at["left_ankle"][2] < 0.15
    assert at["left_foot"][0] > at["left_ankle"][0] + 0.1  # z of the file is x
    np.testing.assert_array_equal(wb.motion.read_skeleton(path, up="y").positions, found.positions)
    with pytest.warns(UserWarning, match="with z up the person lies, and with y up stands"):
        lying = wb.motion.read_skeleton(path, up="z")
    np.testing.assert_allclose(found.positions, lying.positions[:, :, [2, 0, 1]], atol=1e-12)
    with pytest.raises(wb.InputError, match=r"^a\.npz: an archive of AMASS has metres, not inches; leave the unit out"):
        wb.motion.read_skeleton(path, unit="inches")


def test_who_lies_on_the_floor_of_an_archive_with_the_feet_at_its_origin_lies(tmp_path: Path) -> None:
    path = amass(tmp_path / "a.npz", poses=np.zeros((7, 156)), trans=np.tile([0.0, 1.15, 0.12], (7, 1)))
    found = wb.motion.read_skeleton(path)
    assert "y is up" not in found.notes
    at = dict(zip(found.names, found.positions[0], strict=True))
    assert at["head"][1] > at["left_ankle"][1] + 1.3
    assert 0.02 < found.positions[:, :, 2].min() < found.positions[:, :, 2].max() < 0.4  # on the back


@pytest.mark.parametrize(("columns", "model", "down"), [(72, None, 0.22), (156, "smplh", 0.22), (165, None, 0.35)])
def test_a_body_of_amass_turns_about_its_pelvis_beside_the_place_of_the_archive(
    tmp_path: Path, columns: int, model: str | None, down: float
) -> None:
    """SMPL adds `trans` to vertices that turned about the pelvis, which is 22 cm below the template's origin."""
    poses = np.zeros((7, columns))
    poses[:, :3] = np.linspace(0.0, np.pi / 2, 7)[:, None] * [1.0, 0.0, 0.0]
    archive = amass(tmp_path / "a.npz", poses=poses, trans=np.zeros((7, 3)), surface_model_type=model)
    motion = wb.motion.read_skeleton(archive)
    pelvis = motion.positions[:, motion.names.index("pelvis")]
    np.testing.assert_allclose(pelvis, np.tile([0.0, -down, 0.02], (7, 1)), atol=0.01)
    named = amass(tmp_path / "b.npz", poses=poses[:, :66], trans=np.zeros((7, 3)), surface_model_type="smplx")
    assert wb.motion.read_skeleton(named).positions[0, 0, 1] == pytest.approx(-0.35, abs=0.01)


class Unpacked:
    """An object that must not come to life."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("unpacked",)


def test_a_later_archive_of_amass_is_read_and_its_objects_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    poses = np.random.default_rng(0).uniform(-0.5, 0.5, (7, 156))
    first = wb.motion.read_skeleton(amass(tmp_path / "a.npz", poses=poses))
    parts = {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "fps": np.array(60.0), "poses": None}
    objects = np.array([Unpacked(), {"a": 1}], dtype=object)
    later = amass(tmp_path / "b.npz", mocap_framerate=None, labels_obs=objects, **parts)
    np.testing.assert_allclose(wb.motion.read_skeleton(later).positions, first.positions, atol=1e-12)
    assert not (tmp_path / "unpacked").exists()


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"trans": None}, "is no clip of wholebody"),
        ({"mocap_framerate": None}, "is no archive of AMASS; it lacks mocap_framerate"),
        ({"mocap_framerate": np.array(0.0)}, "the frame rate is 0"),
        ({"poses": np.zeros((7, 20))}, r"poses have shape \(7, 20\)"),
        ({"trans": np.zeros((6, 3))}, r"trans has shape \(6, 3\)"),
        ({"trans": np.full((7, 3), np.nan)}, "trans have a value that is not finite or beyond 1e.06 in frame 0"),
        ({"poses": np.array(["x"])}, "poses are no numbers"),
    ],
)
def test_a_wrong_archive_of_amass_is_one_sentence(
    changed: dict[str, Any], sentence: str, human: Figure, tmp_path: Path
) -> None:
    with pytest.raises(wb.FileFormatError, match=rf"^a\.npz: {sentence}"):
        wb.read_clip(amass(tmp_path / "a.npz", **changed), human)


def test_csv_of_other_columns_is_refused_with_its_line(human: Figure, tmp_path: Path) -> None:
    path = swinging(human, 3, 0).write(tmp_path / "a.csv")
    path.write_text(path.read_text().replace("left_knee_flexion", "left_knee_flexoin", 1))
    with pytest.raises(wb.UnknownNameError, match=r"a\.csv, line 1: no column is called 'left_knee_flexoin'"):
        wb.read_clip(path, human)
    with pytest.raises(wb.InputError, match="two frames or more"):
        swinging(human, 1, 0).write(tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()


def test_a_rest_posture_that_turns_some_joints_is_left_out(tmp_path: Path) -> None:
    """As CMU's converted files have it: some joints turn by whole degrees, and the motion begins with a jump."""
    header = ["HIERARCHY", "ROOT a", "{", "OFFSET 0 0 0"]
    header += ["CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"]
    for name in "bcdefg":
        header += [f"JOINT {name}", "{", "OFFSET 0 0.3 0", "CHANNELS 3 Zrotation Xrotation Yrotation"]
    header += ["End Site", "{", "OFFSET 0 0.3 0", "}", *["}"] * 7]
    frame = np.arange(20.0)[:, None]
    moving = 25.0 + np.arange(18.0) + 4.0 * np.sin(0.3 * frame + np.arange(18.0))
    rest = np.zeros((1, 18))
    rest[0, 3] = -21.0

    def frames(angles: np.ndarray) -> int:
        rows = [" ".join(f"{value:.6f}" for value in (0, 1, 0, 0, 0, 0, *row)) for row in angles]
        text = "\n".join([*header, "MOTION", f"Frames: {len(rows)}", "Frame Time: 0.0333333", *rows, ""])
        (tmp_path / "a.bvh").write_text(text)
        return len(wb.motion.read_skeleton(tmp_path / "a.bvh").positions)

    assert frames(np.vstack([rest, moving])) == 20
    noisy = rest + 0.2 * np.cos(np.arange(18.0))  # degrees: as of motions that were brought onto another skeleton
    assert frames(np.vstack([noisy, moving])) == 20
    assert frames(moving) == 20
    ways_in = rest + np.linspace(0.0, 1.0, 20)[:, None] * (moving[:1] - rest)
    assert frames(np.vstack([ways_in, moving])) == 40  # it moves out of that posture


def test_an_unknown_ending_is_answered_with_all_that_can_be_read(human: Figure, tmp_path: Path) -> None:
    (tmp_path / "walk.mocap").write_text("HIERARCHY\n")
    with pytest.raises(wb.FileFormatError, match=r"as \.mocap; give one of \.bvh, \.csv, \.glb, \.gltf, \.npz, \.txt$"):
        wb.read_clip(tmp_path / "walk.mocap", human)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("walk.fbx", "FBX is not read; Blender .*Export > glTF"),
        ("Walk.C3D", "holds places of markers and no skeleton; .* export BVH$"),
        ("walk.trc", "holds places of markers and no skeleton"),
    ],
)
def test_what_is_not_read_is_answered_with_what_turns_it_into_what_is(
    name: str, said: str, human: Figure, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(b"Kaydara FBX Binary  ")
    for read in (wb.motion.read_skeleton, partial(wb.read_clip, figure=human)):
        with pytest.raises(wb.FileFormatError, match=rf"^{name}: {said}"):
            read(tmp_path / name)


@pytest.mark.parametrize("dtype", ["int8", "float64"])
def test_an_archive_of_too_many_frames_is_refused_by_its_header(tmp_path: Path, dtype: str) -> None:
    """Zeros take no room in an archive: nothing of them is read."""
    figure = wb.load("hand")
    frames = MOST_FRAMES + 1
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": np.dtype(dtype).str, "fortran_order": False, "shape": (frames, figure.model.nq)}
    )
    with zipfile.ZipFile(tmp_path / "long.npz", "w") as archive:
        archive.writestr("q.npy", header.getvalue() + b"too few numbers")
    with pytest.raises(wb.FileFormatError, match=rf"q has {frames} frames; give 1 to {MOST_FRAMES}"):
        wb.read_clip(tmp_path / "long.npz", figure)


WHEEL = """<robot name="wheel"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
<joint name="wheel" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="knee" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="finger" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/>{}</joint></robot>"""


@pytest.mark.parametrize("root", ["free", "fixed"])
@pytest.mark.parametrize("mimic", ["", '<mimic joint="knee" multiplier="2" offset="0.1"/>'])
def test_tables_have_the_angles_of_joints_that_turn_without_end(root: str, mimic: str, tmp_path: Path) -> None:
    (tmp_path / "wheel.urdf").write_text(WHEEL.format(mimic))
    figure = wb.load(tmp_path / "wheel.urdf", root=root)
    angles = np.linspace(0.0, 9.0, 7)  # more than a turn
    q = [figure.with_joints(figure.neutral, {"wheel": angle, "knee": 0.1 * angle}) for angle in angles]
    clip = wb.Clip(figure, np.array(q), 0.1)
    path = clip.write(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    turned = [float(line.split(",")[lines[0].split(",").index("wheel")]) for line in lines[1:]]
    assert turned == pytest.approx(angles)
    assert furthest(wb.read_clip(path, figure), clip) < 1e-12
    path.write_text(path.read_text().replace("wheel", "Rad 1 [deg]", 1).replace("time", "t"))
    names = {"columns": {"wheel": "Rad 1 [deg]", "time": "t"}}
    with pytest.raises(wb.WholebodyError, match="no column is called 't'"):
        wb.read_clip(path, figure)
    read = wb.read_clip(path, figure, names)
    assert figure.joint_values(read.q[1])["wheel"] == pytest.approx(np.radians(angles[1]))
    path.write_text(path.read_text().replace("Rad 1 [deg]", "wheel").replace("t,", "time,", 1))
    read = wb.read_clip(path, figure, degrees=True)
    assert figure.joint_values(read.q[1])["wheel"] == pytest.approx(np.radians(angles[1]))
    path.write_text(path.read_text().replace(",", "\t"))
    with pytest.raises(wb.WholebodyError, match="separated by tabs; write commas"):
        wb.read_clip(path, figure)
    with pytest.raises(wb.WholebodyError, match="no joint is called 'whel'; did you mean wheel"):
        wb.read_clip(path, figure, {"columns": {"whel": "Rad 1"}})


def test_one_frame_is_read_again_from_gltf_of_one_arm_and_of_two(tmp_path: Path) -> None:
    arm = wb.load(ARM, root="free")
    clip = wb.Clip(arm, arm.neutral[None], 0.04)
    again = wb.read_clip(clip.write(tmp_path / "a.glb"), arm)
    assert len(again) == 1
    assert furthest(clip, again) < 1e-6
    two = wb.Scene({"anna": arm, "ben": (wb.load(ARM), (3.0, 0.0, 0.0))}).figure
    both = wb.Clip(two, two.neutral[None], 0.04)
    assert furthest(both, wb.read_clip(both.write(tmp_path / "b.glb"), two)) < 1e-6

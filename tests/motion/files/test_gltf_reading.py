"""Animated skeletons of glTF: joint centres by the file's own kinematics, and what is refused."""

from __future__ import annotations

import base64
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation, Slerp

import wholebody as wb
from wholebody.base.errors import FileFormatError
from wholebody.geometry.gltf import GltfBuilder
from wholebody.motion import read_skeleton
from wholebody.motion.skeleton import longest_way

SIDES = (("Left", 1.0), ("Right", -1.0))
BONES: list[tuple[str, str, tuple[float, float, float]]] = [
    ("Hips", "", (0.0, 1.0, 0.0)), ("Spine", "Hips", (0.0, 0.1, 0.0)), ("Spine2", "Spine", (0.0, 0.2, 0.0)),
    ("Neck", "Spine2", (0.0, 0.2, 0.0)), ("Head", "Neck", (0.0, 0.1, 0.02)), ("HeadTop_End", "Head", (0.0, 0.18, 0.0)),
    *(bone for side, sign in SIDES for bone in (
        (f"{side}UpLeg", "Hips", (0.09 * sign, -0.06, 0.0)), (f"{side}Leg", f"{side}UpLeg", (0.0, -0.43, 0.0)),
        (f"{side}Foot", f"{side}Leg", (0.0, -0.42, 0.0)), (f"{side}ToeBase", f"{side}Foot", (0.0, -0.07, 0.14)),
        (f"{side}Shoulder", "Spine2", (0.05 * sign, 0.12, 0.0)),
        (f"{side}Arm", f"{side}Shoulder", (0.12 * sign, 0.0, 0.0)),
        (f"{side}ForeArm", f"{side}Arm", (0.28 * sign, 0.0, 0.0)),
        (f"{side}Hand", f"{side}ForeArm", (0.25 * sign, 0.0, 0.0)),
    )),
]  # fmt: skip
"""Name, parent, and place in the world relative to the parent's where a body is bound: y up, z forward, metres."""


class Foreign:
    """A file as exporters write it: an armature that turns and scales, bones with axes of their own, a skin."""

    def __init__(self, kind: str = "LINEAR", *, bound: bool = True, frames: int = 7) -> None:
        rng = np.random.default_rng(3)
        self.names = [f"mixamorig:{name}" for name, *_ in BONES]
        parents = [[name for name, *_ in BONES].index(parent) if parent else -1 for _, parent, _ in BONES]
        armature = np.eye(4)
        armature[:3, :3] = 0.01 * Rotation.from_euler("x", -90.0, degrees=True).as_matrix()
        bind = np.tile(np.eye(4), (len(BONES), 1, 1))
        for k, (_, _, place) in enumerate(BONES):
            bind[k, :3, 3] = np.array(place) + (bind[parents[k], :3, 3] if parents[k] >= 0 else 0.0)
            bind[k, :3, :3] = 0.01 * Rotation.random(random_state=k).as_matrix()
        self.bind = bind
        local = [np.linalg.solve(armature if p < 0 else bind[p], bind[k]) for k, p in enumerate(parents)]
        self.builder, self.frames = GltfBuilder(), frames
        top = self.builder.node("Armature", None, armature)
        times = np.arange(frames) / 30.0
        at = self.builder.accessor(times, "<f4", bounded=True)
        nodes: list[int] = []
        self.positions = np.empty((frames, len(BONES), 3))
        worlds = np.empty((frames, len(BONES), 4, 4))
        for k, (name, *_) in enumerate(BONES):
            size = 0.02 if "Leg" in name or name == "Hips" else 0.2
            vectors = rng.normal(0.0, size, (frames, 3)).cumsum(axis=0) / 2.0
            turns = (
                Rotation.from_matrix(local[k][:3, :3] / np.cbrt(np.linalg.det(local[k][:3, :3])))
                * Rotation.from_rotvec(vectors)
            ).as_quat()
            places = np.tile(local[k][:3, 3], (frames, 1))
            if not k:
                places = places + 100.0 * np.linspace((0.0, 0.0, 0.0), (0.0, -0.2, 0.0), frames)
            parent = top if parents[k] < 0 else nodes[parents[k]]
            scale = float(np.cbrt(np.linalg.det(local[k][:3, :3])))
            nodes.append(self.builder.moving_node(self.names[k], parent, (turns, places), at))
            for frame in range(frames):
                made = np.eye(4)
                made[:3, :3], made[:3, 3] = scale * Rotation.from_quat(turns[frame]).as_matrix(), places[frame]
                worlds[frame, k] = (armature if parents[k] < 0 else worlds[frame, parents[k]]) @ made
            self.positions[:, k] = worlds[:, k, :3, 3]
        if bound:
            self.builder.skin("skin", nodes, np.linalg.inv(bind))

    def written(self, path: Path) -> Path:
        path.write_bytes(self.builder.glb("walk"))
        return path


def test_joint_centres_are_those_of_the_file(tmp_path: Path) -> None:
    made = Foreign()
    motion = read_skeleton(made.written(tmp_path / "walk.glb"))
    at = [motion.names.index(name) for name in made.names]
    ours = np.stack([made.positions[..., 2], made.positions[..., 0], made.positions[..., 1]], axis=2)
    np.testing.assert_allclose(motion.positions[:, at], ours, atol=1e-6)
    assert motion.dt == 1.0 / 30.0
    bound = made.bind[:, :3, 3] - made.bind[0, :3, 3]
    np.testing.assert_allclose(motion.rest()[at], bound[:, [2, 0, 1]], atol=1e-6)
    for joint in range(1, len(at)):  # bones are rigid, and turn with their parents
        parent = motion.parents[at[joint]]
        way = np.einsum("nij,j->ni", motion.rotations[:, parent], motion.offsets[at[joint]])
        np.testing.assert_allclose(motion.positions[:, at[joint]] - motion.positions[:, parent], way, atol=2e-6)
    with pytest.warns(UserWarning, match="left_hand, right_hand"):
        clip = wb.retarget(motion, wb.load("human"))
    errors = [np.degrees(np.median(values)) for values in wb.motion.bone_errors(motion, clip).values()]
    assert len(errors) == 10
    assert np.median(errors) < 5.0


def test_a_skin_without_matrices_is_bound_by_its_nodes(tmp_path: Path) -> None:
    made = Foreign()
    path = made.written(tmp_path / "walk.glb")
    plain = read_skeleton(path)
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    del tree["skins"][0]["inverseBindMatrices"]
    content = json.dumps(tree, separators=(",", ":")).encode().ljust(length)
    path.write_bytes(data[:20] + content + data[20 + length :])
    motion = read_skeleton(path)
    np.testing.assert_allclose(motion.positions, plain.positions, atol=1e-6)
    lengths = [longest_way(each.parents, each.offsets) for each in (motion, plain)]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-3)


def test_nodes_without_a_body_are_read_where_they_rest(tmp_path: Path) -> None:
    made = Foreign(bound=False)
    motion = read_skeleton(made.written(tmp_path / "walk.glb"))
    at = [motion.names.index(name) for name in made.names]
    np.testing.assert_allclose(motion.positions[:, at][..., 2], made.positions[..., 1], atol=1e-6)
    assert "no body is bound" in " ".join(motion.notes)


def test_text_with_data_beside_it_and_uneven_keyframes(tmp_path: Path) -> None:
    """A .gltf whose buffer is a file, keyframes at unequal times, steps and cubic splines."""
    keys = np.array([0.0, 0.1, 0.5], dtype="<f4")
    turns = (
        Rotation.from_rotvec(np.radians([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0], [0.0, 0.0, 90.0]])).as_quat().astype("<f4")
    )
    cubic = np.zeros((3, 3, 3), dtype="<f4")
    cubic[:, 1, 0] = (0.0, 1.0, 3.0)  # values; tangents are zero
    data = keys.tobytes() + turns.tobytes() + cubic.tobytes()
    (tmp_path / "way of.bin").write_bytes(data)
    sizes = [len(keys.tobytes()), turns.nbytes, cubic.nbytes]
    starts = np.cumsum([0, *sizes])
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "nodes": [{"name": "a", "children": [1]}, {"name": "b", "translation": [0.0, 1.0, 0.0]}],
        "buffers": [{"uri": "way%20of.bin", "byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": size}
            for start, size in zip(starts, sizes, strict=False)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5126, "count": 9, "type": "VEC3"},
        ],
        "animations": [
            {
                "samplers": [{"input": 0, "output": 1}, {"input": 0, "output": 2, "interpolation": "CUBICSPLINE"}],
                "channels": [
                    {"sampler": 0, "target": {"node": 0, "path": "rotation"}},
                    {"sampler": 1, "target": {"node": 0, "path": "translation"}},
                    {"sampler": 0, "target": {"node": 1, "path": "rotation"}},
                ],
            }
        ],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    motion = read_skeleton(tmp_path / "a.gltf")
    assert (len(motion), motion.dt) == (31, 1.0 / 60.0)
    assert "unequal times" in " ".join(motion.notes)
    times = np.linspace(0.0, 0.5, 31)
    share = np.where(times < 0.1, times / 0.1, (times - 0.1) / 0.4)
    smooth = share**2 * (3.0 - 2.0 * share)
    x = np.where(times < 0.1, smooth, 1.0 + 2.0 * smooth)
    np.testing.assert_allclose(motion.positions[:, 0, 1], x, atol=1e-6)  # x of the file is to the left
    at = Slerp(keys.astype(float), Rotation.from_quat(turns))(np.clip(times, 0.0, 0.5))
    np.testing.assert_allclose(
        (motion.positions[:, 1] - motion.positions[:, 0])[:, [1, 2]], at.apply((0, 1, 0))[:, :2], atol=1e-6
    )
    embedded = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    (tmp_path / "b.gltf").write_text(json.dumps(tree | {"buffers": [{"uri": embedded, "byteLength": len(data)}]}))
    np.testing.assert_array_equal(read_skeleton(tmp_path / "b.gltf").positions, motion.positions)


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_own_clips_are_read_back(name: str, tmp_path: Path) -> None:
    figure = wb.load(name)
    model = figure.model
    q = np.array([pin.randomConfiguration(model, *(np.clip(ends, -1.5, 1.5) for ends in (
        model.lowerPositionLimit, model.upperPositionLimit))) for _ in range(4)])  # fmt: skip
    clip = wb.Clip(figure, q, 1.0 / 120.0, "clip")
    found = wb.read_clip(clip.write(tmp_path / "clip.glb"), figure)
    assert (found.dt, found.name) == (clip.dt, "clip")
    for ours, theirs in zip(found.q, clip.q, strict=True):
        assert np.abs(pin.difference(model, ours, theirs)).max() < 2e-6


def test_a_rested_figure_and_a_fixed_robot_keep_their_frames(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="a"/><link name="b"><collision><geometry><sphere radius="0.1"/></geometry>'
        '</collision></link><joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 1"/>'
        '<origin xyz="1 0 0" rpy="0.3 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    arm = wb.load(tmp_path / "arm.urdf")
    clip = wb.Clip(arm, [[0.0], [0.5], [-0.2]], 0.04)
    np.testing.assert_allclose(wb.read_clip(clip.write(tmp_path / "a.glb"), arm).q, clip.q, atol=1e-6)
    still = wb.Clip(arm, [[0.3]] * 5, 0.04)
    found = wb.read_clip(still.write(tmp_path / "s.glb"), arm)
    assert (len(found), found.dt) == (5, 0.04)


WRONG = {
    "a mesh alone": (lambda good: json.dumps({"asset": {"version": "2.0"}, "nodes": [{}]}).encode(), "no animation"),
    "an old version": (lambda good: good[:4] + b"\1\0\0\0" + good[8:], "glTF 1"),
    "cut off": (lambda good: good[: len(good) // 2], "cut off"),
    "no glTF": (lambda good: b"hello", "is no glTF 2"),
    "a ring": (
        lambda good: json.dumps(
            {"asset": {"version": "2.0"}, "nodes": [{"children": [1]}, {"children": [0]}]}
        ).encode(),
        "is no glTF 2",
    ),
    "compressed": (
        lambda good: json.dumps(
            {"asset": {"version": "2.0"}, "extensionsRequired": ["EXT_meshopt_compression"]}
        ).encode(),
        "without compression",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_one_sentence(what: str, tmp_path: Path) -> None:
    change, words = WRONG[what]
    path = tmp_path / "walk.glb"
    path.write_bytes(change(Foreign().builder.glb("walk")))
    with pytest.raises(FileFormatError, match=words) as caught:
        read_skeleton(path)
    assert "\n" not in str(caught.value)


def test_damaged_files_never_end_in_anything_but_a_sentence(tmp_path: Path) -> None:
    good = bytearray(Foreign(frames=2).builder.glb("walk"))
    rng = np.random.default_rng(0)
    length = int.from_bytes(good[12:16], "little")
    read = 0
    for _ in range(60):
        broken = bytearray(good)
        for place in rng.integers(20, 20 + length, 3):
            broken[place] = rng.integers(32, 127)
        (tmp_path / "broken.glb").write_bytes(broken)
        with suppress(wb.WholebodyError):
            assert np.isfinite(read_skeleton(tmp_path / "broken.glb").positions).all()
            read += 1
    assert 0 < read < 60


def test_sparse_keyframes_are_read_between(tmp_path: Path) -> None:
    """Two keyframes a second apart, of a root; its child does not turn by itself, and is a joint all the same."""
    builder = GltfBuilder()
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).as_quat()
    times = builder.accessor([0.0, 1.0], "<f4", bounded=True)
    root = builder.moving_node("root", None, (turns, np.zeros((2, 3))), times)
    child = builder.node("child", root, np.block([[np.eye(3), np.array([[0.0], [1.0], [0.0]])], [0.0, 0.0, 0.0, 1.0]]))
    builder.node("tip", child, np.block([[np.eye(3), np.array([[0.0], [0.5], [0.0]])], [0.0, 0.0, 0.0, 1.0]]))
    (tmp_path / "turn.glb").write_bytes(builder.glb("turn"))
    motion = read_skeleton(tmp_path / "turn.glb")
    assert (motion.names, len(motion), motion.dt) == (("root", "child", "tip"), 61, 1.0 / 60.0)
    angle = np.linspace(0.0, 1.0, 61)
    np.testing.assert_allclose(motion.positions[:, 2, 1], -1.5 * np.sin(angle), atol=1e-6)
    np.testing.assert_allclose(motion.positions[:, 2, 2], 1.5 * np.cos(angle), atol=1e-6)


KINDS = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axis", ["0 0 1", "0.6 0 0.8"])
def test_each_kind_of_joint_is_read_again(kind: str, axis: str, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(
        f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="{kind}"><parent link="a"/>'
        f'<child link="b"/><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="9"/></joint></robot>'
    )
    figure = wb.load(tmp_path / "robot.urdf", root="free")
    random = np.random.default_rng(4)
    moves = random.uniform(-1.0, 1.0, (3, figure.model.nv))
    clip = wb.Clip(figure, np.array([pin.integrate(figure.model, figure.neutral, move) for move in moves]), 0.1, "c")
    again = wb.read_clip(clip.write(tmp_path / "c.glb"), figure)
    for q, given in zip(again.q, clip.q, strict=True):
        assert pin.difference(figure.model, q, given) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("end", "count"), [(1e9, 2), (1.0, 10**13)])
def test_frames_and_counts_without_end_are_refused(end: float, count: int, tmp_path: Path) -> None:
    builder = GltfBuilder()
    times = builder.accessor([0.0, end], "<f4", bounded=True)
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).as_quat()
    root = builder.moving_node("root", None, (turns, np.zeros((2, 3))), times)
    builder.node("tip", root, np.eye(4))
    data = builder.glb("turn")
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    if count > 2:
        tree["accessors"][times] = {"componentType": 5126, "count": count, "type": "SCALAR"}
    tree["buffers"][0]["uri"] = "data:," + base64.b64encode(data[28 + length :]).decode()
    (tmp_path / "turn.gltf").write_text(json.dumps(tree))
    with pytest.raises(
        FileFormatError, match="10000000 are the most" if count > 2 else "turn.gltf: .* at most 1000000"
    ):
        read_skeleton(tmp_path / "turn.gltf")

"""Clips as glTF animations (.glb): one node a joint, with the figure's pieces below, for Blender and three.js viewers.

trimesh writes the meshes and the nodes. Its postprocessors add keyframes of rotations and translations.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, MissingPackageError
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import Motion
from wholebody.motion.skeleton import UP


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as an animation: y up, z forward, metres, one keyframe a frame, interpolated linearly.

    Raises:
        InputError: the file cannot be written.
        MissingPackageError: trimesh is not installed.
    """
    try:
        from trimesh.exchange.gltf import export_glb
    except ImportError:
        raise MissingPackageError("writing glTF needs trimesh: pip install trimesh") from None
    figure = motion.figure
    if len(motion.q) * figure.model.njoints > 20_000_000:  # keyframes, about 600 MB
        raise InputError(f"{motion.name}: {len(motion.q)} frames are too many for one glTF file; write parts of it")
    keys = _keys(figure, motion.q)
    scene, names = joint_tree(
        figure.model, [pin.XYZQUATToSE3(np.r_[at, turn]) for turn, at in zip(keys[0][0], keys[1][0], strict=True)]
    )
    for piece in figure.geometry.geometryObjects:
        if not isinstance(piece.geometry, coal.Halfspace):  # it has no end
            add_piece(scene, names, piece, triangles(piece.geometry), (214, 189, 165, 255))  # the colour of skin
    animate = _Animation(motion, names, keys)
    return write_file(path, export_glb(scene, buffer_postprocessor=animate.buffers, tree_postprocessor=animate.tree))


def joint_tree(model: Any, placements: Sequence[pin.SE3]) -> tuple[Any, list[str]]:
    """A trimesh.Scene with one node a joint, placed in its parent, y up, and the names of the nodes."""
    import trimesh

    names = [f"joint {name}" for name in model.names]
    scene = trimesh.Scene(base_frame="world_y_up")
    upward = np.eye(4)
    upward[:3, :3] = UP["y"].T
    scene.graph.update(frame_to=names[0], frame_from="world_y_up", matrix=upward)
    for joint in range(1, model.njoints):
        at = placements[joint].homogeneous
        scene.graph.update(frame_to=names[joint], frame_from=names[model.parents[joint]], matrix=at)
    return scene, names


class _Animation:
    """Adds keyframes to trimesh's tree and buffers."""

    def __init__(self, motion: Motion, names: list[str], keys: tuple[Array, Array]) -> None:
        self.motion, self.names = motion, names
        self.turns, self.places = keys
        self._channels: list[tuple[str, str, int]] = []
        self._times = 0

    def buffers(self, buffers: Any, tree: Any) -> None:
        """Append times, rotations and translations as accessors."""

        def accessor(label: str, values: Array, kind: str) -> int:
            data = np.ascontiguousarray(values, dtype="<f4")
            flat = data.reshape(len(data), -1)
            buffers[label] = data.tobytes()
            tree["accessors"][label] = {
                "bufferView": len(buffers) - 1, "componentType": 5126, "count": len(data), "type": kind,  # float32
                "min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist(),
            }  # fmt: skip
            return len(tree["accessors"]) - 1

        self._times = accessor("times", self.motion.dt * np.arange(len(self.motion.q), dtype=np.float64), "SCALAR")
        for joint in range(1, len(self.names)):
            for path, keys, kind in (("rotation", self.turns, "VEC4"), ("translation", self.places, "VEC3")):
                values = keys[:, joint]
                if np.ptp(values, axis=0).max() > 1e-9:  # metres or parts of a quaternion
                    index = accessor(f"{path} {joint}", values, kind)
                    self._channels.append((self.names[joint], path, index))

    def tree(self, tree: Any) -> None:
        """Give the joints rotations and translations in place of matrices, and list the channels."""
        times = self._times
        nodes = {node["name"]: index for index, node in enumerate(tree["nodes"])}
        for joint in range(1, len(self.names)):
            node = tree["nodes"][nodes[self.names[joint]]]
            node.pop("matrix", None)
            node["rotation"], node["translation"] = self.turns[0, joint].tolist(), self.places[0, joint].tolist()
        if self._channels:
            tree["animations"] = [
                {
                    "name": self.motion.name,
                    "samplers": [
                        {"input": times, "output": index, "interpolation": "LINEAR"} for *_, index in self._channels
                    ],
                    "channels": [
                        {"sampler": number, "target": {"node": nodes[name], "path": path}}
                        for number, (name, path, _) in enumerate(self._channels)
                    ],
                }
            ]


def _keys(figure: Figure, q: Array) -> tuple[Array, Array]:
    """Quaternions (n, joints, 4) and translations (n, joints, 3) of all joints in their parents, without sign flips."""
    model = figure.model
    data = model.createData()
    turns, places = np.empty((len(q), model.njoints, 4)), np.empty((len(q), model.njoints, 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture)
        for joint, at in enumerate(data.liMi):
            values = pin.SE3ToXYZQUAT(at)
            places[k, joint], turns[k, joint] = values[:3], values[3:]
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=2) < 0.0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips, axis=0)[:, :, None]
    return turns, places


def add_piece(tree: Any, joints: Sequence[str], piece: Any, mesh: Any, color: Sequence[int]) -> None:
    """Add the mesh of a piece to a `joint_tree`, below the node of its joint; colours from 0 to 255."""
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    blend = "BLEND" if color[3] < 255 else None
    mesh.visual = TextureVisuals(
        material=PBRMaterial(baseColorFactor=color, roughnessFactor=0.8, metallicFactor=0.0, alphaMode=blend)
    )
    tree.add_geometry(
        mesh, node_name=f"piece {piece.name}", geom_name=f"mesh {piece.name}",
        parent_node_name=joints[piece.parentJoint], transform=piece.placement.homogeneous,
    )  # fmt: skip


def triangles(shape: Any) -> Any:
    """A trimesh of a coal shape of finite size, about the shape's own origin."""
    from trimesh import convex, creation

    if isinstance(shape, coal.Box):
        return creation.box(2.0 * np.array(shape.halfSide))
    if isinstance(shape, coal.Sphere):
        return creation.icosphere(radius=shape.radius)
    if isinstance(shape, coal.Capsule):
        mesh = creation.capsule(2.0 * shape.halfLength, shape.radius, count=(24, 24))
        mesh.apply_translation(-mesh.bounds.mean(axis=0))  # not centred in every version
        return mesh
    if isinstance(shape, coal.Ellipsoid):
        return creation.icosphere().apply_scale(np.array(shape.radii))
    return convex.convex_hull(np.array(shape.points()))

"""Clips as glTF animations (.glb): a node a joint, the surface as one skinned mesh, or a robot's visuals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import write as write_file
from wholebody.figures.description import Member
from wholebody.figures.figure import Figure
from wholebody.figures.joining import joint_in
from wholebody.figures.link_pieces import Color, Drawn, drawn_of
from wholebody.figures.surface import Surface, surface_of
from wholebody.figures.surface.garments import Bone, halfway
from wholebody.geometry.gltf import VERTICES, GltfBuilder
from wholebody.geometry.placement import steady
from wholebody.motion.files.base import Motion
from wholebody.motion.skeleton import UP

JOINT = "joint "  # before the name of a joint, in the name of its node

UPWARD: Array = np.eye(4)
UPWARD[:3, :3] = UP["y"].T


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as an animation: y up, z forward, metres, one keyframe a frame, interpolated linearly."""
    figure = motion.figure
    if len(motion.q) * figure.model.njoints > 20_000_000:  # keyframes, about 600 MB
        raise InputError(f"{motion.name}: {len(motion.q)} frames are too many for one glTF file; write parts of it")
    tree = JointTree(figure.model, motion.q, motion.dt, clip=True)
    drawn = tree.draw(figure)
    for piece in figure.geometry.geometryObjects:
        link = figure.model.frames[piece.parentFrame].name
        if link not in drawn and not isinstance(piece.geometry, coal.Halfspace):  # it has no end
            given = piece.meshColor if piece.overrideMaterial else (0.84, 0.74, 0.65, 1.0)
            tree.piece(
                f"piece {piece.name}", int(piece.parentJoint), piece.placement.homogeneous, piece.geometry, given
            )
    return write_file(path, tree.builder.glb(motion.name))


class JointTree:
    """A file with a node for each joint of a model, placed in its parent's, that moves as postures (n, nq) say."""

    def __init__(self, model: Any, q: Array, dt: float, *, clip: bool = False) -> None:
        """Place the joints; one posture is no animation, but a `clip` of one frame has its keyframe."""
        self.builder, self._model, self._q = GltfBuilder(), model, q
        times = dt * np.arange(len(q), dtype=np.float64)
        self._times = self.builder.accessor(times, "<f4", bounded=True) if len(q) > 1 or clip else None
        turns, places = keys_of(model, q)
        ends = zip(places[0], turns[0], strict=True)
        self._first = [pin.XYZQUATToSE3(np.concatenate(each)).homogeneous for each in ends]
        self._nodes = [self.builder.node(JOINT + model.names[0], None, UPWARD)]
        for joint in range(1, model.njoints):
            keys = turns[:, joint], places[:, joint]
            parent = self._nodes[model.parents[joint]]
            self._nodes.append(self.builder.moving_node(JOINT + model.names[joint], parent, keys, self._times))

    def draw(self, figure: Figure) -> frozenset[str]:
        """Add surfaces of people, and visuals of others; the names of the links of which pieces need not be drawn."""
        members = {f"{name}/": member for name, member in figure.members.items()}
        covered = set[str]()
        for prefix, (one, at) in (members or {"": Member(figure, pin.SE3.Identity())}).items():
            surface = surface_of(one)
            if surface is not None:
                self.skin(prefix.strip("/") or figure.name, surface, surface.attached(one, at.homogeneous), prefix)
                covered.update(prefix + segment for segment in one.segments)
        drawn = [each for each in drawn_of(figure) if each.link not in covered]
        self.visuals(drawn)
        return frozenset(covered.union(each.link for each in drawn))

    def visuals(self, drawn: Iterable[Drawn], prefix: str = "", color: Color | None = None) -> None:
        """Add what is drawn of links; a prefix stands before their joints' names; all in a colour if there is one."""
        for number, one in enumerate(drawn):
            name, paint = f"visual {prefix}{one.link}:{number}", one.color if color is None else color
            self.piece(name, joint_in(self._model, prefix, one.joint), one.placement, one.shape, paint)

    def piece(self, name: str, joint: int, placement: Array, shape: Any, color: Any) -> None:
        """Add coal's shape, or vertices (n, 3) and faces (m, 3), at a placement (4, 4) in a joint."""
        normals, sheet = None, isinstance(shape, tuple)
        if isinstance(shape, tuple):  # faces of robots' meshes wind either way
            vertices, faces = shape
        else:
            mesh = triangles(shape)
            vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
            normals = mesh.vertex_normals if isinstance(shape, (coal.Sphere, coal.Capsule, coal.Ellipsoid)) else None
        paint = self.builder.material(color, both_sides=sheet)
        made = self.builder.mesh(name, [self.builder.primitive(vertices, faces, paint, normals)])
        self.builder.node(name, self._nodes[joint], np.asarray(placement), mesh=made)

    def skin(
        self, name: str, surface: Surface, places: Sequence[tuple[str, Array]], prefix: str = "",
        color: Color | None = None,
    ) -> None:  # fmt: skip
        """Add one mesh that bones bend, a primitive a colour; `places`: joints after a prefix, (4, 4) of bones."""
        bones: list[int] = []
        held = [(joint_in(self._model, prefix, joint), offset) for joint, offset in places]
        whole = {number: (first, second) for number, first, second in surface.halves}
        known = dict[int, Array]()
        for number, (bone, (joint, offset)) in enumerate(zip(surface.bones, held, strict=True)):
            called = f"{prefix}{bone.segment}"
            if number in whole:
                first, second = whole[number]
                keys = self._between(held[first], held[second], bone)
                node = self.builder.moving_node(f"{called} half", bones[first], keys, self._times)
            else:
                node = self.builder.node(called, self._nodes[joint], offset)
                known.setdefault(joint, bone.bind @ np.linalg.inv(offset))
            bones.append(node)
        under = [k for k, joint in enumerate(self._model.names) if k and joint.startswith(prefix)]
        bound = self._bound(known)
        binds = np.array([bone.bind for bone in surface.bones] + [bound[joint] for joint in under])
        nodes = [*bones, *(self._nodes[joint] for joint in under)]
        skin = self.builder.skin(name, nodes, np.linalg.inv(binds) @ np.linalg.inv(UPWARD))
        parts = dict[Color, list[Any]]()
        for patch in surface.patches:
            parts.setdefault((*patch.color, 1.0) if color is None else color, []).append(patch)
        primitives = []
        for paint, patches in parts.items():
            starts = np.cumsum([0, *(len(patch.vertices) for patch in patches)])
            faces = np.concatenate([start + patch.faces for start, patch in zip(starts, patches, strict=False)])
            vertices, normals, moving, weights = (
                np.concatenate([getattr(patch, part) for patch in patches])
                for part in ("vertices", "normals", "bones", "weights")
            )
            moving = np.where(weights > 0.0, moving, 0)
            more = {
                "JOINTS_0": self.builder.accessor(moving, "u1", VERTICES),
                "WEIGHTS_0": self.builder.accessor(weights / weights.sum(axis=1, keepdims=True), "<f4", VERTICES),
            }
            vertices, normals = (each @ UPWARD[:3, :3].T for each in (vertices, normals))  # as bound, it stands
            normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
            primitives.append(self.builder.primitive(vertices, faces, self.builder.material(paint), normals, **more))
        mesh = self.builder.mesh(f"body {name}", primitives)
        self.builder.node(f"body {name}", mesh=mesh, skin=skin)

    def _bound(self, known: Mapping[int, Array]) -> list[Array]:
        """Placements (4, 4) of the joints where a skin is bound: as they carry bones, others as in the first frame."""
        # Blender takes the rest posture from the joints that a skin names, and displaces vertices if one is missing.
        found = [np.eye(4)]
        for joint in range(1, self._model.njoints):
            above = found[self._model.parents[joint]]
            found.append(known.get(joint, above @ self._first[joint]))
        return found

    def _between(self, first: tuple[int, Array], second: tuple[int, Array], bone: Bone) -> tuple[Array, Array]:
        """Rotations and places of a half bone in the first of its two, of joints and placements in them."""
        data, found = self._model.createData(), np.empty((len(self._q), 4, 4))
        for k, posture in enumerate(self._q):
            pin.forwardKinematics(self._model, data, posture)
            ends = [data.oMi[joint].homogeneous @ offset for joint, offset in (first, second)]
            found[k] = halfway(np.eye(4), np.linalg.solve(*ends), bone)
        return steady(Rotation.from_matrix(found[:, :3, :3]).as_quat()), found[:, :3, 3]


def keys_of(model: Any, q: Array) -> tuple[Array, Array]:
    """Quaternions (n, joints, 4) and translations (n, joints, 3) of all joints in their parents, without sign flips."""
    data = model.createData()
    turns, places = np.empty((len(q), model.njoints, 4)), np.empty((len(q), model.njoints, 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture)
        for joint, at in enumerate(data.liMi):
            values = pin.SE3ToXYZQUAT(at)
            places[k, joint], turns[k, joint] = values[:3], values[3:]
    return steady(turns), places


def triangles(shape: Any) -> Any:
    """A trimesh of a coal shape, about the shape's own origin; a square of a half-space."""
    from trimesh import convex, creation, geometry

    if isinstance(shape, coal.Halfspace):
        wide, thin = 6.0, 1e-3  # m: of the piece of a half-space that is drawn
        mesh, normal = creation.box((wide, wide, thin)), np.array(shape.n)
        mesh.apply_transform(geometry.align_vectors((0.0, 0.0, 1.0), normal))
        return mesh.apply_translation(normal * (float(shape.d) - 0.5 * thin))

    if isinstance(shape, coal.Box):
        return creation.box(2.0 * np.array(shape.halfSide))
    if isinstance(shape, coal.Sphere):
        return creation.icosphere(radius=shape.radius)
    if isinstance(shape, (coal.Cylinder, coal.Cone)):
        make = creation.cylinder if isinstance(shape, coal.Cylinder) else creation.cone
        mesh = make(radius=shape.radius, height=2.0 * shape.halfLength)
        return mesh.apply_translation((0.0, 0.0, -mesh.bounds[:, 2].mean()))  # a cone stands on its base
    if isinstance(shape, coal.Capsule):
        mesh = creation.capsule(2.0 * shape.halfLength, shape.radius, count=(24, 24))
        mesh.apply_translation(-mesh.bounds.mean(axis=0))  # not centred in every version
        return mesh
    if isinstance(shape, coal.Ellipsoid):
        return creation.icosphere().apply_scale(np.array(shape.radii))
    return convex.convex_hull(np.array(shape.points()))

"""A posture of a scene as glTF (.glb), for Blender and three.js: one node a joint, and the pieces below them."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.view.bodies import Bodies
from wholebody.view.viewed_scene import ViewedScene

GROUND = 6.0  # m: of the piece of a half-space that is drawn
THIN = 1e-3  # m: its thickness
SECTIONS = (24, 24)  # of what is round
ROUGH = 0.8  # of the material: 0 is a mirror


def posture_glb(scene: ViewedScene, q: Array) -> bytes:
    """The figure's pieces and all things at a posture (nq,): y up, z forward, metres.

    A node `joint NAME` is each joint, a node `piece NAME` each piece; of half-spaces a square is written.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    from wholebody.motion.files.gltf import joint_tree

    data = State(scene.model).update(q).data
    tree, joints = joint_tree(scene.model, list(data.liMi))
    for piece, body in zip(scene.geometry.geometryObjects, Bodies(scene, (), True).all, strict=True):
        mesh = triangles(piece.geometry)
        color = [round(255 * part) for part in body.color]
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=color,
            roughnessFactor=ROUGH,
            metallicFactor=0.0,
            alphaMode="BLEND" if color[3] < 255 else None,
        )
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
        tree.add_geometry(
            mesh, node_name=f"piece {piece.name}", geom_name=f"mesh {piece.name}",
            parent_node_name=joints[piece.parentJoint], transform=piece.placement.homogeneous,
        )  # fmt: skip
    return bytes(export_glb(tree))


def triangles(shape: Any) -> Any:
    """A trimesh of a coal shape, about the shape's own origin; a square of a half-space."""
    import trimesh

    if isinstance(shape, coal.Box):
        return trimesh.creation.box(2.0 * np.array(shape.halfSide))
    if isinstance(shape, coal.Sphere):
        return trimesh.creation.icosphere(radius=shape.radius)
    if isinstance(shape, coal.Capsule):
        mesh = trimesh.creation.capsule(2.0 * shape.halfLength, shape.radius, count=SECTIONS)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        return mesh
    if isinstance(shape, coal.Ellipsoid):
        mesh = trimesh.creation.icosphere()
        mesh.apply_scale(np.array(shape.radii))
        return mesh
    if isinstance(shape, coal.Halfspace):
        place = trimesh.geometry.align_vectors((0.0, 0.0, 1.0), np.array(shape.n))
        mesh = trimesh.creation.box((GROUND, GROUND, THIN))
        mesh.apply_transform(place)
        mesh.apply_translation(np.array(shape.n) * (float(shape.d) - 0.5 * THIN))
        return mesh
    return trimesh.convex.convex_hull(np.array(shape.points()))

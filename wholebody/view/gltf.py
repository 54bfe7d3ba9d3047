"""A posture of a scene as glTF (.glb), for Blender and three.js: one node a joint, and the pieces below them."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.motion.files.gltf import add_piece, joint_tree, triangles
from wholebody.view.bodies import Bodies
from wholebody.view.viewed_scene import ViewedScene


def posture_glb(scene: ViewedScene, q: Array) -> bytes:
    """The figure's pieces and all things at a posture (nq,): y up, z forward, metres.

    A node `joint NAME` is each joint, a node `piece NAME` each piece; of half-spaces a square is written.
    """
    from trimesh.exchange.gltf import export_glb

    data = State(scene.model).update(q).data
    tree, joints = joint_tree(scene.model, list(data.liMi))
    for piece, body in zip(scene.geometry.geometryObjects, Bodies(scene, (), True).all, strict=True):
        if body.thing is None and body.color[3] == 0.0:
            continue  # outer pieces are not drawn
        add_piece(tree, joints, piece, drawn_triangles(piece.geometry), [round(255 * part) for part in body.color])
    return bytes(export_glb(tree))


def drawn_triangles(shape: Any) -> Any:
    """A trimesh of a coal shape, about the shape's own origin; a square of a half-space."""
    from trimesh import creation, geometry

    if not isinstance(shape, coal.Halfspace):
        return triangles(shape)
    normal = np.array(shape.n)
    wide, thin = 6.0, 1e-3  # m: of the piece of a half-space that is drawn
    mesh = creation.box((wide, wide, thin))
    mesh.apply_transform(geometry.align_vectors((0.0, 0.0, 1.0), normal))
    mesh.apply_translation(normal * (float(shape.d) - 0.5 * thin))
    return mesh

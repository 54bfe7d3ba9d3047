"""What is shown as glTF (.glb): a skinned body or pieces, and all things; a motion as an animation."""

from __future__ import annotations

from wholebody.base.arrays import Array
from wholebody.motion.files.gltf import JointTree
from wholebody.view.bodies import Bodies
from wholebody.view.skin import Skin
from wholebody.view.viewed_scene import ViewedScene


def scene_glb(scene: ViewedScene, bodies: Bodies, postures: Array, dt: float, title: str) -> bytes:
    """What `bodies` draw of a scene at postures (n, nq), `dt` seconds apart: y up, z forward, metres.

    A node `joint NAME` is each joint, a node `piece NAME` each piece; of half-spaces a square is written.
    """
    tree = JointTree(scene.model, postures, dt)
    for figure in bodies.drawn:
        if isinstance(figure.visual, Skin):
            name = figure.prefix.strip("/") or str(scene.figure.name)
            tree.skin(name, figure.visual.surface, figure.visual.places, figure.prefix, figure.color)
        else:
            tree.visuals(figure.visual.drawn, figure.prefix, figure.color)
    for index, (piece, body) in enumerate(zip(scene.geometry.geometryObjects, bodies.all, strict=True)):
        if not bodies.hidden(index):
            tree.piece(f"piece {piece.name}", body.joint, piece.placement.homogeneous, piece.geometry, body.color)
    return tree.builder.glb(title)

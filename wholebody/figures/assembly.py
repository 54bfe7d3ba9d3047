"""From a blueprint to Pinocchio's model and geometry."""

from __future__ import annotations

from dataclasses import replace

import pinocchio as pin

from wholebody.figures.blueprint import Blueprint, Solid, urdf_text

SKIN = (0.85, 0.68, 0.55, 1.0)


def model_of(blueprint: Blueprint) -> pin.Model:
    """Return Pinocchio's model of a blueprint, with a free root, read from its URDF text (without the pieces)."""
    model = pin.buildModelFromXML(urdf_text(replace(blueprint, solids=())), pin.JointModelFreeFlyer())
    model.name = blueprint.name
    return model


def geometry_of(model: pin.Model, solids: tuple[Solid, ...], pairs: tuple[tuple[str, str], ...]) -> pin.GeometryModel:
    """Return Pinocchio's geometry: the pieces on their segments, and the pairs that can touch."""
    geometry = pin.GeometryModel()
    index = {}
    for solid in solids:
        frame_id = model.getFrameId(solid.segment)
        frame = model.frames[frame_id]
        piece = pin.GeometryObject(
            solid.name, frame.parentJoint, frame_id, frame.placement * solid.placement, solid.geometry
        )
        piece.meshColor[:] = SKIN
        index[solid.name] = geometry.addGeometryObject(piece)
    for a, b in pairs:
        geometry.addCollisionPair(pin.CollisionPair(*sorted((index[a], index[b]))))
    return geometry

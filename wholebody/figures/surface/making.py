"""Makes the surfaces of people and hands: closed parts of one colour, divided among the segments that move them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Person
from wholebody.figures.hand import FINGERS, PARTS
from wholebody.figures.surface.borders import BONES_EACH, Bound, divided, strongest
from wholebody.figures.surface.garments import Bone, Claim, Garment, Patch, Surface, bounds
from wholebody.figures.surface.hand_shape import hand_shape
from wholebody.figures.surface.nets import Triangles, coarsened, triangles
from wholebody.figures.surface.person_shape import COLORS, HALVES, PersonShape


class Part(NamedTuple):
    """A closed surface in the binding posture; weights (n, b) of the bones on its vertices, at most four not zero."""

    name: str
    color: tuple[float, float, float]
    surface: Triangles
    weights: Array


def person_surface(person: Person) -> Surface:
    """Return the surface of a person."""
    return _divided(*person_parts(person))


def person_parts(person: Person) -> tuple[dict[str, Bone], list[Part]]:
    """Return the bones of a person and the closed parts that they move."""
    shape = PersonShape(person)
    bones = {name: Bone(name, None, None, placement, np.eye(4)) for name, placement in shape.bind.items()}
    for side in ("left", "right"):
        for part, parent in HALVES.items():
            segment, other = f"{side}_{part}", parent if parent == "pelvis" else f"{side}_{parent}"
            bind = halfway(shape.bind[other], shape.bind[segment])
            bones[segment + "/half"] = Bone(segment, other, None, bind, np.eye(4))
        hand, frame = hand_shape(person, side), shape.bind[f"{side}_hand"]
        for finger, parts in FINGERS.items():
            for part in parts:
                segment = f"{side}_{finger}_{PARTS[part]}"
                bones[segment] = Bone(segment, None, f"{side}_hand", frame @ hand.bind[segment], hand.rest[segment])
    return bones, [_made(garment, bones) for garment in shape.garments()]


def hand_surface(person: Person, side: str) -> Surface:
    """Return the surface of a person's hand on its own."""
    shape = hand_shape(person, side)
    bones = {name: Bone(name, None, None, placement, np.eye(4)) for name, placement in shape.bind.items()}
    bones[f"{side}_forearm"] = Bone(f"{side}_forearm", None, f"{side}_hand", np.eye(4), np.eye(4))
    low, high = bounds(shape.corners, 0.035)
    garment = Garment(f"{side}_hand", COLORS.skin, shape.field, low, high, 0.0030, shape.claims)
    return _divided(bones, [_made(garment, bones)])


def halfway(first: Array, second: Array) -> Array:
    """The placement (4, 4) at the second's origin whose rotation is half way from the first's to the second's."""
    turn = pin.log3(first[:3, :3].T @ second[:3, :3])
    found = np.array(second)
    found[:3, :3] = first[:3, :3] @ pin.exp3(0.5 * turn)
    return found


def _made(garment: Garment, bones: Mapping[str, Bone]) -> Part:
    surface = triangles(garment.field, garment.low, garment.high, garment.cell, garment.cuts)
    weights = _influences(surface.vertices, garment.claims, list(bones))
    # single precision, so that segments which count alike in the middle of a body do so exactly
    vertices, normals, weights = (each.astype(np.float32).astype(float) for each in (*surface[:2], weights))
    return Part(garment.name, garment.color, Triangles(vertices, normals, surface.faces), weights)


def _influences(points: Array, claims: Sequence[Claim], order: list[str]) -> Array:
    """Influences (n, b) of the bones on points (n, 3)."""
    strength = np.full((len(points), max(len(order), BONES_EACH)), -np.inf)
    for claim in claims:
        column = order.index(claim.bone)
        strength[:, column] = np.maximum(strength[:, column], -claim.field(points) / claim.softness)
    bones, weights = strongest(np.exp(strength - strength.max(axis=1, keepdims=True)))
    found = np.zeros(strength.shape)
    np.put_along_axis(found, bones.astype(np.intp), weights, axis=1)
    return found[:, : len(order)]


def _divided(bones: Mapping[str, Bone], parts: Iterable[Part]) -> Surface:
    """Every part divided among the segments that move it; neighbours share the vertices of their border."""
    segments = [bone.segment for bone in bones.values()]
    names = sorted(set(segments))
    place = np.array([names.index(segment) for segment in segments])
    found = []
    for part in parts:
        strength = np.zeros((len(part.weights), len(names)))
        np.add.at(strength.T, place, part.weights.T)
        bound = Bound(part.surface.vertices, part.surface.normals, part.weights, strength)
        bound, fine, owner = divided(bound, part.surface.faces)
        bound, coarse, owner_coarse = divided(bound, coarsened(part.surface))
        moving, influence = strongest(bound.weights)
        for number in np.unique(np.concatenate([owner, owner_coarse])):
            faces, fewer = fine[owner == number], coarse[owner_coarse == number]
            used, local = np.unique(np.concatenate([faces, fewer]), return_inverse=True)
            corners: NDArray[np.int64] = local.reshape(-1, 3)
            made = bound.vertices[used], bound.normals[used], moving[used], influence[used]
            name, split = f"{part.name}:{names[number]}", len(faces)
            found.append(Patch(name, names[number], part.color, *made, corners[:split], corners[split:]))
    return Surface(tuple(bones.values()), tuple(found))

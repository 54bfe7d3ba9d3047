"""Makes the surfaces of people and hands: closed parts of one colour, cut where two segments move them alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.figures.anthropometry import Person
from wholebody.figures.hand import FINGERS, PARTS
from wholebody.figures.surface.garments import Bone, Claim, Garment, Patch, Surface, bounds, halfway
from wholebody.figures.surface.hand_shape import hand_shape
from wholebody.figures.surface.nets import Triangles, coarsened, triangles
from wholebody.figures.surface.person_shape import COLORS, HALVES, PersonShape

BONES_EACH = 4  # bones that move a vertex: as many as a page's shader takes


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
            for kind, turn in shape.turns(side, part).items():
                bone = Bone(segment, other, None, np.eye(4), np.eye(4), shape.slide(side, part), turn)
                bind = halfway(shape.bind[other], shape.bind[segment], bone)
                bones[f"{segment}/{kind}"] = with_values(bone, bind=bind)
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


class Bound(NamedTuple):
    """Vertices with what moves them.

    Attributes:
        vertices, normals: (n, 3) metres, and outward unit vectors.
        weights: (n, b) influence of every bone; rows add up to 1.
        strength: (n, s) influence of every segment.
    """

    vertices: Array
    normals: Array
    weights: Array
    strength: Array

    def with_means(self, corners: NDArray[np.int64], shares: Array) -> Bound:
        """Itself and k more vertices: means of (k, c) corners with shares (k, c), which add up to 1."""
        made = [np.concatenate([values, np.einsum("kc,kcd->kd", shares, values[corners])]) for values in self]
        lengths = np.linalg.norm(made[1][len(self.normals) :], axis=1, keepdims=True)
        made[1][len(self.normals) :] /= np.maximum(lengths, 1e-9)
        return Bound(*made)


def strongest(weights: Array) -> tuple[NDArray[np.uint8], Array]:
    """The bones (n, 4) with the greatest weights (n, b), the strongest first, and these (n, 4), which add up to 1."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :BONES_EACH]
    chosen = np.take_along_axis(weights, bones, axis=1)
    return bones.astype(np.uint8), np.asarray(chosen / chosen.sum(axis=1, keepdims=True))


def divided(bound: Bound, faces: NDArray[np.int64]) -> tuple[Bound, NDArray[np.int64], NDArray[np.int64]]:
    """Cut the triangles (m, 3) between segments; returns vertices, triangles (k, 3) and the segment (k,) of each."""
    # An edge between two segments is cut where both have equal weight, so that no crack opens.
    owner = bound.strength.argmax(axis=1)
    theirs = owner[faces]
    after = np.roll(theirs, -1, axis=1)
    cuts = (theirs != after).sum(axis=1)  # 0, 2 or 3 of a triangle
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)[theirs != after], axis=1)
    if not len(pairs):
        return bound, faces, theirs[:, 0]
    count = len(bound.vertices)
    keys = np.unique(pairs[:, 0] * count + pairs[:, 1])
    ends = np.stack(np.divmod(keys, count), axis=1)
    first, second = ends.T
    lead, back = _lead(bound, owner, first, second), _lead(bound, owner, second, first)
    total = lead + back
    share = np.divide(lead, total, out=np.full(len(keys), 0.5), where=total > 0.0)
    share = np.clip(share, 0.05, 0.95)  # of an edge, on either side of a cut: less makes slivers
    bound = bound.with_means(ends, np.stack([1.0 - share, share], axis=1))

    def cut(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
        wanted = np.minimum(a, b) * count + np.maximum(a, b)
        return np.asarray(count + np.searchsorted(keys, wanted), dtype=np.int64)

    whole = cuts == 0
    made, owners = [faces[whole]], [theirs[whole, 0]]
    two, of_two = faces[cuts == 2], theirs[cuts == 2]  # two segments: the corner that is alone comes first
    alone = np.argmax([(of_two != of_two[:, k : k + 1]).sum(axis=1) == 2 for k in range(3)], axis=0)
    order = (alone[:, None] + np.arange(3)) % 3
    v0, v1, v2 = np.take_along_axis(two, order, axis=1).T
    mine, rest = np.take_along_axis(of_two, order, axis=1)[:, :2].T
    m1, m2 = cut(v0, v1), cut(v0, v2)
    made += [np.stack(corners, axis=1) for corners in ((v0, m1, m2), (m1, v1, v2), (m1, v2, m2))]
    owners += [mine, rest, rest]
    three, of_three = faces[cuts == 3], theirs[cuts == 3]  # three segments: a vertex in the middle
    middle = len(bound.vertices) + np.arange(len(three))
    bound = bound.with_means(three, np.full(three.shape, 1.0 / 3.0))
    for k in range(3):
        here, ahead, behind = three[:, k], three[:, (k + 1) % 3], three[:, k - 1]
        made += [
            np.stack([here, cut(here, ahead), middle], axis=1),
            np.stack([here, middle, cut(here, behind)], axis=1),
        ]
        owners += [of_three[:, k]] * 2
    return bound, np.concatenate(made), np.concatenate(owners)


def _lead(bound: Bound, owner: NDArray[np.int64], here: NDArray[np.int64], there: NDArray[np.int64]) -> Array:
    """(k,) strength at one end of that end's segment, less that of the other end's segment."""
    return np.asarray(bound.strength[here, owner[here]] - bound.strength[here, owner[there]])

"""The surface of a figure: patches of one colour on one segment each, moved by bones (linear blend skinning)."""

from __future__ import annotations

import hashlib
import io
import json
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Person
from wholebody.figures.figure import Figure
from wholebody.figures.hand import FINGERS, PARTS
from wholebody.figures.human.spec import human_spec
from wholebody.geometry.mesh_cache import cached_entry
from wholebody.view.surface.borders import Bound, divided
from wholebody.view.surface.garments import Garment, Part, bounds, made
from wholebody.view.surface.hand_shape import hand_shape
from wholebody.view.surface.nets import Triangles, coarsened
from wholebody.view.surface.person_shape import COLORS, HALVES, PersonShape


class Bone(NamedTuple):
    """What moves vertices.

    Attributes:
        segment: the segment that it moves with; of a half, the segment that it turns half as much as.
        parent: of a half, the segment against which the turn is halved; None of others.
        instead: the segment to move with, rigidly, in a figure that lacks `segment`; None where there is always one.
        bind: (4, 4) placement in the world in the binding posture.
        rest: (4, 4) placement relative to `instead` in such a figure.
    """

    segment: str
    parent: str | None
    instead: str | None
    bind: Array
    rest: Array


class Patch(NamedTuple):
    """A part of the surface.

    Attributes:
        name: such as "shirt:left_upper_arm"; unique.
        segment: the segment whose bones move most of it.
        color: red, green, blue.
        vertices: (n, 3) metres, in the world of the binding posture.
        normals: (n, 3) outward unit vectors.
        faces: (m, 3) indices of vertices, wound outwards.
        coarse: (k, 3) the same of fewer and larger triangles, for shadows and small pictures; neighbours share the
            vertices of their border here too.
        bones: (n, 4) indices of bones.
        weights: (n, 4) their influences, which add up to 1.
    """

    name: str
    segment: str
    color: tuple[float, float, float]
    vertices: Array
    normals: Array
    faces: NDArray[np.int64]
    coarse: NDArray[np.int64]
    bones: NDArray[np.uint8]
    weights: Array


class Surface(NamedTuple):
    """The surface of a body in its binding posture.

    Attributes:
        bones: what moves it.
        parts: closed surfaces: clothes, head, hands, shoes.
    """

    bones: tuple[Bone, ...]
    parts: tuple[Part, ...]

    def patches(self) -> list[Patch]:
        """Every part divided among the segments that move it; neighbours share the vertices of their border."""
        segments = [bone.segment for bone in self.bones]
        names = sorted(set(segments))
        place = np.array([names.index(segment) for segment in segments])
        found = []
        for part in self.parts:
            weights = np.zeros((len(part.weights), len(segments)))
            for column in range(part.weights.shape[1]):
                np.add.at(weights, (np.arange(len(weights)), part.bones[:, column]), part.weights[:, column])
            strength = np.zeros((len(weights), len(names)))
            np.add.at(strength.T, place, weights.T)
            bound = Bound(part.surface.vertices, part.surface.normals, weights, strength)
            bound, fine, owner = divided(bound, part.surface.faces)
            bound, coarse, owner_coarse = divided(bound, coarsened(part.surface))
            bones, influence = bound.strongest()
            for number in np.unique(np.concatenate([owner, owner_coarse])):
                faces, fewer = fine[owner == number], coarse[owner_coarse == number]
                used, local = np.unique(np.concatenate([faces, fewer]), return_inverse=True)
                local = local.reshape(-1, 3)
                found.append(
                    Patch(
                        f"{part.name}:{names[number]}",
                        names[number],
                        part.color,
                        bound.vertices[used],
                        bound.normals[used],
                        local[: len(faces)],
                        local[len(faces) :],
                        bones[used],
                        influence[used],
                    )
                )
        return found


def surface_of(figure: Any) -> Surface | None:
    """Return the surface of a person, an avatar or a hand; None for any other figure.

    The first time a body is drawn takes a second more; then it is kept in the user's cache folder.
    """
    if not isinstance(figure, Figure):
        return None
    person = figure.describe().person
    if person is None:
        return None
    hands = [side for side in ("left", "right") if f"{side}_hand" in figure.segments]
    if "pelvis" in figure.segments:
        return _person_surface(person)
    return _hand_surface(person, hands[0]) if len(hands) == 1 else None


@lru_cache(maxsize=8)
def _person_surface(person: Person) -> Surface:
    return _kept("person", person, lambda: _make_person(person))


@lru_cache(maxsize=8)
def _hand_surface(person: Person, side: str) -> Surface:
    return _kept(f"{side} hand", person, lambda: _make_hand(person, side))


def _make_person(person: Person) -> Surface:
    shape = PersonShape(person)
    bones = {name: Bone(name, None, None, placement, np.eye(4)) for name, placement in shape.bind.items()}
    for side in ("left", "right"):
        for part, parent in HALVES.items():
            segment, other = f"{side}_{part}", parent if parent == "pelvis" else f"{side}_{parent}"
            bind = halfway(shape.bind[other], shape.bind[segment])
            # end of the name of a bone that turns half as much as its segment
            bones[segment + "/half"] = Bone(segment, other, None, bind, np.eye(4))
        hand, frame = hand_shape(person, side), shape.bind[f"{side}_hand"]
        for segment in _finger_segments(side):
            bones[segment] = Bone(segment, None, f"{side}_hand", frame @ hand.bind[segment], hand.rest[segment])
    order = list(bones)
    return Surface(tuple(bones.values()), tuple(made(garment, order) for garment in shape.garments()))


def _make_hand(person: Person, side: str) -> Surface:
    shape = hand_shape(person, side)
    bones = {name: Bone(name, None, None, placement, np.eye(4)) for name, placement in shape.bind.items()}
    bones[f"{side}_forearm"] = Bone(f"{side}_forearm", None, f"{side}_hand", np.eye(4), np.eye(4))
    low, high = bounds(shape.corners, 0.035)
    garment = Garment(f"{side}_hand", COLORS.skin, shape.field, low, high, 0.0030, shape.claims)
    return Surface(tuple(bones.values()), (made(garment, list(bones)),))


def _finger_segments(side: str) -> list[str]:
    return [f"{side}_{finger}_{PARTS[name]}" for finger, parts in FINGERS.items() for name in parts]


def halfway(first: Array, second: Array) -> Array:
    """The placement (4, 4) at the second's origin whose rotation is half way from the first's to the second's."""
    turn = pin.log3(first[:3, :3].T @ second[:3, :3])
    found = np.array(second)
    found[:3, :3] = first[:3, :3] @ pin.exp3(0.5 * turn)
    return found


# ---- kept on disk


def _kept(kind: str, person: Person, make: Any) -> Surface:
    spec = human_spec(person)
    # The 7 is another one whenever a shape, a weight or the layout changes.
    digest = hashlib.sha256(f"7 {kind} {person!r}".encode())
    for solid in spec.solids:
        shape = solid.geometry
        sizes = [getattr(shape, name, 0.0) for name in ("radius", "halfLength")]
        half = np.asarray(getattr(shape, "halfSide", np.zeros(3)))
        digest.update(solid.name.encode() + np.array([*sizes, *half]).tobytes())
        digest.update(np.asarray(solid.placement.homogeneous).tobytes())
    for joint in spec.joints:
        digest.update(joint.name.encode() + np.asarray(joint.origin.homogeneous).tobytes())
    found: Surface = cached_entry(digest.hexdigest(), make, _packed, _unpacked)
    return found


def _packed(surface: Surface) -> bytes:
    arrays: dict[str, Any] = {
        "bind": np.array([bone.bind for bone in surface.bones]),
        "rest": np.array([bone.rest for bone in surface.bones]),
    }
    for number, part in enumerate(surface.parts):
        arrays[f"vertices{number}"] = part.surface.vertices.astype(np.float32)
        arrays[f"normals{number}"] = part.surface.normals.astype(np.float32)
        arrays[f"faces{number}"] = part.surface.faces.astype(np.uint16)
        arrays[f"bones{number}"], arrays[f"weights{number}"] = part.bones, part.weights.astype(np.float32)
    told = {
        "bones": [[bone.segment, bone.parent, bone.instead] for bone in surface.bones],
        "parts": [[part.name, part.color] for part in surface.parts],
    }
    buffer = io.BytesIO()
    np.savez(buffer, told=np.frombuffer(json.dumps(told).encode(), dtype=np.uint8), **arrays)
    return buffer.getvalue()


def _unpacked(data: bytes) -> Surface:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        told = json.loads(arrays["told"].tobytes())
        bones = tuple(
            Bone(segment, parent, instead, bind, rest)
            for (segment, parent, instead), bind, rest in zip(
                told["bones"], arrays["bind"], arrays["rest"], strict=True
            )
        )
        parts = tuple(
            Part(
                name,
                (float(color[0]), float(color[1]), float(color[2])),
                Triangles(
                    arrays[f"vertices{number}"].astype(float),
                    arrays[f"normals{number}"].astype(float),
                    arrays[f"faces{number}"].astype(np.int64),
                ),
                arrays[f"bones{number}"],
                arrays[f"weights{number}"].astype(float),
            )
            for number, (name, color) in enumerate(told["parts"])
        )
    return Surface(bones, parts)

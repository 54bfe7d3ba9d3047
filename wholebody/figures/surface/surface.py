"""The surface of a figure, made when it is first needed and kept on disk."""

from __future__ import annotations

import hashlib
import io
import json
from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.figures.anthropometry import Person
from wholebody.figures.body_spec import urdf_text
from wholebody.figures.figure import Figure
from wholebody.figures.human.spec import human_spec
from wholebody.figures.surface.garments import Bone, Patch, Surface
from wholebody.geometry.mesh_cache import cached_entry


def surface_of(figure: Any) -> Surface | None:
    """Return the surface of a person, an avatar or a hand, kept in the user's cache folder; None for another figure."""
    person = figure.describe().person if isinstance(figure, Figure) else None
    hands = [side for side in ("left", "right") if person and f"{side}_hand" in figure.segments]
    if person is None or ("pelvis" not in figure.segments and len(hands) != 1):
        return None
    if any("/" in name for name in (*figure.segments, *figure.joints)):
        return None  # a person who carries something mounted: the surface would not show that
    return _kept(person, "" if "pelvis" in figure.segments else hands[0])


@lru_cache(maxsize=8)
def _kept(person: Person, hand: str) -> Surface:
    """The surface of a whole person, or of the hand of a side."""

    def make() -> Surface:
        from wholebody.figures.surface.making import hand_surface, person_surface

        return hand_surface(person, hand) if hand else person_surface(person)

    # The number is another one whenever a shape, a weight or the layout changes.
    digest = hashlib.sha256(f"25 {hand} {person!r} {urdf_text(human_spec(person))}".encode())
    return cached_entry(digest.hexdigest(), make, _packed, _unpacked)


_STORED = {"vertices": "f4", "normals": "f4", "bones": "u1", "weights": "f4", "faces": "u2", "coarse": "u2"}
"""Arrays of a patch and their types in the cache, where those of all patches are joined."""


def _packed(surface: Surface) -> bytes:
    patches = surface.patches
    told = {
        "bones": [[bone.segment, bone.parent, bone.instead, bone.slide] for bone in surface.bones],
        "patches": [[patch.name, patch.segment, patch.color] for patch in patches],
    }
    joined = {name: np.concatenate([getattr(patch, name) for patch in patches]) for name in _STORED}
    buffer = io.BytesIO()
    np.savez(
        buffer,
        told=np.frombuffer(json.dumps(told).encode(), dtype=np.uint8),
        bind=np.array([bone.bind for bone in surface.bones]),
        rest=np.array([bone.rest for bone in surface.bones]),
        sizes=np.array([[len(patch.vertices), len(patch.faces), len(patch.coarse)] for patch in patches]),
        **{name: joined[name].astype(kind) for name, kind in _STORED.items()},
    )
    return buffer.getvalue()


def _unpacked(data: bytes) -> Surface:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        told = json.loads(arrays["told"].tobytes())
        placed = zip(told["bones"], arrays["bind"], arrays["rest"], strict=True)
        bones = tuple(
            Bone(name, parent, instead, bind, rest, (x, y, z))
            for (name, parent, instead, (x, y, z)), bind, rest in placed
        )
        ends = np.cumsum(arrays["sizes"], axis=0)[:-1].T
        ends = dict(zip(_STORED, ends[[0, 0, 0, 0, 1, 2]], strict=True))
        parts = [np.split(arrays[name], ends[name]) for name in _STORED]
    patches = [
        Patch(
            name, segment, (color[0], color[1], color[2]), vertices.astype(float), normals.astype(float), moving,
            weights.astype(float), faces.astype(np.int64), coarse.astype(np.int64),
        )
        for (name, segment, color), vertices, normals, moving, weights, faces, coarse in zip(
            told["patches"], *parts, strict=True
        )
    ]  # fmt: skip
    return Surface(bones, tuple(patches))

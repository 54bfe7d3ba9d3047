"""The smooth surface of a body that the viewer draws; contacts are measured with the figure's pieces."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

from wholebody.base.arrays import with_values
from wholebody.figures.anthropometry import Person
from wholebody.figures.body_spec import urdf_text
from wholebody.figures.figure import Figure
from wholebody.figures.human.spec import human_spec
from wholebody.figures.surface.garments import Bone, Patch, Surface, Turn
from wholebody.geometry.mesh_cache import cached_entry

__all__ = ["Bone", "Patch", "Surface", "surface_of"]


def surface_of(figure: Any) -> Surface | None:
    """Return the surface of a person, an avatar or a hand, made once and cached; None for another figure."""
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
    digest = hashlib.sha256(f"34 {hand} {person!r} {urdf_text(human_spec(person))}".encode())
    bones, patches = cached_entry(digest.hexdigest(), make)
    bones = [with_values(Bone(*each), turn=Turn(*each[-1])) for each in bones]
    return Surface(tuple(bones), tuple(Patch(*each) for each in patches))

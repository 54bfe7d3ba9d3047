"""Approaching a contact: the terms that hold just before surfaces meet, each of them on the open side of its face.

The signed distance of two surfaces does not tell on which side of a thing a surface is. A foot under a pedal is pushed
down out of it, never up through it, and a descent from there ends. Towards the plane of the face that it is to lie on,
the distance leads to the open side from everywhere.
"""

from __future__ import annotations

from typing import Any, TypeVar

import coal
import numpy as np

from wholebody.base.records import with_values
from wholebody.geometry.pieces import swept_points
from wholebody.tasks.base import filled
from wholebody.tasks.contact_parts import Gap, Near
from wholebody.tasks.surfaces import Face, Surface

_T = TypeVar("_T")


def has_face(term: Any) -> bool:
    """Whether a resolved term brings a surface to a face of a thing."""
    return any(isinstance(part, (Gap, Near)) and part.face is not None for part in getattr(term, "parts", ()))


def approached(term: _T, distance: float) -> _T:
    """A resolved term whose surfaces are to be in front of the planes of their faces; one without faces as it is.

    Args:
        term: a goal or constraint.
        distance: in front of the planes [m].
    """
    if not has_face(term):
        return term
    return filled(term, parts=tuple(_approached(part, distance) for part in getattr(term, "parts", ())))


def _approached(part: Any, distance: float) -> Any:
    if not isinstance(part, (Gap, Near)) or part.face is None:
        return part
    return with_values(part, second=_plane(part.face, distance))


def _plane(face: Face, distance: float) -> Surface:
    """The half-space behind a face, moved outwards by a distance; it goes where the thing goes."""
    whole, normal = face.surface, face.axes[2]
    space = coal.Halfspace(normal, float(normal @ face.center) + distance)
    return with_values(
        whole, pieces=whole.pieces[:1], joints=whole.joints[:1], shapes=(space,), reach=(np.inf,),
        swept=(swept_points(space),),
    )  # fmt: skip

"""Contact: a surface of the figure brought to a surface of a thing, where it may slide; and leaning on something."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import shown
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.axis import across
from wholebody.tasks.base import filled
from wholebody.tasks.contact_parts import ContactTerm, Facing, Gap, Made, Meeting, OwnSurface, Part, owner_pairs
from wholebody.tasks.faces import Face, face
from wholebody.tasks.surfaces import Surface, carried_by, nearest, surface

ON_SURFACE = 1e-6  # m: a point this near to a surface of its own piece is on it
WITHIN_FACE = 1e-3  # m: and one on a face is within it if it is this far from all others


@dataclass(frozen=True, eq=False)
class Touch(ContactTerm):
    """Bring a surface to another one: their distance is zero, and they may slide along each other.

    The value is the signed distance of the two surfaces [m]: positive apart, negative in an overlap. Its derivative is
    that of the nearest points along the normal. A frame on the round end of its own piece counts as touching where the
    piece does, if it is at most 8e-6 m off there; one within a flat face lays that on what it touches. Two frames meet:
    the value is the vector between their origins (3,) and, with both on their own pieces, which then face each other,
    an angle (2,) [rad]. Use it as a goal or as a constraint. The clearance of what is to touch is zero, for a frame
    that of the segment which carries it. A thing that is moved is touched where it is.

    Attributes:
        part: name of a segment, of a piece such as "left_hand:0", or of a frame, whose origin then touches. Of a link
            without pieces what is drawn of it touches, else, if it has mass or a joint, what moves with it.
        thing: name of a thing or of one of its pieces, such as "chair:2", or of another segment.
        weight: factor on the squared distance, as a goal [1/m^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a name that the scene does not have.

    Examples:
        >>> palm_on_table = wb.Touch("right_palm", "table")
    """

    part: inputs.Name
    thing: inputs.Name
    _: KW_ONLY
    weight: inputs.Weight = 1.0

    @property
    def frame(self) -> str:
        """What touches."""
        return self.part

    def nearest_points(self, state: State) -> Array:
        """(3,) the middle of the two nearest points, once resolved [m]: where they touch."""
        return nearest(self.parts[0].first, self.parts[0].second, state).point  # type: ignore[attr-defined]

    def resolve(self, scene: Scene, start: Array) -> Touch:
        """Find the two surfaces."""
        key = type(self), self.part, self.thing
        parts, touches = inputs.once(scene, key, partial(self._between, scene))
        return filled(self, parts=parts, touches=touches)

    def _between(self, scene: Scene) -> Made:
        where = f"Touch({shown(self.part)}, {shown(self.thing)})"
        first, second = surface(scene, self.part, where), surface(scene, self.thing, where)
        check_apart(first, second, where)
        if second.fixed is not None and first.fixed is None:
            first, second = second, first  # of the first surface alone it is known whether it is on its own piece
        parts: tuple[Part, ...] = (Gap(first, second, own=own_surface(scene, first)),)
        if second.fixed is not None:
            parts = _meeting(scene, first, second, where)
        return parts, owner_pairs(touched(scene, first), touched(scene, second))


@dataclass(frozen=True, eq=False)
class Lean(ContactTerm):
    """Lean a part of the figure on a thing: they touch, and a side of the part faces the thing.

    Attributes:
        on: the thing that is leaned on: a wall, a backrest, a table's edge.
        part: the segment that leans on it.
        side: (3,) direction in the part's axes that looks at the thing; backwards if left out.
        weight: factor on the squared error, as a goal [1/m^2 and 1/rad^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a name that the scene does not have.

    Examples:
        >>> back = wb.tasks.Lean("wall", part="thorax")
    """

    on: inputs.Name
    _: KW_ONLY
    part: inputs.Name = "thorax"
    side: inputs.Direction = (-1.0, 0.0, 0.0)
    weight: inputs.Weight = 1.0
    resolved_side: Array = field(init=False, repr=False)

    @property
    def frame(self) -> str:
        """What leans."""
        return self.part

    def resolve(self, scene: Scene, start: Array) -> Lean:
        """Find the surfaces, and the face of the thing that looks at the part."""
        where = f"Lean({shown(self.on)})"
        place = inputs.find_place(scene, self.part, where)
        first, second = surface(scene, self.part, where), surface(scene, self.on, where)
        check_apart(first, second, where)
        with scene.figure.posed(start) as state:
            toward = state.frame(place.frame).rotation @ self.resolved_side
            leaned_on = face(scene, self.on, -toward, state, where)
        facing = Facing(place, across(self.resolved_side), leaned_on, np.array((0.0, 0.0, -1.0)))
        parts = (Gap(first, leaned_on.surface, leaned_on), facing)
        return filled(self, parts=parts, touches=owner_pairs(touched(scene, first), second.owners))


def _meeting(scene: Scene, first: Surface, second: Surface, where: str) -> tuple[Part, ...]:
    """Two points that meet; where both are on the surfaces of their pieces, those look at each other."""
    meeting, normals = Meeting(first, second), (_outwards(scene, first), _outwards(scene, second))
    if normals[0] is None or normals[1] is None:
        return (meeting,)
    face = Face(second, np.zeros(3), across(normals[1]), np.zeros(2))
    place = inputs.find_place(scene, first.name, where)
    return meeting, Facing(place, across(normals[0]), face, np.array((0.0, 0.0, -1.0)))


def _outwards(scene: Scene, point: Surface) -> Array | None:
    """Normal (3,) of the piece on whose surface a point is, in the axes of its frame; None where it is on none."""
    own = own_surface(scene, point)
    if own is None:
        return None
    way = point.fixed.translation - own.middle.fixed.translation
    return np.asarray(point.fixed.rotation.T @ way / np.linalg.norm(way))


def on_its_side(term: Any, scene: Scene, state: State, distance: float) -> Any:
    """A resolved `Touch` with its point in front of the thing by a distance [m]; a term of another kind stays."""
    # a point's distance does not tell the side: a point farther out than the thing is thick is asked for instead
    part = term.parts[0] if isinstance(term, Touch) else None
    if not isinstance(part, Gap) or part.first.fixed is None or abs(part.rows(state)[0][0]) <= distance:
        return term
    thickness = max(each.width for each in part.second.swept)
    if thickness > 0.1:  # m: of a thicker thing no point gets to the far side
        return term
    own = [each for each in scene.figure.segments if each in scene.piece_owner]
    for way in _faces_of(scene, part.first):
        ahead = [
            with_values(part.first, fixed=pin.SE3(fixed.rotation, fixed.translation + far * way))
            for fixed, far in ((part.first.fixed, distance), (part.first.fixed, distance + thickness))
        ]
        if all(nearest(ahead[0], surface(scene, each, each), state).distance > 0.0 for each in own):
            return filled(term, parts=(Gap(ahead[1], part.second),))
    return term


def _faces_of(scene: Scene, point: Surface) -> list[Array]:
    """Normals (3,) of its pieces' surfaces on which a point is, in the axes of its joint."""
    normal = _outwards(scene, point)
    if normal is not None:
        return [point.fixed.rotation @ normal]
    found = list[Array]()
    own = carried_by(scene, point.name, point.joints[0])
    for index, swept in zip(own.pieces, own.swept, strict=True):
        place = scene.geometry.geometryObjects[index].placement
        behind = swept.faces[:, 3] - swept.faces[:, :3] @ place.actInv(point.fixed.translation)
        if not swept.radius and behind.min(initial=np.inf) >= -ON_SURFACE:
            found += [place.rotation @ normal for normal in swept.faces[behind <= ON_SURFACE, :3]]
    return found


def own_surface(scene: Scene, point: Surface) -> OwnSurface | None:
    """The piece on whose round surface, or within whose face, a point is; None for other surfaces and places."""
    if point.fixed is None:
        return None
    own = carried_by(scene, point.name, point.joints[0])
    for index, swept in zip(own.pieces, own.swept, strict=True):
        place = scene.geometry.geometryObjects[index].placement
        there = place.actInv(point.fixed.translation)
        if swept.radius:
            low, high = swept.points.min(axis=0), swept.points.max(axis=0)
            center = np.clip(there, low, high)  # a sphere's centre, or the segment of a capsule along its own axis
            size = float(swept.radius)
        elif len(swept.faces) > 1:
            behind = swept.faces[:, 3] - swept.faces[:, :3] @ there  # m: how far in front of the point each face is
            face = swept.faces[np.argmin(behind)]
            if np.sum(behind < WITHIN_FACE) > 1:
                continue  # a point on an edge leaves the piece room to turn
            on_it = swept.points[face[3] - swept.points @ face[:3] <= ON_SURFACE]
            size = float(np.linalg.norm(on_it - there, axis=1).max(initial=WITHIN_FACE))
            center = there - size * face[:3] if np.abs(behind).min() <= ON_SURFACE else there
        else:
            continue
        if abs(float(np.linalg.norm(there - center)) - size) <= ON_SURFACE:
            basis = across(place.rotation @ (there - center) / float(np.linalg.norm(there - center)))
            middle = with_values(point, fixed=pin.SE3(np.eye(3), place.act(center)))
            return OwnSurface(middle, size, basis[:2], not swept.radius)
    return None


def touched(scene: Scene, found: Surface) -> tuple[str, ...]:
    """Segments and things whose clearance is zero where a surface touches: without owners, what its joint carries."""
    return found.owners or carried_by(scene, found.name, found.joints[0]).owners


def check_apart(first: Surface, second: Surface, where: str) -> None:
    """Refuse two surfaces that cannot move relative to each other."""
    if set(first.joints) == set(second.joints) and len(set(first.joints)) == 1:
        raise InputError(
            f"{where}: {first.name!r} cannot move relative to {second.name!r}; name two with a joint between them"
        )

"""Surfaces of segments and things, and the distance between two of them.

A surface is a union of convex pieces, or one point. Its pieces are read from the scene's geometry model whenever they
are asked for, so a thing that is moved after a term was resolved is found where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures.link_pieces import drawn_pieces
from wholebody.figures.postures import zero
from wholebody.figures.state import State
from wholebody.geometry.flesh import Flesh, flesh_of
from wholebody.geometry.pieces import SweptPoints, swept_points
from wholebody.scene.scene import Scene
from wholebody.tasks.inputs import once

_T = TypeVar("_T")

POINT = 1e-9  # m: radius of the ball that stands for a point
ACCURACY = 1e-9  # m: to which coal computes a distance; coarser, and a normal is noise
STANDING = -1  # the number of what no posture moves
NO_REACH = np.zeros(0)
_REQUEST = coal.DistanceRequest()
_REQUEST.gjk_tolerance = _REQUEST.epa_tolerance = ACCURACY


class Where(NamedTuple):
    """Where the pieces of a surface are."""

    number: int  # that of the posture; `STANDING` where no joint moves them
    first: pin.SE3  # placement of the first piece in its joint: a thing may be moved at any time
    places: list[pin.SE3]  # (k,) in the world
    origins: Array  # (k, 3) [m]
    shapes: tuple[Any, ...]  # those of the surface, whose identity names it


class Surface(NamedTuple):
    """Convex pieces that count as one surface."""

    name: str  # of the segment, thing, piece or frame
    # segments and things that the pieces are part of; none for a point and for what is only drawn
    owners: tuple[str, ...]
    geometry: Any  # the geometry model that has the pieces' placements; None for a point
    pieces: tuple[int, ...]  # (k,) indices of the pieces in it
    joints: tuple[int, ...]  # (k,) joint that carries each
    shapes: tuple[Any, ...]  # (k,) coal's shapes
    reach: Array  # (k,) radius of each about its origin, metres
    # (k,) their points and flat faces, which take longer to find than what they are asked for
    swept: tuple[SweptPoints, ...]
    fixed: Any = None  # placement of a point in its joint; None for pieces
    flesh: tuple[tuple[int, Flesh], ...] = ()  # of the pieces those that spread, by their number

    def with_shapes(self, shapes: tuple[Any, ...]) -> Surface:
        """The same pieces with other shapes."""
        swept = tuple(swept_points(shape) for shape in shapes)
        return with_values(self, shapes=shapes, reach=np.array([each.reach for each in swept]), swept=swept)

    def placed(self, number: int, state: State) -> Any:
        """Placement (pin.SE3) of a piece in the world."""
        return self.where(state).places[number]

    def where(self, state: State) -> Where:
        """Where the pieces are: of a thing that stands still, from the posture before."""
        key, fixed = id(self.shapes), self.fixed
        first = self.geometry.geometryObjects[self.pieces[0]].placement if fixed is None else fixed
        kept: Where | None = state.kept.get(key)
        if kept is not None and kept.number in (state.number, STANDING) and kept.first == first:
            return kept
        if len(state.kept) > 256:  # hundreds of problems may share one state
            state.kept.clear()
        joints = state.data.oMi
        if fixed is not None:
            places = [joints[self.joints[0]] * first]
        else:
            pieces = self.geometry.geometryObjects
            places = [joints[joint] * pieces[k].placement for joint, k in zip(self.joints, self.pieces, strict=True)]
        for number, one in self.flesh:
            places[number] = one.placed(self.geometry, joints)
        number = state.number if any(self.joints) else STANDING
        origins = np.array([place.translation for place in places])
        found = state.kept[key] = Where(number, pin.SE3(first), places, origins, self.shapes)
        return found


class Nearest(NamedTuple):
    """The nearest points of two surfaces."""

    distance: float  # signed, metres; negative in an overlap
    normal: Array  # (3,) unit vector from the first surface to the second
    point: Array  # (3,) a point on the line of both nearest points [m]
    joint: int  # joint that carries the piece of the second surface
    against: int  # joint that carries the piece of the first
    pieces: tuple[int, int]  # number of the piece of the first surface, and of the second
    where: tuple[Where, Where]  # all pieces of the first surface, and of the second

    @property
    def places(self) -> tuple[pin.SE3, pin.SE3]:
        """Where the two pieces are in the world."""
        (i, j), (one, other) = self.pieces, self.where
        return one.places[i], other.places[j]


def surface(scene: Scene, name: str, where: str) -> Surface:
    """The surface of a thing, a segment or a piece; of a frame, the point at its origin."""
    # A link of a file without pieces is the hull of what is drawn of it, or of all that moves with it.
    if not isinstance(name, str):
        raise InputError(f"{where} takes the name of a segment, thing, piece or frame, not {shown(name)}")
    owned = [index for index, owner in enumerate(scene.piece_owner) if owner == name]
    if not owned:
        owned = [index for index, piece in enumerate(scene.geometry.geometryObjects) if piece.name == name]
    if owned:
        return of_pieces(scene, name, owned)
    try:
        number = scene.figure.frame_id(name)
    except UnknownNameError as error:
        known = [*error.known, *dict.fromkeys(scene.piece_owner)]
        raise UnknownNameError("segment, thing, piece or frame", name, known, where) from None
    frame = scene.model.frames[number]
    joint = int(frame.parentJoint)
    drawn = [part for part in scene.figure.visual.geometryObjects if part.parentFrame == number]
    if drawn:
        return _of_drawn(name, joint, drawn)
    held_by = scene.model.frames[frame.parentFrame]  # its joint; that of a fixed one has the mass of the link
    if held_by.type == pin.FrameType.JOINT or max(frame.inertia.mass, held_by.inertia.mass) > 0.0:
        rigid = carried_by(scene, name, joint)
        if rigid.pieces:
            return rigid
    return Surface(name, (), None, (), (joint,), (), NO_REACH, (), frame.placement).with_shapes((coal.Sphere(POINT),))


def joined(scene: Scene, name: str, owners: Collection[str]) -> Surface:
    """The surface of several segments or things that count as one."""
    return of_pieces(scene, name, [index for index, owner in enumerate(scene.piece_owner) if owner in owners])


def carried_by(scene: Scene, name: str, joint: int) -> Surface:
    """The surface of the figure's own pieces that a joint carries."""
    segments = set(scene.figure.segments)
    pieces = scene.geometry.geometryObjects
    owned = [k for k, owner in enumerate(scene.piece_owner) if owner in segments and pieces[k].parentJoint == joint]
    return of_pieces(scene, name, owned)


def once_by(
    scene: Scene, things: Iterable[str], where: str, start: Array, key: Hashable,
    make: Callable[[State, State], _T],
) -> _T:  # fmt: skip
    """What `make` makes of the start (nq,) and of `zero`; once, if the figure carries none of them."""

    def made() -> _T:
        with scene.figure.posed(start) as state, scene.figure.posed(zero(scene.figure)) as rest:
            return make(state, rest)

    carried = any(joint for thing in things for joint in surface(scene, thing, where).joints)
    return made() if carried else once(scene, key, made)


def _of_drawn(name: str, joint: int, drawn: Iterable[pin.GeometryObject]) -> Surface:
    """The surface of what is drawn of a link; it has pieces of its own, which are tested against nothing."""
    made = pin.GeometryModel()
    for visual in drawn:
        for solid, placement in drawn_pieces(visual, name):
            made.addGeometryObject(pin.GeometryObject(f"{name}:{made.ngeoms}", joint, placement, solid))
    return _made(name, (), made, range(made.ngeoms))


def of_pieces(scene: Scene, name: str, indices: Sequence[int]) -> Surface:
    """The surface of some pieces of the scene's geometry model."""
    owners = tuple(dict.fromkeys(scene.piece_owner[k] for k in indices))

    def made() -> Surface:
        flesh = {one.piece: one for one in flesh_of(scene.geometry)}
        spread = tuple((number, flesh[index]) for number, index in enumerate(indices) if index in flesh)
        return with_values(_made(name, owners, scene.geometry, indices), flesh=spread)

    return once(scene, ("surface", name, *indices), made)


def _made(name: str, owners: tuple[str, ...], geometry: pin.GeometryModel, indices: Sequence[int]) -> Surface:
    pieces = [geometry.geometryObjects[index] for index in indices]
    joints, shapes = tuple(int(piece.parentJoint) for piece in pieces), tuple(piece.geometry for piece in pieces)
    return Surface(name, owners, geometry, tuple(indices), joints, (), NO_REACH, ()).with_shapes(shapes)


def nearest(first: Surface, second: Surface, state: State) -> Nearest:
    """The nearest points of two surfaces, by coal; of several pairs of pieces, those of the nearest pair."""
    key, one, other = (id(first.shapes), id(second.shapes)), first.where(state), second.where(state)
    kept = state.kept.get(key)
    if kept is None or kept[0] is not one or kept[1] is not other:
        kept = state.kept[key] = one, other, _nearest(first, second, one, other)
    found: Nearest = kept[2]
    return found


def _nearest(first: Surface, second: Surface, one: Where, other: Where) -> Nearest:
    ours, theirs = one.places, other.places
    best: tuple[float, Any, int, int] | None = None
    for least, i, j in _pairs(first, one.origins, second, other.origins):
        if best is not None and least > best[0]:
            break
        result = between_pieces(first.shapes[i], ours[i], second.shapes[j], theirs[j])
        if best is None or result.min_distance < best[0]:
            best = float(result.min_distance), result, i, j
    assert best is not None
    distance, result, i, j = best
    normal = np.array(result.normal)
    if not normal @ normal > 0.25:  # the direction between the origins; up where they coincide
        apart = theirs[j].translation - ours[i].translation
        length = float(np.linalg.norm(apart))
        normal = apart / length if length > 0.0 else np.array((0.0, 0.0, 1.0))
    middle = 0.5 * (result.getNearestPoint1() + result.getNearestPoint2())
    return Nearest(distance, normal, middle, second.joints[j], first.joints[i], (i, j), (one, other))


def _pairs(first: Surface, ours: Array, second: Surface, theirs: Array) -> Iterable[tuple[float, int, int]]:
    """Pairs of pieces with origins (k, 3) after a lower bound of their distance, the least first."""
    if len(ours) == len(theirs) == 1:
        return [(-np.inf, 0, 0)]
    apart = ours[:, None] - theirs
    least = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart)) - (first.reach[:, None] + second.reach)
    bounds, count = least.ravel(), len(theirs)
    order = bounds.argsort(kind="stable")
    return ((bound, *divmod(k, count)) for bound, k in zip(bounds[order].tolist(), order.tolist(), strict=True))


def between_pieces(first: Any, placed: pin.SE3, second: Any, other: pin.SE3) -> Any:
    """Coal's distance of two shapes at their placements."""
    return between_transforms(first, coal.Transform3s(placed), second, coal.Transform3s(other))


def between_transforms(first: Any, placed: Any, second: Any, other: Any) -> Any:
    """The same at coal's transforms, of which one may be kept while the other moves."""
    # One of coal's functors, kept for several calls, remembers where a hull was last: its digits differ.
    result = coal.DistanceResult()
    coal.distance(first, placed, second, other, _REQUEST, result)
    return result


def foot(surface: Surface, number: int, point: Array, state: State) -> Array:
    """The point (3,) of a piece that is nearest to a point (3,) outside of it."""
    place = pin.SE3(np.eye(3), point)
    found = between_pieces(coal.Sphere(POINT), place, surface.shapes[number], surface.placed(number, state))
    return np.array(found.getNearestPoint2())


def outermost(shape: Any, placement: pin.SE3, direction: Array, swept: SweptPoints | None = None) -> Array:
    """Candidates (n, 3) for a piece's points farthest along a unit direction (3,); `swept` if they are known."""
    if swept is None and isinstance(shape, coal.Convex):  # its faces, which take far longer, are not asked for
        return np.asarray(np.array(shape.points()) @ placement.rotation.T + placement.translation)
    swept = swept_points(shape) if swept is None else swept
    if len(swept.points) == 0:  # an ellipsoid: the image of the ball's point whose normal is the direction
        radii = np.asarray(shape.radii)
        pull = radii * (placement.rotation.T @ direction)
        return np.array([placement.translation + placement.rotation @ (radii * pull) / np.linalg.norm(pull)])
    return np.asarray(swept.points @ placement.rotation.T + placement.translation + swept.radius * direction)


class Ball(NamedTuple):
    """The ball of which a foot's underside is a part."""

    center: Array  # (3,) in the axes of the joint that carries the foot [m]
    radius: float  # [m]
    joint: int


def ball_under(bears: Surface, rest: State) -> Ball | None:
    """The ball on which a foot rolls in every direction; None where it stands on a sole, or on a line as a wheel."""
    if len(set(bears.joints)) > 1:
        return None
    # Tilted by 10 degrees or by 60, a sole stands on the same edge; the lowest point of a ball moves as the sine.
    places, tilts = bears.where(rest).places, np.radians((-60.0, -10.0, 10.0, 60.0))
    angles = np.radians(np.arange(0.0, 180.0, 15.0))
    along = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    under = np.sin(tilts)[:, None, None] * along - np.cos(tilts)[:, None, None] * np.array((0.0, 0.0, 1.0))
    points = np.empty((len(places), *under.shape))
    for number, piece in enumerate(zip(bears.shapes, places, bears.swept, strict=True)):
        for index in np.ndindex(under.shape[:2]):
            found = np.atleast_2d(outermost(*piece[:2], under[index], piece[2]))
            points[number][index] = found[np.argmax(found @ under[index])]
    depths = (points * under).sum(axis=3)
    bearing = np.unique(depths[:, 1:3].argmax(axis=0))  # tilted by 60 degrees, a shank may be lower than its foot
    points, depths = points[bearing], depths[bearing]
    lowest = np.take_along_axis(points, depths.argmax(axis=0)[None, :, :, None], axis=0)[0]
    little, large = (((lowest[k] - lowest[3 - k]) * along).sum(axis=1) for k in (2, 3))
    share = little / np.maximum(large, POINT)
    if share.max() > 0.67:  # spheres have 0.2, hulls of 48 corners up to 0.56, soles 0.78 to 1, wheels 1 along the axle
        return None
    radius = float(large.mean() / (2.0 * np.sin(tilts[3])))
    center = lowest[[0, 3]].mean(axis=(0, 1)) + (0.0, 0.0, radius * np.cos(tilts[3]))
    # of the radius: hulls of balls are nearer by up to 0.18, fingers and shanks of one piece with their foot by 0.3
    if np.abs(depths.max(axis=0) - under @ center - radius).max() > 0.25 * radius:
        return None
    joint = bears.joints[0]
    return Ball(np.asarray(rest.data.oMi[joint].actInv(center)), radius, joint)


def segments_on(scene: Scene, joints: Iterable[int]) -> list[str]:
    """Segments with pieces on some joints."""
    segments, wanted = set(scene.figure.segments), set(joints)
    owners = zip(scene.piece_owner, scene.geometry.geometryObjects, strict=True)
    return list(dict.fromkeys(one for one, piece in owners if piece.parentJoint in wanted and one in segments))


def segments_beyond(scene: Scene, joint: int) -> list[str]:
    """Segments on a joint and beyond it, such as a foot with its toes, or a hand with its fingers."""
    joints = (k for k in range(scene.model.njoints) if joint in scene.model.supports[k])
    return once(scene, ("beyond", joint), lambda: segments_on(scene, joints))

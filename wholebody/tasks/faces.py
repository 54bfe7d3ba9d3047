"""Flat faces of things: where somebody sits, stands, leans or lays a hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, Protocol

import coal
import numpy as np

from wholebody.base.arrays import Array, Mask, cross
from wholebody.base.checks import shown
from wholebody.base.errors import InputError
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks.axis import across
from wholebody.tasks.surfaces import Surface, of_pieces, outermost, surface

UP = np.array((0.0, 0.0, 1.0))
SMALLER = 0.4  # share of the largest face's area from which another one counts; less: tops of backrests, rests for arms


class Carried(Protocol):
    """A place with axes that goes with a thing: a face, or the bar of a grip."""

    def at(self, state: State) -> tuple[Array, Array]:
        """Middle (3,) and axes (3, 3) in the world."""

    def rows(self, state: State, wrench: Array, joint: int) -> Array:
        """Rows (m, nv) of wrenches (m, 6) on a joint against it."""


class Face(NamedTuple):
    """A flat face of a thing, in the axes of one of its pieces, so that it goes where the thing goes."""

    surface: Surface  # the pieces of the thing that have the face
    center: Array  # (3,) middle of the face [m]
    axes: Array  # (3, 3) rows: two directions in the face, and its outward normal
    half: Array  # (2,) half its size along the two directions; inf for a half-space [m]

    @property
    def joint(self) -> int:
        """Joint that carries the thing; 0 is the world."""
        return self.surface.joints[0]

    def at(self, state: State) -> tuple[Array, Array]:
        """Middle (3,) and axes (3, 3) in the world."""
        place = self.surface.placed(0, state)
        return place.act(self.center), self.axes @ place.rotation.T

    def rows(self, state: State, wrench: Array, joint: int) -> Array:
        """Rows (m, nv) of wrenches (m, 6) on a joint against what has the face."""
        return state.wrench_jacobian(Wrench(wrench, joint, self.joint))


def face(scene: Scene, name: str, direction: Array, state: State, where: str) -> Face:
    """The face of a thing that looks towards a direction, to lay a palm on, to sit on, to stand on or to lean at.

    Of a box it is the nearest one, of what is round where it reaches farthest. Of other flat faces within 45 degrees of
    the direction those count that have two fifths of the area of the largest: a seat and not the narrow top of its
    backrest, a desk and not the screen on it. Of these, it is the one that reaches farthest.
    """
    found = _with_faces(scene, name, where)
    if len(found.shapes) > 1 or isinstance(found.shapes[0], coal.Convex):
        flat = _flats(found, state, lambda normals: normals @ direction > np.sqrt(0.5))
        shadow = np.ptp(_ends(found, direction, state) @ across(direction)[:2].T, axis=0)
        # of a round thing, each is a small part of what looks there
        least = max([SMALLER * one.area for one in flat] + [0.1 * float(np.prod(shadow))])
        if wide := [one for one in flat if one.area >= least]:
            return _placed(scene, found, max(wide, key=lambda one: float(one.center @ direction)), state)
    return _extreme(found, direction, state)


def back_above(scene: Scene, name: str, seat: Face, state: State, where: str) -> tuple[Face, Surface]:
    """The face of a thing that is the back of its own seat, and the surface of all of its pieces that are the back.

    Raises:
        InputError: it has none.
    """
    found, (middle, axes) = surface(scene, name, where), seat.at(state)

    def above(points: Array) -> Mask:
        higher: Mask = (points - middle) @ axes[2] > 0.05  # m: what is lower is the seat's own edge
        return higher

    flat = _flats(found, state, lambda normals: np.abs(normals @ axes[2]) < 0.5, above)
    looking = [one for one in flat if one.axes[2] @ (middle - one.center) > 0.0]  # over the seat
    if not looking:
        raise InputError(f"{where}: {shown(name)} has no flat back above its seat; name the thing or piece that is it")
    largest = max(looking, key=lambda one: one.area)
    behind = set(largest.pieces)
    for number, shape in enumerate(found.shapes):
        corners = outermost(shape, found.placed(number, state), axes[2], found.swept[number])
        ahead = (corners - largest.center) @ largest.axes[2]
        if above(corners).any() and ahead.max() < 0.1:  # m: rests for arms reach farther
            behind.add(number)
    return _placed(scene, found, largest, state), _part(scene, found, behind)


def _extreme(found: Surface, direction: Array, state: State) -> Face:
    """The face of a thing that looks towards a direction: of a box the nearest one, else where it reaches farthest."""
    place = found.placed(0, state)
    if len(found.shapes) == 1 and isinstance(found.shapes[0], coal.Halfspace):
        normal = np.array(found.shapes[0].n)
        return Face(found, normal * float(found.shapes[0].d), across(normal), np.full(2, np.inf))
    if len(found.shapes) == 1 and isinstance(found.shapes[0], coal.Box):
        half = np.array(found.shapes[0].halfSide)
        along = place.rotation.T @ direction
        axis = int(np.argmax(np.abs(along)))
        normal = np.eye(3)[axis] * (1.0 if along[axis] >= 0.0 else -1.0)
        others = [k for k in range(3) if k != axis]
        return Face(found, normal * half[axis], np.array([*np.eye(3)[others], normal]), half[others])
    everything = _ends(found, direction, state)
    height = everything @ direction
    # m: how far below the highest point of a thing its face reaches; more joins faces, less loses corners
    top = everything[height >= height.max() - 2e-3]
    axes = across(direction)
    flat = top @ axes[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    center = axes[:2].T @ (0.5 * (low + high)) + direction * height.max()
    return Face(found, place.actInv(center), axes @ place.rotation, 0.5 * (high - low))


def _with_faces(scene: Scene, name: str, where: str) -> Surface:
    """The surface of a thing that is no frame, nor endless with other pieces."""
    found = surface(scene, name, where)
    if found.fixed is not None:
        raise InputError(f"{where}: {shown(name)} is a frame and has no face; name a thing or a segment")
    if len(found.shapes) > 1 and any(isinstance(shape, coal.Halfspace) for shape in found.shapes):
        raise InputError(f"{where}: {shown(name)} has a half-space among its pieces; name one, as {name + ':0'!r}")
    return found


def _ends(thing: Surface, direction: Array, state: State) -> Array:
    """Points (n, 3) of which one is the farthest of a thing along a direction."""
    shapes = enumerate(thing.shapes)
    return np.vstack([outermost(shape, thing.placed(number, state), direction) for number, shape in shapes])


class _Flat(NamedTuple):
    """Faces of pieces that are nearly in one plane, as far as no other piece covers them."""

    area: float  # m^2
    center: Array  # (3,) the middle of a rectangle around them, in the world [m]
    axes: Array  # (3, 3) rows: its sides, and the outward normal
    half: Array  # (2,) half its size [m]
    pieces: tuple[int, ...]  # numbers of the pieces


class _Facet(NamedTuple):
    """A face of one convex piece."""

    piece: int
    normal: Array  # (3,) in the world
    offset: float  # of its plane [m]
    corners: Array  # (k, 3) in turn around it [m]
    area: float  # m^2


def _flats(
    thing: Surface,
    state: State,
    admits: Callable[[Array], Mask],
    counts: Callable[[Array], Mask] = lambda points: np.ones(len(points), bool),
) -> list[_Flat]:
    """The largest flat faces with normals (k, 3) that `admits` takes, as far as `counts` takes their points (k, 3)."""
    numbers = [k for k, shape in enumerate(thing.shapes) if isinstance(shape, (coal.Box, coal.Convex))]
    solids = {number: _planes(thing, number, state) for number in numbers}
    facets = [one for piece, planes in solids.items() for one in _facets(thing, piece, planes, admits, state)]
    groups: list[list[_Facet]] = []
    facets.sort(key=lambda one: -one.area)
    for facet in facets:
        if facet.area < 0.02 * facets[0].area:  # chamfers, of which a mesh may have a thousand
            break
        for group in groups:
            first = group[0]
            # 5 degrees and 20 mm: planks of one seat, and neither steps of stairs nor the sides of a prism of 64
            level = np.abs(facet.corners @ first.normal - first.offset).max() < 0.02
            if level and facet.normal @ first.normal > np.cos(np.radians(5.0)):
                group.append(facet)
                break
        else:
            groups.append([facet])
    sizes = [sum(one.area for one in group) for group in groups]
    found, largest = list[_Flat](), 0.0
    for number in np.argsort(sizes)[::-1].tolist():
        if sizes[number] < SMALLER * largest:
            break
        seen = _exposed(groups[number], solids, counts)
        if seen is not None:
            largest = max(largest, seen.area)
            found.append(seen)
    return found


def _planes(thing: Surface, number: int, state: State) -> Array:
    """Planes (f, 4) of a piece in the world: n . x <= b inside."""
    place, faces = thing.placed(number, state), thing.swept[number].faces
    normals = faces[:, :3] @ place.rotation.T
    return np.column_stack([normals, faces[:, 3] + normals @ place.translation])


def _facets(
    thing: Surface, piece: int, planes: Array, admits: Callable[[Array], Mask], state: State
) -> Iterator[_Facet]:
    place = thing.placed(piece, state)
    points = thing.swept[piece].points @ place.rotation.T + place.translation
    for *normal, offset in planes[admits(planes[:, :3])].tolist():
        up = np.array(normal)
        corners = points[points @ up > offset - 1e-5]  # m: rounding of the planes
        if len(corners) > 2:
            flat = (corners - corners.mean(axis=0)) @ across(up)[:2].T
            turn = np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))
            (x, y), corners = flat[turn].T, corners[turn]
            yield _Facet(piece, up, offset, corners, 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _exposed(group: list[_Facet], solids: dict[int, Array], counts: Callable[[Array], Mask]) -> _Flat | None:
    """What of a group no piece covers, seen on a grid; None for nothing."""
    normal = np.sum([one.area * one.normal for one in group], axis=0)
    normal = normal / np.linalg.norm(normal)
    corners = np.vstack([one.corners for one in group])
    axes = _rectangle(normal, np.roll(group[0].corners, -1, axis=0) - group[0].corners, corners)
    low, high = (corners @ axes.T).min(axis=0), (corners @ axes.T).max(axis=0)
    shares = (np.arange(16) + 0.5) / 16
    across_it = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    places = (low[:2] + across_it * (high - low)[:2]) @ axes[:2]
    seen, tops = np.zeros(len(places), bool), np.full(len(places), -np.inf)
    for one in group:
        heights = (one.offset - places @ one.normal) / (normal @ one.normal)
        points = places + heights[:, None] * normal
        free = np.flatnonzero(_inside(points, solids[one.piece], 1e-5) & counts(points))
        for planes in solids.values():
            free = free[~_inside(points[free] + 5e-3 * one.normal, planes, 0.0)]  # m: more is another face
            if not len(free):
                break
        seen[free] = True
        tops[free] = np.maximum(tops[free], heights[free])
    if not seen.any():
        return None
    cell, met = (high - low)[:2] / len(shares), (places @ axes.T)[seen, :2]
    low, high = met.min(axis=0) - 0.5 * cell, met.max(axis=0) + 0.5 * cell
    center = 0.5 * (low + high) @ axes[:2] + float(np.median(tops[seen])) * normal
    return _Flat(float(seen.sum() * cell.prod()), center, axes, 0.5 * (high - low), tuple({f.piece for f in group}))


def _inside(points: Array, planes: Array, room: float) -> Mask:
    """Which points (k, 3) are within planes (f, 4), or less than `room` outside [m]."""
    within: Mask = (points @ planes[:, :3].T <= planes[:, 3] + room).all(axis=1)
    return within


def _rectangle(normal: Array, edges: Array, corners: Array) -> Array:
    """Axes (3, 3) along and across a normal: of the least rectangle around corners (k, 3) beside an edge of (e, 3)."""
    least, best = np.inf, across(normal)
    for edge in edges:
        along = edge - (edge @ normal) * normal
        if (length := float(np.linalg.norm(along))) < 1e-6:
            continue
        axes = np.array([along / length, cross(normal, along / length), normal])
        area = float(np.prod(np.ptp(corners @ axes[:2].T, axis=0)))
        if area < 0.999 * least:
            least, best = area, axes
    return best


def _placed(scene: Scene, thing: Surface, flat: _Flat, state: State) -> Face:
    """A flat face in the axes of the first of its pieces."""
    bearing = _part(scene, thing, flat.pieces)
    place = bearing.placed(0, state)
    return Face(bearing, place.actInv(flat.center), flat.axes @ place.rotation, flat.half)


def _part(scene: Scene, thing: Surface, numbers: Iterable[int]) -> Surface:
    """The surface of some pieces of a thing; of what is only drawn, all of it."""
    return of_pieces(scene, thing.name, [thing.pieces[k] for k in sorted(numbers)]) if thing.owners else thing

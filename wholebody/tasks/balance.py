"""Constraint: the centre of mass above the support polygon of the feet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from itertools import pairwise
from math import hypot, isinf
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, cross
from wholebody.base.errors import InputError
from wholebody.base.fields import Names, Range
from wholebody.figures.postures import zero
from wholebody.figures.state import State
from wholebody.geometry.pieces import swept_points
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, filled
from wholebody.tasks.surfaces import ball_under, of_pieces, outermost

STANDING_HEIGHT = 0.01
"""Height [m] above a foot's lowest point up to which its corners stand on the ground; soles are rounded by as much."""


STEADY = 0.15
"""Least distance of the centre of mass from the edges of the support polygon, as a share of the polygon's least width:
41 mm of the median man with his feet side by side. People under 60 who lean as far forward and back as they can use
0.60 of the foot's length, with a standard deviation of 0.07 (King, Judge & Wolfson 1994, Journal of Gerontology 49(6):
M258, its abstract): a share of 0.2; about 8 % lean farther than 0.15. The centre of mass of nine who leaned all around
came 20 to 59 % less far from the middle of the stance than the edges are (Forth, Fiedler & Paloski 2011, Gait & Posture
33: 715, its abstract); here it is 30 %."""

DOWN = np.array((0.0, 0.0, -1.0))
NEAREST = 1e-5  # Distance [m] below which two points count as one corner


class _Soles(NamedTuple):
    """Points of the pieces of feet, and of what is beyond them, in the axes of their joints."""

    joints: Indices  # (n,) that carry the points
    points: Array  # (n, 4) swept points, and 1; of an ellipsoid its middle
    radii: Array  # (n,) around them
    begin: Indices  # (feet,) first point of each foot
    foot: Indices  # (n,) which foot a point is of
    ellipsoids: list[tuple[int, Any, pin.SE3]]  # place of the point, shape, and where it is


def standing_points(scene: Scene, q: Array, feet: Sequence[str]) -> Array:
    """Points (n, 3) on which the feet, toes included, stand at q: the lowest corners of their pieces."""
    return standing_corners(scene, q, feet)[0]


def standing_corners(scene: Scene, q: Array, feet: Sequence[str]) -> tuple[Array, Indices]:
    """The same, and the joints (n,) that carry them."""
    joints = tuple([place.joint for place in inputs.find_feet(scene, feet, "Balance")])
    soles = inputs.once(scene, ("soles", joints), partial(_soles_of, scene, feet, joints))
    with scene.figure.posed(q) as state:
        points = np.einsum("nj,njk->nk", soles.points, state.joints[soles.joints])
        points[:, 2] -= soles.radii
        for number, shape, local in soles.ellipsoids:
            points[number] = outermost(shape, state.data.oMi[int(soles.joints[number])] * local, DOWN)[0]
        heights = [float(state.data.oMi[k].translation[2]) for k in _carried(scene, feet)]
    height = points[:, 2]
    least = np.minimum.reduceat(height, soles.begin)
    # A hand may bear where it touches a thing; feet may be raised.
    raised = least > min(heights) + (max(heights) - min(heights)) / 3.0
    legs = _legs(scene) if raised.any() else set()
    for foot in np.flatnonzero(raised).tolist():
        if legs and joints[foot] not in legs and not _touches(scene, q, joints[foot]):
            checks.warn(
                f"Balance: {feet[foot]!r} is {least[foot] - min(heights):.2f} m above the lowest joint at the "
                "start and touches nothing: it is counted as bearing; unless a term brings it to what bears it, name "
                "what stands, such as feet=['left_foot', 'right_foot']"
            )
    low = height <= least[soles.foot] + STANDING_HEIGHT
    return points[low], soles.joints[low]


def _carried(scene: Scene, feet: Sequence[str]) -> range:
    """Joints of the figure that stands on some feet."""
    return inputs.joints_with_mass(scene, "Balance", feet) or range(1, scene.model.njoints)


def _legs(scene: Scene) -> set[int]:
    """Joints of legs of persons."""
    figure = scene.figure
    groups = (f"{body}{side}_leg" for body in figure.bodies for side in ("left", "right"))
    return {figure.joint_id(name) for group in groups for name in figure.groups.get(group, ())}


def _touches(scene: Scene, q: Array, joint: int) -> bool:
    """Whether what a joint carries is at a thing."""
    pieces, owners = scene.geometry.geometryObjects, scene.piece_owner
    beyond = {owners[k] for k, one in enumerate(pieces) if joint in scene.model.supports[one.parentJoint]}
    pairs = ((owners[a], owners[b]) for a, b in scene.contacts(q, within=0.05).pair)  # m
    return any(one in beyond and other in scene.objects for pair in pairs for one, other in (pair, pair[::-1]))


def _soles_of(scene: Scene, feet: Sequence[str], bearing: Sequence[int]) -> _Soles:
    points, radii, joints, begin, foot = list[Array](), list[float](), list[int](), list[int](), list[int]()
    ellipsoids: list[tuple[int, Any, pin.SE3]] = []
    pieces = scene.geometry.geometryObjects
    for number, (name, joint) in enumerate(zip(feet, bearing, strict=True)):
        begin.append(len(radii))
        beyond = (k for k, piece in enumerate(pieces) if joint and joint in scene.model.supports[piece.parentJoint])
        # a half-space that a foot carries has no end to stand on
        found = [k for k in beyond if not isinf(swept_points(pieces[k].geometry).reach)]
        if not found:
            raise InputError(f"Balance: {name!r} has no pieces to stand on; name segments with geometry as feet")
        with scene.figure.posed(zero(scene.figure)) as rest:
            ball = ball_under(of_pieces(scene, name, found), rest)
        if ball is not None:
            points.append(np.append(ball.center, 1.0)[None])
            radii.append(ball.radius)
            joints.append(ball.joint)
        for piece in () if ball else [pieces[k] for k in found]:
            swept, local = swept_points(piece.geometry), piece.placement
            if not len(swept.points):
                ellipsoids.append((len(radii), piece.geometry, pin.SE3(local)))
            own = swept.points if len(swept.points) else np.zeros((1, 3))
            points.append(np.insert(own @ local.rotation.T + local.translation, 3, 1.0, axis=1))
            radii += [swept.radius] * len(own)
            joints += [int(piece.parentJoint)] * len(own)
        foot += [number] * (len(radii) - begin[-1])
    carriers, first, of = (np.array(each, dtype=np.intp) for each in (joints, begin, foot))
    return _Soles(carriers, np.concatenate(points), np.array(radii), first, of, ellipsoids)


class Polygon(NamedTuple):
    """A convex polygon, anticlockwise: inside, normals @ x >= offsets."""

    corners: Array  # (k, 2)
    normals: Array  # (k, 2) unit normals of the edges, inward
    offsets: Array  # (k,) of the edges
    width: float  # least extent over the directions of the normals


def convex_polygon(points: Array) -> Polygon:
    """The convex hull of points (n, 2)."""
    flat = points[:, :2].round(6)
    found = polygon(flat[hull_corners(flat)].reshape(-1, 2))
    if found.width < 1e-4:  # Width [m] below which a polygon counts as a line.
        raise InputError(
            "Balance: the feet stand on a line, not an area; name more feet, or load a figure with more detail"
        )
    return found


def hull_corners(points: Array) -> list[int]:
    """Indices of the convex hull's corners of points (n, 2), anticlockwise; none on a line."""
    # Andrew's monotone chain (1979), on micrometres: an edge that is rounding alone would have no direction.
    places, rounded = points[:, :2].tolist(), points[:, :2].round(6).tolist()
    order = sorted(range(len(places)), key=rounded.__getitem__)

    def half(indices: Iterable[int]) -> list[int]:
        chain: list[int] = []
        bx = by = np.inf  # the last corner
        for k in indices:
            x, y = places[k]
            while len(chain) > 1:
                ax, ay = places[chain[-2]]
                along, across = x - ax, y - ay
                # Height [m] of a corner over the line through its neighbours below which it is no corner.
                turn = (bx - ax) * across - (by - ay) * along
                if turn > 0.0 and turn > 1e-6 * hypot(along, across):
                    break
                chain.pop()
                bx, by = ax, ay
            if abs(x - bx) > NEAREST or hypot(x - bx, y - by) > NEAREST:
                chain.append(k)
                bx, by = x, y
        return chain

    lower, upper = half(order), half(reversed(order))
    corners = list(dict.fromkeys(lower[:-1] + upper[:-1]))
    return corners if len(corners) > 2 else []


def polygon(corners: Array) -> Polygon:
    """The polygon with these corners (k, 2), anticlockwise; a point or none has no width."""
    normals, offsets = [], []
    places = corners.tolist()  # few: numbers are faster than arrays
    width = np.inf if len(places) > 2 else 0.0
    for (x, y), (following_x, following_y) in pairwise([*places, *places[:1]]):
        along_x, along_y = following_x - x, following_y - y
        length = hypot(along_x, along_y)
        a, b, offset = -along_y / length, along_x / length, (along_x * y - along_y * x) / length
        width = min(width, max([a * x + b * y for x, y in places]) - offset)
        normals.append((a, b))
        offsets.append(offset)
    return Polygon(corners, np.reshape(normals, (-1, 2)), np.array(offsets), width)


def shrunk(whole: Polygon, margin: float) -> Array:
    """Corners (m, 2) of a polygon with a margin cut off (Sutherland and Hodgman 1974); empty if nothing remains."""
    rest = whole.corners
    for normal, offset in zip(whole.normals, whole.offsets, strict=True):
        inside = rest @ normal - offset - margin
        kept = []
        for i in range(len(rest)):
            a, b = inside[i - 1], inside[i]
            if (a >= 0.0) != (b >= 0.0):
                kept.append(rest[i - 1] + (rest[i] - rest[i - 1]) * (a / (a - b)))
            if b >= 0.0:
                kept.append(rest[i])
        rest = np.array(kept).reshape(-1, 2)
    return rest


class SolePolygon(NamedTuple):
    """The convex hull of points of the feet, seen from above; row i is for the edge that begins at point i.

    With e = b - a the edge from a to b, anticlockwise, n its inward normal and s = (e . (c - a)) / |e|^2, the distance
    d = n . (c - a) of the centre of mass c changes by n . (dc - (1 - s) da - s db): n turns with the edge.
    """

    points: Array  # (m, 3) in the axes of their joints [m]
    joints: Indices  # (m,) joint that carries each
    mass: range | None  # joints of the figure whose centre of mass it is; None for all

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return (False,) * len(self.joints)

    def corners(self, state: State) -> Array:
        """Corners (k, 2) of the polygon, anticlockwise."""
        points = self._placed(state)[:, :2]
        return points[hull_corners(points)]

    def _placed(self, state: State) -> Array:
        """The points (m, 3) in the world."""
        placed = state.joints[self.joints]
        return np.asarray(np.einsum("nj,njk->nk", self.points, placed[:, :3]) + placed[:, 3])

    def rows(self, state: State) -> tuple[Array, Array]:
        """Distances (m,) inside the edges and their derivative (m, nv); 1 and zero for no corner."""
        return self.inside(state, state.center_of_mass(self.mass), state.center_of_mass_jacobian(self.mass))

    def height(self, state: State) -> tuple[float, Array]:
        """Mean height of the points [m] and its derivative (nv,)."""
        points, up = self._placed(state), np.zeros((len(self.joints), 6))
        up[:, 2], up[:, 3], up[:, 4] = 1.0, points[:, 1], -points[:, 0]
        return float(points[:, 2].mean()), state.rows(up, self.joints, np.zeros_like(self.joints)).mean(axis=0)

    def inside(self, state: State, center: Array, moves: Array) -> tuple[Array, Array]:
        """The same of another point (2,) or (3,) than the centre of mass, with its derivative."""
        points = self._placed(state)
        # a point that is no corner of the polygon is far inside, by 1 m
        values, rows = np.full(len(points), 1.0), np.zeros((len(points), state.model.nv))
        corners = hull_corners(points[:, :2])
        if not corners:
            return values, rows
        begin, end = np.array(corners, dtype=np.intp), np.array([*corners[1:], corners[0]], dtype=np.intp)
        edge, arm = (points[end] - points[begin])[:, :2], center[:2] - points[begin, :2]
        length, normals = np.hypot(edge[:, 0], edge[:, 1]), np.zeros((len(corners), 3))
        normals[:, 0], normals[:, 1] = -edge[:, 1] / length, edge[:, 0] / length
        share = np.einsum("ij,ij->i", edge, arm) / length**2
        values[begin] = np.einsum("ij,ij->i", normals[:, :2], arm)
        both, along = np.concatenate([begin, end]), np.concatenate([normals, normals])
        wrench = np.concatenate([along, cross(points[both], along)], axis=1)
        gone = np.append(1.0 - share, share)[:, None] * state.rows(wrench, self.joints[both], np.zeros_like(both))
        rows[begin] = normals[:, :2] @ moves[:2] - gone[: len(begin)] - gone[len(begin) :]
        return values, rows


Feet: TypeAlias = Annotated[Sequence[str], Names("['left_foot', 'right_foot']")]
Margin: TypeAlias = Annotated[float, Range(0.0, 1.0, "m")]


@dataclass(frozen=True, eq=False)
class Balance(Constraint):
    """Keep the centre of mass above the support polygon of the feet, so that the figure can stand still.

    The polygon is the convex hull of the points on which the feet stand at the start; hold the feet there. There is a
    row for each edge: the horizontal distance of the centre of mass from it, positive inside [m].

    Attributes:
        feet: names of the segments that carry the figure, including their child segments, such as toes.
        margin: least distance from the edges [m].
        joints: of the figure that stands, among several; None where there is one.

    Raises:
        InputError: a margin out of range, or feet that do not stand on anything at the start.

    Examples:
        >>> steady = wb.Balance(margin=0.02)
    """

    feet: Feet = ("left_foot", "right_foot")
    _: KW_ONLY
    margin: Margin = 0.0
    joints: range | None = field(init=False, repr=False, default=None)
    normals: Array = field(init=False, repr=False)  # (m, 2) unit normals of the edges of the support polygon, inward
    offsets: Array = field(init=False, repr=False)  # (m,) of the edges: inside, normals @ x >= offsets [m]

    def resolve(self, scene: Scene, start: Array) -> Balance:
        """Compute the support polygon at the start."""
        return self.on_points(standing_points(scene, start, self.feet), scene)

    def on_points(self, points: Array, scene: Scene, steady: bool = False) -> Balance:
        """Copy that is ready to be evaluated, on points (n, 3) of the soles; if `steady`, with that as its margin."""
        joints, sole = inputs.joints_with_mass(scene, "Balance", self.feet), convex_polygon(points)
        margin = STEADY * sole.width if steady else self.margin
        # The circle inside a convex set has at least a third of its width as radius (Blaschke 1915).
        if 3.0 * margin > sole.width and len(shrunk(sole, margin)) == 0:
            raise InputError(
                f"Balance: a margin of {margin:g} m leaves nothing of the support polygon; make it smaller"
            )
        return filled(self, margin=margin, joints=joints, normals=sole.normals, offsets=sole.offsets)

    @property
    def lower(self) -> Array:
        """The margin."""
        return np.array(self.margin)

    def value(self, state: State) -> Array:
        """(m,) distance inside each edge [m]."""
        return np.asarray(self.normals @ state.center_of_mass(self.joints)[:2] - self.offsets)

    def jacobian(self, state: State) -> Array:
        """(m, nv)."""
        return np.asarray(self.normals @ state.center_of_mass_jacobian(self.joints)[:2])

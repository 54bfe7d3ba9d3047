"""The pieces of a scene as parts of bodies, the pairs of them that can meet, and the points at which they touch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, Mask, cross, with_values
from wholebody.base.compiled import compiled
from wholebody.base.errors import InputError
from wholebody.dynamics import motion_kernel
from wholebody.geometry.contact_rows import ContactRowBuilder, compiled_kernel
from wholebody.geometry.flesh import is_flesh
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.proximity import Contacts, PairTable, Proximity
from wholebody.scene.matter.body import MATERIALS, MassProperties, Material, Surface, mass_properties, surface
from wholebody.scene.scene import Scene

HUMAN = MATERIALS["human"]  # of every figure


def surface_of(scene: Scene, first: str, second: str) -> Surface:
    """What happens where two segments or things touch."""
    one, other = (scene.objects[name].material if name in scene.objects else HUMAN for name in (first, second))
    return surface(one, other)


class Surfaces:
    """What happens where two of so many named bodies touch, asked once for each two."""

    def __init__(self, scene: Scene, names: Sequence[str]) -> None:
        self._scene, self._names = scene, names
        self._known = np.full((len(names), len(names), 2), np.nan)

    def __call__(self, both: Indices) -> tuple[Array, Array]:
        """Restitution and friction (k,) of bodies (k, 2)."""
        first, second = both.T
        found = self._known[first, second]
        unknown = np.isnan(found[:, 0])
        if unknown.any():
            for one, other in set(map(tuple, both[unknown].tolist())):
                self._known[one, other] = surface_of(self._scene, self._names[one], self._names[other])
            found = self._known[first, second]
        return found[:, 0], found[:, 1]


class PlacedProximity(Proximity):
    """Distances between pieces that stand where they are said to stand."""

    def place(self, data: Array) -> Array:
        """Take placements (pieces, 4, 3), flesh as of bent limbs, in the place of Pinocchio's data; the pieces' own."""
        self.distances.put(data)
        self.distances.place_flesh()
        return self.distances.placed


class SweptPoints(NamedTuple):
    """The points that each piece is swept from, for its heights along directions."""

    points: Array  # (points, 3) of all pieces, in their axes
    start: Indices  # (pieces,) the first of each
    number: Indices  # (pieces,) how many
    radius: Array  # (pieces,) around the points
    axes: Array  # (pieces, 3) semi-axes of an ellipsoid; zero for others
    plane: Array  # (pieces, 4) normal and offset of a half-space; zero for others


class Pieces:
    """The bodies of a scene, their pieces, and the pairs of pieces that can meet and of which one moves by itself.

    A body is a thing, or a segment with what it carries. Things that move by themselves come first.

    Attributes:
        names: (n,) of the bodies.
        index: name to number; a carried thing has that of its segment.
        dynamic: (n,) which bodies move by themselves.
        mass: (n,) kg; infinite where nothing is known.
        centre: (n, 3) centre of mass in the body's axes.
        inertia: (n, 3, 3) about it, along the body's axes; identity where nothing is known.
        placement: name to the body's placement in the scene; of segments in the figure's posture.
        body: (pieces,) the body of each piece.
        local: (pieces, 4, 3) placement of each piece in its body.
        table: pieces and pairs.
        restitution: (pairs,).
        friction: (pairs,).
        lever: (n,) greatest distance of a body's swept points from its centre of mass, metres; 0 for a half-space.
        swept: swept points of all pieces.
        jointed: (n,) bodies that have joints.
        notes: what was assumed about masses.
    """

    def __init__(self, scene: Scene, q: Array) -> None:
        """Gather bodies, pieces and pairs, with the figure in the posture q (nq,)."""
        objects = scene.objects
        free = [thing for thing in objects.values() if thing.body is not None]
        fixed = [thing for thing in objects.values() if thing.body is None and thing.segment is None]
        segments = [name for name in dict.fromkeys(scene.piece_owner) if name not in objects]
        for thing in objects.values():
            if thing.segment is not None and thing.segment not in segments:
                segments.append(thing.segment)
        self.names = tuple([thing.name for thing in free] + [thing.name for thing in fixed] + segments)
        self.index = {name: number for number, name in enumerate(self.names)}
        self.dynamic: Mask = np.arange(len(self.names)) < len(free)
        self.mass = np.full(len(self.names), np.inf)
        self.centre = np.zeros((len(self.names), 3))
        self.inertia = np.tile(np.eye(3), (len(self.names), 1, 1))
        self.placement: dict[str, pin.SE3] = {thing.name: thing.placement for thing in (*free, *fixed)}
        self.placement.update(segment_placements(scene, q))
        self.notes: tuple[str, ...] = ()
        for number, thing in enumerate(free):
            known = mass_properties(thing.shape, thing.body, thing.name)  # type: ignore[arg-type]
            self._weigh(number, known)
            self.notes += (known.note,) if known.note else ()
        for name in segments:
            self._weigh_segment(scene, name)
        self._add_pieces(scene)

    def _weigh(self, number: int, known: MassProperties) -> None:
        self.mass[number], self.centre[number], self.inertia[number] = known.mass, known.centre, known.inertia

    def _weigh_segment(self, scene: Scene, name: str) -> None:
        """The mass of a segment is that of all that its joint carries."""
        frame = scene.model.frames[scene.frame_id(name)]
        carried = scene.model.inertias[frame.parentJoint]
        if frame.parentJoint > 0 and carried.mass > 0.0 and np.linalg.eigvalsh(carried.inertia).min() > 0.0:
            inertia = frame.placement.actInv(carried)
            self._weigh(self.index[name], MassProperties(inertia.mass, inertia.lever, inertia.inertia))

    def _add_pieces(self, scene: Scene) -> None:
        built, objects = scene.built, scene.objects
        pieces, body, local, made_of = [], [], [], []
        local_of = {index: (name, at) for name, parts in built.pieces_of.items() for index, at in parts}
        for number, piece in enumerate(built.geometry.geometryObjects):
            if number in local_of:
                name, at = local_of[number]
                thing = objects[name]
                owner = name if thing.segment is None else thing.segment
                at = at if thing.segment is None else thing.placement * at
                made_of.append(thing.material)
            else:
                owner = built.owners[number]
                at = scene.model.frames[scene.frame_id(owner)].placement.actInv(piece.placement)
                made_of.append(HUMAN)
            pieces.append(pin.GeometryObject(piece.name, 0, 0, pin.SE3.Identity(), piece.geometry))
            pieces[-1].meshPath = piece.meshPath if is_flesh(piece) else ""
            body.append(self.index[owner])
            local.append([*at.rotation.T, at.translation])
        self.body: Indices = np.array(body, dtype=np.intp)
        self.local = np.array(local, dtype=float).reshape(-1, 4, 3)
        free = self.dynamic[self.body]  # each with what does not move by itself, and with those after it
        first, second = np.repeat(np.flatnonzero(free), len(pieces)), np.tile(np.arange(len(pieces)), int(free.sum()))
        pairs = np.sort(np.column_stack([first, second])[~free[second] | (first < second)], axis=1).astype(np.intp)
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        a, b = self.body[pairs].T
        kept = a != b
        if scene.figure.outer:
            kept &= (pairs >= scene.figure.geometry.ngeoms).all(axis=1)  # its own pieces do not meet things
        self.jointed: Mask = np.zeros(len(self.names), dtype=bool)
        for name, holder in joined(scene):
            one, other = self.index[name], self.index[name if holder is None else holder]
            self.jointed[[one, other]] = True
            kept &= ~(((a == one) & (b == other)) | ((a == other) & (b == one)))
        self.table = PairTable(pin.Model(), geometry_model(pieces, pairs[kept]), pairs[kept])
        surfaces = self._surfaces(made_of)
        self.restitution, self.friction = surfaces[:, 0].copy(), surfaces[:, 1].copy()
        self._add_swept_points()

    def _surfaces(self, made_of: list[Material]) -> Array:
        known: dict[tuple[int, int], tuple[float, float]] = {}
        found = np.zeros((len(self.table.pairs), 2))
        for number, (i, j) in enumerate(self.table.pairs.tolist()):
            key = (id(made_of[i]), id(made_of[j]))
            if key not in known:
                known[key] = tuple(surface(made_of[i], made_of[j]))  # type: ignore[assignment]
            found[number] = known[key]
        return found

    def _add_swept_points(self) -> None:
        """Take the swept points of the table, and their greatest distances from centres of mass."""
        table, centres, number = self.table, self.centre[self.body], np.diff(self.table.first_point)
        endless, plane = np.isinf(table.reach), np.zeros((len(number), 4))
        plane[endless] = table.faces[table.first_face[:-1][endless]]
        axes = np.where((~endless & (number == 0))[:, None], table.half, 0.0)
        self.swept = SweptPoints(table.points, table.first_point[:-1], number, table.radius, axes, plane)
        lever = np.where(endless, 0.0, np.linalg.norm(self.local[:, 3] - centres, axis=1) + table.reach)
        for k in np.flatnonzero(number).tolist():
            placed = table.swept[k].points @ self.local[k, :3] + self.local[k, 3] - centres[k]
            lever[k] = float(np.linalg.norm(placed, axis=1).max())
        self.lever = np.zeros(len(self.names))
        np.maximum.at(self.lever, self.body, lever)


def segment_placements(scene: Scene, q: Array) -> dict[str, pin.SE3]:
    """Where every segment of the figure is at a posture q, shape (nq,)."""
    model = scene.model
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    pin.updateFramePlacements(model, data)
    carrying = (thing.segment for thing in scene.objects.values() if thing.segment is not None)
    return {
        name: pin.SE3(data.oMf[scene.frame_id(name)]) for name in dict.fromkeys((*scene.figure.segments, *carrying))
    }


def joined(scene: Scene) -> tuple[tuple[str, str | None], ...]:
    """Names of things that have joints, each with what holds it; None for the world."""
    found = []
    known = [name for name, thing in scene.objects.items() if thing.segment is None]
    for name, thing in scene.objects.items():
        for joint in () if thing.body is None else thing.body.joints:
            if joint.to is not None:
                checks.known(joint.to, known, "thing", f"the joint of {name!r}")
            if joint.to == name:
                raise InputError(f"{name!r} has a joint to itself; name another thing, or None for the world")
            found.append((name, joint.to))
    return tuple(found)


class ContactPoints(NamedTuple):
    """Points of contacts, one row each."""

    pair: Indices  # (m,) place of the pair among the pairs of pieces
    bodies: Indices  # (m, 2) A and B
    normal: Array  # (m, 3) unit normal from A to B
    point: Array  # (m, 3) in the world, between the two surfaces
    gap: Array  # (m,) metres

    def linked(self, bodies: Mask, movable: Mask, things: int, touch: float) -> ContactPoints:
        """Points of `bodies` (n,) and of movable ones that touch them, gaps up to `touch` [m]."""
        among, linked = (self.bodies < things).all(axis=1), bodies
        while True:
            found = among & linked[self.bodies].any(axis=1)
            joined = linked.copy()
            joined[self.bodies[found & (self.gap <= touch)]] = True
            joined &= movable
            if (joined == linked).all() or found.sum() > 40:  # points; more: exact for more things, slower
                return with_values(self, **{name: part[found] for name, part in self._asdict().items()})
            linked = joined


def places(wrench: Array, contacts: Contacts, owner: Indices) -> Array:
    """Points (m, 3) of rows (m, 6), normal and moment, half way between the surfaces of their contacts (m,)."""
    normal, middle = wrench[:, :3], 0.5 * (contacts.point_a + contacts.point_b)
    height = (normal * middle[owner]).sum(axis=1)
    return np.asarray(cross(normal, wrench[:, 3:]) + height[:, None] * normal)


class ContactFinder:
    """Finds near pairs and their contact points for one run of the engine."""

    def __init__(self, pieces: Pieces) -> None:
        self.pieces = pieces
        self._proximity = PlacedProximity(pieces.table)
        # six points of a contact beside its witness points: a box on a box has four, two crossed planks have six;
        # normals within 0.1 rad are the same: coal's are off by some 0.02 rad where pieces are 50 um apart
        self._rows = ContactRowBuilder(pieces.table, 6, 0.995)
        compiled_kernel()  # not in the middle of a motion
        self._last: tuple[Contacts, ContactPoints] | None = None  # of the last question
        self._bodies = pieces.body[pieces.table.pairs]

    def near(self, position: Array, rotation: Array, margin: Array, active: Mask) -> Contacts:
        """Pairs that are nearer than the margins (n,) of both bodies together, metres, and have an active body."""
        pieces = self.pieces
        placement = np.empty((len(pieces.body), 4, 3))
        motion_kernel.place_pieces(position, rotation, pieces.centre, pieces.body, pieces.local, placement)
        first, second = self._bodies[:, 0], self._bodies[:, 1]
        most = np.where(active[first] | active[second], margin[first] + margin[second], -np.inf)
        within = float(2.0 * margin.max(initial=0.0))
        return self._proximity.query(placement, within, most)

    def points(self, contacts: Contacts) -> ContactPoints:
        """Contact points of near pairs; the normals in `contacts` become those of faces where they are meant."""
        if self._last is not None and self._last[0] is contacts:
            return self._last[1]
        rows = self._rows.rows(contacts)
        owner = rows.contact
        normal = rows.wrench[:, :3].copy()
        point = places(rows.wrench, contacts, owner)
        kept = needed(owner, len(contacts.distance), normal, point, rows.gap, 1e-5)  # m: see `step_program.TOUCH`
        owner, normal, point = owner[kept], normal[kept], point[kept]
        bodies: Indices = self.pieces.body[contacts.pair[owner]]
        self._last = contacts, ContactPoints(contacts.number[owner], bodies, normal, point, rows.gap[kept])
        return self._last[1]


@compiled()
def needed(contact: Indices, count: int, normal: Array, point: Array, gap: Array, within: float) -> Mask:
    """All points (m,) except witness points (they come first) between touching ends of a patch, to `within` [m]."""
    # Ends alone bear a face on a face, as in Bullet, MuJoCo and ODE: friction at a witness point would not stop a spin.
    found, first, arm = np.ones(len(contact), dtype=np.bool_), count, np.empty((len(contact) - count, 3))
    while first < len(contact):
        c, arms, last = contact[first], 0, first
        while last < len(contact) and contact[last] == c:
            if gap[last] - gap[c] <= within:
                for k in range(3):
                    arm[arms, k] = point[last, k] - point[c, k]
                arms += 1
            last += 1
        found[c] = not _surrounded(arm[:arms], normal[c])
        first = last
    return found


@compiled(inner=True)
def _surrounded(arm: Array, normal: Array) -> bool:
    """Whether the origin is between points (k, 3) of a plane: seen from it, each has another half a turn on or more."""
    for one in arm:
        found = False
        for other in arm:
            cross, dot, square, other_square = 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                cross += normal[k] * (one[i] * other[j] - one[j] * other[i])
                dot += one[k] * other[k]
                square += one[k] * one[k]
                other_square += other[k] * other[k]
            straight = 1e-3 * np.sqrt(square * other_square)  # on a line with the origin, but for coal's accuracy
            if cross < -straight or (cross <= straight and dot < 0.0):
                found = True
                break
        if not found:
            return False
    return len(arm) > 0

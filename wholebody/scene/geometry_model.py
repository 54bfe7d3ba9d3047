"""The geometry model of a scene: pieces of a figure, of carried things and of things around, and their pairs."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import combinations
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Indices, Mask, brief
from wholebody.base.pool import Pooled
from wholebody.geometry.contact_rows import ContactRowBuilder
from wholebody.geometry.continuous.moved_pairs import compiled_kernel
from wholebody.geometry.flesh import is_flesh
from wholebody.geometry.large_models import geometry_model, pairs_of
from wholebody.geometry.pieces import SweptPoints
from wholebody.geometry.proximity import PairTable, Proximity
from wholebody.scene.matter.body import DEFAULT, Material

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.geometry.shapes import Shape
    from wholebody.scene.matter.body import Body

T = TypeVar("T")


@dataclass(frozen=True)
class Motion:
    """How a thing came to where it is: where it was, in the world or in the frame of its segment, and the seconds."""

    start: pin.SE3
    seconds: float


@dataclass(frozen=True)
class SceneObject:
    """One thing in a scene.

    Attributes:
        name: its name, unique among the objects and segments of the scene.
        shape: its shape.
        placement: in the world, or in the segment's frame for a carried thing.
        segment: the segment that carries it; None for a thing in the world.
        color: red, green, blue, alpha from 0 to 1, or None for the viewer's choice.
        rests_on: segments and carried things that a carried thing is not tested against.
        motion: how it came to its placement; None if it was put there.
        body: mass and velocity of a thing that `wholebody.dynamics` moves; None for one that it does not.
        material: what it is made of; a body's own.
    """

    name: str
    shape: Shape
    placement: pin.SE3
    segment: str | None = None
    color: tuple[float, float, float, float] | None = None
    rests_on: tuple[str, ...] = ()
    motion: Motion | None = None
    body: Body | None = None
    material: Material = DEFAULT

    __repr__ = brief


class SceneGeometry(Pooled):
    """The geometry model of the list of objects, with the indices into it.

    Only the placements of the pieces of things change, by `place`. Any number of runs may share it; the data that a run
    changes come from `pool`.

    Attributes:
        model: Pinocchio's model of the figure.
        geometry: the geometry model of all pieces and pairs.
        table: pieces and pairs as arrays.
        rows: builds contact rows.
        owners: name of the segment or object that each piece is part of.
        pieces_of: object to its pieces: index, and placement in the object.
        number_of: object to a number from 1 on.
        standing: pieces (m,) that the world carries, and the number of the object of each (m,); 0 for the figure's.
        lock: held while pieces are placed, and while more than one placement is copied.
        moves: how often a thing was placed.
    """

    def __init__(
        self,
        model: pin.Model,
        geometry: pin.GeometryModel,
        owners: tuple[str, ...],
        pieces_of: dict[str, list[tuple[int, pin.SE3]]],
        pairs: Indices | None = None,
        swept: Sequence[SweptPoints] | None = None,
    ) -> None:
        self.model, self.geometry, self.owners, self.pieces_of = model, geometry, owners, pieces_of
        self.table = PairTable(model, geometry, pairs, swept)
        self.number_of = {name: number for number, name in enumerate(pieces_of, start=1)}
        standing: Indices = np.flatnonzero(self.table.joint == 0).astype(np.intp)
        # those of joined figures, "anna/seat", have numbers below zero: each figure's its own
        own = {name: -number for number, name in enumerate(dict.fromkeys(owner.partition("/")[0] for owner in owners))}
        of_figures = {owner: own[owner.partition("/")[0]] if "/" in owner else 0 for owner in owners}
        numbered = of_figures | self.number_of
        numbers = [numbered[owners[k]] for k in standing]
        self.standing = standing, np.array(numbers, dtype=np.intp)
        self.rows = ContactRowBuilder(self.table)
        compiled_kernel()  # of `far_moved`: compile now, not during a solve
        self.lock = Lock()
        self.moves = 0
        self._moved_at = np.zeros(geometry.ngeoms, dtype=np.int64)
        self._put_at: dict[str, int] = {}
        super().__init__()
        self._known: OrderedDict[Any, Any] = OrderedDict()

    def place(self, name: str, base: pin.SE3, *, moving: bool = False) -> None:
        """Put the pieces of an object to its placement in its joint's frame, or move them there along the way."""
        with self.lock:
            self.moves += 1
            if not moving:
                self._put_at[name] = self.moves
            for index, local in self.pieces_of[name]:
                self.geometry.geometryObjects[index].placement = base * local
                self._moved_at[index] = self.moves

    def update_placements(
        self, proximity: Proximity, seen: int, moved: dict[str, tuple[pin.SE3, pin.SE3]] | None = None
    ) -> int:
        """Update placements of pieces that moved since `seen`; the number of moves. `moved` takes before and after."""
        if seen == self.moves:
            return seen
        with self.lock:
            if moved is not None:
                self._note_moved(proximity, seen, moved)
            for index in self.moved_since(seen).tolist():
                proximity.place_piece(index, self.geometry.geometryObjects[index].placement)
            return self.moves

    def moved_since(self, seen: int) -> Indices:
        """Pieces (k,) of things that were placed after so many moves."""
        return np.flatnonzero(self._moved_at > seen)

    def _note_moved(self, proximity: Proximity, seen: int, moved: dict[str, tuple[pin.SE3, pin.SE3]]) -> None:
        for name in dict.fromkeys(self.owners[piece] for piece in self.moved_since(seen).tolist()):
            index, local = self.pieces_of[name][0]
            before, after = (
                model.geometryObjects[index].placement * local.inverse()
                for model in (proximity.geometry, self.geometry)
            )
            if self._put_at.get(name, 0) > seen:
                moved[name] = (after, after)
                continue
            moved[name] = (moved[name][0] if name in moved else before, after)

    def known(self, key: Hashable, make: Callable[[], T]) -> T:
        """What follows from the model and a key alone, made the first time and read-only; the last 64 are kept."""
        found: T | None = self._known.get(key)
        if found is None:
            found = make()
            with self.lock:
                self._known[key] = found
                if len(self._known) > 64:
                    self._known.popitem(last=False)
            return found
        try:  # noqa: SIM105 # a context takes longer than to find what is known
            self._known.move_to_end(key)
        except KeyError:  # another thread has just made room
            pass
        return found

    def between(self, owners: Set[tuple[str, str]]) -> Mask:
        """Which collision pairs are of owners that stand in some pairs of names, in either order."""
        pairs = ((self.owners[a], self.owners[b]) for a, b in self.table.pairs.tolist())
        return np.array([pair in owners or pair[::-1] in owners for pair in pairs], dtype=bool)

    def copied(self) -> SceneGeometry:
        """A copy with placements of its own."""
        with self.lock:
            pieces, table = dict(self.pieces_of), self.table
            return SceneGeometry(self.model, self.geometry.copy(), self.owners, pieces, table.pairs, table.swept)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments that it is made from."""
        return SceneGeometry, (self.model, self.geometry, self.owners, self.pieces_of, self.table.pairs)


def assemble(figure: Figure, objects: Iterable[SceneObject], excluded: dict[tuple[str, str], str]) -> SceneGeometry:
    """Geometry model of a figure with things: the figure's pieces, outer ones, carried ones, the world's."""
    model = figure.model
    pieces = [pin.GeometryObject(piece) for piece in figure.geometry.geometryObjects]
    owners = [model.frames[piece.parentFrame].name for piece in pieces]
    pieces_of: dict[str, list[tuple[int, pin.SE3]]] = {}
    own = len(pieces)
    things = sorted(objects, key=lambda item: item.segment is None)
    for piece in figure.outer if things and things[-1].segment is None else ():
        pieces.append(pin.GeometryObject(piece))
        owners.append(model.frames[piece.parentFrame].name)
    body = len(pieces)
    made = {key: shape.pieces() for key, shape in {id(thing.shape): thing.shape for thing in things}.items()}
    for thing in things:
        base, joint, parent = thing.placement, 0, 0
        if thing.segment is not None:
            parent, joint, place = figure.place_of(thing.segment)
            base = place * base
        pieces_of[thing.name] = []
        for number, part in enumerate(made[id(thing.shape)]):
            name = f"{thing.name}:{number}"
            pieces_of[thing.name].append((len(pieces), part.placement))
            pieces.append(pin.GeometryObject(name, joint, parent, base * part.placement, part.geometry))
            owners.append(thing.name)

    joints = np.array([piece.parentJoint for piece in pieces], dtype=int)
    carried = {thing.name: thing for thing in things if thing.segment is not None}
    excluded.update(_leaning(figure, pieces, owners, carried))
    endless = [thing for thing in things if any(np.isinf(part.volume) for part in made[id(thing.shape)])]
    for one, other in combinations(endless, 2):
        if one.name in carried:
            excluded[one.name, other.name] = "two half-spaces, which have no end"
    met = _pairs_of_things(body, joints, owners, excluded)
    flesh = [k for k, piece in enumerate(pieces[:own]) if is_flesh(piece)]
    # what is worn lies on the flesh, and goes with it
    met = met[~(np.isin(met[:, 0], flesh) & (joints[met[:, 1]] > 0))]
    if body > own:
        outer, standing = (met[:, 0] >= own) & (met[:, 0] < body), joints[met[:, 1]] == 0
        met = met[(met[:, 0] >= body) | (outer == standing)]
    pairs = np.concatenate([pairs_of(figure.geometry), met])
    return SceneGeometry(model, geometry_model(pieces, pairs), tuple(owners), pieces_of, pairs)


def _pairs_of_things(
    body: int, joints: NDArray[np.int_], owners: list[str], excluded: Mapping[tuple[str, str], str]
) -> Indices:
    """(k, 2) pairs of a thing's piece, from `body` on, and an earlier one that another joint carries."""
    moving = int(np.flatnonzero(joints > 0).max(initial=-1)) + 1  # what stands in the world comes last, and meets these
    found = [np.zeros((0, 2), dtype=np.intp)]
    earlier = np.arange(moving)
    for joint in np.unique(joints[body:]).tolist():
        seconds = np.flatnonzero(joints == joint)
        seconds = seconds[seconds >= body]
        firsts = earlier[joints[:moving] != joint] if moving else earlier
        pairs = np.column_stack([np.tile(firsts, len(seconds)), np.repeat(seconds, len(firsts))])
        found.append(pairs[pairs[:, 0] < pairs[:, 1]])
    pairs = np.concatenate(found)
    if len(found) > 2:  # those of one joint are in order
        pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    if excluded:
        kept = [(owners[first], owners[second]) not in excluded for first, second in pairs.tolist()]
        pairs = pairs[np.array(kept, dtype=bool)] if len(pairs) else pairs
    return np.asarray(pairs, dtype=np.intp)


def _leaning(
    figure: Figure, pieces: list[pin.GeometryObject], owners: list[str], carried: Mapping[str, SceneObject]
) -> dict[tuple[str, str], str]:
    """Pairs (segment, carried thing) that are not tested, with the reason."""
    if not carried:
        return {}
    count = len(figure.geometry.geometryObjects)
    segments = [figure.model.frames[piece.parentFrame].name for piece in figure.geometry.geometryObjects]
    tested = {frozenset((segments[pair.first], segments[pair.second])) for pair in figure.geometry.collisionPairs}
    joint_of = dict(zip(segments, (piece.parentJoint for piece in pieces[:count]), strict=True))
    touching = _touching_at_rest(figure, pieces, owners, carried)
    found: dict[tuple[str, str], str] = {}
    for name, thing in carried.items():
        # A thing rests on things that were attached before it, whose pieces come first.
        found.update({(other, name): "said to rest on it" for other in thing.rests_on if other in carried})
        carrier = figure.model.frames[figure.frame_id(str(thing.segment))].parentJoint
        for segment in dict.fromkeys(segments):
            near = [other for other, joint in joint_of.items() if joint == carrier]
            if segment in thing.rests_on:
                found[segment, name] = "said to rest on it"
            elif (segment, name) in touching and not any(frozenset((segment, other)) in tested for other in near):
                found[segment, name] = f"a neighbour of {thing.segment} that it leans on in {figure.postures[0]!r}"
    return found


def _touching_at_rest(
    figure: Figure, pieces: list[pin.GeometryObject], owners: list[str], carried: Mapping[str, SceneObject]
) -> set[tuple[str, str]]:
    """Pairs (segment, carried thing) that touch in the figure's first posture."""
    held = [k for k, owner in enumerate(owners) if owner in carried]  # before what stands in the world
    joint, own = [piece.parentJoint for piece in pieces], range(len(figure.geometry.geometryObjects))
    pairs = [(k, thing) for thing in held for k in own if joint[k] != joint[thing]]
    probe = geometry_model(pieces[: held[-1] + 1], np.array(pairs, dtype=np.intp).reshape(-1, 2))
    rest = figure.posture(figure.postures[0])
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, rest)
    # m: a carried thing nearer than this to a segment in the first posture rests on it
    return {(owners[a], owners[b]) for a, b in Proximity(PairTable(figure.model, probe)).query(data, 1e-3).pair}

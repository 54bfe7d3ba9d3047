"""Hands that rest in a clip: on a box that is carried, on a rail, in another hand. They are held where they rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.fields import Checked, Names
from wholebody.figures.figure import Figure
from wholebody.motion.footholds import RestLimits, slow
from wholebody.motion.roles import figure_roles
from wholebody.motion.solids import least_distance
from wholebody.motion.thing_contacts import still_things
from wholebody.motion.windows import long_runs
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold

PALMS = ("left_palm", "right_palm")
NEAR = 0.005  # m: a hand that rests on a thing that stands, or in a hand, is no farther from it
INSIDE = 1e-3  # m: a hand that is deeper in what it rests on cannot be held there


@dataclass(frozen=True)
class RestingHands(Checked):
    """Hold every hand that rests where it rests: a constraint for `wb.avoid`.

    A hand rests on what it hardly moves along (0.15 m/s) and touches: a thing that stands (within 5 mm), another hand
    (5 mm), what another hand carries (30 mm) or what is said to rest on it by `rests_on`. A palm keeps its position
    there and may turn; a segment keeps its orientation too.

    Attributes:
        hands: palms or segments; None for the figure's palms, the hands of a robot by its structure, and last segments
            of others that a carried thing rests on. [] holds none.

    Raises:
        InputError: hands are no list of names.

    Examples:
        >>> freed = wb.avoid(clip, scene, constraints=[wb.motion.RestingHands([])])  # hands may leave what they hold
    """

    hands: Annotated[Sequence[str], Names("['left_palm']", 0)] | None = None

    def names(self, scene: Scene) -> tuple[str, ...]:
        """The hands of a scene's figures.

        Raises:
            UnknownNameError: a figure has no such frame.
        """
        checks.instance(scene, Scene, "RestingHands: scene", "make one with wb.Scene(figure)")
        figure = scene.figure
        if self.hands is not None:
            for name in self.hands:
                figure.frame_id(name)
            return tuple(self.hands)
        found = [f"{body}{palm}" for body in figure.bodies for palm in PALMS if f"{body}{palm}" in figure.frames]
        if not found and len(figure.bodies) == 1 and figure.root == "free":
            roles = figure_roles(figure)
            choices = ([f"{side}_hand", f"{side}_wrist"] for side in ("left", "right"))
            found = [name for choice in choices for name in [roles[role] for role in choice if role in roles][:1]]
        hands = {_joint(scene, name) for name in found}
        # of a figure with hands nothing else holds things: a pack rests on the neck
        armed = {joint for joints in figure.bodies.values() if hands & set(joints) for joint in joints}
        taken = set[int]()
        bearing = {piece.parentJoint for piece in figure.geometry.geometryObjects}
        for thing in scene.objects.values():
            ends = {_joint(scene, name): name for name in reversed(thing.rests_on) if name in figure.segments}
            for joint in sorted(ends.keys() - {0} - armed):  # the palm of a gripper before its fingers
                if (_after(figure, joint) & bearing) <= ends.keys() and not taken & set(figure.model.supports[joint]):
                    taken.add(joint)
                    found.append(ends[joint])
        return tuple(found)


class _Place(NamedTuple):
    """What a hand may rest on: in the axes of a frame, or of the world, from how near, and its pieces."""

    name: str
    base: str | None
    most: float  # metres
    told: bool  # whether it is said to rest on the hand
    pieces: list[int]  # their indices in the scene's geometry


def resting_hands(scene: Scene, q: Array, dt: float, hands: Sequence[str]) -> tuple[list[tuple[Hold, ...]], str]:
    """What holds the hands that rest in each of the frames q (n, nq), and which rest too deep to be held; or ""."""
    model, data = scene.model, scene.model.createData()
    held: list[list[Hold]] = [[] for _ in q]
    sunk, limits = list[str](), RestLimits(stayed=0.0)
    ids = {name: scene.frame_id(name) for name in hands}
    ids |= {thing.segment: scene.frame_id(thing.segment) for thing in scene.objects.values() if thing.segment}
    at: dict[str, list[pin.SE3]] = {name: [] for name in ids}
    joints = {hand: sorted(_after(scene.figure, _joint(scene, hand))) for hand in hands}
    spans = {hand: np.array([[np.inf] * 3, [-np.inf] * 3]) for hand in hands}  # of the origins of its joints
    for posture in q if hands else ():
        pin.framesForwardKinematics(model, data, posture)
        for name, number in ids.items():
            at[name].append(data.oMf[number].copy())
        for hand, span in spans.items():
            origins = np.array([data.oMi[joint].translation for joint in joints[hand]])
            span[:] = np.minimum(span[0], origins.min(axis=0)), np.maximum(span[1], origins.max(axis=0))
    for hand in hands:
        own, free = _pieces(scene, _joint(scene, hand)), np.ones(len(q), dtype=bool)
        slow_in: dict[str | None, Mask] = {}
        for place in _places(scene, hand, hands, spans[hand]) if len(q) else ():
            if place.base not in slow_in:
                bases = [pin.SE3.Identity()] * len(q) if place.base is None else at[place.base]
                there = [base.actInv(here) for base, here in zip(bases, at[hand], strict=True)]
                slow_in[place.base] = slow(np.array([one.translation for one in there]), dt, limits)
            gaps = np.full(len(q), np.inf)
            for frame in np.flatnonzero(free & slow_in[place.base]).tolist():
                gaps[frame] = 0.0 if place.told else _gap(scene, data, q[frame], own, place)
            least = max(1, round(limits.least / dt))
            rests = long_runs((gaps <= place.most) & (gaps >= -INSIDE), least)
            for frame in np.flatnonzero(rests).tolist():
                turns = not hand.endswith(PALMS)
                held[frame].append(Hold(hand, orientation=turns, relative_to=place.base))
            free &= ~rests
            # a hand that is deeper than 20 mm goes through it
            deep = long_runs((gaps <= place.most) & (gaps >= -0.02), least) & (gaps < -INSIDE)
            if deep.any():
                sunk.append(f"{hand} rests up to {-1e3 * gaps[deep].min():.0f} mm inside {place.name}")
    said = f"{', '.join(sunk)}, and is not held there" if sunk else ""
    return [tuple(each) for each in held], said


def _joint(scene: Scene, name: str) -> int:
    return int(scene.model.frames[scene.frame_id(name)].parentJoint)


def _after(figure: Figure, joint: int) -> set[int]:
    return {other for other in range(figure.model.njoints) if joint in figure.model.supports[other]}


def _pieces(scene: Scene, joint: int) -> list[int]:
    """Indices of the figure's pieces on a joint, or on one after it."""
    pieces, after, things = scene.geometry.geometryObjects, _after(scene.figure, joint), scene.objects
    owners = enumerate(scene.piece_owner)
    return [index for index, owner in owners if owner not in things and pieces[index].parentJoint in after]


def _places(scene: Scene, hand: str, hands: Sequence[str], span: Array) -> Iterator[_Place]:
    """What a hand may rest on, what carries it first: carried things, other hands after it in the list, and things.

    Its joints stay within a box `span` (2, 3).
    """
    figure, own = scene.figure, _after(scene.figure, _joint(scene, hand))
    others = [_after(figure, _joint(scene, name)) for name in hands if name != hand]
    joints = {name: _joint(scene, name) for name in figure.segments}
    for name, thing in scene.objects.items():
        if thing.segment is None or (carrier := _joint(scene, thing.segment)) in own:
            continue
        told = any(joints.get(segment) in own for segment in thing.rests_on)
        if told or any(carrier in other for other in others):
            # 30 mm, as carried boxes are modelled smaller than hands are apart
            yield _Place(name, thing.segment, 0.03, told, [index for index, _ in scene.built.pieces_of[name]])
    for other in hands[hands.index(hand) + 1 :]:
        if (joint := _joint(scene, other)) not in own:
            yield _Place(other, other, NEAR, False, _pieces(scene, joint))
    for name in _beside(scene, _pieces(scene, _joint(scene, hand)), span):
        yield _Place(name, None, NEAR, False, [index for index, _ in scene.built.pieces_of[name]])


def _beside(scene: Scene, own: Sequence[int], span: Array) -> list[str]:
    """Things that stand no farther than `NEAR` from where pieces may be whose joints stay within a box (2, 3)."""
    pieces, reach = scene.geometry.geometryObjects, scene.pair_table.reach
    out = max((float(np.linalg.norm(pieces[k].placement.translation)) + reach[k] for k in own), default=0.0)
    names = still_things(scene)
    places = [(name, index) for name in names for index, _ in scene.built.pieces_of[name]]
    index = np.array([index for _, index in places], dtype=np.intp)
    with scene.borrow() as workspace:
        centres = workspace.placements(scene.figure.neutral)[index, 3]
    away = np.maximum(np.maximum(span[0] - centres, centres - span[1]), 0.0)
    near = np.linalg.norm(away, axis=1) <= out + reach[index] + 2.0 * NEAR
    found = {name for (name, _), is_near in zip(places, near.tolist(), strict=True) if is_near}
    return [name for name in names if name in found]


def _gap(scene: Scene, data: pin.Data, q: Array, own: Sequence[int], place: _Place) -> float:
    """Signed distance of a hand's pieces to what it may rest on, metres; infinite where that is far."""
    pieces, reach = scene.geometry.geometryObjects, scene.pair_table.reach
    pin.forwardKinematics(scene.model, data, q)
    at = {index: data.oMi[pieces[index].parentJoint] * pieces[index].placement for index in (*own, *place.pieces)}
    best = np.inf
    for one in own:
        for other in place.pieces:
            between = float(np.linalg.norm(at[one].translation - at[other].translation))
            if between - reach[one] - reach[other] <= min(best, place.most):
                first, second = (pieces[one].geometry, at[one]), (pieces[other].geometry, at[other])
                best = min(best, least_distance([first], [second]))
    return best

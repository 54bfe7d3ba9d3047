"""What a problem of a person has by default: ranges of motion, balance, and its measures."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence, Set
from functools import partial
from typing import Any, TypeVar

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.balance import Balance, standing_points
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.bounds import Freeze
from wholebody.tasks.checks import is_a
from wholebody.tasks.distance import Effort, scaled
from wholebody.tasks.forces import LoadedBalance
from wholebody.tasks.frame import Hold, PlacementResidual
from wholebody.tasks.range_of_motion import RangeOfMotion, ReachCones
from wholebody.tasks.rhythm import Rhythm, girdles_of
from wholebody.tasks.sit import SeatCenterline, Sit
from wholebody.tasks.stand import Hang, LevelHead, Stance, Stand
from wholebody.tasks.touch import Lean

FEET = ("left_foot", "right_foot")

UPRIGHT: tuple[type[Balance | LoadedBalance | Stand], ...] = (Balance, LoadedBalance, Stand)
"""Terms that say how somebody stands."""

_effort, _rhythm = Effort(), Rhythm()
_Kept = TypeVar("_Kept", Stance, Hang, LevelHead)


def usual_measures(
    scene: Scene, start: Array, terms: Sequence[Constraint | Goal], bounds: Sequence[Bound],
    stands: Sequence[str], *, ranges: bool,
) -> tuple[Measure, ...]:  # fmt: skip
    """The measures of a problem that states none, for its resolved terms and persons of `standing`; once a scene."""
    if not scene.figure.ranges:  # no person; to look it up by its start takes longer
        return (_effort.resolve(scene, start),)
    seats = seated(scene, terms)
    feet = stances(scene, start, terms, seats)
    arms: tuple[str, ...] = ()
    heads = _heads(scene, terms)
    if ranges:
        stated = [inputs.body_of(scene, term.feet) for term in terms if is_a(term, UPRIGHT)]
        arms = free_arms(scene, start, terms, bounds, {*stated, *stands} - {None, *seats})
    make = partial(default_measures, scene, start, feet, seats, arms, heads, ranges=ranges)
    key = "measures", ranges, feet, (*seats.items(),), arms, heads, start.tobytes()
    found: tuple[Measure, ...] = scene.built.known(key, make)
    return found


def default_measures(
    scene: Scene,
    start: Array,
    stances: Sequence[tuple[tuple[str, ...], bool]],
    seats: Mapping[str, tuple[str, str]],
    hanging: tuple[str, ...],
    heads: tuple[str, ...],
    *,
    ranges: bool,
) -> tuple[Measure, ...]:
    """Resolved `Effort`, a person's `Rhythm`, `Stance` of sliding feet; kneelers count them from a kneeling posture.

    `hanging` are arms that hang, see `free_arms`, `heads` persons of whom a term places eyes or head, `seats` what
    persons sit on, see `seated`. Shares of knees and lumbar spine are of somebody who bends on both feet: on a seat
    the knees follow the pedals, and who leans back bends no lordosis. So is the fourfold weight of lumbar flexion: of
    who looks at something, a back that is seated bends before the trunk leans to a side. Without a term of the head it
    stays: one of 40 typists is not found without it. How far the seat is from the start is no effort either.
    """
    if not (ranges and scene.figure.ranges and inputs.once(scene, "girdles", lambda: girdles_of(scene.figure))):
        return (_effort.resolve(scene, start),)
    shanks = {side for sides, _ in stances for side in sides if side.endswith("_shank")}
    rest = _kneeling(scene, start, shanks) if shanks else start
    rest = _sitting(scene, rest, seats) if seats else rest
    pairs = [(feet, both) for feet, both in stances if len(feet) == 2 and shanks.isdisjoint(feet)]
    effort, rhythm = _effort.resolve(scene, rest), _rhythm.resolve(scene, rest)
    if seats:
        who = tuple(seats)
        own = inputs.once(scene, ("places", who), partial(_places, scene, who))
        looking = _places(scene, [body for body in who if body in heads])
        lumbar = [place for spine in rhythm.lumbar for place in spine.idx_v if place in looking]
        effort = scaled(effort, {**dict.fromkeys(_ways(scene, who), 0.0), **dict.fromkeys(lumbar, 0.25)})
        rhythm = rhythm.of_arms(own)

    def kept(kind: type[_Kept], names: Any) -> _Kept:  # whatever the start is, it is the same
        return inputs.once(scene, (kind, names), lambda: kind(names).resolve(scene, rest))

    free = [kept(Hang, hanging)] if hanging else []
    feet = (kept(Stance, pair) if both else kept(Stance, pair).of_feet() for pair, both in pairs)
    alone = [(on, pelvis) for on, pelvis in seats.values() if sum(on == other for other, _ in seats.values()) == 1]
    middles = (SeatCenterline(on, pelvis=pelvis).resolve(scene, start) for on, pelvis in alone)
    return (effort, rhythm, *feet, *middles, *free, *(kept(LevelHead, f"{body}gaze") for body in heads))


def _heads(scene: Scene, terms: Sequence[Constraint | Goal]) -> tuple[str, ...]:
    """What the names of persons begin with of whom a term places eyes or head."""
    placed, figure = {joint for term in terms for joint in _placed(term)}, scene.figure
    eyes = {body: f"{body}gaze" for body in figure.bodies}
    known = [body for body, eye in eyes.items() if eye in figure.frames]
    return tuple(body for body in known if inputs.find_place(scene, eyes[body], "").joint in placed)


def _places(scene: Scene, bodies: Sequence[str]) -> frozenset[int]:
    """First places in the tangent of the joints of persons."""
    return frozenset(int(scene.model.joints[joint].idx_v) for body in bodies for joint in scene.figure.bodies[body])


def _ways(scene: Scene, bodies: Sequence[str]) -> list[int]:
    """Places in the tangent of the translation of the free roots of persons."""
    roots = [scene.figure.roots[root] for body in bodies if (root := f"{body}root") in scene.figure.roots]
    firsts = [int(scene.model.joints[root].idx_v) for root in roots]
    return [first + axis for first in firsts for axis in range(3)]


def seated(scene: Scene, terms: Sequence[Constraint | Goal]) -> dict[str, tuple[str, str]]:
    """The seat and the pelvis of the persons who sit on something, by what their names begin with."""
    return {body: (term.on, term.pelvis) for term in terms if is_a(term, (Sit,))
            if (body := inputs.body_of(scene, [term.frame])) is not None}  # fmt: skip


def free_arms(
    scene: Scene, start: Array, terms: Sequence[Constraint | Goal], bounds: Sequence[Bound], up: Set[str | None]
) -> tuple[str, ...]:
    """The upper arms that no term moves, of the persons `up` who stand or kneel."""
    if not up:
        return ()
    bearing, moved = set[int](), set[int]()
    for bound in bounds:
        moved.update(scene.figure.dofs(getattr(bound, "joints", ())).tolist())
    for term in terms:
        if borne := _bearing(scene, term):
            bearing.update(borne)
        else:
            with scene.figure.posed(start) as state:
                moved.update(np.flatnonzero(state.dense_jacobian(term.jacobian(state)).any(axis=0)).tolist())
    key = "free arms", frozenset(up), frozenset(bearing), frozenset(moved)
    return inputs.once(scene, key, partial(_free_arms, scene, up, bearing, moved))


def _free_arms(scene: Scene, up: Set[str | None], bearing: Set[int], moved: Set[int]) -> tuple[str, ...]:
    """The upper arms of persons without the joints that carry some joints, and without some places in the tangent."""
    figure, joints = scene.figure, [scene.model.joints[one] for joint in bearing for one in scene.model.supports[joint]]
    moved = set(moved).union(*(range(one.idx_v, one.idx_v + one.nv) for one in joints))
    groups = [f"{body}{side}" for body in figure.bodies if body in up for side in ("left", "right")]
    known = (arm for arm in groups if f"{arm}_arm" in figure.groups)
    return tuple(f"{arm}_upper_arm" for arm in known if moved.isdisjoint(figure.dofs(f"{arm}_arm").tolist()))


def _bearing(scene: Scene, term: Constraint | Goal) -> tuple[int, ...]:
    """Joints that a resolved term moves; of a balance, which all masses move, what bears it. Empty: not known."""
    if is_a(term, UPRIGHT):
        loads = term.loads.places if isinstance(term, LoadedBalance) else ()
        return (*(inputs.find_place(scene, foot, "").joint for foot in term.feet), *(one.joint for one in loads))
    return _placed(term)


def _placed(term: Constraint | Goal) -> tuple[int, ...]:
    """Joints of the frames between which a term places one; empty for others."""
    own = vars(term)
    residual = own.get("residual")  # that of a class of one's own may be anything
    known = own.get("place"), own.get("base")
    if isinstance(residual, PlacementResidual):
        known = residual.place, residual.base
    return tuple([one.joint for one in known if type(one) is inputs.Place])


def seen(goal: Goal) -> Hashable:
    """What the defaults of a problem depend on of a resolved goal: all but its target where it places frames."""
    placed = _placed(goal)
    return (type(goal), placed) if placed else goal


def alike(goals: Sequence[Goal], before: Sequence[Goal]) -> bool:
    """Whether resolved goals differ in their targets alone, as far as the defaults of a problem depend on them."""
    return len(goals) == len(before) and all(
        new is old or seen(new) == seen(old) for new, old in zip(goals, before, strict=True)
    )


def stances(
    scene: Scene, start: Array, terms: Sequence[Constraint | Goal], seats: Mapping[str, tuple[str, str]]
) -> tuple[tuple[tuple[str, ...], bool], ...]:
    """The feet of each person that stands on them or kneels, and whether one `Stand` has them all and balances.

    Those of somebody with one foot on one thing and one on another are together, as both belong to a stance. Who sits
    (see `seated`) has them where pedals are.
    """

    def kneels(stand: Stand) -> bool:
        with scene.figure.posed(start) as state:
            at_start, shanks = stand.value(state), [inputs.find_place(scene, knee, "") for knee in stand.knees]
            upright = [abs(state.frame(shank.frame).rotation[2, 2]) for shank in shanks]
        missed = np.maximum(np.maximum(stand.lower - at_start, at_start - stand.upper), 0.0).max()
        # The ankles of who stands are as near to the ground as knees.
        # m, rad: who misses a `Stand` by less at the start kneels there
        return bool(missed <= 0.05) and max(upright) < 0.5

    stand = [one for one in terms if is_a(one, (Stand,))]
    found = [
        (tuple(one.feet), one.balance or bool(one.knees))
        for one in stand
        if not (one.knees and kneels(one))
        and (one.balance or one.knees or inputs.body_of(scene, one.feet) not in seats)
    ]
    single = {one.feet[0]: inputs.body_of(scene, one.feet) for one in stand if len(one.feet) == 1 and not one.knees}
    pairs = [tuple(sorted(foot for foot in single if single[foot] == single.get(feet[0], ""))) for feet, _ in found]
    both = [(pair, False) if len(pair) == 2 else one for one, pair in zip(found, pairs, strict=True)]
    return tuple(dict.fromkeys(both))


def _kneeling(scene: Scene, start: Array, shanks: Set[str]) -> Array:
    """The start (nq,) with the legs and the height of one who kneels on some shanks, upright and facing as there."""
    figure, q = scene.figure, start.copy()
    for body in {shank.removesuffix("shank").removesuffix("left_").removesuffix("right_") for shank in shanks}:
        kneeling, sitting = (figure.posture(f"{body}{name}") for name in ("kneeling", "sitting"))
        for side in ("left", "right"):
            usual = kneeling if f"{body}{side}_shank" in shanks else sitting
            places = [figure.model.joints[figure.joint_id(one)].idx_q for one in figure.groups[f"{body}{side}_leg"]]
            q[places] = usual[places]
        root = int(figure.model.joints[figure.roots[f"{body}root"]].idx_q) if f"{body}root" in figure.roots else None
        if root is not None:
            x, y, z, w = start[root + 3 : root + 7]
            heading = 0.5 * np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            q[root + 2 : root + 7] = kneeling[root + 2], 0.0, 0.0, np.sin(heading), np.cos(heading)
    return np.asarray(q)


def _sitting(scene: Scene, start: Array, bodies: Iterable[str]) -> Array:
    """The start with the legs of who sits as in the posture "sitting" where their thighs are upright."""
    # Counted from standing legs, people would sit on the edge or a corner of the seat, with the legs far ahead.
    figure, q = scene.figure, start.copy()
    for body in bodies:
        legs = [f"{body}{side}" for side in ("left", "right") if f"{body}{side}_leg" in figure.groups]
        for leg in (leg for leg in legs if abs(figure.placement(start, f"{leg}_thigh").rotation[2, 2]) > 0.5):
            places = [figure.model.joints[figure.joint_id(one)].idx_q for one in figure.groups[f"{leg}_leg"]]
            q[places] = figure.posture(f"{body}sitting")[places]
    return np.asarray(q)


def usual_constraints(
    scene: Scene, start: Array, stated: Sequence[Constraint], stands: Sequence[str], *, ranges: bool,
    balance: bool | None,
) -> tuple[tuple[Constraint, ...], str]:  # fmt: skip
    """The constraints added to resolved ones, once a scene; `ranges` and `balance` as a problem takes them."""
    if not (scene.figure.ranges or balance):
        return (), ""  # no person
    known = frozenset(map(type, stated))
    steady = stands if balance is None else ()
    steady = balancing(scene, stated) if (required := balance is True) else steady
    if not (steady or (ranges and scene.figure.ranges)):
        return (), ""
    moves = bool(steady) * scene.built.moves  # shoes carry too
    key = "constraints", ranges, steady, required, known, moves, start.tobytes() if steady else b""
    make = partial(default_constraints, scene, start, known, ranges=ranges, standing=steady, required=required)
    found: tuple[tuple[Constraint, ...], str] = scene.built.known(key, make)
    return found


def default_constraints(
    scene: Scene, start: Array, known: Set[type], *, ranges: bool, standing: Sequence[str], required: bool
) -> tuple[tuple[Constraint, ...], str]:
    """What is added to stated constraints, whose classes replace it; `standing`: names of figures that keep balance."""
    # who stands on a line at the start keeps no balance that is measured by an area, unless it is required
    figure = scene.figure
    found: list[Constraint] = []
    if ranges and figure.ranges and RangeOfMotion not in known:
        found.append(inputs.once(scene, RangeOfMotion, lambda: RangeOfMotion().resolve(scene, start)))
    if ranges and figure.ranges and figure.cones and ReachCones not in known:
        found.append(inputs.once(scene, ReachCones, lambda: ReachCones().resolve(scene, start)))
    left_out = ""
    for body in standing:
        feet = tuple(body + foot for foot in FEET)
        try:
            found.append(Balance(feet).on_points(standing_points(scene, start, feet), scene, steady=True))
        except InputError as error:
            if required:
                raise
            why = str(error).removeprefix("Balance: ").partition(";")[0]
            left_out = f"the default Balance is left out: {body}{': ' if body else ''}{why}"
    return tuple(found), left_out


def standing(
    scene: Scene, start: Array, terms: Sequence[Constraint | Goal], bounds: Sequence[Bound]
) -> tuple[str, ...]:
    """The persons who stand, by what the names of each begin with; see `_stands`."""
    figure = scene.figure
    bodies = [body for body in balancing(scene, terms) if f"{body}root" in figure.roots] if figure.ranges else []
    return tuple(body for body in bodies if _stands(scene, start, terms, bounds, body))


def balancing(scene: Scene, terms: Sequence[Constraint | Goal]) -> tuple[str, ...]:
    """The figures with feet, by what their names begin with, of which no term says how they stand."""
    figure = scene.figure
    stated = [inputs.body_of(scene, term.feet) for term in terms if is_a(term, UPRIGHT)]
    return tuple(
        body
        for body in figure.bodies
        if body not in stated and (body == "" or {body + foot for foot in FEET} <= set(figure.segments))
    )


def _stands(scene: Scene, start: Array, terms: Sequence[Constraint | Goal], bounds: Sequence[Bound], body: str) -> bool:
    """Whether a person stands: both feet are held where they are at the start, and nothing else carries it."""
    figure = scene.figure
    held = [term for term in terms if is_a(term, (Hold,)) and not term.residual.base.frame]
    feet_names = [body + foot for foot in FEET]
    if not held or not set(feet_names) <= set(figure.segments):
        return False
    root = f"{body}root"
    if any(isinstance(bound, Freeze) and root in figure.joint_names(bound.joints) for bound in bounds):
        return False
    if any((is_a(term, (Sit,)) or is_a(term, (Lean,))) and str(term.frame).startswith(body) for term in terms):
        return False
    feet = {figure.place_of(foot).joint for foot in feet_names}
    mine = figure.bodies[body]
    holds = [term for term in held if not body or term.residual.place.joint in mine]
    if {term.residual.place.joint for term in holds} != feet:
        return False
    placed = [term for term in holds if term.at is not None]  # the others are where they are at the start
    if not placed:
        return True
    with scene.figure.posed(start) as state:
        # m, rad: a foot held this near to its place at the start stands where the support polygon is computed.
        return all(np.abs(term.value(state)).max() <= 1e-3 for term in placed)

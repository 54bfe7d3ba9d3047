"""What a recorded person stands on: the floor, its levels, and when and where feet, hands and knees rest."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.base.files import checked_target
from wholebody.motion.footholds import SPAN, Point, RestLimits, above_ground, lowest, resting, speeds
from wholebody.motion.roles import ROLES, skeleton_roles
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.motion.structure import size_of
from wholebody.motion.surfaces import Surface, surface_of
from wholebody.motion.windows import Window, long_runs, runs
from wholebody.scene.scene import Scene

FEET = ("ankle", "toe")
APART, SPREAD = 0.04, 0.06  # m: between two levels of a floor; within one level, by errors of a recording
HANGS = 0.15  # m: what seems to rest and has all surfaces so far below it hangs, as legs do of who lies on an edge
ABOVE = -0.05, 0.2  # m: how high an ankle or toe may be recorded above the surface on which its foot stands
HEIGHT, MOST_FRAMES = Range(-1e6, 1e6, "m"), 10**9


class Foothold(NamedTuple):
    """A point that rests at one place."""

    role: str  # part of the body, such as "left_toe"
    # first and end: frames, without the last
    first: int
    end: int
    place: Array  # (3,) mean place of the joint, metres, in the recording's world
    height: float  # of the ground there above the lowest level, metres


def _by_role(given: object, what: str) -> Mapping[str, Any]:
    found = checks.instance(given, Mapping, what, "give role to value, as wb.motion.ground(motion) has")
    for role in found:
        checks.known(role, ROLES, "role", what)
    return found


def _rests(given: object, what: str) -> Mapping[str, Mask]:
    """True or false for each frame by role; zeros and ones too."""
    found = {}
    for role, mask in _by_role(given, what).items():
        if isinstance(mask, np.ndarray) and mask.ndim == 1 and mask.dtype == bool:
            found[role] = mask
            continue
        entries = checks.listed(mask, f"{what} of {role}", "True or False for each frame")
        if not all(isinstance(one, (bool, np.bool_, int, float, np.number)) and one in (0, 1) for one in entries):
            raise InputError(f"{what} of {role} are {checks.shown(mask)}; give True or False for each frame")
        found[role] = np.array(entries, dtype=bool)
    if len({len(mask) for mask in found.values()}) > 1:
        lengths = ", ".join(f"{role} {len(mask)}" for role, mask in found.items())
        raise InputError(f"{what} have different numbers of frames ({lengths}); give one for each frame")
    return found


def _lowest(given: object, what: str) -> Mapping[str, float]:
    return {role: HEIGHT(height, f"{what} of {role}") for role, height in _by_role(given, what).items()}


def _levels(given: object, what: str) -> tuple[float, ...]:
    return tuple(HEIGHT(one, f"{what}: a level") for one in checks.listed(given, what, "(0.0, 0.15)"))


def _footholds(given: object, what: str) -> tuple[Foothold, ...]:
    found = []
    for number, one in enumerate(checks.listed(given, what, "those of wb.motion.ground(motion)")):
        where = f"{what}[{number}]"
        checks.instance(one, Foothold, where, "give one of wb.motion.ground(motion), or one._replace(height=0.1)")
        checks.known(one.role, ROLES, "role", where)
        first = checks.whole(one.first, f"{where}: first", 0, MOST_FRAMES - 1)
        end = checks.whole(one.end, f"{where}: end", first + 1, MOST_FRAMES)
        place = checks.numbers(one.place, (3,), f"{where}: place")
        found.append(Foothold(one.role, first, end, place, HEIGHT(one.height, f"{where}: height")))
    return tuple(found)


@dataclass(frozen=True, eq=False, repr=False)
class Ground(Checked):
    """The ground of a recording. `dataclasses.replace` makes a changed one.

    `wb.retarget` uses `footholds` (role, frames and height), `rests` and `lowest`; the others describe what was found.

    Attributes:
        footholds: in the order of time.
        rests: role to (n,) when it rests.
        lowest: role to the height at which its joint rests on the lowest level, in the recording's world, metres.
        levels: heights of the floor's levels above the lowest, metres; of uneven ground none beside 0. In a scene those
            of surfaces, as `height` of footholds.
        tilt: degrees by which the lowest level slopes in the recording; drift of less than 2 degrees is usual.
        uneven: whether heights do not gather in levels; each foothold then has its own.
        dt: seconds from frame to frame.

    Raises:
        InputError: a value of the wrong kind or range.
        UnknownNameError: a role that no joint has.

    Examples:
        >>> flat = wb.motion.ground(skeleton).tilt
    """

    footholds: Annotated[tuple[Foothold, ...], _footholds]
    rests: Annotated[Mapping[str, Mask], _rests]
    lowest: Annotated[Mapping[str, float], _lowest]
    levels: Annotated[tuple[float, ...], _levels]
    tilt: Annotated[float, Range(0.0, 90.0, "degrees")]
    uneven: bool
    dt: Annotated[float, checks.time_step]

    def below(self, frames: int) -> Array:
        """(frames,) height of the ground under the body, between footholds and over time, metres."""
        frames = checks.whole(frames, "below: frames", 0, MOST_FRAMES)
        feet = [each for each in self.footholds if each.role in self.lowest]
        total, count = np.zeros(frames), np.zeros(frames)
        for each in feet:
            total[each.first : each.end] += each.height
            count[each.first : each.end] += 1.0
        known = np.flatnonzero(count)
        if not len(known):
            return total
        return np.asarray(np.interp(np.arange(frames), known, total[known] / count[known]))

    def __str__(self) -> str:
        shares = ", ".join(f"{role} {mask.mean():.0%}" for role, mask in self.rests.items() if mask.any())
        return f"ground: {self._kind()}, tilt {self.tilt:.1f} degrees; rests: {shares or 'none'}"

    def __repr__(self) -> str:
        return f"Ground({self._kind()}, {len(self.footholds)} footholds)"

    def _kind(self) -> str:
        return "uneven" if self.uneven else f"levels at {', '.join(f'{level:.2f}' for level in self.levels)} m"

    def chart(self, path: str | os.PathLike[str]) -> str:
        """Draw footholds seen from above and their heights over time into a picture; returns its path."""
        from matplotlib.figure import Figure as Drawing

        target = checked_target(path, "chart: path", "a chart", (".png", ".svg", ".pdf"))
        drawing = Drawing(figsize=(9, 6), layout="constrained")
        seen, timed = drawing.subplots(2, 1)
        for level in self.levels:
            timed.axhline(level, color="0.8", linewidth=0.8, zorder=0)
        shown = [role for role in self.rests if any(each.role == role for each in self.footholds)]
        for number, role in enumerate(shown):
            mine = [each for each in self.footholds if each.role == role]
            color, places = f"C{number}", np.array([each.place for each in mine])
            seen.scatter(places[:, 0], places[:, 1], color=color, label=role.replace("_", " "), s=20)
            for each in mine:  # those at one height at one time are drawn one on the other, each narrower
                times = self.dt * np.array([each.first, each.end])
                timed.plot(times, 2 * [each.height], color=color, linewidth=1.2 * (len(shown) - number))
        heights = [each.height for each in self.footholds] or [0.0]
        seen.set(xlabel="x [m]", ylabel="y [m]", title=f"footholds from above ({self._kind()})")
        seen.set_aspect("equal", adjustable="datalim")
        timed.set(
            xlabel="time [s]", ylabel="height of the ground [m]", title="when each part rests, and at what height"
        )
        timed.set_ylim(min(heights) - 0.1, max(heights) + 0.1)
        timed.set_xlim(0.0, self.dt * max([1, *(each.end for each in self.footholds)]))
        if self.footholds:
            drawing.legend(loc="outside right upper", fontsize="small")
        drawing.savefig(target)
        return os.fspath(target)


NOTHING = Ground((), {}, {}, (0.0,), 0.0, False, 1.0)  # the ground of what never rests


def ground(
    motion: SkeletonMotion,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    scene: Scene | None = None,
) -> Ground:
    """Find what a recorded person stands on.

    Args:
        motion: the skeleton.
        names: as for `wb.retarget`.
        scene: what stood there in the recording. Then what hangs over an edge does not rest, and heights are those of
            surfaces, from z = 0 of the scene on.

    Returns:
        Without feet that rest, a ground without footholds.

    Raises:
        UnknownNameError: a name that does not exist.

    Examples:
        >>> ground = wb.motion.ground(skeleton)
    """
    if scene is None:
        return ground_on(motion, names, None)
    return ground_on(
        motion, names, surface_of(checks.instance(scene, Scene, "ground: scene", "make one with wb.Scene(figure)"))
    )


def ground_on(
    motion: SkeletonMotion,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None,
    surface: Surface | None,
) -> Ground:
    """The same on surfaces of a scene, or without one."""
    motion = checked_motion(motion, "ground: motion")
    named = skeleton_roles(motion, names)
    size, joints = size_of(motion, named), {role: motion.names.index(name) for role, name in named.items()}
    if size == 1.0:
        return _ground(motion, joints, surface)
    # speeds and heights of rests are those of people
    found = _ground(motion.resized(1.0 / size), joints, surface and partial(_below, surface, size))
    holds = [with_values(each, place=size * each.place, height=size * each.height) for each in found.footholds]
    lows = {role: size * low for role, low in found.lowest.items()}
    return replace(found, footholds=tuple(holds), lowest=lows, levels=tuple(size * level for level in found.levels))


def _below(surface: Surface, size: float, place: Array, frame: int) -> float | None:
    return (height := surface(size * place, frame)) and height / size


def _ground(motion: SkeletonMotion, joints: Mapping[str, int], surface: Surface | None) -> Ground:
    feet = [f"{side}_{part}" for side in ("left", "right") for part in FEET if f"{side}_{part}" in joints]
    limits, points = RestLimits(), {role: Point(role.split("_")[0], FEET.index(role.split("_")[1])) for role in feet}
    places = motion.positions[:, [joints[role] for role in feet]]
    # what kneels or lies with its feet up does not stand on them: they are above their knees
    knees = [joints.get(f"{role.split('_')[0]}_knee", joints[role]) for role in feet]
    allowed = places[:, :, 2] <= motion.positions[:, knees, 2]
    ends = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "shoulder")]
    trunk = [joints[role] for role in ends if role in joints]
    centre = motion.positions[:, trunk, :2].mean(axis=1) if len(trunk) == 4 else None
    marks = resting(places, motion.dt, limits, list(points.values()), allowed, centre)
    rests = {role: marks[:, k] for k, role in enumerate(feet)}
    raw = [
        Foothold(role, *run, motion.positions[run.first : run.end, joints[role]].mean(axis=0), 0.0)
        for role in feet
        for run in runs(rests[role])
    ]
    lows = np.array([lowest(motion.positions[each.first : each.end, joints[each.role], 2]) for each in raw])
    rise = above_ground([points[each.role] for each in raw], [Window(each.first, each.end) for each in raw], lows)
    heights = lows - [rise[points[each.role].kind] for each in raw]
    above = {role: rise[point.kind] for role, point in points.items() if point.kind in rise}
    settled, levels, uneven = _levelled(heights, np.array([each.end - each.first for each in raw]))
    low = float(settled.min()) if len(settled) else 0.0
    settled, above = settled - low, {role: height + low for role, height in above.items()}
    holds = [with_values(each, height=float(height)) for each, height in zip(raw, settled, strict=True)]
    tilt = _tilt(np.array([each.place[:2] for each in raw]).reshape(-1, 2), heights, settled)
    if surface is not None and holds:
        holds, shift = _on_surfaces(motion, joints, holds, above, surface)
        above = {role: height + shift for role, height in above.items()}
        stood = sorted({round(each.height, 3) for each in holds})  # mm
        levels = (0.0,) if uneven or not stood else tuple(stood)
        _clear(rests, holds)
    if holds:
        for role in (f"{side}_{part}" for side in ("left", "right") for part in ("hand", "wrist", "knee")):
            if role in joints and not (role.endswith("wrist") and role.replace("wrist", "hand") in joints):
                rests[role], more = _others(motion, joints[role], role, holds, above)
                if surface is not None:
                    more = [each for each in more if not _hangs(each, min(above.values()), surface)]
                    _clear(rests, [*holds, *more])
                holds = [*holds, *more]
    return Ground(tuple(sorted(holds, key=lambda each: each.first)), rests, above, levels, tilt, uneven, motion.dt)


def _clear(rests: dict[str, Mask], holds: list[Foothold]) -> None:
    """Take from the frames in which roles rest those without a foothold."""
    for role, mask in rests.items():
        kept = np.zeros_like(mask)
        for each in holds:
            kept[each.first : each.end] |= each.role == role
        rests[role] = mask & kept


def _hangs(each: Foothold, floor: float, surface: Surface) -> bool:
    """Whether a point is far above what is below it; `floor` is z = 0 of the scene in the recording's world."""
    below = surface(each.place, _middle(each))
    return below is not None and each.place[2] - floor - below > HANGS


def _middle(each: Foothold) -> int:
    return (each.first + each.end) // 2


def _on_surfaces(
    motion: SkeletonMotion,
    joints: Mapping[str, int],
    holds: list[Foothold],
    above: Mapping[str, float],
    surface: Surface,
) -> tuple[list[Foothold], float]:
    """Footholds of feet with the heights of surfaces, without those that hang; how much they were too high, metres."""
    known = [_under(motion, joints, each, surface) for each in holds]
    counts = np.array([each.end - each.first for each in holds])
    some = [k for k, heights in enumerate(known) if heights]
    if not some:
        return holds, 0.0
    # where they stand, they are as much too high as most are, by errors of the recording
    off = np.array([min((holds[k].height - height for height in known[k]), key=abs) for k in some])
    inside = max((np.abs(off - one) <= 0.5 * SPREAD for one in off), key=lambda mask: counts[some][mask].sum())
    shift = float(np.median(np.repeat(off[inside], counts[some][inside])))
    if not all(ABOVE[0] <= height + shift <= ABOVE[1] for height in above.values()):
        shift = 0.0  # the recording's floor is elsewhere
    found = []
    for each, heights in zip(holds, known, strict=True):
        high = each.height - shift
        here = min(heights, key=lambda height: abs(high - height), default=high)
        if high - here <= HANGS:
            found.append(with_values(each, height=here if here - high <= HANGS else high))
    return found, shift


def _under(motion: SkeletonMotion, joints: Mapping[str, int], each: Foothold, surface: Surface) -> list[float]:
    """Heights of surfaces below the sole of a foot that rests; of those in which it is recorded none."""
    ends = [f"{each.role.split('_')[0]}_{part}" for part in FEET]
    ways = [motion.positions[each.first : each.end, joints[role]].mean(axis=0) for role in ends if role in joints]
    # a sole is looked at from its heel on, at shares of the way from ankle to toe
    places = [ways[0] + share * (ways[-1] - ways[0]) for share in (-0.4, 0.0, 0.5, 1.0, 1.4)] if len(ways) > 1 else ways
    top = max(place[2] for place in ways)
    found = [surface(np.array([*place[:2], top]), _middle(each)) for place in places]
    return [height for height in found if height is not None]


def _levelled(heights: Array, counts: Indices) -> tuple[Array, tuple[float, ...], bool]:
    """Heights (k,) of the ground at footholds, brought to levels where they gather in some; the levels."""
    if not len(heights):
        return heights, (0.0,), False
    order = np.argsort(heights, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(heights[order]) > APART) + 1)
    settled, levels, uneven = heights.copy(), list[float](), False
    for group in groups:
        # of a group that is wider than a level: what most rests gather in, as on a box from whose edge a foot slips
        inside = [(heights[group] >= low) & (heights[group] <= low + SPREAD) for low in heights[group]]
        densest = max(inside, key=lambda mask: counts[group[mask]].sum())
        gathered = group[densest]
        if counts[gathered].sum() < 0.8 * counts[group].sum():  # of the time of rests at nearly one height
            uneven = True
            continue
        settled[gathered] = np.median(np.repeat(heights[gathered], counts[gathered]))
        levels.append(float(settled[gathered][0]))
    if uneven:
        return settled, (0.0,), True
    settled = np.maximum(settled, levels[0])  # nothing rests below the floor: a sole rolls there, or errors of markers
    return settled, tuple(level - levels[0] for level in levels), False


def _tilt(places: Array, heights: Array, settled: Array) -> float:
    """Degrees of the slope of what is on the lowest level."""
    low = settled <= 1e-9
    if low.sum() < 3 or np.ptp(places[low], axis=0).max() < 0.5:
        return 0.0
    columns = np.column_stack([places[low] - places[low].mean(axis=0), np.ones(low.sum())])
    slope = np.linalg.lstsq(columns, heights[low], rcond=0.05)[0][:2]
    return float(np.degrees(np.arctan(np.linalg.norm(slope))))


def _others(
    motion: SkeletonMotion, joint: int, role: str, holds: list[Foothold], above: Mapping[str, float]
) -> tuple[Mask, list[Foothold]]:
    at, limits = motion.positions[:, joint], RestLimits()
    feet = [each for each in holds if each.role in above]
    middles, floors = np.array([each.place[:2] for each in feet]), np.array([each.height for each in feet])
    nearest = np.linalg.norm(at[:, None, :2] - middles[None], axis=2).argmin(axis=1)
    floor = floors[nearest] + min(above.values())
    # m: highest place of a knee's or wrist's joint above the ground on which it rests
    low = (speeds(at, motion.dt, SPAN) <= limits.speed) & (at[:, 2] <= floor + 0.12)
    mask = long_runs(low, max(1, round(limits.least / motion.dt)))
    return mask, [
        Foothold(role, *run, at[run.first : run.end].mean(axis=0), float(floors[nearest[run.first]]))
        for run in runs(mask)
    ]

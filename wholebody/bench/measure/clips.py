"""Recordings retargeted by wholebody and by mink, judged alike.

mink follows frame by frame as General Motion Retargeting does (Araujo and others, Retargeting Matters, 2025;
`motion_retarget.py` and `bvh_to_g1.json` of github.com/YanjieZe/GMR): targets of frames, two stages of weights, no
contact; its weights, damping and the end of the iteration. There each skeleton and robot has a table of rotations and
lengths; here both come from the rest postures, as for `wb.retarget`.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array, Mask, with_values
from wholebody.base.errors import InputError
from wholebody.bench.rows import Figure, Row
from wholebody.bench.suite.adapters.mink import Order
from wholebody.bench.suite.adapters.urdf import mjcf, own_frame
from wholebody.motion.checking import check
from wholebody.motion.clip import Clip
from wholebody.motion.retarget_targets import rest_axes, standing_places
from wholebody.motion.retargeting import errors_of
from wholebody.motion.roles import ROWS, Roles, matched
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import point_paths
from wholebody.motion.standing_ground import ground_on
from wholebody.motion.structure import LIMBS, upright
from wholebody.motion.surfaces import surface_of
from wholebody.motion.thing_contacts import NEAR, Things

TOOLS = ("wholebody", "mink, GMR's weights")
# m: as far from a moving thing are joints of parts that go with it
CARRIED = {"ankle": 0.15, "toe": 0.1, **NEAR}


def compare(folder: Path, figures: Sequence[wb.Figure], frames: int) -> Iterator[Row]:
    """A row for each recording (BVH) in a folder, figure and installed tool, of `frames`.

    Raises:
        InputError: a folder without recordings.
    """
    tools = TOOLS if find_spec("mink") else TOOLS[:1]
    files = sorted(folder.rglob("*.bvh"))
    if not files:
        raise InputError(f"{folder} is no folder with .bvh files; give one of recordings")
    for path in files:
        motion = _thinned(wb.motion.read_skeleton(path))
        motion = motion.part(0, min(frames, len(motion)))
        for figure in figures:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # warnings about a recording are the same for both tools
                roles = matched(motion, figure, None)
                for tool in tools:
                    began = time.process_time()
                    clip = _followed(tool, motion, figure, roles)
                    rate = len(motion) / (time.process_time() - began)
                    yield Row(f"{path.stem}, {figure.name}", tool, judged(motion, clip, roles) | {"frames a s": rate})


def _thinned(motion: SkeletonMotion) -> SkeletonMotion:
    every = max(1, round(1.0 / (motion.dt * 60.0)))  # recordings at more than twice 60 Hz are subsampled
    parts = motion.rotations[::every], motion.positions[::every]
    return SkeletonMotion(motion.names, motion.parents, motion.offsets, *parts, motion.dt * every, motion.name)


def _followed(tool: str, motion: SkeletonMotion, figure: wb.Figure, roles: Roles) -> Clip:
    if tool == TOOLS[0]:
        return wb.retarget(motion, figure)
    follower = MinkRetargeting(motion, figure, roles)
    return Clip(figure, np.array([follower.frame(k) for k in range(len(motion))]), motion.dt, motion.name)


def judged(
    motion: SkeletonMotion,
    clip: Clip,
    roles: Roles,
    scene: wb.Scene | None = None,
    things: Mapping[str, Array] | None = None,
) -> dict[str, Figure]:
    """Figures of a clip that follows a recording among a scene's things; `things` (n, 7) has where they were in it.

    Without a scene it is a floor.
    """
    world = wb.Scene(clip.figure).add(wb.HalfSpace(), name="floor") if scene is None else scene
    found, recorded = check(clip, world), things or {}
    known = ground_on(motion, {"skeleton": roles.joints}, None if scene is None else surface_of(scene, recorded))
    errors = np.degrees(np.concatenate(list(errors_of(motion, clip, roles, known).values())))
    places = roles.places(clip.figure)
    ours = dict(zip(places, point_paths(clip.figure, clip.q, list(places.values())).swapaxes(0, 1), strict=True))
    theirs = {role: motion.positions[:, motion.names.index(roles.joints[role])] for role in places}
    slides, free = [np.zeros(0)], {role: np.ones(len(clip), dtype=bool) for role in places}
    for name in recorded:
        moving, moved = (Things(world, {name: tracks[name]}) for tracks in (recorded, clip.things))
        for role, path in theirs.items():
            if role.split("_")[-1] in CARRIED:
                mask = moving.touched(name, path, CARRIED[role.split("_")[-1]], motion.dt) & free[role]
                slides.append(_slid(moved.within(name, ours[role]), mask, clip.dt))
                free[role] &= ~mask
    for role, mask in known.rests.items():
        if role in ours and role.endswith(("ankle", "toe")):
            slides.append(_slid(ours[role], mask & free[role], clip.dt))
    slide = np.concatenate(slides)
    own, other = (np.stack(list(paths.values()), axis=1) for paths in (ours, theirs))
    return {
        "bones median deg": float(np.median(errors)),
        "frames that overlap": f"{found.colliding} of {len(clip)}",
        "deepest mm": 1e3 * max(found.deepest, found.deepest_between),
        "slide mm/s": 1e3 * float(slide.mean()) if len(slide) else float("nan"),
        "jerk": _jerk(own) / max(_jerk(other) * _size(own) / max(_size(other), 1e-9), 1e-9),
    }


def _slid(path: Array, mask: Mask, dt: float) -> Array:
    """Speeds of a point (n, 3) from one frame in which it rests (n,) to the next, m/s."""
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1)[mask[1:] & mask[:-1]] / dt)


def _jerk(places: Array) -> float:
    """Root mean square of the third difference of places (n, p, 3), metres."""
    return float(np.sqrt((np.diff(places, 3, axis=0) ** 2).mean())) if len(places) > 3 else 0.0


def _size(places: Array) -> float:
    """Metres by which points (n, p, 3) are spread, in the middle of the frames."""
    return float(np.median(np.sqrt(((places - places.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))))


def totals(rows: Sequence[Row]) -> list[Row]:
    """A row for each figure and tool over all clips: medians, and the deepest of all."""
    found = []
    for figure, tool in dict.fromkeys((_figure(row), row.tool) for row in rows):
        mine = [row for row in rows if (_figure(row), row.tool) == (figure, tool)]
        free = sum(str(row["frames that overlap"]).startswith("0 ") for row in mine)
        middle = dict[str, float]()
        for name in ("bones median deg", "slide mm/s", "jerk", "frames a s"):
            known = [value for row in mine if not np.isnan(value := float(row[name]))]  # who never rests does not slide
            middle[name] = float(np.median(known)) if known else float("nan")
        deep = np.array([float(row["deepest mm"]) for row in mine])
        figures: dict[str, Figure] = {"clips": len(mine), "without overlap in frames": free, **middle}
        figures |= {"deepest mm, median": float(np.median(deep)), "deepest mm, most": float(deep.max())}
        found.append(Row(figure, tool, figures))
    return found


def _figure(row: Row) -> str:
    return row.case.rsplit(", ", 1)[-1]


# weights of place and orientation, of the first and of the second stage
WEIGHTS = {
    "pelvis": ((0.0, 10.0), (100.0, 5.0)), "chest": ((0.0, 100.0), (0.0, 10.0)), "hip": ((0.0, 10.0), (10.0, 5.0)),
    "knee": ((0.0, 10.0), (10.0, 5.0)), "ankle": ((50.0, 10.0), (50.0, 10.0)), "shoulder": ((0.0, 100.0), (5.0, 100.0)),
    "elbow": ((0.0, 10.0), (10.0, 5.0)), "wrist": ((0.0, 10.0), (10.0, 5.0)),
}  # fmt: skip


class MinkRetargeting:
    """Postures of a figure that follow a skeleton."""

    def __init__(self, motion: SkeletonMotion, figure: wb.Figure, roles: Roles) -> None:
        import mink
        import mujoco

        self._mink = mink
        roles_used = [role for role in roles.frames if role.split("_")[-1] in WEIGHTS and role in roles.joints]
        segments = {row["role"]: row["wholebody"] for row in ROWS}  # those that carry limbs of a person
        self._turned = {
            role: segments[role] if segments[role] in figure.segments else roles.turns[role] for role in roles_used
        }
        sites = {f"{role} at": (joint, pin.SE3(np.eye(3), at)) for role, (joint, at) in roles.places(figure).items()}
        sites |= {f"{role} turned": own_frame(figure, self._turned[role]) for role in roles_used}
        model = mujoco.MjModel.from_xml_string(mjcf(wb.Scene(figure), sites))
        self._order, self._dt, self._configuration = Order(figure, model), model.opt.timestep, mink.Configuration(model)
        self._targets = _targets(motion, figure, roles, self._turned)
        self._stages = [self._tasks(roles_used, stage) for stage in (0, 1)]
        start = upright(figure).copy()
        if figure.root == "free":
            start[:7] = pin.SE3ToXYZQUAT(pin.SE3(self._targets["pelvis"][1][0], self._targets["pelvis"][0][0]))
        self._configuration.update(self._order.theirs(start))
        for _ in range(20):  # before the motion begins, so that the approach is not judged
            self.frame(0)

    def _tasks(self, used: list[str], stage: int) -> list[tuple[str, str, object]]:
        made = []
        for role in used:
            at, turn = WEIGHTS[role.split("_")[-1]][stage]
            for kind, place, turned in (("at", at, 0.0), ("turned", 0.0, turn)):
                if place or turned:
                    task = self._mink.FrameTask(
                        f"{role} {kind}", "site", position_cost=place, orientation_cost=turned, lm_damping=1.0
                    )
                    made.append((role, kind, task))
        return made

    def frame(self, number: int) -> Array:
        """The posture (nq,) of a frame, from that of the frame before."""
        for stage in self._stages:
            tasks = [task for _, _, task in stage]
            for role, _, task in stage:
                place, turn = (values[number] for values in self._targets[role])
                rotation = self._mink.SO3.from_matrix(turn)
                task.set_target(self._mink.SE3.from_rotation_and_translation(rotation, place))  # type: ignore[attr-defined]
            before = self._error(tasks)
            for _ in range(1 + 10):  # further steps
                step = self._mink.solve_ik(self._configuration, tasks, self._dt, "daqp", 0.5)
                self._configuration.integrate_inplace(step, self._dt)
                after = self._error(tasks)
                if before - after <= 1e-3:  # of the error
                    break
                before = after
        return self._order.ours(np.array(self._configuration.q))

    def _error(self, tasks: list[object]) -> float:
        errors = [task.compute_error(self._configuration) for task in tasks]  # type: ignore[attr-defined]
        return float(np.linalg.norm(np.concatenate(errors)))


def _targets(
    motion: SkeletonMotion, figure: wb.Figure, roles: Roles, used: dict[str, str]
) -> dict[str, tuple[Array, Array]]:
    """Places (n, 3) and orientations (n, 3, 3) of the parts: those of the skeleton, limbs as long as the figure's."""
    own, turned, lowest = standing_places(figure, with_values(roles, turns=used))
    joints = {role: motion.names.index(name) for role, name in roles.joints.items()}
    axes, rest = rest_axes(motion, roles), motion.rest()
    axes = np.eye(3) if axes is None else axes
    scales = {limb[0]: _length(own, limb) / max(_length({r: rest[k] for r, k in joints.items()}, limb), 1e-9)
              for limb in LIMBS}  # fmt: skip
    legs = scales["hip"]
    root = motion.positions[:, joints["pelvis"]]
    found = {}
    for role in used:
        arm = role.split("_")[-1] in ("shoulder", "elbow", "wrist")
        scale = scales["shoulder"] if arm else legs
        places = legs * root + scale * (motion.positions[:, joints[role]] - root)
        turns = motion.rotations[:, joints[role]] @ axes @ _rest_turn(role, own, rest @ axes, joints) @ turned[role]
        found[role] = (places, turns)
    if {"left_hip", "right_hip"} <= found.keys():  # a figure's pelvis may be elsewhere above its hips
        hips = 0.5 * (found["left_hip"][0] + found["right_hip"][0])
        above = own["pelvis"] - 0.5 * (own["left_hip"] + own["right_hip"])
        found["pelvis"] = (hips + motion.rotations[:, joints["pelvis"]] @ axes @ above, found["pelvis"][1])
    if "left_ankle" in found:  # the ankles are as high above the floor as where the figure stands
        low = min(float(np.percentile(found[role][0][:, 2], 2.0)) for role in ("left_ankle", "right_ankle"))
        for places, _ in found.values():
            places[:, 2] += own["left_ankle"][2] - lowest - low
    return found


def _rest_turn(role: str, own: dict[str, Array], rest: Array, joints: dict[str, int]) -> Array:
    """(3, 3) from the direction of a limb where the figure stands to that in the skeleton's rest posture."""
    for limb in LIMBS:
        for start, end in pairwise(limb[:3]):
            side = role.split("_")[0]
            first, last = f"{side}_{start}", f"{side}_{end}"
            mine = role == first or (role == last and end == limb[2] and limb[0] == "shoulder")
            if mine and {first, last} <= own.keys() & joints.keys():
                bones = own[last] - own[first], rest[joints[last]] - rest[joints[first]]
                return np.asarray(pin.Quaternion.FromTwoVectors(*bones).toRotationMatrix())
    return np.eye(3)


def _length(places: dict[str, Array], limb: tuple[str, ...]) -> float:
    """Metres of the first two bones of a limb of the left side."""
    known = [places[f"left_{part}"] for part in limb[:3] if f"left_{part}" in places]
    return float(sum(np.linalg.norm(last - first) for first, last in pairwise(known)))

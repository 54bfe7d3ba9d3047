"""The frame loop: the figure moves towards its tracker, and its overlap is removed (Schmidl and Lin, figure 3)."""

from __future__ import annotations

import copy
import itertools
import time
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import array, choice, flag, function, instance, known, listed, time_step
from wholebody.base.errors import InputError
from wholebody.figures.state import UNIT_TOLERANCE
from wholebody.geometry.placement import PlacementLike, placement
from wholebody.geometry.proximity import PENETRATION
from wholebody.methods.base import SEED, judged
from wholebody.methods.qp.method import QP
from wholebody.motion.clip import Clip, same_joints
from wholebody.problem import Problem
from wholebody.scene.moving_obstacles import Collision, FrameMotion
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import NotCopyable
from wholebody.tasks import ReachCones
from wholebody.tracking.frame import FRAME, Frame, OverlapStrategy, Resolution
from wholebody.tracking.overlaps import GIVE_WAY, make_room
from wholebody.tracking.qp_strategy import CLEARANCE, Attraction, QPStrategy, weights
from wholebody.tracking.recording import Recording

OVERLAPS = ("qp", "ccd")

SHARES = (0.5, 0.25)
"""Shares of the motion that are tried if the whole is not free: an arc leaves a surface by the square of the share."""


class FrameLoop(NotCopyable):
    """Computes the posture of a figure that follows a tracker, frame by frame, without penetration.

    Things may be moved between frames. One that moves during a frame (`Scene.move` with `over`) is met on its way: with
    "qp" the figure evades it as it comes. One that was put into the figure is left as fast as joints may
    move. What could not be avoided, and what the figure is still inside of, is named in the frame.

    Attributes:
        scene: the figure among things.
        shown: (nq,) the posture that is shown at present.
        overlap: name of the overlap strategy.
        give_way: who takes an overlap of the figure with a thing that has a `wb.Body`.
        count: number of frames so far.

    Examples:
        >>> loop = wholebody.tracking.FrameLoop(scene, standing)
        >>> loop.frame(standing).note
        ''
    """

    def __init__(
        self,
        scene: Scene,
        start: ArrayLike,
        *,
        overlap: str = "qp",
        dt: float = FRAME,
        seed: int = 0,
        rigid: bool = False,
        touching: Sequence[str] = (),
        give_way: str = "figure",
    ) -> None:
        """Prepare the first frame.

        Args:
            scene: the figure among things.
            start: (nq,) first tracked posture; if it overlaps something, the nearest posture without overlap is shown.
            overlap: "qp": the nearest posture without overlap, by quadratic programs; "ccd": limb by limb by cyclic
                coordinate descent, or for a rigid figure by its global penetration depth, as Schmidl and Lin do.
            dt: seconds from frame to frame.
            seed: of all random orders.
            rigid: whether the figure is displaced as a whole, such as a hand, while its joints follow the tracker.
            touching: names of things that the figure may touch; with "qp" it keeps a millimetre from all others.
            give_way: "figure": where it would overlap a thing that has a `wb.Body`, the figure takes all of it. "both":
                the thing is first moved by half of PD_g, as far as nothing else is in its way (Schmidl and Lin).

        Raises:
            UnknownNameError: another overlap, or no such thing.
            InputError: the start has the wrong shape, is not finite, or no posture near it is free of overlap.
        """
        instance(scene, Scene, "FrameLoop: scene", "make one with wb.Scene(figure)")
        known(overlap, OVERLAPS, "way to remove overlap", "overlap")
        self.give_way: str = choice(give_way, GIVE_WAY, "FrameLoop: give_way")
        dt = time_step(dt, "dt")
        SEED(seed, "seed")
        rigid = flag(rigid, "rigid")
        for name in listed(touching, "FrameLoop: touching", "['ball']"):
            known(name, scene.objects, "object", "touching")
        self.scene, self.overlap, self.count, self._touching = scene, overlap, 0, tuple(touching)
        self._inside = False  # whether the posture that is shown overlaps something
        q = array(start, "start", f"a posture of {scene.figure.name}").copy()
        reason = invalid_reason(scene, q)
        if reason:
            raise InputError(f"frame 0: {reason}; begin with a posture of {scene.figure.name}")
        self._said = scene.figure.warn_of_angles(q, "start")
        self.shown, self._note = free_start(scene, q, rigid)
        self._workspace = scene.workspace()
        self._strategy = self._strategy_for(overlap, dt, seed, rigid)
        self._kept_from_passing(self._strategy.resolve(self.shown, self.shown))  # one-time set-up

    def frame(self, tracked: ArrayLike) -> Frame:
        """Show one frame towards a tracked posture (nq,).

        If that is invalid (a sensor that failed), the figure keeps its posture, and the note of the frame reports it.
        """
        began = _clocks()
        goal = array(tracked, "tracked", f"{self.scene.model.nq} numbers")
        reason = invalid_reason(self.scene, goal)
        if self.give_way == "both" and not reason:
            make_room(self.scene, self.scene.figure.clamp(pin.normalize(self.scene.model, goal)))
        self._workspace.refresh()
        motion = self._workspace.next_frame(self.shown)
        if reason:
            resolution = Resolution((self.shown,), 0.0, 0.0, 0, 0, 0, f"{reason}; the figure stays", swept=True)
        else:
            self._said = self._said or self.scene.figure.warn_of_angles(goal, "tracked")  # once for all frames
            within = self.scene.figure.clamp(pin.normalize(self.scene.model, goal))
            resolution = self._strategy.resolve(self.shown, within)
        if motion is None:
            return self._shown(self._kept_from_passing(resolution), began=began)
        if not motion.still:
            resolution, collisions = self._kept_from_moving(resolution, motion)
            return self._shown(resolution, collisions, resolution.path, began=began)
        resolution = self._kept_from_passing(resolution)
        collisions = judged(self._workspace, motion, self.shown, resolution.candidates[0])
        note = "; ".join(part for part in (resolution.note, *map(str, collisions)) if part)
        return self._shown(with_values(resolution, note=note), collisions, began=began)

    def _shown(
        self,
        resolution: Resolution,
        collisions: tuple[Collision, ...] = (),
        path: tuple[tuple[float, Array], ...] = (),
        *,
        began: tuple[float, float],
    ) -> Frame:
        self.shown = np.array(resolution.candidates[0])
        left = ""
        if self._inside or any(one.inside for one in collisions):
            left = deepest_overlap(self.scene, self.shown)
            self._inside = bool(left)
        note = "; ".join(part for part in (self._note, resolution.note, left) if part)
        note = f"frame {self.count}: {note}" if note else ""
        self._note, self.count = "", self.count + 1
        wall, cpu = (now - then for now, then in zip(_clocks(), began, strict=True))
        return Frame(
            self.shown, wall, cpu, resolution.contact_seconds, resolution.solve_seconds,
            resolution.iterations, resolution.joints, resolution.pairs, note,
            collisions, path,
        )  # fmt: skip

    def _kept_from_passing(self, resolution: Resolution) -> Resolution:
        """The first posture to which the motion is free; else a share of the motion, or the posture shown."""
        # Algorithm 1, step 4. Motions up to a contact are rejected, because they would creep into it.
        if resolution.swept:
            return resolution
        began = time.perf_counter()
        nearest = resolution.candidates[-1]
        parts = (np.asarray(pin.interpolate(self.scene.model, self.shown, nearest, share)) for share in SHARES)
        note, contact = resolution.note, None
        for q in itertools.chain(resolution.candidates, parts):
            contact = self.scene.sweep(self.shown, q, self._strategy.sweep_tolerance)
            if contact is None:
                break
        if contact is not None:
            owners = " and ".join(self.scene.piece_owner[piece] for piece in contact.pair)
            q = self.shown
            stop = f"{owners} would pass through each other on the way; the figure stays"
            note = "; ".join(part for part in (note, stop) if part)
        spent = resolution.contact_seconds + time.perf_counter() - began
        return with_values(resolution, candidates=(q,), contact_seconds=spent, note=note)

    def _kept_from_moving(
        self, resolution: Resolution, motion: FrameMotion
    ) -> tuple[Resolution, tuple[Collision, ...]]:
        """The first posture free of things that move, or the least deep, and what was not avoided."""
        began, start = time.perf_counter(), (0.0, self.shown)
        nearest = resolution.candidates[-1]
        paths: list[tuple[tuple[float, Array], ...]] = [resolution.path] if resolution.path else []
        ends = [*resolution.candidates, *(pin.interpolate(self.scene.model, self.shown, nearest, s) for s in SHARES)]
        paths += [(start, (1.0, np.asarray(q))) for q in [*ends, self.shown]]
        best, found, least = paths[0], tuple[Collision, ...](), np.inf
        for way in paths:
            collisions = motion.collisions(way)
            depth = sum(one.depth for one in collisions)
            if depth < least:
                best, found, least = way, collisions, depth
            if not collisions:
                break
        self._workspace.keep(motion, found)
        note = "; ".join(part for part in (resolution.note, *map(str, found)) if part)
        spent = resolution.contact_seconds + time.perf_counter() - began
        return with_values(resolution, candidates=(best[-1][1],), contact_seconds=spent, note=note, path=best), found

    def _strategy_for(self, overlap: str, dt: float, seed: int, rigid: bool) -> OverlapStrategy:
        if overlap == "qp":
            return QPStrategy(self.scene, self.shown, dt, rigid, self._touching)
        from wholebody.tracking.ccd_strategy import CCDStrategy, RigidTranslation

        return RigidTranslation(self.scene) if rigid else CCDStrategy(self.scene, self.shown, dt, seed)


def invalid_reason(scene: Scene, q: Array) -> str:
    """Why a tracked posture is invalid, or ""."""
    if q.shape != (scene.model.nq,) or not np.isfinite(q).all():
        return f"the tracked posture is not {scene.model.nq} finite numbers"
    if not pin.isNormalized(scene.model, q, UNIT_TOLERANCE):
        return "a quaternion of the tracked posture is not of unit length"
    return ""


def _clocks() -> tuple[float, float]:
    """Wall time and the processor's time for this thread, seconds."""
    return time.perf_counter(), time.thread_time()


def frame_placements(
    scene: Scene, moves: Mapping[str, Iterable[PlacementLike]] | None, count: int, what: str
) -> dict[str, tuple[pin.SE3, ...]]:
    """Placements of things at the ends of `count` frames."""
    if moves is None:
        return {}
    instance(moves, Mapping, what, "give {name: a placement for each frame}")
    found = {}
    for name, given in moves.items():
        known(name, scene.objects, "object", what)
        places = listed(given, f"{what}[{name!r}]", "[(x, y, z), ...]")
        if len(places) != count:
            raise InputError(f"{what}[{name!r}] has {len(places)} placements; give {count}, one for each frame")
        found[name] = tuple(placement(at, f"{what}[{name!r}][{number}]") for number, at in enumerate(places))
    return found


def free_start(scene: Scene, q: Array, rigid: bool) -> tuple[Array, str]:
    """The posture q, or the nearest one without overlap, with a note of the change."""
    q = scene.figure.clamp(pin.normalize(scene.model, q))
    deepest = deepest_overlap(scene, q)
    if not deepest:
        return q, ""
    attraction = Attraction(q, weights(scene, rigid))
    cones = [ReachCones()] if scene.figure.cones else []
    solution = QP().solve(Problem(scene, q, constraints=cones, measures=[attraction], clearance=CLEARANCE))
    if deepest_overlap(scene, solution.q):
        raise InputError(
            f"frame 0: {deepest}, and no posture near it is free of overlap; begin the track outside of things"
        )
    return solution.q, f"{deepest}; the nearest posture without overlap is shown"


def deepest_overlap(scene: Scene, q: Array) -> str:
    """The deepest overlap at q in words, or "" if there is none."""
    contacts = scene.contacts(q, within=-PENETRATION)
    if not len(contacts.distance):
        return ""
    first, second = (scene.piece_owner[piece] for piece in contacts.pair[0])
    return f"{first} is {-1e3 * contacts.distance[0]:.1f} mm inside {second}"


def follow(
    scene: Scene,
    track: Clip,
    *,
    overlap: str = "qp",
    seed: int = 0,
    rigid: bool = False,
    progress: Callable[[int], None] | None = None,
    moves: Mapping[str, Sequence[PlacementLike]] | None = None,
) -> Recording:
    """Follow a whole track.

    Args:
        scene: the figure among things.
        track: the tracked postures; they may overlap things. Its own `things` move with it.
        overlap: name of the overlap strategy, see `FrameLoop`.
        seed: of all random orders; the same seed gives the same frames.
        rigid: whether the figure is displaced as a whole, see `FrameLoop`.
        progress: called after each frame with the number of frames done.
        moves: thing to its placement at the end of each frame, as many as the track has; it moves from one to the next,
            and begins where the scene has it. The scene is not changed.

    Raises:
        UnknownNameError, InputError: the track is of another figure, or no posture near its start is free.

    Examples:
        >>> track = wb.motion.posed(human, angles={"right_elbow_flexion": [0.0, 0.1, 0.2]}, dt=1 / 60)
        >>> wholebody.tracking.follow(scene, track).q.shape
        (3, 56)
    """
    instance(scene, Scene, "follow: scene", "make one with wb.Scene(figure)")
    instance(track, Clip, "follow: track", "make one with wb.Clip(figure, q, dt)")
    function(progress, "progress")
    same_joints(track, scene.figure, "follow")
    own = frame_placements(scene, track.things, len(track.q), "follow: things of the track")
    tracks = {**own, **frame_placements(scene, moves, len(track.q), "follow: moves")}
    scene = copy.copy(scene) if tracks else scene
    for name, places in own.items():
        scene.move(name, at=places[0])
    loop = FrameLoop(scene, track.q[0], overlap=overlap, dt=track.dt, seed=seed, rigid=rigid)
    frames = []
    for number, tracked in enumerate(track.q):
        for name, places in tracks.items():
            scene.move(name, at=places[number], over=track.dt)
        frames.append(loop.frame(tracked))
        if progress is not None:
            progress(number + 1)
    return Recording.of(frames, track.q, track.dt, overlap, tracks)

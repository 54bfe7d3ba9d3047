"""Retargeting: the motion of a skeleton becomes a clip of a figure, and how well the clip follows it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross
from wholebody.base.checks import function, instance, known, warn
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.geometry.placement import PlacementLike
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.carrying import as_carried, brought_back, carrier
from wholebody.motion.clip import Clip, thing_tracks
from wholebody.motion.files.base import check_one
from wholebody.motion.held_points import held_points, touching_points
from wholebody.motion.holds import LAG, Holds
from wholebody.motion.posture_fit import Fitter
from wholebody.motion.retarget_run import Run
from wholebody.motion.retarget_targets import (
    Proportions,
    Wanted,
    known_bones,
    soled,
    soles,
    standing_places,
    wanted_of,
)
from wholebody.motion.roles import Roles, matched, skeleton_roles
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.motion.stance import point_paths
from wholebody.motion.standing_ground import NOTHING, Ground, ground_on
from wholebody.motion.structure import LIMBS, size_of
from wholebody.motion.surfaces import Surface, surface_of
from wholebody.motion.thing_contacts import (
    ThingContact,
    Things,
    hand_shares,
    own_contacts,
    own_rests,
    said_of_many,
    still_things,
)
from wholebody.motion.touching import Touched
from wholebody.scene.scene import Scene

DEEP = 2e-3  # m: what overlaps by so much is told
# a clip whose points jerk so many times as those of the free fit, and so much [m/s³], or that overlaps so, is beyond
# what it should be; so many times beyond, it is stuck at an edge, and is sought once more with feet that lag so much.
# Of both the one is kept with the least product of errors of bones and of how many times it is beyond
JERKS, LEAST_JERK, STUCK, AGAIN = 3.0, 50.0, 2.0, 0.8


def retarget(
    motion: SkeletonMotion,
    figure: Figure,
    scene: Scene | None = None,
    ground: str | Ground | None = "auto",
    *,
    things: Mapping[str, Iterable[PlacementLike]] | None = None,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    progress: Callable[[float], object] | None = None,
) -> Clip:
    """The motion of a skeleton as a clip of a figure.

    Args:
        motion: the skeleton, from `wb.motion.read_skeleton`.
        figure: the figure.
        scene: the figure among things, where they were in the recording; None for a level floor. Things do not change
            their size with the figure, so a way among them keeps its length.
        ground: "auto" to find what the person stands on, as `wb.motion.ground` does in the scene; that, or one that was
            changed; None to hold nothing, and without a scene to follow the skeleton alone.
        things: where things of the scene are that move in the recording: by name, a placement in each frame. The clip
            has them as `things`. Beside others that stand they move as recorded; alone, on a way as much shorter, and
            as much less high above the floor, as the figure's legs are shorter.
        names: which joint of the skeleton and which frame of the figure are which part of a body: a TOML file or a
            mapping; see docs/motion.md. Names of CMU, Mixamo, LAFAN1, SMPL, DeepMimic, Bandai-Namco, Biovision, Xsens,
            Poser, Daz, 3ds Max (biped), Unreal, VRM, VRoid, Rokoko and Motive are known.
        progress: called now and then with the share of the work that is done.

    Returns:
        A clip within the figure's joint limits, reach cones and speed limits. Feet, hands and knees that rest are held
        where they came down, soles on the ground. Hands, elbows, knees and the pelvis that touch a thing of the scene
        touch it at the same place, and go with it; hands that meet do so. In every frame the figure is free of itself,
        of the ground and of things where the holds and limits leave room for it; between frames too, as seen at some
        places of each motion, unless things move. Overlaps of 2 mm or more are told that are seen in frames, in the
        middle between two, or at eighths between where one of 1 mm is near. What `wb.check` tells, `wb.avoid` mends.
        With `ground=None` and no scene the figure may collide.

    Raises:
        UnknownNameError: a name that does not exist.
        FileFormatError: the TOML file cannot be read.
        InputError: no bones are known to belong to the figure, or two ends of none; the scene is of another figure; the
            ground is none, or of a recording of another length; so are placements of a thing.

    Examples:
        >>> walk = wb.retarget(skeleton, human)
        >>> walk.figure.name
        'human'
    """
    motion = checked_motion(motion, "retarget: motion")
    one_figure(figure, "retarget: figure")
    check_one(motion.names, figure, f"the skeleton of {motion.name}")
    function(progress, "progress")
    if scene is not None:
        same_figure(scene, figure, "retarget")
        if said := said_of_many(scene):
            warn(f"retarget: {said}")
    tracks = _tracks(motion, scene, things)
    surface = None if scene is None else surface_of(scene, tracks, motion.dt)
    if scene is not None and tracks and ground is not None and not isinstance(ground, Ground) and figure.root == "free":
        still_ground, joints = ground_on(motion, names, surface), skeleton_roles(motion, names)
        if on := carrier(motion, joints, scene, tracks, still_ground):
            seen, there, others = as_carried(motion, scene, tracks, on)
            below = surface_of(there, others, motion.dt)
            rests = checked_ground(seen, figure, ground, names, below)  # nobody is carried twice
            clip = retarget(seen, figure, there, rests, things=others, names=names, progress=progress)
            return brought_back(clip, tracks[on], tracks)
    roles = matched(motion, figure, names)
    if roles.by_structure:
        known = ", ".join(f"{role} is {roles.joints[role]!r}" for role in roles.by_structure)
        mend = "name them by names= (or --names FILE.toml) if not"
        warn(f"retarget: {motion.name}: by the structure of the skeleton {known}; {mend}")
    if roles.missing:
        warn(
            f"retarget: no joint of {motion.name} is known for {', '.join(roles.missing)}, so these follow nothing; "
            'name them by names= (or --names FILE.toml): a table "skeleton" with left_wrist = "hand.L"'
        )
    found = checked_ground(motion, figure, ground, names, surface)
    # without things but floors, the paths of moving things are scaled like the figure's own path
    still = [] if scene is None else [name for name in still_things(scene) if name not in tracks]
    path = None if scene is None or (tracks and not still) else 1.0
    proportions = Proportions(motion, figure, roles, found, path)
    wanted = proportions.targets(motion, found.below(len(motion)))
    if not wanted.points:
        raise InputError(
            f"the roles that {motion.name} and {figure.name} have in common ({', '.join(roles.joints)}) make no bone; "
            "name both ends of one"
        )
    world = Scene(figure) if scene is None else scene
    if scene is None and ground is not None and figure.root == "free":
        world.add(HalfSpace(), name="floor")
    frames, lost, inside = wanted_of(wanted, roles), "", ""
    with world.borrow() as workspace:
        alone = Run(figure, wanted, roles, motion.dt, None, workspace)
        alone.led_by(frames)
        q = _postures(alone, frames, progress, 0.0)
        if ground is not None or scene is not None:
            held = NOTHING if ground is None else found
            recorded, contacts = Things(world, tracks), list[ThingContact]()
            tracks = {name: recorded.scaled(name, proportions.path) for name in tracks}
            joints = skeleton_roles(motion, names)
            if ground is not None and figure.root == "free":
                contacts = _contacts(motion, roles, joints, recorded, found, alone)
            parts = ((one.role, one.share, one.base) for one in contacts)
            points = held_points(figure, roles, held) + touching_points(figure, roles, motion, parts, joints)
            touched = Touched(figure, Things(world, tracks), contacts)
            tries = list[tuple[float, Array, Array, Holds]]()
            for lag in (LAG, AGAIN):
                holds = Holds(points, held, proportions.path, motion.dt, surface, touched, lag)
                run = partial(Run, figure, wanted, roles, motion.dt, holds, workspace, alone.free)
                # places on things are sought as bodies come to them; a hand on the own body after a first pass
                q = _held(run, holds, frames, all(one.base for one in contacts), progress)
                depths = _depths(alone.fitter, holds, q)
                most = max(JERKS * alone.jerk(alone.free), LEAST_JERK)
                over = max(1.0, alone.jerk(q) / most, depths.max() / DEEP)
                bones = list(errors_of(motion, Clip(figure, q, motion.dt), roles, found).values())
                tries.append((over * float(np.median(bones)) if bones else over, q, depths, holds))
                if over < STUCK:
                    break
            # a second try that lets go of a tenth of all contacts more is none
            lost_most = len(tries[0][3].given_up) + 0.1 * sum(one.end - one.first for one in contacts)
            _, q, depths, holds = min(
                (one for one in tries if len(one[3].given_up) <= lost_most), key=lambda one: one[0]
            )
            lost = holds.let_go(q)
            inside = _said_inside(alone.fitter, holds, q, depths)
    clip = Clip(figure, q, motion.dt, motion.name, tracks)
    if lost:
        warn(f"retarget: {motion.name}: {lost}, which it lets go of there; things keep their places and sizes")
    if inside:
        warn(f"retarget: {motion.name}: {inside}; wb.check lists all, wb.avoid frees what can be free")
    if said := said_of(errors_of(motion, clip, roles, found)):
        warn(f"retarget: {motion.name}: {said}; bone_errors has them frame by frame")
    return clip


def _postures(run: Run, frames: list[Wanted], tell: Callable[[float], object] | None, done: float) -> Array:
    """Postures (n, nq) of all frames; tells how much is done, where it was `done` before."""
    found = list[Array]()
    for number, wanted in enumerate(frames):
        found += run.push(wanted)
        if tell is not None and number % 20 == 0:
            tell(done + (1.0 - done) * (number + len(found)) / (2 * len(frames)))
    found += run.finish()
    if tell is not None:
        tell(1.0)
    return np.array(found)


def _advanced(run: Run, count: int, tell: Callable[[float], object] | None) -> Array:
    """Postures (n, nq) of all frames after the first pass; tells how much is done, from 0.4 on."""
    found = list[Array]()
    for until in (*range(20, count, 20), count):
        found += run.advance(until)
        if tell is not None:
            tell(0.4 + 0.6 * until / count)
    return np.array(found)


def _held(
    make: Callable[[], Run], holds: Holds, frames: list[Wanted], ahead: bool, tell: Callable[[float], object] | None
) -> Array:
    """Postures (n, nq) of all frames with holds; `ahead`: what is out of reach is known after a first pass."""
    for _ in range(2):  # the second time around what the first one could not reach
        run = make()
        if ahead:
            run.pass_first(frames)
        else:
            q = _postures(run, frames, tell, 0.3)
        if not holds.give_up():
            break
    return _advanced(run, len(frames), tell) if ahead else q


def _depths(fitter: Fitter, holds: Holds, q: Array) -> Array:
    """How deep frames (n, nq), and eighths of motions to the next where one is near, overlap (n, 8), m."""
    depths = np.zeros((len(q), 8))
    for frame, posture in enumerate(q):
        fitter.see(holds.moved(frame))
        depths[frame, 0] = fitter.depth(posture)
    for frame, (before, after) in enumerate(pairwise(q)):
        for part in () if holds.moved(frame) else (4, 2, 6, 1, 3, 5, 7):
            if part == 4 or max(depths[frame].max(), depths[frame + 1, 0]) >= 0.5 * DEEP:
                depths[frame, part] = fitter.depth(pin.interpolate(fitter.model, before, after, part / 8))
    return depths


def _said_inside(fitter: Fitter, holds: Holds, q: Array, depths: Array) -> str:
    """What is known of frames (n, nq), and motions to the next, that overlap deeply; empty without one."""
    if depths.max() < DEEP:
        return ""
    worst, part = np.unravel_index(int(depths.argmax()), depths.shape)
    fitter.see(holds.moved(int(worst)))
    first, second = fitter.deepest(pin.interpolate(fitter.model, *q[[worst, min(worst + 1, len(q) - 1)]], part / 8))
    return (
        f"{(depths.max(axis=1) >= DEEP).sum()} of {len(q)} frames, or motions to the next, overlap by "
        f"{1e3 * DEEP:.0f} mm or more, most of all {first} and {second} by {1e3 * depths.max():.0f} mm "
        f"{'after' if part else 'in'} frame {worst}"
    )


def _contacts(
    motion: SkeletonMotion, roles: Roles, joints: Mapping[str, str], things: Things, ground: Ground, alone: Run
) -> list[ThingContact]:
    """What a figure touches with what: things, and with its hands its own body; `alone` has its free fit."""
    touching, figure = _touching(joints, roles), alone.figure
    contacts = things.contacts(motion, touching)
    busy = [one[:3] for one in contacts] + [one[:3] for one in ground.footholds]
    grown = motion.resized(1.0 / size_of(motion, joints))
    if rests := own_rests(grown, joints, shares := hand_shares(touching), busy):
        parts = ((role, share, 0) for role, share in shares.items())
        hands = {point.role: point for point in touching_points(figure, roles, motion, parts, joints)}
        contacts += own_contacts(rests, figure, roles, hands, alone.free)
    return sorted(contacts, key=lambda one: one.first)


def _tracks(
    motion: SkeletonMotion, scene: Scene | None, given: Mapping[str, Iterable[PlacementLike]] | None
) -> dict[str, Array]:
    """Placements (n, 7) of things that move."""
    if given is None:
        return {}
    named = instance(given, Mapping, "retarget: things", "give placements by name: {'box': [(0.4, 0.0, 1.0), ...]}")
    if scene is None:
        raise InputError("retarget: things move in a scene; give scene= with them")
    standing = [name for name, thing in scene.objects.items() if thing.segment is None]
    for name in named:
        known(name, standing, "thing", "retarget: things")
        if isinstance(scene.objects[name].shape, HalfSpace):
            raise InputError(f"retarget: things: {name} is a half-space, which stands; give a box that moves")
    return thing_tracks(named, len(motion), "retarget")


def _touching(joints: Mapping[str, str], roles: Roles) -> dict[str, str]:
    """Joints of the skeleton by roles that a figure can bring to things: its own, and hands beyond its wrists."""
    return {
        role: joint
        for role, joint in joints.items()
        if role in roles.frames or (role.endswith("hand") and role.replace("hand", "wrist") in roles.frames)
    }


def same_figure(scene: Scene, figure: Figure, where: str) -> None:
    """Refuse a scene of another figure, or of several, and what is none."""
    instance(scene, Scene, f"{where}: scene", "make one with wb.Scene(figure)")
    if scene.figure.root == "several":
        name = next(iter(scene.figure.bodies)).rstrip("/")
        raise InputError(
            f"{where}: the scene has several figures; leave it out, move the clip's free root to where the figure "
            f"stands, join the postures by figure.posture({{{name!r}: q, ...}}), and free the clip of all by avoid"
        )
    if scene.figure.joints != figure.joints or scene.model.nq != figure.model.nq:
        raise InputError(f"{where}: the scene has the figure {scene.figure.name}, not {figure.name}; give its own")


def checked_ground(
    motion: SkeletonMotion,
    figure: Figure,
    given: object,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None,
    surface: Surface | None,
) -> Ground:
    """The ground of a recording, stated or found, on surfaces of a scene where these are given."""
    if figure.root != "free":  # no ground moves with a pelvis
        return NOTHING
    if given is None or (isinstance(given, str) and given == "auto"):
        return ground_on(motion, names, surface)
    found = instance(given, Ground, "retarget: ground", 'give "auto", wb.motion.ground(motion) or None')
    if any(len(mask) != len(motion) for mask in found.rests.values()) or any(
        not 0 <= each.first < each.end <= len(motion) for each in found.footholds
    ):
        raise InputError(
            f"retarget: the ground is of another recording than {motion.name}; give wb.motion.ground of it"
        )
    return found


def bone_errors(
    motion: SkeletonMotion,
    clip: Clip,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    scene: Scene | None = None,
) -> dict[str, Array]:
    """The angle (n,) in radians between each bone of a skeleton and that of a figure, by the bone's two ends.

    Args:
        motion: the skeleton.
        clip: the motion of the figure, from `retarget`, frame by frame the same.
        names: as for `retarget`.
        scene: the one of `retarget`: what its feet stand on says where their soles are flat.

    Returns:
        Errors by names such as "left_shoulder to left_elbow"; a bone without both ends, or without a length, has none.
        Those of feet are between soles: skeletons have ankles and toes at other heights above them.

    Raises:
        InputError: the clip has another number of frames, no bones are known to belong to the figure, or the scene is
            of another figure.

    Examples:
        >>> errors = wb.motion.bone_errors(skeleton, wb.retarget(skeleton, human))
    """
    motion = checked_motion(motion, "bone_errors: motion")
    instance(clip, Clip, "bone_errors: clip", "give that of wb.retarget(motion, figure)")
    if len(clip) != len(motion):
        raise InputError(
            f"bone_errors: the clip has {len(clip)} frames and the motion {len(motion)}; give its own clip"
        )
    if scene is not None:
        same_figure(scene, clip.figure, "bone_errors")
    roles = matched(motion, clip.figure, names)
    surface = None if scene is None else surface_of(scene, clip.things, clip.dt)
    return errors_of(motion, clip, roles, ground_on(motion, {"skeleton": roles.joints}, surface))


def errors_of(motion: SkeletonMotion, clip: Clip, roles: Roles, ground: Ground) -> dict[str, Array]:
    """`bone_errors` with known roles and ground, which says where soles are flat."""
    points = roles.places(clip.figure)
    places = dict(zip(points, point_paths(clip.figure, clip.q, list(points.values())).swapaxes(0, 1), strict=True))
    centres = {role: motion.positions[:, motion.names.index(joint)] for role, joint in roles.joints.items()}
    if clip.figure.root == "free":
        known = soles(motion, roles, ground.rests, standing_places(clip.figure, roles)[0])
        centres |= soled(motion, {role: motion.names.index(name) for role, name in roles.joints.items()}, known)
    found = {}
    for ends in (ends for side in ("left", "right") for limb in LIMBS for ends in known_bones(limb, side, places)):
        start, end = (centres[role] for role in ends)
        theirs, ours = end - start, places[ends[1]] - places[ends[0]]
        lengths = np.linalg.norm(theirs, axis=1) * np.linalg.norm(ours, axis=1)
        if lengths.min() > 1e-9:
            across = np.linalg.norm(cross(theirs, ours), axis=1)
            found[" to ".join(ends)] = np.arctan2(across, np.einsum("ni,ni->n", theirs, ours))
    return found


def said_of(errors: Mapping[str, Array]) -> str:
    """A sentence on bones whose median error is over 15 degrees; empty without one."""
    medians = {name: float(np.degrees(np.median(values))) for name, values in errors.items()}
    loud = {name: angle for name, angle in medians.items() if angle > 15.0}
    listed = ", ".join(
        f"{name} by {angle:.0f} degrees" for name, angle in sorted(loud.items(), key=lambda one: -one[1])
    )
    return f"bones differ from the recording's (median): {listed}" if loud else ""

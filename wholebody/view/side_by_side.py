"""Several postures in one picture, and several motions in one scene: recorded skeletons as bones, and clips."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import a, known, listed
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch, checked_target, write
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Capsule, HalfSpace
from wholebody.motion.clip import Clip
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.scene.scene import Scene
from wholebody.view.screenshot import check_size
from wholebody.view.viewed_scene import ViewedWorld
from wholebody.view.viewer import Viewer

APART, RADIUS = 1.4, 0.022  # m: from one motion to the next, least; of a bone
SHORT = 0.01  # m: shorter bones are not drawn


class _Body(NamedTuple):
    """A figure of a clip: its only one, or one of several."""

    name: str  # in the scene of all motions
    figure: Figure
    at: pin.SE3  # where its world is in that of the clip
    q: Array  # (n, nq) its postures
    prefix: str  # what its names begin with in the clip

    @property
    def free(self) -> bool:
        """Whether its postures place it."""
        return self.figure.root == "free"

    @property
    def way(self) -> Array:
        """(n, 3) where it is in each frame: its root, or the middle of the joints of what stands on a fixed base."""
        if self.free:
            return self.q[:, :3]
        data = self.figure.model.createData()
        pin.forwardKinematics(self.figure.model, data, self.q[0])
        middle = np.mean([at.translation for at in data.oMi], axis=0)
        return np.tile(self.at.act(middle), (len(self.q), 1))


def beside(motion: SkeletonMotion | None, clips: Mapping[str, Clip], scene: Scene, title: str) -> Viewer:
    """A viewer that plays motions side by side, from the left to the right as they are given.

    The recorded skeleton, if any, is on the left; clips have as many frames, and get what the scene's figures carry
    and what stands around. InputError for other frames, or two names that differ in "/" and " " alone.
    """
    _check(motion, clips, scene)
    bodies = {name: _bodies(name, clip) for name, clip in clips.items()}
    ways = {name: np.concatenate([body.way for body in those]) for name, those in bodies.items()}
    wide = max(APART, 0.5 + max(np.ptp(way[:, 1]) for way in ways.values()))
    count = len(clips) + (motion is not None)
    first = -0.5 * wide * (count - 1)  # what looks against the x axis has y on its right
    aside = {name: first + wide * (number + (motion is not None)) for number, name in enumerate(clips)}
    world = _furnished(bodies, scene, aside)
    tracks = {} if motion is None else _bones(world, motion, first)
    for name, clip in clips.items():
        for thing, track in clip.things.items():
            tracks[f"{thing} by {name}"] = [pin.XYZQUATToSE3(at + np.eye(7)[1] * aside[name]) for at in track]
    viewed = ViewedWorld(world, tracks, between_things=False)
    moved = [
        body.q + np.eye(body.q.shape[1])[1] * aside[name] if body.free else body.q
        for name, those in bodies.items()
        for body in those
    ]
    parts = np.concatenate(moved, axis=1)
    postures = [
        viewed.configuration(q, {name: track[frame] for name, track in tracks.items()}) for frame, q in enumerate(parts)
    ]
    dt = next(iter(clips.values())).dt
    viewer = Viewer(viewed, title=title, contact_distance=-1e-4)  # overlaps alone are shown
    middle = np.mean([way.mean(axis=0) for way in ways.values()], axis=0)
    ahead = [np.ptp(way[:, 0]) for way in ways.values()] + (
        [] if motion is None else [np.ptp(motion.positions[:, 0, 0])]
    )
    away = 1.2 + 1.1 * wide * count + 0.6 * max(ahead)  # half the way, and some, comes towards the camera
    viewer.look(tuple(middle + away * np.array([0.9, 0.1, 0.25])), tuple(middle))
    viewer.play(postures, dt)
    return viewer


def _check(motion: SkeletonMotion | None, clips: Mapping[str, Clip], scene: Scene) -> None:
    """Refuse motions that cannot be shown beside each other; see `beside`."""
    if len({_figure(name) for name in clips}) < len(clips):
        raise InputError(
            f"side by side: the names {', '.join(map(repr, clips))} need to differ in more than '/' and ' '"
        )
    counts = {name: len(clip) for name, clip in clips.items()} | (
        {} if motion is None else {"the recording": len(motion)}
    )
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InputError(f"side by side: motions have different numbers of frames ({listed}); give the same ones")
    around = [name for name, each in scene.objects.items() if each.segment is None]
    for clip in clips.values():
        for thing in clip.things:
            known(thing, around, "thing", "side by side: scene")
            if isinstance(scene.objects[thing].shape, HalfSpace):
                raise InputError(f"side by side: {thing} of {clip.name} moves; a half-space is drawn where it is")


def _furnished(bodies: Mapping[str, Sequence[_Body]], scene: Scene, aside: Mapping[str, float]) -> Scene:
    """The figures, those on a fixed base at their place, with what each carries and what stands around each."""
    around = [each for each in scene.objects.values() if each.segment is None]
    world = Scene(
        {
            body.name: (body.figure, pin.SE3(np.eye(3), np.array((0.0, aside[name], 0.0))) * body.at)
            for name, those in bodies.items()
            for body in those
        }
    )
    for name, those in bodies.items():
        for each in scene.objects.values():
            if each.segment is not None:
                # several figures of a clip may touch what one of them carries
                renamed = {one: _renamed(one, those) for one in (each.segment, *each.rests_on)}
                rests = [renamed[one] for one in each.rests_on if renamed[one] in world.figure.segments]
                label, to = f"{each.name} of {name}", renamed[each.segment]
                world.attach(each.shape, to=to, name=label, at=each.placement, rests_on=rests, color=each.color)
        for each in around:
            if not isinstance(each.shape, HalfSpace):
                at = pin.SE3(each.placement.rotation, each.placement.translation + [0.0, aside[name], 0.0])
                world.add(each.shape, name=f"{each.name} by {name}", at=at, color=each.color)
    if not any(isinstance(each.shape, HalfSpace) for each in around):
        world.add(HalfSpace(), name="floor")
    for each in around:
        if isinstance(each.shape, HalfSpace):
            world.add(each.shape, name=each.name, at=each.placement, color=each.color)
    return world


def _figure(name: str) -> str:
    return name.replace("/", " ")


def _bodies(name: str, clip: Clip) -> list[_Body]:
    """The figures of a clip, with names in the scene of all motions."""
    figure = clip.figure
    if figure.root != "several":
        return [_Body(_figure(name), figure, pin.SE3.Identity(), clip.q, "")]
    return [
        _Body(f"{_figure(name)} {member}", clip.part(member).figure, at, figure.part(member, clip.q), f"{member}/")
        for member, (_, at) in figure.members.items()
    ]


def _renamed(segment: str, bodies: Sequence[_Body]) -> str:
    """The name in the scene of all motions of a segment of a clip's figures."""
    body = next(body for body in bodies if segment.startswith(body.prefix))
    return f"{body.name}/{segment.removeprefix(body.prefix)}"


def _bones(world: Scene, motion: SkeletonMotion, aside: float) -> dict[str, list[pin.SE3]]:
    """Add the bones of a skeleton to a scene as things; where each of them is in each frame."""
    tracks, places = {}, motion.positions + [0.0, aside, 0.0]
    for joint, parent in enumerate(motion.parents):
        if parent < 0 or np.linalg.norm(motion.offsets[joint]) < SHORT:
            continue
        bones = places[:, joint] - places[:, parent]
        length = float(np.median(np.linalg.norm(bones, axis=1)))
        middles = 0.5 * (places[:, joint] + places[:, parent])
        up = np.array([0.0, 0.0, 1.0])
        turns = [pin.Quaternion.FromTwoVectors(up, way) for way in bones]  # which turn evenly from frame to frame
        track = [pin.SE3(turn, middle) for turn, middle in zip(turns, middles, strict=True)]
        name = f"bone {motion.names[joint]}"
        world.add(Capsule(RADIUS, max(length, SHORT)), name=name, at=track[0], color=(0.25, 0.28, 0.33, 1.0))
        tracks[name] = track
    return tracks


GAP = 6  # pixels between two pictures


def write_filmstrip(
    viewer: Viewer,
    postures: Sequence[ArrayLike],
    path: str | os.PathLike[str],
    size: tuple[int, int] = (400, 560),
    *,
    ghosts: Sequence[ArrayLike] | None = None,
) -> Path:
    """Write postures as one PNG, the first one left; the camera should have been set with `viewer.look`.

    Args:
        viewer: shows the postures one after the other, and the last one afterwards.
        postures: each (nq,).
        path: of the file, which is returned.
        size: width and height of each picture, pixels.
        ghosts: as many postures, each (nq,), shown transparent beside the others; those of the viewer stay if left out.

    Raises:
        InputError: no posture, one of a wrong shape, another number of ghosts, or a file that cannot be written.
        MissingPackageError: there is no Chromium.
    """
    from PIL import Image

    if not isinstance(viewer, Viewer):
        raise InputError(f"write_filmstrip: viewer is {a(type(viewer))}, not a Viewer; make one with wb.Viewer(scene)")
    postures = listed(postures, "postures", "[q], each of shape (nq,)")
    if not postures:
        raise InputError("a filmstrip has at least one posture; give a list of postures, each of shape (nq,)")
    beside = None if ghosts is None else listed(ghosts, "ghosts", "[q], each of shape (nq,)")
    if beside is not None and len(beside) != len(postures):
        raise InputError(f"{len(beside)} ghosts for {len(postures)} postures; give one for each")
    width, height = check_size(size)
    strip = Image.new("RGB", (len(postures) * (width + GAP) - GAP, height), "white")
    place = checked_target(path, "write_filmstrip: path", "a filmstrip", (".png",))
    with Scratch() as folder:
        for number, q in enumerate(postures):
            if beside is not None:
                viewer.ghosts([beside[number]])
            viewer.show(q)
            with Image.open(viewer.picture(folder / "one.png", size, legend=False)) as picture:
                strip.paste(picture, (number * (width + GAP), 0))
    made = io.BytesIO()
    strip.save(made, format="PNG")
    return write(place, made.getvalue())

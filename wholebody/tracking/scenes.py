"""Scenes with scripted trackers, from files; those of `scenes.toml` are the experiments of Schmidl and Lin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import known, number, whole
from wholebody.base.files import parsed_toml
from wholebody.figures import load
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.geometry import shapes
from wholebody.methods.base import SEED
from wholebody.motion.clip import MOST_FRAMES, Clip
from wholebody.scene.matter.body import BallJoint, Body, Hinge
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import FRAME

Place = tuple[float, float, float]
Thing = Mapping[str, Any]

WAVES = 5


@dataclass(frozen=True)
class InteractionScene:
    """A scene with a tracker.

    Attributes:
        name, about: its name on the command line, and one sentence.
        scene, track: figure and things, and the tracked postures.
        rigid: whether the figure is displaced as a whole, such as a hand.
        eye, target: position of the camera, and the point in the middle of the picture, metres; None for a camera that
            sees the figure.
        see_through: things to draw transparent.

    Examples:
        >>> len(wholebody.tracking.build_scene("hand_on_table", frames=3).track)
        3
    """

    name: str
    about: str
    scene: Scene
    track: Clip
    rigid: bool = False
    eye: Place | None = None
    target: Place | None = None
    see_through: tuple[str, ...] = ()


class SceneFile:
    """Scenes with scripted trackers, of a TOML file such as `tracking/scenes.toml`, by name."""

    def __init__(self, path: Path, rooms: SceneFile | None = None) -> None:
        """Read a file, whose scenes may be in its rooms and in those of another."""
        self._data = parsed_toml(path.read_text("utf-8"), path.name)
        if rooms is not None:
            for key in ("rooms", "colors"):
                self._data[key] = {**rooms._data[key], **self._data[key]}
        self.scenes: Mapping[str, str] = {name: plan["about"] for name, plan in self._data["scenes"].items()}

    def build(self, name: str, *, frames: int | None = None, seed: int = 0, dt: float = FRAME) -> InteractionScene:
        """Build a scene.

        Args:
            name: of the scene.
            frames: number of frames; the script is cut, or repeated. By default the whole script once.
            seed: of the tracked person's tremor.
            dt: seconds from frame to frame.

        Raises:
            UnknownNameError: there is no such scene.
            InputError: fewer than one frame, or a seed or a time step out of range.

        Examples:
            >>> wholebody.tracking.build_scene("two_arms", frames=2).name
            'two_arms'
        """
        known(name, self.scenes, "scene")
        if frames is not None:
            frames = whole(frames, "frames", 1, MOST_FRAMES)
        SEED(seed, "seed")
        dt = number(dt, "dt", 1e-3, 1.0, "s")  # s: least and greatest from frame to frame
        plan = self._data["scenes"][name]
        figure = load(plan["figure"])
        keys = plan["keys"] if "keys" in plan else self._data["scripts"][plan["script"]]
        pose = _hand_at if plan["figure"] == "hand" else self._standing_at
        track = script(figure, [(key[0], pose(figure, *key[1:])) for key in keys], dt=dt, seed=seed, name=name)
        if frames is not None:
            track = track.with_q(track.q[np.arange(frames) % len(track)])
        scene = self.furnish(Scene(figure), plan.get("room"))
        self._put(scene, plan.get("things", ()))
        eye, target = (tuple(plan[key]) for key in ("eye", "target"))
        return InteractionScene(
            name, plan["about"], scene, track, plan["figure"] == "hand",
            eye, target, tuple(plan.get("see_through", ())),
        )  # fmt: skip

    def furnish(self, scene: Scene, room: str | None) -> Scene:
        """The scene, to which a floor and the things of a room are added."""
        scene.add(shapes.HalfSpace(), name="floor")
        self._put(scene, self._data["rooms"][room] if room else ())
        return scene

    def _put(self, scene: Scene, things: Sequence[Thing]) -> None:
        for thing in things:
            given = dict(thing)
            name, at, count, by = (given.pop(key, other) for key, other in
                                   (("name", ""), ("at", ()), ("count", 0), ("by", 0.0)))  # fmt: skip
            color = self._data["colors"].get(given.pop("color", ""))
            joints = [kind(**given.pop(key)) for key, kind in (("hinge", Hinge), ("ball", BallJoint)) if key in given]
            moving = {key: given.pop(key) for key in ("density", "mass", "velocity") if key in given}
            shape = getattr(shapes, given.pop("shape"))(**given)
            for place in range(max(count, 1)):
                scene.add(
                    shape, name=f"{name} {place + 1}" if count else name, at=(at[0] + by * place, *at[1:]),
                    color=color, body=Body(joints=joints, **moving) if moving else None,
                )  # fmt: skip

    def _standing_at(self, figure: Figure, pose: str, at: Sequence[float], turn: float = 0.0) -> Array:
        """The figure as it stands, at (x, y) and turned by degrees about z, in a pose; without a side both sides."""
        values = {}
        for name, angle in self._data["poses"][pose].items():
            for joint in (name, f"left_{name}", f"right_{name}"):
                if joint in figure.joints:
                    values[joint] = math.radians(angle)
        q, half = figure.with_joints(figure.posture("standing"), values), 0.5 * math.radians(turn)
        q[:2], q[3:7] = at, (0.0, 0.0, math.sin(half), math.cos(half))
        return figure.clamp(q)


def _hand_at(figure: Figure, glove: str, at: Sequence[float], turn: float = 0.0, curl: float = 0.0) -> Array:
    """The hand in a posture, its wrist at a place, turned by degrees about z, the index bent by radians."""
    q = figure.posture(glove)
    q[:3] = at
    if turn:
        turned = pin.utils.rotate("z", math.radians(turn)) @ pin.Quaternion(q[3:7]).toRotationMatrix()
        q[3:7] = pin.Quaternion(turned).coeffs()
    bent = {name: value + curl for name, value in figure.joint_values(q).items()
            if "index" in name and "flexion" in name}  # fmt: skip
    return figure.clamp(figure.with_joints(q, bent))


def script(
    figure: Figure, keys: Sequence[tuple[float, Array]], *, dt: float = FRAME, seed: int = 0, name: str = "script"
) -> Clip:
    """Move through postures, at rest in each; two equal keys make a pause.

    Between two keys the share of the motion is ``10 s^3 - 15 s^4 + 6 s^5``, the straight movement of least jerk (Flash
    and Hogan 1985, "The Coordination of Arm Movements", J. Neuroscience 5(7)). `keys`: seconds from the key before (the
    first one's are not used), and the posture (nq,).
    """
    frames = [keys[0][1]]
    for (_, before), (seconds, after) in pairwise(keys):
        count = max(1, round(seconds / dt))
        for s in np.arange(1, count + 1) / count:
            frames.append(np.asarray(pin.interpolate(figure.model, before, after, smooth(float(s)))))
    return Clip(figure, _trembling(figure, np.array(frames), dt, np.random.default_rng(seed)), dt, name)


def smooth(s: float) -> float:
    """Share of the motion after the share s of the time."""
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def _trembling(figure: Figure, q: Array, dt: float, rng: np.random.Generator) -> Array:
    """Add slow waves of small amplitude that begin and end at zero."""
    time = dt * np.arange(len(q))
    size = np.zeros(figure.model.nv)
    for joint in figure.joints:
        # rad: amplitude of a tracker's noise and a person's tremor in arms, fingers and neck
        size[figure.dofs(joint)] = 0.0 if any(part in joint for part in ("hip", "knee", "ankle", "toe")) else 2e-3
    shake = np.zeros((len(q), figure.model.nv))
    for _ in range(WAVES):
        rate = 2.0 * np.pi * rng.uniform(0.3, 2.0, figure.model.nv)  # Hz
        shake += np.sin(np.outer(time, rate) + rng.uniform(0.0, 2.0 * np.pi, figure.model.nv))
    ramp = np.minimum(1.0, np.minimum(time, time[::-1]) / 0.5)
    shake *= size / WAVES * ramp[:, None]
    return np.array([figure.clamp(pin.integrate(figure.model, *pair)) for pair in zip(q, shake, strict=True)])


FILE = SceneFile(Path(__file__).with_name("scenes.toml"))

SCENES = FILE.scenes  # descriptions of the scenes, by name; each lasts 600 frames or more

build_scene = FILE.build


def gallery(figure: Figure) -> Scene:
    """A scene with a figure in a gallery: a west room (x from -5 to 0), an east room (0 to 5), and a door between them.

    Walls, a door with a lintel, a niche in the east room, tables, a bench, pedestals, and sculptures on them: a torus,
    a sphere, an egg, an obelisk and a column. All of them are fixed.

    Examples:
        >>> "bench" in wholebody.tracking.gallery(human).objects
        True
    """
    return FILE.furnish(Scene(one_figure(figure, "gallery: figure")), "gallery")

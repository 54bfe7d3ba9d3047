"""Scenes in which things move by themselves: balls, boxes and dominoes that a hand or an avatar meets.

After the experiments of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual
environments" (section 6): a ball flicked off a table by a finger, and rooms with things to push.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import known, posture, whole
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box, Capsule, HalfSpace, Sphere
from wholebody.scene.matter.body import BallJoint, Body, Hinge
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import FRAME
from wholebody.tracking.scripts import Keys, Place, ScenePlan, standing_at
from wholebody.tracking.tracks import MOST_FRAMES, Track

TOP = 0.75  # m: of the table
GAP = 2e-4  # m: that things stand above what bears them at the start, so that they do not begin inside it
WRIST = 0.105  # m: of the wrist above the table, so that bent fingers just clear it
INDEX = 0.018  # m: of the index to the left of the wrist
BLUE, RED, OAK = (0.30, 0.42, 0.58, 1.0), (0.72, 0.25, 0.20, 1.0), (0.60, 0.48, 0.36, 1.0)


@dataclass(frozen=True)
class WorldScene:
    """A scene with a tracker, in which things move by themselves."""

    name: str  # its name on the command line, and one sentence
    about: str
    scene: Scene  # figure and things; those with a `wb.Body` move by themselves
    track: Track  # the tracked postures
    eye: Place | None = None  # the camera and the middle of the picture, metres; None for one that sees the figure
    target: Place | None = None
    see_through: tuple[str, ...] = ()  # things to draw transparent


@dataclass(frozen=True, kw_only=True)
class _Plan(ScenePlan):
    put: Callable[[Scene], object]


def build_world_scene(name: str, *, frames: int | None = None, seed: int = 0, dt: float = FRAME) -> WorldScene:
    """Build a scene of `WORLD_SCENES`.

    Its script is cut or repeated to a number of frames, each dt seconds later; the seed is that of the tracked person's
    tremor.
    """
    known(name, _PLANS, "scene")
    plan = _PLANS[name]
    figure, track = plan.played(name, frames=frames, seed=seed, dt=dt)
    scene = Scene(figure).add(HalfSpace(), name="floor")
    plan.put(scene)
    return WorldScene(name, plan.about, scene, track, plan.eye, plan.target, plan.see_through)


def standing_scene(name: str, scene: Scene, q: Array, *, frames: int, dt: float = FRAME) -> WorldScene:
    """A scene of one's own, in which the figure keeps the posture q (nq,) for a number of frames.

    Raises:
        InputError: nothing in the scene moves by itself, or a value of the wrong kind, shape or range.
    """
    frames = whole(frames, "frames", 1, MOST_FRAMES)
    if not any(thing.body is not None for thing in scene.objects.values()):
        raise InputError(f"{name}: nothing moves by itself; give an object a density or a mass")
    track = Track.of(scene.figure, np.tile(posture(q, scene.model.nq), (frames, 1)), dt, name)
    return WorldScene(name, "things move around a figure that stands", scene, track)


# ---- things


def _table(scene: Scene) -> None:
    thickness = 0.04
    scene.add(Box((0.8, 0.6, thickness)), name="table", at=(0.0, 0.0, TOP - 0.5 * thickness), color=OAK)
    leg = TOP - thickness
    for number, (x, y) in enumerate(((-0.35, -0.25), (-0.35, 0.25), (0.35, -0.25), (0.35, 0.25))):
        scene.add(Box((0.05, 0.05, leg)), name=f"leg {number + 1}", at=(x, y, 0.5 * leg), color=OAK)


def _ball(x: float, radius: float) -> Callable[[Scene], object]:
    def put(scene: Scene) -> None:
        _table(scene)
        scene.add(Sphere(radius), name="ball", at=(x, 0.0, TOP + radius + GAP), color=RED, body=Body(density=700.0))

    return put


def _box_to_push(scene: Scene) -> None:
    _table(scene)
    scene.add(
        Box((0.10, 0.14, 0.08)), name="box", at=(0.0, 0.0, TOP + 0.04 + GAP), color=BLUE, body=Body(density=300.0)
    )


def _dominoes(scene: Scene) -> None:
    _table(scene)
    size = (0.008, 0.024, 0.048)
    for number in range(12):
        at = (-0.05 + 0.028 * number, 0.0, TOP + 0.5 * size[2] + GAP)
        scene.add(Box(size), name=f"domino {number + 1}", at=at, color=BLUE, body=Body(density=700.0))


def _stairs(scene: Scene) -> None:
    tread, width, rise, count = 0.25, 1.0, 0.17, 6
    for number in range(count):
        height = rise * (count - number)
        scene.add(Box((tread, width, height)), name=f"stair {number + 1}", at=(tread * number, 0.0, 0.5 * height))
    body = Body(density=700.0, velocity=(0.6, 0.0, 0.0))
    scene.add(Sphere(0.06), name="ball", at=(0.0, 0.0, rise * count + 0.06 + GAP), color=RED, body=body)


def _things_to_walk_into(scene: Scene) -> None:
    scene.add(Box((0.30, 0.40, 0.50)), name="carton", at=(0.75, -0.1, 0.25 + GAP), color=OAK, body=Body(density=60.0))
    scene.add(
        Box((0.25, 0.30, 0.40)), name="parcel", at=(0.75, -0.1, 0.70 + 2 * GAP), color=BLUE, body=Body(density=60.0)
    )
    scene.add(Sphere(0.12), name="ball", at=(1.15, 0.35, 0.12 + GAP), color=RED, body=Body(density=60.0))


def _door(scene: Scene) -> None:
    width, height = 0.90, 2.00
    x, middle = 0.75, 0.5 * height + 0.01
    hinge = Hinge((0.0, -0.5 * width, 0.0), axis=(0.0, 0.0, 1.0))
    for side in (-1.0, 1.0):
        at = (x, side * (0.5 * width + 0.03 + 0.25), 0.5 * (height + 0.1))
        name = "left wall" if side > 0.0 else "right wall"
        scene.add(Box((0.10, 0.50, height + 0.1)), name=name, at=at, color=OAK)
    scene.add(
        Box((0.04, width, height)), name="door", at=(x, 0.0, middle), color=BLUE, body=Body(mass=12.0, joints=[hinge])
    )


def _bag(scene: Scene) -> None:
    radius, length = 0.17, 0.55
    x, beam, low = 0.75, 2.30, 1.15
    top = low + 0.5 * length + radius
    rope = beam - 0.05 - top
    scene.add(Box((0.10, 1.2, 0.10)), name="beam", at=(x, 0.0, beam), color=OAK)
    scene.add(
        Capsule(0.015, rope - 0.03), name="rope", at=(x, 0.0, top + 0.5 * rope), color=OAK,
        body=Body(mass=1.0, joints=[BallJoint((0.0, 0.0, 0.5 * rope), to="beam")]),
    )  # fmt: skip
    scene.add(
        Capsule(radius, length), name="bag", at=(x, 0.0, low), color=RED,
        body=Body(mass=15.0, joints=[BallJoint((0.0, 0.0, top - low), to="rope")]),
    )  # fmt: skip


def _twenty_things(scene: Scene) -> None:
    slab = (0.05, 0.20, 0.60)
    for number in range(8):
        at = (0.65 + 0.22 * number, -0.15, 0.5 * slab[2] + GAP)
        scene.add(Box(slab), name=f"domino {number + 1}", at=at, color=BLUE, body=Body(density=100.0))
    for number in range(6):
        at = (0.75 + 0.25 * number, 0.035, 0.08 + GAP)
        scene.add(Sphere(0.08), name=f"ball {number + 1}", at=at, color=RED, body=Body(density=60.0))
    for number in range(6):
        size, level = (0.25, 0.30, 0.35), number % 2
        at = (0.7 + 0.5 * (number // 2), 0.27, (level + 0.5) * size[2] + (level + 1) * GAP)
        scene.add(Box(size), name=f"carton {number + 1}", at=at, color=OAK, body=Body(density=60.0))


# ---- the hand: position of the wrist, and the glove


def _hand(figure: Figure, at: Place, glove: str, curl: float = 0.0) -> Array:
    """The hand with fingers forward (x) and palm down, its wrist at a place over the table's middle, the index bent."""
    q = figure.posture(glove)
    q[:3] = at[0], at[1], TOP + at[2]
    bent = {
        name: value + curl for name, value in figure.joint_values(q).items() if "index" in name and "flexion" in name
    }
    return figure.clamp(figure.with_joints(q, bent))


def _flick(figure: Figure) -> Keys:
    def at(x: float, z: float, curl: float) -> Array:
        return _hand(figure, (x, -INDEX, z), "pointing", curl)

    return [
        (0.0, at(0.02, WRIST + 0.12, 0.9)),
        (0.8, at(0.163, WRIST, 0.9)),
        (0.3, at(0.163, WRIST, 0.9)),
        (0.12, at(0.163, WRIST, -0.1)),
        (0.5, at(0.163, WRIST, -0.1)),
        (1.2, at(0.02, WRIST + 0.12, 0.0)),
    ]


def _push(figure: Figure) -> Keys:
    def at(x: float, z: float) -> Array:
        return _hand(figure, (x, 0.0, z), "grip")

    return [
        (0.0, at(-0.45, WRIST + 0.12)),
        (0.8, at(-0.35, WRIST)),
        (1.6, at(0.02, WRIST)),
        (0.5, at(0.02, WRIST)),
        (0.8, at(-0.30, WRIST + 0.05)),
        (0.8, at(-0.45, WRIST + 0.12)),
    ]


def _tap(figure: Figure) -> Keys:
    def at(x: float, z: float) -> Array:
        return _hand(figure, (x, -INDEX, z), "pointing", 0.5)

    return [
        (0.0, at(-0.40, WRIST + 0.12)),
        (0.8, at(-0.26, WRIST)),
        (0.8, at(-0.18, WRIST)),
        (0.4, at(-0.22, WRIST)),
        (1.6, at(-0.40, WRIST + 0.12)),
    ]


def _aside(figure: Figure) -> Keys:
    q = _hand(figure, (-0.6, -0.9, 0.6), "relaxed")
    return [(0.0, q), (4.0, q)]


# ---- the avatar


HANGING = {"shoulder_flexion": 5.0, "elbow_flexion": 15.0}  # degrees: arms
AHEAD = {"shoulder_flexion": 45.0, "elbow_flexion": 50.0, "shoulder_abduction": 8.0}


def _walk_into(figure: Figure) -> Keys:
    return [
        (0.0, standing_at(figure, -0.4, 0.0, 0.0, HANGING)),
        (0.8, standing_at(figure, -0.2, 0.0, 0.0, AHEAD)),
        (2.0, standing_at(figure, 0.7, 0.0, 0.0, AHEAD)),
        (0.8, standing_at(figure, 0.7, 0.0, 0.0, AHEAD)),
        (1.5, standing_at(figure, -0.2, 0.0, 0.0, HANGING)),
        (0.8, standing_at(figure, -0.4, 0.0, 0.0, HANGING)),
    ]


def _walk_through(figure: Figure) -> Keys:
    return [
        (0.0, standing_at(figure, -0.4, 0.0, 0.0, HANGING)),
        (0.8, standing_at(figure, -0.2, 0.0, 0.0, AHEAD)),
        (3.5, standing_at(figure, 1.7, 0.0, 0.0, AHEAD)),
        (0.8, standing_at(figure, 1.9, 0.0, 0.0, HANGING)),
        (1.0, standing_at(figure, 1.9, 0.0, 0.0, HANGING)),
    ]


_PLANS: dict[str, _Plan] = {
    "flick": _Plan(
        "a finger flicks a ball off a table", "hand", _flick, (1.9, -1.5, 1.5), (0.45, 0.0, 0.5), put=_ball(0.30, 0.02)
    ),
    "push_ball": _Plan(
        "a fist pushes a ball along a table", "hand", _push, (1.6, -1.6, 1.6), (0.3, 0.0, 0.5), put=_ball(-0.05, 0.03)
    ),
    "push_box": _Plan(
        "a fist pushes a box along a table", "hand", _push, (0.6, -1.0, 1.35), (0.0, 0.0, 0.72), put=_box_to_push
    ),
    "dominoes": _Plan(
        "a finger pushes the first of a row of dominoes", "hand", _tap, (0.5, -0.7, 1.15), (0.05, 0.0, 0.76),
        put=_dominoes,
    ),
    "stairs": _Plan(
        "a ball rolls down stairs; the hand stays aside", "hand", _aside, (3.6, -3.4, 1.9), (1.1, 0.0, 0.45),
        put=_stairs,
    ),
    "avatar_and_cartons": _Plan(
        "an avatar walks with its hands ahead into two cartons, one on the other, and a ball",
        "avatar", _walk_into, (3.4, -3.4, 1.9), (0.5, 0.0, 0.85), put=_things_to_walk_into,
    ),
    "room": _Plan(
        "an avatar walks with its hands ahead through twenty things: dominoes, balls and cartons upon each other",
        "avatar", _walk_through, (3.6, -3.4, 2.4), (1.1, 0.0, 0.6), put=_twenty_things,
    ),
    "door": _Plan(
        "an avatar walks with its hands ahead against a swinging door, and through it",
        "avatar", _walk_through, (-2.6, 3.0, 2.2), (0.6, 0.0, 0.95), put=_door,
    ),
    "bag": _Plan(
        "an avatar walks with its hands ahead into a bag that hangs from a beam, and back",
        "avatar", _walk_into, (3.4, -3.4, 1.9), (0.4, 0.0, 1.1), put=_bag,
    ),
}  # fmt: skip

WORLD_SCENES: Mapping[str, str] = {name: plan.about for name, plan in _PLANS.items()}
"""Descriptions of the scenes, by name."""

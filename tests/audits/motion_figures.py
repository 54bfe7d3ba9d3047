"""Figures 4.1 to 4.7 of Degenhardt's thesis (2014) redrawn: what a motion is before and after, by each method."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch, make_folder, write
from wholebody.bench import plot_style
from wholebody.bench.measure.motion.cases import RATE
from wholebody.bench.measure.motion.report import STYLES
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Capsule, HalfSpace
from wholebody.methods.solve import solve
from wholebody.motion.avoider import Avoider
from wholebody.motion.batch import avoid_many
from wholebody.motion.batch_table import AvoidedCase
from wholebody.motion.bisection.method import Bisection
from wholebody.motion.checking import check
from wholebody.motion.clip import Clip
from wholebody.motion.frame_terms import Given
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import Equipment, Worn, dressed, equipment
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Freeze, Hold, Point

WALK, JUMP, RISE = "cmu_35_01", "cmu_02_04", "deepmimic_getup_facedown"
METHODS = ("trajectory", "bisection", "frames", "fade")
HANDS = ("right_palm", "left_palm")
CARRIED = ((0.16, -0.19, 0.98), (0.44, 0.06, 1.10))  # m: where the hands hold the weapon, before a standing person
WEAPON = (0.015, 0.75)  # m: radius and length
ARMS = ("right_hand", "left_hand", "right_forearm", "left_forearm")
TILE = (230, 330)  # pixels of a picture
GAP = 4  # pixels between two
COLORS = 96  # of a picture's palette: it is a third of the size
PICTURES = 7
AWAY = 3.5  # m: of the camera from the figure

View = tuple[float, float, float]
FRONT, SIDE, SLANTED = (1.0, 0.12, 0.12), (0.12, -1.0, 0.12), (0.8, 0.7, 0.15)


@dataclass(frozen=True)
class Drawing:
    """A figure of the thesis.

    Attributes:
        number: its number there.
        title: what it shows.
        clip: file name of the recording.
        worn: what the person wears.
        methods: that are compared.
        constraints: what holds in every frame.
        views: directions to the camera; one for a strip of moments, several for one moment.
        span: seconds of the clip, from and to.
        armed: whether both hands carry a weapon.
        feet: whether feet that stand are held.
        shown: method whose answer the picture shows.
    """

    number: str
    title: str
    clip: str
    worn: Callable[[Figure], Worn]
    methods: tuple[str | Avoider, ...] = METHODS
    constraints: tuple[Given, ...] = ()
    views: tuple[View, ...] = (SLANTED,)
    span: tuple[float, float] = (0.0, 1.8)
    armed: bool = False
    feet: bool = True
    shown: str = "trajectory"


def belt(figure: Figure) -> tuple[Equipment, ...]:
    """Pouches that rest on the hips too, into which a crouch presses them."""
    hips = ("pelvis", "left_thigh", "right_thigh")
    return tuple(replace(pouch, rests_on=(*pouch.rests_on, *hips)) for pouch in equipment("pouches", figure))


def weapon(figure: Figure) -> Worn:
    """Pouches, and a rod in the right hand that points to the left one."""
    q = carrying(figure)
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    hand, right, left = (pin.SE3(data.oMf[figure.frame_id(name)]) for name in ("right_hand", *HANDS))
    along = left.translation - right.translation
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
    at = hand.actInv(pin.SE3(turn, right.translation + 0.4 * along))
    rod = Equipment("weapon", Capsule(*WEAPON), "right_hand", at, ARMS, (0.15, 0.15, 0.17, 1.0))
    return ("pouches", rod)


def carrying(figure: Figure) -> Array:
    """A standing person that holds a weapon before the body, with nothing on."""
    held = [Point(hand, at) for hand, at in zip(HANDS, CARRIED, strict=True)]
    still = [Freeze(name) for name in ("root", "lower_body", "spine", "neck")]
    return solve(Problem(Scene(figure), figure.posture("standing"), goals=held, constraints=still)).q


DRAWINGS = (
    Drawing("4.1", "a walk, with a sphere at the torso's side", WALK, lambda _: "side_sphere"),
    Drawing("4.2", "a vertical jump, with a sphere at the torso's side", JUMP, lambda _: "side_sphere",
            span=(0.4, 2.0)),
    Drawing("4.3", "the take-off of the jump, with pouches", JUMP, belt, views=(FRONT, SLANTED),
            span=(0.6, 1.2)),
    Drawing("4.4", "a walk with a weapon in both hands, with pouches, hands free", WALK, weapon, armed=True,
            views=(FRONT, SLANTED), shown="bisection"),
    Drawing("4.5", "the same, with the grip of both hands held", WALK, weapon, armed=True, views=(FRONT, SLANTED),
            constraints=(Hold(HANDS[1], relative_to=HANDS[0]),), shown="bisection"),
    Drawing("4.6", "from prone to standing, all joints free to move", RISE, lambda _: "nothing",
            (*METHODS, Bisection(frozen=())), views=(SIDE, SLANTED), span=(1.4, 2.8), feet=False, shown="bisection 2"),
    Drawing("4.7", "the same, with the feet that stand held", RISE, lambda _: "nothing",
            views=(SIDE, SLANTED), span=(1.4, 2.8), shown="bisection"),
)  # fmt: skip


@dataclass(frozen=True)
class Redrawn:
    """A figure that was drawn.

    Attributes:
        drawing: which.
        strip: picture before (above or left) and after, with the motion before as a ghost.
        curves: chart of the joints that change most, or of what the figure is about.
        rows: what each method reached.
    """

    drawing: Drawing
    strip: Path
    curves: Path
    rows: tuple[AvoidedCase, ...]


def redraw(drawing: Drawing, recordings: Mapping[str, Path], figure: Figure, folder: Path, jobs: int) -> Redrawn:
    """Free the clip of a figure by its methods, and draw it; clips that the folder holds are not freed again.

    Raises:
        InputError: the recording is not there.
        MissingPackageError: there is no Chromium.
    """
    before = _clip(drawing, recordings, figure, folder)
    worn = drawing.worn(figure)
    name = f"figure-{drawing.number.replace('.', '-')}"
    rows = avoid_many(
        [before], folder / name, equipment=[worn], methods=drawing.methods, constraints=drawing.constraints,
        hold_feet=drawing.feet, jobs=jobs,
    )  # fmt: skip
    after = {row.method: read_clip(folder / name / row.file, figure) for row in rows if row.file}
    if drawing.shown not in after:
        raise InputError(f"figure {drawing.number}: there is no clip by {drawing.shown}, which its picture shows")
    shown = after[drawing.shown]
    strip = _strip(drawing, dressed(figure, worn), before, shown, folder / f"{name}.png")
    return Redrawn(drawing, strip, _curves(drawing, before, after, shown, folder / f"{name}-curves")[0], rows)


def _clip(drawing: Drawing, recordings: Mapping[str, Path], figure: Figure, folder: Path) -> Clip:
    if drawing.clip not in recordings:
        raise InputError(f"figure {drawing.number} needs the recording {drawing.clip}; give its folder with --clips")
    kept = folder / "clips" / f"{drawing.clip}.npz"
    if not kept.is_file():
        make_folder(kept.parent)
        read_clip(recordings[drawing.clip], figure).resampled(1.0 / RATE).write(kept)
    clip = read_clip(kept, figure)
    first, last = (round(second * RATE) for second in drawing.span)
    q = np.array(clip.q[first : min(last + 1, len(clip))])
    if drawing.armed:
        columns = [figure.model.joints[figure.joint_id(name)].idx_q for name in figure.groups["arms"]]
        q[:, columns] = carrying(figure)[columns]
    return Clip(figure, q, clip.dt, drawing.clip)


def _strip(drawing: Drawing, scene: Scene, before: Clip, after: Clip, path: Path) -> Path:
    """A row before and a row after for several moments; for one moment, each view before and after beside it."""
    from PIL import Image

    from wholebody.view import Viewer

    scene.add(HalfSpace(offset=-_sunk(before, after)), name="floor")
    if len(drawing.views) == 1:
        frames = np.linspace(0, len(before) - 1, PICTURES).round().astype(int).tolist()
        tiles = [[(frame, drawing.views[0], freed) for frame in frames] for freed in (False, True)]
    else:
        frame = int(np.argmax(np.abs(_change(before, after)).max(axis=1)))
        tiles = [[(frame, view, freed) for view in drawing.views for freed in (False, True)]]
    width, height = TILE
    strip = Image.new("RGB", (len(tiles[0]) * (width + GAP) - GAP, len(tiles) * (height + GAP) - GAP), "white")
    with Viewer(scene, contact_distance=0.0) as viewer, Scratch() as scratch:
        for row, line in enumerate(tiles):
            for column, (frame, view, freed) in enumerate(line):
                viewer.look(*camera(before, frame, view))
                viewer.ghosts([before.q[frame]] if freed else [])
                viewer.show(after.q[frame] if freed else before.q[frame])
                with Image.open(viewer.picture(scratch / "one.png", TILE, legend=False)) as picture:
                    strip.paste(picture, (column * (width + GAP), row * (height + GAP)))
    made = io.BytesIO()
    strip.quantize(COLORS).save(made, format="PNG", optimize=True)
    return write(path, made.getvalue())


def camera(clip: Clip, frame: int, view: View) -> tuple[Array, Array]:
    """Where the camera of a picture is, and what it looks at, metres: the middle of the box around the joints.

    Args:
        clip: that is drawn; in its first frame it faces forward.
        frame: of the picture.
        view: direction to the camera: forward, to the left, up.
    """
    model, data = clip.figure.model, clip.figure.model.createData()
    pin.forwardKinematics(model, data, clip.q[frame])
    places = np.array([at.translation for at in data.oMi][1:])
    middle: Array = 0.5 * (places.min(axis=0) + places.max(axis=0))
    away = _facing(clip.q[0]) @ np.array(view)
    return middle + AWAY * away / np.linalg.norm(view), middle


def _facing(q: Array) -> Array:
    """Rotation about z to where the root faces, or to where its head is if it lies."""
    turn = pin.Quaternion(np.array(q[3:7])).matrix()
    forward = turn[:2, 0]
    if np.linalg.norm(forward) < 0.5:
        forward = turn[:2, 2]
    c, s = forward / np.linalg.norm(forward)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _sunk(*clips: Clip) -> float:
    """How far clips go into the floor, metres: it takes no part in the avoiding, and is drawn below them."""
    floor = Scene(clips[0].figure)
    floor.add(HalfSpace(), name="floor")
    found = [contact for clip in clips for contact in check(clip, floor).contacts]
    return max((contact.deepest for contact in found if "floor" in contact.names), default=0.0)


def _curves(drawing: Drawing, before: Clip, after: Mapping[str, Clip], shown: Clip, path: Path) -> tuple[Path, Path]:
    """The two joints that change most in the picture before and after, and what the figure is about."""
    figure = before.figure
    change = np.abs(_change(before, shown)).max(axis=0)
    columns = {figure.model.joints[figure.joint_id(name)].idx_v: name for name in figure.joints}
    ranked = sorted(columns, key=lambda column: -change[column])[:2]
    drawn, axes = plot_style.figure(1, 3, (11.0, 2.9))
    for axis, column in zip(axes[0], ranked, strict=False):
        place = figure.model.joints[figure.joint_id(columns[column])].idx_q
        axis.plot(
            before.times, np.degrees(before.q[:, place]), color="#000000", linewidth=2.4, alpha=0.35, label="before"
        )
        for method, clip in after.items():
            axis.plot(clip.times, np.degrees(clip.q[:, place]), label=method, **_style(method))
        axis.set_title(f"{columns[column].replace('_', ' ')}, degrees", fontsize=10)
    last = axes[0][2]
    title, measured = _about(drawing, before)
    for method, clip in after.items():
        last.plot(clip.times, 1e3 * measured(clip), **_style(method))
    last.set_title(title, fontsize=10)
    for axis in axes[0]:
        axis.set_xlabel("s")
    drawn.legend(*axes[0][0].get_legend_handles_labels(), loc="outside right upper", fontsize=8, frameon=False)
    return plot_style.save(drawn, path)


def _style(method: str) -> dict[str, Any]:
    if method in STYLES:
        return {"color": STYLES[method][0], "linewidth": 1.1}
    return {"color": STYLES["bisection"][0], "linewidth": 1.1, "linestyle": ":"}


def _about(drawing: Drawing, before: Clip) -> tuple[str, Callable[[Clip], Array]]:
    """Title and measure, metres a frame, of the third chart."""
    rising = drawing.clip == RISE and not drawing.armed
    names = ("left_foot", "right_foot") if rising else HANDS
    stood = _placements(before, names)

    def apart(clip: Clip) -> Array:
        now = _placements(clip, names)
        if drawing.armed:
            places = [(a.actInv(b), c.actInv(d)) for (a, b), (c, d) in zip(now, stood, strict=True)]
            return np.array([np.linalg.norm(here.translation - there.translation) for here, there in places])
        return np.array(
            [max(np.linalg.norm(a.translation - b.translation) for a, b in zip(one, other, strict=True))
             for one, other in zip(now, stood, strict=True)]
        )  # fmt: skip

    if drawing.armed:
        return "left hand from its place on the weapon, mm", apart
    return f"farthest {'foot' if rising else 'hand'} from where it was, mm", apart


def _placements(clip: Clip, names: Sequence[str]) -> list[list[Any]]:
    """Placements of frames in every frame of a clip."""
    model, data, found = clip.figure.model, clip.figure.model.createData(), []
    ids = [clip.figure.frame_id(name) for name in names]
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        found.append([pin.SE3(data.oMf[number]) for number in ids])
    return found


def _change(before: Clip, after: Clip) -> Array:
    """(n, nv) differences of the postures; the root's are left out, as they are larger in other units."""
    model = before.figure.model
    found = np.array([pin.difference(model, *pair) for pair in zip(before.q, after.q, strict=True)])
    found[:, :6] = 0.0
    return found

"""A motion over time as one HTML page: curves beside its recording, and the timeline of a checked clip."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch, templates
from wholebody.motion.checking import ClipCheck, check
from wholebody.motion.clip import Clip
from wholebody.motion.clip_contacts import Contact
from wholebody.motion.clip_torques import torques
from wholebody.motion.footholds import speeds
from wholebody.motion.load_change import load_curves, telling
from wholebody.motion.retargeting import bone_errors
from wholebody.motion.roles import skeleton_roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import has_feet, paths, standing
from wholebody.motion.standing_ground import ground
from wholebody.scene.scene import Scene
from wholebody.view.side_by_side import beside
from wholebody.view.viewer import Viewer

Names: TypeAlias = str | os.PathLike[str] | Mapping[str, Mapping[str, str]]
"""Which joint and frame are which part of a body, as `wb.retarget` takes it."""

RECORDING = "recording"
NEAR = 0.1  # m: distances that are drawn


def motion_curves(
    motion: SkeletonMotion | None, clips: Mapping[str, Clip], scene: Scene, names: Names | None = None
) -> str:
    """HTML of curves and a film of motions, which makes no network requests.

    `motion` is the recorded skeleton, if any; `clips` have as many frames, or an InputError; `scene` is what they
    carry, and what stands around; `names` as for `wb.retarget`.
    """
    first = next(iter(clips.values()))
    with Scratch() as folder, beside(motion, clips, scene, first.name) as viewer:
        page = viewer.save(folder / "film.html").read_text("utf-8")
    loads, said = _loads(clips, scene)
    charts = [*_joints(clips), *_distances(clips, scene), *_slides(motion, clips, names), *_bones(motion, clips, names)]
    charts += loads
    data = {"dt": first.dt, "frames": len(first), "charts": charts}
    named = ([] if motion is None else [RECORDING]) + list(clips)
    page_of = templates(Path(__file__).parent).get_template("motion_curves.html.jinja")
    return page_of.render(clip=first, named=named, said=said, data=data, page=page)


def _chart(title: str, unit: str, lines: Sequence[tuple[str, str, Array]]) -> dict[str, Any]:
    """What the page draws: lines with a name, the motion that they are of, and a value a frame; NaN breaks a line."""
    rows = [
        {"name": name, "of": of, "values": [None if np.isnan(value) else round(float(value), 4) for value in values]}
        for name, of, values in lines
    ]
    return {"title": title, "unit": unit, "lines": rows}


def _joints(clips: Mapping[str, Clip]) -> list[dict[str, Any]]:
    first, lines = next(iter(clips.values())), []
    model = first.figure.model
    places = {name: int(model.joints[first.figure.joint_id(name)].idx_q) for name in first.names}
    ends = first.q, list(clips.values())[-1].q
    ranges, changes = np.ptp(ends[0], axis=0), np.abs(ends[1] - ends[0]).max(axis=0)
    columns = list(places.values())
    telling = ranges / max(ranges[columns].max(), 1e-9) + changes / max(changes[columns].max(), 1e-9)
    for joint in sorted(places, key=lambda name: -telling[places[name]])[:8]:
        for name, clip in clips.items():
            lines.append((joint, name, clip.q[:, places[joint]]))
    return [_chart("joints that move or change most", "rad, m", lines)]


def _distances(clips: Mapping[str, Clip], scene: Scene) -> list[dict[str, Any]]:
    lines, least = [], []
    for name, clip in clips.items():
        found = check(clip, scene)
        between = np.append(found.between, 0.0)
        lines.append(("deepest overlap", name, 1e3 * np.maximum(found.depth, between)))
        if not clip.things:
            least += [(kind, name, 1e3 * values) for kind, values in _least(clip, scene).items()]
    return [
        _chart("deepest overlap in each frame and until the next", "mm", lines),
        *([_chart(f"least distance of parts, below {1e3 * NEAR:g}", "mm", least)] if least else []),
    ]


def _least(clip: Clip, scene: Scene) -> dict[str, Array]:
    """(n,) least signed distance in each frame, metres, of parts of the body, of what it wears, and of things."""
    around = {name: each.segment is None for name, each in scene.objects.items()}
    kinds = ["equipment" if name in around else "body" for name in scene.piece_owner]
    kinds = ["things" if around.get(name) else kind for name, kind in zip(scene.piece_owner, kinds, strict=True)]
    ranks = ("body", "equipment", "things")  # a pair is of the last one of its two
    found = {kind: np.full(len(clip), np.nan) for kind in ranks}
    with scene.borrow() as workspace:
        for frame, q in enumerate(clip.q):
            near = workspace.near(q, NEAR)
            for (first, second), distance in zip(near.pair.tolist(), near.distance.tolist(), strict=True):
                values = found[max(kinds[first], kinds[second], key=ranks.index)]
                values[frame] = np.fmin(values[frame], distance)
    return {kind: values for kind, values in found.items() if not np.isnan(values).all()}


def _slides(motion: SkeletonMotion | None, clips: Mapping[str, Clip], names: Names | None) -> list[dict[str, Any]]:
    lines = []
    if motion is not None:
        joints, rests = skeleton_roles(motion, names), ground(motion, names).rests
        feet = [role for role in rests if role.split("_")[-1] in ("ankle", "toe")]
        lines.append(("feet", RECORDING, _fastest(
            motion.positions[:, [motion.names.index(joints[role]) for role in feet]],
            np.array([rests[role] for role in feet]).reshape(len(feet), -1).T, motion.dt,
        )))  # fmt: skip
    for name, clip in clips.items():
        if has_feet(clip.figure):
            found = standing(clip.figure, clip.q, clip.dt)
            marks = np.array(list(found.values())).T
            lines.append(("feet", name, _fastest(paths(clip.figure, clip.q, tuple(found)), marks, clip.dt)))
    return [_chart("fastest point of a foot that stands", "mm/s", lines)] if lines else []


def _fastest(places: Array, marks: Array, dt: float) -> Array:
    """(n,) greatest speed of points (n, p, 3) that are marked (n, p), mm/s; NaN where none is."""
    fast = np.where(marks, 1e3 * speeds(places, dt), -1.0).max(axis=1, initial=-1.0)
    return np.where(fast < 0.0, np.nan, fast)


def _bones(motion: SkeletonMotion | None, clips: Mapping[str, Clip], names: Names | None) -> list[dict[str, Any]]:
    if motion is None:
        return []
    lines = []
    for name, clip in clips.items():
        errors = np.degrees(np.array(list(bone_errors(motion, clip, names).values())))
        lines += [("median", name, np.median(errors, axis=0)), ("greatest", name, errors.max(axis=0))]
    return [_chart("angle of bones to the recording's", "degrees", lines)]


def _loads(clips: Mapping[str, Clip], scene: Scene) -> tuple[list[dict[str, Any]], str]:
    """Charts of torques, forces and the zero moment point; or none, and why: a figure without mass, or without feet."""
    try:
        found = {name: torques(clip, scene) for name, clip in clips.items()}
    except InputError as error:
        return [], str(error)
    columns = telling(list(found.values()))
    charts = []
    for each in zip(*(load_curves(loads, columns) for loads in found.values()), strict=True):
        lines = [(line, name, values) for name, one in zip(found, each, strict=True) for line, values in one.lines]
        charts += [_chart(each[0].title, each[0].unit, lines)] if lines else []
    return charts, ""


MOST_POSTURES = 1200
"""Postures of the animation: of a longer clip each k-th frame is shown. More make the page larger, 3 kB each."""


def timeline(found: ClipCheck, scene: Scene | None = None) -> str:
    """HTML of a checked clip, which makes no network requests.

    Args:
        found: what `wholebody.check` found.
        scene: the scene that the clip was checked in; the figure alone by default.

    Raises:
        InputError: no check, or a scene of another figure.
    """
    instance(found, ClipCheck, "timeline: found", "give the answer of wb.check(clip)")
    clip = found.clip
    scene = Scene(clip.figure) if scene is None else instance(scene, Scene, "timeline: scene", "give a scene")
    if scene.model.nq != clip.q.shape[1]:
        raise InputError("timeline: the scene is of another figure than the clip; give the one that was checked")
    every = math.ceil(len(clip) / MOST_POSTURES)
    with Viewer(scene, title=clip.name) as viewer, Scratch() as folder:
        viewer.play(clip.q[::every], clip.dt * every)
        page = viewer.save(folder / "clip.html").read_text("utf-8")
    page_of = templates(Path(__file__).parent).get_template("timeline.html.jinja")
    return page_of.render(check=found, clip=clip, contacts=found.contacts, data=_data(found), page=page)


def _data(found: ClipCheck) -> dict[str, Any]:
    """What the page draws: depths in millimetres, those that are not zero, frames and gaps in the order of time."""
    return {
        "frames": len(found.clip),
        "dt": found.clip.dt,
        "tolerance": 1e3 * found.tolerance,
        "rows": [
            {"name": contact.names, "kind": contact.kind, **_cells(contact)} for contact in found.contacts
        ],
    }  # fmt: skip


def _cells(contact: Contact) -> dict[str, Any]:
    times = np.zeros(2 * len(contact.depth) - 1)
    times[::2], times[1::2] = contact.depth, contact.between
    at = np.flatnonzero(times)
    # digits of depths in the page, after the point of millimetres
    return {"at": at.tolist(), "depth": np.round(1e3 * times[at], 4).tolist()}

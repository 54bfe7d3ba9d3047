"""The timeline of a checked clip: one HTML page with the pairs by frames, and the figure at the frame clicked on."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch, templates
from wholebody.motion.checking import ClipCheck
from wholebody.motion.clip_contacts import Contact
from wholebody.scene.scene import Scene
from wholebody.view.viewer import Viewer

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

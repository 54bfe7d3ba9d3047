"""Markers of blockers at their positions: contacts, joints at their limits, held frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.view import drawing
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedContacts, ViewedScene


def mark_blockers(
    keyframe: Keyframe, scene: ViewedScene, state: State, contacts: ViewedContacts, blockers: Sequence[Any]
) -> None:
    """Mark each of the strongest blockers by a ball and its name.

    Args:
        keyframe: the keyframe to which the markers are added.
        scene: the scene.
        state: of the figure at the shown posture.
        contacts: near pairs at that posture.
        blockers: `Blocker`s of an assessment, the strongest first.
    """
    # most blockers that are marked, the strongest; more labels hide each other
    for number, blocker in enumerate(blockers[:4]):
        place = _place(scene, state, contacts, blocker)
        if place is None:
            continue
        root = f"{LOOK.blocker_node}/{number}"
        keyframe.markers[f"{root}/ball"] = (
            Marker("ball", LOOK.blocker, LOOK.blocker_radius),
            drawing.point_placement(place),
        )
        label = Marker("label", LOOK.blocker_label, LOOK.label_size, f"in the way: {blocker}")
        above = drawing.point_placement(place + [0.0, 0.0, 2.0 * LOOK.blocker_radius])
        keyframe.markers[f"{root}/text"] = (label, above)


def _place(scene: ViewedScene, state: State, contacts: ViewedContacts, blocker: Any) -> Array | None:
    """Position of a blocker (3,), or None for one without a position, such as a balance."""
    if blocker.kind == "contact":
        owners = scene.piece_owner
        for row, (a, b) in enumerate(np.asarray(contacts.pair)):
            if {owners[a], owners[b]} == set(blocker.names):
                return np.asarray(0.5 * (contacts.point_a[row] + contacts.point_b[row]))
        return None
    if blocker.kind == "constraint":
        frame = blocker.frame
        if frame is None:
            return None
        frame_id = scene.model.getFrameId(frame)
        joint = scene.model.frames[frame_id].parentJoint
        return np.array(state.data.oMi[joint].act(scene.model.frames[frame_id].placement.translation))
    return np.array(state.data.oMi[scene.model.getJointId(blocker.names[0])].translation)

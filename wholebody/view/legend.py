"""The panel of the page: the title, what the picture says in one line, and the meaning of the colours that occur."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any

from wholebody.assessment.posture import Assessment
from wholebody.geometry.proximity import PENETRATION
from wholebody.view.commands import pack
from wholebody.view.scene_graph import Keyframe
from wholebody.view.server import Command, Op
from wholebody.view.style import LOOK


def legend(keyframes: Sequence[Keyframe]) -> list[tuple[str, Any]]:
    """Meanings and colours (red, green, blue) of what occurs in any of the keyframes."""
    found: dict[str, Any] = {}
    if any(keyframe.touching for keyframe in keyframes):
        found["touches"] = LOOK.contact[:3]
    if any(keyframe.overlapping for keyframe in keyframes):
        found["overlaps"] = LOOK.penetration[:3]
    paths = {path for keyframe in keyframes for path in keyframe.markers}
    marked = (  # end of a marker's node, its folder, its colour and its meaning
        ("/normal", LOOK.contact_node, LOOK.normal, "normal of a contact"),
        ("/depth", LOOK.contact_node, LOOK.depth, "way out of an overlap"),
        ("/first", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/second", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/cancelled", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/target", LOOK.goal_node, LOOK.target, "goal, and the way to it"),
        ("/wanted", LOOK.goal_node, LOOK.target, "goal, and the way to it"),
        ("/ball", LOOK.blocker_node, LOOK.blocker, "in the way"),
    )
    for end, folder, shade, meaning in marked:
        if any(path.startswith(folder) and path.endswith(end) for path in paths):
            found[meaning] = shade
    return list(found.items())


def status(keyframes: Sequence[Keyframe], count: int, dt: float, found: Assessment | None) -> str:
    """One line about what is shown: postures `dt` s apart, their ways as keyframes, or the only one's fit."""
    said = [f"{count} postures, {(count - 1) * dt:.2f} s"] if count > 1 else []
    if found is not None and found.goal_errors:
        # radians: smaller angles are not told
        angle = f", {degrees(found.goal_angle):.1f}°" if found.goal_angle > 1e-3 else ""
        said.append(f"goals missed by at most {1e3 * found.goal_error:.1f} mm{angle}")
    if not all(keyframe.contacts_shown for keyframe in keyframes):
        return "; ".join(said)
    touching = max(keyframe.touching + keyframe.overlapping for keyframe in keyframes)
    said.append(f"{'at most ' if len(keyframes) > 1 else ''}{touching} contact{'' if touching == 1 else 's'}")
    deepest = max(keyframe.overlap for keyframe in keyframes)
    said.append(f"deepest overlap {1e3 * deepest:.1f} mm" if deepest > PENETRATION else "no overlap")
    return "; ".join(said)


def panel(title: str, keyframes: Sequence[Keyframe], count: int, dt: float, found: Assessment | None = None) -> Command:
    """The command that puts the panel on the page; the arguments are those of `status`, and the page's title."""
    rows = [[meaning, *(round(255 * float(part)) for part in color)] for meaning, color in legend(keyframes)]
    message = {"type": "panel", "title": title, "status": status(keyframes, count, dt, found), "legend": rows}
    return Command(Op.OBJECT, "/panel", "", pack(message))  # node under which the page keeps it; nothing is drawn there

"""Which joint of a skeleton and which frame of a figure are the same part of a body."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import NamedTuple

from wholebody.base.checks import path as checked_path
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.files import parsed_toml, read_text
from wholebody.figures.figure import Figure

SIDED = ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "wrist", "hand")
ROLES = ("pelvis", "chest", "neck", "head", *(f"{side}_{part}" for side in ("left", "right") for part in SIDED))
"""Parts of a body that skeletons and figures have in common. Each but the pelvis may be absent."""

_CMU = {
    "pelvis": "root", "chest": "thorax", "neck": "lowerneck", "head": "head",
    "hip": "femur", "knee": "tibia", "ankle": "foot", "toe": "toes",
    "shoulder": "humerus", "elbow": "radius", "wrist": "wrist", "hand": "fingers",
}  # fmt: skip
_MOTION_BUILDER = {
    "pelvis": "Hips", "chest": "Spine1", "neck": "Neck1", "head": "Head",
    "hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "toe": "ToeBase",
    "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand", "hand": "HandIndex1",
}  # fmt: skip
_MIXAMO = {**_MOTION_BUILDER, "chest": "Spine2", "neck": "Neck", "hand": "HandMiddle1"}
_LAFAN1 = {**_MIXAMO, "toe": "Toe", "hand": "Hand_end"}
_SMPL = {
    "pelvis": "pelvis", "chest": "spine3", "neck": "neck", "head": "head",
    "hip": "hip", "knee": "knee", "ankle": "ankle", "toe": "foot",
    "shoulder": "shoulder", "elbow": "elbow", "wrist": "wrist", "hand": "hand",
}  # fmt: skip
_PLAIN = {**_SMPL, "pelvis": "root", "chest": "chest", "neck": "", "head": "neck", "toe": "", "hand": "wrist_end"}

_OWN = {
    **_SMPL, "chest": "thorax",
    "hip": "thigh", "knee": "shank", "ankle": "foot", "toe": "toes",
    "shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand", "hand": "hand_end",
}  # fmt: skip


def _both(table: Mapping[str, str], name: str) -> dict[str, str]:
    """Names of all roles from those of one side; `name` has {side}, {Side} or {s} where the side stands."""
    said = {}
    for role in ROLES:
        side, _, part = role.partition("_")
        if part in SIDED:
            said[role] = name.format(side=side, Side=side.capitalize(), s=side[0], part=table[part])
        else:
            said[role] = table[role]
    return said


TABLES: dict[str, dict[str, str]] = {
    "CMU": _both(_CMU, "{s}{part}"),
    "Mixamo": _both(_MIXAMO, "{Side}{part}"),
    "LAFAN1": _both(_LAFAN1, "{Side}{part}"),
    "MotionBuilder": _both(_MOTION_BUILDER, "{Side}{part}"),
    "SMPL": _both(_SMPL, "{side}_{part}"),
    "DeepMimic": _both(_PLAIN, "{side}_{part}"),
    "wholebody": _both(_OWN, "{side}_{part}"),
}
"""Names of joints by role, of the skeletons that files of motion capture have."""

NEEDED = 6
"""Least number of roles that a table must name in a skeleton to be taken."""

PREFIX = re.compile(r"^.*[:|]")
"""Name space before a joint's name, such as mixamorig: ."""

SIDE = {
    "left": re.compile(r"left|(?<![a-z])l(?![a-z])"),
    "right": re.compile(r"right|(?<![a-z])r(?![a-z])"),
}
"""How the joints of robots say their side."""

HUMAN = {
    "pelvis": "pelvis", "chest": "thorax", "neck": "neck1_flexion", "head": "head",
    **{f"{side}_{part}": f"{side}_{part}" for side in ("left", "right") for part in SIDED[:3] + SIDED[4:7]},
    **{f"{side}_toe": f"{side}_toe_extension" for side in ("left", "right")},
    **{f"{side}_hand": f"{side}_index_tip" for side in ("left", "right")},
}  # fmt: skip
"""Frames of the person and of the avatar."""


HUMAN_TURNS = {
    "pelvis": "pelvis", "head": "head",
    **{f"{side}_ankle": f"{side}_foot" for side in ("left", "right")},
    **{f"{side}_hand": f"{side}_hand" for side in ("left", "right")},
}  # fmt: skip
"""Segments of the person and of the avatar that have a role's orientation."""


class Roles(NamedTuple):
    """What has which role.

    Attributes:
        joints: role to joint of the skeleton.
        frames: role to frame of the figure.
        turns: role to the frame of the figure that has the orientation of the role.
        table: name of the table that matched the skeleton.
    """

    joints: dict[str, str]
    frames: dict[str, str]
    turns: dict[str, str]
    table: str


def matched(
    joints: tuple[str, ...], figure: Figure, names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None
) -> Roles:
    """The roles that a skeleton and a figure have in common.

    Args:
        joints: names of the skeleton.
        figure: the figure.
        names: a TOML file or a mapping with tables `skeleton` and `figure`, each role to name; what it leaves out is
            matched by the tables of this module.

    Raises:
        UnknownNameError: a role, a joint or a frame that does not exist.
        FileFormatError: the file cannot be read.
        InputError: less than two roles are common to both.
    """
    given = _given(names)
    table, found = _recognised(joints)
    said = _checked(given.get("skeleton", {}), joints, "joint of the skeleton")
    found = {role: joint for role, joint in found.items() if joint not in said.values()} | said
    frames = _frames(figure)
    frames |= {
        role: frame
        for role, frame in _checked(given.get("figure", {}), None, "frame").items()
        if figure.frame_id(frame) >= 0
    }
    common = [role for role in ROLES if role in found and role in frames]
    if len(common) < 2:
        what = f"the skeleton has {', '.join(joints[:5])}, ..." if not found else f"{figure.name} names none of them"
        raise InputError(
            f"no bones of the skeleton are known to belong to {figure.name} ({what}); name them in a TOML file with "
            "the tables [skeleton] and [figure]"
        )
    segments = HUMAN_TURNS if set(HUMAN_TURNS.values()) <= set(figure.segments) else {}
    return Roles(
        {role: found[role] for role in common},
        {role: frames[role] for role in common},
        {role: segments.get(role, frames[role]) for role in common},
        table,
    )


def _recognised(joints: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """The table that names most joints, and those."""
    plain = {PREFIX.sub("", joint).lower(): joint for joint in reversed(joints)}
    best: tuple[str, dict[str, str]] = ("", {})
    for title, table in TABLES.items():
        found = {role: plain[name.lower()] for role, name in table.items() if name.lower() in plain}
        if len(found) >= NEEDED and len(found) > len(best[1]):
            best = title, found
    return best


def _frames(figure: Figure) -> dict[str, str]:
    """Frames of a figure by role: those of the person, or of a robot whose joints are named after parts of a body."""
    known = {*figure.frames, *figure.segments, *figure.joints}
    if all(frame in known for frame in HUMAN.values()):
        return dict(HUMAN)
    found: dict[str, str] = {}
    for joint in figure.joints:
        words = joint.lower()
        side = next((side for side, pattern in SIDE.items() if pattern.search(words)), "")
        part = next((part for part in SIDED if part in words), "")
        # Of several joints at a hip, a shoulder or an ankle the last one is where they meet; of a wrist the first.
        if side and part and (part in ("hip", "shoulder", "ankle") or f"{side}_{part}" not in found):
            found[f"{side}_{part}"] = joint
    if figure.root == "free":
        found["pelvis"] = figure.segments[0]
    return found


def _given(names: object) -> dict[str, Mapping[str, str]]:
    if names is None:
        return {}
    if not isinstance(names, Mapping):
        path = checked_path(names, "names")
        names = parsed_toml(read_text(path, "names of bones"), path.name)
    for key, table in names.items():
        if key not in ("skeleton", "figure"):
            raise UnknownNameError("table", str(key), ("skeleton", "figure"), "names of bones")
        if not isinstance(table, Mapping):
            raise InputError(
                f'names of bones: {key} is {shown(table)}; give names by role, such as left_knee = "LeftLeg"'
            )
    return dict(names)


def _checked(table: Mapping[str, str], known: tuple[str, ...] | None, kind: str) -> dict[str, str]:
    for role, name in table.items():
        if role not in ROLES:
            raise UnknownNameError("part of a body", str(role), ROLES, "names of bones")
        if not isinstance(name, str):
            raise InputError(f"names of bones: {role} is {shown(name)}; give the name of a {kind}")
        if known is not None and name not in known:
            raise UnknownNameError(kind, name, known, "names of bones")
    return dict(table)

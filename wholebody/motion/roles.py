"""Which joint of a skeleton and which frame of a figure are the same part of a body."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import path as checked_path
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.files import packaged_table, parsed_toml, read_text
from wholebody.figures.figure import Figure
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.structure import LIMBS, built, built_figure, side_of

ROWS = packaged_table(Path(__file__).parent / "data" / "roles.csv")

ROLES = tuple(row["role"] for row in ROWS)
"""Parts of a body that skeletons and figures have in common. Each but the pelvis may be absent."""


class Roles(NamedTuple):
    """What has which role."""

    joints: dict[str, str]  # role to joint of the skeleton
    frames: dict[str, str]  # role to frame of the figure
    turns: dict[str, str]  # role to the frame of the figure that has the orientation of the role
    # roles of the figure that no joint of the skeleton is known to have, if there are others to name
    missing: tuple[str, ...] = ()
    by_structure: tuple[str, ...] = ()  # roles whose joints are known by the skeleton's structure alone
    # where in its frame (3,) a part is that is not at it, metres: a wrist of which the forearm ends without a joint, a
    # hip beside its thigh
    ends: Mapping[str, Array] = MappingProxyType({})

    def places(self, figure: Figure) -> dict[str, tuple[int, Array]]:
        """Joint of the figure that carries each role, and where (3,) it is in it, metres."""
        frames = {role: figure.model.frames[figure.frame_id(name)] for role, name in self.frames.items()}
        return {
            role: (int(frame.parentJoint), frame.placement.act(self.ends.get(role, np.zeros(3))))
            for role, frame in frames.items()
        }


def matched(
    motion: SkeletonMotion, figure: Figure, names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None
) -> Roles:
    """The roles that skeleton and figure have in common, by `names` (tables `skeleton` and `figure`) or structure."""
    given = _given(names)
    found, more, said = _joints(motion, given)
    frames = figure_roles(figure)
    frames |= {
        role: frame
        for role, frame in _checked(given.get("figure", {}), None, "frame").items()
        if figure.frame_id(frame) >= 0
    }
    common = [role for role in ROLES if role in found and role in frames]
    if len(common) < 2:
        what = (
            f"the skeleton has {', '.join(motion.names[:5])}, ..." if not found else f"{figure.name} names none of them"
        )
        raise InputError(
            f"no bones of the skeleton are known to belong to {figure.name} ({what}); name them in a TOML file with "
            "the tables [skeleton] and [figure]"
        )
    asked = () if said and set(motion.names) <= set(found.values()) else ROLES  # every joint is named
    segments = _column("person_turn")
    segments = segments if set(segments.values()) <= set(figure.segments) else {}
    return Roles(
        {role: found[role] for role in common},
        {role: frames[role] for role in common},
        {role: segments.get(role, frames[role]) for role in common},
        tuple(role for role in asked if role in frames and role not in found),
        tuple(role for role in common if role in more),
        _ends(figure, {role: frames[role] for role in common}),
    )


def _ends(figure: Figure, frames: Mapping[str, str]) -> dict[str, Array]:
    """Where parts are that are known by structure and not at their joints."""
    parts = built_figure(figure)
    return {role: parts[role].place for role, name in frames.items() if role in parts and parts[role].joint == name}


def skeleton_roles(
    motion: SkeletonMotion, names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None
) -> dict[str, str]:
    """Role to joint of a skeleton, of all roles that are known; `names` and errors as for `matched`."""
    return _joints(motion, _given(names))[0]


def _joints(
    motion: SkeletonMotion, given: Mapping[str, Mapping[str, str]]
) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Role to joint of all that are known, of those by structure, and of those given."""
    found = _next_to(motion, _recognised(motion.names))
    said = _checked(given.get("skeleton", {}), motion.names, "joint of the skeleton")
    found = {role: joint for role, joint in found.items() if joint not in said.values()} | said
    more = {} if said or set(ROLES) <= found.keys() else _by_structure(motion, found)
    return found | more, more, said


def _by_structure(motion: SkeletonMotion, known: Mapping[str, str]) -> dict[str, str]:
    """Joints of roles that no names tell: all where none are known, else those between known ones that agree."""
    found = built(motion)
    same = [found.get(role) == joint for role, joint in known.items() if role not in ("chest", "neck", "head")]
    if not known:
        return found
    if sum(same) < 0.7 * len(same):
        return {}
    return {role: joint for role, joint in found.items() if role not in known and joint not in known.values()}


def _recognised(joints: tuple[str, ...]) -> dict[str, str]:
    """Role to joint by the column of the table that names most joints, six or more."""
    plain = {_plain(joint): joint for joint in reversed(joints)}
    best = dict[str, str]()
    for title in ROWS[0]:
        if title in ("role", "person", "person_turn"):  # no skeletons
            continue
        found = {role: plain[_plain(name)] for role, name in _column(title).items() if _plain(name) in plain}
        if len(found) >= 6 and len(found) > len(best):
            best = found
    return best


def _next_to(motion: SkeletonMotion, found: Mapping[str, str]) -> dict[str, str]:
    """The same roles, with what alone goes on from a knee or elbow as ankle or wrist, whatever its name."""
    nearer = {"toe": ("knee", "ankle"), "hand": ("elbow", "wrist")}
    renamed = {}
    for role, joint in found.items():
        side, _, part = role.partition("_")
        before, here = (f"{side}_{other}" for other in nearer.get(part, (part, part)))
        parent = motion.parents[motion.names.index(joint)]
        own = here not in found and parent >= 0 and motion.names[parent] == found.get(before)
        renamed[here if own else role] = joint
    above = [motion.names[parent] if parent >= 0 else "" for parent in motion.parents]
    for joint in (name for name in motion.names if not name.endswith("_end")):  # no end site
        for side, (before, here) in product(("left", "right"), nearer.values()):
            alone = (
                above[motion.names.index(joint)] == renamed.get(f"{side}_{before}") and joint not in renamed.values()
            )
            if alone and f"{side}_{here}" not in renamed and above.count(renamed[f"{side}_{before}"]) == 1:
                renamed[f"{side}_{here}"] = joint
    return renamed


def _plain(joint: str) -> str:
    """A name in small letters, without a name space such as mixamorig:, blanks and strokes, and zeros of "Bip001"."""
    return re.sub(r"bip0*(\d)", r"bip\1", re.sub(r"[^a-z0-9]", "", re.sub(r"^.*[:|]", "", joint).lower()))


def _column(title: str) -> dict[str, str]:
    """Role to name, of the roles that a column of the table names."""
    return {row["role"]: row[title] for row in ROWS if row[title]}


def figure_roles(figure: Figure) -> dict[str, str]:
    """Frames of a figure by role: those of the person, or of a robot whose joints are named after parts of a body."""
    known = {*figure.frames, *figure.segments, *figure.joints}
    person = _column("person")
    if set(person.values()) <= known:
        return person
    found: dict[str, str] = {}
    parts = [role.removeprefix("left_") for role in ROLES if role.startswith("left_")]
    for joint in figure.joints:
        side = ("", "left", "right")[side_of(joint)]
        part = next((part for part in parts if part in joint.lower()), "")
        # Of several joints at a hip, a shoulder or an ankle the last one is where they meet; of a wrist the first.
        if side and part and (part in ("hip", "shoulder", "ankle") or f"{side}_{part}" not in found):
            found[f"{side}_{part}"] = joint
    # one name alone tells no limb: RR_hip_joint is of the rear legs of a quadruped
    found = {role: joint for role, joint in found.items() if _limb_of(role) & found.keys() - {role}}
    # where its links are says more than names: a yaw of a shoulder may be at the elbow, and a hand be the wrist
    structure = {role: part.joint for role, part in built_figure(figure).items()}
    named = {joint: role for role, joint in found.items()}
    if any(joint in named and role not in _limb_of(named[joint]) for role, joint in structure.items()):
        structure = {}  # of a trunk on a table the arms are lowest
    if structure:  # joints that are named after a hand are those of fingers
        found = {role: joint for role, joint in found.items() if role.split("_")[-1] != "hand"}
    found = {role: joint for role, joint in found.items() if joint not in structure.values()} | structure
    if figure.root == "free":
        links = (*figure.segments, *figure.frames)  # a root link without a shape is no segment
        found["pelvis"] = next(name for name in links if figure.model.frames[figure.frame_id(name)].parentJoint == 1)
    return found


def _limb_of(role: str) -> set[str]:
    """Roles of the joints of a limb of which a role is one."""
    side, part = role.split("_")
    return {f"{side}_{each}" for limb in LIMBS if part in limb for each in limb}


def column_names(names: object, figure: Figure) -> dict[str, str]:
    """Joint of a figure, or "time", to its column in a table, of the table `columns` of names; see `matched`."""
    known = ("time", *figure.joints)
    for joint, column in (found := dict(_given(names).get("columns", {}))).items():
        if joint not in known:
            raise UnknownNameError("joint", str(joint), known, "names of columns")
        if not isinstance(column, str):
            raise InputError(f"names of columns: {joint} is {shown(column)}; give the name of a column")
    return found


def _given(names: object) -> dict[str, Mapping[str, str]]:
    if names is None:
        return {}
    if not isinstance(names, Mapping):
        path = checked_path(names, "names")
        names = parsed_toml(read_text(path, "names of bones"), path.name)
    for key, table in names.items():
        if key not in ("skeleton", "figure", "columns"):
            raise UnknownNameError("table", str(key), ("skeleton", "figure", "columns"), "names of bones")
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

"""A posture outside of things from one where contact normals cancel.

Rows of two pieces of one segment that overlap one thing from opposite sides add up to nothing, and no descent leaves,
although a translation does: the least that separates all pieces of the two (`wholebody.geometry.penetration`; figure 4b
of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual environments").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross
from wholebody.geometry.penetration import global_depth, least_separation
from wholebody.geometry.proximity import Contacts
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.bounds import allowed

CANCELLED = 0.1  # share of the deepest overlap below which what all normals together push with counts as none
STEPS = 12  # most steps of least squares
ROOM = 1e-4  # m: that the two are moved apart beyond touching


class _Group(NamedTuple):
    """Two owners of pieces, the joints that carry their overlapping pieces, and the overlaps' rows in the contacts."""

    owners: tuple[str, str]
    joints: tuple[int, int]
    rows: list[int]


def posture_apart(problem: Problem, workspace: Workspace, q: Array) -> Array | None:
    """A posture (nq,) that separates objects whose normals cancel at q; None if none cancel or none separates them."""
    near = workspace.near(q, 0.0)
    for group in _groups(workspace, near):
        depth = -near.distance[group.rows]
        push = global_depth(depth, near.normal[group.rows])
        # of pieces that overlap; more take longer to separate than other starts
        if float(np.linalg.norm(push)) <= CANCELLED * float(depth.max()) and len(group.rows) <= 16:
            way = _separation(workspace, near, group.owners)
            if way is not None:
                return _moved(problem, workspace, q, group.joints, way)
    return None


def _groups(workspace: Workspace, near: Contacts) -> list[_Group]:
    """Every two owners with two and more overlaps, those with the deepest first."""
    joints, owners = workspace.table.joint, workspace.owners
    found: dict[tuple[str, str, int, int], list[int]] = {}
    for row in np.argsort(near.distance, kind="stable").tolist():
        if near.distance[row] < 0.0:
            a, b = near.pair[row].tolist()
            found.setdefault((owners[a], owners[b], int(joints[a]), int(joints[b])), []).append(row)
    return [_Group(key[:2], key[2:], rows) for key, rows in found.items() if len(rows) > 1]


def _separation(workspace: Workspace, near: Contacts, owners: tuple[str, str]) -> Array | None:
    """Least translation (3,) of the first owner's pieces out of the second's, with some room; None if there is none."""
    pieces = workspace.geometry.geometryObjects
    both = [[k for k, owner in enumerate(workspace.owners) if owner == name] for name in owners]
    tested = {(a, b) for a, b in workspace.table.pairs.tolist()}
    allowed = np.array([[(a, b) in tested or (b, a) in tested for b in both[1]] for a in both[0]])
    placed = [
        [(pieces[k].geometry, pin.SE3(near.placements[k, :3].T, near.placements[k, 3])) for k in of] for of in both
    ]
    way = least_separation(placed[0], placed[1], allowed)
    length = float(np.linalg.norm(way.translation))
    return way.translation * (1.0 + ROOM / length) if way.separated and length > 0.0 else None


def _moved(problem: Problem, workspace: Workspace, q: Array, joints: tuple[int, int], way: Array) -> Array:
    """The posture with the first joint moved by `way` (3,) relative to the second, and turned little."""
    state, model, figure = workspace.state.update(q), workspace.model, problem.scene.figure
    begun = [state.data.oMi[joint].copy() for joint in joints]
    wanted = pin.SE3(begun[0].rotation, begun[0].translation + way)
    joint, against = (np.full(6, each, dtype=np.intp) for each in joints)
    for _ in range(STEPS):
        here, other = (state.data.oMi[each].copy() for each in joints)
        target = other * begun[1].actInv(wanted)
        error = np.concatenate([target.translation - here.translation, pin.log3(target.rotation @ here.rotation.T)])
        if float(np.abs(error[:3]).max()) <= ROOM:
            break
        turning = cross(here.translation, np.eye(3))
        wrenches = np.block([[np.eye(3), turning], [np.zeros((3, 3)), np.eye(3)]])
        rows = state.rows(wrenches, joint, against)
        # added to the squared singular values, m^2; more: steps fall short near stretched limbs
        step = rows.T @ np.linalg.solve(rows @ rows.T + 1e-3 * np.eye(6), error)
        # rad, m: of a degree of freedom in one of them
        step *= min(1.0, 0.2 / max(float(np.abs(step).max()), ROOM))
        lower, upper = allowed(problem.bounds, figure.limits, state, None)
        q = figure.clamp(pin.integrate(model, q, np.clip(step, np.minimum(lower, 0.0), np.maximum(upper, 0.0))))
        state.update(q)
    return q

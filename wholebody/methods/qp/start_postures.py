"""Start postures: on the open side of the faces that surfaces are to meet, and out of things whose normals cancel."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross, with_values
from wholebody.figures.state import State
from wholebody.geometry.penetration import global_depth, way_out
from wholebody.geometry.proximity import Contacts
from wholebody.methods.qp.closest import ENDLESS
from wholebody.methods.qp.feasibility import Feasibility
from wholebody.methods.qp.iterates import LocalSolution, Run
from wholebody.methods.qp.settings import SEARCH
from wholebody.methods.qp.sqp import SQP
from wholebody.methods.starts import alike, halfway, least_effort, restarts
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.base import Goal, filled
from wholebody.tasks.bounds import allowed
from wholebody.tasks.contact_parts import Gap, Near, approached, has_face
from wholebody.tasks.frame import Frame, PlacementResidual
from wholebody.tasks.grips import Opposing, opened, takes_bar
from wholebody.tasks.inputs import Place
from wholebody.tasks.point import Point
from wholebody.tasks.surfaces import nearest
from wholebody.tasks.touch import Touch, on_its_side

IN_FRONT = 0.01  # m: how far surfaces are in front of faces; more: reached by fewer limbs, and farther from the contact


def before_contact(
    problem: Problem, shared: Run, seed: int, most: int, *, grips: bool = False, begin: Sequence[Array] | None = None
) -> Iterator[LocalSolution]:
    """Descents to surfaces in front of what they are to touch or, with `grips`, to bars in front of palms too.

    They begin at `begin`, or where that is not given at the problem's start and others.
    """
    terms, start = (*problem.goals, *problem.constraints), problem.scene.figure.clamp(problem.start)
    state = shared.lineariser.state.update(start)
    faces, bars = any(_at_no_face(term, state) for term in terms), any(takes_bar(term) for term in terms)
    fingers = any(isinstance(part, Opposing) for term in terms for part in getattr(term, "parts", ()))
    if grips and (not bars or (faces and not fingers)):
        return

    def in_front(given: Sequence[Any]) -> list[Any]:
        beside = [on_its_side(term, problem.scene, state, IN_FRONT) for term in given]
        return [approached(opened(term, IN_FRONT) if grips else term, IN_FRONT) for term in beside]

    goals, constraints = in_front(problem.goals), in_front(problem.constraints)
    sides = any(isinstance(a, Touch) and a is not b for a, b in zip((*goals, *constraints), terms, strict=True))
    if not (grips or faces or (sides and not bars)):
        return
    # The measures count: without contacts, they determine what the terms leave free. Where a point is to come to its
    # side of a thing, limbs first go around that.
    runs, figure = list[Run](), problem.scene.figure
    for depth in (SEARCH.rest_depth, 0.0) if sides else (ENDLESS,):
        lineariser = shared.lineariser.relaxed(depth)
        lineariser.take(goals, lineariser.clearances, constraints)
        runs.append(with_values(shared, lineariser=lineariser))

    def led(q: Array) -> LocalSolution:
        for run in runs:  # to 1 mm or mrad: what is exact there is not where surfaces meet
            given = run, 1e-3, 40, "before contact"
            local = (Feasibility(*given, figure=figure) if sides else SQP(*given, full_step=True)).run(q)
            q = local.q
        return local

    # descents from the start and from others, at most; of a driver in 30 one in ten is met; fingers close slowly
    count = 3 if grips else 24
    others = restarts(problem, shared.lineariser.state, start, np.random.default_rng(seed), count - 1)
    ends, missed = list[float](), list[LocalSolution]()
    usual = chain(least_effort(problem, state), [start], [halfway(problem, state, start)] if sides else [], others)
    for q in usual if begin is None else begin:
        local = led(q)
        # m, rad: nearer ends lead to the contacts; of the others, which take ten times as long, one in ten does
        if local.violation.worst <= 0.01:
            yield with_values(local, iterations=local.iterations + sum(each.iterations for each in missed))
            missed = []
        else:
            missed.append(local)
            ends.append(local.violation.total)
        if alike(ends) or shared.control.over or len(shared.trace) >= most:
            break
    if missed and not alike(ends):
        nearest = min(missed, key=lambda each: each.violation.total)
        yield with_values(nearest, iterations=sum(each.iterations for each in missed))


def _at_no_face(term: Any, state: State) -> bool:
    """Whether a term is to bring surfaces to faces at which they are not: who stands stays on the floor."""
    parts = getattr(term, "parts", ()) if has_face(term) else ()
    gaps = [part.rows(state)[0] for part in parts if isinstance(part, (Gap, Near)) and part.face is not None]
    return any(np.abs(gap).max() > IN_FRONT for gap in gaps)


def at_its_place(problem: Problem, state: State) -> Problem | None:
    """The problem that asks for the places of its contacts at a state; None where fingers close around a thing."""
    # A contact that turns a frame becomes its goal, another one a point's; other constraints stay. Rows of contacts
    # bend and have kinks: where a descent to the place ends lower, the answer was one, or another local minimum.
    terms: list[Any] = [term for term in (*problem.goals, *problem.constraints) if _slides(term)]
    if not terms or any(isinstance(part, Opposing) for term in terms for part in term.parts):
        return None
    result = copy.copy(problem)
    others = [goal for goal in problem.goals if not _slides(goal)]
    result.goals = (*others, *(goal for term in terms for goal in _places(problem, term, state)))
    kept = [(each, _beside(each)) for each in problem.constraints]
    result.constraints = tuple(filled(each, parts=rest) if rest else each for each, rest in kept if rest != ())
    return result


def _slides(term: Any) -> bool:
    """Whether a term is a contact whose place is open."""
    return hasattr(term, "touches") and any(isinstance(part, (Gap, Near)) for part in term.parts)


def _beside(term: Any) -> tuple[Any, ...] | None:
    """The parts of a contact that are not about its place; None for another term."""
    if not _slides(term):
        return None
    return tuple(part for part in term.parts if not hasattr(part, "place") and not isinstance(part, (Gap, Near)))


def _places(problem: Problem, term: Any, state: State) -> list[Goal]:
    """Resolved goals for where a contact's frames are, or its point on all that moves."""
    names, frames = problem.scene.model.names, problem.scene.model.frames
    turned: dict[int, Any] = {part.place.frame: part.place for part in term.parts if hasattr(part, "place")}
    found: list[Goal] = []
    for place in turned.values():
        at = pin.SE3(state.frame(place.frame))
        found.append(filled(Frame(names[place.joint], at), residual=PlacementResidual(place, at)))
    gap = next(part for part in term.parts if isinstance(part, (Gap, Near)))
    near = nearest(gap.first, gap.second, state)
    for joint in (near.joint,) if turned else (near.joint, near.against):
        if joint:
            number = next(k for k, frame in enumerate(frames) if frame.parentJoint == joint)  # a body may have its name
            offset, frame = state.frame(number).actInv(near.point), frames[number]
            place = Place(number, joint, frame.placement.copy())
            found.append(filled(Point(frame.name, near.point, offset=offset), place=place))
    return found


CANCELLED = 0.1  # share of the deepest overlap below which what all normals together push with counts as none
STEPS = 12  # most steps of least squares
ROOM = 1e-4  # m: that the two are moved apart beyond touching


class _Group(NamedTuple):
    """Two owners of pieces, the joints that carry their overlapping pieces, and the overlaps' rows in the contacts."""

    owners: tuple[str, str]
    joints: tuple[int, int]
    rows: list[int]


def posture_apart(problem: Problem, workspace: Workspace, q: Array) -> Array | None:
    """A posture (nq,) that separates objects whose normals cancel at q; None if none cancel or none separates them.

    Rows of two pieces of one segment that overlap one thing from opposite sides add up to nothing, and no descent
    leaves, although a translation does (`wholebody.geometry.penetration.way_out`; figure 4b of Schmidl and Lin,
    "Real-time physically-based interaction between avatars and virtual environments").
    """
    near = workspace.near(q, 0.0)
    for group in _groups(workspace, near):
        depth = -near.distance[group.rows]
        push = global_depth(depth, near.normal[group.rows])
        # of pieces that overlap; more take longer to separate than other starts
        if float(np.linalg.norm(push)) <= CANCELLED * float(depth.max()) and len(group.rows) <= 16:
            shift = _way_out(workspace, near, group)
            if shift is not None:
                return _moved(problem, workspace, q, group.joints, shift)
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


def _way_out(workspace: Workspace, near: Contacts, group: _Group) -> Array | None:
    """A short translation (3,) of the first owner out of the second, with some room; None if there is none."""
    table = workspace.table
    first, second = (np.array([owner == name for owner in workspace.owners]) for name in group.owners)
    a, b = table.pairs.T
    pairs = table.pairs[(first[a] & second[b]) | (second[a] & first[b])]
    normal = near.normal[group.rows[0]]
    shift = way_out(workspace.geometry, near.placements, pairs, np.flatnonzero(first), normal)
    return None if shift is None else shift * (1.0 + ROOM / float(np.linalg.norm(shift)))


def _moved(problem: Problem, workspace: Workspace, q: Array, joints: tuple[int, int], shift: Array) -> Array:
    """The posture with the first joint moved by `way` (3,) relative to the second, and turned little."""
    state, model, figure = workspace.state.update(q), workspace.model, problem.scene.figure
    begun = [state.data.oMi[joint].copy() for joint in joints]
    wanted = pin.SE3(begun[0].rotation, begun[0].translation + shift)
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

"""Contradictions: infeasibility of a problem that is proven before any search.

Joints that cannot turn join segments into rigid groups, and a hold of a frame fixes the placement of its whole group.
What two holds, pairs, ranges, cones or goals of such groups ask may contradict for all values of the other joints. A
goal beyond the distances between joints, or inside of what does not move, has a least error.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import millimetres
from wholebody.geometry.flesh import is_flesh
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import Status
from wholebody.tasks.base import Bound
from wholebody.tasks.frame import Frame, Hold, Orientation
from wholebody.tasks.inputs import Place
from wholebody.tasks.point import Point
from wholebody.tasks.range_of_motion import ConeRow, CoupledRow, RangeConstraint, TwistRow

CLEAR = 1e-4  # m, rad: smaller differences are left to the search
NEAREST = 1.02  # factor on the least possible goal error, up to which a posture counts as the nearest
ON_SURFACE = 2e-6  # m: a point outside of a piece by less (twice coal's accuracy) is on its surface


class Contradiction(NamedTuple):
    """Two requirements that exclude each other."""

    # the best possible status: "infeasible", or "unreachable" if one of the two is a goal
    status: Literal["infeasible", "unreachable"]
    text: str  # both, and their difference
    least: float = 0.0  # lower bound of the goal's error, metres, if the error depends on the posture; otherwise zero


class _FixedGroup(NamedTuple):
    """The placement of a rigid group, and the term that fixes it."""

    placement: pin.SE3
    by: str


def contradictions(problem: Problem, workspace: Workspace) -> tuple[Contradiction, ...]:
    """All contradictions, those of constraints first; the workspace's state is left at the problem's start."""
    finder = _Finder(problem, workspace)
    finder.holds()
    finder.pairs()
    finder.ranges()
    finder.goals_beyond()  # before goals fix groups too
    finder.goals()
    finder.goals_inside()
    return (*finder.found, *finder.missed.values())


class _Finder:
    """The rigid groups of one problem, and their fixed placements."""

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        self._problem, self._workspace = problem, workspace
        self.found: list[Contradiction] = []
        self.missed: dict[int, Contradiction] = {}  # number of a goal to what leaves the largest error of it
        state = workspace.state.update(problem.start)
        model = problem.scene.model
        frozen = np.zeros(model.nv, dtype=bool)
        self._frozen: list[tuple[Bound, Mask]] = []  # each bound, and the degrees of freedom (nv,) that it keeps
        for bound in problem.bounds:
            low, high = bound.bounds(state, None)
            self._frozen.append((bound, (low == 0.0) & (high == 0.0)))
            frozen |= self._frozen[-1][1]
        self._group = list(range(model.njoints))
        for joint in range(1, model.njoints) if frozen.any() else ():
            if frozen[model.idx_vs[joint] : model.idx_vs[joint] + model.nvExtendeds[joint]].all():
                self._group[joint] = self._group[model.parents[joint]]
        self._start = state.data
        # flesh is elsewhere in its joint where a limb is bent
        self._rigid = np.array([not is_flesh(piece) for piece in workspace.geometry.geometryObjects], dtype=bool)
        self._fixed: dict[int, _FixedGroup] = {0: _FixedGroup(pin.SE3.Identity(), "the world")}

    def holds(self) -> None:
        """Collect the placements of groups that holds fix; different ones contradict each other."""
        for number, term in enumerate(self._problem.constraints):
            if not isinstance(term, Hold) or term.relative_to is not None:
                continue
            name = self._problem.constraint_names[number]
            group, local = self._frame(term.residual.place)
            here = self._at(group, local)
            if here is not None:
                self._compare("infeasible", name, here, term.kept_at, term.orientation, self._fixed[group].by)
            elif term.orientation:
                self._fixed[group] = _FixedGroup(term.kept_at * local.inverse(), name)

    def pairs(self) -> None:
        """Find pieces that cannot move and are nearer than their clearance."""
        table, geometry = self._workspace.table, self._workspace.geometry
        group = np.array([self._group[joint] for joint in table.joint.tolist()], dtype=np.intp)
        known = np.isin(group, list(self._fixed))
        pairs = table.pairs
        still = known[pairs].all(axis=1) | (group[pairs[:, 0]] == group[pairs[:, 1]])
        fixed = np.flatnonzero(still & self._rigid[pairs].all(axis=1))
        if not len(fixed):
            return
        center = self._centers(group)
        reach = table.reach[pairs[fixed]].sum(axis=1) + self._problem.clearances[fixed]
        apart = np.linalg.norm(center[pairs[fixed, 0]] - center[pairs[fixed, 1]], axis=1)
        for number in fixed[apart < reach].tolist():
            a, b = pairs[number].tolist()
            places = [self._piece(index, int(table.joint[index])) for index in (a, b)]
            asked = float(self._problem.clearances[number])
            shapes = [geometry.geometryObjects[index].geometry for index in (a, b)]
            at = [coal.Transform3s(place.rotation, place.translation) for place in places]
            distance = coal.distance(shapes[0], at[0], shapes[1], at[1], coal.DistanceRequest(), coal.DistanceResult())
            if distance < asked - CLEAR:
                self.found.append(Contradiction("infeasible", self._overlap(a, b, distance, asked)))
                return  # one is enough: such parts mostly overlap in many pieces

    def ranges(self) -> None:
        """Find ranges of motion and reach cones that are violated wherever the joints turn that can."""
        if not any(mask.any() for _, mask in self._frozen):
            return
        least, most = self._reachable()
        for number, term in enumerate(self._problem.constraints):
            name = self._problem.constraint_names[number]
            if isinstance(term, RangeConstraint):
                for row, range_name in zip(term.rows, term.row_names, strict=True):
                    if isinstance(row, (TwistRow, ConeRow)):
                        self._turned(f"{name}, {range_name!r}", row)
                    else:
                        axes = (row.coordinates,) if isinstance(row, CoupledRow) else row.axes
                        dofs = [coordinate.idx_v for axis in axes for coordinate in axis]
                        self._violated(f"{name}, {range_name!r}", row.largest(least, most), dofs)

    def _reachable(self) -> tuple[Array, Array]:
        """Least and largest entries (nq,) of postures; infinite but for joints of one angle with limits."""
        limits, start = self._problem.scene.figure.limits, self._problem.start
        least, most = np.full(len(start), -np.inf), np.full(len(start), np.inf)
        least[limits.idx_q], most[limits.idx_q] = limits.lower, limits.upper
        for joint in list(self._problem.scene.model.joints)[1:]:
            if joint.nq == 1 and any(mask[joint.idx_v] for _, mask in self._frozen):
                least[joint.idx_q] = most[joint.idx_q] = start[joint.idx_q]
        return least, most

    def _turned(self, name: str, row: TwistRow | ConeRow) -> None:
        """Report a range of one frame in another where the two are in one rigid group."""
        limb, reference = row.limb, row.reference
        if self._group[limb.joint] == self._group[reference.joint]:
            model, dofs = self._problem.scene.model, list[int]()
            for end in (limb.joint, reference.joint):
                while end and end != self._group[limb.joint]:
                    dofs += range(model.idx_vs[end], model.idx_vs[end] + model.nvExtendeds[end])
                    end = model.parents[end]
            self._violated(name, row.value(self._workspace.state.update(self._problem.start)), dofs)

    def _violated(self, name: str, largest: float, dofs: list[int]) -> None:
        """Report a range whose largest value is negative, with the bounds that keep some of its degrees of freedom."""
        if largest < -CLEAR:
            keepers = " and ".join(repr(bound) for bound, mask in self._frozen if mask[dofs].any())
            if keepers:
                text = f"{name} is violated by {np.degrees(-largest):.3g} degrees where {keepers} keeps the joints"
                self.found.append(Contradiction("infeasible", text))

    def goals(self) -> None:
        """Find goals that contradict the placement of their group, or another goal on the same group."""
        points: list[tuple[int, Array, Array, str]] = []
        for number, goal in enumerate(self._problem.goals):
            if not isinstance(goal, (Point, Frame, Orientation)):
                continue
            name = f"goals[{number}], {type(goal).__name__}({goal.frame!r})"
            group, local = self._frame(goal.place if isinstance(goal, Point) else goal.residual.place)
            here = self._at(group, local)
            if isinstance(goal, Frame):
                target = goal.residual.placement
                if here is not None:
                    self._compare("unreachable", name, here, target, True, self._fixed[group].by)
                else:
                    self._fixed[group] = _FixedGroup(target * local.inverse(), name)
            elif isinstance(goal, Point):
                place, wanted = local.act(goal.resolved_offset), goal.resolved_target
                if here is not None:
                    away = float(np.linalg.norm(self._fixed[group].placement.act(place) - wanted))
                    self._report("unreachable", name, away, 0.0, self._fixed[group].by)
                for other, its_place, its_wanted, its_name in points:
                    if other == group:
                        apart = np.linalg.norm(wanted - its_wanted) - np.linalg.norm(place - its_place)
                        self._report("unreachable", name, abs(float(apart)), 0.0, its_name)
                points.append((group, place, wanted, name))

    def _wanted(self) -> Iterator[tuple[int, str, Place, Array, Array]]:
        """Number, name and frame of each goal for a point; its places (3,) in its joint, and wanted in the world."""
        for number, goal in enumerate(self._problem.goals):
            if isinstance(goal, (Point, Frame)):
                name = f"goals[{number}], {type(goal).__name__}({goal.frame!r})"
                if isinstance(goal, Point):
                    here = goal.place.placement.act(goal.resolved_offset)
                    yield number, name, goal.place, here, goal.resolved_target
                else:
                    place, wanted = goal.residual.place, goal.residual.placement.translation
                    yield number, name, place, place.placement.translation, wanted

    def goals_beyond(self) -> None:
        """Find goals for points farther away than their joints are from each other, all in one line."""
        model = self._problem.scene.model
        for number, name, place, here, wanted in self._wanted():
            joint, longest = place.joint, float(np.linalg.norm(here))
            while self._group[joint] not in self._fixed:
                longest += _travel(model, joint)
                parent = model.parents[joint]
                if self._group[parent] in self._fixed:
                    root = (
                        self._fixed[self._group[parent]].placement * self._local(parent) * model.jointPlacements[joint]
                    )
                    beyond = float(np.linalg.norm(wanted - root.translation)) - longest
                    if beyond > CLEAR:
                        text = f"{name}, is {millimetres(beyond)} beyond the reach of its joints in one line"
                        self.missed[number] = Contradiction("unreachable", text, beyond)
                longest += float(np.linalg.norm(model.jointPlacements[joint].translation))
                joint = parent

    def goals_inside(self) -> None:
        """Find goals for points that are deeper in things than the pieces of the points' own joint can be."""
        # A point at a depth in its piece, negative outside, is the centre of a ball in it, or at that distance from a
        # place of it, however the piece turns: its depth in a thing is at most minus this, less the clearance.
        table, geometry = self._workspace.table, self._workspace.geometry
        for number, name, found, here, wanted in self._wanted():
            pieces = (table.joint == found.joint) & self._rigid & (found.joint > 0)
            own = {k: self._depth(k, here) for k in np.flatnonzero(pieces).tolist()}
            pairs = np.isin(table.pairs, [*own]).any(axis=1) & (table.joint[table.pairs] == 0).any(axis=1)
            depths, deepest, thing = dict[int, float](), 0.0, -1
            for pair in np.flatnonzero(pairs).tolist():
                a, b = table.pairs[pair].tolist()
                mine, other = (a, b) if table.joint[b] == 0 else (b, a)
                asked = own[mine] + float(self._problem.clearances[pair])
                centre = geometry.geometryObjects[other].placement.translation
                if np.linalg.norm(wanted - centre) < table.reach[other] + asked:
                    depths[other] = depths[other] if other in depths else self._depth(other, wanted)
                    if depths[other] + asked > max(deepest, CLEAR):
                        deepest, thing = depths[other] + asked, other
            if thing >= 0 and (number not in self.missed or deepest > self.missed[number].least):
                where = "in" if depths[thing] > 0.0 else "beside"
                far = f"{millimetres(deepest)} from where it can be"
                text = f"{name}, is {where} {self._workspace.owners[thing]}, at least {far}"
                self.missed[number] = Contradiction("unreachable", text, deepest)
            if isinstance(goal := self._problem.goals[number], Frame):
                self._placed_inside(number, name, goal, found)

    def _placed_inside(self, number: int, name: str, goal: Frame, found: Place) -> None:
        """Find a piece of a frame's joint that the frame's placement puts into a thing."""
        # A ball in the piece leaves the thing when its centre moves by `much`, which the frame's displacement and its
        # rotation vector do together, at most by the displacement and the vector's length times the distance.
        table, geometry = self._workspace.table, self._workspace.geometry
        at = goal.residual.placement * found.placement.inverse()
        for pair, (a, b) in enumerate(table.pairs.tolist() if found.joint else ()):
            own, other = (a, b) if table.joint[a] == found.joint else (b, a)
            if table.joint[own] != found.joint or table.joint[other] != 0 or not self._rigid[own]:
                continue
            centre = geometry.geometryObjects[own].placement.translation
            reached = np.linalg.norm(at.act(centre) - geometry.geometryObjects[other].placement.translation)
            if not 0.0 < (inner := self._depth(own, centre)) < np.inf or reached > table.reach[other] + inner:
                continue
            much = inner + self._depth(other, at.act(centre)) + float(self._problem.clearances[pair])
            away = float(np.linalg.norm(centre - found.placement.translation))
            least = much / float(np.hypot(1.0, away))
            if much > CLEAR and (number not in self.missed or least > self.missed[number].least):
                piece, thing = self._workspace.owners[own], self._workspace.owners[other]
                text = f"{name}, puts {piece} into {thing}, at least {millimetres(much)}"
                self.missed[number] = Contradiction("unreachable", text, least)

    def _depth(self, index: int, point: Array) -> float:
        """Depth of a point (3,) inside a piece, metres, both in the frame of the piece's joint."""
        body = self._workspace.geometry.geometryObjects[index]
        at = coal.Transform3s(body.placement.rotation, body.placement.translation)
        there = coal.Transform3s(np.eye(3), np.asarray(point, dtype=float))
        ask, answer = coal.DistanceRequest(), coal.DistanceResult()
        return -float(coal.distance(body.geometry, at, coal.Sphere(ON_SURFACE), there, ask, answer)) - ON_SURFACE

    def _centers(self, group: NDArray[np.intp]) -> Array:
        """Origins (n, 3) of the pieces; those of fixed groups at their fixed placements."""
        center: Array = self._workspace.near(self._problem.start, 0.0).placements[:, 3].copy()
        for joint, (at, _) in self._fixed.items():
            moved = at * self._start.oMi[joint].inverse()
            members = group == joint
            center[members] = center[members] @ moved.rotation.T + moved.translation
        return center

    def _local(self, joint: int) -> pin.SE3:
        """Placement of a joint in its group."""
        return self._start.oMi[self._group[joint]].actInv(self._start.oMi[joint])

    def _frame(self, place: Place) -> tuple[int, pin.SE3]:
        """The group that carries a frame, and the frame's placement in it."""
        return self._group[place.joint], self._local(place.joint) * place.placement

    def _at(self, group: int, local: pin.SE3) -> pin.SE3 | None:
        """Placement in the world of a local placement of a group, if the group is fixed."""
        return self._fixed[group].placement * local if group in self._fixed else None

    def _piece(self, index: int, joint: int) -> pin.SE3:
        """Placement of a piece: in the world if its group is fixed, otherwise in its group."""
        local = self._local(joint) * self._workspace.geometry.geometryObjects[index].placement
        here = self._at(self._group[joint], local)
        return local if here is None else here

    def _compare(self, status: Any, name: str, here: pin.SE3, wanted: pin.SE3, turned: bool, by: str) -> None:
        away = float(np.linalg.norm(here.translation - wanted.translation))
        angle = float(np.linalg.norm(pin.log3(here.rotation.T @ wanted.rotation))) if turned else 0.0
        self._report(status, name, away, angle, by)

    def _report(self, status: Any, name: str, away: float, angle: float, by: str) -> None:
        if max(away, angle) > CLEAR:
            far = millimetres(away) if away > CLEAR else f"{np.degrees(angle):.3g} degrees"
            by = f"{by}," if "," in by else by  # "constraints[0], Hold('hand')," and "the world"
            self.found.append(Contradiction(status, f"{name}, is {far} from where {by} keeps that part"))

    def _overlap(self, a: int, b: int, distance: float, asked: float) -> str:
        owners, joint = self._workspace.owners, self._workspace.table.joint.tolist()
        said = [f"{owners[k]} (kept by {self._fixed[group].by})" if (group := self._group[joint[k]]) in self._fixed
                else f"{owners[k]} (frozen)" for k in (a, b)]  # fmt: skip
        what = f"{millimetres(-distance)} inside" if distance < 0.0 else f"{millimetres(distance)} from"
        return f"{said[0]} is {what} {said[1]}" + (f", where {millimetres(asked)} are required" if asked else "")


def _travel(model: pin.Model, joint: int) -> float:
    """How far a joint moves its own origin from where its parent carries it, metres; infinite where it is not known."""
    kind = model.joints[joint].shortname()
    if kind.startswith(("JointModelR", "JointModelSpherical")):
        return 0.0
    if kind.startswith("JointModelP") and model.nvs[joint] == 1:
        place = model.idx_qs[joint]
        return float(max(abs(model.lowerPositionLimit[place]), abs(model.upperPositionLimit[place])))
    return np.inf


def in_words(found: tuple[Contradiction, ...]) -> str:
    """One sentence about contradictions; empty without any."""
    if not found:
        return ""
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"the problem contradicts itself: {found[0].text}{more}"


def least_left(found: tuple[Contradiction, ...]) -> float | None:
    """Lower bound of the norm of the goals' errors, metres; None if no search can succeed."""
    if not all(each.least for each in found):
        return None
    return float(np.linalg.norm([each.least for each in found]))


def proven(status: Status, found: tuple[Contradiction, ...], holds: bool) -> Status:
    """The status of an answer to a contradictory problem; an infeasible answer is never `unreachable`."""
    if status == "stalled" and found and (holds or found[0].status == "infeasible"):
        return found[0].status
    return status


def contradictions_of(problem: Problem) -> tuple[Contradiction, ...]:
    """The contradictions of a problem, in a workspace of its own."""
    with problem.borrow() as workspace:
        return contradictions(problem, workspace)

"""placo's robot for a scene: it has a floating base, and its collision model includes the objects.

placo reads a skeleton: links, the kinds and axes of joints, and a link for every frame that a task names. Placements,
limits and inertias, which a URDF would round, and the pieces are then copied from our model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import MissingPackageError
from wholebody.figures.description import Follower
from wholebody.figures.figure import Figure
from wholebody.figures.state import free_roots
from wholebody.figures.urdf.joints import ANY_LIMIT, add_joint, urdf_axis
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.differential import TOOL
from wholebody.problem import Problem

SWELL = 0.005
"""Metres by which pieces are enlarged beyond their clearance, and which placo's margin subtracts again.

placo computes the direction of a row from the two nearest points. Where pieces just touch, these coincide and give no
direction; enlarged pieces overlap there instead.
"""

ENDLESS = 1e6  # rad, m: limit of a joint that has none
BASE = "base"


class Robot:
    """placo's robot for the scene of a problem.

    Attributes:
        wrapper: the placo.RobotWrapper.
        frames: the frames that tasks can name -> the index of the joint and the placement in it.
        floating: whether placo's base moves, as the one free root.
    """

    def __init__(self, figure: Figure, frames: Mapping[str, tuple[int, pin.SE3]]) -> None:
        """Build it, without pieces; `frames` are those that tasks use -> joint of our model and placement in it."""
        try:
            import placo
        except ModuleNotFoundError:
            raise MissingPackageError("placo is not installed; install: pip install 'wholebody[placo]'") from None
        except ImportError as error:
            raise MissingPackageError(
                f"placo cannot be imported ({error}); install what it was built for: pip install 'wholebody[placo]'"
            ) from None
        self.frames, self.floating, self._roots = dict(frames), figure.root == "free", _jointed(figure)
        self._clearances = np.zeros(0)
        self._pairs = np.zeros(0, dtype=np.intp)
        text = ElementTree.tostring(_skeleton(figure, self.frames), encoding="unicode")
        self.wrapper = placo.RobotWrapper("", placo.Flags.ignore_collisions, text)
        self._copy_model(figure)
        self._pieces: list[int] = []

    def move(self, q: Array) -> None:
        """Move to our posture q (nq,)."""
        theirs = pin.neutral(self.wrapper.model)
        theirs[self._idx_q[self._alike]] = q[self._alike]
        for joint, at in self._seats.items():
            place = at * pin.XYZQUATToSE3(q[self._first[joint] : self._first[joint] + 7])
            self.wrapper.model.jointPlacements[self._id(self.joint_names(joint)[0])] = place
        for place, law in self._followers.items():
            theirs[place] = law.slope * q[law.idx_q] + law.offset
        self.wrapper.state.q = theirs
        with TOOL:
            self.wrapper.update_kinematics()

    def posture(self) -> Array:
        """Our posture (nq,) where it is now, of a figure with at most one free root."""
        return np.array(self.wrapper.state.q)[self._idx_q]

    def couple(self, solver: Any) -> None:
        """Add the laws of joints that follow others to a `placo.KinematicsSolver`, as hard gear tasks."""
        for name, law in self._laws.items():
            gear = solver.add_gear_task()
            gear.set_gear(*(self.joint_name(self._ids[joint]) for joint in (name, law.joint)), law.slope)
            gear.configure(f"gear {name}", "hard", 1.0)

    def serves(self, problem: Problem, frames: Mapping[str, tuple[int, pin.SE3]], pairs: Indices) -> bool:
        """Whether it fits another problem of the same scene: the same clearances and pairs, these frames or more."""
        same = np.array_equal(self._clearances, problem.clearances) and np.array_equal(self._pairs, pairs)
        return same and set(frames) <= set(self.frames)

    def place_objects(self, ours: pin.GeometryModel) -> None:
        """Copy the placements of the pieces from a geometry model like the scene's."""
        model = self.wrapper.collision_model
        for index, number in enumerate(self._pieces):
            model.geometryObjects[index].placement = ours.geometryObjects[number].placement

    def displacement(self, theirs: Array) -> Array:
        """Our displacement (nv,) from placo's."""
        return np.asarray(theirs, dtype=float)[self._idx_v]

    def half_spaces(self, rows: Array, room: Array) -> tuple[Array, Array]:
        """Rows (k, placo's nq) and bounds (k,) on placo's joints of ``rows (k, nv) @ our displacement >= -room (k,)``.

        Placo's base is left out, which with several figures nothing moves.
        """
        model = self.wrapper.model
        theirs = np.zeros((len(rows), model.nq))
        ahead = model.nq - model.nv  # of the base's quaternion
        theirs[:, self._idx_v + ahead] = -rows
        return theirs, theirs @ self.wrapper.state.q + room

    def limit_steps(self, longest: float) -> None:
        """Limit what one program moves a joint by [rad, m]; free roots have no limit, as placo's base has none."""
        self.wrapper.set_velocity_limits(longest)
        model, free = self.wrapper.model, self.wrapper.model.velocityLimit.copy()
        for joint in self._roots:
            for name in self.joint_names(joint):
                free[model.joints[self._id(name)].idx_v] = ENDLESS
        model.velocityLimit = free

    def joint_name(self, joint: int) -> str:
        """Name in placo of a joint of our model that has one axis."""
        return f"j{joint:05d}"

    def joint_names(self, joint: int) -> tuple[str, ...]:
        """Names in placo of what stands for a joint of our model: of a free root of several figures six."""
        return _six(joint) if joint in self._roots else (self.joint_name(joint),)

    def joint(self, ours: int) -> int:
        """Index of our joint in placo's model."""
        if ours == 0:
            return 0
        return 1 if self.floating and ours == 1 else self._id(self.joint_names(ours)[-1])

    def _id(self, name: str) -> int:
        return int(self.wrapper.model.getJointId(name))

    def link(self, joint: int) -> str:
        """Name of the link that a free root moves."""
        return f"l{joint:05d}" if joint in self._roots else BASE

    def _copy_model(self, figure: Figure) -> None:
        ours, theirs = figure.model, self.wrapper.model
        idx_q, idx_v = np.zeros(ours.nq, dtype=np.intp), np.zeros(ours.nv, dtype=np.intp)
        lower, upper = theirs.lowerPositionLimit.copy(), theirs.upperPositionLimit.copy()
        self._laws, self._ids = figure.followers, {name: index for index, name in enumerate(ours.names)}
        self._followers: dict[int, Follower] = {}
        # free roots of several figures: six joints at zero, whose seat moves with the posture
        self._seats = {joint: pin.SE3(ours.jointPlacements[joint]) for joint in self._roots}
        self._first = {joint: int(ours.idx_qs[joint]) for joint in self._seats}
        self._alike = np.ones(ours.nq, dtype=bool)
        for index in range(1, ours.njoints):
            joint, other = ours.joints[index], theirs.joints[self.joint(index)]
            theirs.inertias[other.id] = ours.inertias[index]
            if index in self._seats:
                self._alike[joint.idx_q : joint.idx_q + 7] = False
                six = [theirs.joints[self._id(name)] for name in self.joint_names(index)]
                idx_v[joint.idx_v : joint.idx_v + 6] = [one.idx_v for one in six]
                places = [one.idx_q for one in six]
                lower[places], upper[places] = -ENDLESS, ENDLESS
                continue
            idx_q[joint.idx_q : joint.idx_q + joint.nq] = np.arange(other.idx_q, other.idx_q + joint.nq)
            idx_v[joint.idx_v : joint.idx_v + joint.nv] = np.arange(other.idx_v, other.idx_v + joint.nv)
            theirs.jointPlacements[other.id] = ours.jointPlacements[index]
            if ours.names[index] in figure.followers:
                self._followers[int(other.idx_q)] = figure.followers[ours.names[index]]
                lower[other.idx_q], upper[other.idx_q] = -ENDLESS, ENDLESS
            elif joint.nq == 1:
                lower[other.idx_q] = max(ours.lowerPositionLimit[joint.idx_q], -ENDLESS)
                upper[other.idx_q] = min(ours.upperPositionLimit[joint.idx_q], ENDLESS)
        theirs.lowerPositionLimit, theirs.upperPositionLimit = lower, upper
        self._idx_q, self._idx_v = idx_q, idx_v
        for name, (_, placement) in self.frames.items():
            theirs.frames[theirs.getFrameId(name)].placement = placement

    def add_pieces(self, problem: Problem, pairs: Indices) -> None:
        """Add the pieces of pairs of a problem, by their numbers (pairs,) in the scene."""
        # placo has one margin for all pairs, so the first piece of a pair is enlarged by its clearances.
        scene, model = problem.scene.geometry, self.wrapper.collision_model
        self._clearances, self._pairs = problem.clearances.copy(), pairs.copy()
        made: dict[tuple[int, float], int] = {}

        def piece(number: int, radius: float) -> int:
            if (number, radius) not in made:
                ours = scene.geometryObjects[number]
                shape = ours.geometry.clone()
                shape.setSweptSphereRadius(ours.geometry.getSweptSphereRadius() + radius)
                name = f"{ours.name} {radius!r}"
                added = pin.GeometryObject(name, self.joint(ours.parentJoint), ours.placement, shape)
                made[number, radius] = model.addGeometryObject(added)
                self._pieces.append(number)
            return made[number, radius]

        for number in pairs.tolist():
            pair, clearance = scene.collisionPairs[number], float(problem.clearances[number])
            first, second = piece(pair.first, clearance + SWELL), piece(pair.second, 0.0)
            model.addCollisionPair(pin.CollisionPair(first, second))


def _skeleton(figure: Figure, frames: Mapping[str, tuple[int, pin.SE3]]) -> ElementTree.Element:
    """URDF of links and joints without placements, and of a link for every frame."""
    model = figure.model
    robot = ElementTree.Element("robot", name="figure")
    root, roots = 1 if figure.root == "free" else 0, _jointed(figure)
    link = {0: BASE, root: BASE}
    ElementTree.SubElement(robot, "link", name=BASE)
    for index in range(root + 1, model.njoints):
        link[index] = f"l{index:05d}"
        ElementTree.SubElement(robot, "link", name=link[index])
        if index in roots:
            before = BASE
            for k, name in enumerate(_six(index)):
                after = link[index] if k == 5 else f"to {name}"
                if k < 5:
                    ElementTree.SubElement(robot, "link", name=after)
                kind = "prismatic" if k < 3 else "revolute"
                add_joint(robot, name, kind, before, after, axis=np.eye(3)[k % 3], limit=ANY_LIMIT)
                before = after
            continue
        known = urdf_axis(model, index)
        if known is None:
            raise UnsupportedTermError("placo", [_refused(model, index)])
        limit = None if known.kind == "continuous" else ANY_LIMIT
        names = f"j{index:05d}", known.kind, link[int(model.parents[index])], link[index]
        add_joint(robot, *names, axis=known.axis, limit=limit)
    for name, (carrier, _) in frames.items():
        ElementTree.SubElement(robot, "link", name=name)
        add_joint(robot, f"to {name}", "fixed", link[carrier], name)
    return robot


def _jointed(figure: Figure) -> tuple[int, ...]:
    """The free roots of several figures, for which six joints stand: placo's own base is one root."""
    return () if figure.root == "free" else free_roots(figure.model)


def _six(root: int) -> tuple[str, ...]:
    """Names of the six joints that stand for a free root."""
    return tuple(f"j{root:05d} {k}" for k in range(6))


def unsupported_joints(figure: Figure) -> list[str]:
    """The first joint of a kind that placo's robots do not have, with the reason; empty if there is none."""
    model = figure.model
    for index in sorted(set(range(1, model.njoints)) - set(free_roots(model))):
        name = model.names[index]
        if urdf_axis(model, index) is None:
            return [f"{_refused(model, index)} (its robots have turning and sliding joints, and free roots)"]
        if name in figure.followers and figure.followers[name].offset:
            return [f"joint {name!r}, which mimics another with an offset (its gears have none)"]
    return []


def _refused(model: Any, index: int) -> str:
    return f"joint {model.names[index]!r}, a {model.joints[index].shortname()}"

"""Pinocchio's model of a robot in a compiled MJCF file.

MuJoCo moves a body by its joints one after another: a hinge turns it about its anchor by ``q - ref``, a slide shifts
it, a ball turns it about its anchor; a free joint places it in the world. So the placement of a body in its parent is
``P T_1 ... T_n`` with ``T = Trans(anchor) R(axis, q - ref) Trans(-anchor)``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown, warn_of_degrees
from wholebody.figures.description import ROOT_JOINT, JointCone, Law, follows, led
from wholebody.figures.mjcf.compiled import BALL, FREE, HINGE, SLIDE, Compiled, placement
from wholebody.figures.motion_ranges import ReachCone
from wholebody.geometry.placement import along_z


class RobotModel(NamedTuple):
    """A robot in an MJCF file."""

    model: pin.Model  # Pinocchio's
    bodies: tuple[int, ...]  # numbers of its bodies in MuJoCo, parents first
    joints: dict[int, int]  # number of a joint in MuJoCo -> its index in Pinocchio
    sites: tuple[str, ...]  # names of the frames of its sites
    cones: dict[str, JointCone]  # limits of ball joints, by joint
    notes: tuple[str, ...]  # sentences on what Pinocchio's model does not have

    def posture(self, compiled: Compiled, qpos: Array) -> Array:
        """(nq,) posture of MuJoCo's (nq,) configuration."""
        q: Array = pin.neutral(self.model)
        for joint, index in self.joints.items():
            made, at = self.model.joints[index], int(compiled.model.jnt_qposadr[joint])
            if follows(made):
                continue
            kind = compiled.model.jnt_type[joint]
            if kind in (FREE, BALL):
                shift = 3 if kind == FREE else 0
                q[made.idx_q : made.idx_q + shift] = qpos[at : at + shift]
                turned = placement(np.zeros(3), qpos[at + shift : at + shift + 4]).rotation
                q[made.idx_q + shift : made.idx_q + shift + 4] = pin.Quaternion(turned).coeffs()
            else:
                q[made.idx_q] = qpos[at]
        return q


class RobotBuilder:
    """Builds the model of the robot on the body `top`; its root is "fixed", "free", or None: as in the file."""

    def __init__(self, compiled: Compiled, top: int, root: str | None) -> None:
        self._file, self._top, self._root = compiled, top, root
        self._model = pin.Model()
        self._joints: dict[int, int] = {}
        self._notes: list[str] = []
        self._bodies = compiled.tree(top)
        self._laws = self._followers()

    def build(self) -> RobotModel:
        """Build it, once."""
        theirs, file, model = self._file.model, self._file, self._model
        model.name = file.name
        at: dict[int, tuple[int, pin.SE3]] = {0: (0, pin.SE3.Identity())}
        for body in self._bodies:
            joint, place = self._moved(body, *at[theirs.body_parentid[body]])
            at[body] = (joint, place)
            inertia = _inertia(theirs, body)
            if inertia.mass > 0.0:
                model.appendBodyToJoint(joint, inertia, place)
            frame = pin.Frame(file.names["body"][body], joint, 0, place, pin.FrameType.BODY, inertia)
            model.addFrame(frame, False)
        self._name_joints()
        sites = self._add_sites(at)
        return RobotModel(model, tuple(self._bodies), self._joints, sites, self._cones(), tuple(self._notes))

    def _moved(self, body: int, parent: int, place: pin.SE3) -> tuple[int, pin.SE3]:
        """The last joint of a body, and the body in the frame of this joint."""
        theirs = self._file.model
        place = place * self._file.place(body)
        joints = list(self._file.joints(body))
        free = self._file.is_free(body)
        if body == self._top and (self._root == "free" or (free and self._root is None)):
            parent = self._model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), ROOT_JOINT)
            place = pin.SE3.Identity()
            if free:
                self._joints[joints[0]] = parent
        for joint in joints:
            kind = int(theirs.jnt_type[joint])
            if kind == FREE:
                continue
            anchor, axis = np.array(theirs.jnt_pos[joint]), np.array(theirs.jnt_axis[joint])
            before, after = pin.SE3(np.eye(3), anchor), pin.SE3(np.eye(3), -anchor)
            reference = float(theirs.qpos0[theirs.jnt_qposadr[joint]])
            if kind == HINGE:
                after = pin.SE3(pin.exp3(-reference * axis), np.zeros(3)) * after
            elif kind == SLIDE:
                before, after = pin.SE3.Identity(), pin.SE3(np.eye(3), -reference * axis)
            parent, place = self._add(joint, kind, axis, parent, place * before)
            place = place * after
        return parent, place

    def _add(self, joint: int, kind: int, axis: Array, parent: int, place: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint; the frame in which the rest is placed, in the joint's own."""
        name, theirs = self._file.names["joint"][joint], self._file.model
        law, letter, turned = self._laws.get(joint), "Z", pin.SE3(along_z(axis), np.zeros(3))
        if law is None and 1.0 in axis and all(each.leader != joint for each in self._laws.values()):
            letter, turned = "XYZ"[int(np.argmax(axis))], pin.SE3.Identity()
        if kind == BALL:
            model, turned = pin.JointModelSpherical(), pin.SE3.Identity()
        elif law is not None:  # a follower has the axis of its leader in its own frame: z
            leader = self._model.joints[self._joints[law.leader]]
            model = pin.JointModelMimic(leader, law.slope, law.offset)
        else:
            model = getattr(pin, f"JointModel{'P' if kind == SLIDE else 'R'}{letter}")()
        made = self._joints[joint] = self._model.addJoint(parent, model, place * turned, name)
        if kind == BALL:
            return made, turned
        if law is not None:
            return made, turned.inverse()
        slot, dof = self._model.joints[made].idx_q, self._model.joints[made].idx_v
        low, high = self._range(joint)
        for end, value in (("lower", low), ("upper", high)) if kind == HINGE else ():
            warn_of_degrees(value, f"joint {shown(name)}: the {end} limit")
        self._fill("lowerPositionLimit", slot, low + 0.0)  # no negative zero
        self._fill("upperPositionLimit", slot, high + 0.0)
        self._fill("velocityLimit", dof, np.inf)
        force = theirs.jnt_actfrcrange[joint]
        limited = bool(theirs.jnt_actfrclimited[joint])
        self._fill("effortLimit", dof, float(np.abs(force).max()) if limited else np.inf)
        self._fill("armature", dof, float(theirs.dof_armature[theirs.jnt_dofadr[joint]]))
        return made, turned.inverse()

    def _fill(self, what: str, place: int, value: float) -> None:
        changed = np.array(getattr(self._model, what))
        changed[place] = value
        setattr(self._model, what, changed)

    def _range(self, joint: int) -> tuple[float, float]:
        """Limits of a joint, cut by those of its followers."""
        theirs = self._file.model
        low, high = (float(end) for end in theirs.jnt_range[joint]) if theirs.jnt_limited[joint] else (-np.inf, np.inf)
        for follower, law in self._laws.items():
            if law.leader == joint and theirs.jnt_limited[follower]:
                ends = sorted((float(end) - law.offset) / law.slope for end in theirs.jnt_range[follower])
                if max(low, ends[0]) >= min(high, ends[1]):
                    names = (shown(self._file.names["joint"][each]) for each in (follower, joint))
                    self._notes.append("joint {}: its range leaves {} no room, so it is left out".format(*names))
                    continue
                low, high = max(low, ends[0]), min(high, ends[1])
        return low, high

    def _name_joints(self) -> None:
        """Add a frame for every joint; a body of the same name keeps its own."""
        for index in range(1, self._model.njoints):
            name = self._model.names[index]
            if not self._model.existFrame(name):
                self._model.addFrame(pin.Frame(name, index, 0, pin.SE3.Identity(), pin.FrameType.JOINT))

    def _add_sites(self, at: dict[int, tuple[int, pin.SE3]]) -> tuple[str, ...]:
        theirs, made, renamed = self._file.model, [], []
        for site, body in enumerate(theirs.site_bodyid):
            if body not in at or body == 0:
                continue
            joint, place = at[body]
            name = self._file.names["site"][site]
            if self._model.existFrame(name):
                renamed.append(name)
                name = f"{name}_site"
            there = place * placement(theirs.site_pos[site], theirs.site_quat[site])
            self._model.addFrame(pin.Frame(name, joint, 0, there, pin.FrameType.OP_FRAME))
            made.append(name)
        if renamed:
            self._notes.append(f"sites with the name of a body or joint end in _site: {', '.join(renamed)}")
        return tuple(made)

    def _followers(self) -> dict[int, Law]:
        """Joints that follow another by an equality that is linear in it; the first in the tree leads."""
        import mujoco

        theirs = self._file.model
        laws: dict[int, Law] = {}
        mine = {joint for body in self._bodies for joint in self._file.joints(body)}
        for row in np.flatnonzero(theirs.eq_type == mujoco.mjtEq.mjEQ_JOINT).tolist():
            first, second = int(theirs.eq_obj1id[row]), int(theirs.eq_obj2id[row])
            if first not in mine:
                continue
            why = self._unlike(row, first, second, mine)
            if not why:
                given, own, other = self._law(row, first, second), led(laws, first), led(laws, second)
                slope = given.slope * other.slope / own.slope
                law = Law(other.leader, slope, (given.slope * other.offset + given.offset - own.offset) / own.slope)
                follower = own.leader
                if follower < law.leader:
                    follower, law = law.leader, Law(follower, 1.0 / law.slope, -law.offset / law.slope)
                if follower != law.leader:
                    laws[follower] = law
                    continue
                why = "is one of several, of which the first is kept"
            name = self._file.names["joint"][int(theirs.eq_obj1id[row])]
            free = "" if "first" in why else ", so it moves by itself"
            self._notes.append(f"joint {shown(name)}: its <equality> {why}{free}")
        others = int((theirs.eq_type != mujoco.mjtEq.mjEQ_JOINT).sum())
        if others:
            self._notes.append(
                f"{others} <equality> between bodies or tendons: not kept; these parts move by themselves"
            )
        return {joint: led(laws, joint) for joint in laws}

    def _unlike(self, row: int, first: int, second: int, mine: set[int]) -> str:
        """Why a joint does not follow another by an equality; empty if it does."""
        theirs = self._file.model
        if not theirs.eq_active0[row]:
            return "is switched off"
        if second not in mine or theirs.eq_data[row, 1] == 0.0 or theirs.eq_data[row, 2:5].any():
            return "is not linear in another joint"
        kinds = {int(theirs.jnt_type[joint]) for joint in (first, second)}
        return "" if kinds in ({HINGE}, {SLIDE}) else "joins joints of two kinds"

    def _law(self, row: int, first: int, second: int) -> Law:
        """MuJoCo's ``q1 - ref1 = a + b (q2 - ref2)``."""
        theirs = self._file.model
        offset, slope = (float(value) for value in theirs.eq_data[row, :2])
        refs = [float(theirs.qpos0[theirs.jnt_qposadr[joint]]) for joint in (first, second)]
        return Law(second, slope, offset + refs[0] - slope * refs[1])

    def _cones(self) -> dict[str, JointCone]:
        """Limited balls: a cone about the direction of the limb, which bounds its swing and not its twist."""
        theirs, made = self._file.model, {}
        for joint, index in self._joints.items():
            if theirs.jnt_type[joint] != BALL or not theirs.jnt_limited[joint]:
                continue
            body, angle = int(theirs.jnt_bodyid[joint]), float(theirs.jnt_range[joint][1])
            name = self._model.names[index]
            limb = np.array(theirs.body_ipos[body]) - np.array(theirs.jnt_pos[joint])
            limb = limb / np.linalg.norm(limb) if np.linalg.norm(limb) > 1e-6 else np.array((0.0, 0.0, 1.0))
            if angle >= np.pi:
                continue
            round_it = np.arange(16) * (2.0 * np.pi / 16)
            frame = along_z(limb)
            corners = np.column_stack(
                (np.sin(angle) * np.cos(round_it), np.sin(angle) * np.sin(round_it), np.full(16, np.cos(angle)))
            )
            place = self._file.place(body).rotation @ frame
            parent = int(theirs.body_parentid[body])
            reference = self._file.names["body"][parent] if parent in self._bodies else "universe"
            cone = ReachCone(corners @ place.T, place[:, 2])
            made[name] = JointCone(cone, reference, self._file.names["body"][body], limb)
            self._notes.append(
                f"joint {shown(name)}: its range of {np.degrees(angle):.1f} degrees is that of the swing of its limb "
                "in wb.tasks.ReachCones; the twist about it has none"
            )
        return made


def _inertia(theirs: Any, body: int) -> pin.Inertia:
    turn = placement(np.zeros(3), theirs.body_iquat[body]).rotation
    about = turn @ np.diag(theirs.body_inertia[body]) @ turn.T
    return pin.Inertia(float(theirs.body_mass[body]), np.array(theirs.body_ipos[body]), about)

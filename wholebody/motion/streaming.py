"""Retargeting of a stream: skeletons come in frame by frame, and postures come out a little later."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.footholds import LiveRests
from wholebody.motion.held_points import held_points
from wholebody.motion.holds import Holds
from wholebody.motion.retarget_run import Run
from wholebody.motion.retarget_targets import Proportions, wanted_of
from wholebody.motion.retargeting import checked_ground, same_figure
from wholebody.motion.roles import matched, skeleton_roles
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.motion.standing_ground import FEET, Ground
from wholebody.motion.structure import size_of
from wholebody.motion.surfaces import surface_of
from wholebody.scene.scene import Scene


class Retargeter:
    """Retargets a stream of skeletons, by the same run as `wb.retarget`.

    Each posture follows `ahead` frames after its skeleton: so many are looked at before a posture is fixed. A recording
    is fitted backward in time too; where only that finds better postures, those of a stream differ. Feet are held
    where they rest on a level floor; hands, knees and contacts with things are held in recordings alone.

    Attributes:
        ahead: frames from a skeleton to its posture.
        latency: the same in seconds.

    Examples:
        >>> stream = wb.motion.Retargeter(skeleton, human)
        >>> q = np.concatenate([stream.push(skeleton.part(k, k + 1)) for k in range(len(skeleton))] + [stream.finish()])
        >>> q.shape == (len(skeleton), human.model.nq)
        True
    """

    def __init__(
        self,
        motion: SkeletonMotion,
        figure: Figure,
        scene: Scene | None = None,
        ground: Ground | None = None,
        *,
        names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    ) -> None:
        """Take what does not change.

        Args:
            motion: some seconds of the same skeleton at the same rate, in which it stands or walks: they say how long
                its bones are and where its floor is.
            figure: the figure.
            scene: the figure among things that stand; None for a level floor.
            ground: when what rests in the stream, where that is known before; None to find it as frames come.
            names: as for `wb.retarget`.

        Raises:
            UnknownNameError: a name that does not exist.
            FileFormatError: the TOML file cannot be read.
            InputError: no bones are known to belong to the figure, or the scene is of another figure.
        """
        motion = checked_motion(motion, "Retargeter: motion")
        one_figure(figure, "Retargeter: figure")
        if scene is not None:
            same_figure(scene, figure, "Retargeter")
        self._like, self._roles = motion, matched(motion, figure, names)
        surface = None if scene is None else surface_of(scene)
        known = checked_ground(motion, figure, ground, names, surface)
        self._proportions = Proportions(motion, figure, self._roles, known, None if scene is None else 1.0)
        like = self._proportions.targets(motion)
        if not like.points:
            raise InputError(f"the roles that {motion.name} and {figure.name} have in common make no bone; name more")
        world = scene
        if world is None:
            world = Scene(figure) if figure.root == "fixed" else Scene(figure).add(HalfSpace(), name="floor")
        joints = skeleton_roles(motion, names)  # also those that the figure lacks, such as toes
        self._feet = [role for role in known.lowest if role.split("_")[-1] in FEET and role in joints]
        self._joints = [motion.names.index(joints[role]) for role in self._feet]
        self._size = size_of(motion, joints)
        self._rests: LiveRests | None = None
        if ground is None:
            known = replace(known, footholds=(), rests={role: known.rests[role] for role in self._feet})
        points = held_points(figure, self._roles, known)
        self._holds = Holds(points, known, self._proportions.path, motion.dt, surface)
        self._run = Run(figure, like, self._roles, motion.dt, self._holds, world.workspace())
        if ground is None:
            lows = np.array([known.lowest[role] for role in self._feet]) / self._size
            self._rests = LiveRests(lows, motion.dt, self._run.every + self._run.slowing)

    def __repr__(self) -> str:
        return f"Retargeter({self._like.name!r}, frames of {self._like.dt:g} s, {self.ahead} ahead)"

    @property
    def ahead(self) -> int:
        """Frames from a skeleton to its posture."""
        return self._run.ahead

    @property
    def latency(self) -> float:
        """Seconds from a skeleton to its posture."""
        return self.ahead * self._like.dt

    def push(self, motion: SkeletonMotion) -> Array:
        """Take the next frame, or some.

        Args:
            motion: one frame or more of the skeleton.

        Returns:
            (m, nq) the postures that are known by it, in their order; none for the first `ahead` frames.

        Raises:
            InputError: the skeleton has other joints or another time step, or the stream was finished.
        """
        motion = checked_motion(motion, "push: motion")
        if motion.names != self._like.names or abs(motion.dt - self._like.dt) > 1e-6:
            raise InputError(
                f"push: {motion.name} has other joints or another time step than {self._like.name}; give frames like it"
            )
        if self._run.ended:
            raise InputError("push: the stream was finished; make another Retargeter")
        found = list[Array]()
        for number, wanted in enumerate(wanted_of(self._proportions.targets(motion), self._roles)):
            if self._rests is not None:
                begins, ends = self._rests.push(motion.positions[number, self._joints] / self._size)
                for foot, frame in begins:
                    self._holds.rest(self._feet[foot], frame)
                for foot, frame in ends:
                    self._holds.leave(self._feet[foot], frame)
            found += self._run.push(wanted)
        return np.array(found).reshape(-1, self._run.model.nq)

    def finish(self) -> Array:
        """The postures (m, nq) of the last frames; nothing can be pushed afterwards."""
        return np.array(self._run.finish()).reshape(-1, self._run.model.nq)

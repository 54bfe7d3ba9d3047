"""Torques of a clip: inverse dynamics, forces on feet that stand and on what touches things, strength.

A part other than feet bears on a thing, such as a hand on a rail, while it is as near to it as retargeting and
`wb.avoid` bring what touches, and slow there. Feet stand by height and speed, on whatever is below them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask, cross
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.figures.strength import Strength, torque_limits
from wholebody.geometry.placement import steady
from wholebody.geometry.proximity import Contacts
from wholebody.motion.clip import Clip, same_joints
from wholebody.motion.footholds import RestLimits
from wholebody.motion.inverse_dynamics import ROOT, InverseDynamics, Stand, Touches, foot_wrenches
from wholebody.motion.stance import FEET, own_feet, standing_feet
from wholebody.scene.scene import Scene
from wholebody.tasks.forces import FRICTION

CUTOFF = 6.0
"""Hz: noise of recordings lies above, most of walking below (D. A. Winter, "Biomechanics and motor control of human
movement", chapter 2.2.4: 4 to 6 Hz for walking)."""


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques of a clip, frame by frame; nothing in it is NaN.

    Attributes:
        figure: the figure.
        dt: seconds from frame to frame.
        torque: (n, nv) torque of each joint, N m (force of sliding joints, N), after the ground's forces; positive
            towards positive angles. The six columns of a free root hold what is missing (see there).
        strained: (n, nv) the same about the axes to which strength applies: those of the joints, but of a shoulder's
            flexion the one across the upper arm (`wholebody.figures.strength.Shoulder`), as in `wb.ergonomics`.
        feet: names of the feet, and after them of other segments that touch things.
        force: (n, feet, 3) force of the ground or of things on each of these, N, in the world. It acts on the segment;
            the joint of the toes bears nothing.
        moment: (n, feet, 3) moment on each about its centre of pressure, N m, in the world.
        pressure: (n, feet, 3) centre of pressure of each, metres; zero where it bears nothing.
        center_of_pressure: (n, 3) of the feet together, metres; zero where none bears.
        stands: (n, feet) whether each stands, or touches, in the frame.
        missing: (n, 6) what the ground cannot give of the wrench that the motion needs: force, N, and moment about the
            centre of mass, N m, in the world. Zero for a motion that is possible on these feet.
        outside: (n,) by how far the zero moment point of what the feet bear is outside of their support polygon,
            metres; 0 inside, where no foot stands, and in frames that press with less than a fifth of the weight.
        lower: (nv,) least torque of each joint, N m: published strength of a person, effort limits of a robot; -inf
            where none is known.
        upper: (nv,) largest torque of each joint, N m; inf where none is known.

    Examples:
        >>> needed = wb.motion.torques(clip)
        >>> needed.torque.shape == (len(clip), human.model.nv)
        True
    """

    figure: Figure
    dt: float
    torque: Array = field(repr=False)
    strained: Array = field(repr=False)
    feet: tuple[str, ...]
    force: Array = field(repr=False)
    moment: Array = field(repr=False)
    pressure: Array = field(repr=False)
    center_of_pressure: Array = field(repr=False)
    stands: Mask = field(repr=False)
    missing: Array = field(repr=False)
    outside: Array = field(repr=False)
    lower: Array = field(repr=False)
    upper: Array = field(repr=False)

    @property
    def supported(self) -> Mask:
        """(n,) whether a foot stands, or something touches, in the frame."""
        return np.asarray(self.stands.any(axis=1))

    @property
    def flies(self) -> bool:
        """Whether there is a frame in which no foot of a figure with feet stands."""
        return bool(self.feet) and not self.supported.all()

    @property
    def share(self) -> Array:
        """(n, nv) `strained` as a share of the strength in its direction; more than 1 is more than the person can."""
        limit = np.where(self.strained >= 0.0, self.upper, -self.lower)
        return np.asarray(np.abs(self.strained) / limit)

    @property
    def largest_share(self) -> float:
        """The largest `share` of any joint in any frame."""
        return float(self.share.max(initial=0.0))

    @property
    def beyond(self) -> Mask:
        """(n,) frames in which a joint needs more than its strength."""
        return np.asarray((self.share > 1.0).any(axis=1))

    def largest(self) -> dict[str, float]:
        """Largest absolute torque of each joint over the clip, N m, by name."""
        peaks = np.abs(self.torque).max(axis=0)
        return {name: float(peaks[first:end].max()) for name, first, end in self._columns()}

    def joint_of(self, column: int) -> str:
        """Name of the joint of a column of `torque`."""
        column = checks.whole(column, "column", 0, self.figure.model.nv - 1)
        return next((name for name, first, end in self._columns() if first <= column < end), "root")

    def _columns(self) -> list[tuple[str, int, int]]:
        """Name of each joint, its first column of `torque`, and the one after its last."""
        joints = [(name, self.figure.model.joints[self.figure.joint_id(name)]) for name in self.figure.joints]
        return [(name, joint.idx_v, joint.idx_v + joint.nv) for name, joint in joints]

    def __str__(self) -> str:
        """Three lines: the joint nearest to its strength, what the ground cannot give, and how many frames stand."""
        share = self.share
        frame, column = (int(k) for k in np.unravel_index(np.argmax(share), share.shape))
        first = "no joint has a known strength"
        if np.isfinite(self.lower).any():
            first = (
                f"{self.joint_of(column)} needs {abs(self.strained[frame, column]):.0f} N m, "
                f"{share[frame, column]:.0%} of its strength, at {frame * self.dt:.2f} s; "
                f"{int(self.beyond.sum())} of {len(self.torque)} frames need more than the strength of a joint"
            )
        force, moment = (np.linalg.norm(part, axis=1) for part in (self.missing[:, :3], self.missing[:, 3:]))
        return (
            f"{first}\nthe ground cannot give, of what the motion needs: at most {force.max():.0f} N, "
            f"{moment.max():.0f} N m; in the median {np.median(force):.0f} N, {np.median(moment):.0f} N m\n"
            f"a foot stands in {int(self.supported.sum())} of {len(self.torque)} frames"
        )


def torques(
    clip: Clip,
    scene: Scene | None = None,
    *,
    feet: Sequence[str] = FEET,
    strength: Strength | None = None,
    friction: float = FRICTION,
    cutoff: float | None = CUTOFF,
) -> Torques:
    """Torques of a clip by inverse dynamics (recursive Newton-Euler, Featherstone 2008, chapter 5; `pin.rnea`).

    A figure with a free root stands on feet: the wrench that its motion needs at the root is split over the corners
    of the soles of the feet that stand, on level ground and with friction, and acts on the joints from there. In flight
    the ground gives nothing. With a scene, other segments bear on the things that they touch, along the normals there
    and within friction, at the nearest point of each piece. Where several splits give the wrench, the one with the
    least sum of squares is taken.

    Args:
        clip: the motion.
        scene: things that hands and other parts may touch; they bear while they are within 5 mm of a thing that stands,
            and slower there than 0.15 m/s.
        feet: segments that may stand; left and right foot, or the ankles of a robot. A foot stands while its heel,
            ball or tip of the toes is low and slow, or nearly on the ground and slower than 0.5 m/s, as where it comes
            down and leaves; without frames of such names, while its own frame is.
        strength: of the person, for `lower`, `upper` and `share`; median of its sex and age if left out. For figures
            whose joints have no published strength, such as robots, the effort limits of their descriptions count.
        friction: coefficient of friction of the ground.
        cutoff: Hz of the low-pass filter (Butterworth, zero lag) that takes the noise of recordings out before
            differences amplify it; None for none. It is not used where the frame rate is less than four times of it.

    Raises:
        UnknownNameError: the figure has no such foot.
        InputError: something else than a clip or a scene, a scene of a figure with other joints, a value out of range,
            or a figure without mass or feet.

    Examples:
        >>> needed = wb.motion.torques(clip, strength=wb.motion.Strength(50, "female"))
    """
    clip = checks.instance(clip, Clip, "torques: clip", "read one with wb.read_clip(path, figure)")
    friction = checks.number(friction, "torques: friction", 1e-3, 100.0)
    if cutoff is not None:
        cutoff = checks.number(cutoff, "torques: cutoff", 1e-3, 1e6, "Hz")
    strength = Strength() if strength is None else strength
    checks.instance(strength, Strength, "torques: strength", "give wb.motion.Strength(percentile=50, sex='female')")
    figure = one_figure(clip.figure, "torques: the clip's figure")
    if feet is FEET:
        feet = own_feet(figure)
    feet = checks.listed(feet, "torques: feet", "['left_foot', 'right_foot']")
    for name in feet:
        figure.frame_id(name)
    if not sum(inertia.mass for inertia in figure.model.inertias[1:]) > 0.0:
        raise InputError(f"torques: {figure.name} has no mass; give its segments masses")
    stands = standing_feet(clip, feet)
    if scene is not None:
        checks.instance(scene, Scene, "torques: scene", "make one with wb.Scene(clip.figure)")
        same_joints(clip, scene.figure, "torques")
    calm = smoothed(clip, cutoff)
    v, a = calm.velocities(), calm.accelerations()
    dynamics, names, places = bearing(clip, calm.q, stands, scene, friction)
    count, nv = len(clip), figure.model.nv
    torque, strained, missing = np.zeros((count, nv)), np.zeros((count, nv)), np.zeros((count, ROOT))
    force, moment, pressure = (np.zeros((count, len(names), 3)) for _ in range(3))
    both, outside = np.zeros((count, 3)), np.zeros(count)
    marks: Mask = np.zeros((count, len(names)), dtype=bool)
    marks[:, : len(stands)] = np.array(list(stands.values()), dtype=bool).reshape(len(stands), count).T
    for k, stand in enumerate(places):
        marks[k, stand.owner] = True
        loads = dynamics.loads(calm.q[k], v[k], a[k], stand)
        torque[k], strained[k] = loads.torque, loads.strained
        if not dynamics.free:
            continue
        forces = loads.ground.forces
        missing[k] = loads.ground.missing
        pressed = np.einsum("ij,ij->i", forces, stand.axes)
        for foot, total in enumerate(foot_wrenches(forces, stand, len(names))):
            mine = stand.owner == foot
            force[k, foot] = total[:3]
            pressure[k, foot] = _pressure(pressed[mine], stand.points[mine])
            moment[k, foot] = total[3:] - cross(pressure[k, foot], total[:3])
        standing = stand.owner < len(stands)
        both[k] = _pressure(pressed[standing], stand.points[standing])
        outside[k] = dynamics.outside(loads, stand)
    lower, upper = torque_limits(figure, strength)
    borne = names, force, moment, pressure, both, marks
    return Torques(figure, clip.dt, torque, strained, *borne, missing, outside, lower, upper)


def smoothed(clip: Clip, cutoff: float | None = CUTOFF) -> Clip:
    """The clip without frequencies above a cutoff [Hz]: Butterworth filter, forward and backward (Winter)."""
    # A clip of one frame, or with a frame rate below four times the cutoff, is not changed.
    rate = 1.0 / clip.dt
    if cutoff is None or rate < 4.0 * cutoff:
        return clip
    from scipy.signal import butter, sosfiltfilt  # it loads scipy.stats, which takes longer than a short clip

    # it runs forward and backward, so without delay and with twice this order (Winter)
    sections = butter(2, cutoff, fs=rate, output="sos")
    reach = min(len(clip) - 1, int(np.ceil(3.0 * rate / cutoff)))
    if reach < 1:
        return clip
    q: Array = clip.q.copy()
    for joint in clip.figure.model.joints:
        if joint.nq in (4, 7) and joint.nv in (3, 6):
            steady(q[:, joint.idx_q + joint.nq - 4 : joint.idx_q + joint.nq])
    filtered = sosfiltfilt(sections, q, axis=0, padtype="odd", padlen=reach)
    return clip.with_q(np.array([pin.normalize(clip.figure.model, posture) for posture in filtered]))


def _pressure(pressed: Array, points: Array) -> Array:
    """Centre of pressure (3,) of normal forces (p,) on points; zero without load."""
    load = float(pressed.sum())
    if load <= 0.0:
        return np.zeros(3)
    return np.asarray(pressed @ points / load)


def bearing(
    clip: Clip, q: Array, feet: Mapping[str, Mask], scene: Scene | None, friction: float
) -> tuple[InverseDynamics, tuple[str, ...], list[Stand]]:
    """Dynamics on feet and what else touches the scene at q (n, nq), names of both, and where frames stand."""
    figure, names, touches = clip.figure, tuple[str, ...](), list[Touches]()
    if scene is not None and figure.root == "free":
        names, touches = touching_parts(clip, scene, feet)
    joints = [figure.model.frames[figure.frame_id(name)].parentJoint for name in names]
    dynamics = InverseDynamics(figure, tuple(feet), friction, joints)
    stands = [
        dynamics.stand(posture, [bool(marks[k]) for marks in feet.values()], touches[k] if touches else None)
        for k, posture in enumerate(q)
    ]
    return dynamics, (*feet, *names), stands


def touching_parts(clip: Clip, scene: Scene, feet: Collection[str]) -> tuple[tuple[str, ...], list[Touches]]:
    """Segments other than feet that touch things of a scene that stand, and where they do in each frame."""
    figure, owners, slow = clip.figure, scene.piece_owner, RestLimits().speed
    model, data = figure.model, figure.model.createData()
    carrier = {name: name for name in figure.segments}
    carrier |= {name: each.segment for name, each in scene.objects.items() if each.segment is not None}
    joints = {name: int(model.frames[figure.frame_id(segment)].parentJoint) for name, segment in carrier.items()}
    standing = {model.frames[figure.frame_id(name)].parentJoint for name in feet}
    bearing = {name for name, joint in joints.items() if not standing & set(model.supports[joint])}
    found = list[list[tuple[str, Array, Array]]]()
    with scene.borrow() as workspace:
        for q, v in zip(clip.q, clip.velocities(), strict=True):
            pin.forwardKinematics(model, data, q, v)
            here = list[tuple[str, Array, Array]]()
            # 5 mm, as retargeted hands are up to 1 mm away, and avoiders keep a clearance
            for first, second, normal, point in _sides(workspace.near(q, 0.005)):
                mine, other = owners[first], owners[second]
                if mine in bearing and other not in carrier and other not in clip.things:
                    twist = pin.getVelocity(model, data, joints[mine], pin.ReferenceFrame.WORLD)
                    if np.linalg.norm(twist.linear + np.cross(twist.angular, point)) <= slow:
                        here.append((carrier[mine], point, normal))
            found.append(here)
    names = tuple(dict.fromkeys(segment for here in found for segment, _, _ in here))
    return names, [
        Touches(
            np.array([point for _, point, _ in here]).reshape(-1, 3),
            np.array([len(feet) + names.index(segment) for segment, _, _ in here], dtype=np.intp),
            np.array([normal for _, _, normal in here]).reshape(-1, 3),
        )
        for here in found
    ]


def _sides(near: Contacts) -> Iterator[tuple[int, int, Array, Array]]:
    """Of each pair in both orders: a piece, the other, the normal (3,) out of it, and the point (3,) of the first."""
    for number, (first, second) in enumerate(near.pair.tolist()):
        yield first, second, -near.normal[number], np.array(near.point_a[number])
        yield second, first, np.array(near.normal[number]), np.array(near.point_b[number])

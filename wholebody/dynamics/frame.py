"""What is given to a frame of the engine, and what happened in it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, brief, with_values
from wholebody.base.errors import InputError
from wholebody.geometry.placement import placement


class Event(NamedTuple):
    """One impact of A and B, which have names.

    Attributes:
        time: since the start of the frame, seconds.
        point: (3,) metres.
        normal: (3,) unit normal from A to B.
        speed: of approach, m/s.
        impulse: (3,) on B, N s; its opposite acts on A.
    """

    time: float
    first: str
    second: str
    point: Array
    normal: Array
    speed: float
    impulse: Array


class EngineFrame(NamedTuple):
    """What happened in a frame.

    Attributes:
        events: impacts in the order of their times.
        impulses: name of a body to the impulse (3,) of all its contacts during the frame, N s.
        contacts: contact points that bore a force in the last step.
        deepest: greatest depth of pieces in each other after any step, metres; 0 if none were.
        energy: kinetic and potential energy of the bodies that move by themselves, joules.
        work: energy that they were given, joules: by what is moved, during the frame, by pushes since the one before,
            and by lifting where pieces that touched were parted. The energy grows by no more. It may fall, also where
            the restitution is 1: a contact that is no impact (slower than 0.02 m/s, or of a step that could not end at
            each of its impacts) gives nothing back.
        signorini: largest residual of the programs, m/s; see `solve_kernel.residuals`.
        coulomb: likewise.
        steps: how many steps were made, those made again included.
        sleeping: bodies that sleep.
        wrenches: the impulses with their moments about the world's origin, (6,), N s and N m s.
        given: every impulse of what is moved, as an event; the speed of one that is no impact is 0.
    """

    events: tuple[Event, ...]
    impulses: Mapping[str, Array]
    contacts: int
    deepest: float
    energy: float
    work: float
    signorini: float
    coulomb: float
    steps: int
    sleeping: int
    wrenches: Mapping[str, Array]
    given: tuple[Event, ...]


def impacts(events: Sequence[Event], names: Collection[str], speed: float) -> list[Event]:
    """The impacts with bodies of these names that were faster than a speed, m/s."""
    return [event for event in events if event.speed > speed and (event.first in names or event.second in names)]


@dataclass
class FrameRecord:
    """A frame while it is being made; attributes as in `EngineFrame`."""

    __repr__ = brief

    stops: int  # early ends of steps that are left
    impulse: Array  # (n, 6) of each body, with its moment about the origin
    time: float = 0.0
    events: list[Event] = field(default_factory=list)
    given: list[Event] = field(default_factory=list)
    contacts: int = 0
    deepest: float = 0.0
    work: float = 0.0
    signorini: float = 0.0
    coulomb: float = 0.0
    steps: int = 0
    given_up: int = 0  # steps that were halved as often as they may be, and still led too deep

    def met(self, names: Collection[str], speed: float) -> bool:
        """Whether an impact with bodies of these names was faster than a speed, m/s."""
        return bool(impacts(self.events, names, speed))

    def finished(self, names: tuple[str, ...], energy: float, sleeping: int) -> EngineFrame:
        """The frame, with the names of the bodies."""
        pushed = np.flatnonzero(self.impulse.any(axis=1)).tolist()
        return EngineFrame(
            tuple(self.events), {names[k]: self.impulse[k, :3] for k in pushed}, self.contacts, self.deepest, energy,
            self.work, self.signorini, self.coulomb, self.steps, sleeping,
            {names[k]: self.impulse[k] for k in pushed}, tuple(self.given),
        )  # fmt: skip


def one_frame(frames: Sequence[EngineFrame], ends: Sequence[float]) -> EngineFrame | None:
    """Several frames that follow each other, with the times of their ends, as one; None for none."""
    if not frames:
        return None
    starts = [0.0, *ends[:-1]]
    events = [
        with_values(event, time=start + event.time)
        for start, one in zip(starts, frames, strict=True)
        for event in one.events
    ]
    wrenches: dict[str, Array] = {}
    for one in frames:
        for name, wrench in one.wrenches.items():
            wrenches[name] = wrenches.get(name, np.zeros(6)) + wrench
    return with_values(
        frames[-1],
        events=tuple(events),
        impulses={name: wrench[:3] for name, wrench in wrenches.items()},
        deepest=max(one.deepest for one in frames),
        work=sum(one.work for one in frames),
        signorini=max(one.signorini for one in frames),
        coulomb=max(one.coulomb for one in frames),
        steps=sum(one.steps for one in frames),
        wrenches=wrenches,
    )


def given_placements(kinematic: object) -> dict[str, tuple[pin.SE3, pin.SE3]]:
    """The placements before and after of what is moved in a frame, checked."""
    if kinematic is None:
        return {}
    given = checks.instance(kinematic, Mapping, "kinematic", "give {name: (placement before, after)}")
    return {name: _two_placements(pair, name) for name, pair in given.items()}


def _two_placements(pair: object, name: str) -> tuple[pin.SE3, pin.SE3]:
    """Two placements; checking each of those that are pin.SE3 already would take a frame longer than its bodies."""
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise InputError(
            f"kinematic: {checks.shown(name)} has {checks.shown(pair)}; give its placements before and after"
        )
    before, after = (
        one if isinstance(one, pin.SE3) and np.isfinite(one.homogeneous).all() else placement(one, f"kinematic: {name}")
        for one in pair
    )
    return before, after

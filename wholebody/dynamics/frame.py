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
        restitution: of their materials.
    """

    time: float
    first: str
    second: str
    point: Array
    normal: Array
    speed: float
    impulse: Array
    restitution: float


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
        lent: the part of the work by which things were lifted off segments that yield, which these have to pay, J.
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
    lent: float


def impacts(events: Sequence[Event], names: Collection[str], speed: float) -> list[Event]:
    """The impacts with bodies of these names whose rebound is faster than a speed, m/s."""
    # at least 0.2, of wood and people: a blow that does not bounce has an impulse, too
    fast = (event for event in events if max(0.2, event.restitution) * event.speed > speed)
    return [event for event in fast if event.first in names or event.second in names]


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
    lent: float = 0.0
    signorini: float = 0.0
    coulomb: float = 0.0
    steps: int = 0
    given_up: int = 0  # steps that were halved as often as they may be, and still led too deep

    def met(self, names: Collection[str], speed: float) -> bool:
        """Whether an impact with bodies of these names rebounds faster than a speed, m/s."""
        return bool(impacts(self.events, names, speed))

    def finished(self, names: tuple[str, ...], energy: float, sleeping: int) -> EngineFrame:
        """The frame, with the names of the bodies."""
        pushed = np.flatnonzero(self.impulse.any(axis=1)).tolist()
        return EngineFrame(
            tuple(self.events), {names[k]: self.impulse[k, :3] for k in pushed}, self.contacts, self.deepest, energy,
            self.work, self.signorini, self.coulomb, self.steps, sleeping,
            {names[k]: self.impulse[k] for k in pushed}, tuple(self.given), self.lent,
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
        lent=sum(one.lent for one in frames),
        signorini=max(one.signorini for one in frames),
        coulomb=max(one.coulomb for one in frames),
        steps=sum(one.steps for one in frames),
        wrenches=wrenches,
    )


class Given(NamedTuple):
    """What is moved in a frame: its names, and the placements (k, 2, 4, 4) before and after."""

    names: list[str]
    placed: Array

    def and_others(self, others: Mapping[str, tuple[pin.SE3, pin.SE3]]) -> Given:
        """These and others."""
        if not others:
            return self
        placed = [[one.homogeneous for one in both] for both in others.values()]
        return Given([*self.names, *others], np.concatenate([self.placed, placed]))

    def way(self, name: str) -> Array:
        """The twist (6,) at the world's origin by which one of them moves in a unit of time."""
        before, after = (pin.SE3(one) for one in self.placed[self.names.index(name)])
        return np.asarray(pin.log6(after * before.inverse()).vector)


def given_placements(kinematic: object) -> Given:
    """What is moved in a frame, checked."""
    if isinstance(kinematic, Given):
        return kinematic
    if kinematic is None:
        return Given([], np.zeros((0, 2, 4, 4)))
    given = checks.instance(kinematic, Mapping, "kinematic", "give {name: (placement before, after)}")
    pairs = [pair if _usual(pair) else _two_placements(pair, name) for name, pair in given.items()]
    placed = np.array([(before.homogeneous, after.homogeneous) for before, after in pairs]).reshape(-1, 2, 4, 4)
    if not np.isfinite(placed).all():
        placed = np.array([[one.homogeneous for one in _two_placements(pair, name)] for name, pair in given.items()])
    return Given(list(given), placed)


def _usual(pair: object) -> bool:
    return type(pair) is tuple and len(pair) == 2 and type(pair[0]) is type(pair[1]) is pin.SE3


def _two_placements(pair: object, name: str) -> tuple[pin.SE3, pin.SE3]:
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise InputError(
            f"kinematic: {checks.shown(name)} has {checks.shown(pair)}; give its placements before and after"
        )
    before, after = (placement(one, f"kinematic: {name}") for one in pair)
    return before, after


def bounded(value: object, most: float, what: str, count: int = 3) -> Array:
    """So many numbers, none of them beyond `most`."""
    numbers = np.array(checks.numbers(value, (count,), what))
    if np.abs(numbers).max() > most:
        raise InputError(f"{what} is {checks.shown(value)}; give at most {most:g}")
    return numbers

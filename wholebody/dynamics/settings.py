"""The numbers of the engine; what each trades stands at its name. Those of a compiled loop stand at its head."""

from __future__ import annotations

from typing import NamedTuple

SKIN = 5e-5  # m: gap at which bodies rest: coal's distances stay positive, its normals right to 0.02 rad


class StepNumbers(NamedTuple):
    """Steps of a frame.

    Attributes:
        longest: s: of a step. Smaller: more accurate and slower.
        shortest: s: of a step that ends with an impact.
        margin: m: pairs are looked at from this much farther than bodies come in a step.
        stops: most early ends of steps in a frame while at most `few` bodies move ...
        few: ... and fewer in proportion with more of them: each stop costs a step of all bodies.
        inside: m: a step that leaves pieces deeper in each other is made again.
        shallow: m: the same for the first try of a step. Smaller: more steps made again, fewer pieces to part.
        halvings: most of a step.
        given_up: steps of a frame that are too deep even so; then nothing helps, as where bodies are pushed together.
        foreseen: times that a step is made again with the points where it led too deep, before it is halved.
        least_gap: m: pieces nearer than this are parted before the next step.
        separations: rounds of parting pieces after a step.
        closings: most programs of a step with joints: each closes what the one before left by bodies' turning.
        fine: s: in shorter steps joints only keep their velocities; rounding over such a time is no velocity.
        closed: m: by which joint points may be apart at the end of a step.
    """

    longest: float = 1.0 / 240.0
    shortest: float = 1e-6
    margin: float = 2e-3
    stops: int = 8
    few: int = 12
    inside: float = 1e-4
    shallow: float = 2e-5
    halvings: int = 6
    given_up: int = 3
    foreseen: int = 2
    least_gap: float = 2e-6
    separations: int = 4
    closings: int = 6
    fine: float = 1e-5
    closed: float = 1e-9


class ProgramNumbers(NamedTuple):
    """The program of a step.

    Attributes:
        touch: m: a gap larger than `SKIN` by this still touches.
        tolerance: m/s: 0.4 um of the way of a step.
        unsolved: m/s: impulses of points that push against what is moved, and are off by more, are not started from.
        visits: points times sweeps of an island. More: more exact and slower.
        sweeps: most of an island.
        events: most impacts at one stop.
    """

    touch: float = 1e-5
    tolerance: float = 1e-4
    unsolved: float = 1.2e-4
    visits: int = 20_000
    sweeps: int = 1000
    events: int = 1000


class PassingNumbers(NamedTuple):
    """Pairs that are followed on their way during a step.

    Attributes:
        places: most of one pair; what would need more is doubtful.
        doubts: most pairs that are followed.
        earliest: share of a step: of meetings before it, the points are taken there.
    """

    places: int = 64
    doubts: int = 50
    earliest: float = 0.1


class SleepNumbers(NamedTuple):
    """Bodies that sleep.

    Attributes:
        still: m/s of every point of a body: slower bodies may sleep.
        after: s that all bodies of an island are so slow before they sleep.
        touching: m: nearer bodies wake each other.
        moved: m: by which what touches a sleeper wakes it; less than `SKIN`, so none gets inside.
    """

    still: float = 5e-3
    after: float = 0.5
    touching: float = 1e-3
    moved: float = 3e-5


class PushNumbers(NamedTuple):
    """Impulses of a figure that is stopped by contact.

    Attributes:
        blocked: rad, m: by which contact keeps a joint from where the spring wants it; less is the method's accuracy.
        touch: m: nearer pieces touch; a figure stops short of things by less.
        rounds: of impulses over all contacts: with several contacts one undoes a part of another.
        slow: m/s: slower approaches do not bounce, so that what is held lies still.
        least: m/s: slower approaches are none.
    """

    blocked: float = 1e-3
    touch: float = 1.5e-3
    rounds: int = 10
    slow: float = 0.05
    least: float = 1e-6


STEP, PROGRAM, PASSING_PAIRS = StepNumbers(), ProgramNumbers(), PassingNumbers()
SLEEP, PUSH = SleepNumbers(), PushNumbers()

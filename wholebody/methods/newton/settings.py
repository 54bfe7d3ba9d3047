"""The numbers of Newton's method; what each trades stands at its name."""

from __future__ import annotations

from typing import NamedTuple


class Steps(NamedTuple):
    """Steps of the iteration."""

    hard_damping: float = 1e-10  # of joints and constraints: redundant equations are tolerated at this loss of accuracy
    goal_damping: float = 1e-7  # of goals, far larger, so that they give way first
    first_damping: float = 1e-5  # after a failed step
    most_damping: float = 1e4  # beyond it a failed step ends the iteration
    damping_up: float = 8.0  # factors after a failed step, and after a good one
    damping_down: float = 0.1
    hard_share: float = 1e-6  # of the squared damping applies to constraints, for conflicts among them
    # m or rad: largest reduction of a goal's error in a step. Larger: fewer steps, more of them fail
    error_clamp: float = 0.3
    # change of Euler parameters in a step, half the radians. Larger: beyond what a linearisation says
    largest_turn: float = 0.35
    # motion per metre of target beyond which a step is damped: the equations are nearly singular there
    amplified: float = 6.0
    # m or rad: goal error from which that is tested; nearer, the measures may move more than the goals
    far: float = 0.05
    # m or rad of violation allowed for a metre of goal, and at most; beyond it a step only restores. Larger: longer
    # steps; at metres, goals far out of reach pull chains open so far that they do not close again
    funnel: float = 0.5
    gain: float = 0.05  # least ratio of actual to predicted reduction of a step
    restored: float = 0.2  # the same for a step that only restores the constraints
    least_progress: float = 1e-6  # relative reduction below which a step counts as no progress
    patience: int = 12  # steps without progress in a row after which the iteration counts as stationary
    systems: int = 25  # most linear systems a step, while the active set changes


class Frames(NamedTuple):
    """Frames of a drag."""

    iterations: int = 12  # most of one frame; a farther goal is followed over several frames
    tolerance: float = 1e-4  # m, rad: of the goals; the end of a drag is solved to the method's tolerance
    hard_tolerance: float = 1e-6  # m, rad: of joints and contacts of assemblies
    least_progress: float = 0.1  # relative reduction below which a step counts as no progress
    patience: int = 2  # steps without progress in a row after which a frame ends
    # of a frame's processor time, where that is bounded, for steps towards the goals and for trying states nearby; the
    # others restore
    time_share: float = 0.5


class Endings(NamedTuple):
    """What follows where the equations cannot all hold."""

    restorations: int = 30  # most steps that only restore the constraints, after the goals were not met
    # of goals out of reach, so that they give way to constraints by 1e8, not 1e3. Larger: slower
    goal_damping: float = 1e-2
    # random motions tried from a saddle; joint limits send some of them back. More: more time where a goal is out of
    # reach
    nudges: int = 3
    nudge: float = 0.05  # parts of a quaternion, and of a body's size: these motions
    gain: float = 1e-2  # least share of the error by which the end of another iteration is lower


class Refinement(NamedTuple):
    """The descent of the measures along the equations."""

    rounds: int = 40  # most rounds
    motion: float = 1e-2  # weight of the motion. Smaller: faster, less stable for degrees of freedom without measures
    longer: float = 1.3  # factors on the length of a step after a round that was kept, and one that was not
    shorter: float = 0.5
    shortest: float = 0.02  # least length; where shorter steps do not lower the measures, the last state is the minimum
    # of the tolerances, to which a round returns to the equations: larger errors would lower the measures
    finer: float = 0.1
    back: int = 6  # most Newton steps back to the equations
    # m^2 per unit of effort [rad^2]: measures against motion. Larger: nearer to the least measure
    stiffness: float = 10.0
    least_stiffness: float = 0.03  # rad^-2: half of the least second derivative of a joint


class Starts(NamedTuple):
    """The search over starts."""

    # of the tolerance, to which the equations are solved: an assessment uses norms over the rows of a goal
    sharper: float = 0.3
    trial: int = 30  # iterations in which another start must come nearer than the best so far
    iterations: int = 250  # after which no other start follows. More: more is solved, later; one to four seconds
    # other starts where a goal is farther than the limbs are long: none solves it, one may come nearer past things
    beyond: int = 2
    longest: float = 20.0  # s of processor time: several times what these take
    # of the time limit for other starts: the last iteration, towards the least violation, takes time too
    time_share: float = 0.5
    alike: float = 1e-5  # relative difference of goal errors up to which two results count as equally near


class ContactNumbers(NamedTuple):
    """Contacts as inequalities."""

    # m beyond the clearance: nearer pairs become inequalities. Larger: more rows, fewer repeated steps
    enter: float = 0.03
    # m beyond the clearance: farther pairs cease to be; the difference avoids changes of the structure
    leave: float = 0.06
    slots: int = 4  # rows a pair: its witness points and the ends of its contact patch
    overlap: float = 1e-3  # m: a step is undone if a pair that was no inequality gets deeper than this
    deepest: float = 0.01  # m: largest overlap of linearised contacts after a step; a deeper one shortens the step
    shallow: float = 0.25  # largest such overlap as a share of the thinner piece's width
    # m: largest motion of a body in a step if pairs can touch. Larger: faster, fewer contacts seen
    longest: float = 0.08
    more: float = 1e-4  # m: growth of an existing overlap that a step is allowed


STEPS, FRAMES, ENDINGS, REFINEMENT = Steps(), Frames(), Endings(), Refinement()
STARTS, CONTACTS = Starts(), ContactNumbers()

"""The numbers of Newton's method; what each trades stands at its name."""

from __future__ import annotations

from typing import NamedTuple


class Steps(NamedTuple):
    """Steps of the iteration.

    Attributes:
        hard_damping: of joints and constraints: redundant equations are tolerated at this loss of accuracy.
        goal_damping: of goals, far larger, so that they give way first.
        first_damping: after a failed step.
        most_damping: beyond it a failed step ends the iteration.
        damping_up, damping_down: factors after a failed step, and after a good one.
        hard_share: of the squared damping applies to constraints, for conflicts among them.
        restoring_damping: of goals in a step that only restores: they keep their errors, but may give way.
        error_clamp: m or rad: largest reduction of a goal's error in a step. Larger: fewer steps, more of them fail.
        largest_turn: change of Euler parameters in a step, half the radians. Larger: beyond what a linearisation says.
        amplified: motion per metre of target beyond which a step is damped: the equations are nearly singular there.
        far: m or rad: goal error from which that is tested; nearer, the measures may move more than the goals.
        funnel: m or rad of violation allowed for a metre of goal; beyond it a step only restores. Larger: longer steps.
        narrow: factor on the funnel after a step that only restores.
        gain: least ratio of actual to predicted reduction of a step.
        restored: the same for a step that only restores the constraints.
        least_progress: relative reduction below which a step counts as no progress.
        patience: steps without progress in a row after which the iteration counts as stationary.
        systems: most linear systems a step, while the active set changes.
    """

    hard_damping: float = 1e-10
    goal_damping: float = 1e-7
    first_damping: float = 1e-5
    most_damping: float = 1e4
    damping_up: float = 8.0
    damping_down: float = 0.1
    hard_share: float = 1e-6
    restoring_damping: float = 0.03
    error_clamp: float = 0.3
    largest_turn: float = 0.35
    amplified: float = 6.0
    far: float = 0.05
    funnel: float = 0.5
    narrow: float = 0.7
    gain: float = 0.05
    restored: float = 0.2
    least_progress: float = 1e-6
    patience: int = 12
    systems: int = 25


class Frames(NamedTuple):
    """Frames of a drag.

    Attributes:
        iterations: most of one frame; a farther goal is followed over several frames.
        tolerance: m, rad: of the goals; the end of a drag is solved to the method's tolerance.
        hard_tolerance: m, rad: of joints and contacts of assemblies.
        least_progress: relative reduction below which a step counts as no progress.
        patience: steps without progress in a row after which a frame ends.
        time_share: of a frame's processor time, where that is bounded, for steps towards the goals and for trying
            states nearby; the others restore.
    """

    iterations: int = 12
    tolerance: float = 1e-4
    hard_tolerance: float = 1e-6
    least_progress: float = 0.1
    patience: int = 2
    time_share: float = 0.5


class Endings(NamedTuple):
    """What follows where the equations cannot all hold.

    Attributes:
        restorations: most steps that only restore the constraints, after the goals were not met.
        goal_damping: of goals out of reach, so that they give way to constraints by 1e8, not 1e3. Larger: slower.
        nudges: random motions tried from a saddle; joint limits send some of them back. More: more time where a goal is
            out of reach.
        nudge: parts of a quaternion, and of a body's size: these motions.
        gain: least share of the error by which the end of another iteration is lower.
    """

    restorations: int = 30
    goal_damping: float = 1e-2
    nudges: int = 3
    nudge: float = 0.05
    gain: float = 1e-2


class Refinement(NamedTuple):
    """The descent of the measures along the equations.

    Attributes:
        rounds: most rounds.
        motion: weight of the motion. Smaller: faster, less stable for degrees of freedom without measures.
        longer, shorter: factors on the length of a step after a round that was kept, and one that was not.
        shortest: least length; where shorter steps do not lower the measures, the last state is the minimum.
        finer: of the tolerances, to which a round returns to the equations: larger errors would lower the measures.
        back: most Newton steps back to the equations.
        stiffness: m^2 per unit of effort [rad^2]: measures against motion. Larger: nearer to the least measure.
        least_stiffness: rad^-2: half of the least second derivative of a joint.
    """

    rounds: int = 40
    motion: float = 1e-2
    longer: float = 1.3
    shorter: float = 0.5
    shortest: float = 0.02
    finer: float = 0.1
    back: int = 6
    stiffness: float = 10.0
    least_stiffness: float = 0.03


class Starts(NamedTuple):
    """The search over starts.

    Attributes:
        sharper: of the tolerance, to which the equations are solved: an assessment uses norms over the rows of a goal.
        trial: iterations in which another start must come nearer than the best so far.
        time_share: of the time limit for other starts: the last iteration, towards the least violation, takes time too.
        alike: relative difference of goal errors up to which two results count as equally near.
    """

    sharper: float = 0.3
    trial: int = 30
    time_share: float = 0.5
    alike: float = 1e-5


class ContactNumbers(NamedTuple):
    """Contacts as inequalities.

    Attributes:
        enter: m beyond the clearance: nearer pairs become inequalities. Larger: more rows, fewer repeated steps.
        leave: m beyond the clearance: farther pairs cease to be; the difference avoids changes of the structure.
        slots: rows a pair: its witness points and the ends of its contact patch.
        overlap: m: a step is undone if a pair that was no inequality gets deeper than this.
        deepest: m: largest overlap of linearised contacts after a step; a deeper one shortens the step.
        shallow: largest such overlap as a share of the thinner piece's width.
        longest: m: largest motion of a body in a step if pairs can touch. Larger: faster, fewer contacts seen.
        more: m: growth of an existing overlap that a step is allowed.
    """

    enter: float = 0.03
    leave: float = 0.06
    slots: int = 4
    overlap: float = 1e-3
    deepest: float = 0.01
    shallow: float = 0.25
    longest: float = 0.08
    more: float = 1e-4


STEPS, FRAMES, ENDINGS, REFINEMENT = Steps(), Frames(), Endings(), Refinement()
STARTS, CONTACTS = Starts(), ContactNumbers()

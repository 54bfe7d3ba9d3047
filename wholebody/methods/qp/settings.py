"""The settings of the QP method, and its constants as frozen records; each name states its trade-off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from wholebody.base.fields import Checked
from wholebody.methods.base import BUDGET, Iterations, Restarts, Seed, TimeLimit, Tolerance


@dataclass(frozen=True)
class Settings(Checked):
    """What `QP` is set by."""

    solver: str = "osqp"
    hot_start: bool = True
    tolerance: Tolerance = 1e-5
    iterations: Iterations = 150
    budget: Annotated[int, BUDGET] = 1500
    restarts: Restarts = 40
    restarts_for_measure: Restarts = 0
    seed: Seed = 0
    measures: bool = True
    time_limit: TimeLimit = None


class Weights(NamedTuple):
    """Weights of the rows, 1/m^2 or 1/rad^2, in the order in which they give way."""

    force: float = 1e4  # 1/m: what all goals together pull with, however far they are
    least: float = 1e4  # of a goal's row with the largest weight
    most: float = 1e8
    hold: float = 1e10  # of equalities
    elastic: float = 1e10  # of contacts and inequalities


class Corrections(NamedTuple):
    """How active sets are corrected: the numbers of the algorithm."""

    # violation at x = 0, metres, above which a row is in the first round. More: larger programs; less: rounds.
    near: float = -0.03
    rounds: int = 8  # most times that violated rows are added before all rows are in
    most: int = 120  # corrections of one set before another solver is asked
    of_guess: int = 12  # corrections of a set that was guessed from an approximate answer
    at_once: int = 8  # how many of them correct all that is wrong; as that may cycle, later ones change the worst entry
    tolerance: float = 1e-11  # by which x may be out of its box and a row violated, radians and metres


class ProgramNumbers(NamedTuple):
    """How programs are built."""

    # share of the curvature left where measures do not count: they still say which joints move
    proximal_share: float = 0.01
    hold_share: float = 3.0  # what a metre of hold counts against a metre of goal when a step is judged
    elastic_share: float = 10.0  # and a metre of overlap; above any ratio at which overlap could buy goal
    lever: float = 1.0  # m: of a limb; larger = more damping of every joint while a goal is out of reach
    # share of the largest curvature that a degree of freedom has which no measure speaks for
    least_curvature: float = 1e-3
    # m per rad of radius that one program asks for. Larger: fewer iterations in the open, more bounds that bind and
    # more rejected steps in clutter.
    error_clamp: float = 0.4
    box: float = 2.0  # radii. Half width of the box. Smaller: it binds where asking for little would do.
    # of the largest goal weight. Smaller: light goals are met late or not; larger: weights farther apart than this
    # count as this.
    least_share: float = 1e-3
    heaviest_curvature: float = 5e3  # 1/rad^2. Heavier measures are scaled to this. Larger: they hold goals back.


class DescentNumbers(NamedTuple):
    """A descent."""

    first_radius: float = 0.3  # rad, m. Larger: fewer iterations in the open, more rejected ones in clutter.
    largest_radius: float = 0.8  # rad, m. Larger: linearisations believed beyond what they say.
    # where feasibility alone is asked, shares of the squared error: at first, and after a step was rejected. Less:
    # fewer programs in the open, more rejected ones.
    full_step_damping: tuple[float, float] = (0.5, 2.0)
    # share of the violation that a step must take away where feasibility alone is asked, or the descent goes on as
    # others do. Less: it crawls where it is far or stuck.
    full_step_gain: float = 0.05
    # m. Pairs nearer than what a step asks for have rows, and at least those nearer than this. Larger: more rows;
    # smaller: more steps blocked by what they did not see.
    least_within: float = 0.05
    # m. No pair farther apart than this has a row. Larger: slower; smaller: more steps blocked by what they did not
    # see.
    most_within: float = 0.12
    # m per rad of the last step, beyond which pairs have no row either. Larger: more rows; smaller: steps that meet
    # what they did not see.
    within_step: float = 1.0
    # least predicted reduction, as a share of the violation. Smaller: slow to see that a goal is out of reach.
    least_gain: float = 1e-3
    least_gain_alone: float = 1e-7  # least share of the violation to gain, with measures and without
    # m, rad: violation of holds and contacts that the next step is trusted to repair. Larger: more steps that are taken
    # back.
    restorable: float = 0.03
    near_met: float = 1e-4  # m, rad. Residuals below which multipliers act. Larger: they act on what has other causes.
    # violation allowed while measures improve, at first. Wider: longer steps along constraints, more to restore.
    width: float = 0.02
    # measures lead once they gain more than this times the squared violation. Smaller: they lead earlier, far from the
    # goals.
    switch: float = 10.0
    worth: float = 0.05  # share of the predicted reduction that a step must achieve. Larger: more steps rejected.
    good: float = 0.5  # share above which the next step may be longer
    poor: float = 0.25  # share below which it must be shorter
    along: float = 3.0  # tangential parts that a step is where they grow. Larger: faster down, rejected more often.
    # rad, m: distance of a bound from which on the way to it is tangential. Larger: steps to joint limits count as met
    # goals; much smaller: joints that a bound stops bend the normal part.
    room: float = 1e-3


class SeedNumbers(NamedTuple):
    """Seeds of chains."""

    # m, rad: of the steps at the goals, as in `DampedLeastSquares`. Less: errors vanish in fewer steps, steps near
    # singular postures are wild.
    damping: float = 1e-3
    steps: int = 60  # most of a descent; those that reach their goals take 5 to 20
    together: int = 10  # seeds of a batch
    batches: int = 25  # most. More: fewer problems are left to the slower search, which then begins later.
    # batches whose ends are led to the least effort, where goals leave joints free. More: less effort, more in vain.
    weighed: int = 4
    compared: int = 5  # ends of which the one of least effort is taken. More: less effort, more time.
    samples: int = 24  # values of the joint of seven that a closed form holds. More: less effort, more time.
    finer: int = 96  # the same where no posture of these is within limits. More: random seeds are tried less often.
    worth: float = 0.9  # share of the effort of an answer below which a rejected end is descended from too
    near: int = 3  # ends near goals that no posture meets from which the nearest is sought. More: nearer, more time.
    differing: float = 0.1  # rad or m by which these differ
    deep: float = 5e-3  # m: of a posture inside of a thing that no tolerance of the goals leads out of


class FeasibilityNumbers(NamedTuple):
    """Feasibility without regard to the measures."""

    # rad, m: most that a degree of freedom moves in a program; larger = fewer programs, limbs jump over others
    step: float = 0.2
    least_step: float = 1e-3  # rad, m: of the box; smaller = slower to end where steps go to and fro
    # share of the squared error, as in `sqp`; less = dozens of bounds hold a step, and programs are dear
    damping: float = 0.05
    within: float = 0.1  # m: pairs nearer than this get rows
    wide: float = 5.0  # rad: range from which a joint may be taken from one limit to the other
    # share of the violation, or `progress`, that must go in `patience` programs, else nothing leads nearer
    slow: float = 0.1
    progress: float = 0.1  # see `slow`; m, rad
    patience: int = 6  # see `slow`


class NearestNumbers(NamedTuple):
    """Descents to the closest posture, with second derivatives."""

    # m. Nearer pairs have rows where things count. Larger: more rows; smaller: steps that meet things unseen.
    within: float = 0.12
    radius: float = 0.5  # rad, m: trust region of the first step
    largest_radius: float = 1.0  # and of any. Larger: fewer programs, more rejected ones.
    held: float = 1e-2  # m, rad: holds missed by more than this do not bend; what they pull with says nothing yet
    # share of the violation that a step must be predicted to gain, or it is at rest. Smaller: more programs, nearer.
    flat: float = 1e-3
    nearly_flat: float = 1e-2  # the same where only the size of the residual counts
    # share of the largest curvature that every direction has at least. Less: active sets that go in circles, dearer
    # programs; more: shorter steps, ends farther off (at 0.2 by centimetres).
    damping: float = 3e-2
    negligible: float = 1e-2  # share of the largest curvature below which a direction is left out


class SearchNumbers(NamedTuple):
    """A search over starts."""

    # programs of a relaxed probe. More: surer along curved paths, and fewer starts within the budget.
    probe_programs: int = 40
    # m: depth that a relaxed probe may first have, from the start (of 31 postures of arms that cross it finds 7 with 0,
    # 18 with 0.07, 9 with 0.15) and from others. More: limbs change sides more easily, and are harder to separate.
    start_depth: float = 0.07
    relaxation_depth: float = 0.15
    # probes from beside goals. More: goals behind things are found more often, and what none reaches takes longer.
    beside: int = 40
    displaced: float = 0.5  # m, rad: of goals along each axis, the standard deviation. Less: the same side of things.
    # tolerances within which such a relaxed probe must come for the second one to follow. More: more second ones in
    # vain.
    reached: float = 10.0
    reach_trials: int = 10  # most descents without contacts that tell whether goals are out of reach
    reach_trial_programs: int = 60  # most programs of each
    # shares of the joints' ranges that their starts may be away by. Smaller: local minima are taken for the edge of
    # reach.
    far: tuple[float, float] = (1.0, 0.6)
    # share of the goals' residual by which constraints may be missed where one ends that counts. Less: ends far from
    # the goals do not count, and probes go on in vain.
    held: float = 1e-2
    agreeing: int = 7  # of them that must come to rest equally near. Fewer: faster, and reachable goals are given up.
    # degrees of freedom that move the goals; with fewer, minima lie apart, programs are cheap, and starts are all over
    # the limits
    few: int = 12
    agreeing_few: int = 8  # the same with so few
    reach_trials_few: int = 16  # most descents with so few
    # ends of probes with so few before their minima count as all. Fewer: a second configuration of an arm may stay
    # unseen.
    fewest_descents: int = 12
    agree: float = 1.1  # times the least violation up to which they count as equally near
    coming_near: int = 40  # most programs from there to the nearest posture among things
    inside_probes: int = 5  # seeded starts for goals inside of things, which only look for the nearest posture
    staying: int = 40  # most programs that improve the measures at the nearest posture to goals that are not met
    optimal: float = 1e-2  # rad: first-order optimality of a contact's answer from which on it counts as none
    # share of a contact's measures below which those at its place count as another minimum. Less: ends at kinks stay.
    lower: float = 0.9995
    # share below which they are looked for again, at the place of that minimum. More: slower.
    moved: float = 0.99
    # how many starts for the measures are descended from where it is none after all. More: lower, slower.
    poor: int = 2
    # times the measures of a descent through everything above which a lower minimum is sought. Less: lower, slower.
    dear: float = 2.0
    # feasible postures that are looked for, for each that is descended from; more = lower measures, slower
    screened: int = 4


class StepNumbers(NamedTuple):
    """Programs of tracking steps."""

    # rad, m. A goal that jumps asks for `error_clamp` times this in a step. Larger: faster, and more to second order.
    radius: float = 0.1
    # of the pull of goals out of reach. Larger: slower to close in; smaller: limbs oscillate at obstacles.
    damping: float = 2.0
    # s in which measures decrease by 1/e beside goals. Longer: slower to settle; shorter: joints swing about the
    # optimum.
    settling: float = 1.0
    resting: float = 1e-5  # m, rad: a goal missed by less than this, and more than predicted, rests; less is reached
    # m, rad: by how much a step runs ahead of a hold as the last one was curved; more overshoots after jumps
    curved: float = 1e-4
    # damping that makes no difference to how a step looks. Larger: limbs jump where a goal is just blocked.
    little: float = 0.01
    worse: float = 2.0  # times the damping of a program that its answer may ask for before it is solved again with that
    # m rad: change of a step's motion times its turn above which it is looked at how it curves what is held. Larger:
    # feet off by micrometres after jumps; smaller: more looks.
    bent: float = 5e-5
    # m, rad by which what is held may be curved differently than predicted. Smaller: more programs; larger: feet
    # farther off.
    straight: float = 1.5e-6
    traded: float = 0.5  # see `StepProgram.solve`: greater = weights count in more steps, and light goals wait in more.
    again: int = 2  # times that a program is solved again at most. More: smoother at obstacles, dearer steps there.


class TrackingNumbers(NamedTuple):
    """Steps of a tracker, and frames of several."""

    # m beyond the clearance within which pairs have rows. Larger: more rows a step; smaller: fast steps are cut.
    least_within: float = 0.06
    largest_within: float = 0.5  # m. Larger: faster motions uncut, at the price of rows.
    headroom: float = 2.5  # times the last step's motion. Less than 2 would cut every step; more: more rows.
    # times what turning brings nearer, roughly: a step that leaves all pairs more room is not looked at
    spare: float = 10.0
    # times that much and more at the end is too much half way too, where a straight way bows by a quarter
    midway: float = 4.0
    # programs that ask again for what turning brought nearer. More: fewer cut steps, each a program more.
    corrections: int = 3
    cuts: int = 6  # times that a step is halved before it is given up
    of_a_frame: float = 1e-4  # m, rad: to which the goals of a frame are met
    # most of a frame, and of one that is asked for more exactly than that; more = nearer to a goal that turns quickly,
    # dearer frames where it cannot be met. With 3 for both, one exact frame in twenty ends 1e-5 m short.
    programs: tuple[int, int] = (3, 6)
    # m, rad: constraints are violated by more where joints brake for their limits: they do not then
    braked: float = 1e-6
    out: float = 5e-5  # m: overlap with what came into the figure that is left; half of what counts as an overlap
    worth: float = 0.5  # share of the error that another program must leave at most for one more to follow
    room: float = 2.0  # times what a pair may get nearer by turning: with more room after a step it is not looked at
    off: float = 6e-3  # rad: by which coal's normal may be off, as it stops within 1e-6 m of the distance
    # m: by which turning may bring things nearer than the linearisation says without being looked after
    unseen: float = 1e-4
    # m: the same of pairs whose clearance is less; beside coal's accuracy, so that none ends inside
    inside: float = 5e-6


class EscapeNumbers(NamedTuple):
    """Postures that are free where a thing came too fast."""

    random: int = 150  # more starts; more = free postures are missed less, and a frame that has none costs more
    farthest: float = 1.0  # m, rad: of a random start, where no bound is nearer
    # m: pairs nearer than this are parted; farther ones cost more and may come in the way of a step
    within: float = 0.02
    gap: float = 3e-4  # m: to which pairs are parted; a round is exact to first order only
    rounds: int = 25  # from one start, at most
    worth: float = 0.95  # share of the depth that a round must leave at most, or else it is weak
    weak: int = 3  # rounds from one start that may be weak; larger is slower and finds more


WEIGHTS, CORRECTIONS = Weights(), Corrections()
PROGRAM = ProgramNumbers()
DESCENT = DescentNumbers()
FEASIBILITY = FeasibilityNumbers()
SEEDS = SeedNumbers()
NEAREST = NearestNumbers()
SEARCH = SearchNumbers()
STEP = StepNumbers()
TRACKING = TrackingNumbers()
ESCAPE = EscapeNumbers()

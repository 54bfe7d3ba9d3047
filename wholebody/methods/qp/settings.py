"""The settings of the QP method, and its constants as frozen records; each name states its trade-off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from wholebody.base.fields import Checked
from wholebody.methods.base import BUDGET, Iterations, Restarts, Seed, TimeLimit, Tolerance


@dataclass(frozen=True)
class Settings(Checked):
    """What `QP` is set by."""

    solver: str = "active_set"
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

    near: float = -0.03  # m: violation at x = 0 above which a row is in the first round. More: larger programs.
    rounds: int = 8  # most times that violated rows are added before all rows are in
    # corrections of one set before semismooth Newton steps. More: sets are corrected in vain; fewer: dearer steps.
    most: int = 12
    tolerance: float = 1e-11  # by which x may be out of its box and a row violated, radians and metres


class ProgramNumbers(NamedTuple):
    """How programs are built."""

    proximal_share: float = 0.01  # of the curvature where measures do not count: it still says which joints move
    hold_share: float = 3.0  # what a metre of hold counts against a metre of goal when a step is judged
    elastic_share: float = 10.0  # and a metre of overlap
    lever: float = 1.0  # m: of a limb; larger = more damping of every joint while a goal is out of reach
    least_curvature: float = 1e-3  # share of the largest that a degree of freedom has which no measure speaks for
    # m per rad of radius that one program asks for. Larger: fewer iterations in the open, more rejected in clutter.
    error_clamp: float = 0.4
    box: float = 2.0  # radii. Half width of the box. Smaller: it binds where asking for little would do.
    least_share: float = 1e-3  # of the largest goal weight. Smaller: light goals are met late or not.
    heaviest_curvature: float = 5e3  # 1/rad^2. Heavier measures are scaled to this. Larger: they hold goals back.


class DescentNumbers(NamedTuple):
    """A descent."""

    first_radius: float = 0.3  # rad, m. Larger: fewer iterations in the open, more rejected ones in clutter.
    largest_radius: float = 0.8  # rad, m. Larger: linearisations believed beyond what they say.
    # where feasibility alone is asked, shares of the squared error: at first, and after a step was rejected. Less:
    # fewer programs in the open, more rejected ones.
    full_step_damping: tuple[float, float] = (0.5, 2.0)
    full_step_gain: float = 0.05  # share of the violation that such a step must take away. Less: it crawls where stuck.
    # m. Pairs nearer than what a step asks for have rows, and at least those nearer than this. Larger: more rows.
    least_within: float = 0.05
    most_within: float = 0.12  # m: no pair farther apart has a row. Smaller: steps blocked by what they did not see.
    within_step: float = 1.0  # m per rad of the last step, beyond which pairs have no row either; likewise
    # share of the violation that is the least to gain, with measures and without. Smaller: slow to see what is out of
    # reach.
    least_gain: float = 1e-3
    least_gain_alone: float = 1e-7
    restorable: float = 0.03  # m, rad: violation that the next step is trusted to repair. Larger: more taken back.
    near_met: float = 1e-4  # m, rad. Residuals below which multipliers act. Larger: they act on what has other causes.
    width: float = 0.02  # of the funnel at first. Wider: longer steps along constraints, more to restore.
    switch: float = 10.0  # times the squared violation that measures lead above. Smaller: they lead far from the goals.
    worth: float = 0.05  # share of the predicted reduction that a step must achieve. Larger: more steps rejected.
    good: float = 0.5  # share above which the next step may be longer
    poor: float = 0.25  # share below which it must be shorter
    # rad, m: distance of a bound below which motion to it is tangential. Larger: steps to joint limits count as met
    # goals; much smaller: joints that a bound stops bend the normal part.
    room: float = 1e-3


class SeedNumbers(NamedTuple):
    """Seeds of chains."""

    damping: float = 1e-3  # m, rad: of the steps at the goals. Less: faster there, wild near singular postures.
    steps: int = 60  # most of a descent; those that reach their goals take 5 to 20
    together: int = 10  # seeds of a batch
    batches: int = 25  # most. More: fewer problems are left to the slower search, which then begins later.
    weighed: int = 2  # batches led to the least effort where joints are left free. More: less effort, more in vain.
    sparse: int = 3  # most batches for as many ends as are compared. More: less effort where few seeds lead to goals.
    compared: int = 5  # ends of which the one of least effort is taken. More: less effort, more time.
    samples: int = 24  # values of the joint of seven that a closed form holds. More: less effort, more time.
    finer: int = 96  # the same where no posture of these is within limits. More: random seeds are tried less often.
    spread: int = 144  # values of joints that a singular placement leaves free, of Fibonacci. More: more is found.
    worth: float = 0.9  # share of the effort of an answer below which a rejected end is descended from too
    ahead: float = 0.05  # m: least gap of a posture along a branch that counts as this. Less: edges take more looks.
    edge: float = 3e-6  # m: gap at which such a posture is at the edge of what is free. Less: less effort, more looks.
    gain: float = 1e-4  # share of the effort that another look at an edge is worth. Less: less effort, more looks.
    closer: int = 16  # most looks at postures on the way to one edge
    near: int = 3  # ends near goals that no posture meets from which the nearest is sought. More: nearer, more time.
    differing: float = 0.1  # rad or m by which these differ, and beyond which contacts are others
    radius: float = 0.5  # rad, m: of a step from a free posture. More: fewer steps, limbs jump into what is behind.
    deep: float = 5e-3  # m: of a posture inside of a thing that no tolerance of the goals leads out of


class FeasibilityNumbers(NamedTuple):
    """Feasibility without regard to the measures."""

    step: float = 0.2  # rad, m: most that a degree of freedom moves. Larger: fewer programs, limbs jump over others.
    least_step: float = 1e-3  # rad, m: of the box; smaller = slower to end where steps go to and fro
    damping: float = 0.05  # share of the squared error. Less: dozens of bounds hold a step, and programs are dear.
    within: float = 0.1  # m: pairs nearer than this get rows
    wide: float = 5.0  # rad: range from which a joint may be taken from one limit to the other
    # share of the violation, or m and rad, that must go in so many programs, else nothing leads nearer
    slow: float = 0.1
    progress: float = 0.1
    patience: int = 6


class NearestNumbers(NamedTuple):
    """Descents to the closest posture, with second derivatives."""

    within: float = 0.12  # m. Nearer pairs have rows where things count. Smaller: steps that meet things unseen.
    radius: float = 0.5  # rad, m: trust region of the first step
    largest_radius: float = 1.0  # and of any. Larger: fewer programs, more rejected ones.
    held: float = 1e-2  # m, rad: holds missed by more than this do not bend; what they pull with says nothing yet
    flat: float = 1e-3  # share of the violation that a step is to gain, or it is at rest. Smaller: more programs.
    nearly_flat: float = 1e-2  # the same where only the size of the residual counts
    # share of the largest curvature that every direction has at least. Less: active sets that go in circles, dearer
    # programs; more: shorter steps, ends farther off (at 0.2 by centimetres).
    damping: float = 3e-2
    negligible: float = 1e-2  # share of the largest curvature below which a direction is left out
    # of the goals against constraints where it rests on violated ones. Larger: limbs stay inside of things.
    share: float = 1e-3


class SearchNumbers(NamedTuple):
    """A search over starts."""

    probe_programs: int = 40  # of a relaxed probe. More: surer along curved paths, fewer starts within the budget.
    # m: depth that a relaxed probe may first have, from the start (of 31 postures of arms that cross it finds 7 with 0,
    # 18 with 0.07, 9 with 0.15) and from others. More: limbs change sides more easily, and are harder to separate.
    start_depth: float = 0.07
    relaxation_depth: float = 0.15
    # m: the same of a descent with measures. Of 19 reaches of both hands to the body 0.05 leads to 12, 0.03 to 4, and
    # 0.07 to 10.
    rest_depth: float = 0.05
    rest_programs: int = 60  # most of it. Fewer: ends before it; more: goals that none reaches take longer.
    beside: int = 40  # probes from beside goals. More: goals behind things are found, what none reaches takes longer.
    displaced: float = 0.5  # m, rad: of goals along each axis, the standard deviation. Less: the same side of things.
    reached: float = 10.0  # tolerances that a relaxed probe must come within for a second one. More: more in vain.
    reach_trials: int = 10  # most descents without contacts that tell whether goals are out of reach
    reach_trial_programs: int = 60  # most programs of each
    # share of the goals' residual by which constraints may be missed where one ends that counts. Less: ends far from
    # the goals do not count, and probes go on in vain.
    held: float = 1e-2
    agreeing: int = 7  # of them that must come to rest equally near. Fewer: faster, and reachable goals are given up.
    # degrees of freedom that move the goals; with fewer minima lie apart, programs are cheap, and starts are all over
    # the limits
    few: int = 12
    agreeing_few: int = 8  # the same with so few
    reach_trials_few: int = 16  # most descents with so few
    agree: float = 1.1  # times the least violation up to which they count as equally near
    coming_near: int = 40  # most programs from there to the nearest posture among things
    inside_probes: int = 5  # seeded starts for goals inside of things, which only look for the nearest posture
    staying: int = 40  # most programs that improve the measures at the nearest posture to goals that are not met
    # m: violation up to which a descent into contact that spent its programs goes on. Larger: more go on in vain.
    on_its_way: float = 1e-3
    optimal: float = 1e-2  # rad: first-order optimality of a contact's answer from which on it counts as none
    lower: float = 0.9995  # share of a contact's measures below which those at its place are another minimum
    aside: float = 0.03  # rad, m: from an end, to see whether it is a saddle. More: to other minima; less: slower.
    moved: float = 0.99  # share below which they are looked for again, at the place of that minimum. More: slower.
    # share of what the start misses below which who sits is tried on the seat too. More: in vain of those beside it.
    nearer: float = 0.9
    poor_contact: float = 2.5  # rad^2: measures of contacts beyond which they are also met from before. More: poorer.
    poor: int = 2  # starts for the measures where it is none after all. More: lower, slower.
    screened: int = 4  # feasible postures that are looked for, for each descended from. More: lower measures, slower.
    # starts that seek lower minima, for each factor e that things multiply the measures by. More: lower, slower.
    dear: float = 3.0
    cheap: int = 60  # programs that starts for lower measures may take beside as many as before. More: lower, slower.
    width: float = 0.5  # of the funnel of descents that seek lower minima. Narrower: shorter steps, slower.
    less: float = 0.98  # share of the least measures that others must come below. More: descents in vain end later.
    # the same where terms are contacts, whose descents take ten times as long. More: only the best is begun from.
    less_of_contacts: float = 0.8


class StepNumbers(NamedTuple):
    """Programs of tracking steps."""

    # rad, m. A goal that jumps asks for `error_clamp` times this in a step. Larger: faster, and more to second order.
    radius: float = 0.1
    damping: float = 2.0  # of the pull of goals out of reach. Larger: slower; smaller: limbs oscillate at obstacles.
    settling: float = 1.0  # s in which measures decrease by 1/e beside goals. Shorter: joints swing about the optimum.
    resting: float = 1e-5  # m, rad: a goal missed by less than this, and more than predicted, rests; less is reached
    curved: float = 1e-4  # m, rad: by which a step runs ahead of a hold as the last one was curved. More: overshoots.
    little: float = 0.01  # damping that no step shows. Larger: limbs jump where a goal is just blocked.
    worse: float = 2.0  # times the damping of a program that its answer may ask for before it is solved again with that
    # m rad: change of a step's motion times its turn above which it is looked at how it curves what is held. Larger:
    # feet off by micrometres after jumps; smaller: more looks.
    bent: float = 5e-5
    straight: float = 1.5e-6  # m, rad by which holds may be curved otherwise than predicted. Less: more programs.
    traded: float = 0.5  # see `StepProgram.solve`: greater = weights count in more steps, and light goals wait in more.
    again: int = 2  # times that a program is solved again at most. More: smoother at obstacles, dearer steps there.


class TrackingNumbers(NamedTuple):
    """Steps of a tracker, and frames of several."""

    least_within: float = 0.06  # m beyond the clearance within which pairs have rows. Smaller: fast steps are cut.
    largest_within: float = 0.5  # m. Larger: faster motions uncut, at the price of rows.
    headroom: float = 2.5  # times the last step's motion. Less than 2 would cut every step; more: more rows.
    spare: float = 10.0  # times what turning brings nearer, roughly: with more room after a step it is not looked at
    midway: float = 4.0  # times that and more at the end is too much half way too, where a way bows by a quarter
    corrections: int = 3  # programs that ask again for what turning brought nearer. More: fewer cut steps.
    cuts: int = 6  # times that a step is halved before it is given up
    of_a_frame: float = 1e-4  # m, rad: to which the goals of a frame are met
    # most of a frame, and of one that is asked for more exactly than that; more = nearer to a goal that turns quickly,
    # dearer frames where it cannot be met. With 3 for both, one exact frame in twenty ends 1e-5 m short.
    programs: tuple[int, int] = (3, 6)
    braked: float = 1e-6  # m, rad: violation of constraints above which joints do not brake for their limits
    out: float = 5e-5  # m: overlap with what came into the figure that is left; half of what counts as an overlap
    worth: float = 0.5  # share of the error that another program must leave at most for one more to follow
    room: float = 2.0  # times what a pair may get nearer by turning: with more room after a step it is not looked at
    off: float = 6e-3  # rad: by which coal's normal may be off, as it stops within 1e-6 m of the distance
    unseen: float = 1e-4  # m: by which turning may bring things nearer than rows say without being looked after
    inside: float = 5e-6  # m: the same of pairs whose clearance is less; beside coal's accuracy: none ends inside


class EscapeNumbers(NamedTuple):
    """Postures that are free where a thing came too fast."""

    random: int = 150  # more starts; more = free postures are missed less, and a frame that has none costs more
    farthest: float = 1.0  # m, rad: of a random start, where no bound is nearer
    within: float = 0.02  # m: pairs nearer than this are parted; farther ones cost more and may come in the way
    gap: float = 3e-4  # m: to which pairs are parted; a round is exact to first order only
    rounds: int = 25  # from one start, at most
    worth: float = 0.95  # share of the depth that a round must leave at most, or else it is weak
    weak: int = 3  # rounds from one start that may be weak; larger is slower and finds more


WEIGHTS, CORRECTIONS, PROGRAM, DESCENT = Weights(), Corrections(), ProgramNumbers(), DescentNumbers()
FEASIBILITY, SEEDS, NEAREST, SEARCH = FeasibilityNumbers(), SeedNumbers(), NearestNumbers(), SearchNumbers()
STEP, TRACKING, ESCAPE = StepNumbers(), TrackingNumbers(), EscapeNumbers()

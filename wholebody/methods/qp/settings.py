"""The numbers of the QP method; what each trades stands at its name.

They are frozen records, one for each part of the method, which compiled loops take as they are.
"""

from __future__ import annotations

from typing import NamedTuple


class Weights(NamedTuple):
    """Weights of the rows, 1/m^2 or 1/rad^2, in the order in which they give way.

    Attributes:
        force: 1/m: what all goals together pull with, however far they are.
        least, most: of a goal's row with the largest weight.
        hold: of equalities.
        elastic: of contacts and inequalities.
    """

    force: float = 1e4
    least: float = 1e4
    most: float = 1e8
    hold: float = 1e10
    elastic: float = 1e10


class Corrections(NamedTuple):
    """How active sets are corrected: the numbers of the algorithm.

    Attributes:
        near: violation at x = 0, metres, above which a row is in the first round. More: larger programs; less: rounds.
        rounds: most times that violated rows are added before all rows are in.
        most: corrections of one set before another solver is asked.
        of_guess: corrections of a set that was guessed from an approximate answer.
        at_once: how many of them correct all that is wrong; as that may cycle, later ones change the worst entry.
        tolerance: by which x may be out of its box and a row violated, radians and metres.
    """

    near: float = -0.03
    rounds: int = 8
    most: int = 120
    of_guess: int = 12
    at_once: int = 8
    tolerance: float = 1e-11


class ProgramNumbers(NamedTuple):
    """How programs are built.

    Attributes:
        proximal_share: share of the curvature left where measures do not count: they still say which joints move.
        hold_share: what a metre of hold counts against a metre of goal when a step is judged.
        elastic_share: and a metre of overlap; above any ratio at which overlap could buy goal.
        lever: m: of a limb; larger = more damping of every joint while a goal is out of reach.
        least_curvature: share of the largest curvature that a degree of freedom has which no measure speaks for.
        error_clamp: m per rad of radius that one program asks for. Larger: fewer iterations in the open, more bounds
            that bind and more rejected steps in clutter.
        box: radii. Half width of the box. Smaller: it binds where asking for little would do.
        least_share: of the largest goal weight. Smaller: light goals are met late or not; larger: weights farther apart
            than this count as this.
        heaviest_curvature: 1/rad^2. Heavier measures are scaled to this. Larger: they hold goals back.
    """

    proximal_share: float = 0.01
    hold_share: float = 3.0
    elastic_share: float = 10.0
    lever: float = 1.0
    least_curvature: float = 1e-3
    error_clamp: float = 0.4
    box: float = 2.0
    least_share: float = 1e-3
    heaviest_curvature: float = 5e3


class DescentNumbers(NamedTuple):
    """A descent.

    Attributes:
        first_radius: rad, m. Larger: fewer iterations in the open, more rejected ones in clutter.
        largest_radius: rad, m. Larger: linearisations believed beyond what they say.
        full_step_damping: where feasibility alone is asked, shares of the squared error: at first, and after a step was
            rejected. Less: fewer programs in the open, more rejected ones.
        full_step_gain: share of the violation that a step must take away where feasibility alone is asked, or the
            descent goes on as others do. Less: it crawls where it is far or stuck.
        least_within: m. Pairs nearer than what a step asks for have rows, and at least those nearer than this. Larger:
            more rows; smaller: more steps blocked by what they did not see.
        most_within: m. No pair farther apart than this has a row. Larger: slower; smaller: more steps blocked by what
            they did not see.
        within_step: m per rad of the last step, beyond which pairs have no row either. Larger: more rows; smaller:
            steps that meet what they did not see.
        least_gain: least predicted reduction, as a share of the violation. Smaller: slow to see that a goal is out of
            reach.
        least_gain_alone: least share of the violation to gain, with measures and without.
        restorable: m, rad: violation of holds and contacts that the next step is trusted to repair. Larger: more steps
            that are taken back.
        near_met: m, rad. Residuals below which multipliers act. Larger: they act on what has other causes.
        width: violation allowed while measures improve, at first. Wider: longer steps along constraints, more to
            restore.
        switch: measures lead once they gain more than this times the squared violation. Smaller: they lead earlier, far
            from the goals.
        worth: share of the predicted reduction that a step must achieve. Larger: more steps rejected.
        good: share above which the next step may be longer.
        poor: share below which it must be shorter.
        along: tangential parts that a step is where they grow. Larger: faster down, rejected more often.
        room: rad, m: distance of a bound from which on the way to it is tangential. Larger: steps to joint limits count
            as met goals; much smaller: joints that a bound stops bend the normal part.
    """

    first_radius: float = 0.3
    largest_radius: float = 0.8
    full_step_damping: tuple[float, float] = (0.5, 2.0)
    full_step_gain: float = 0.05
    least_within: float = 0.05
    most_within: float = 0.12
    within_step: float = 1.0
    least_gain: float = 1e-3
    least_gain_alone: float = 1e-7
    restorable: float = 0.03
    near_met: float = 1e-4
    width: float = 0.02
    switch: float = 10.0
    worth: float = 0.05
    good: float = 0.5
    poor: float = 0.25
    along: float = 3.0
    room: float = 1e-3


class SeedNumbers(NamedTuple):
    """Seeds of chains.

    Attributes:
        damping: m, rad: of the steps at the goals, as in `DampedLeastSquares`. Less: errors vanish in fewer steps,
            steps near singular postures are wild.
        steps: most of a descent; those that reach their goals take 5 to 20.
        together: seeds of a batch.
        batches: most. More: fewer problems are left to the slower search, which then begins later.
        compared: ends of which the one of least effort is taken. More: less effort, more time.
        samples: values of the joint of seven that a closed form holds. More: less effort, more time.
        worth: share of the effort of an answer below which a rejected end is descended from too.
    """

    damping: float = 1e-3
    steps: int = 60
    together: int = 10
    batches: int = 25
    compared: int = 5
    samples: int = 24
    worth: float = 0.9


class FeasibilityNumbers(NamedTuple):
    """Feasibility without regard to the measures.

    Attributes:
        step: rad, m: most that a degree of freedom moves in a program; larger = fewer programs, limbs jump over others.
        least_step: rad, m: of the box; smaller = slower to end where steps go to and fro.
        damping: share of the squared error, as in `sqp`; less = dozens of bounds hold a step, and programs are dear.
        within: m: pairs nearer than this get rows.
        wide: rad: range from which a joint may be taken from one limit to the other.
        slow: share of the violation, or `progress`, that must go in `patience` programs, else nothing leads nearer.
        progress: see `slow`; m, rad.
        patience: see `slow`.
    """

    step: float = 0.2
    least_step: float = 1e-3
    damping: float = 0.05
    within: float = 0.1
    wide: float = 5.0
    slow: float = 0.1
    progress: float = 0.1
    patience: int = 6


class NearestNumbers(NamedTuple):
    """Descents to the closest posture, with second derivatives.

    Attributes:
        within: m. Nearer pairs have rows where things count. Larger: more rows; smaller: steps that meet things unseen.
        radius: rad, m: trust region of the first step.
        largest_radius: and of any. Larger: fewer programs, more rejected ones.
        held: m, rad: holds missed by more than this do not bend; what they pull with says nothing yet.
        flat: share of the violation that a step must be predicted to gain, or it is at rest. Smaller: more programs,
            nearer.
        nearly_flat: the same where only the size of the residual counts.
        damping: share of the largest curvature that every direction has at least. Less: active sets that go in circles,
            dearer programs; more: shorter steps, ends farther off (at 0.2 by centimetres).
        negligible: share of the largest curvature below which a direction is left out.
    """

    within: float = 0.12
    radius: float = 0.5
    largest_radius: float = 1.0
    held: float = 1e-2
    flat: float = 1e-3
    nearly_flat: float = 1e-2
    damping: float = 3e-2
    negligible: float = 1e-2


class SearchNumbers(NamedTuple):
    """A search over starts.

    Attributes:
        probe_programs: programs of a relaxed probe. More: surer along curved ways, and fewer starts within the budget.
        relaxation_depth: m: depth that a relaxed probe may first have. More: limbs change sides more easily, and are
            harder to separate. Two upper arms that cross need about as much. Also the residual of the goals up to
            which the start's probe comes before the proof that they are out of reach.
        no_nearer: probes in a row, without contacts or relaxed, that came no nearer before the goals are given up.
            Fewer: faster to know, rare branches of arms are missed.
        reached: tolerances within which such a relaxed probe must come for the second one to follow. More: more second
            ones in vain.
        nearer: share of the residual that counts as nearer.
        reach_trials: most descents without contacts that tell whether goals are out of reach.
        reach_trial_programs: most programs of each.
        far: shares of the joints' ranges that their starts may be away by. Smaller: local minima are taken for the edge
            of reach.
        held: share of the goals' residual by which constraints may be missed where one ends that counts. Less:
            ends far from the goals do not count, and probes go on in vain.
        agreeing: of them that must come to rest equally near. Fewer: faster, and reachable goals are given up.
        few: degrees of freedom that move the goals; with fewer, minima lie apart, programs are cheap, and starts are
            all over the limits.
        agreeing_few: the same with so few.
        reach_trials_few: most descents with so few.
        fewest_descents: ends of probes with so few before their minima count as all. Fewer: a second configuration of
            an arm may stay unseen.
        agree: times the least violation up to which they count as equally near.
        coming_near: most programs from there to the nearest posture among things.
        inside_probes: seeded starts for goals inside of things, which only look for the nearest posture.
        staying: most programs that improve the measures at the nearest posture to goals that are not met.
        optimal: rad: first-order optimality of a contact's answer from which on it counts as none.
        poor: how many starts for the measures are descended from where it is none after all. More: lower, slower.
        screened: feasible postures that are looked for, for each that is descended from; more = lower measures, slower.
    """

    probe_programs: int = 40
    relaxation_depth: float = 0.15
    no_nearer: int = 20
    reached: float = 10.0
    nearer: float = 0.02
    reach_trials: int = 10
    reach_trial_programs: int = 60
    far: tuple[float, float] = (1.0, 0.6)
    held: float = 1e-2
    agreeing: int = 3
    few: int = 12
    agreeing_few: int = 8
    reach_trials_few: int = 16
    fewest_descents: int = 12
    agree: float = 1.1
    coming_near: int = 40
    inside_probes: int = 5
    staying: int = 40
    optimal: float = 1e-2
    poor: int = 2
    screened: int = 4


class StepNumbers(NamedTuple):
    """Programs of tracking steps.

    Attributes:
        radius: rad, m. A goal that jumps asks for `error_clamp` times this in a step. Larger: faster, and more to
            second order.
        damping: of the pull of goals out of reach. Larger: slower to close in; smaller: limbs oscillate at obstacles.
        settling: s in which measures decrease by 1/e beside goals. Longer: slower to settle; shorter: joints swing
            about the optimum.
        resting: m, rad: a goal missed by less than this, and more than predicted, rests; less is reached.
        curved: m, rad: by how much a step runs ahead of a hold as the last one was curved; more overshoots after jumps.
        little: damping that makes no difference to how a step looks. Larger: limbs jump where a goal is just blocked.
        worse: times the damping of a program that its answer may ask for before it is solved again with that.
        bent: m rad: change of a step's motion times its turn above which it is looked at how it curves what is held.
            Larger: feet off by micrometres after jumps; smaller: more looks.
        straight: m, rad by which what is held may be curved differently than predicted. Smaller: more programs;
            larger: feet farther off.
        traded: see `StepProgram.solve`: greater = weights count in more steps, and light goals wait in more.
        again: times that a program is solved again at most. More: smoother at obstacles, dearer steps there.
    """

    radius: float = 0.1
    damping: float = 2.0
    settling: float = 1.0
    resting: float = 1e-5
    curved: float = 1e-4
    little: float = 0.01
    worse: float = 2.0
    bent: float = 5e-5
    straight: float = 1.5e-6
    traded: float = 0.5
    again: int = 2


class TrackingNumbers(NamedTuple):
    """Steps of a tracker, and frames of several.

    Attributes:
        least_within: m beyond the clearance within which pairs have rows. Larger: more rows a step; smaller: fast steps
            are cut.
        largest_within: m. Larger: faster motions uncut, at the price of rows.
        headroom: times the last step's motion. Less than 2 would cut every step; more: more rows.
        spare: times what turning brings nearer, roughly: a step that leaves all pairs more room is not looked at.
        midway: times that much and more at the end is too much half way too, where a straight way bows by a quarter.
        corrections: programs that ask again for what turning brought nearer. More: fewer cut steps, each a program
            more.
        cuts: times that a step is halved before it is given up.
        of_a_frame: m, rad: to which the goals of a frame are met.
        programs: most of a frame, and of one that is asked for more exactly than that; more = nearer to a goal that
            turns quickly, dearer frames where it cannot be met. With 3 for both, one exact frame in twenty ends 1e-5 m
            short.
        braked: m, rad: constraints are violated by more where joints brake for their limits: they do not then.
        out: m: overlap with what came into the figure that is left; half of what counts as an overlap.
        worth: share of the error that another program must leave at most for one more to follow.
        room: times what a pair may get nearer by turning: with more room after a step it is not looked at.
        off: rad: by which coal's normal may be off, as it stops within 1e-6 m of the distance.
        unseen: m: by which turning may bring things nearer than the linearisation says without being looked after.
        inside: m: the same of pairs whose clearance is less; beside coal's accuracy, so that none ends inside.
    """

    least_within: float = 0.06
    largest_within: float = 0.5
    headroom: float = 2.5
    spare: float = 10.0
    midway: float = 4.0
    corrections: int = 3
    cuts: int = 6
    of_a_frame: float = 1e-4
    programs: tuple[int, int] = (3, 6)
    braked: float = 1e-6
    out: float = 5e-5
    worth: float = 0.5
    room: float = 2.0
    off: float = 6e-3
    unseen: float = 1e-4
    inside: float = 5e-6


class EscapeNumbers(NamedTuple):
    """Postures that are free where a thing came too fast.

    Attributes:
        random: more starts; more = free postures are missed less, and a frame that has none costs more.
        farthest: m, rad: of a random start, where no bound is nearer.
        within: m: pairs nearer than this are parted; farther ones cost more and may come in the way of a step.
        gap: m: to which pairs are parted; a round is exact to first order only.
        rounds: from one start, at most.
        worth: share of the depth that a round must leave at most, or else it is weak.
        weak: rounds from one start that may be weak; larger is slower and finds more.
    """

    random: int = 150
    farthest: float = 1.0
    within: float = 0.02
    gap: float = 3e-4
    rounds: int = 25
    worth: float = 0.95
    weak: int = 3


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

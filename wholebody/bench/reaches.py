"""`wholebody bench reaches`: random reaches among random objects, each with an answer that is known to exist.

A seed makes one reach. The upper body of a standing person is put at random within its limits until nothing touches;
where a fingertip is then becomes the target. Random objects are added that touch neither that posture (the witness) nor
the standing one. The witness holds both feet and keeps the clearance, so whoever does not find an answer has failed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.track import Array, clear

OBJECTS = 20
KINDS = ("box", "sphere", "capsule", "hull")
ROOM = 0.005  # m: what objects and limbs leave free in the witness, and objects at the start
CLEARANCE = 0.002  # m: what is asked of an answer
SPACE = ((-0.6, -1.0, 0.1), (1.2, 1.0, 2.0))  # m: where the objects are put
TIPS = ("right_index_tip", "left_index_tip")


@dataclass(frozen=True)
class Reach:
    """One reach and the posture that proves it possible, shape (nq,)."""

    seed: int
    problem: wb.Problem
    witness: Array


@dataclass(frozen=True)
class ReachRow:
    """What came of one reach.

    Attributes:
        seed: what it was made from.
        solver: of the QP method.
        status: as the method said.
        how: "directly", "in stages", "from another start", or the message of what was not solved.
        milliseconds: of the solve.
        iterations: of the method.
        goal_error: distance left, as judged independently [m].
        penetration: deepest overlap, as judged [m].
        clearance_lack: by how much the worst pair misses its clearance, as judged [m].
        limit_violation: as judged [rad].
        constraint_violation: of the feet, as judged [m, rad].
        measure: effort of the answer.
        witness_measure: effort of the witness.
    """

    seed: int
    solver: str
    status: str
    how: str
    milliseconds: float
    iterations: int
    goal_error: float
    penetration: float
    clearance_lack: float
    limit_violation: float
    constraint_violation: float
    measure: float
    witness_measure: float


def reach(seed: int, figure: wb.Figure | None = None) -> Reach:
    """Make one reach; the same seed makes the same one.

    Args:
        seed: of everything random in it.
        figure: the human, if it is loaded already.
    """
    rng = np.random.default_rng(seed)
    figure = figure or wb.load("human")
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for number in range(OBJECTS):
        kind = KINDS[number % len(KINDS)]
        while True:
            shape = _shape(kind, rng)
            turn = rng.normal(size=4)
            at = (*rng.uniform(*SPACE), *(turn / np.linalg.norm(turn)))
            if all(clear(figure, shape, at, q, ROOM) for q in (start, witness)):
                break
        scene.add(shape, name=f"{kind} {number}", at=at)
    tip = TIPS[seed % len(TIPS)]
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, witness)
    problem = wb.Problem(
        scene,
        start,
        goals=[wb.Point(tip, np.array(data.oMf[figure.frame_id(tip)].translation))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        measures=[wb.Effort()],
        clearance=CLEARANCE,
    )
    return Reach(seed, problem, witness)


def sampled_posture(figure: wb.Figure, start: Array, rng: np.random.Generator) -> Array:
    """Posture (nq,) with the upper body uniformly at random within its limits, nothing touching itself or the floor."""
    alone = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    joints = figure.groups["upper_body"]
    places = np.array([figure.model.joints[figure.joint_id(name)].idx_q for name in joints])
    lower, upper = figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places]
    soles = {frozenset(("floor", name)) for name in ("left_foot", "right_foot", "left_toes", "right_toes")}
    while True:
        q = np.array(start)
        q[places] = rng.uniform(lower, upper)
        owners = alone.piece_owner
        near = (frozenset((owners[a], owners[b])) for a, b in alone.contacts(q, within=ROOM).pair)
        if all(pair in soles for pair in near):
            return q


def solve_reach(seed: int, solver: str, figure: wb.Figure | None = None) -> ReachRow:
    """Make and solve one reach with a fresh method."""
    made = reach(seed, figure)
    solution = wb.QP(solver=solver).solve(made.problem)
    judged = wb.assess(made.problem, solution.q)
    how = solution.message.removeprefix("solved ")
    return ReachRow(
        seed=seed,
        solver=solver,
        status=solution.status,
        how=how,
        milliseconds=1e3 * solution.seconds,
        iterations=solution.iterations,
        goal_error=judged.goal_error,
        penetration=judged.penetration,
        clearance_lack=judged.clearance_lack,
        limit_violation=judged.limit_violation,
        constraint_violation=judged.constraint_violation,
        measure=judged.measure,
        witness_measure=wb.assess(made.problem, made.witness).measure,
    )


def run(seeds: range, solver: str, jobs: int = 1) -> Iterator[ReachRow]:
    """Solve the reaches of these seeds, in processes of their own where `jobs` is more than one; in order."""
    if jobs <= 1:
        figure = wb.load("human")
        for seed in seeds:
            yield solve_reach(seed, solver, figure)
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(solve_reach, seeds, [solver] * len(seeds), chunksize=4)


def _shape(kind: str, rng: np.random.Generator) -> wb.Shape:
    if kind == "box":
        edges = rng.uniform(0.05, 0.5, 3)
        return wb.Box((float(edges[0]), float(edges[1]), float(edges[2])))
    if kind == "sphere":
        return wb.Sphere(float(rng.uniform(0.03, 0.2)))
    if kind == "capsule":
        return wb.Capsule(float(rng.uniform(0.02, 0.1)), float(rng.uniform(0.1, 0.6)))
    return wb.Hull(rng.normal(size=(30, 3)) * rng.uniform(0.03, 0.12, 3))

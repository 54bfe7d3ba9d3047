"""Streams: goals that jump, change and leave, things that move, followed step by step or by dragging."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.bench.attack.bodies import Body, body
from wholebody.bench.attack.case import Verdict, Written
from wholebody.bench.attack.judging import Pairs, judge
from wholebody.bench.attack.solves import Terms, number_text, script_head
from wholebody.bench.attack.things import Thing, clear, xyzquat
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.problem import Problem

DIP = 5e-4  # m, of pieces of up to a metre: as far as a way between two postures may go deeper into a pair than before
PARTS = 8  # of a way that are looked at
DRIFT = 5e-3  # m, rad: by which a step may worsen what must hold beyond the square of its length, as rows are linear
FRAMES = (10, 40)
STEPS = (0.001, 1.0 / 60.0, 0.1, 1.0)  # s

STEPPING = """
problem = wb.Problem(scene, start, goals=goals, constraints=constraints, clearance={clearance!r})
watch = streams.Watch(problem, constraints, speed={speed!r}, dt={dt!r})
tracker = wb.QP().tracker(problem, {dt!r})
q = figure.clamp(problem.start)
for asked, moved in frames:
    for name, at in moved:
        scene.move(name, at=at)
    problem.retarget(asked)
    step = tracker.step(q)
    watch.step(q, step.q)
    q = step.q
verdict = watch.verdict()
print(verdict)
"""
DRAGGING = """
problem = wb.Problem(scene, start, goals=goals, constraints=constraints, clearance={clearance!r})
watch = streams.Watch(problem, constraints, speed={speed!r}, dt={dt!r})
drag = wb.Drag(problem, method={method!r}, dt={dt!r})
for target, moved in frames:
    for name, at in moved:
        scene.move(name, at=at)
    q = drag.q
    drag.to(target)
    watch.step(q, drag.q)
verdict = watch.verdict()
print(verdict)
"""


class Watch:
    """Looks at every step of a stream, and at the way between two postures."""

    def __init__(self, problem: Problem, constraints: Sequence[Any], *, speed: float, dt: float) -> None:
        """Begin; joints may move at `speed` [rad/s or m/s], inf for any, and a step takes `dt` seconds."""
        self._problem, self._constraints, self._most = problem, constraints, speed * dt
        self._frame = 0
        self._wrongs: list[str] = []

    def step(self, before: Array, after: Array) -> None:
        """Look at a step from one posture (nq,) to the next."""
        number, self._frame = self._frame, self._frame + 1
        model = self._problem.scene.model
        if np.shape(after) != (model.nq,) or not np.isfinite(after).all():
            self._wrongs.append(f"frame {number}: the posture is not made of numbers")
            raise WholebodyError("; ".join(self._wrongs))
        here, there = (judge(self._problem, [], self._constraints, q) for q in (before, after))
        if there.limits > max(here.limits, 1e-9) + 1e-9:
            self._wrongs.append(f"frame {number}: a joint is {there.limits:.3g} out of its limits")
        way = pin.difference(model, before, after)
        turned = (DRIFT + float(way @ way)) * max(1.0, Pairs(self._problem.scene).size)
        apart = here.least > -DIP  # what is inside of something and held cannot have both
        if apart and there.constraints > max(here.constraints, turned):
            self._wrongs.append(f"frame {number}: what must hold is missed by {there.constraints:.3g}")
        if np.abs(way).max(initial=0.0) > self._most * (1.0 + 1e-6) + 1e-9:
            self._wrongs.append(f"frame {number}: a joint moves {np.abs(way).max():.3g}, allowed are {self._most:.3g}")
        self._dip(number, before, after)

    def verdict(self) -> Verdict:
        """What came of the stream."""
        if self._wrongs:
            more = f" (and {len(self._wrongs) - 1} more)" if len(self._wrongs) > 1 else ""
            return Verdict("wrong", self._wrongs[0] + more)
        return Verdict("right", f"{self._frame} frames")

    def _dip(self, number: int, before: Array, after: Array) -> None:
        """Whether some pair gets deeper than it was before, or deeper than it may be."""
        pairs = Pairs(self._problem.scene)
        began = np.minimum(pairs.distances(before), 0.0)
        if not len(began):
            return
        model = self._problem.scene.model
        for share in np.linspace(0.0, 1.0, PARTS + 1)[1:]:
            found = pairs.distances(np.asarray(pin.interpolate(model, before, after, float(share))))
            worst = int(np.argmin(found - began))
            dip = float((began - found)[worst])
            if dip > DIP * max(1.0, pairs.size):
                names = " and ".join(pairs.owners[worst])
                self._wrongs.append(f"frame {number}: {names} get {dip:.3g} m deeper at {share:.2f} of the way")
                return


def written(rng: np.random.Generator) -> Written:
    """Write a stream."""
    figure = body(rng)
    figure_start = figure.figure.clamp(figure.figure.posture(figure.figure.postures[0]))
    things = _things(figure, figure_start, rng)
    dt = float(STEPS[int(rng.integers(len(STEPS)))])
    speed = float(rng.choice([np.inf, np.inf, 1.0, 10.0]))
    terms = Terms(constraints=[f"wb.StepLimit({speed!r})"] if np.isfinite(speed) else [])
    if rng.random() < 0.3:
        terms.constraints.append(f"wb.Hold({str(rng.choice(figure.frames))!r})")
    if figure.figure.root == "free" and np.isfinite(speed):
        terms.constraints.append(f"wb.StepLimit({speed!r}, root_velocity={speed!r}, root_turn={speed!r})")
    clearance = float(rng.choice([0.0, 0.002, 0.005])) * min(1.0, figure.size)
    method = "step" if rng.random() < 0.7 else str(rng.choice(["qp", "qp", "newton", "ccd"]))
    frame = str(rng.choice(figure.frames))
    targets = _targets(figure, figure_start, frame, int(rng.integers(*FRAMES)), rng)
    terms.goals.append(f"wb.Point({frame!r}, {targets[0]})")
    frames = []
    for target in targets:
        goals = target if method != "step" else f"[{_goal(figure, frame, target, rng)}]"
        frames.append(f"    ({goals}, {_moved(things, figure.size, rng)!r}),\n")
    text = script_head(
        f"{figure.figure.name}: {len(targets)} frames by {method}", figure, figure_start, things, terms, "streams"
    )
    text += f"\nframes = [\n{''.join(frames)}]"
    values = {"clearance": clearance, "speed": speed if np.isfinite(speed) else 1e300, "dt": dt, "method": method}
    return Written(text + (STEPPING if method == "step" else DRAGGING).format(**values), figure.files)


def _things(figure: Body, start: Array, rng: np.random.Generator) -> list[Thing]:
    placed = Occupied(figure.figure, [start])
    count = int(rng.integers(0, 8))
    found = (clear(rng, placed, figure.size, 1e-3 * figure.size, [0]) for _ in range(count))
    return [thing for thing in found if thing is not None]


def _targets(figure: Body, start: Array, frame: str, count: int, rng: np.random.Generator) -> list[str]:
    """Places: along a line, or jumping between places that the figure can reach and places that it cannot."""
    postures = (start, figure.near(start, 1.0, rng), figure.near(start, 0.5, rng))
    places = [figure.figure.placement(q, frame).translation for q in postures]
    places[2] = places[2] + rng.normal(size=3) * figure.size * float(rng.choice([0.0, 0.3]))
    if rng.random() < 0.3:
        return [number_text(places[int(rng.integers(3))]) for _ in range(count)]
    stations = np.linspace(0.0, 2.0, count)
    return [
        number_text(np.clip(places[int(s)] + (s - int(s)) * (places[min(int(s) + 1, 2)] - places[int(s)]), -99.0, 99.0))
        for s in stations
    ]


def _goal(figure: Body, frame: str, target: str, rng: np.random.Generator) -> str:
    """The goal of a frame, now and then another one than before."""
    if rng.random() < 0.85:
        return f"wb.Point({frame!r}, {target})"
    joints = figure.figure.joints
    some = [str(name) for name in rng.permutation(joints)[: int(rng.integers(1, len(joints) + 1))]]
    posture = repr(figure.figure.postures[0])
    options = [
        f"wb.CenterOfMass({target}, axes='xy')",
        f"wb.CenterOfMass({target})",
        f"wb.Posture({posture}, joints={some!r})",
        f"wb.Point({str(rng.choice(figure.frames))!r}, {target})",
        f"wb.Frame({frame!r}, {target})",
        "",
    ]
    return options[int(rng.integers(len(options)))]


def _moved(things: list[Thing], size: float, rng: np.random.Generator) -> list[tuple[str, tuple[float, ...]]]:
    if not things or rng.random() < 0.9:
        return []
    number = int(rng.integers(len(things)))
    place = things[number].placement
    place.translation = np.clip(place.translation + rng.normal(size=3) * 0.1 * size, -99.0, 99.0)
    return [(f"thing {number}", xyzquat(place))]

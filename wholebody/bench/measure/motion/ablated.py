"""Which constants of the methods of `wb.avoid` matter: each halved and doubled, on a few clips that need no recordings.

A constant decides something here where it changes whether a clip is free, its figures, or the programs that it takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.measure.motion.cases import synthetic
from wholebody.bench.report import render
from wholebody.bench.suite.ablation import FACTORS, Constant, changed, constants_in, replaced

CASES: tuple[tuple[str, str, str, int], ...] = (
    ("arms crossed", "torus", "trajectory", 2),
    ("squat", "pouches", "trajectory", 2),
    ("squat", "pouches", "bisection", 1),
    ("arms crossed", "torus", "bisection", 1),
    ("from the belly to the feet", "torus", "bisection", 1),
    ("arms crossed", "nothing", "frames", 1),
    ("squat", "nothing", "frames", 1),
    ("sword cut", "nothing", "frames", 1),
)
"""Clip, what is worn, method, and of how many frames one is taken: a trajectory of all frames takes too long here."""

USED: dict[str, tuple[str, ...]] = {
    "trajectory.window_run": ("trajectory",),
    "trajectory.sqp": ("trajectory",),
    "trajectory.program": ("trajectory",),
    "trajectory.nodes": ("trajectory",),
    "trajectory.banded_qp": ("trajectory",),
    "bisection.prediction": ("bisection",),
    "one_side": ("trajectory", "bisection", "frames"),
    "repair": ("bisection", "frames"),
    "faults": ("trajectory", "bisection", "frames"),
    "stance": ("trajectory", "bisection", "frames"),
}
"""Modules of `wholebody.motion`, and the methods on whose cases their constants are changed."""

NOTICED = 1e-3
"""Millimetres, parts of the original's jerk and, ten times, radians: smaller changes of a figure are of rounding."""


@dataclass(frozen=True)
class Freed:
    """Figures of the clips of one run, one entry a case.

    Attributes:
        free: whether each is free.
        deepest: at any time, millimetres.
        deviation: radians.
        jerk: of the clip before.
        sliding: of standing feet, millimetres.
        programs: quadratic programs.
        answers: postures (n, nq).
        seconds: of the processor, of all together.
    """

    free: tuple[bool, ...]
    deepest: Array
    deviation: Array
    jerk: Array
    sliding: Array
    programs: Array
    answers: tuple[Array, ...]
    seconds: float


@dataclass(frozen=True)
class Row:
    """What a change did: all of them changes but `cases`, and `seconds`, which is a share.

    Attributes:
        what, change: constant, and how it was changed.
        value: its value.
        cases: how many were looked at.
        differ: answers that differ by more than rounding.
        free: clips that are free.
        deepest_mm, deviation, jerk, sliding_mm: sums over the cases.
        programs: of all cases.
        seconds: of the processor, of the time without the change; noisy on a busy machine.
    """

    what: str
    change: str
    value: str
    cases: int
    differ: int
    free: int
    deepest_mm: float
    deviation: float
    jerk: float
    sliding_mm: float
    programs: int
    seconds: float

    @property
    def matters(self) -> bool:
        """Whether a figure or the programs change by more than rounding."""
        changes = (self.deepest_mm, 10.0 * self.deviation, self.jerk, self.sliding_mm)
        return bool(self.free or self.programs or max(map(abs, changes)) > NOTICED)


def freed(cases: Sequence[tuple[str, str, str, int]], figure: Any) -> Freed:
    """Free clips of collisions, and judge them."""
    from wholebody.motion import measures
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.clip import Clip
    from wholebody.motion.worn_equipment import dressed

    free, answers, figures, spent = list[bool](), list[Array](), list[tuple[float, ...]](), 0.0
    for name, worn, method, every in cases:
        whole = synthetic(name, figure)
        clip = Clip(figure, whole.q[::every], every * whole.dt, name)
        began = time.process_time()
        answer = avoid(clip, dressed(figure, worn), method=method)
        spent += time.process_time() - began
        free.append(answer.report.solved)
        answers.append(answer.clip.q)
        after = answer.report.after
        figures.append(
            (
                1e3 * max(after.deepest, after.deepest_between),
                measures.deviation(clip, answer.clip).angle,
                measures.jerk_ratio(clip, answer.clip),
                1e3 * measures.foot_sliding(clip, answer.clip),
                answer.report.programs,
            )
        )
    deepest, deviation, jerk, sliding, programs = np.array(figures).T
    return Freed(tuple(free), deepest, deviation, jerk, sliding, programs, tuple(answers), spent)


def ablation(
    figure: Any,
    tell: Callable[[str], object],
    cases: Sequence[tuple[str, str, str, int]] = CASES,
    only: Sequence[str] = tuple(USED),
) -> tuple[Freed, list[Row]]:
    """Change one constant after the other; what is freed without a change, and a row a change.

    Args:
        figure: a person.
        tell: is told of every row.
        cases: of `CASES`.
        only: modules of `USED`.
    """
    freed(cases, figure)  # what is compiled at first use
    whole = {case: freed([case], figure) for case in cases}
    rows: list[Row] = []
    for module in only:
        mine = [case for case in cases if case[2] in USED[module]]
        if not mine:
            continue
        before = _together([whole[case] for case in mine])
        name = f"wholebody.motion.{module}"
        for constant in (*constants_in([name])[0], *_settings(name)):
            for change, factor in FACTORS.items():
                value = constant.times(factor)
                if value != constant.value:
                    with changed(constant, value) if "." not in constant.name else _set(constant, value):
                        rows.append(_row(constant, module, change, before, freed(mine, figure)))
                    tell(str(rows[-1]))
    return _together(list(whole.values())), rows


def _settings(module: str) -> list[Constant]:
    """The numbers of a module's record `SETTINGS`, if it has one; named "SETTINGS.radius"."""
    record = getattr(import_module(module), "SETTINGS", None)
    values = {} if record is None else asdict(record)
    return [Constant(module, f"SETTINGS.{name}", value) for name, value in values.items()]


@contextmanager
def _set(constant: Constant, value: Any) -> Iterator[None]:
    """Give a number of a module's settings another value for a while."""
    owner = import_module(constant.module)
    settings = owner.SETTINGS
    with replaced([(owner, "SETTINGS")], replace(settings, **{constant.name.partition(".")[2]: value})):
        yield


def _row(constant: Constant, module: str, change: str, before: Freed, after: Freed) -> Row:
    differ = [
        a.shape != b.shape or not np.allclose(a, b, rtol=0.0, atol=1e-6)
        for a, b in zip(before.answers, after.answers, strict=True)
    ]
    changes = [
        float(np.sum(getattr(after, name) - getattr(before, name)))
        for name in ("deepest", "deviation", "jerk", "sliding", "programs")
    ]
    deepest, deviation, jerk, sliding, programs = changes
    return Row(
        f"{module}.{constant.name}", change, f"{constant.value}", len(before.free), sum(differ),
        sum(after.free) - sum(before.free), deepest, deviation, jerk, sliding, round(programs),
        after.seconds / before.seconds,
    )  # fmt: skip


def _together(found: Sequence[Freed]) -> Freed:
    return Freed(
        tuple(free for one in found for free in one.free),
        np.concatenate([one.deepest for one in found]),
        np.concatenate([one.deviation for one in found]),
        np.concatenate([one.jerk for one in found]),
        np.concatenate([one.sliding for one in found]),
        np.concatenate([one.programs for one in found]),
        tuple(answer for one in found for answer in one.answers),
        sum(one.seconds for one in found),
    )


def report(rows: Sequence[Row]) -> str:
    """The changes as Markdown, and the constants that changed nothing."""
    matter = {row.what for row in rows if row.matters}
    unnoticed = dict.fromkeys(row.what for row in rows if row.what not in matter)
    return render("ablation_motion.md", rows=[row for row in rows if row.what in matter], unnoticed=list(unnoticed))

"""Which constants of the methods of `wb.avoid` matter: each halved and doubled, on a few clips that need no recordings.

A constant matters here where it changes whether a clip is free, its figures, or the programs that it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from tests.audits.ablation import FACTORS, Constant, changed, constants_in, replaced
from wholebody.base.arrays import Array
from wholebody.bench.measure.motion import synthetic
from wholebody.bench.rows import Row, measured_ms

Case = tuple[str, str, str, int]
"""Clip, what is worn, method, and of how many frames one is taken: a trajectory of all frames takes too long here."""

CASES: tuple[Case, ...] = (
    ("arms crossed", "torus", "trajectory", 2),
    ("squat", "pouches", "trajectory", 2),
    ("squat", "pouches", "bisection", 1),
    ("arms crossed", "torus", "bisection", 1),
    ("from the belly to the feet", "torus", "bisection", 1),
    ("arms crossed", "nothing", "frames", 1),
    ("squat", "nothing", "frames", 1),
    ("sword cut", "nothing", "frames", 1),
)
USED: dict[str, tuple[str, ...]] = {
    **dict.fromkeys((f"trajectory.{name}" for name in ("window_run", "sqp", "program", "nodes")), ("trajectory",)),
    **dict.fromkeys(("bisection.method", "bisection.prediction"), ("bisection",)),
    "repair": ("bisection", "frames"),
    **dict.fromkeys(("one_side", "faults"), ("trajectory", "bisection", "frames")),
}
"""Modules of `wholebody.motion`, and the methods on whose cases their constants are changed."""


@dataclass(frozen=True)
class Freed:
    """What came of some clips.

    Attributes:
        figures: (cases, 6) free, deepest [mm], deviation [rad], jerk of that before, sliding [mm], programs.
        answers: postures (n, nq) of each.
        milliseconds: of the processor, of all together.
    """

    figures: Array
    answers: tuple[Array, ...]
    milliseconds: float


def freed(cases: Sequence[Case], figure: Any) -> Freed:
    """Free clips of collisions, and judge them."""
    from wholebody.motion import measures
    from wholebody.motion.avoidance import avoid
    from wholebody.motion.clip import Clip
    from wholebody.motion.worn_equipment import dressed

    figures, answers, total = list[tuple[float, ...]](), list[Array](), 0.0
    for name, worn, method, every in cases:
        whole = synthetic(name, figure)
        clip = Clip(figure, whole.q[::every], every * whole.dt, name)
        spent, _, answer = measured_ms(partial(avoid, clip, dressed(figure, worn), method=method))
        total += spent
        after = answer.report.after
        figures.append(
            (
                answer.report.solved,
                1e3 * max(after.deepest, after.deepest_between),
                measures.deviation(clip, answer.clip).angle,
                measures.jerk_ratio(clip, answer.clip),
                1e3 * measures.foot_sliding(clip, answer.clip),
                answer.report.programs,
            )
        )
        answers.append(answer.clip.q)
    return Freed(np.array(figures, dtype=float), tuple(answers), total)


def ablation(
    figure: Any, tell: Callable[[str], object], cases: Sequence[Case] = CASES, only: Sequence[str] = tuple(USED)
) -> list[Row]:
    """Change one constant of some modules of `USED` after the other; a row a change. `tell` is told of every row."""
    freed(cases, figure)  # what is compiled at first use
    rows: list[Row] = []
    for module in only:
        mine = [case for case in cases if case[2] in USED[module]]
        before = freed(mine, figure) if mine else None
        for constant in numbers_of(module) if before else ():
            for change, factor in FACTORS.items():
                value = constant.times(factor)
                if before and value != constant.value:
                    with changed(constant, value) if "." not in constant.name else _set(constant, value):
                        rows.append(_row(f"{module}.{constant.name}", change, before, freed(mine, figure)))
                    tell(f"{rows[-1].case}, {change}: {rows[-1].figures}")
    return rows


def numbers_of(module: str) -> list[Constant]:
    """The constants of a module of `wholebody.motion`, and the numbers of its record `SETTINGS`, if it has one."""
    name = f"wholebody.motion.{module}"
    record = getattr(import_module(name), "SETTINGS", None)
    values = {} if record is None else asdict(record)
    return [*constants_in([name])[0], *(Constant(name, f"SETTINGS.{key}", value) for key, value in values.items())]


@contextmanager
def _set(constant: Constant, value: Any) -> Iterator[None]:
    """Give a number of a module's settings another value for a while."""
    owner = import_module(constant.module)
    settings = replace(owner.SETTINGS, **{constant.name.partition(".")[2]: value})
    with replaced([(owner, "SETTINGS")], settings):
        yield


def _row(name: str, change: str, before: Freed, after: Freed) -> Row:
    differ = [
        a.shape != b.shape or not np.allclose(a, b, rtol=0.0, atol=1e-6)
        for a, b in zip(before.answers, after.answers, strict=True)
    ]
    free, deepest, deviation, jerk, sliding, programs = (after.figures - before.figures).sum(axis=0).tolist()
    return Row(
        name,
        change,
        {
            "cases": len(differ), "differ": sum(differ), "free": round(free), "deepest mm": deepest,
            "deviation rad": deviation, "jerk": jerk, "feet slide mm": sliding, "programs": round(programs),
            "time": after.milliseconds / before.milliseconds,
        },
    )  # fmt: skip


def matters(row: Row) -> bool:
    """Whether a figure changes by more than rounding, or the programs do."""
    changes = (row["deepest mm"], 10.0 * row["deviation rad"], row["jerk"], row["feet slide mm"])
    return bool(row["free"] or row["programs"] or max(map(abs, changes)) > 1e-3)

"""Which cases are worth looking at, and Meshcat scenes of them, packed so that a report can carry several."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.compare.front import OURS
from wholebody.bench.compare.record import COARSE, DEFAULT, Record
from wholebody.bench.compare.results import Results
from wholebody.bench.compare.settings import seed_of
from wholebody.bench.compare.solving import BUILDING, Ready, Which, case_of
from wholebody.bench.problem_sets.case import ProblemSet
from wholebody.files import Scratch
from wholebody.runner import ONE_THREAD, Child, EndedError, allow_processor

OPENING = '<script id="picture" type="application/octet-stream">'
CLOSING = "</script>"


class Scene(NamedTuple):
    """A case with two answers, as a page in two halves: what all pages have, and the picture.

    Attributes:
        shown: which case, and why.
        shell: HTML with `OPENING` and `CLOSING` around nothing.
        picture: base64 of a gzip of what belongs between them.
    """

    shown: Shown
    shell: str
    picture: str


def draw(
    shown: Sequence[Shown], families: Mapping[str, ProblemSet], adapters: Mapping[str, Adapter], seed: int, cap: float
) -> list[Scene]:
    """Solve the chosen cases again and draw them; one that cannot be drawn is left out."""
    child, scenes = Child(ONE_THREAD), []
    try:
        for case in shown:
            try:
                which = Which(families[case.set], case.number, seed_of(seed, case.number))
                pair = adapters[case.good], adapters[case.bad]
                page = child.call(drawn, which, *pair, cap, seconds=BUILDING)
            except EndedError:
                continue
            head, _, rest = page.partition(OPENING)
            picture, _, tail = rest.partition(CLOSING)
            packed = base64.b64encode(gzip.compress(picture.encode("ascii"), mtime=0)).decode("ascii")
            scenes.append(Scene(case, f"{head}{OPENING}{CLOSING}{tail}", packed))
    finally:
        child.close()
    return scenes


def drawn(which: Which, good: Adapter, bad: Adapter, cap: float) -> str:
    """HTML of a case with two answers; a job of a process of its own."""
    made = case_of(which)
    allow_processor(2.0 * cap)
    return page(good, bad, made)


def page(good: Adapter, bad: Adapter, made: Ready) -> str:
    """HTML of a case: the answer of one method solid, that of the other transparent."""
    from wholebody.view.viewer import Viewer

    problem = made.case.problem
    right, wrong = (adapter.make(*DEFAULT).solve(problem).q for adapter in (good, bad))
    with Viewer(problem.scene, title=f"{made.case.set} {made.case.number}") as viewer:
        viewer.ghosts([right])
        viewer.show(wrong, problem=problem)
        with Scratch() as folder:
            return viewer.save(folder / "scene.html").read_text(encoding="utf-8")


SCENES = 6  # in a report; each is a hundred kilobytes or two


class Shown(NamedTuple):
    """A case to show.

    Attributes:
        set, number: which case.
        good, bad: methods whose answers are shown: the first solves it; the second does not, or is only slower.
        about: why it was chosen, in a sentence.
    """

    set: str
    number: int
    good: str
    bad: str
    about: str


def chosen(results: Results) -> list[Shown]:
    """At most one case a set, where a method is farthest from an answer; another method each time, if there is one."""
    shown: list[Shown] = []
    for family in results.sets:
        found = _candidates(results, family)
        if found and len(shown) < SCENES:
            seen = [one.bad for one in shown]
            shown.append(min(found, key=lambda pair: (seen.count(pair[1].bad), -pair[0]))[1])
    return shown


def _candidates(results: Results, family: str) -> list[tuple[float, Shown]]:
    """For every method that fails, how far it is from an answer where it is farthest, and that case."""
    if results.moving(family):
        return []
    good = _by_number(results, family, OURS) or _by_number(results, family, _most_successful(results, family))
    found = []
    for other in results.adapters:
        failing = [
            (_size(bad), Shown(family, number, good[number].method, other, _about(good[number], bad)))
            for number, bad in _by_number(results, family, other).items()
            if bad.answered and not bad.success(COARSE) and number in good and good[number].success(COARSE)
        ]
        found += [max(failing, key=lambda pair: pair[0])] if failing else []
    return found


def _size(record: Record) -> float:
    return min(max(record.penetration, record.missed), 1.0) + (1.0 if record.status == "solved" else 0.0)


def _about(good: Record, bad: Record) -> str:
    claim = f"says {bad.status!r}" if bad.status else "answers"
    faults = []
    if bad.missed > COARSE:
        faults.append(f"misses the goals by {1e3 * bad.missed:.0f} mm or mrad")
    if bad.penetration > COARSE:
        faults.append(f"is {1e3 * bad.penetration:.0f} mm inside of something")
    elif bad.broken > COARSE:
        faults.append(f"breaks what must hold by {1e3 * bad.broken:.1f} mm or mrad")
    return f"{good.method} solves it in {1e3 * good.seconds:.0f} ms; {bad.method} {claim} and {' and '.join(faults)}."


def _by_number(results: Results, family: str, adapter: str) -> dict[int, Record]:
    return {record.number: record for record in results.taken(family, adapter)}


def _most_successful(results: Results, family: str) -> str:
    def solved(adapter: str) -> int:
        return sum(record.success(COARSE) for record in results.default(family, adapter))

    return max(results.adapters, key=solved)

"""Meshcat scenes of the hardest solved and the easiest failed problems, packed so that a page can carry several."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import NamedTuple

from wholebody.base.files import Scratch
from wholebody.base.runner import ONE_THREAD, Child, EndedError, allow_processor
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.charts import groups
from wholebody.bench.suite.compare.examples import Example, Pair
from wholebody.bench.suite.compare.record import COARSE, DEFAULT
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.settings import seed_of
from wholebody.bench.suite.compare.solving import BUILDING, Ready, Which, case_of, solve
from wholebody.bench.suite.problem_sets.case import ProblemSet

OPENING = '<script id="picture" type="application/octet-stream">'
CLOSING = "</script>"


class Scene(NamedTuple):
    """A problem with a method's answer, as a page in two halves: what all pages have, and the picture.

    Attributes:
        shown: which problem, and what came of it.
        shell: HTML with `OPENING` and `CLOSING` around nothing.
        picture: base64 of a gzip of what belongs between them.
    """

    shown: Example
    shell: str
    picture: str

    @property
    def caption(self) -> str:
        """What it shows, in sentences."""
        return f"{self.shown.about} Transparent: {'the start' if self.shown.solved else 'the witness'}."


def chosen(results: Results, found: Mapping[tuple[str, str], Pair]) -> list[Example]:
    """Of every set that has no moving goals the hardest problem that is solved and the easiest that is failed.

    Among the methods of the first chart; one that has no posture is not drawn.
    """
    first = groups(results.adapters)[0] if results.adapters else ()
    listed: list[Example | None] = []
    for family in results.sets:
        mine = [] if results.moving(family) else [found[family, name] for name in first]
        solved = [pair.hardest for pair in mine if pair.hardest]
        failed = [pair.easiest for pair in mine if pair.easiest and pair.easiest.record.answered]
        listed.append(max(solved, key=attrgetter("difficulty"), default=None))
        listed.append(min(failed, key=attrgetter("difficulty"), default=None))
    return [one for one in listed if one is not None]


def in_brief(scenes: Sequence[Scene]) -> list[Scene]:
    """For a page of all sets: of each the problem that is failed, or the one that is solved where none is failed."""
    last = {scene.shown.record.set: scene for scene in scenes}
    return list(last.values())


def draw(
    shown: Sequence[Example], families: Mapping[str, ProblemSet], adapters: Mapping[str, Adapter], seed: int, cap: float
) -> list[Scene]:
    """Solve the chosen problems again and draw them.

    One is left out that cannot be drawn, or of which something else comes now than what was recorded.
    """
    child, scenes = Child(ONE_THREAD), []
    try:
        for example in sorted(shown, key=lambda one: (one.record.set, one.record.number)):
            record = example.record
            which = Which(families[record.set], record.number, seed_of(seed, record.number))
            try:
                page = child.call(drawn, which, adapters[record.method], example.solved, cap, seconds=BUILDING)
            except EndedError:
                continue
            if page:
                head, _, rest = page.partition(OPENING)
                picture, _, tail = rest.partition(CLOSING)
                packed = base64.b64encode(gzip.compress(picture.encode("ascii"), mtime=0)).decode("ascii")
                scenes.append(Scene(example, f"{head}{OPENING}{CLOSING}{tail}", packed))
    finally:
        child.close()
    order = [id(example) for example in shown]
    return sorted(scenes, key=lambda scene: order.index(id(scene.shown)))


def drawn(which: Which, adapter: Adapter, solved: bool, cap: float) -> str:
    """HTML of a problem with a method's answer, or "" where it is not as recorded; a job of a process of its own."""
    made = case_of(which)
    allow_processor(2.0 * cap)
    if solve(adapter, DEFAULT, made).success(COARSE) != solved:
        return ""
    return page(adapter, made, solved)


def page(adapter: Adapter, made: Ready, solved: bool) -> str:
    """HTML of a problem: the answer solid, and transparent the start, or the witness where the answer is none."""
    from wholebody.view.viewer import Viewer

    problem = made.case.problem
    answer = adapter.make(*DEFAULT).solve(problem).q
    with Viewer(problem.scene, title=f"{made.case.set} {made.case.number}") as viewer:
        viewer.ghosts([problem.start if solved else made.case.witness])
        viewer.show(answer, problem=problem)
        with Scratch() as folder:
            return viewer.save(folder / "scene.html").read_text(encoding="utf-8")

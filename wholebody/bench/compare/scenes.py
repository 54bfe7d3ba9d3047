"""Pages with Meshcat scenes of chosen cases, packed so that a report can carry several."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.compare.cases import Shown
from wholebody.bench.compare.record import DEFAULT
from wholebody.bench.compare.solving import BUILDING, Which, drawn
from wholebody.bench.problem_sets.case import ProblemSet
from wholebody.files import Scratch
from wholebody.runner import ONE_THREAD, Child, EndedError

if TYPE_CHECKING:
    from wholebody.bench.compare.solving import Ready

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
                which, pair = Which(families[case.set], case.number, seed), (adapters[case.good], adapters[case.bad])
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

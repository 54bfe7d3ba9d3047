"""`wb.reach_map`: which places of a grid a frame can reach among things."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.batches import JobOptions, Jobs, spread
from wholebody.base.errors import InputError
from wholebody.base.runner import packed
from wholebody.geometry.placement import FARTHEST
from wholebody.methods.base import Method, check_problem
from wholebody.methods.contradictions import contradictions
from wholebody.methods.qp.chain import takes_seeds
from wholebody.methods.qp.method import QP
from wholebody.methods.simplification import beyond_reach
from wholebody.methods.solve import as_method, warn_of_left_out
from wholebody.problem import Problem
from wholebody.studies.reach_result import BEYOND, EXCLUDED, INSIDE, MISSED, NOT_TRIED, REACHED, ReachMap
from wholebody.tasks import Point, inputs

if TYPE_CHECKING:
    from typing_extensions import Unpack

MOST_PLACES = 1_000_000
SURE = 0.95  # share of the distance to a missed place within which no place is searched: 1 trusts descents wholly
SLACK = 1e-6  # m: for rounding: a place that is out of reach by no more may be reached
LEAST_EDGE, MOST_EDGE = 2, 6  # places along an edge of a brick


class Search(NamedTuple):
    """A place to search."""

    place: int  # its number
    begin: int  # the reached place whose posture is the start; -1 for the problem's own start, and a whole solve
    at: Array  # (3,) metres
    start: Array  # (nq,)


class Try(NamedTuple):
    """A place that was searched."""

    place: int  # its number
    begin: int  # see `Search`
    reached: bool  # whether a posture was found
    inside: bool  # whether the place contradicts the constraints, so that it was not searched
    left: float  # distance to the nearest posture that was found, metres
    sure: bool  # whether the search says that there is nothing nearer, so that places within that distance are left out
    measure: float  # weighted sum of the measures at the posture
    q: Array  # (nq,) the posture


@dataclass(frozen=True)
class Asked:
    """The problem of every place."""

    problem: Problem  # its goals are met at every place too
    frame: str  # the frame that reaches
    offset: Array  # (3,) the point of the frame, in its axes
    whole: Method  # method of whole solves
    quick: Method  # method of those that begin at a neighbour

    def searched(self, search: Search) -> Try:
        """Search a place."""
        problem = self.problem.with_start(search.start)
        goal = Point(self.frame, search.at, offset=self.offset).resolve(problem.scene, problem.start)
        problem.goals = (*self.problem.goals, goal)
        with problem.borrow() as workspace:
            if contradictions(problem, workspace):
                return Try(search.place, search.begin, False, True, 0.0, False, 0.0, problem.start)
        solution = (self.whole if search.begin < 0 else self.quick).solve(problem)
        judged = solution.assessment
        # Only where the place is the only goal its residual is its distance from the reach. An arm may reach a place
        # beside in another configuration: there every place is searched from seeds.
        sure = not self.problem.goals and solution.status == "unreachable" and not takes_seeds(problem)
        return Try(
            search.place, search.begin, solution.solved, False, judged.goal_errors[-1], sure, judged.measure,
            np.asarray(solution.q),
        )  # fmt: skip


_known: dict[str, Asked] = {}


def search_places(sent: tuple[str, bytes, list[Search]]) -> list[Try]:
    """Search places, in any process; the problem is unpacked once a process."""
    key, packed_asked, searches = sent
    if key not in _known:
        _known.clear()
        _known[key] = pickle.loads(packed_asked)
    return [_known[key].searched(each) for each in searches]


def covered(places: Array, center: Array, radius: Array) -> Mask:
    """Which places (n, 3) are within a ball around a place that is out of reach by more."""
    inside = np.zeros(len(places), dtype=bool)
    for middle, size in zip(center, radius, strict=True):
        inside |= np.linalg.norm(places - middle, axis=1) < SURE * size
    return inside


class _Grid(NamedTuple):
    axes: tuple[Array, Array, Array]
    places: Array
    cells: Indices
    number: dict[tuple[int, int, int], int]

    def neighbours(self, place: int) -> list[int]:
        """Numbers of the up to six places beside a place."""
        i, j, k = self.cells[place].tolist()
        near = ((i - 1, j, k), (i + 1, j, k), (i, j - 1, k), (i, j + 1, k), (i, j, k - 1), (i, j, k + 1))
        return [self.number[at] for at in near if at in self.number]

    def beside(self, marked: Mask) -> Indices:
        """(places,) how many of the places beside each are marked."""
        padded = np.pad(marked.reshape([len(axis) for axis in self.axes]).astype(np.intp), 1)
        counts = [np.roll(padded, way, axis)[1:-1, 1:-1, 1:-1] for axis in range(3) for way in (1, -1)]
        return np.asarray(np.sum(counts, axis=0).ravel())


def reach_map(
    problem: Problem,
    frame: str,
    low: Any,
    high: Any,
    step: Any = 0.1,
    *,
    offset: Any = (0.0, 0.0, 0.0),
    method: str | Method | None = None,
    **running: Unpack[JobOptions],
) -> ReachMap:
    """Find which places of a grid a point of a frame can reach, with everything that a problem asks.

    Each place is solved from the posture of a reached neighbour, for chains from seeds too. Not searched are places
    beyond the lengths of the limbs from what is held, places inside of things, and, of figures that are no chain,
    places within the distance by which a search of another place missed, unless a place beside is reached. The
    answer is the same whatever `jobs` is. A place counts as reached only with a posture that the assessment of
    `wb.solve` accepts; a place counts as missed after local searches, so that a way in between things that no
    neighbour leads to may be overlooked.

    Args:
        problem: figure, things, start, constraints; its goals are met at every place too.
        frame: the frame that reaches.
        low: (3,) least corner of the grid, metres.
        high: (3,) greatest corner; equal values make a plane or a line.
        step: metres between places, one or for each axis.
        offset: (3,) the point of the frame that reaches, in its axes.
        method: of the solves, name or settings; None for `wb.methods.QP(measures=False)`, with quicker settings where a
            neighbour is reached. A given method solves all places: `wb.methods.QP()` minimises the measures too.
        running: `jobs`: processes; `cluster`: address of a dask scheduler, None for this machine; `progress`: called
            with the numbers of settled and of all places; if it returns True, the search ends, and the other places
            are not tried. True in place of a function prints a line that counts.

    Raises:
        InputError: a value of the wrong kind or range, or more than a million places.
        UnknownNameError: no such frame or method.
        MissingPackageError: dask is not installed.
        WholebodyError: the cluster does not answer.

    Examples:
        >>> found = wb.reach_map(problem, "right_index_tip", (0.3, -0.3, 1.0), (0.5, -0.1, 1.0), 0.2)
        >>> found.verdict.shape
        (2, 2, 1)
    """
    what = "reach_map"
    check_problem(problem, f"{what}: problem").check_fresh()
    inputs.find_place(problem.scene, frame, what)
    point = inputs.point(offset, f"{what}: offset")
    grid = _grid(low, high, step)
    if method is None:
        whole: Method = QP(measures=False)
        quick: Method = QP(measures=False, budget=0, iterations=30)  # from a neighbour's posture, or from seeds
    else:
        whole = quick = warn_of_left_out(as_method(method), 2, problem)
    checks.keywords(running, JobOptions, what)
    asked = Asked(problem, frame, point, whole, quick)
    search = _Search(asked, grid, Jobs.checked(what, **running))
    search.run()
    return search.answer()


class _Search:
    """The waves of one map, and what is known of each place: places beside reached ones are searched from these."""

    def __init__(self, asked: Asked, grid: _Grid, running: Jobs) -> None:
        self._asked, self._grid = asked, grid
        self._jobs, self._cluster, self._progress = running
        count = len(grid.places)
        least = beyond_reach(asked.problem, asked.frame, asked.offset, grid.places)
        self._verdict = np.where(least > SLACK, BEYOND, NOT_TRIED).astype(np.int8)
        self._left = np.where(least > SLACK, least, 0.0)
        self._measure = np.zeros(count)
        self._q: dict[int, Array] = {}
        self._tried: dict[int, set[int]] = {}  # places from which each was tried
        self._balls: dict[int, float] = {}
        self._solves, self._from_neighbours, self._settled, self._over = 0, 0, 0, False
        self._bricks = _bricks(grid)
        self._sent = packed(asked)
        self._key = sha256(self._sent).hexdigest()

    def run(self) -> None:
        """All waves."""
        while not self._over and (wave := self._wave()):
            self._search(wave)
            self._settle()

    def answer(self) -> ReachMap:
        """What was found."""
        shape = tuple(len(axis) for axis in self._grid.axes)
        model = self._asked.problem.scene.model
        postures = np.tile(self._asked.problem.start, (len(self._verdict), 1))
        for place, q in self._q.items():
            postures[place] = q
        x, y, z = self._grid.axes
        return ReachMap(
            self._asked.problem, self._asked.frame, x, y, z, self._verdict.reshape(shape),
            self._left.reshape(shape), self._measure.reshape(shape), postures.reshape((*shape, model.nq)), self._solves,
            int(self._from_neighbours),
        )  # fmt: skip

    def _wave(self) -> list[Search]:
        """What is searched next: of each brick the places beside reached ones, or one; and missed places once more."""
        from scipy.spatial import cKDTree

        places, reached, pairs = self._grid.places, self._verdict == REACHED, list[tuple[int, int]]()
        beside, known = self._grid.beside(reached), np.flatnonzero(reached)
        nearest, apart = np.full(len(places), -1), np.full(len(places), np.inf)  # of what is not reached
        if len(known):
            some = np.flatnonzero(np.isin(self._verdict, (NOT_TRIED, MISSED)))
            apart[some], at = cKDTree(places[known]).query(places[some])
            nearest[some] = known[at]
        for members in self._bricks:
            free = members[self._verdict[members] == NOT_TRIED]
            near = free[beside[free] > 0].tolist()
            pairs += [(place, next(k for k in self._grid.neighbours(place) if reached[k])) for place in near]
            if len(free) and not near:
                middle = np.linalg.norm(places[free] - places[members].mean(axis=0), axis=1)
                one = int(free[np.argmax(apart[free] if len(known) else -middle)])
                pairs.append((one, int(nearest[one])))
        for place in np.flatnonzero(self._verdict == MISSED).tolist():
            tried = self._tried[place]
            if len(tried) == 4:  # more finds more behind things, and takes longer at the border of the reach
                continue
            if beside[place] >= 4:  # 3 reaches 2 of 226 places more for an eighth more solves
                starts = [k for k in self._grid.neighbours(place) if reached[k]]
            else:  # a reached place is nearer than what the missed one was missed by
                starts = [int(nearest[place])] if apart[place] < SURE * self._left[place] else []
            pairs += [(place, begin) for begin in starts if begin not in tried][:1]
        start = self._asked.problem.start
        return [Search(place, begin, places[place], self._q.get(begin, start)) for place, begin in pairs]

    def _search(self, wave: Sequence[Search]) -> None:
        """Search places beside each other, and take down in their order what was found."""
        open_, found = self._verdict == NOT_TRIED, list[Try]()
        settled = len(open_) - int(open_.sum())
        size = max(1, min(16, len(wave) // (4 * self._jobs)))
        sent = ((self._key, self._sent, [*wave[k : k + size]]) for k in range(0, len(wave), size))
        if self._ended(settled):
            return
        answers = spread(search_places, sent, self._jobs, self._cluster)
        try:
            for tries in answers:
                found += tries
                settled += int(open_[[one.place for one in tries]].sum())
                if self._ended(settled):
                    break
        finally:
            answers.close()  # type: ignore[attr-defined]
        for one in sorted(found, key=lambda one: one.place):
            self._take(one)

    def _ended(self, settled: int) -> bool:
        """Tell how many places are settled, and take down whether the caller ends the search."""
        self._settled = max(self._settled, settled)  # a reached place may show that others were left out wrongly
        self._over = self._progress is not None and self._progress(self._settled, len(self._verdict)) is True
        return self._over

    def _take(self, one: Try) -> None:
        place = one.place
        self._tried.setdefault(place, set()).add(one.begin)
        self._solves += not one.inside
        if one.reached:
            self._from_neighbours += self._verdict[place] == MISSED
            if self._verdict[place] != REACHED or one.measure < self._measure[place]:
                self._verdict[place], self._left[place], self._measure[place] = REACHED, 0.0, one.measure
                self._q[place] = one.q
            self._balls.pop(place, None)
        elif one.inside:
            self._verdict[place] = INSIDE
        elif self._verdict[place] != REACHED:
            nearer = self._verdict[place] != MISSED or one.left < self._left[place]
            if nearer:
                self._verdict[place], self._left[place], self._q[place] = MISSED, one.left, one.q
            if one.sure and nearer:
                self._balls[place] = one.left

    def _settle(self) -> None:
        """Leave out what is within the distance by which a search missed, unless a reached place disproves it."""
        places, reached = self._grid.places, np.flatnonzero(self._verdict == REACHED)
        for place, left in list(self._balls.items()):
            if len(reached) and np.linalg.norm(places[reached] - places[place], axis=1).min() < SURE * left:
                del self._balls[place]
        centers = np.array([places[place] for place in self._balls]).reshape(-1, 3)
        radii = np.array(list(self._balls.values()))
        free = np.flatnonzero(np.isin(self._verdict, (NOT_TRIED, EXCLUDED)))
        # a descent may have missed by too much: what is beside a reached place is searched from there
        out = covered(places[free], centers, radii) & (self._grid.beside(self._verdict == REACHED)[free] == 0)
        self._verdict[free] = np.where(out, EXCLUDED, NOT_TRIED)
        for place in free[out].tolist():
            near = radii - np.linalg.norm(centers - places[place], axis=1)
            self._left[place] = max(float(near.max()), 0.0)


def _bricks(grid: _Grid) -> list[Indices]:
    """The places in bricks of equal edges; their size depends on the number of places alone."""
    dimensions = max(sum(len(axis) > 1 for axis in grid.axes), 1)
    # about how many there are of many places: more = more whole solves, fewer = less to do beside each other
    edge = (len(grid.places) / 64) ** (1.0 / dimensions)
    size = int(min(max(round(edge), LEAST_EDGE), MOST_EDGE))
    keys = grid.cells // size
    order: dict[tuple[int, ...], list[int]] = {}
    for place, key in enumerate(map(tuple, keys.tolist())):
        order.setdefault(key, []).append(place)
    return [np.array(members, dtype=np.intp) for members in order.values()]


def _grid(low: Any, high: Any, step: Any) -> _Grid:
    what = "reach_map"
    least, most = checks.numbers(low, (3,), f"{what}: low"), checks.numbers(high, (3,), f"{what}: high")
    if (least > most).any() or max(np.abs(least).max(), np.abs(most).max()) > FARTHEST:
        raise InputError(
            f"{what}: low is {least.tolist()} and high {most.tolist()}; give the least corner first, metres"
        )
    if checks.array(step, f"{what}: step", "metres, one number or three").ndim == 0:
        steps = np.full(3, checks.number(step, f"{what}: step", 1e-4, FARTHEST, "m"))
    else:
        steps = checks.numbers(step, (3,), f"{what}: step")
    if (steps < 1e-4).any():
        raise InputError(f"{what}: step is {steps.tolist()}; give 0.0001 m or more")
    wide = most > least
    if wide.any() and (steps[wide] > (most - least)[wide]).all():
        size = ", ".join(f"{length:.4g}" for length in most - least)
        raise InputError(
            f"reach_map: step is {checks.shown(step)} m and the grid measures {size} m; give a smaller step"
        )
    counts = np.floor((most - least) / steps + 1e-9) + 1
    if np.prod(counts) > MOST_PLACES:
        raise InputError(f"{what}: {np.prod(counts):.3g} places; give a greater step, at most {MOST_PLACES} places fit")
    x, y, z = (start + size * np.arange(int(n)) for start, size, n in zip(least, steps, counts, strict=True))
    places = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.stack(np.meshgrid(*(np.arange(int(n)) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    number = {(i, j, k): place for place, (i, j, k) in enumerate(index.tolist())}
    return _Grid((x, y, z), places, index, number)

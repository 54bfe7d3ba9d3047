"""What is done every day, by processor and clock: reach maps, dragging in a browser, pictures and movies."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch
from wholebody.bench.report import render
from wholebody.tracking.live import LiveDrag
from wholebody.view.live_page import LivePage

CORNERS = (0.15, -0.75, 0.80), (0.90, 0.45, 1.25)  # m: of the grid over the desk
GRIDS = (5, 5, 2), (25, 20, 4), (40, 25, 10)  # places along x, y and z: 50, 2,000 and 10,000
DRAG_FRAMES = 300
BOXES = 20
MOVIE_FRAMES = 60
PICTURE, MOVIE = (960, 720), (640, 480)  # pixels
SEED = 5


@dataclass(frozen=True)
class DailyRow:
    """One measurement.

    Attributes:
        what: in words.
        count: places, frames or pictures.
        processes: that worked beside each other.
        cpu: seconds of the processor of all processes, of one map, frame or picture; the median of frames.
        p95: likewise, of frames; 0 where there is one measurement.
        clock: seconds by the clock, likewise; tells little on a machine that does other work.
        asked: seconds of the clock on two cores that are asked; 0 for none.
        told: counts of the outcome, in words.
    """

    what: str
    count: int
    processes: int
    cpu: float
    p95: float
    clock: float
    asked: float
    told: str


ASKED = {50: 3.0, 10_000: 90.0}  # s: of a reach map of so many places on two cores


def measure(part: str, *, quick: bool = False) -> Iterator[DailyRow]:
    """Measure one after the other.

    Args:
        part: "maps", "drag" or "pictures".
        quick: the smallest map, and few frames.
    """
    if part == "maps":
        yield from maps(GRIDS[:1] if quick else GRIDS)
    elif part == "drag":
        yield drag(20 if quick else DRAG_FRAMES)
    else:
        yield from pictures(4 if quick else MOVIE_FRAMES)


def maps(grids: Sequence[tuple[int, int, int]]) -> Iterator[DailyRow]:
    """Each map by one process and by two; the second tells how many times faster it was."""
    reach((2, 2, 2))  # loads what a first solve needs
    for counts in grids:
        one = reach(counts)
        yield one
        both = reach(counts, jobs=2)
        yield replace(both, told=f"{one.clock / both.clock:.2f} times as fast as by one; {both.told}")


def reach(counts: tuple[int, int, int], jobs: int = 1) -> DailyRow:
    """Map the right index finger of a seated woman over a desk with a monitor."""
    scene = wb.Scene(wb.load("human", sex="female", stature=1.65)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.70, 1.40, 0.03)), name="desk", at=(0.62, 0.0, 0.74))
    scene.add(wb.Box((0.03, 0.50, 0.32)), name="monitor", at=(0.72, 0.0, 0.98))
    held = [wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "sitting", constraints=held, clearance=0.005)
    low, high = np.array(CORNERS)
    before, began = processor_seconds(), time.perf_counter()
    found = wb.reach_map(problem, "right_index_tip", low, high, (high - low) / (np.array(counts) - 1), jobs=jobs)
    spent, clock = processor_seconds() - before, time.perf_counter() - began
    told = ", ".join(f"{count:,} {name}" for name, count in found.counts().items())
    places = int(np.prod(counts))
    asked = ASKED.get(places, 0.0) if jobs > 1 else 0.0
    return DailyRow("reach map", places, jobs, spent, 0.0, clock, asked, told)


def drag(frames: int) -> DailyRow:
    """Drag a person's right palm on a circle through 20 boxes; a step, contacts, and the messages to the page."""
    figure, rng = wb.load("human"), np.random.default_rng(SEED)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for number in range(BOXES):
        place = (rng.uniform(0.35, 0.9), rng.uniform(-0.9, 0.9), rng.uniform(0.2, 1.6))
        scene.add(wb.Box(tuple(rng.uniform(0.05, 0.15, 3))), name=f"box {number}", at=place)
    problem = wb.Problem(scene, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()])
    dragged, times, clocks, deepest = LiveDrag(problem), [], [], 0.0
    with Scratch() as folder:
        page = LivePage(dragged, folder / "posture.toml", 8471)
        try:
            dragged.take("right_palm")
            middle = dragged.place("right_palm") + (0.25, 0.0, 0.25)
            for turn in 2.0 * np.pi * np.arange(frames) / 100.0:
                target = middle + 0.3 * np.array((np.sin(turn), 0.5 * np.sin(2.0 * turn), -np.cos(turn)))
                before, began = time.thread_time(), time.perf_counter()
                frame = page.follow(target)
                times.append(time.thread_time() - before)
                clocks.append(time.perf_counter() - began)
                deepest = max(deepest, frame.overlap)
        finally:
            page.stop()
    p95 = float(np.quantile(times, 0.95))
    told = f"deepest overlap {1e3 * deepest:.4f} mm"
    return DailyRow("frame of a drag", frames, 1, median(times), p95, median(clocks), 1 / 60, told)


def pictures(frames: int) -> Iterator[DailyRow]:
    """Draw a person among things; all processes of Chromium count, and ffmpeg does not.

    Raises:
        InputError: this is no Linux, which tells what other processes spent.
    """
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for number in range(10):
        side = (-1) ** number
        scene.add(wb.Box((0.2, 0.2, 0.1 + 0.1 * number)), name=f"box {number}", at=(0.8, side * 0.25 * number, 0.6))
    first = figure.posture("standing")
    last = figure.with_joints(first, {"right_shoulder_flexion": 1.2, "left_elbow_flexion": 1.4})
    motion = [pin.interpolate(figure.model, first, last, share) for share in np.linspace(0.0, 1.0, frames)]
    with Scratch() as folder, wb.Viewer(scene) as viewer:
        viewer.show(first)
        viewer.picture(folder / "first.png", PICTURE)
        before, began = processor_seconds(), time.perf_counter()
        viewer.show(last)
        viewer.picture(folder / "later.png", PICTURE)
        spent, clock = processor_seconds() - before, time.perf_counter() - began
        yield DailyRow("picture after the first", 1, 1, spent, 0.0, clock, 1.5, "960 x 720")
        viewer.play(motion, 1 / 25)
        viewer.picture(folder / "begin.png", MOVIE)
        before, began = processor_seconds(), time.perf_counter()
        viewer.movie(folder / "motion.gif", MOVIE)
        spent, clock = (processor_seconds() - before) / frames, (time.perf_counter() - began) / frames
        yield DailyRow("picture of a movie", frames, 1, spent, 0.0, clock, 0.1, "640 x 480")


def processor_seconds() -> float:
    """Seconds of the processor that this process and all that descend from it have spent.

    Raises:
        InputError: there is no /proc.
    """
    if not Path("/proc/self/stat").is_file():
        raise InputError("measuring needs /proc, which tells what other processes spent; run it on Linux")
    parent, spent = {}, {}
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split() if entry.name.isdigit() else []
        except OSError:  # it has ended
            continue
        if fields:
            parent[int(entry.name)] = int(fields[1])
            spent[int(entry.name)] = sum(map(int, fields[11:15]))  # its own, and that of its children that have ended
    total = 0
    for process in parent:
        above = process
        while above in parent and above != os.getpid():
            above = parent[above]
        total += spent[process] if above == os.getpid() else 0
    return total / os.sysconf("SC_CLK_TCK")


def report(rows: list[DailyRow], facts: dict[str, str]) -> str:
    """Return the table as Markdown."""
    return render("daily.md", rows=rows, facts=facts)

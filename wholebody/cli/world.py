"""`wholebody world`: a figure follows a tracker among things that move by themselves."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import check_overlaps, scene_names, scene_options
from wholebody.cli.command import command, option

if TYPE_CHECKING:
    from wholebody.bench.measure.world_runs import WorldRow
    from wholebody.dynamics.overlaps import Overlap
    from wholebody.dynamics.scenes import WorldScene
    from wholebody.dynamics.world import WorldFrame


@command(
    "world",
    "let a hand or an avatar meet balls, boxes and dominoes that move by themselves",
    """\
Run a scene: a scripted tracker moves a hand or an avatar, and the things that it meets fall, roll, slide and bounce.
With a task file the figure stands as the file starts. Print a table of frame times, impacts and overlap. Write the
numbers of every frame (CSV), a chart of the energy and the frame times (PNG, SVG) and the animation (HTML, opens
without a network).""",
    *scene_options(
        "name of the scene, or all; or a task file whose objects have a density or a mass",
        "qp or ccd (default: qp)",
        "out/world",
    ),
    option("--picture", action="store_true", help="draw five moments too, by a headless Chromium"),
    epilog="""\
examples:
  wholebody world --list
  wholebody world flick
  wholebody world my_task.toml --frames 300
  wholebody world all --out out/world
exit code: 1 if pieces were deeper in each other than 0.1 mm after a frame, or a collision could not be avoided""",
)
def run(arguments: argparse.Namespace) -> int:
    """List the scenes, or run one or all."""
    from wholebody.base.files import check_writable, make_folder
    from wholebody.bench.machine import machine
    from wholebody.bench.measure.world_runs import report
    from wholebody.bench.tables import write_text
    from wholebody.dynamics.scenes import WORLD_SCENES

    names = scene_names(arguments, WORLD_SCENES, "world", files=True)
    if not names:
        return 0
    check_overlaps([arguments.overlap])
    make_folder(arguments.out)
    check_writable(arguments.out / f"{Path(names[0]).stem}.csv")
    facts = machine()
    rows = [_run_one(_scene(name, arguments), arguments, facts) for name in names]
    _print(rows)
    text = report(rows, facts)
    write_text(arguments.out / "world.md", text + "\n")
    print(f"wrote {arguments.out}")
    if arguments.update_docs is not None:
        _update(arguments, text, names)
    return 0 if all(row.deepest_mm <= 0.1 and not row.unavoided for row in rows) else 1  # mm


def _scene(name: str, arguments: argparse.Namespace) -> WorldScene:
    """The scene of a name, or that of a task file, whose figure stands as the file starts."""
    from wholebody.base.files import title_of
    from wholebody.dynamics.scenes import build_world_scene, standing_scene
    from wholebody.taskfile import read_task

    if name.endswith(".toml"):
        problem = read_task(name).problem
        # frames of a task file
        return standing_scene(title_of(name), problem.scene, problem.start, frames=arguments.frames or 180)
    return build_world_scene(name, frames=arguments.frames, seed=arguments.seed)


def _run_one(scene: WorldScene, arguments: argparse.Namespace, facts: dict[str, str]) -> WorldRow:
    from wholebody.bench.measure.world_runs import chart, frame_rows, summary
    from wholebody.bench.tables import write_rows
    from wholebody.cli.tables import progress_bar
    from wholebody.dynamics.overlaps import overlaps
    from wholebody.dynamics.world import World

    name = scene.name
    frames: list[WorldFrame] = []
    pushed: list[tuple[Overlap, ...]] = []
    with progress_bar() as bar:
        task = bar.add_task(name, total=len(scene.track))
        world = World(
            scene.scene, scene.track.q[0], dt=scene.track.dt, overlap=arguments.overlap, seed=arguments.seed
        )  # fmt: skip
        for tracked in scene.track.q:
            frames.append(world.step(tracked))
            pushed.append(overlaps(scene.scene, frames[-1].wanted))
            bar.update(task, completed=len(frames))
    drawing = _animation(scene, frames, pushed, arguments.out, arguments.picture)
    rows = frame_rows(name, frames, drawing, [sum(one.pairs for one in each) for each in pushed])
    write_rows(arguments.out / f"{name}.csv", facts, rows)
    chart(rows, scene.track.dt, arguments.out / name)
    for row in [row for row in rows if row.note][:5]:
        print(f"{name}, frame {row.frame}: {row.note}")
    return summary(len(frames[-1].placements), rows)


def _animation(
    scene: WorldScene, frames: list[WorldFrame], pushed: list[tuple[Overlap, ...]], out: Path, picture: bool
) -> list[float]:
    """Write the animation, with PD_g of what the spring wanted; the seconds that each frame takes to draw."""
    import time

    from wholebody.bench.measure.world_runs import moments
    from wholebody.view import Viewer
    from wholebody.view.filmstrip import write_filmstrip
    from wholebody.view.viewed_scene import ViewedWorld

    viewed = ViewedWorld(scene.scene, frames[-1].placements)
    postures = [viewed.configuration(frame.q, frame.placements) for frame in frames]
    with Viewer(viewed, contact_distance=0.0, see_through=scene.see_through, title=scene.name) as viewer:
        if scene.eye is not None and scene.target is not None:
            viewer.look(eye=scene.eye, target=scene.target)
        seconds = []
        for posture, overlaps in zip(postures, pushed, strict=True):
            began = time.perf_counter()
            viewer.show(posture, overlaps=overlaps)
            seconds.append(time.perf_counter() - began)
        viewer.play(postures, scene.track.dt, repeat=float("inf"), overlaps=pushed)
        viewer.save(out / f"{scene.name}.html")
        if picture:
            chosen = [postures[number] for number in moments(frames)]
            write_filmstrip(viewer, chosen, out / f"{scene.name}-film.png", (460, 420))  # pixels of a moment
    return seconds


def _update(arguments: argparse.Namespace, text: str, names: list[str]) -> None:
    """Write the table and the charts of figures 7 and 8 into the documentation."""
    import shutil

    from wholebody.bench.tables import replace_section

    docs = arguments.update_docs
    folder = docs / "assets" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    # a hand and an avatar, as figures 7 and 8 of the paper
    charted = [name for name in ("flick", "avatar_and_cartons") if name in names]
    for name in charted:
        shutil.copyfile(arguments.out / f"{name}.svg", folder / f"world-{name}.svg")
    pictures = [f"![Energy and frame time: {name}](assets/bench/world-{name}.svg)" for name in charted]
    replace_section(docs / "results.md", "world-scenes", "\n\n".join([*pictures, text]))
    print(f"wrote {docs / 'results.md'}")


def _print(rows: list[WorldRow]) -> None:
    from rich.console import Console

    from wholebody.cli.tables import table

    shown = table(
        "scene", "bodies", "frames", "median ms", "p99", "max", "impacts", "deepest mm", "not avoided",
        "energy J, first", "last",
    )  # fmt: skip
    for row in rows:
        shown.add_row(
            row.scene, str(row.bodies), str(row.frames), f"{row.median_ms:.2f}", f"{row.p99_ms:.2f}",
            f"{row.max_ms:.1f}", str(row.events), f"{row.deepest_mm:.4f}", str(row.unavoided),
            f"{row.first_energy:.3g}", f"{row.last_energy:.3g}",
        )  # fmt: skip
    console = Console(width=max(120, Console().width))
    console.print(shown)

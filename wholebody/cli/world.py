"""`wholebody world`: a figure follows a tracker among things that move by themselves."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, known
from wholebody.base.errors import InputError
from wholebody.base.files import check_writable, make_folder, title_of
from wholebody.bench.rows import Row, chart
from wholebody.bench.tables import machine, write_rows, write_text
from wholebody.cli.arguments import scene_names
from wholebody.cli.frames import frame_panels, moments, paper_report, world_rows
from wholebody.cli.tables import bar, print_rows
from wholebody.dynamics.live_world import LiveWorld
from wholebody.dynamics.world import WORLD_SCENES, World, WorldFrame, build_world_scene, standing_scene
from wholebody.taskfile import read_task
from wholebody.taskfile.task import View
from wholebody.tracking.loop import OVERLAPS
from wholebody.tracking.overlaps import GIVE_WAY, Overlap, overlaps
from wholebody.tracking.receiver import Receiver
from wholebody.tracking.scenes import InteractionScene
from wholebody.view import Viewer
from wholebody.view.live_page import LivePage
from wholebody.view.side_by_side import write_filmstrip
from wholebody.view.viewed_scene import ViewedWorld


def run(arguments: argparse.Namespace) -> int:
    """List the scenes, or run one or all."""
    names = scene_names(arguments, WORLD_SCENES, "world", files=True)
    if not names:
        return 0
    known(arguments.overlap, OVERLAPS, "way to remove overlap", "--overlap")
    choice(arguments.give_way, GIVE_WAY, "--give-way")
    if arguments.live:
        if len(names) > 1:
            raise InputError("--live shows one scene, not all; name one")
        return _live(_scene(names[0], arguments), arguments)
    for name in ("port", "udp"):
        if getattr(arguments, name) is not None:
            raise InputError(f"--{name} is of the live page; add --live or leave it out")
    make_folder(arguments.out)
    check_writable(arguments.out / f"{Path(names[0]).stem}.csv")
    facts = machine()
    rows = [_run_one(_scene(name, arguments), arguments, facts) for name in names]
    print_rows(rows)
    write_text(arguments.out / "world.md", paper_report("world_frames", rows, facts) + "\n")
    print(f"wrote {arguments.out}")
    return 0 if all(row["deepest mm"] <= 0.1 and not row["not avoided"] for row in rows) else 1  # mm


def _live(scene: InteractionScene, arguments: argparse.Namespace) -> int:
    """Let figure and things be dragged in a browser until Ctrl-C."""
    live = LiveWorld(scene.scene, scene.track.q[0], give_way=arguments.give_way)
    receiver = None if arguments.udp is None else Receiver(arguments.udp, live.handles)
    seen = {""}

    def places() -> Mapping[str, Array]:
        assert receiver is not None
        found = receiver.latest()
        if receiver.note not in seen and len(seen) < 20:
            seen.add(receiver.note)
            print(f"refused: {receiver.note}", flush=True)
        return found

    view = View(scene.eye, scene.target, scene.see_through)
    asked = None if receiver is None else places
    page = LivePage(live, arguments.out, arguments.port or 8080, places=asked, view=view)
    print(f"drag handles and things at {page.url}; Ctrl-C ends", flush=True)
    page.serve()
    if receiver is not None:
        receiver.close()
    return 0


def _scene(name: str, arguments: argparse.Namespace) -> InteractionScene:
    """The scene of a name, or that of a task file, whose figure stands as the file starts."""
    if name.endswith(".toml"):
        task = read_task(name)
        still = all(thing.body is None for thing in task.problem.scene.objects.values())
        if still and not arguments.live:  # on the page the figure and what stands are dragged
            raise InputError(
                f"{title_of(name)}: nothing moves by itself; give an object a density or a mass, or add --live"
            )
        # frames of a task file
        scene = standing_scene(title_of(name), task.problem.scene, task.problem.start, frames=arguments.frames or 180)
        return replace(scene, eye=task.view.eye, target=task.view.target, see_through=task.view.see_through)
    return build_world_scene(name, frames=arguments.frames, seed=arguments.seed)


def _run_one(scene: InteractionScene, arguments: argparse.Namespace, facts: dict[str, str]) -> Row:
    name = scene.name
    frames: list[WorldFrame] = []
    pushed: list[tuple[Overlap, ...]] = []
    with bar(name, len(scene.track)) as tell:
        world = World(
            scene.scene, scene.track.q[0], dt=scene.track.dt, overlap=arguments.overlap, seed=arguments.seed,
            give_way=arguments.give_way,
        )  # fmt: skip
        for tracked in scene.track.q:
            frames.append(world.step(tracked))
            pushed.append(overlaps(scene.scene, frames[-1].wanted, arguments.give_way))
            tell(len(frames), name)
    drawing = _animation(scene, frames, pushed, arguments.out, arguments.picture)
    inside = [sum(one.pairs for one in each) for each in pushed]
    summary, rows = world_rows(name, arguments.overlap, frames, drawing, inside)
    write_rows(arguments.out / f"{name}.csv", facts, rows)
    chart(frame_panels(rows, ("energy J",), ("ms", "queries ms")), arguments.out / name)
    for row in [row for row in rows if row["note"]][:5]:
        print(f"{name}, frame {row['frame']}: {row['note']}")
    return summary


def _animation(
    scene: InteractionScene, frames: list[WorldFrame], pushed: list[tuple[Overlap, ...]], out: Path, picture: bool
) -> list[float]:
    """Write the animation, with PD_g of what the spring wanted; the seconds that each frame takes to draw."""
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

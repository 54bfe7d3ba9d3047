"""`wholebody interact`: a tracked figure penetrates things frame by frame; the shown figure does not."""

from __future__ import annotations

import argparse
import gc
from pathlib import Path

from wholebody.base.checks import known
from wholebody.base.files import check_writable, make_folder
from wholebody.bench.rows import Row, chart
from wholebody.bench.tables import machine, write_rows, write_text
from wholebody.cli.arguments import scene_names
from wholebody.cli.frames import frame_panels, is_held, loop_rows, paper_report
from wholebody.cli.tables import bar, print_rows
from wholebody.tracking import Judgement, Recording, follow, judge
from wholebody.tracking.loop import OVERLAPS
from wholebody.tracking.scenes import SCENES, InteractionScene, build_scene
from wholebody.view import Viewer


def run(arguments: argparse.Namespace) -> int:
    """List the scenes, or run one or all."""
    names = scene_names(arguments, SCENES, "interact", files=False)
    if not names:
        return 0
    asked = list(OVERLAPS) if arguments.overlap == "all" else [arguments.overlap]
    chosen = [known(one, OVERLAPS, "way to remove overlap", "--overlap") for one in asked]
    make_folder(arguments.out)
    check_writable(arguments.out / f"{names[0]}.csv")
    facts, rows = machine(), []
    for name in names:
        scene = build_scene(name, frames=arguments.frames, seed=arguments.seed)
        rows += [_run_one(scene, overlap, arguments.seed, arguments.out, facts) for overlap in chosen]
    write_text(
        arguments.out / f"{arguments.scene}-{arguments.overlap}.md", paper_report("interact", rows, facts) + "\n"
    )
    print_rows(rows)
    print(f"wrote {arguments.out}")
    return 0 if all(map(is_held, rows)) else 1


def _run_one(scene: InteractionScene, overlap: str, seed: int, out: Path, facts: dict[str, str]) -> Row:
    with bar(label := f"{scene.name}, {overlap}", len(scene.track)) as tell:
        gc.collect()
        gc.freeze()  # otherwise the garbage collector visits all objects once in a run, which delays a frame by 80 ms
        recording = follow(
            scene.scene, scene.track, overlap=overlap, seed=seed, rigid=scene.rigid,
            progress=lambda done: tell(done, label),
        )  # fmt: skip
        tell(len(scene.track), "judging every pair of every frame")
        judged = judge(scene.scene, recording)
    row, frames = loop_rows(scene.name, recording, judged)
    name = f"{scene.name}-{overlap}"
    write_rows(out / f"{name}.csv", facts, frames)
    chart(frame_panels(frames, ("ms", "queries ms"), ("tracked deepest mm", "deepest mm")), out / name)
    _animation(scene, recording, out / f"{name}.html")
    _notes(recording, judged)
    return row


def _animation(scene: InteractionScene, recording: Recording, path: Path) -> None:
    with Viewer(scene.scene, see_through=scene.see_through, title=scene.name) as viewer:
        viewer.look(eye=scene.eye, target=scene.target)
        viewer.play(recording, ghost=recording.tracked, repeat=float("inf"))
        viewer.save(path)


def _notes(recording: Recording, judged: Judgement) -> None:
    """Print the first notes: no frame is lost silently."""
    noted = [note for note in recording.notes if note]
    for note in noted[:5]:
        print(note)
    if len(noted) > 5:
        print(f"... and {len(noted) - 5} frames more with a note; see the CSV file")
    for frame in judged.passed[:5]:
        print(f"frame {frame}: something passes through something on the motion to it")

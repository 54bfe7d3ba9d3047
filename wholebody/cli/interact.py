"""`wholebody interact`: a tracked figure penetrates things frame by frame; the shown figure does not."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import check_overlaps, scene_names, scene_options
from wholebody.cli.command import command

if TYPE_CHECKING:
    from wholebody.bench.measure.interaction import InteractionRow, WorstFrames
    from wholebody.tracking import InteractionScene, Judgement, Recording


@command(
    "interact",
    "follow a tracker frame by frame through a gallery without penetration",
    """\
Run a scene: a scripted tracker moves a hand or an avatar into walls, tables and itself, and the shown figure follows as
far as contact allows. Print a table of times and remaining overlap, assessed independently. Write the numbers of every
frame (CSV), a chart of the frame times (PNG, SVG) and the animation with the tracked posture as a ghost (HTML, opens
without a network).""",
    *scene_options("name of the scene, or all", "qp, ccd or all (default: qp)", "out/interact"),
    epilog="""\
examples:
  wholebody interact --list
  wholebody interact two_arms
  wholebody interact all --out out/interact
exit code: 1 if a frame overlaps by more than the tolerance, passes through something, or leaves a joint limit""",
)
def run(arguments: argparse.Namespace) -> int:
    """List the scenes, or run one or all."""
    from wholebody.base.files import check_writable, make_folder
    from wholebody.bench.machine import machine
    from wholebody.bench.measure.interaction import report
    from wholebody.bench.tables import write_text
    from wholebody.tracking import SCENES, build_scene
    from wholebody.tracking.loop import OVERLAPS

    names = scene_names(arguments, SCENES, "interact", files=False)
    if not names:
        return 0
    chosen = list(OVERLAPS) if arguments.overlap == "all" else [arguments.overlap]
    check_overlaps(chosen)
    make_folder(arguments.out)
    check_writable(arguments.out / f"{names[0]}.csv")
    if arguments.update_docs is not None:
        _check_pages(arguments.update_docs)
    facts, worst = machine(), []
    for name in names:
        scene = build_scene(name, frames=arguments.frames, seed=arguments.seed)
        worst += [_run_one(scene, overlap, arguments.seed, arguments.out, facts) for overlap in chosen]
    rows = [each.row for each in worst]
    text = report(rows, facts)
    label = f"{arguments.scene}-{arguments.overlap}"
    write_text(arguments.out / f"{label}.md", text + "\n")
    _print(rows)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is not None:
        _update(arguments.update_docs, text, worst, arguments.out)
    held = all(
        row.depth_mm <= 1.0 and not row.passed and max(row.limit_rad, row.cone_rad) < 1e-6 for row in rows
    )  # fmt: skip
    return 0 if held else 1


def _check_pages(docs: Path) -> None:
    """Check that the pages exist, before anything is computed."""
    from wholebody.base.errors import InputError

    for page in ("results.md", "where-methods-fail.md"):
        if not (docs / page).is_file():
            raise InputError(f"--update-docs {docs}: there is no {page} in it; give the folder that holds the pages")


def _run_one(
    scene: InteractionScene, overlap: str, seed: int, out: Path, facts: dict[str, str]
) -> WorstFrames:  # fmt: skip
    import gc

    from wholebody.bench.measure.interaction import frame_chart, frame_rows, summary, worst_frames
    from wholebody.bench.tables import write_rows
    from wholebody.cli.tables import progress_bar
    from wholebody.tracking import follow, judge

    with progress_bar() as bar:
        gc.collect()
        gc.freeze()  # otherwise the garbage collector visits all objects once in a run, which delays a frame by 80 ms
        task = bar.add_task(f"{scene.name}, {overlap}", total=len(scene.track))
        recording = follow(
            scene.scene, scene.track, overlap=overlap, seed=seed, rigid=scene.rigid,
            progress=lambda done: bar.update(task, completed=done),
        )  # fmt: skip
        bar.update(task, description="judging every pair of every frame")
        judged = judge(scene.scene, recording)
    rows = frame_rows(scene.name, recording, judged)
    write_rows(out / f"{scene.name}-{overlap}.csv", facts, rows)
    frame_chart(rows, out / f"{scene.name}-{overlap}")
    _animation(scene, recording, out / f"{scene.name}-{overlap}.html")
    _notes(recording, judged)
    worst = worst_frames(summary(scene.name, recording, judged), recording, judged)
    _picture(scene, recording, worst.picture, out / f"{scene.name}-{overlap}-frame.png")
    return worst


def _picture(scene: InteractionScene, recording: Recording, frame: int, path: Path) -> None:
    """Draw the frame that misses a requirement, with the tracked posture as a ghost; none if all are met."""
    from wholebody.base.errors import MissingPackageError
    from wholebody.view import Viewer

    path.unlink(missing_ok=True)
    if frame < 0:
        return
    with Viewer(scene.scene, see_through=scene.see_through, title=scene.name) as viewer:
        viewer.look(eye=scene.eye, target=scene.target)
        viewer.ghosts([recording.tracked[frame]])
        viewer.show(recording.q[frame])
        try:
            viewer.picture(path)
        except MissingPackageError as error:
            print(f"no picture of frame {frame}: {error}")


def _animation(scene: InteractionScene, recording: Recording, path: Path) -> None:
    from wholebody.view import Viewer

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
        print(f"frame {frame}: something passes through something on the way to it")


def _print(rows: list[InteractionRow]) -> None:
    from rich.console import Console

    from wholebody.bench.measure.interaction import PAPER
    from wholebody.cli.tables import table

    times = table(
        "scene", "overlap", "frames", "mean ms", "p95", "p99", "max", "CPU", "CPU p99",
        "joints", "iter", "IK %", "pairs", "queries %",
        title="per frame",
    )  # fmt: skip
    left = table(
        "scene", "overlap", "left mm", "tracked mm", "passed", "limits", "cones", "off rad", "root mm", "jerk",
        "tracked", "back after", "missed", title="what is left",
    )  # fmt: skip
    for row in rows:
        times.add_row(
            row.scene, row.overlap, str(row.frames), f"{row.mean_ms:.2f}", f"{row.p95_ms:.2f}", f"{row.p99_ms:.2f}",
            f"{row.max_ms:.1f}", f"{row.cpu_mean_ms:.2f}", f"{row.cpu_p99_ms:.2f}",
            f"{row.joints:.0f}", f"{row.iterations:.1f}", f"{row.ik_percent:.0f}",
            f"{row.tracked_pairs:.1f}", f"{row.query_percent:.0f}",
        )  # fmt: skip
        back = "never" if row.latest < 0 else f"{row.latest} frames" if row.returns else "no end"
        left.add_row(
            row.scene, row.overlap, f"{row.depth_mm:.4f}", f"{row.tracked_depth_mm:.0f}", str(row.passed),
            f"{row.limit_rad:.0e}", f"{row.cone_rad:.0e}", f"{row.distance_rad:.3f}", f"{row.root_distance_mm:.1f}",
            f"{row.jerk:.0f}", f"{row.tracked_jerk:.0f}", back, "; ".join(row.misses) or "nothing",
        )  # fmt: skip
    for scene, frames, ms, joints, turns, ik, pairs, queries in PAPER:
        times.add_row(scene, "paper", frames, ms, "", "", "", "", "", joints, turns, ik, pairs, queries)
    console = Console(width=max(150, Console().width))
    console.print(times)
    console.print(left)


def _update(docs: Path, text: str, worst: list[WorstFrames], out: Path) -> None:
    import shutil

    from wholebody.bench.measure.interaction import failures
    from wholebody.bench.tables import replace_section

    folder = docs / "assets" / "interaction"
    folder.mkdir(parents=True, exist_ok=True)
    charts, pictures = [], []
    for each in worst:
        scene, overlap = each.row.scene, each.row.overlap
        # scenes whose charts go into the documentation: those of figures 7 and 8 of the paper
        if scene in ("hand_on_table", "two_arms"):
            name = f"{scene}-{overlap}.svg"
            shutil.copyfile(out / name, folder / name)
            charts.append(f"![Frame time of {scene.replace('_', ' ')}](assets/interaction/{name})")
        name = f"{scene}-{overlap}-frame.png"
        (folder / name).unlink(missing_ok=True)
        if (out / name).is_file():
            shutil.copyfile(out / name, folder / name)
            pictures.append((each, f"assets/interaction/{name}"))
    replace_section(docs / "results.md", "interaction", "\n\n".join([text, *charts]))
    replace_section(docs / "where-methods-fail.md", "interaction-failures", failures(worst, pictures))
    print(f"wrote {docs / 'results.md'} and {docs / 'where-methods-fail.md'}")

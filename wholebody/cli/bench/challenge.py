"""`wholebody bench challenge`: a standing person is dragged down onto a chair."""

from __future__ import annotations

import argparse
from functools import partial
from itertools import chain
from typing import Any

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish

CAPTION = "Time of a frame and what is left to the goal, frame by frame"


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "challenge",
        help="a standing person dragged down onto a chair, by newton and qp",
        description="Drag a standing person down onto a chair by the pelvis, and judge every posture and way between.",
    )
    parser.add_argument("--frames", type=int, default=240, metavar="N", help="of the way (default: 240)")


def run(arguments: argparse.Namespace) -> int:
    """Measure the challenge."""
    from wholebody.bench import challenge
    from wholebody.bench.drag import drag_chart
    from wholebody.bench.machine import machine
    from wholebody.cli.demo import packaged_tasks

    frames = 60 if arguments.quick else arguments.frames
    check_count(frames, "--frames")
    facts = machine()
    rows, every = challenge.measure(packaged_tasks()[challenge.TASK], frames, print)
    tables: dict[str, list[Any]] = {"challenge": rows, "challenge-frames": list(chain.from_iterable(every.values()))}
    charts = {"challenge": Chart(partial(drag_chart, every), CAPTION)}
    publish("challenge", challenge.report(rows, facts), arguments, facts=facts, tables=tables, charts=charts)
    return 0

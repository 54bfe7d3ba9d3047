"""`wholebody bench challenge`: a standing person is dragged down onto a chair."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import add_common, check_count, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "challenge",
        help="a standing person dragged down onto a chair, by newton and qp",
        description="Drag a standing person down onto a chair by the pelvis, and judge every posture and way between.",
    )
    parser.add_argument("--frames", type=int, default=240, metavar="N", help="of the way (default: 240)")
    parser.set_defaults(run=run)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure the challenge."""
    from wholebody.bench import challenge
    from wholebody.bench.drag import drag_chart
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import write_rows
    from wholebody.cli.demo import packaged_tasks

    frames = 60 if arguments.quick else arguments.frames
    check_count(frames, "--frames")
    facts = machine()
    rows, every = challenge.measure(packaged_tasks()[challenge.TASK], frames, print)
    write_rows(arguments.out / "challenge.csv", facts, rows)
    write_rows(arguments.out / "challenge-frames.csv", facts, [row for method in every.values() for row in method])
    drawn = {"challenge": drag_chart(every, arguments.out / "challenge")}
    captions = {"challenge": "Time of a frame and what is left to the goal, frame by frame"}
    publish("challenge", challenge.report(rows, facts), drawn, captions, arguments)
    return 0

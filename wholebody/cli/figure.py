"""`wholebody figure`: describe a figure, or write a person of given size as a URDF."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from wholebody.cli.arguments import add_person, person_options
from wholebody.cli.command import command, option


@command(
    "figure",
    "describe a figure, or write a person as a URDF",
    """\
List the joints with their limits, the frames for goals, groups and postures of a figure:
human, avatar, hand, or the path of a URDF. With --out, write a person as a URDF instead.""",
    option("name", metavar="FIGURE", help="human, avatar, hand, or the path of a URDF"),
    add_person,
    option("--out", type=Path, metavar="FILE.urdf", help="write a person's URDF to this file"),
    epilog="""\
examples:
  wholebody figure human --sex female --stature 1.62 --mass 60
  wholebody figure human --sex female --stature 1.62 --mass 60 --out small-woman.urdf
  wholebody figure human --sex female --percentile 5 --age 60
  wholebody figure human --stature 1.80 --proportion sitting_height=0.96
  wholebody figure human --hands fingers --out with-fingers.urdf
  wholebody figure robot.urdf""",
)
def run(arguments: argparse.Namespace) -> int:
    """Describe or write."""
    from wholebody.cli.tables import show_figure
    from wholebody.figures import load

    options = person_options(arguments)
    if arguments.out is not None:
        return _write(arguments.name, options, arguments.out)
    show_figure(load(arguments.name, **options))
    return 0


def _write(name: str, options: dict[str, Any], out: Path) -> int:
    from wholebody.base.errors import InputError
    from wholebody.base.files import checked_ending
    from wholebody.figures.anthropometry import make_person
    from wholebody.figures.packaged_urdf import write_human

    if name != "human" or "detail" in options:
        raise InputError("--out writes the person in capsules; write: wholebody figure human --out FILE.urdf")
    checked_ending(out, "--out", "a person", (".urdf",))
    person = make_person(**{name: value for name, value in options.items() if name != "hands"})
    write_human(out, person, options.get("hands", "rigid"))
    print(f"wrote {out}: {person.sex}, {person.stature:.3f} m, {person.mass:.1f} kg")
    return 0

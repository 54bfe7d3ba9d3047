"""`wholebody bench human`: the person beside people."""

from __future__ import annotations

import argparse
import shutil

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring


def add_to(commands: Commands) -> None:
    """Add the command."""
    measuring(
        commands,
        run,
        "human",
        help="compare the person with people: sizes, ranges, self-contacts, everyday tasks",
        description="Measure the dimensions, circumferences and ranges of motion of the person beside those of people, "
        "bring parts of the body together, and solve thirteen everyday tasks. With --update-docs the page becomes "
        "docs/human.md, with a picture of each contact and task.",
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure; --quick measures one design case and three tasks, and draws nothing."""
    from wholebody.bench.human import Measured, figures, measure, page
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import write_text
    from wholebody.files import make_folder
    from wholebody.view.browser import find_chromium

    facts = machine()
    drawn = not arguments.quick and find_chromium() is not None
    pictures = arguments.out / "human"
    make_folder(pictures)
    found = None
    for told in measure(pictures if drawn else None, quick=arguments.quick):
        if isinstance(told, Measured):
            found = told
        else:
            print(told, flush=True)
    assert found is not None
    text = page(found, facts, pictures=drawn)
    write_text(arguments.out / "human.md", text)
    write_text(arguments.out / "human.json", figures(found, facts))
    print(f"wrote {arguments.out / 'human.md'} and human.json")
    if arguments.update_docs is not None:
        write_text(arguments.update_docs / "human.md", text)
        if drawn:
            folder = arguments.update_docs / "assets" / "human"
            make_folder(folder)
            names = [row.picture for row in found.contacts if row.drawn] + [row.picture for row in found.tasks]
            for name in names:
                shutil.copyfile(pictures / name, folder / name)
        print(f"wrote {arguments.update_docs / 'human.md'}")
    return 0

"""`wholebody doctor`: this installation examined."""

from __future__ import annotations

import argparse

from rich.markup import escape
from rich.table import Table

from wholebody.cli.examination import examine
from wholebody.cli.tables import console
from wholebody.version import __version__

_MARKS = {"works": "[green]works[/]", "absent": "[dim]absent[/]", "broken": "[red]broken[/]"}


def doctor(arguments: argparse.Namespace) -> int:
    """Examine and print; 1 if there are faults."""
    if arguments.clear_cache:
        from wholebody.geometry.mesh_cache import clear_cache  # loads what the examination may find broken

        state = clear_cache()
        print(f"removed {state.entries} meshes, {state.size / 2**20:.1f} MB, in {state.folder}")
        return 0
    shown = console()
    with shown.status("trying everything once (about ten seconds)"):
        report = examine()
    shown.print(f"[bold]wholebody {__version__}[/], {report.python}", highlight=False, soft_wrap=True)
    made = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for column in ("kind", "name", "", "detail", "to have it"):
        made.add_column(column, overflow="fold")
    for entry in report.entries:
        repair = entry.repair if entry.state != "works" else ""
        made.add_row(entry.kind, entry.name, _MARKS[entry.state], escape(entry.detail), escape(repair))
    shown.print(made)
    for fault, repair in report.faults:
        shown.print(f"[red]wrong:[/] {escape(fault)}\n  repair: {escape(repair)}", highlight=False, soft_wrap=True)
    if report.healthy:
        shown.print("[green]nothing is wrong[/]")
    return 0 if report.healthy else 1

"""`wholebody doctor` and `completion`: this installation examined, and completed in a shell."""

from __future__ import annotations

import argparse

from wholebody.cli.command import command, flag, option

_MARKS = {"works": "[green]works[/]", "absent": "[dim]absent[/]", "broken": "[red]broken[/]"}


@command(
    "doctor",
    "check this installation: versions, methods, QP solvers, tools",
    """\
Print the versions of all packages, use every method and QP solver once, and name wrong combinations of versions and
wrong search paths with their repairs. Print the folder and size of the cache of mesh pieces. The exit code is 1 if
something is wrong; an absent optional package is no fault.""",
    flag("--clear-cache", "empty the cache of mesh pieces, and end"),
)
def doctor(arguments: argparse.Namespace) -> int:
    """Examine and print; 1 if there are faults."""
    if arguments.clear_cache:
        from wholebody.geometry.mesh_cache import clear_cache

        state = clear_cache()
        print(f"removed {state.entries} meshes, {state.size / 2**20:.1f} MB, in {state.folder}")
        return 0
    from rich.markup import escape
    from rich.table import Table

    from wholebody.cli.tables import console
    from wholebody.doctor import examine
    from wholebody.version import __version__

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


SHELLS = ("bash", "zsh", "tcsh")


@command(
    "completion",
    "print the completion script of a shell",
    """\
Print a script with which a shell completes the commands and options of wholebody. It needs shtab:
pip install 'wholebody[completion]'. The script itself needs nothing and costs no time when the command starts.""",
    option("shell", choices=SHELLS, help="the shell"),
    epilog="""\
examples:
  wholebody completion bash > ~/.local/share/bash-completion/completions/wholebody
  wholebody completion zsh > ~/.zfunc/_wholebody""",
)
def completion(arguments: argparse.Namespace) -> int:
    """Print the script; raises MissingPackageError where shtab is not installed."""
    from wholebody.base.errors import MissingPackageError
    from wholebody.cli.main import parser

    try:
        import shtab
    except ImportError:
        raise MissingPackageError(
            "completion scripts need shtab, which is not installed; run: pip install 'wholebody[completion]'"
        ) from None
    print(shtab.complete(parser(), shell=arguments.shell))
    return 0

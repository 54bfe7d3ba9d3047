"""`wholebody bench export`: the problem sets as files that any program reads."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count

DESCRIPTION = """\
Write the problems of the sets as files that any program reads: JSON with a schema, the body as URDF, meshes as OBJ, two
seeds each (near: the start; far: random), what must hold, and apart from them a posture that solves each, with measures
of how hard it is. The same sets, number and seed give the same files. They are in the public domain (CC0)."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("export", help="the problem sets as files for any program", description=DESCRIPTION)
    parser.add_argument("folder", type=Path, metavar="DIR", help="a folder that does not exist yet")
    parser.add_argument("--sets", nargs="+", metavar="NAME", help="problem sets (default: all)")
    parser.add_argument("--per-set", type=int, metavar="N", help="problems of each set (default: 200)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all problems (default: 0)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Export."""
    from rich.console import Console
    from rich.progress import Progress

    from wholebody.bench.problem_sets.registry import CASES, SETS, problem_set
    from wholebody.bench.published.export import export
    from wholebody.errors import InputError

    sets = [problem_set(name) for name in dict.fromkeys(arguments.sets or SETS)]
    per_set = CASES if arguments.per_set is None else arguments.per_set
    check_count(per_set, "--per-set")
    if arguments.seed < 0:
        raise InputError(f"--seed is {arguments.seed}; give 0 or more")
    console = Console()
    with Progress(console=console) as bar:
        task = bar.add_task("writing", total=per_set * len(sets))
        index = export(
            sets, per_set, arguments.seed, arguments.folder, lambda name: bar.update(task, advance=1, description=name)
        )
    console.print(f"wrote {per_set * len(sets)} problems, listed in {index}", highlight=False, soft_wrap=True)
    return 0

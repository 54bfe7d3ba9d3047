"""`wholebody completion`: print a script that completes commands, options and files in a shell."""

from __future__ import annotations

import argparse

from wholebody.cli.command import command, option

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
def run(arguments: argparse.Namespace) -> int:
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

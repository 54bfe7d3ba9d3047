"""The command `wholebody bench`, run in this process."""

from __future__ import annotations

import argparse

from wholebody.cli.bench import group


def bench(*words: str) -> int:
    """Run `wholebody bench` with these words: the exit code; errors are raised."""
    parser = argparse.ArgumentParser()
    group.add_to(parser.add_subparsers())
    arguments = parser.parse_args(["bench", *words])
    return int(arguments.run(arguments))

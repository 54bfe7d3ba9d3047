"""The command `wholebody`: one file for each of its commands."""

from wholebody.cli.main import main

__all__ = ["main"]

"""How a command is declared: its words, its options and its function."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from wholebody.base.errors import InputError

Measure = Callable[[argparse.Namespace], "int | None"]
"""Runs a command; None is the exit code 0."""

Option = Callable[[argparse.ArgumentParser], object]  # adds itself to a parser


@dataclass(frozen=True)
class Command:
    """A command: its words as `argparse` shows them (line breaks stay), its options in order, and what runs it."""

    name: str
    help: str
    description: str
    epilog: str
    options: tuple[Option, ...]
    measure: Measure

    def add_to(self, commands: Any) -> None:
        """Add it to what `add_subparsers` of `argparse` makes."""
        lines = "\n" in self.description + self.epilog
        shape = argparse.RawDescriptionHelpFormatter if lines else argparse.HelpFormatter
        parser = commands.add_parser(
            self.name, help=self.help, description=self.description, epilog=self.epilog, formatter_class=shape
        )
        parser.set_defaults(run=self.run, checks=())
        for add in self.options:
            add(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """Check the options that have checks of their own, run it, and return the exit code."""
        for check in arguments.checks:
            check(arguments)
        return self.measure(arguments) or 0


def command(
    name: str, help: str, description: str, *options: Option, epilog: str = ""
) -> Callable[[Measure], Command]:  # fmt: skip
    """Make the decorated function a command."""
    return lambda measure: Command(name, help, description, epilog, options, measure)


def later(where: str) -> Measure:
    """What runs a command: a function of a module of `wholebody.cli`, such as "pose.run", imported for the call."""

    def measure(arguments: argparse.Namespace) -> int | None:
        found: int | None = _function(where)(arguments)
        return found

    return measure


def later_with_pictures(where: str, draws: Callable[[argparse.Namespace], bool]) -> Measure:
    """The same for a function that takes `Screenshots` too, whose browser starts before the imports if it draws."""

    def measure(arguments: argparse.Namespace) -> int | None:
        from wholebody.view.screenshot import Screenshots

        with Screenshots() as screenshots:
            if draws(arguments):
                screenshots.start()
            found: int | None = _function(where)(arguments, screenshots)
            return found

    return measure


def _function(where: str) -> Any:
    module, _, name = where.rpartition(".")
    return getattr(import_module(f"wholebody.cli.{module}"), name)


@dataclass(frozen=True)
class Group:
    """A command that has commands of its own, `members`, in the order of the help; `title` is that of their list."""

    name: str
    help: str
    description: str
    members: tuple[Command, ...]
    title: str = "commands"

    def add_to(self, commands: Any) -> None:
        """Add it, with its own commands, to a group of commands."""
        shape = argparse.RawDescriptionHelpFormatter
        parser = commands.add_parser(self.name, help=self.help, description=self.description, formatter_class=shape)
        kinds = parser.add_subparsers(title=self.title, metavar="COMMAND", required=True)
        for member in self.members:
            member.add_to(kinds)


def option(*names: str, **settings: Any) -> Option:
    """An option or an argument, as `ArgumentParser.add_argument` takes it."""
    return lambda parser: parser.add_argument(*names, **settings)


def _values(kind: type | None) -> Callable[..., Option]:
    """What declares options of a kind by name, how the help shows the value, the help and further settings."""
    taken = {} if kind is None else {"type": kind}
    return lambda name, shown, help, **settings: option(name, metavar=shown, help=help, **taken, **settings)


path, text, real, whole = (_values(kind) for kind in (Path, None, float, int))


def flag(name: str, help: str) -> Option:
    """An option without a value."""
    return option(name, action="store_true", help=help)


def count(name: str, default: int | None, help: str, least: int = 1) -> Option:
    """An option that counts things to do, `least` or more; the help says the default."""

    def add(parser: argparse.ArgumentParser) -> None:
        def check(arguments: argparse.Namespace) -> None:
            number = getattr(arguments, name.removeprefix("--").replace("-", "_"))
            if number is not None and number < least:
                raise InputError(f"{name} is {number}; give {least} or more")

        said = help if default is None or "(default" in help else f"{help} (default: {default})"
        parser.add_argument(name, type=int, default=default, metavar="N", help=said)
        checked(check)(parser)

    return add


def checked(check: Callable[[argparse.Namespace], None]) -> Option:
    """No option, but a check of those that were given, which comes before the command runs."""
    return lambda parser: parser.set_defaults(checks=(*parser.get_default("checks"), check))

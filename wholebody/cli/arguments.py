"""What the parsers of several commands share: the type of a group of commands, and the choice of a scene."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any, Protocol

from wholebody.errors import InputError, UnknownNameError


class Commands(Protocol):
    """A group of commands, as `argparse` makes it by `add_subparsers`."""

    def add_parser(self, name: str, /, **options: Any) -> argparse.ArgumentParser:
        """Add a command; the options are those of `argparse.ArgumentParser`, and `help`."""


def scene_names(arguments: argparse.Namespace, scenes: Mapping[str, str], command: str, *, files: bool) -> list[str]:
    """Names of the scenes to run; none if the list was asked for, which is printed.

    Args:
        arguments: with scene, list and seed.
        scenes: each scene and what it shows.
        command: name of the command, for messages.
        files: whether a task file may stand for a scene.

    Raises:
        InputError: no scene, or a negative seed.
        UnknownNameError: there is no such scene.
    """
    if arguments.list:
        for name, about in scenes.items():
            print(f"{name:20} {about}")
        return []
    if arguments.scene is None:
        raise InputError(f"name a scene: {', '.join(scenes)}, or all; see wholebody {command} --list")
    names = list(scenes) if arguments.scene == "all" else [arguments.scene]
    for name in names:
        if name not in scenes and not (files and name.endswith(".toml")):
            raise UnknownNameError("scene", name, scenes)
    if arguments.seed < 0:
        raise InputError(f"--seed is {arguments.seed}; give 0 or more")
    return names

"""What the parsers of several commands share: the parser itself, the options of a person, the choice of a scene."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from wholebody.base.batches import threads
from wholebody.base.checks import is_number
from wholebody.base.errors import InputError, UnknownNameError, suggestion
from wholebody.cli.command import Option, checked, count, flag, path, text, whole

JOINED = "X,Y,Z"  # how the help shows numbers that are joined by commas


class Parser(argparse.ArgumentParser):
    """A parser whose messages name the nearest known commands and options; -0.3,0.5,1.2 is a value."""

    def __init__(self, *given: Any, **settings: Any) -> None:
        super().__init__(*given, **settings)
        self._negative_number_matcher = re.compile(r"-[\d.][\d.,eE+-]*")  # or numbers joined by commas

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """As `argparse` does; what a command does not know is named with the options of that command."""
        found, rest = super().parse_known_args(args, namespace)
        for word in rest[:1]:
            if is_number(word) and any(option.metavar == JOINED for option in self._actions):
                self.error(f"{word} belongs to no option; join numbers by commas, such as 0.3,-0.4,1.0")
            if word.startswith("-") and not is_number(word):
                self.error(f"no option is called {word!r}; {suggestion(word, self._option_string_actions)}")
        return found, rest

    def error(self, message: str) -> NoReturn:
        """Print the usage and the message, and end with 2."""
        if wrong := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            word, choices = wrong[1], [choice.strip("'") for choice in wrong[2].split(", ")]
            message = f"{message}; {suggestion(word, choices)}"
        super().error(message)


PERSON = ("sex", "stature", "mass", "percentile", "proportions", "age", "shoes", "clothing", "detail", "hands")
"""Options of `wb.load` that `add_person` adds."""


def add_person(parser: Any) -> None:
    """Add the options of a person to a parser or a group of arguments; those that are not given are None."""
    parser.add_argument("--sex", choices=("male", "female"), help="sex of a person (default: male)")
    parser.add_argument("--stature", type=float, metavar="M", help="height of a person, m (default: median)")
    parser.add_argument("--mass", type=float, metavar="KG", help="mass of a person, kg (default: from the stature)")
    parser.add_argument("--percentile", type=float, metavar="P", help="of stature and mass if not given, 1 to 99")
    parser.add_argument(
        "--proportion", action="append", dest="proportions", metavar="NAME=M",
        help="a dimension of a person, m, such as sitting_height=0.93; the others follow; repeated",
    )  # fmt: skip
    parser.add_argument("--age", type=float, metavar="YEARS", help="of a person, 17 to 69: ranges of motion, size")
    parser.add_argument("--shoes", type=float, metavar="M", help="thickness of soles of a person, m (default: 0)")
    parser.add_argument("--clothing", type=float, metavar="M", help="thickness of cloth on trunk and limbs, m")
    parser.add_argument(
        "--detail", choices=("spheres", "capsules", "hulls"), help="detail of the geometry (default: capsules)"
    )
    parser.add_argument("--hands", choices=("rigid", "fingers"), help="of a person: one segment each, or fingers")


def person_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `wb.load` that were given; raises InputError for a proportion without name or number."""
    given = {name: value for name in PERSON if (value := getattr(arguments, name)) is not None}
    if "proportions" in given:
        proportions = {}
        for text in given["proportions"]:
            name, _, size = text.partition("=")
            try:
                proportions[name] = float(size)
            except ValueError:
                raise InputError(f"--proportion is {text!r}; give NAME=METRES such as sitting_height=0.93") from None
        given["proportions"] = proportions
    return given


def _at_once(arguments: argparse.Namespace) -> None:
    arguments.at_once = arguments.jobs or (threads(arguments.cluster) if arguments.cluster else 1)


JOBS: tuple[Option, ...] = (
    count("--jobs", None, "cases at a time (default: 1, or all of the cluster)"),
    text("--cluster", "ADDRESS", "of a dask scheduler, such as tcp://10.0.0.1:8786"),
    checked(_at_once),
)
"""How many cases are done `at_once`, and where; a cluster that does not answer is refused before anything is done."""


OF_WORK = {
    "static": "the posture is held for minutes",
    "repeated": "the action is repeated more than four times a minute",
    "shock": "the load comes with a shock",
    "unstable": "the base is unstable, or the posture changes rapidly",
    "arms_supported": "the arms rest on something",
    "walking": "the person walks",
}
"""Flags about the work that ergonomics score, with their help."""


def scene_options(scene: str, overlap: str, out: str) -> tuple[Option, ...]:
    """Options of a command that runs scenes with a scripted tracker: help of two, and the folder if none is given."""
    return (
        text("scene", "SCENE", scene, nargs="?"),
        flag("--list", "list the scenes"),
        text("--overlap", "METHOD", overlap, default="qp"),
        whole("--frames", "N", "number of frames (default: the whole script, once)"),
        count("--seed", 0, "seed of all random numbers", least=0),
        path("--out", "DIR", f"folder (default: {out})", default=Path(out)),
    )


def scene_names(arguments: argparse.Namespace, scenes: Mapping[str, str], command: str, *, files: bool) -> list[str]:
    """Names of the scenes to run, or of task files if `files`; none if the list was asked for, which is printed."""
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
    return names

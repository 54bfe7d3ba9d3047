"""Commands that the pages print: each is understood, and what it names exists."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from wholebody.cli.main import parser


def printed(root: Path) -> dict[str, list[str]]:
    """Command -> the pages that print it; comments are left out."""
    found: dict[str, list[str]] = {}
    for page in [*sorted(root.glob("*.md")), *sorted(root.glob("docs/**/*.md")), *sorted(root.glob("examples/*.md"))]:
        for block in re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            for line in re.findall(r"^\$ (.*)$", block, re.MULTILINE):
                found.setdefault(re.sub(r"\s+(# |> ).*", "", line).strip(), []).append(page.name)
    return found


def test_every_command_of_the_pages_is_understood(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commands = [command for command in printed(root) if command.startswith("wholebody ")]
    assert len(commands) > 30
    for command in commands:
        try:
            parser().parse_args(shlex.split(command)[1:])
        except SystemExit:
            pytest.fail(f"{command}: {capsys.readouterr().err}")


def test_what_else_the_pages_run_exists(root: Path) -> None:
    targets = re.findall(r"^([a-z-]+):", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for command, pages in printed(root).items():
        first, *rest = shlex.split(command)
        if first == "make":
            assert rest[0] in targets, (command, pages)
        if first == "python" and rest[0].startswith("examples/"):
            assert (root / rest[0]).is_file(), (command, pages)


def test_inline_commands_name_known_options(root: Path) -> None:
    """`wholebody COMMAND --option` in a sentence: its options are among those that the command's help lists."""
    known: dict[str, str] = {}
    for page in [root / "README.md", *sorted(root.glob("docs/**/*.md"))]:
        for command in re.findall(r"`wholebody ([a-z]+[^`\n]*)`", page.read_text(encoding="utf-8")):
            words = [word for word in re.findall(r"\S+", command) if not word[0].isupper()]
            names = [word for word in words[:2] if re.fullmatch(r"[a-z][a-z-]+", word)]
            if names[:1] not in (["bench"], ["clip"]):
                names = names[:1]
            key = " ".join(names)
            if key not in known:
                known[key] = _help(names)
            for option in re.findall(r"--[a-z-]+", command):
                assert option in known[key], (page.name, command)


def _help(names: list[str]) -> str:
    """What a command prints with --help."""
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.suppress(SystemExit):
        parser().parse_args([*names, "--help"])
    return told.getvalue()

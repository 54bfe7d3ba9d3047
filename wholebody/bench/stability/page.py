"""The page "Where methods fail": case by case, with pictures, what is asked and what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.machine import sentence
from wholebody.bench.stability.case import HardCase, Kind
from wholebody.bench.stability.pictures import Drawn
from wholebody.bench.stability.rows import Result
from wholebody.bench.stability.verdict import WORDS
from wholebody.bench.tables import markdown

CHART = "stability.svg"
FAULT = (
    "In these cells the answer was bad, but the tool alone, without our adapter, does better on the same case. "
    "They say something about our adapter and nothing about the tool."
)


def report(result: Result, facts: Mapping[str, str]) -> str:
    """The result in short: the counts, the cases by methods, and every wrong cell."""
    return "\n\n".join(
        [
            _counts(result),
            _matrix(result),
            _cells(result, "wrong", "No answer was wrong."),
            *_adapters(result),
            sentence(facts),
        ]
    )


def page(result: Result, adapters: Sequence[Adapter], facts: Mapping[str, str], drawn: Drawn, folder: str) -> str:
    """The section of the page that is written by the command.

    Args:
        result: all cells.
        adapters: who was asked.
        facts: of the machine.
        drawn: pictures by case.
        folder: of the pictures, relative to the page.
    """
    parts = [
        f"![{len(result.cases)} cases by {len(result.methods)} methods: a colour and a sign a cell]({folder}/{CHART})",
        _counts(result),
        _setups(adapters),
    ]
    group = ""
    for case in result.cases:
        if case.group != group:
            group = case.group
            parts.append(f"## {group}")
        parts += _case(case, result, drawn.get(case.name, []), folder)
    parts += [
        "## Every wrong answer",
        _cells(result, "wrong", "No answer was wrong."),
        *_adapters(result),
        sentence(facts),
    ]
    return "\n\n".join(parts)


def _counts(result: Result) -> str:
    rows = [
        [
            f"`{method}`",
            *(str(result.count(method, kind)) for kind in ("solved", "honest", "refusal", "adapter")),
            _strong(result.count(method, "wrong")),
            str(result.acceptable(method)),
        ]
        for method in result.methods
    ]
    columns = ["method", *WORDS.values(), "acceptable"]
    return markdown(columns, rows) + f"\n\nOf {len(result.cases)} cases each."


def _strong(count: int) -> str:
    return f"**{count}**" if count else "0"


def _matrix(result: Result) -> str:
    rows = [[case.name, *(_brief(result, case.name, method) for method in result.methods)] for case in result.cases]
    return markdown(["case", *result.methods], rows)


def _brief(result: Result, case: str, method: str) -> str:
    verdict = result.verdicts[case, method]
    return f"{verdict.symbol} {verdict.brief}".strip()


def _adapters(result: Result) -> list[str]:
    """The cells in which our adapter is at fault, and what the tool alone does; nothing where there are none."""
    found = _cells(result, "adapter", "")
    return ["## Where our adapters are at fault", FAULT, found] if found else []


def _cells(result: Result, kind: Kind, none: str) -> str:
    """All cells of a kind, one a line, or what is said where there are none."""
    rows = [
        [f"`{method}`", f"`{case.name}`", result.verdicts[case.name, method].figure]
        for method in result.methods
        for case in result.cases
        if result.verdicts[case.name, method].kind == kind
    ]
    if not rows:
        return none
    head = ["method", "case", "what is wrong"]
    lines = [head, ["---", "---", "---"], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _setups(adapters: Sequence[Adapter]) -> str:
    lines = [
        "How each method was set up; the others are called by adapters of this project, and may do better alone:",
        "",
    ]
    for adapter in adapters:
        differences = "; ".join(adapter.differences)
        lines.append(f"- `{adapter.name}`: {adapter.setup}" + (f" Besides: {differences}." if differences else ""))
    return "\n".join(lines)


def _case(case: HardCase, result: Result, pictures: Sequence[tuple[Path, str]], folder: str) -> list[str]:
    parts = [f"### {case.title}", case.why, f"*Acceptable.* {case.acceptable}"]
    parts += [f"![{case.title}: {caption}]({folder}/{path.name})\n*{caption}*" for path, caption in pictures]
    rows = []
    for symbol, words, methods in _alike(case, result):
        rows.append([f"{symbol} {words}", ", ".join(f"`{method}`" for method in methods)])
    lines = [["verdict", "methods"], ["---", "---"], *rows]
    return [*parts, "\n".join("| " + " | ".join(line) + " |" for line in lines)]


def _alike(case: HardCase, result: Result) -> list[tuple[str, str, list[str]]]:
    """Methods with the same verdict in one line, in the order in which they were asked."""
    found: dict[tuple[str, str], list[str]] = {}
    for method in result.methods:
        verdict = result.verdicts[case.name, method]
        words = WORDS[verdict.kind] + (f": {verdict.figure}" if verdict.figure else "")
        found.setdefault((verdict.symbol, words), []).append(method)
    return [(symbol, words, methods) for (symbol, words), methods in found.items()]
